"""Assign columns of a log to channels and units; each assumption becomes a finding."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import Unit, find_unit, si_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import CHANNELS, SIMULATED_HEADERS, Finding
from winchcascade.ingest.dialects import (
    CHANNELS_BY_NAME,
    COUNTS,
    DATES,
    DIMENSION,
    Header,
    letters_of,
    read_header,
    recognise,
)


class Match(msgspec.Struct, frozen=True):
    """One channel found in a log: index of its header, and its unit; a time column may name none."""

    index: int
    unit: Unit | None

    @property
    def factor(self) -> float:
        """What one of the unit is in SI units."""
        return 1.0 if self.unit is None else self.unit.factor


class Assignment(msgspec.Struct, frozen=True):
    """Which header is which channel; `time` is None for a log without a time column, `time_named` if it has a name."""

    channels: Mapping[str, Match]
    time: Match | None
    findings: tuple[Finding, ...]
    simulated: bool
    time_named: bool


def assign(headers: Sequence[Header], rig: Rig, where: str, *, clock: int | None = None) -> Assignment:
    """Match the headers of a log to channels, by the rig file's [columns] first, then by the table of names.

    Parameters
    ----------
    clock : index of the time column of a log that names none

    Raises
    ------
    LogError : two columns for one channel, a column of the rig file that the log does not have, a unit that does not
        fit, no column that could give the line velocity
    """
    named = _named_in_rig(headers, rig, where)
    taken: dict[str, int] = dict(named) if clock is None else {"time": clock} | named
    dates: list[int] = []
    unknown: list[int] = []
    simulated = {header.name.strip() for header in headers}.issuperset(SIMULATED_HEADERS)
    for index, header in enumerate(headers):
        if index == clock or index in named.values() or (simulated and header.name.strip() in SIMULATED_HEADERS):
            continue
        channel = recognise(header)
        letters = letters_of(header.name)
        if channel is None and letters in DATES:
            dates.append(index)
        elif channel is None and (not header.name.strip() or letters in COUNTS or set(header.name) <= set("# ")):
            continue
        elif channel is None or channel in named:
            unknown.append(index)
        elif channel in taken:
            taken[channel], other = _better(headers, taken[channel], index, channel, where)
            unknown += [other] if channel != "time" else []
        else:
            taken[channel] = index
    if dates:
        taken.setdefault("time", dates[0])
    if "velocity" not in taken and "displacement" not in taken:
        raise LogError(
            f"{where}: no column for the line velocity or displacement; the log has "
            f"{listed([h.name.strip() for h in headers])}. Name the columns in a rig file under [columns]."
        )
    matches, findings = _matches(taken, headers, rig, where)
    if unknown:
        what = f"{len(unknown)} columns that are no channel" if len(unknown) > 1 else "1 column that is no channel"
        message = f"{what}: {listed([headers[k].name.strip() for k in sorted(unknown)])}"
        findings.append(Finding("unknown_column", message, "not read", count=len(unknown)))
    findings += [
        Finding(
            "missing_channel",
            f"no column {column.name!r}, which the rig names for {channel}",
            f"{headers[taken[channel]].name.strip()!r} read instead",
            channel,
        )
        for channel, column in rig.columns.items()
        if channel not in named and channel in taken
    ]
    time = matches.pop("time", None)
    return Assignment(matches, time, tuple(findings), simulated, time_named=clock is None)


def _named_in_rig(headers: Sequence[Header], rig: Rig, where: str) -> dict[str, int]:
    names = [h.name.strip() for h in headers]
    bare = [read_header(h).name.strip() for h in headers]
    found = {}
    for channel, column in rig.columns.items():
        name = column.name.strip()
        if name in names or name in bare:
            found[channel] = (names if name in names else bare).index(name)
        elif channel in ("velocity", "time"):
            raise LogError(
                f"{where}: no column {column.name!r}, which the rig {rig.name} names for {channel}; the log has "
                f"{listed(names)}. Correct [columns] in the rig file or choose the rig with --rig."
            )
    return found


def _better(headers: Sequence[Header], old: int, new: int, channel: str, where: str) -> tuple[int, int]:
    """Of two columns for one channel, the one whose name is a plain one of the table, and the other; a draw is a fault.

    Of two time columns it is the one that names a unit of time, as a stamp may be coarser than the time elapsed.
    """
    read = [read_header(headers[k]) for k in (old, new)]
    better = [channel in CHANNELS_BY_NAME.get(letters_of(r.name), ()) for r in read]
    if channel == "time":
        better = [read[0].unit is not None or read[1].unit is None, read[0].unit is None and read[1].unit is not None]
    names = [headers[k].name.strip() for k in (old, new)]
    if better[0] == better[1] and names[0] == names[1]:
        raise LogError(
            f"{where}: columns {old + 1} and {new + 1} are both named {names[0]!r}; expected one {channel}. Rename or "
            f"delete one of them."
        )
    if better[0] == better[1]:
        raise LogError(
            f"{where}: both {names[0]!r} and {names[1]!r} could be the {channel}; expected one. Name the right one in a "
            f"rig file under [columns]."
        )
    return (old, new) if better[0] else (new, old)


def listed(names: Sequence[str], most: int = 12) -> str:
    """Names of columns for a sentence: so many of them, none of them long, and none of them empty."""
    shown = ", ".join((n if len(n) <= 40 else n[:37] + "...") or "(no name)" for n in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "") if names else "no columns"


def _matches(
    taken: Mapping[str, int], headers: Sequence[Header], rig: Rig, where: str
) -> tuple[dict[str, Match], list[Finding]]:
    """The column of each channel and of the time, with its unit; the usual one for a channel whose column names none."""
    findings: list[Finding] = []
    matches = {}
    for channel in ("time", *CHANNELS):
        if channel not in taken:
            continue
        header = headers[taken[channel]]
        unit = _unit_of(header, channel, rig, where, findings)
        if unit is None and channel != "time":
            usual = CHANNELS[channel].unit
            message = f"column {header.name.strip()!r} names no unit that is known; taken as {usual}"
            findings.append(Finding("unit_assumed", message, "assumed", channel))
            unit = find_unit(usual)
        matches[channel] = Match(taken[channel], unit)
    return matches, findings


def _unit_of(header: Header, channel: str, rig: Rig, where: str, findings: list[Finding]) -> Unit | None:
    """Unit of a column, None where neither log nor rig file names one, and a finding where they contradict each other.

    The log's own unit counts, unless the rig file overrides it or it measures something else.
    """
    column, read, dimension = rig.columns.get(channel), read_header(header), DIMENSION[channel]
    own = read.unit
    if own is None and read.unknown_unit is not None:
        own = _unit_by_pint(read.unknown_unit, channel)
    measured = dimension if own is None else own.dimension
    if column is None or column.unit is None:
        if measured != dimension:
            raise LogError(
                f"{where}: column {header.name.strip()!r} is named for {channel} but its unit is one of {measured}; "
                f"expected one of {dimension}. Correct the log or [columns] in a rig file."
            )
        return own
    named = find_unit(column.unit) or _unit_by_pint(column.unit, channel)
    if named is None:
        raise LogError(
            f"{where}: the rig {rig.name} gives {channel} the unit {column.unit!r}, which is none of "
            f"{dimension}; correct [columns] in the rig file."
        )
    if own is None or (own.factor, own.offset) == (named.factor, named.offset):
        return named
    override = column.override or measured != dimension
    findings.append(
        Finding(
            "unit_conflict",
            f"the header {header.name.strip()!r} and the rig {rig.name}, which gives {channel} in {column.unit}, contradict "
            "each other",
            "the unit of the rig is used"
            if override
            else "the unit of the header is used; override = true takes the other",
            channel,
        )
    )
    return named if override else own


_LONGEST_UNIT = 60
"""More characters are no unit."""

_LETTER = (
    r"A-Za-z_%\u00b0\u00b5\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u024f\u0370-\u03ff"
    r"\u2030\u2103\u2109\u210e\u2113\u2126\u212b\u221e"
)
_SYMBOL = rf"[{_LETTER}][{_LETTER}0-9]*"
_POWER = rf"{_SYMBOL}(?:\s*(?:\*\*|\^)\s*[-+]?\d(?!\d)|[\u207a\u207b]?[\u00b9\u00b2\u00b3\u2070\u2074-\u2079])?"
_TIMES = r"(?:\s*[*/.\u00b7\u22c5\u00d7]\s*|\s+)"
_PRODUCT = rf"(?:1\s*/\s*)?{_POWER}(?:{_TIMES}{_POWER})*"
_UNIT = rf"\s*{_PRODUCT}(?:{_TIMES}\(\s*{_PRODUCT}\s*\))?\s*"
"""What a unit may look like: symbols or words, each with a power of one digit, their products and quotients, one bracket.

Nothing else is given to pint, which would evaluate any arithmetic: 9**9**9 takes hours.
"""


def _unit_by_pint(text: str, channel: str) -> Unit | None:
    """Find a unit that the table does not hold by pint; None where pint has none for this channel either."""
    if len(text) > _LONGEST_UNIT or not re.fullmatch(_UNIT, text):
        return None
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    dimension = DIMENSION[channel]
    si = si_unit(dimension).replace(".", "*")
    try:
        at_zero, at_one = (float(registry.Quantity(x, text).to(si).magnitude) for x in (0.0, 1.0))
    except Exception:  # pint raises errors of many kinds, tokenizer errors among them, for text that is no unit
        return None
    return Unit(dimension, at_one - at_zero, at_zero)
