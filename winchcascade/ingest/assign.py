"""Which column of a log is which channel, in which unit; what is assumed is a finding."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import Unit, find_unit
from winchcascade.core.run import CHANNELS, SIMULATED_HEADERS, Finding
from winchcascade.ingest.dialects import CHANNELS_BY_NAME, COUNTS, DATES, DIMENSION, letters_of, read_header, recognise

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.ingest.source import Header


class Match(msgspec.Struct, frozen=True):
    """One channel found in a log: index of its header, and SI value = factor * value + offset."""

    index: int
    factor: float
    offset: float = 0.0


class Assignment(msgspec.Struct, frozen=True):
    """Which header is which channel; `time` is None for a log without a time column.

    `time_unit_known`: the time column names a unit. `time_named`: it has a name itself.
    """

    channels: Mapping[str, Match]
    time: Match | None
    time_unit_known: bool
    findings: tuple[Finding, ...]
    simulated: bool
    time_named: bool = True


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
    found = _assignment(taken, headers, rig, [headers[k].name.strip() for k in sorted(unknown)], simulated, where)
    absent = _absent(headers, rig, named, taken)
    return msgspec.structs.replace(found, findings=(*found.findings, *absent), time_named=clock is None)


def _absent(headers: Sequence[Header], rig: Rig, named: Mapping[str, int], taken: Mapping[str, int]) -> list[Finding]:
    """Columns that the rig file names and the log does not have, and what was read in their place."""
    findings = []
    for channel, column in rig.columns.items():
        if channel not in named and channel in taken:
            instead = headers[taken[channel]].name.strip()
            message = f"no column {column.name!r}, which the rig names for {channel}"
            findings.append(Finding("missing_channel", message, f"{instead!r} read instead", channel))
    return findings


def _named_in_rig(headers: Sequence[Header], rig: Rig, where: str) -> dict[str, int]:
    names = [h.name.strip() for h in headers]
    bare = [read_header(h).name.strip() for h in headers]
    found = {}
    for channel, column in rig.columns.items():
        if column.name.strip() in names:
            found[channel] = names.index(column.name.strip())
        elif column.name.strip() in bare:
            found[channel] = bare.index(column.name.strip())
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
        coarse = read[0].unit is None and read[1].unit is not None
        better = [not coarse, coarse]
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


def _assignment(
    taken: Mapping[str, int], headers: Sequence[Header], rig: Rig, unknown: Sequence[str], simulated: bool, where: str
) -> Assignment:
    findings = []
    channels = {}
    time, time_unit_known = None, False
    for channel in ("time", *CHANNELS):
        if channel not in taken:
            continue
        index = taken[channel]
        unit, conflict = _unit_of(headers[index], channel, rig, where)
        findings += conflict
        if channel == "time":
            time_unit_known = unit is not None
            time = Match(index, 1.0 if unit is None else unit.factor)
            continue
        if unit is None:
            unit, finding = _assumed(headers[index], channel)
            findings.append(finding)
        channels[channel] = Match(index, unit.factor, unit.offset)
    if unknown:
        what = f"{len(unknown)} columns that are no channel" if len(unknown) > 1 else "1 column that is no channel"
        findings.append(Finding("unknown_column", f"{what}: {listed(unknown)}", "not read", count=len(unknown)))
    return Assignment(channels, time, time_unit_known, tuple(findings), simulated)


def _assumed(header: Header, channel: str) -> tuple[Unit, Finding]:
    """The usual unit of a channel, for a column that names none, and the finding that says so."""
    usual = CHANNELS[channel].unit
    unit = find_unit(usual)
    assert unit is not None
    message = f"column {header.name.strip()!r} names no unit that is known; taken as {usual}"
    return unit, Finding("unit_assumed", message, "assumed", channel)


def _unit_of(header: Header, channel: str, rig: Rig, where: str) -> tuple[Unit | None, list[Finding]]:
    """Unit of a column, None where neither log nor rig file names one, and a finding where they contradict each other.

    The log's own unit counts, unless the rig file overrides it or it measures something else.
    """
    column = rig.columns.get(channel)
    read = read_header(header)
    own = read.unit
    if own is None and read.unknown_unit is not None:
        own = _unit_by_pint(read.unknown_unit, channel)
    fits = own is None or own.dimension == DIMENSION[channel]
    if column is None or column.unit is None:
        if not fits and own is not None:
            raise LogError(
                f"{where}: column {header.name.strip()!r} is named for {channel} but its unit is one of {own.dimension}; "
                f"expected one of {DIMENSION[channel]}. Correct the log or [columns] in a rig file."
            )
        return own, []
    named = find_unit(column.unit) or _unit_by_pint(column.unit, channel)
    if named is None:
        raise LogError(
            f"{where}: the rig {rig.name} gives {channel} the unit {column.unit!r}, which is none of "
            f"{DIMENSION[channel]}; correct [columns] in the rig file."
        )
    if own is None or (own.factor, own.offset) == (named.factor, named.offset):
        return named, []
    override = column.override or not fits
    message = (
        f"the header {header.name.strip()!r} and the rig {rig.name}, which gives {channel} in {column.unit}, contradict"
    )
    action = (
        "the unit of the rig is used" if override else "the unit of the header is used; override = true takes the other"
    )
    return (named if override else own), [Finding("unit_conflict", f"{message} each other", action, channel)]


_PINT_UNIT = {
    "time": "s", "length": "m", "velocity": "m/s", "pressure": "Pa", "force": "N", "torque": "N*m", "power": "W",
    "voltage": "V", "current": "A",
}  # fmt: skip


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
_UNIT = re.compile(rf"\s*{_PRODUCT}(?:{_TIMES}\(\s*{_PRODUCT}\s*\))?\s*")
"""What a unit may look like: symbols or words, each with a power of one digit, their products and quotients, one bracket.

Nothing else is given to pint, which would evaluate any arithmetic: 9**9**9 takes hours.
"""


def _unit_by_pint(text: str, channel: str) -> Unit | None:
    """Ask pint for a unit that the table does not hold; None where pint does not know it for this channel either."""
    if len(text) > _LONGEST_UNIT or not _UNIT.fullmatch(text):
        return None
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    dimension = DIMENSION[channel]
    try:
        at_zero, at_one = (float(registry.Quantity(x, text).to(_PINT_UNIT[dimension]).magnitude) for x in (0.0, 1.0))
    except Exception:  # pint raises errors of many kinds, tokenizer errors among them, for text that is no unit
        return None
    return Unit(dimension, at_one - at_zero, at_zero)
