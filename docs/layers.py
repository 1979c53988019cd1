"""Draw the layers of the package and what imports what, from the imports in its modules.

`python docs/layers.py` writes docs/layers.svg.
"""

import ast
from collections import Counter
from html import escape
from pathlib import Path

HERE = Path(__file__).parent
PACKAGE = HERE.parent / "winchcascade"

PACKAGES = {
    "cli": "the commands",
    "batch": "campaigns: plan, store, run, dataset",
    "report": "tables, figures, pages, files",
    "blind": "trials on an independent twin",
    "comparison": "differences between two sets of results",
    "design": "other loads, speeds and runs",
    "sea": "the corrected rig in waves",
    "tables": "published tables: check and audit",
    "diagnosis": "why model and measurement differ",
    "rig": "the rig as a model, and its effects",
    "reduction": "logs to energies and efficiencies",
    "ingest": "files to a checked run",
    "core": "run, units, files, errors, jobs",
}
"""Packages from the highest layer to the lowest, and what each is for."""

ROW, CELL, NAMES, TOP = 40, 46, 330, 100
"""Height of a row, width of a column, width of the boxes and height of the heads. [px]"""


def imports() -> dict[str, Counter[str]]:
    """Number of modules of a package that import another package."""
    found: dict[str, Counter[str]] = {package: Counter() for package in PACKAGES}
    for package, others in found.items():
        for path in sorted((PACKAGE / package).rglob("*.py")):
            nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            modules = {
                node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module
            }
            parts = {
                module.split(".")[1] for module in modules if module.startswith("winchcascade.")
            }
            others.update(parts - {package})
    return found


def picture() -> str:
    """The picture as SVG: one row and one column for each package, a dot where modules of the
    row import the column.
    """
    found, order = imports(), list(PACKAGES)
    width, height = NAMES + CELL * len(order) + 20, TOP + ROW * len(order) + 20
    maximum = max(max(others.values(), default=1) for others in found.values())
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'font-family="sans-serif" font-size="13">',
        "<title>Layers of the package: which package imports which</title>",
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
    ]
    for column, name in enumerate(order):
        x = NAMES + CELL * column + CELL / 2
        lines.append(
            f'<text transform="translate({x + 4:g} {TOP - 10}) rotate(-60)" '
            f'fill="#333333">{name}</text>'
        )
    for row, name in enumerate(order):
        y = TOP + ROW * row
        files = len([path for path in (PACKAGE / name).rglob("*.py") if path.stem != "__init__"])
        lines += [
            f'<rect x="10" y="{y + 3}" width="{NAMES - 20}" height="{ROW - 6}" rx="4" '
            f'fill="#e8eef5" stroke="#4a6a8a"/>',
            f'<text x="20" y="{y + 18}" font-weight="bold" fill="#1b2b3a">{name}'
            f'<tspan font-weight="normal" fill="#555555" font-size="11"> {files} '
            f"modules</tspan></text>",
            f'<text x="20" y="{y + 32}" font-size="11" '
            f'fill="#333333">{escape(PACKAGES[name])}</text>',
        ]
        for column, other in enumerate(order):
            x, middle = NAMES + CELL * column + CELL / 2, y + ROW / 2
            if other == name:
                lines.append(
                    f'<rect x="{x - 15:g}" y="{middle - 15:g}" width="30" height="30" '
                    f'fill="#d0d7de"/>'
                )
            elif times := found[name][other]:
                radius = 4.0 + 10.0 * (times / maximum) ** 0.5
                lines.append(
                    f'<circle cx="{x:g}" cy="{middle:g}" r="{radius:.1f}" fill="#4a6a8a"/>'
                )
                lines.append(
                    f'<text x="{x:g}" y="{middle + 4:g}" text-anchor="middle" font-size="10" '
                    f'fill="#ffffff">{times}</text>'
                )
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    (HERE / "layers.svg").write_text(picture(), encoding="utf-8")
