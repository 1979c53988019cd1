"""LabVIEW measurement files (.lvm): the table below their second heading, which states units and
sampling intervals.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from winchcascade.core.errors import LogError
from winchcascade.ingest.cells import is_value, looks_like_a_number, number, split_row
from winchcascade.ingest.headers import Header
from winchcascade.ingest.layout import SAMPLE_ROWS, columns_of

_END, _AXIS, _REMARKS = "***End_of_Header***", "X_Value", "Comment"

INTERVAL_SHARE_MAX = 1e-6
"""Share by which the sampling intervals of two channels may differ: they are written with seven
digits.
"""


def labview_table(
    lines: Sequence[str], where: str
) -> tuple[str, int, list[Header], list[list[str]]] | None:
    """Find delimiter, first row of data, headers and the cells of each column; None for a file
    without such headings.

    Raises
    ------
    LogError : no rows below the names, or channels that are sampled at different intervals or from
        different times
    """
    ends = [k for k, line in enumerate(lines) if line.startswith(_END)]
    at = next(
        (k + 1 for k in ends if lines[k + 1 : k + 2] and lines[k + 1].startswith(_AXIS)), None
    )
    if at is None:
        return None
    delimiter = lines[at][len(_AXIS) : len(_AXIS) + 1]
    heading = {
        cells[0]: cells for line in lines[ends[0] : at - 1] if (cells := split_row(line, delimiter))
    }
    names, rows = split_row(lines[at], delimiter), list[list[str]]()
    for line in lines[at + 1 : at + 1 + SAMPLE_ROWS]:
        cells = split_row(line, delimiter)
        if cells[0] and not is_value(cells[0]):
            break  # the heading of the next segment
        rows += [cells] if any(map(looks_like_a_number, cells)) else []
    if not rows:
        raise LogError(
            f"{where}: a LabVIEW heading but no rows of numbers below it; expected at least a few "
            f"seconds of samples. Check "
            "that the logger wrote its data."
        )
    for key in (
        ("Delta_X", "X0")
        if not any(re.match(r"X_Columns\WOne", line) for line in lines[: ends[0]])
        else ()
    ):
        filled = zip(names, heading.get(key, ()), heading.get("Samples", names), strict=False)
        stated = {
            name: number(cell, ",")
            for name, cell, samples in filled
            if looks_like_a_number(cell) and samples != "0"
        }
        if stated and max(stated.values()) - min(stated.values()) > INTERVAL_SHARE_MAX * max(
            map(abs, stated.values())
        ):
            listed = ", ".join(f"{name} {value:g} s" for name, value in stated.items())
            raise LogError(
                f"{where}: the channels have different values of {key} ({listed}); expected one "
                f"for all. Save them with one X "
                "column, or as TDMS."
            )
    columns, units = columns_of(rows), heading.get("Y_Unit_Label", ())
    is_time = any(columns[0]) and (*heading.get("X_Dimension", ()), "", "")[1] in ("", "Time")
    headers = [Header(_AXIS, "s") if is_time else Header(_AXIS if any(columns[0]) else "")]
    for name, unit in zip(names[1:], (*units[1:], *[""] * len(names)), strict=False):
        headers.append(Header("" if name in (_AXIS, _REMARKS) else name, unit or None))
    return delimiter, at + 1, headers + [Header("")] * (len(columns) - len(headers)), columns
