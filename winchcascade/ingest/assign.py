"""Assign columns of a log to channels and units; each assumption becomes a finding, and nothing
is guessed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from difflib import get_close_matches

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.core.plain_text import first_of
from winchcascade.core.quantity import Unit, find_unit, read_as
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import BUILT_IN, built_in
from winchcascade.core.run import LOAD_HEADER, SIMULATED_HEADERS, Finding
from winchcascade.ingest.headers import (
    DIMENSION,
    Header,
    column_names,
    letters_of,
    nameless,
    read_header,
    recognise,
    words_of,
)

MOTIONS = ("velocity", "displacement", "speed")
"""Channels that show how line or shaft moves."""

POWERS = (("power_mech",), ("power_ac",), ("vdc", "idc"), ("pressure", "flow"))
"""Channels of which, without a motion, a stage of the cascade has a power."""

NEAR_MATCHES = 3
"""Number of columns that a message proposes for one channel."""

NEAR_NAME_LENGTH = 3
"""Minimum length of a name of a channel that a near match may resemble. [characters]"""

NEAR_SHARE = 0.75
"""Minimum share of letters that a near match has in common with a name of the channel. [1]"""

NEAR_COLUMNS_MAX = 300
"""Columns among which near matches are sought: a file of many thousands would take minutes."""

_OF_SIMULATE = (*SIMULATED_HEADERS, LOAD_HEADER)
"""Columns of a simulated log that are no channel."""


class Match(msgspec.Struct, frozen=True):
    """One channel found in a log: index of its header, and its unit; a time column may name
    none.
    """

    index: int
    unit: Unit | None

    @property
    def factor(self) -> float:
        """What one of the unit is in SI units."""
        return 1.0 if self.unit is None else self.unit.factor


class Assignment(msgspec.Struct, frozen=True):
    """Which header is which channel; `time` is None for a log without a time column, `time_named`
    if it has a name.

    `temperature` is the only column with a temperature of the machine that is no channel.
    """

    channels: Mapping[str, Match]
    time: Match | None
    findings: tuple[Finding, ...]
    simulated: bool
    time_named: bool
    temperature: Match | None = None


def load_column(headers: Sequence[Header]) -> int | None:
    """Index of the column in which `simulate` writes the load; None for another log."""
    names = [header.name.strip() for header in headers]
    return names.index(LOAD_HEADER) if set(names).issuperset(_OF_SIMULATE) else None


def gives_result(channels: Collection[str], rig: Rig) -> bool:
    """Whether channels show a motion or give a power, so that a log of them can be reduced."""
    own = any(name in channels for name in rig.channels)
    return (
        own
        or any(name in channels for name in MOTIONS)
        or any(all(c in channels for c in pair) for pair in POWERS)
    )


def of_machine(name: str) -> bool:
    """Whether a name describes the winding or the housing of the machine, as that of a
    temperature must.
    """
    folded = letters_of(name)
    return any(word in folded for word in column_names().warm_parts)


def named_column(headers: Sequence[Header], name: str) -> int | None:
    """Index of the column that a rig file names, with or without its unit; None where the log lacks
    it.

    `LC-17 [kN]` also names a column `LC-17` whose unit kN is in another row.
    """
    read = [*map(read_header, headers)]
    spelled: list[object] = [
        *(header.name.strip() for header in headers),
        *(one.name.strip() for one in read),
        *read,
    ]
    named = (one for one in (name.strip(), read_header(Header(name))) if one in spelled)
    return next((spelled.index(one) % len(headers) for one in named), None)


def has_columns(headers: Sequence[Header], rig: Rig) -> bool:
    """Whether a log has every column that a rig names, and the rig names some."""
    each = [
        any(named_column(headers, name) is not None for name in one.names)
        for one in rig.columns.values()
    ]
    return bool(each) and all(each)


def listed(names: Sequence[str], maximum: int = 12) -> str:
    """Names of columns for a sentence: a limited number of them, none of them long, and none of
    them empty.
    """
    return (
        first_of([(n if len(n) <= 40 else n[:37] + "...") or "(no name)" for n in names], maximum)
        or "no columns"
    )


def assign(
    headers: Sequence[Header], rig: Rig, where: str, *, clock: int | None = None
) -> Assignment:
    """Match the headers of a log to channels, by the rig file's [columns] first, then by the table
    of names.

    Of several columns for one channel none is read, and a finding names them.

    Parameters
    ----------
    clock : index of the time column of a log that names none

    Raises
    ------
    LogError : a column of the rig file that the log does not have, a unit that does not fit, no
        columns that could give a motion or a power, the columns of a built-in rig where no rig was
        named
    """
    for name in BUILT_IN if rig.assumed else ():
        if has_columns(headers, built_in(name)):
            raise LogError(
                f"{where}: has the columns of the built-in rig {name}, and no rig was named; add "
                f"--rig {name}."
            )
    findings: list[Finding] = []
    taken = ({} if clock is None else {"time": clock}) | _named_in_rig(headers, rig, where)
    absent = [channel for channel in rig.columns if channel not in taken]
    names = [header.name.strip() for header in headers]
    simulated = set(names).issuperset(SIMULATED_HEADERS)
    other = {k for k, name in enumerate(names) if simulated and name in _OF_SIMULATE}
    alike, unknown = _by_name(
        headers, [k for k in range(len(headers)) if k not in {*taken.values(), *other}], rig, taken
    )
    several = {channel: columns for channel, columns in alike.items() if len(columns) > 1}
    taken |= {channel: columns[0] for channel, columns in alike.items() if len(columns) == 1}
    if not gives_result(taken, rig):
        raise LogError(
            f"{where}: {_without_motion(headers, several, taken)} Name the columns in a rig file "
            f"under [columns]."
        )
    matches = {
        channel: Match(
            taken[channel], _unit(headers[taken[channel]], channel, rig, where, findings)
        )
        for channel in ("time", *rig.known_channels)
        if channel in taken
    }
    warm = [
        k for k in unknown if (u := read_header(headers[k]).unit) and u.dimension == "temperature"
    ]
    warm = [k for k in warm if of_machine(names[k])]
    label = named_column(headers, rig.phases.column) if rig.phases.source == "column" else None
    left = tuple(names[k] for k in unknown if k != label and [k] != warm)
    if left:
        message = f"{len(left)} column{'s that are' if len(left) > 1 else ' that is'} no channel: {listed(left)}"
        findings.append(
            Finding("unknown_column", message, "not read", count=len(left), columns=left)
        )
    for channel in absent:
        column = rig.columns[channel]
        if channel in taken and isinstance(column.name, tuple):
            continue
        called = " or ".join(map(repr, column.names))
        message = f"no column {called}, which the rig names for {channel}; {near_columns(column.names, headers)}"
        done = f"{names[taken[channel]]!r} read instead" if channel in taken else "not read"
        findings.append(Finding("missing_channel", message, done, channel))
    for channel in (
        c for c in rig.channels if c not in taken and c not in rig.sensors and c not in rig.columns
    ):
        message = f"the log has no {channel} channel"
        findings.append(
            Finding("missing_channel", message, "metrics that need it are null", channel)
        )
    for channel, found in several.items():
        message = f"{len(found)} columns could be the {channel}: " + listed(
            [f"{names[k]!r} (column {k + 1})" for k in found]
        )
        action = "none is read; name the right one in a rig file under [columns]"
        findings.append(Finding("ambiguous_column", message, action, channel, count=len(found)))
    temperature = Match(warm[0], read_header(headers[warm[0]]).unit) if len(warm) == 1 else None
    time = matches.pop("time", None)
    return Assignment(matches, time, tuple(findings), simulated, clock is None, temperature)


def _named_in_rig(headers: Sequence[Header], rig: Rig, where: str) -> dict[str, int]:
    """Columns that the rig file names or numbers.

    LogError for a velocity, a time or a number that the log lacks, and for a log that has several
    of the names of one channel.
    """
    found = {}
    for channel, column in rig.columns.items():
        named = {
            index: name
            for name in column.names
            if (index := named_column(headers, name)) is not None
        }
        if len(named) > 1:
            raise LogError(
                f"{where}: has {len(named)} columns that the rig {rig.name} names for {channel}: "
                f"{listed([*named.values()])}; "
                "expected one of them. State which one in columns of its [[run]] in campaign.toml."
            )
        index = next(iter(named), None) if column.number is None else column.number - 1
        beyond = column.number is not None and column.number > len(headers)
        if index is not None and not beyond:
            found[channel] = index
        elif beyond or (channel in ("velocity", "time") and isinstance(column.name, str)):
            called = column.number if beyond else repr(column.name)
            near = (
                f"the log has {len(headers)} columns"
                if beyond
                else near_columns(column.names, headers)
            )
            raise LogError(
                f"{where}: no column {called}, which the rig {rig.name} names for {channel}; "
                f"{near}. Correct [columns] in the "
                "rig file or choose the rig with --rig."
            )
    return found


def near_columns(stated: Sequence[str], headers: Sequence[Header]) -> str:
    """Which columns resemble a name that a rig file states, or which there are, for a sentence."""
    names = [header.name.strip() for header in headers[:NEAR_COLUMNS_MAX]]
    near = []
    for name in stated:
        near += get_close_matches(
            name, [other for other in names if len(other) <= 2 * len(name)], NEAR_MATCHES
        )
    return f"near it: {', '.join(map(repr, near))}" if near else f"the log has {listed(names)}"


def _by_name(
    headers: Sequence[Header], free: Iterable[int], rig: Rig, taken: Mapping[str, int]
) -> tuple[dict[str, list[int]], list[int]]:
    """The free columns by the channel that their names mean, and those that are no channel.

    Of several time columns it is the first that names a unit of time, as a stamp may be coarser
    than the time elapsed; a column of dates is the time where no other is.
    """
    table = column_names()
    alike: dict[str, list[int]] = {}
    dates, unknown = [], []
    for k in free:
        header = headers[k]
        bare = read_header(header).name.strip()
        own = bare in rig.channels and bare not in rig.columns
        channel = bare if own else recognise(header)
        if channel is not None and channel not in taken:
            alike.setdefault(channel, []).append(k)
        elif channel is None and letters_of(bare) in table.dates:
            dates.append(k)
        elif channel is not None or not (nameless(header) or letters_of(bare) in table.counts):
            unknown.append(k)
    if "time" in alike:
        alike["time"] = [
            next((k for k in alike["time"] if read_header(headers[k]).unit), alike["time"][0])
        ]
    elif dates and "time" not in taken:
        alike["time"] = dates[:1]
    return alike, unknown


def _without_motion(
    headers: Sequence[Header], several: Mapping[str, list[int]], taken: Collection[str]
) -> str:
    """Sentence for a log that shows neither a motion nor a power: the columns that come near
    each channel it lacks.
    """
    needed = {*MOTIONS, *(channel for power in POWERS for channel in power)}
    columns = [
        repr(headers[k].name.strip())
        for channel, alike in several.items()
        if channel in needed
        for k in alike
    ]
    if columns:
        return f"several columns could be the motion or the power: {listed(columns)}; expected one for each channel."
    lack = "no column for a motion (line velocity, displacement or speed of rotation) and none for a power"
    near = {
        channel: near_channel(channel, headers)
        for channel in DIMENSION
        if channel not in ("time", *taken)
    }
    found = "; ".join(
        f"{channel}: {', '.join(map(repr, names))}" for channel, names in near.items() if names
    )
    if found:
        return f"{lack}; columns that come near: {found}."
    named = [header for header in headers if not nameless(header)] or headers
    units = [f" ({header.unit.strip()})" if header.unit else "" for header in named]
    return f"{lack}; the log has {listed([h.name.strip() + u for h, u in zip(named, units, strict=True)])}."


def near_channel(channel: str, headers: Sequence[Header]) -> list[str]:
    """Columns that hold a name of the channel among other words, then those whose letters
    resemble one.
    """
    long = {
        name for name in column_names().channels[channel].letters if len(name) >= NEAR_NAME_LENGTH
    }
    read = {header.name.strip(): read_header(header) for header in headers[:NEAR_COLUMNS_MAX]}
    fitting = {
        n: r.name for n, r in read.items() if r.unit is None or read_as(r.unit, DIMENSION[channel])
    }
    held = [
        n for n, bare in fitting.items() if any(letters_of(word) in long for word in words_of(bare))
    ]
    alike = [
        n for n, bare in fitting.items() if get_close_matches(letters_of(bare), long, 1, NEAR_SHARE)
    ]
    return list(dict.fromkeys(held + alike))[:NEAR_MATCHES]


def _unit(
    header: Header, channel: str, rig: Rig, where: str, findings: list[Finding]
) -> Unit | None:
    """Unit of the column of a channel: the log's own, unless the rig file overrides it or it
    measures something else.

    Without either it is the usual one of the channel, with a finding, and None for the time. A
    speed of rotation that is measured at the generator is divided by the gear ratio.
    """
    column, known, name = (
        rig.columns.get(channel),
        rig.known_channels.get(channel),
        header.name.strip(),
    )
    dimension = "time" if known is None else known.dimension
    read = read_header(header)
    own = read_as(read.unit, dimension) or read.unit
    unit, fits = own, own is None or own.dimension == dimension
    if column is None or column.unit is None:
        if own is not None and not fits:
            raise LogError(
                f"{where}: column {name!r} is named for {channel} but its unit is one of "
                f"{own.dimension}; expected one of "
                f"{dimension}. Correct the log or [columns] in a rig file."
            )
    else:
        named = read_as(find_unit(column.unit), dimension)
        if named is None:
            raise LogError(
                f"{where}: the rig {rig.name} gives {channel} the unit {column.unit!r}, which is "
                f"none of {dimension}; correct "
                "[columns] in the rig file."
            )
        override = own is None or column.override or not fits
        if own is not None and (own.factor, own.offset) != (named.factor, named.offset):
            message = f"the header {name!r} and the rig {rig.name}, which gives {channel} in {column.unit}, contradict"
            done = (
                "the rig counts"
                if override
                else "the header counts; override = true takes the unit of the rig"
            )
            findings.append(Finding("unit_conflict", message, done, channel))
        unit = named if override else own
    if unit is None and known is not None:
        if channel not in rig.channels:
            stated = f" ({read.unknown_unit!r} is none)" if read.unknown_unit else ""
            message = f"column {name!r} names no unit that is known{stated}; taken as {known.unit}"
            findings.append(Finding("unit_assumed", message, "assumed", channel))
        unit = read_as(find_unit(known.unit), dimension)
    table, words = column_names(), words_of(name) | {letters_of(read.name)}
    at_machine = "generator" if words & table.at_machine and not words & table.at_drum else "shaft"
    if (
        channel != "speed"
        or unit is None
        or ((column and column.side) or at_machine) != "generator"
    ):
        return unit
    gear = rig.drivetrain.gear_ratio
    if gear is None:
        message = f"{name!r} is the speed of a machine, and the rig {rig.name} states no gear_ratio; taken as that of the shaft"
        findings.append(Finding("unit_assumed", message, "assumed", "speed"))
        return unit
    return msgspec.structs.replace(unit, factor=unit.factor / gear.value)
