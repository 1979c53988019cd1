"""A table of a report as a file of its own: CSV with numbers in full, LaTeX and Markdown with those of the page."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence

from winchcascade.report.digits import PLUS_MINUS, NumberText
from winchcascade.report.report_model import SUBSCRIPTS
from winchcascade.report.table_model import Cell, Table

ENDINGS = ("csv", "tex", "md")
"""Files of a table."""


def table_files(table: Table, label: str, *, subscripts: Sequence[str] = SUBSCRIPTS) -> dict[str, str]:
    """The files of a table by their ending.

    Parameters
    ----------
    label : by which a LaTeX document refers to the table
    subscripts : what may stand low behind a letter and an underscore
    """
    return {
        "csv": csv_text(table),
        "tex": latex_text(table, label, subscripts),
        "md": markdown_text(table),
    }


def heads(table: Table) -> list[str]:
    """Names of the columns with their units; a column that only has a sign is named after the one before it."""
    names: list[str] = []
    for k, name in enumerate(table.head):
        full = f"{table.head[k - 1]} {name}" if name == "±" and k else name
        names.append(f"{full} ({table.units[k]})" if table.units[k] else full)
    return names


# ---------------------------------------------------------------------------------------------------------------- as CSV
def csv_text(table: Table) -> str:
    """A table as CSV: one head with units, numbers in full, an interval in columns of its own, nothing for what is unknown."""
    rows = table.values or table.rows
    columns = [_spread(name, [row[k] for row in rows]) for k, name in enumerate(heads(table))]
    names = _apart([name for names, _ in columns for name in names])
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    for i in range(len(rows)):
        writer.writerow([_written(cell) for _, cells in columns for cell in cells[i]])
    return out.getvalue()


def _spread(name: str, cells: Sequence[Cell]) -> tuple[list[str], list[list[Cell]]]:
    """The columns that hold the values of one: number, ends of the interval, and the unit where rows differ in it."""
    texts = [cell for cell in cells if isinstance(cell, NumberText)]
    most, united = max((len(text.values) for text in texts), default=1), any(text.unit for text in texts)
    ends = [f"{name}, low", f"{name}, high"]
    if any(text.form == PLUS_MINUS for text in texts):
        ends = [name, f"{name}, standard uncertainty"]
    names = {1: [name], 2: ends, 3: [name, *ends]}[most]
    rows: list[list[Cell]] = []
    for cell in cells:
        own = list(cell.values) if isinstance(cell, NumberText) else [cell]
        unit = [cell.unit if isinstance(cell, NumberText) else ""] if united else []
        rows.append([*own, *[None] * (most - len(own)), *unit])
    return [*names, *([f"{name}, unit"] if united else [])], rows


def _apart(names: Sequence[str]) -> list[str]:
    """Names of columns, numbered where one comes again, so that each is found by its name."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name}, {seen[name]}")
    return found


def _written(cell: Cell) -> str:
    if cell is None or cell == "–":
        return ""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return str(cell)
    return "" if math.isnan(cell) else repr(float(cell))


# -------------------------------------------------------------------------------------------------------------- as LaTeX
def latex_text(table: Table, label: str, subscripts: Sequence[str] = SUBSCRIPTS) -> str:
    """A table for LaTeX with the package booktabs: names and units in the head, rows that summarise below a line."""
    kinds = "".join("l" if k in table.text_columns else "r" for k in range(len(table.head)))

    def row(cells: Sequence[str]) -> str:
        return f"    {' & '.join(latex(cell, subscripts) for cell in cells)} \\\\"

    rows = [row(cells) for cells in table.rows]
    if table.summary:
        rows.insert(len(rows) - table.summary, "    \\midrule")
    units = [row([f"({unit})" if unit else "" for unit in table.units])] if any(table.units) else []
    lines = [
        "% Requires \\usepackage{booktabs}.",
        "\\begin{table}",
        "  \\centering",
        f"  \\caption{{{latex(table.caption, subscripts)}}}",
        f"  \\label{{tab:{re.sub(r'[^A-Za-z0-9-]+', '-', label).strip('-')}}}",
        f"  \\begin{{tabular}}{{{kinds}}}",
        "    \\toprule",
        row(table.head),
        *units,
        "    \\midrule",
        *rows,
        "    \\bottomrule",
        "  \\end{tabular}",
        *([f"  \\par\\smallskip {latex(table.note, subscripts)}"] if table.note else []),
        "\\end{table}",
    ]
    return "\n".join(line.rstrip() for line in lines) + "\n"


