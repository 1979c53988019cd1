"""Figures and tables of a report as files of their own, for papers; a file of another origin is never replaced.

A table is written as CSV with numbers in full, and as LaTeX and Markdown with those of the page.
"""

from __future__ import annotations

import csv
import io
import math
import re
import unicodedata
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

import msgspec

from winchcascade.core.errors import OutputError
from winchcascade.core.files import json_bytes, write_set
from winchcascade.core.jobs import Nobody
from winchcascade.core.plain_text import cell_text
from winchcascade.core.store import digest_of, inside, locked, make_one
from winchcascade.core.version import __version__
from winchcascade.report.content import Report as Stated
from winchcascade.report.digits import PLUS_MINUS, NumberText
from winchcascade.report.report_files import ReportFiles
from winchcascade.report.sheet import SUBSCRIPTS, Cell, Picture, Report, Table, every_row

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ENDINGS = ("csv", "tex", "md")
"""Files of a table."""


def heads(table: Table) -> list[str]:
    """Names of the columns with their units; a column that only has a sign is named after the one before it."""
    names = [f"{table.head[k - 1]} {name}" if name == "±" and k else name for k, name in enumerate(table.head)]
    return [f"{name} ({unit})" if unit else name for name, unit in zip(names, table.units, strict=True)]


# ---------------------------------------------------------------------------------------------------------------- as CSV
def csv_text(table: Table) -> str:
    """A table as CSV: one head with units, numbers in full, an interval in columns of its own, nothing for what is unknown."""
    rows = table.values or table.rows
    columns = [_spread(name, [row[k] for row in rows]) for k, name in enumerate(heads(table))]
    names = _apart([name for names, _ in columns for name in names])
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([cell_text(name) for name in names])
    for i in range(len(rows)):
        writer.writerow([_written(cell) for _, cells in columns for cell in cells[i]])
    return out.getvalue()


def _spread(name: str, cells: Sequence[Cell]) -> tuple[list[str], list[list[Cell]]]:
    """The columns that hold the values of one: number, ends of the interval, and the unit where rows differ in it."""
    texts = [cell for cell in cells if isinstance(cell, NumberText)]
    maximum, united = max((len(text.values) for text in texts), default=1), any(text.unit for text in texts)
    ends = [f"{name}, low", f"{name}, high"]
    if any(text.form == PLUS_MINUS for text in texts):
        ends = [name, f"{name}, standard uncertainty"]
    names = {1: [name], 2: ends, 3: [name, *ends]}[maximum]

    def values(cell: Cell) -> list[Cell]:
        own, unit = (list(cell.values), cell.unit) if isinstance(cell, NumberText) else ([cell], "")
        return [*own, *[None] * (maximum - len(own)), *([unit] if united else [])]

    return [*names, *([f"{name}, unit"] if united else [])], [values(cell) for cell in cells]


def _apart(names: Sequence[str]) -> list[str]:
    """Names of columns, numbered where one comes again, so that each is found by its name."""
    return [f"{name}, {names[:k].count(name) + 1}" if name in names[:k] else name for k, name in enumerate(names)]


def _written(cell: Cell) -> str:
    if cell is None or cell == "–":
        return ""
    if isinstance(cell, str):
        return cell_text(cell)
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


SCHEMA = "winchcascade/exports/1"

LIST = "winchcascade-files.json"
"""File of a folder that lists what this tool wrote there, with digests."""

MILLIMETRES = (90, 190)
"""Widths of the figures: one column and two columns of a journal. [mm]"""

SHOWS = {
    "budget": "share-of-the-variance",
    "closed": "error-by-set-of-causes",
    "closure-bars": "misfit-before-and-after",
    "cycles": "error-by-cycle",
    "errors": "errors-before-and-after",
    "flow": "energy-flow",
    "histories": "time-histories",
    "history": "differences-over-time",
    "loads": "powers-and-efficiencies-over-load",
    "map": "gap-map",
    "model-budget": "loss-budget",
    "model-damper": "damper-sweep",
    "model-emf": "back-emf",
    "model-generator": "generator-measured-and-simulated",
    "model-losses": "losses-measured-and-simulated",
    "model-tether": "line-measured-and-simulated",
    "model-torque": "torque-measured-and-simulated",
    "numbers": "numbers-of-the-causes",
    "odds": "odds-of-effects",
    "overlaid": "cycles-overlaid",
    "rolloff": "back-emf-over-current",
    "scatter": "measured-over-predicted-power",
    "speed": "powers-over-generator-speed",
    "stability": "numbers-run-by-run",
    "stages": "gap-map-of-stages",
    "streams": "powers-over-time-and-speed",
    "trend": "cycle-by-cycle",
    "waterfall": "efficiency-cause-by-cause",
}
"""What a figure shows, for the name of its file, by its name in a report; others keep that name."""


class Exported(msgspec.Struct, frozen=True):
    """A file that was exported: its digest, the report it is of, and what it shows."""

    sha256: str
    of: str
    shows: str


class _Listed(msgspec.Struct, frozen=True):
    """Files of a folder that this tool wrote, by their names."""

    schema: str
    version: str = __version__
    files: dict[str, Exported] = {}


