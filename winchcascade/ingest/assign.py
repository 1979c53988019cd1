"""Assign columns of a log to channels and units; each assumption becomes a finding."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.core.plain_text import first_of
from winchcascade.core.quantity import Unit, find_unit, read_as, si_unit
from winchcascade.core.rig_file import Rig, Side
from winchcascade.core.run import LOAD_HEADER, SIMULATED_HEADERS, Finding
from winchcascade.ingest.dialects import (
    CHANNELS_BY_NAME,
    COUNTS,
    DATES,
    Header,
    letters_of,
    nameless,
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
    """Which header is which channel; `time` is None for a log without a time column, `time_named` if it has a name.

    `candidates` holds the columns of each channel for which names and units leave several. `temperature` is the only column
    with a temperature of the machine that is no channel.
    """

    channels: Mapping[str, Match]
    time: Match | None
    findings: tuple[Finding, ...]
    simulated: bool
    time_named: bool
    candidates: Mapping[str, tuple[Match, ...]] = msgspec.field(default_factory=dict)
    temperature: Match | None = None


_OF_SIMULATE = (*SIMULATED_HEADERS, LOAD_HEADER)
"""Columns of a simulated log that are no channel."""


def load_column(headers: Sequence[Header]) -> int | None:
    """Index of the column in which `simulate` writes the load; None for another log."""
    names = [header.name.strip() for header in headers]
    return names.index(LOAD_HEADER) if set(names).issuperset(_OF_SIMULATE) else None


def assign(headers: Sequence[Header], rig: Rig, where: str, *, clock: int | None = None) -> Assignment:
    """Match the headers of a log to channels, by the rig file's [columns] first, then by the table of names.

    Parameters
    ----------
    clock : index of the time column of a log that names none

    Raises
    ------
    LogError : a column of the rig file that the log does not have, a unit that does not fit, no columns that could give a
        motion or a power
    """
    named = _named_in_rig(headers, rig, where)
    taken: dict[str, int] = dict(named) if clock is None else {"time": clock} | named
    columns = _columns_by_name(headers, rig, taken)
    taken |= {channel: alike[0] for channel, alike in columns.by_channel.items()}
    if not gives_result(taken, rig):
        raise LogError(
            f"{where}: no column for a motion (line velocity, displacement or speed of rotation) and none for a power; the log "
            f"has {listed(_names_with_units(headers))}. Name the columns in a rig file under [columns]."
        )
    several = {channel: alike for channel, alike in columns.by_channel.items() if len(alike) > 1}
    matches, findings = _matches({k: v for k, v in taken.items() if k not in several}, headers, rig, where)
    candidates = {
        channel: tuple(_matches({channel: k}, headers, rig, where)[0][channel] for k in alike)
        for channel, alike in several.items()
    }
    labels = rig.phases.column.strip() if rig.phases.source == "column" else ""
    unknown = [k for k in columns.unknown if not labels or labels not in _names(headers[k])]
    temperatures = [k for k in unknown if _is_temperature(headers[k])]
    temperature = Match(temperatures[0], read_header(headers[temperatures[0]]).unit) if len(temperatures) == 1 else None
    unknown = [k for k in unknown if temperature is None or k != temperature.index]
    if unknown:
        names = tuple(headers[k].name.strip() for k in unknown)
        what = f"{len(names)} columns that are no channel" if len(names) > 1 else "1 column that is no channel"
        message = f"{what}: {listed(names)}"
        findings.append(Finding("unknown_column", message, "not read", count=len(names), columns=names))
    findings += _missing(headers, rig, named, taken)
    time = matches.pop("time", None)
    return Assignment(matches, time, tuple(findings), columns.simulated, clock is None, candidates, temperature)


_MACHINE = re.compile(r"winding|wicklung|stator|housing|gehäuse|generator|motor|machine")


def of_machine(name: str) -> bool:
    """Whether a name describes the winding or the housing of the machine, as that of a temperature must."""
    return _MACHINE.search(name.casefold()) is not None


def _is_temperature(header: Header) -> bool:
    """Whether a column is a temperature of the machine, by its name and its unit."""
    unit = read_header(header).unit
    return unit is not None and unit.dimension == "temperature" and of_machine(header.name)


def _names(header: Header) -> tuple[str, str]:
    """Name of a column with and without its unit."""
    return header.name.strip(), read_header(header).name.strip()


class _Columns(msgspec.Struct, frozen=True):
    """Columns by the channel that their name means, the best ones of each, and those that are no channel."""

    by_channel: Mapping[str, list[int]]
    unknown: Sequence[int]
    simulated: bool


def _columns_by_name(headers: Sequence[Header], rig: Rig, taken: Mapping[str, int]) -> _Columns:
    """Find the channels that are not taken yet by the names of the columns; a column of dates is the time where no other is."""
    alike: dict[str, list[int]] = {}
    dates: list[int] = []
    unknown: list[int] = []
    simulated = {header.name.strip() for header in headers}.issuperset(SIMULATED_HEADERS)
    for index, header in enumerate(headers):
        if index in taken.values() or (simulated and header.name.strip() in _OF_SIMULATE):
            continue
        channel = _own_channel(header, rig) or recognise(header)
        letters = letters_of(header.name)
        if channel is None and letters in DATES:
            dates.append(index)
        elif channel is None and (not header.name.strip() or letters in COUNTS or set(header.name) <= set("# ")):
            continue
        elif channel is None or channel in taken:
            unknown.append(index)
        else:
            alike.setdefault(channel, []).append(index)
    best = {channel: _best(headers, columns, channel) for channel, columns in alike.items()}
    unknown += [k for channel, columns in alike.items() if channel != "time" for k in columns if k not in best[channel]]
    if dates and "time" not in taken:
        best.setdefault("time", dates[:1])
    return _Columns(best, sorted(unknown), simulated)


def _missing(headers: Sequence[Header], rig: Rig, named: Collection[str], taken: Mapping[str, int]) -> list[Finding]:
    """Columns that the rig file names and the log lacks, and channels of the rig's own that the log lacks."""
    read_instead = [
        Finding(
            "missing_channel",
            f"no column {column.name!r}, which the rig names for {channel}",
            f"{headers[taken[channel]].name.strip()!r} read instead",
            channel,
        )
        for channel, column in rig.columns.items()
        if channel not in named and channel in taken
    ]
    absent = [
        Finding("missing_channel", f"the log has no {name} channel", "metrics that need it are null", name)
        for name in rig.channels
        if name not in taken and name not in rig.sensors
    ]
    return read_instead + absent


