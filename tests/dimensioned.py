"""Constants of modules that have a dimension, by the unit in brackets at the end of their notes."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "winchcascade"

PURE = {"1", "sigma"}
"""Units of numbers without a dimension."""


def dimensioned(*folders: str, but: tuple[str, ...] = ()) -> dict[str, str]:
    """Constants of the modules in some folders of the package with the unit of their note, where
    this is a dimension.

    Parameters
    ----------
    but : folders within these that are left out
    """
    left_out = tuple(PACKAGE / folder for folder in but)
    modules = (path for folder in folders for path in sorted((PACKAGE / folder).rglob("*.py")))
    return {
        f"{'.'.join(path.relative_to(PACKAGE).with_suffix('').parts)}.{name}": ", ".join(units)
        for path in modules
        if not any(path.is_relative_to(folder) for folder in left_out)
        for name, note in _noted(ast.parse(path.read_text(encoding="utf-8")))
        if (units := [unit for unit in re.findall(r"\[([^\[\]`]+)\]", note) if unit not in PURE])
    }


def _noted(module: ast.Module) -> Iterator[tuple[str, str]]:
    """Constants of a module that hold numbers, with the note that follows them."""
    for statement, following in zip(module.body, module.body[1:], strict=False):
        targets = statement.targets if isinstance(statement, ast.Assign) else []
        if isinstance(statement, ast.AnnAssign):
            targets = [statement.target]
        note = following.value if isinstance(following, ast.Expr) else None
        if (
            isinstance(note, ast.Constant)
            and isinstance(note.value, str)
            and _holds_numbers(statement)
        ):
            names = (
                node.id
                for target in targets
                for node in ast.walk(target)
                if isinstance(node, ast.Name)
            )
            yield from ((name, note.value) for name in names if name.isupper())


def _holds_numbers(statement: ast.stmt) -> bool:
    """Whether a number or another constant takes part in a value, and not only words."""
    parts = list(ast.walk(statement))
    numbers = any(
        isinstance(node, ast.Constant) and isinstance(node.value, int | float) for node in parts
    )
    return numbers or any(
        isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) for node in parts
    )
