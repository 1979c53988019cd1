"""Find the table among rows of cells, of a text or a sheet: its first row of data, its names and
units, and what is above.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import islice, pairwise, zip_longest

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import TURN, find_unit
from winchcascade.ingest.cells import is_value, looks_like_a_number
from winchcascade.ingest.headers import Header, recognise

Row = Sequence[str]

PREAMBLE_ROWS_MAX = 400
"""Rows in which the table must begin."""

SAMPLE_ROWS = 50
"""Rows of data from which the layout of a table is found."""

HEADING_ROWS = 12
"""Rows right above the data among which names and units stand."""

NEAR_ROWS = 5
"""Rows after the first one of data that must resemble it, but for two."""

DATA_SHARE = 0.6
"""Share of the filled cells of a row of data that are numbers, stamps or marks for none, at
least.
"""

_DATE = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}$")
_PROPERTY = re.compile(r"\s*[#%]?\s*\"?([^:=;,\t|\"]{1,60}?)\"?\s*[:=;,\t|]\s*([^;\t|]*)")


def find_data(row: Callable[[int], Row], count: int) -> tuple[int, list[list[str]]] | None:
    """Find the first row of data, which most of the next rows resemble.

    Parameters
    ----------
    row : gives the cells of a row by its index, below `count`

    Returns
    -------
    its index and the cells of each column in the first rows of data, as far as rows have it; None
    without such a row
    """
    is_data = cache(lambda k: _is_data(row(k)))
    for k in range(min(count - 1, PREAMBLE_ROWS_MAX)):
        if not is_data(k) or channels_named(row(k)) > 1:
            continue
        after = [j for j in range(k + 1, min(k + 1 + NEAR_ROWS, count)) if any(row(j))]
        data = [row(j) for j in after if is_data(j)]
        width = _usual_width(data)
        alike = (
            sum(abs(len(cells) - width) <= 1 for cells in data) if len(row(k)) >= width - 1 else 0
        )
        named = any(channels_named(row(j)) > 1 for j in after if not is_data(j))
        if alike >= max(1, len(after) - 2) and not named:
            return k, columns_of(
                [row(j) for j in range(k, min(k + SAMPLE_ROWS, count)) if is_data(j)]
            )
    return None


def _is_data(row: Row) -> bool:
    """Whether most filled cells of a row, two at least, are numbers, stamps or marks for none,
    and one is a number.
    """
    full = [cell for cell in row if cell]
    if len(full) < 2:
        return False
    enough = math.ceil(DATA_SHARE * len(full))
    numbers = len([*islice(filter(looks_like_a_number, full), enough)])
    return numbers > 0 and (numbers == enough or sum(map(is_value, full)) >= enough)


def _usual_width(rows: Sequence[Row]) -> int:
    """Count the cells that most rows have."""
    lengths = [len(row) for row in rows]
    return max(lengths, key=lengths.count, default=0)


def columns_of(rows: Sequence[Row]) -> list[list[str]]:
    """Cells of each column, as far as rows have it."""
    return [[row[k] for row in rows if len(row) > k] for k in range(_usual_width(rows))]


def channels_named(row: Row) -> int:
    """Count the different channels that a row names."""
    return len(
        {recognise(Header(cell)) for cell in row if cell and not looks_like_a_number(cell)} - {None}
    )


def headers_above(
    above: Sequence[Row], columns: Sequence[Row], where: str, *, numbered: bool
) -> list[Header]:
    """Find names and units above rows of data: the row that names most channels, and the row that
    is all units.

    Names beyond the last column of the data come last. A column that only counts rows, or holds
    nothing below an empty cell, has no name.

    Parameters
    ----------
    above : rows of cells above the data, in their order
    columns : cells of each column in the first rows of data
    numbered : the rig file numbers the columns, so that they need no names

    Raises
    ------
    LogError : no row holds names, or one holds more or fewer than there are columns
    """
    width = len(columns)
    filled = max(k + 1 for k, column in enumerate(columns) if any(column))
    near = [row for row in above[: -HEADING_ROWS - 1 : -1] if sum(map(bool, row)) >= 2]
    fitting = [row for row in near if len(row) >= filled - 1]
    known = [
        sum(find_unit(text) is not None for cell in row if (text := _bare(cell))) for row in fitting
    ]
    named = [channels_named(row) for row in fitting]
    # Single letters are names as well as units: `t,F,V` are names where no other row has them.
    order = sorted(range(len(fitting)), key=lambda k: (known[k] - named[k], -named[k], k))
    names = (
        fitting[order[0]]
        if order and (named[order[0]] >= known[order[0]] or known[order[0]] < 2)
        else []
    )
    half = [0.5 * sum(map(bool, map(_bare, row))) for row in fitting]
    units = next(
        (row for k, row in enumerate(fitting) if row is not names and known[k] >= max(2, half[k])),
        [],
    )
    if not names and numbered:
        names = [f"column {k + 1}" for k in range(width)]
    counts = [_counts_rows(column) for column in columns]
    if names and len(names) < filled and (counts[0] or any(map(_DATE.match, columns[0]))):
        # Rows begin with a number or a date that has no name.
        names, units = (
            ["" if counts[0] else "Date", *names],
            ["", *units] if len(units) < filled else units,
        )
    if not names or any(recognise(Header(name)) for name in names[width:] if name):
        raise LogError(_no_names(near if not names else [names], filled, where))
    headers = []
    for k, (name, unit, column) in enumerate(
        zip_longest(names, units[:width], columns, fillvalue="")
    ):
        if name and not any(column) and k < width and recognise(Header(name)) == "time":
            name = ""
        elif not name and any(map(looks_like_a_number, column)) and not counts[k]:
            name = f"column {k + 1}"
        headers.append(Header(name, unit.strip("()[] ") or None))
    return headers


def _bare(cell: str) -> str:
    """A cell without brackets and dashes, as a row of units has them."""
    return cell.strip("()[]-– ")


def _counts_rows(column: Row) -> bool:
    """Whether the cells of a column number the rows."""
    return all(c.isdecimal() and len(c) < 16 for c in column) and all(
        int(b) == int(a) + 1 for a, b in pairwise(column)
    )


def _no_names(near: Sequence[Row], filled: int, where: str) -> str:
    """Explain why rows of data have no names."""
    row = max(near, key=channels_named, default=[])
    if len(row) not in (0, filled) and channels_named(row) > 1:
        return (
            f"{where}: {len(row)} column names above rows of {filled} cells; expected one name "
            f"for each column. Check for a "
            f"delimiter inside of names, or for decimal commas in a file that commas delimit."
        )
    units = f" (they hold {', '.join(row[:8])})" if row else ""
    return (
        f"{where}: rows of {filled} numbers but no column names above them{units}; expected a "
        f"first row such as "
        f"'Time (s),Displacement (m),Velocity (m/s),Force (N)'. Add one, or number the columns in "
        f"a rig file: [columns] "
        f'velocity = {{ number = 3, unit = "m/s" }}.'
    )


def properties_of(above: Sequence[str]) -> dict[str, str]:
    """Read the lines above a table that have the form `key: value`, `key = value` or
    `key<delimiter>value`.
    """
    found: dict[str, str] = {}
    for parts in filter(None, map(_PROPERTY.match, above)):
        value = parts[2].strip(' \r\n,"')
        if value:
            found.setdefault(parts[1], re.sub(r"^([-+]?\d+),(\d+)(?!\d*,)", r"\1.\2", value))
    return found


_STEP_KEYS = frozenset(
    """deltax dt dts step sampleinterval sampleintervals samplinginterval samplingintervals sampleperiod samplingperiod
    sampletime samplingtime scaninterval loginterval logginginterval wfincrement timestep timeinterval abtastintervall
    abtastzeit périodedéchantillonnage 取樣間隔 取樣週期 採樣間隔 採樣週期 采样间隔 采样周期 サンプリング間隔""".split()
)
_RATE_KEYS = frozenset(
    """samplerate samplingrate samplefrequency samplingfrequency samplespersecond scanrate lograte loggingrate datarate
    acquisitionrate fs rate abtastrate abtastfrequenz messrate fréquencedéchantillonnage 取樣率 取樣頻率 採樣率 採樣頻率
    采样率 采样频率 サンプリング周波数 サンプリングレート""".split()
)
_AMOUNT = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)[\s,;]*([^,;()\[\]]*)")


def waveform(properties: Mapping[str, str]) -> tuple[float | None, float]:
    """Sampling interval and first stamp that a preamble states. [s]

    >>> waveform({"Sample rate": "25 Hz"}), waveform({"Sampling interval [ms]": "40"})
    ((0.04, 0.0), (0.04, 0.0))
    """
    step, start = None, 0.0
    for key, value in properties.items():
        name, _, bracket = re.sub(r"[(\[（]", "\n", key).partition("\n")
        letters = "".join(c for c in name.casefold() if c.isalnum())
        spellings = {letters, letters.removesuffix("hz"), letters.removesuffix("s")}
        amount = _AMOUNT.match(value)
        if amount is None:
            continue
        number, unit = (
            float(amount[1].replace(",", ".")),
            bracket.strip(" )]）") or amount[2].strip(),
        )
        usual = "s" if spellings & _STEP_KEYS else "Hz" if spellings & _RATE_KEYS else None
        if usual is not None and number > 0:
            step = sampling_interval(number, unit or usual) or step
        elif letters == "x0":
            start = number
    return step, start


def sampling_interval(number: float, unit: str) -> float | None:
    """Interval between samples of a period or a rate in any unit of time or frequency; None for a
    text that is neither. [s]

    A preamble may call either of them a rate, so that the unit decides.

    >>> sampling_interval(40.0, "ms"), sampling_interval(25.0, "samples per second")
    (0.04, 0.04)
    """
    unit = re.sub(r"^(/|per\s)\s*", "1/", unit)
    scale = find_unit(unit)
    if scale is None and " " in unit:
        scale = find_unit(unit.split()[0])  # a remark follows
    if scale is not None and scale.dimension == "time":
        return number * scale.factor
    rates = {"frequency": 1.0, "rotation": TURN}  # 1/min is a speed of rotation elsewhere
    if scale is None or scale.dimension not in rates:
        return None
    return rates[scale.dimension] / (number * scale.factor)
