"""Layout of LabVIEW measurement files (.lvm), which state delimiter, decimal sign, units and sampling intervals themselves."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from winchcascade.core.errors import LogError
from winchcascade.ingest.cells import decimal_sign, is_value, looks_like_a_number, split_row
from winchcascade.ingest.dialects import Header
from winchcascade.ingest.layout import SAMPLE_ROWS, Layout, columns_of, properties_of

_END = "***End_of_Header***"
_DELIMITERS = {"tab": "\t", "comma": ",", "semicolon": ";"}
_AXIS, _REMARKS = "X_Value", "Comment"

INTERVAL_SHARE_MAX = 1e-6
"""Share by which the sampling intervals of two channels may differ: they are written with seven digits."""


def labview_layout(lines: Sequence[str], where: str) -> Layout | None:
    """Find the table below the second heading of a LabVIEW measurement; None for a file without such headings.

    Raises
    ------
    LogError : no rows below the names, or channels that are sampled at different intervals
    """
    ends = [k for k, line in enumerate(lines) if line.startswith(_END)]
    at = next((k + 1 for k in ends if lines[k + 1 : k + 2] and lines[k + 1].startswith(_AXIS)), None)
    if at is None:
        return None
    # The first heading separates by tabs or by the separator of the file.
    head = {
        key.strip(): rest[0].strip() for key, *rest in (re.split(r"[\t,;]", line) for line in lines[: ends[0]]) if rest
    }
    delimiter = _DELIMITERS.get(head.get("Separator", "").casefold(), "\t")
    heading = {cells[0]: cells for line in lines[ends[0] : at - 1] if (cells := split_row(line, delimiter))}
    names = split_row(lines[at], delimiter)
    rows = _rows(lines[at + 1 : at + 1 + SAMPLE_ROWS], delimiter)
    if not rows:
        raise LogError(
            f"{where}: a LabVIEW heading but no rows of numbers below it; expected at least a few seconds of samples. Check "
            "that the logger wrote its data."
        )
    if head.get("X_Columns") != "One":
        _require_one_interval(heading, names, where)
    columns = columns_of(rows)
    width = len(columns)
    headers = [_header(k, name, heading, columns[k]) for k, name in enumerate(names[:width])]
    stated = head.get("Decimal_Separator", "")
    return Layout(
        delimiter,
        stated if stated in (".", ",") else decimal_sign(rows),
        (*headers, *[Header("")] * (width - len(headers))),
        len(names) > width,
        at + 1,
        columns,
        properties_of([line.replace(delimiter, "\t") for line in lines[:at]]),
        labview=True,
    )


def _rows(lines: Sequence[str], delimiter: str) -> list[Sequence[str]]:
    """Rows of data up to the next heading."""
    rows: list[Sequence[str]] = []
    for line in lines:
        cells = split_row(line, delimiter)
        if cells[0] and not is_value(cells[0]):
            break
        if any(map(looks_like_a_number, cells)):
            rows.append(cells)
    return rows


def _header(k: int, name: str, heading: Mapping[str, Sequence[str]], column: Sequence[str]) -> Header:
    """Column k: the first axis is the time; other axes, an axis without numbers and the remarks have no name."""
    if name == _AXIS:
        dimension = (*heading.get("X_Dimension", ()), "", "")[1]
        return Header(_AXIS, "s" if dimension in ("", "Time") else None) if k == 0 and any(column) else Header("")
    unit = (*heading.get("Y_Unit_Label", ()), *[""] * (k + 1))[k]
    return Header("" if name == _REMARKS else name, unit or None)


def _require_one_interval(heading: Mapping[str, Sequence[str]], names: Sequence[str], where: str) -> None:
    """Reject channels that stand side by side but were sampled at different intervals, or from different times: LogError."""
    counts = heading.get("Samples", ())
    for key, what in (("Delta_X", "sampled every"), ("X0", "sampled from")):
        stated = {
            names[k]: _number(cell)
            for k, cell in enumerate(heading.get(key, ())[: len(names)])
            if k and cell and (k >= len(counts) or counts[k] != "0")
        }
        values = [value for value in stated.values() if value is not None]
        if values and max(values) - min(values) > INTERVAL_SHARE_MAX * max(map(abs, values)):
            listed = ", ".join(f"{name} {value:g} s" for name, value in stated.items() if value is not None)
            raise LogError(
                f"{where}: the channels are {what} different times ({listed}); expected one for all. Save them with "
                "one X column, or as TDMS."
            )


def _number(cell: str) -> float | None:
    return (
        float(cell.replace(",", ".")) if looks_like_a_number(cell) and cell.count(",") + cell.count(".") < 2 else None
    )