_SPECIAL = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': r"\textquotedbl{}",
    "\u2212": "$-$", "–": "--", "—": "---", "\u00a0": "~", "…": r"\dots{}", "·": r"$\cdot$", "×": r"$\times$", "±": r"$\pm$",
    "≤": r"$\leq$", "≥": r"$\geq$", "√": r"$\surd$", "°": r"$^{\circ}$", "→": r"$\rightarrow$", "∞": r"$\infty$",
    "µ": r"$\mu$", "μ": r"$\mu$", "η": r"$\eta$", "τ": r"$\tau$", "ρ": r"$\rho$", "ω": r"$\omega$", "Ω": r"$\Omega$",
    "Δ": r"$\Delta$", "σ": r"$\sigma$", "α": r"$\alpha$", "β": r"$\beta$", "φ": r"$\varphi$", "λ": r"$\lambda$",
}  # fmt: skip
"""What LaTeX writes for a character that means something else to it, or that its usual fonts do not hold."""

_RAISED = dict(zip("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", strict=True))
_GREEK = {"η": r"\eta", "τ": r"\tau"}


def latex(text: str, subscripts: Sequence[str] = SUBSCRIPTS) -> str:
    r"""A text for LaTeX: special characters escaped, symbols with their subscripts and raised numbers in mathematics.

    >>> print(latex("E_line"), latex("50 % of a_b & c"), latex("2.5×10⁻¹³"))
    $E_{\mathrm{line}}$ 50 \% of a\_b \& c 2.5$\times$10$^{-13}$
    """
    symbol = rf"\b(?P<letter>[EPFvpητ])_(?P<low>{'|'.join(map(re.escape, subscripts))})\b"
    parts, at = [], 0
    for found in re.finditer(f"{symbol}|(?P<raised>[{''.join(_RAISED)}]+)", text):
        parts.append(_escaped(text[at : found.start()]))
        at = found.end()
        if found["raised"]:
            parts.append(f"$^{{{''.join(_RAISED[c] for c in found['raised'])}}}$")
        else:
            low = found["low"].replace("_", r"\_").replace(" ", r"\ ")
            parts.append(f"${_GREEK.get(found['letter'], found['letter'])}_{{\\mathrm{{{low}}}}}$")
    return "".join([*parts, _escaped(text[at:])])


def _escaped(text: str) -> str:
    return "".join(_SPECIAL.get(c, c) for c in re.sub(r"\s+", " ", text))


# ------------------------------------------------------------------------------------------------------------ as Markdown
def markdown_text(table: Table) -> str:
    """A table for Markdown, under its caption and above its note; what would be markup is escaped."""
    rules = [":---" if k in table.text_columns else "---:" for k in range(len(table.head))]
    lines = [f"**Table.** {markdown(table.caption)}", ""]
    lines += [_line([markdown(head) for head in heads(table)]), _line(rules)]
    lines += [_line([markdown(cell) for cell in row]) for row in table.rows]
    lines += ["", markdown(table.note)] if table.note else []
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def markdown(text: str) -> str:
    r"""A text for Markdown.

    >>> print(markdown("a_b | *c*"))
    a\_b \| \*c\*
    """
    return re.sub(r"([\\`*_{}\[\]<>|~#])", r"\\\1", re.sub(r"\s+", " ", text))