MOTIONS = ("velocity", "displacement", "speed")
"""Channels that show how line or shaft moves."""

POWERS = (("power_mech",), ("power_ac",), ("vdc", "idc"), ("pressure", "flow"))
"""Channels of which, without a motion, a stage of the cascade has a power."""


def gives_result(channels: Collection[str], rig: Rig) -> bool:
    """Whether channels show a motion or give a power, so that a log of them can be reduced."""
    own = any(name in channels for name in rig.channels)
    return own or any(name in channels for name in MOTIONS) or any(all(c in channels for c in pair) for pair in POWERS)


def _own_channel(header: Header, rig: Rig) -> str | None:
    """Channel of the rig's own of which the column has the name, where [columns] names no other."""
    name = read_header(header).name.strip() if rig.channels else ""
    return name if name in rig.channels and name not in rig.columns else None


def _named_in_rig(headers: Sequence[Header], rig: Rig, where: str) -> dict[str, int]:
    names = [h.name.strip() for h in headers]
    bare = [read_header(h).name.strip() for h in headers]
    found = {}
    for channel, column in rig.columns.items():
        if column.number is not None:
            if column.number > len(headers):
                raise LogError(
                    f"{where}: no column {column.number}, which the rig {rig.name} names for {channel}; the log has "
                    f"{len(headers)} columns. Correct [columns] in the rig file or choose the rig with --rig."
                )
            found[channel] = column.number - 1
            continue
        name = column.name.strip()
        if name in names or name in bare:
            found[channel] = (names if name in names else bare).index(name)
        elif channel in ("velocity", "time"):
            raise LogError(
                f"{where}: no column {column.name!r}, which the rig {rig.name} names for {channel}; the log has "
                f"{listed(names)}. Correct [columns] in the rig file or choose the rig with --rig."
            )
    return found


def _best(headers: Sequence[Header], columns: Sequence[int], channel: str) -> list[int]:
    """Of the columns for one channel, those whose name is a plain one of the table; all of them where none has one.

    Of several time columns it is the first that names a unit of time, as a stamp may be coarser than the time elapsed.
    """
    read = {k: read_header(headers[k]) for k in columns}
    if channel == "time":
        return [next((k for k in columns if read[k].unit is not None), columns[0])]
    plain = [k for k in columns if channel in CHANNELS_BY_NAME.get(letters_of(read[k].name), ())]
    return plain or list(columns)


def _names_with_units(headers: Sequence[Header]) -> list[str]:
    """Names of the columns for a message, with the units that the file keeps apart from them."""
    named = [header for header in headers if not nameless(header)] or headers
    units = [f"({h.unit.strip()})" if h.unit else "" for h in named]
    return [
        h.name.strip() if unit in h.name else f"{h.name.strip()} {unit}" for h, unit in zip(named, units, strict=True)
    ]


