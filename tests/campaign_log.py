"""The clean 36 ohm log as cells, and the ways in which loggers, spreadsheets and lab PCs would
have written it.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path

from winchcascade import Reduction, Rig, Run, read_run, reduce

SOURCE = Path(__file__).parent.parent / "fixtures" / "campaign" / "r36ohm.csv"
HEAD, *ROWS = (line.split(",") for line in SOURCE.read_text().splitlines())
NAMES = ["Time", "Displacement", "Velocity", "Pressure", "Force", "Torque", "Vdc", "Idc"]
UNITS = ["s", "m", "m/s", "kg/cm2", "N", "N.m", "V", "A"]
T = [float(row[0]) for row in ROWS]
NOON = dt.datetime(2026, 4, 18, 10, 0, 0)

SAME = 1e-9
"""The same numbers in another spelling reduce to the same efficiencies, to rounding."""

LOST = 0.005
"""What a few samples that are lost, moved or rounded may change in an efficiency."""

Cells = Sequence[Sequence[str]]


def text(
    rows: Cells = ROWS,
    head: Sequence[str] | None = HEAD,
    *,
    delimiter: str = ",",
    decimal: str = ".",
    end: str = "\n",
) -> str:
    lines = [] if head is None else [delimiter.join(head)]
    lines.append(end.join(map(delimiter.join, rows)).replace(".", decimal))
    return end.join(lines) + end


def with_time(stamps: Iterable[str], name: str = "Time") -> tuple[Cells, list[str]]:
    return [[stamp, *row[1:]] for stamp, row in zip(stamps, ROWS, strict=True)], [name, *HEAD[1:]]


def stamps(form: str, start: dt.datetime = NOON, digits: int = 3) -> list[str]:
    """Stamps of the log; `~` stands for the fraction of a second, given to so many digits."""
    moments = [start + dt.timedelta(milliseconds=round(1000 * t)) for t in T]
    return [m.strftime(form).replace("~", f"{m.microsecond:06d}"[:digits]) for m in moments]


def scaled(column: int, factor: float, header: str) -> str:
    rows = [[*row[:column], repr(float(row[column]) * factor), *row[column + 1 :]] for row in ROWS]
    return text(rows, [*HEAD[:column], header, *HEAD[column + 1 :]])


def changed(cell: Callable[[str], str], rows: Cells = ROWS) -> Cells:
    return [[cell(c) for c in row] for row in rows]


def write(folder: Path, content: str | bytes, encoding: str = "utf-8") -> Path:
    path = folder / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return path


def read(
    folder: Path, content: str | bytes, encoding: str = "utf-8", rig: Rig | None = None
) -> Run:
    return read_run(write(folder, content, encoding), rig=rig)


def kinds(run: Run) -> set[str]:
    return {finding.kind for finding in run.findings}


def efficiencies(run: Run) -> list[float]:
    return _efficiencies(reduce(run, window=5.48))


def _efficiencies(result: Reduction) -> list[float]:
    found = [result.mean.eta_trans, result.mean.eta_gen, result.mean.eta_pto]
    return [eta for eta in found if eta is not None]


@cache
def clean() -> list[float]:
    return efficiencies(read_run(SOURCE))
