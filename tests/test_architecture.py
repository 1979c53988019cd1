"""The house: which room may import which."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "winchcascade"

GROUND = {
    "accuracy", "errors", "quantity", "channels", "run", "campaign", "rigfile", "rigtoml", "table", "tabletoml", "tomltext",
    "tasks", "plaintext", "files", "integrate", "order", "smooth", "threads", "addresses",
    "marks", "origin", "scratch", "signals", "store",
}  # fmt: skip
"""Open to every room."""

MAY_IMPORT = {
    "ingest": set(),
    "phases": set(),
    "cascade": {"phases"},
    "published": {"cascade"},
    "rig": set(),
    "effects": {"rig"},
    "fit": {"rig", "phases"},
    "gap": {"cascade", "fit"},
    "diagnose": {"gap", "rig"},
    "reach": {"published", "diagnose"},
    "blind": {"ingest", "diagnose"},
    "report": {"phases", "cascade", "published", "rig", "gap", "diagnose", "reach", "blind"},
    "batch": {"ingest", "cascade", "diagnose", "report"},
}
"""Rooms and the rooms they may import directly; the right includes what the imported room may import."""

MAY_IMPORT["commands"] = set(MAY_IMPORT)
"""The commands may import every room, and none may import them."""

DOORS = {"cli.py", "__main__.py", "__init__.py"}
"""Files by which one enters the house: open to nobody inside, and each may import what it opens."""


def rooms_open_to(room: str) -> set[str]:
    reached, waiting = {room}, [room]
    while waiting:
        for other in MAY_IMPORT[waiting.pop()] - reached:
            reached.add(other)
            waiting.append(other)
    return reached


def imports(path: Path) -> set[str]:
    """Rooms (or ground-floor files) of this package that a file imports, at the top or inside a function."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        found |= {name.split(".")[1] for name in names if name.startswith("winchcascade.")}
    return found


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_a_file_imports_only_rooms_that_are_open_to_it(path: Path) -> None:
    place = path.relative_to(PACKAGE).parts
    if place[0] in DOORS:
        return
    room = place[0] if len(place) > 1 else None
    allowed = GROUND | (rooms_open_to(room) if room else set())
    assert imports(path) <= allowed


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_file_stands_in_a_room_or_on_the_ground_floor(path: Path) -> None:
    place = path.relative_to(PACKAGE).parts
    top = DOORS | {f"{name}.py" for name in GROUND}
    assert place[0] in top if len(place) == 1 else place[0] in MAY_IMPORT


def test_only_the_command_line_prints_and_knows_typer() -> None:
    for path in FILES:
        if path.relative_to(PACKAGE).parts[0] not in ("cli.py", "commands"):
            source = path.read_text(encoding="utf-8")
            assert "typer" not in source, path
            calls = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Call)]
            assert not any(isinstance(c.func, ast.Name) and c.func.id == "print" for c in calls), path