def write_report_files(
    make: Callable[[], Report | Stated], files: ReportFiles, name: str, *, of: str = "", force: bool = False
) -> None:
    """Write a report as page and PDF, and its figures and tables into their folders, as far as they are wanted.

    Parameters
    ----------
    make : makes the report; it is called again for each width of the figures
    name : with which the names of the exported files begin
    of : log or campaign that the report is about, if its name is another one

    Raises
    ------
    OutputError : a file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    report = make()
    if isinstance(report, Stated):
        from winchcascade.report.publish import publish
        from winchcascade.report.render.files import write_figures, write_tables

        publish(report, html=files.html, pdf=files.pdf, force=force)
        for folder, write in ((files.figures, write_figures), (files.tables, write_tables)):
            if folder is not None:
                write(report, folder, name, force=force)
        return
    older = cast("Callable[[], Report]", make)
    if files.html is not None or files.pdf is not None:
        from winchcascade.report.publish import publish

        publish(older(), html=files.html, pdf=files.pdf, force=force)
    if files.figures is not None or files.tables is not None:
        write_exports(older, files, name, of=of or name, force=force)


def write_exports(make: Callable[[], Report], files: ReportFiles, name: str, *, of: str, force: bool) -> None:
    """Write the figures and tables of a report into their folders, each folder whole or not at all.

    Raises
    ------
    OutputError : a folder cannot be written, or holds a file of that name that is of another report, from elsewhere, or that
        was changed since
    """
    figures, tables = files.figures, files.tables
    for folder in (figures, tables):
        if folder is not None:
            make_one(folder, "another")
    stem, report = stem_of(name), None
    if figures is not None:
        drawn: Contents = {}
        for width in MILLIMETRES:
            report, pictures = _drawn(make, width)
            shows = {b.id: b.caption for s in report.sections for b in s.blocks if isinstance(b, Picture)}
            for (key, ending), content in pictures.items():
                drawn[f"{stem}_{SHOWS.get(key, key)}_{width}mm.{ending}"] = content, shows.get(key, "")
        _write(drawn, figures, f"figures of {of}", force=force)
    if tables is not None:
        report = report or _drawn(make, None)[0]
        texts: Contents = {}
        for table in (b for s in report.sections for b in s.blocks if isinstance(b, Table)):
            for ending, text in {
                "csv": csv_text(table),
                "tex": latex_text(table, f"{stem}-{table.id}", report.subscripts),
                "md": markdown_text(table),
            }.items():
                texts[f"{stem}_{table.id}.{ending}"] = text.encode(), table.caption
        _write(texts, tables, f"tables of {of}", force=force)


Contents = dict[str, tuple[bytes, str]]
"""Contents of files by their names, each with what it shows."""


def _drawn(make: Callable[[], Report], width: int | None) -> tuple[Report, dict[tuple[str, str], bytes]]:
    """A report with every row of its tables, and its figures at a width [mm] by name and ending; none without a width."""
    from winchcascade.report.figure_files import figure_files, lay_out
    from winchcascade.report.style import Format, figure_format

    found: dict[tuple[str, str], bytes] = {}

    def take(name: str, figure: Figure) -> None:
        if width is not None:
            lay_out(figure)
            found.update({(name, ending): content for ending, content in figure_files(figure).items()})

    with every_row(), figure_format(Format((width or MILLIMETRES[-1]) / 25.4, take)):
        return make(), found


def stem_of(name: str) -> str:
    """How the names of files about a log or a campaign begin: its name with hyphens for blanks and signs.

    >>> stem_of("Versuch 3 (März)"), stem_of("...")
    ('Versuch-3-März', 'report')
    """
    return re.sub(r"[^\w.]+", "-", unicodedata.normalize("NFC", name)).strip("-._")[:80] or "report"


def _write(contents: Contents, folder: Path, of: str, *, force: bool) -> None:
    """Put files into their folder together, with the list of what is there; files that this report no longer has go."""
    with locked(folder, Nobody().waiting):
        listed = _listed(folder, force=force)
        for name in contents:
            _check(inside(folder, name), listed.get(name), of, force=force)
        new = {name: Exported(digest_of(content), of, shows) for name, (content, shows) in contents.items()}
        outdated = {name: file for name, file in listed.items() if file.of == of and name not in new}
        gone = [path for name, file in outdated.items() if _is_own(path := inside(folder, name), file)]
        files = {name: file for name, file in listed.items() if name not in outdated} | new
        parts = {folder / name: content for name, (content, _) in contents.items()}
        write_set(parts | {folder / LIST: json_bytes(_Listed(SCHEMA, files=dict(sorted(files.items()))))}, without=gone)


def _listed(folder: Path, *, force: bool) -> dict[str, Exported]:
    """Files that this tool wrote into a folder, by their names, as it listed them there."""
    path = inside(folder, LIST)
    if not path.exists():
        return {}
    try:
        found = msgspec.json.decode(path.read_bytes(), type=_Listed)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OSError):
        found = _Listed(schema="")
    if found.schema != SCHEMA and not force:
        raise OutputError(
            f"{path}: is no list of the files that winchcascade wrote; choose another folder, remove it, or add --force."
        )
    return found.files


def _check(path: Path, known: Exported | None, of: str, *, force: bool) -> None:
    """Reject to replace what this tool did not write, what belongs to another report, or what was changed since."""
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; expected the name of a file to be free. Choose another folder.")
    if force or not path.exists():
        return
    own = known is not None and _is_own(path, known)
    what = f"belongs to the {known.of}" if known is not None and own else "was changed since winchcascade wrote it"
    what = "was not written by winchcascade" if known is None else what
    if not own or (known is not None and known.of != of):
        raise OutputError(f"{path}: exists and {what}; choose another folder or add --force.")


def _is_own(path: Path, known: Exported) -> bool:
    """Whether a file has the content that this tool wrote."""
    return path.is_file() and digest_of(path.read_bytes()) == known.sha256
