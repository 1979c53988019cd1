"""Figures and tables of a report as files of their own, for papers; a file of another origin is never replaced."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.errors import OutputError
from winchcascade.core.files import json_bytes, write_set
from winchcascade.core.jobs import Nobody
from winchcascade.core.store import digest_of, inside, locked, make_one
from winchcascade.core.version import __version__
from winchcascade.report.report_files import ReportFiles
from winchcascade.report.report_model import Picture, Report
from winchcascade.report.table_files import table_files
from winchcascade.report.table_model import Table, every_row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    "differences": "efficiency-differences",
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
    make: Callable[[], Report], files: ReportFiles, name: str, *, of: str = "", force: bool = False
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
    if files.html is not None or files.pdf is not None:
        from winchcascade.report.publish import publish

        publish(make(), html=files.html, pdf=files.pdf, force=force)
    if files.figures is not None or files.tables is not None:
        write_exports(make, files, name, of=of or name, force=force)


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
            for ending, text in table_files(table, f"{stem}-{table.id}", subscripts=report.subscripts).items():
                texts[f"{stem}_{table.id}.{ending}"] = text.encode(), table.caption
        _write(texts, tables, f"tables of {of}", force=force)


Contents = dict[str, tuple[bytes, str]]
"""Contents of files by their names, each with what it shows."""


def _drawn(make: Callable[[], Report], width: int | None) -> tuple[Report, dict[tuple[str, str], bytes]]:
    """A report with every row of its tables, and its figures at a width [mm] by name and ending; none without a width."""
    from winchcascade.report.figure_files import figure_files
    from winchcascade.report.figure_layout import lay_out
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
    if known is None:
        what = "was not written by winchcascade"
    elif not _is_own(path, known):
        what = "was changed since winchcascade wrote it"
    elif known.of != of:
        what = f"belongs to the {known.of}"
    else:
        return
    raise OutputError(f"{path}: exists and {what}; choose another folder or add --force.")


def _is_own(path: Path, known: Exported) -> bool:
    """Whether a file has the content that this tool wrote."""
    return path.is_file() and digest_of(path.read_bytes()) == known.sha256
