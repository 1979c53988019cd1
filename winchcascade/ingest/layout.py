"""Find the table among rows of cells, of a text or a sheet: its first row of data, its names and units, and what is above."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import find_unit
from winchcascade.ingest.cells import is_value, looks_like_a_number
from winchcascade.ingest.dialects import Header, recognise

Row = Sequence[str]

PREAMBLE_ROWS_MAX = 400
"""Rows in which the table must begin."""

SAMPLE_ROWS = 50
"""Rows of data from which the layout of a table is found."""

HEADING_ROWS = 12
"""Rows right above the data among which names and units stand."""

DATA_SHARE = 0.6
"""Share of the filled cells of a row of data that are numbers, stamps or marks for none, at least."""

_DATE = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}$")
_PROPERTY = re.compile(r"\s*[#%]?\s*\"?([^:=;,\t|\"]{1,60}?)\"?\s*[:=;,\t|]\s*([^;\t|]*)")


class Layout(msgspec.Struct, frozen=True):
    """Where and how a text keeps its table.

    Parameters
    ----------
    delimiter : one character; a blank stands for any run of blanks
    headers : the columns in order; one that is empty or only counts rows has no name
    more : there are names beyond the last column that rows usually have, of remarks as a rule
    first : index of the first line of data
    rows : cells of the first rows of data
    properties : what the lines above the table state, keys as written
    labview : the file is a LabVIEW measurement, in which the heading may stand above every segment
    """

    delimiter: str
    decimal: str
    headers: tuple[Header, ...]
    more: bool
    first: int
    rows: list[Row]
    properties: dict[str, str]
    labview: bool = False


def first_data(rows: Sequence[Row]) -> int | None:
    """Find the first row of data, which most of the next five rows resemble; None without such a row."""

    @cache  # most logs show their table in the first lines
    def data(k: int) -> bool:
        return _is_data(rows[k])

    for k in range(len(rows) - 1):
        if not data(k) or channels_named(rows[k]) > 1:
            continue
        after = [j for j in range(k + 1, min(k + 6, len(rows))) if any(rows[j])]
        width = usual_width([rows[j] for j in after if data(j)])
        alike = sum(data(j) and abs(len(rows[j]) - width) <= 1 for j in after) if len(rows[k]) >= width - 1 else 0
        named = any(channels_named(rows[j]) > 1 for j in after if not data(j))
        if alike >= max(1, len(after) - 2) and not named:
            return k
    return None


def _is_data(row: Row) -> bool:
    """Whether most filled cells of a row, two at least, are numbers, stamps or marks for none, and one is a number."""
    full = [cell for cell in row if cell]
    return len(full) >= 2 and sum(map(is_value, full)) >= DATA_SHARE * len(full) and any(map(looks_like_a_number, full))


def sample(rows: Sequence[Row], first: int) -> list[Row]:
    """Take the first rows of data, notes among them left out."""
    return [row for row in rows[first : first + SAMPLE_ROWS] if _is_data(row)]


def usual_width(rows: Sequence[Row]) -> int:
    """Count the cells that most rows have."""
    lengths = [len(row) for row in rows]
    return max(lengths, key=lengths.count, default=0)


def columns_of(rows: Sequence[Row]) -> list[list[str]]:
    """Cells of each column, as far as rows have it."""
    return [[row[k] for row in rows if len(row) > k] for k in range(usual_width(rows))]


def channels_named(row: Row) -> int:
    """Count the different channels that a row names."""
    return len({recognise(Header(cell)) for cell in row if cell and not looks_like_a_number(cell)} - {None})


def headers_above(above: Sequence[Row], rows: Sequence[Row], where: str, *, numbered: bool) -> list[Header]:
    """Find names and units above rows of data: the row that names most channels, and the row that is all units.

    Names beyond the last column of the data come last. A column that only counts rows, or holds nothing below an empty
    cell, has no name.

    Parameters
    ----------
    above : rows of cells above the data, in their order
    rows : first rows of data
    numbered : the rig file numbers the columns, so that they need no names

    Raises
    ------
    LogError : no row holds names, or one holds more or fewer than there are columns
    """
    columns = columns_of(rows)
    width = len(columns)
    filled = max(k + 1 for k, column in enumerate(columns) if any(column))
    found = [_without_own_units(row, width) for row in above[-HEADING_ROWS:]][::-1]
    near = [row for row in found if sum(map(bool, row)) >= 2 and len(row) >= filled - 1]
    units = _units_row(near)
    names = max((row for row in near if row is not units), key=channels_named, default=None)
    if names is None and numbered:
        units = _padded(units, width)
        return [Header(f"column {k + 1}", unit or None) for k, unit in enumerate(units[:width])]
    if names is None:
        raise LogError(_no_names(found, filled, where))
    first = "Date" if any(map(_DATE.match, columns[0])) else "" if _counts_rows(columns[0]) else None
    if len(names) < filled and first is not None:  # rows begin with a number or a date that has no name
        names, units = [first, *names], ["", *units] if len(units) < filled else units
    if any(recognise(Header(name)) for name in names[width:] if name):
        raise LogError(_no_names([names], filled, where))
    named = zip(_padded(names, width), _padded(units, width), columns, strict=False)
    return [
        *(_header(k, name, unit, column) for k, (name, unit, column) in enumerate(named)),
        *map(Header, names[width:]),
    ]


def _without_own_units(row: Row, width: int) -> Row:
    """Put units that follow each name in a cell of their own, as in `Time, s, Force, N`, into brackets."""
    if len(row) == 2 * width and all(map(find_unit, row[1::2])):
        return [f"{name} [{unit}]" for name, unit in zip(row[::2], row[1::2], strict=True)]
    return row


def _units_row(near: Sequence[Row]) -> Row:
    """Find the row of units among those above the data, nearest first; empty if there is none.

    Single letters are names as well as units: `t,F,V` are tonnes, farads and volts where another row has the names, and the
    names themselves where none has.
    """
    alike = [row for k, row in enumerate(near) if _is_units(row) and (k < 4 or "unit" in row[0].casefold())]
    units = min(alike, key=lambda row: channels_named(row) - _known_units(row), default=[])
    others = [row for row in near if row is not units]
    named = {recognise(Header(cell)) for cell in units if cell} - {None}
    alone = not others or ("time" in named and not any(map(channels_named, others)))
    return [] if len(named) > _known_units(units) - alone else units


def _is_units(row: Row) -> bool:
    """Whether most cells of a row are units or blank, and few are the name of a channel."""
    full = [text for cell in row if (text := cell.strip("()[]-– "))]
    named = sum(recognise(Header(text)) is not None and len(text) > 2 for text in full)
    return _known_units(row) >= max(2, 0.5 * len(full)) and named <= 0.3 * len(full)


def _known_units(row: Row) -> int:
    """Count the cells of a row that are units."""
    return sum(find_unit(cell.strip("()[] ")) is not None for cell in row if cell.strip("()[]-– "))


def _padded(row: Row, width: int) -> list[str]:
    return [*row, *[""] * (width - len(row))]


def _header(k: int, name: str, unit: str, column: Row) -> Header:
    """Column k; without a name if it is an empty time column, or one without a name that only counts rows or is text."""
    if not name:
        name = "" if _counts_rows(column) or not any(map(looks_like_a_number, column)) else f"column {k + 1}"
    elif not any(column) and recognise(Header(name)) == "time":
        return Header("")
    return Header(name, unit.strip("()[]") or None)


def _counts_rows(column: Row) -> bool:
    """Whether the cells of a column number the rows."""
    return all(c.isdecimal() and len(c) < 16 for c in column) and all(int(b) == int(a) + 1 for a, b in pairwise(column))


def _no_names(found: Sequence[Row], filled: int, where: str) -> str:
    """Explain why rows of data have no names."""
    names = next((row for row in found if channels_named(row) > 1), None)
    if names is None:
        return (
            f"{where}: rows of {filled} numbers but no column names above them; expected a first row such as "
            f"'Time (s),Displacement (m),Velocity (m/s),Force (N)'. Add one, or number the columns in a rig file: [columns] "
            f'velocity = {{ number = 3, unit = "m/s" }}.'
        )
    if len(names) == filled:
        return (
            f"{where}: the line above the numbers holds units ({', '.join(names[:8])}) and none holds names; expected a row "
            f"of names such as 'Time,Displacement,Velocity,Force' above it. Add one."
        )
    return (
        f"{where}: {len(names)} column names above rows of {filled} cells; expected one name for each column. Check for a "
        f"delimiter inside of names, or for decimal commas in a file that commas delimit."
    )


def properties_of(above: Sequence[str]) -> dict[str, str]:
    """Read the lines above a table that have the form `key: value`, `key = value` or `key<delimiter>value`."""
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
_AMOUNT = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)[\s,;]*([^\s,;()\[\]]*)")


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
        number, unit = float(amount[1].replace(",", ".")), bracket.strip(" )]）") or amount[2]
        if spellings & _STEP_KEYS and number > 0:
            scale = find_unit(unit or "s")
            step = number * scale.factor if scale is not None and scale.dimension == "time" else step
        elif spellings & _RATE_KEYS and number > 0:
            small = unit.casefold()  # Hz, kHz, S/s, kS/s, samples per minute
            step = 1.0 / (number * (1.0 / 60.0 if "min" in small else {"k": 1e3, "m": 1e6}.get(small[:1], 1.0)))
        elif letters == "x0":
            start = number
    return step, start