def listed(names: Sequence[str], maximum: int = 12) -> str:
    """Names of columns for a sentence: a limited number of them, none of them long, and none of them empty."""
    return first_of([(n if len(n) <= 40 else n[:37] + "...") or "(no name)" for n in names], maximum) or "no columns"


def _matches(
    taken: Mapping[str, int], headers: Sequence[Header], rig: Rig, where: str
) -> tuple[dict[str, Match], list[Finding]]:
    """The column of each channel and of the time, with its unit; the usual one for a channel whose column names none."""
    findings: list[Finding] = []
    matches = {}
    for channel in ("time", *rig.known_channels):
        if channel not in taken:
            continue
        header = headers[taken[channel]]
        unit = _unit_of(header, channel, rig, where, findings)
        if unit is None and channel != "time":
            usual = rig.known_channels[channel].unit
            if channel not in rig.channels:
                stated = read_header(header).unknown_unit
                known = f"known ({stated!r} is none)" if stated else "known"
                message = f"column {header.name.strip()!r} names no unit that is {known}; taken as {usual}"
                findings.append(Finding("unit_assumed", message, "assumed", channel))
            unit = read_as(find_unit(usual), _dimension(channel, rig))
        if channel == "speed" and unit is not None:
            unit = _at_the_shaft(unit, header, rig, findings)
        matches[channel] = Match(taken[channel], unit)
    return matches, findings


_AT_GENERATOR = re.compile(
    r"generator|(?<![a-z])(?:gen|mot)(?![a-z])|motor|rotor|moteur|alternador|генератор|двигател|發電|发电|電動|电动|電機|电机"
)
_AT_DRUM = re.compile(r"drum|winch|trommel|winde|tambour|treuil|tambor|tamburo|барабан|捲筒|卷筒|ドラム")
"""Words of a name that show where a speed of rotation is measured; else it is that of the shaft with the torque sensor."""


def _at_the_shaft(unit: Unit, header: Header, rig: Rig, findings: list[Finding]) -> Unit:
    """Unit of a speed of rotation, divided by the gear ratio for one that is measured at the generator."""
    column, name = rig.columns.get("speed"), header.name.strip()
    side: Side | None = None if column is None else column.side
    if side is None:
        side = "generator" if _AT_GENERATOR.search(name.casefold()) else "shaft"
        side = "drum" if _AT_DRUM.search(name.casefold()) else side
    if side != "generator":
        return unit
    gear = rig.drivetrain.gear_ratio
    if gear is None:
        message = f"{name!r} is the speed of a machine, and the rig {rig.name} states no gear_ratio; taken as that of the shaft"
        findings.append(Finding("unit_assumed", message, "assumed", "speed"))
        return unit
    return msgspec.structs.replace(unit, factor=unit.factor / gear.value)


def _dimension(channel: str, rig: Rig) -> str:
    """What a channel, or the time, measures."""
    return "time" if channel == "time" else rig.known_channels[channel].dimension


def _unit_of(header: Header, channel: str, rig: Rig, where: str, findings: list[Finding]) -> Unit | None:
    """Unit of a column, None where neither log nor rig file names one, and a finding where they contradict each other.

    The log's own unit counts, unless the rig file overrides it or it measures something else.
    """
    column, read, dimension = rig.columns.get(channel), read_header(header), _dimension(channel, rig)
    own = read.unit
    if own is None and read.unknown_unit is not None:
        own = _unit_by_pint(read.unknown_unit, dimension)
    if own is None and channel == "speed":  # a column may be named rpm
        own = read_as(find_unit(read.name), dimension)
    own = read_as(own, dimension) or own
    measured = dimension if own is None else own.dimension
    if column is None or column.unit is None:
        if measured != dimension:
            raise LogError(
                f"{where}: column {header.name.strip()!r} is named for {channel} but its unit is one of {measured}; "
                f"expected one of {dimension}. Correct the log or [columns] in a rig file."
            )
        return own
    named = read_as(find_unit(column.unit), dimension) or _unit_by_pint(column.unit, dimension)
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


def _unit_by_pint(text: str, dimension: str) -> Unit | None:
    """Find a unit of a dimension that the table does not hold by pint; None where pint has none either."""
    if len(text) > _LONGEST_UNIT or not re.fullmatch(_UNIT, text):
        return None
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    si = si_unit(dimension).replace(".", "*")
    try:
        at_zero, at_one = (float(registry.Quantity(x, text).to(si).magnitude) for x in (0.0, 1.0))
    except Exception:  # pint raises errors of many kinds, tokenizer errors among them, for text that is no unit
        return None
    return Unit(dimension, at_one - at_zero, at_zero)
