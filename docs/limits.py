"""A hook of the site: tables of the constants and of the modules, made from the code itself.

A page holds a marker such as `<!-- limits: diagnosis/judge -->` or `<!-- modules: diagnosis -->`
on a line of its own. MkDocs calls `on_page_markdown`, which puts the table in its place.
`PYTHONPATH=. python docs/limits.py diagnosis/judge` prints one.
"""

from __future__ import annotations

import ast
import importlib
import itertools
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "winchcascade"

MARKER = re.compile(r"^<!-- (limits|modules): ([\w/.]+) -->$", re.MULTILINE)


class Limit(NamedTuple):
    """A constant of a module: its names, its value as text, and what its docstring says of it."""

    module: str
    names: tuple[str, ...]
    value: str
    about: str


def on_page_markdown(markdown: str, **_: object) -> str:
    """Put tables in the places of the markers of a page."""
    return MARKER.sub(lambda found: TABLES[found[1]](found[2]), markdown)


def limits_table(place: str) -> str:
    """The constants of a module or of a folder of modules, as a table in Markdown."""
    rows = [
        f"| {', '.join(f'`{name}`' for name in limit.names)} | {limit.value} | {limit.about} "
        f"| `{limit.module}` |"
        for file in files_of(place)
        for limit in limits_of(file)
    ]
    return "\n".join(["| constant | value | what it is | module |", "|---|---|---|---|", *rows])


def modules_table(place: str) -> str:
    """The modules of a folder with the first sentence of each, as a table in Markdown."""
    rows = []
    for file in files_of(place):
        about = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
        first = plain(about.partition("\n\n")[0])
        rows.append(f"| `{name_of(file)}` | {first} |")
    return "\n".join(["| module | what it does |", "|---|---|", *rows])


TABLES = {"limits": limits_table, "modules": modules_table}


def files_of(place: str) -> list[Path]:
    """A module of the package, or all modules below a folder of it."""
    path = PACKAGE / place
    files = [path] if path.suffix else sorted(path.rglob("*.py"))
    return [file for file in files if file.name != "__init__.py"]


def name_of(file: Path) -> str:
    """Name of a module within the package, such as `diagnosis/judge/alarms`."""
    return file.relative_to(PACKAGE).with_suffix("").as_posix()


def limits_of(file: Path) -> Iterator[Limit]:
    """Constants of a module that are numbers and have a docstring, in the order of the file."""
    module = importlib.import_module(f"winchcascade.{name_of(file).replace('/', '.')}")
    body = ast.parse(file.read_text(encoding="utf-8")).body
    for statement, below in itertools.pairwise(body):
        about = docstring(below)
        names = assigned(statement)
        values = [getattr(module, name) for name in names]
        if about and names and all(map(is_number, values)):
            yield Limit(name_of(file), names, ", ".join(map(text_of, values)), plain(about))


def assigned(statement: ast.stmt) -> tuple[str, ...]:
    """Public names in capitals that a statement assigns to."""
    if isinstance(statement, ast.AnnAssign):
        targets: list[ast.expr] = [statement.target]
    elif isinstance(statement, ast.Assign):
        targets = statement.targets
    else:
        return ()
    names = [
        node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)
    ]
    return tuple(names) if all(re.fullmatch(r"[A-Z][A-Z0-9_]*", name) for name in names) else ()


def docstring(statement: ast.stmt) -> str:
    """Text of a statement that is only a text."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        value = statement.value.value
        return value if isinstance(value, str) else ""
    return ""


def is_number(value: Any) -> bool:
    """Whether a value is a number, or consists of numbers and names alone."""
    if isinstance(value, Mapping):
        return bool(value) and all(is_number(item) for item in value.values())
    if isinstance(value, tuple):
        numbers = [item for item in value if not isinstance(item, str)]
        return bool(numbers) and all(map(is_number, numbers))
    return isinstance(value, int | float) and not isinstance(value, bool)


def text_of(value: Any) -> str:
    """A value as a reader writes it: six digits, entries of a mapping one by one."""
    if isinstance(value, Mapping):
        return "; ".join(f"{text_of(key)}: {text_of(item)}" for key, item in value.items())
    if isinstance(value, tuple):
        return " ".join(map(text_of, value))
    return value if isinstance(value, str) else f"{value:.6g}"


def plain(text: str) -> str:
    """A docstring on one line, in which nothing ends a cell of a table or begins an element."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


if __name__ == "__main__":
    sys.stdout.write(f"{limits_table(sys.argv[1])}\n")
