"""The layers of the package: which package may import which, and which module prints."""

import ast
import importlib.util
import re
import runpy
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "winchcascade"

LAYERS = (
    {"core"},
    {"ingest"},
    {"reduction", "rig"},
    {"diagnosis"},
    {"tables", "comparison", "blind", "design", "sea"},
    {"report"},
    {"batch"},
    {"cli"},
)
"""Packages from the lowest to the highest layer: a package imports itself and the layers below
its own.
"""

ENTRY_POINTS = {"__init__.py", "__main__.py"}
"""Modules of the top level: the public names and `python -m winchcascade`."""

PATTERNS = {
    "glossary": "symbols of physics, signs and units of texts that are set on a page",
    "check_record": "characters that XML forbids",
    "wording": "symbols of physics, signs and units of sentences that are set on a page",
}
"""Modules of `report` that may search texts by a pattern, and which texts."""

FILES = sorted(PACKAGE.rglob("*.py"))
LAYER = {package: number for number, packages in enumerate(LAYERS) for package in packages}


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Imports and calls of a file."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom | ast.Call)]


@cache
def imported(path: Path) -> list[str]:
    """Modules that a file imports, at the top or inside a function."""
    found = []
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom) and node.module:
            found += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
    return [name for name in found if name.split(".")[0] == "winchcascade"]


def test_every_module_is_in_a_package_of_the_layers() -> None:
    places = [path.relative_to(PACKAGE).parts for path in FILES]
    assert {place[0] for place in places if len(place) == 1} == ENTRY_POINTS
    assert {place[0] for place in places if len(place) > 1} == set(LAYER)


def test_a_package_imports_only_from_the_layers_below_its_own() -> None:
    for path in FILES:
        package, *rest = path.relative_to(PACKAGE).parts
        if not rest:
            continue
        for name in imported(path):
            other = name.split(".")[1] if "." in name else "the public names"
            below = other in LAYER and LAYER[other] < LAYER[package]
            assert other == package or below, f"{path.relative_to(PACKAGE)} imports {name}"


def test_no_modules_import_each_other_in_a_circle() -> None:
    names = {
        ".".join(("winchcascade", *path.relative_to(PACKAGE).with_suffix("").parts)): path
        for path in FILES
    }
    graph = {
        name: {other for other in imported(path) if other in names} - {name}
        for name, path in names.items()
    }
    TopologicalSorter(graph).prepare()


def test_the_picture_of_the_layers_is_drawn_from_the_present_imports() -> None:
    docs = PACKAGE.parent / "docs"
    assert runpy.run_path(str(docs / "layers.py"))["picture"]() == (docs / "layers.svg").read_text(
        encoding="utf-8"
    )


def test_no_two_modules_share_a_name() -> None:
    names = Counter(path.stem for path in FILES if path.stem != "__init__")
    assert [name for name, times in names.items() if times > 1] == []


def test_only_the_command_line_prints_and_uses_typer() -> None:
    for path in FILES:
        if path.relative_to(PACKAGE).parts[0] != "cli":
            source = path.read_text(encoding="utf-8")
            assert "typer" not in source, path
            calls = [n for n in nodes_of(path) if isinstance(n, ast.Call)]
            assert not any(isinstance(c.func, ast.Name) and c.func.id == "print" for c in calls), (
                path
            )


def test_no_report_reads_the_package_s_own_sentences_by_a_pattern() -> None:
    """Results come as data, of which `report` alone makes sentences; patterns are for texts that
    others wrote.
    """
    for path in sorted((PACKAGE / "report").glob("*.py")):
        if path.stem not in PATTERNS:
            names = {
                alias.name
                for node in nodes_of(path)
                if isinstance(node, ast.Import)
                for alias in node.names
            }
            assert "re" not in names, (
                f"{path.name}: read a field of the result in place of its sentence"
            )


IMPORT = re.compile(r"^[ >.]*from (winchcascade[\w.]*) import ([\w, ]+)", re.MULTILINE)
"""An import in a page, or in a text that a script gives another process: neither mypy nor ruff
reads those.
"""


def test_what_pages_and_scripts_import_exists() -> None:
    root = PACKAGE.parent
    files = [
        *(root / "benchmarks").glob("*.py"),
        *(root / "docs").glob("*.md"),
        *root.glob("*.md"),
        root / ".ci/run",
    ]
    for path in sorted(files):
        for module, names in IMPORT.findall(path.read_text(encoding="utf-8")):
            found = importlib.import_module(module)
            for name in (words.split()[0] for words in names.split(",")):
                assert hasattr(found, name) or importlib.util.find_spec(f"{module}.{name}"), (
                    f"{path.name}: {module}.{name}"
                )
