"""The groups of a TDMS file: which of them are parts of one log, and what their channels are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from winchcascade.ingest.align import Waveform, overlap
from winchcascade.ingest.choice import moves
from winchcascade.ingest.dialects import recognise
from winchcascade.ingest.source import Header
from winchcascade.run import Finding

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "Unit", "unit")

UNSET = np.datetime64("1904-01-02", "us")
"""A start time before this one was never set: LabVIEW counts from 1904 and writes a zero."""

AS_LONG = 0.01
"""Groups without clocks are one log if their lengths differ by at most this share: loops do not stop together."""

NUMERIC, STAMPS = "biuf", "M"


class Column(msgspec.Struct, frozen=True):
    """One channel as its metadata describe it; the clock is None for a channel that is no waveform of numbers."""

    header: Header
    group: str
    channel: str
    length: int
    kind: str
    clock: Waveform | None


def one_log(
    groups: Sequence[Any], cut_off: bool, first: str | None = None
) -> tuple[list[Any], tuple[Finding, ...], list[str]]:
    """Choose the channels that make one log: of the group with the most numeric ones and of those that fit beside it.

    Also given are the findings on groups that are not read and, where these hold a motion as the chosen ones do, the names of
    all groups that could be the log.

    A group fits if its channels have other names, but for a clock that both hold alike, and can be put beside the
    first in time. A channel without samples is none, but in a file that was cut off it is one that was lost.
    """
    ranked = sorted(
        groups, key=lambda group: (group.name != first, -sum(_is_numeric(c) for c in _filled(group, cut_off)))
    )
    others: list[str] = []
    taken = _filled(ranked[0], cut_off) if ranked else []
    left: dict[str, list[str]] = {}
    for group in ranked[1:]:
        channels = _filled(group, cut_off)
        if not any(c.dtype.kind in NUMERIC + STAMPS for c in channels):
            continue
        obstacle = _obstacle(taken, channels)
        if obstacle is None:
            names = {c.name for c in taken}
            taken = taken + [c for c in channels if c.name not in names]
        else:
            left.setdefault(obstacle, []).append(group.name)
            others += [group.name] if moves(Header(c.name) for c in channels if _is_numeric(c)) else []
    several = [ranked[0].name, *others] if others and moves(Header(c.name) for c in taken if _is_numeric(c)) else []
    return taken, tuple(_not_read(ranked[0].name, names, why) for why, names in left.items()), several


def _not_read(first: str, names: Sequence[str], why: str) -> Finding:
    count = len(names)
    message = f"{count} group{'s' * (count > 1)} beside {first!r} {why}: {', '.join(map(repr, names[:12]))}"
    return Finding("unknown_column", message + (", ..." if count > 12 else ""), "not read", count=count)


def _filled(group: Any, cut_off: bool) -> list[Any]:
    return [channel for channel in group.channels() if len(channel) or cut_off]


def _is_numeric(channel: Any) -> bool:
    return channel.dtype.kind in NUMERIC


def _obstacle(taken: Sequence[Any], channels: Sequence[Any]) -> str | None:
    """Say why a group cannot be read beside the channels already taken; None where it can."""
    known = {c.name: c for c in taken}
    twins = [(known[c.name], c) for c in channels if c.name in known]
    if len(twins) == len(channels) or not all(_same(*pair) for pair in twins):
        return "with channels of the same names, another recording"
    columns = describe([*taken, *channels])
    first, second = _data(columns[: len(taken)]), _data(columns[len(taken) :])
    if first and second and all(c.clock for c in first + second):
        tracks = [[(c.clock, c.length) for c in data if c.clock] for data in (first, second)]
        return None if overlap(*tracks) else "sampled at another time"
    rows = sorted(max(len(c) for c in side) for side in (taken, channels))
    return None if rows[1] - rows[0] <= AS_LONG * rows[1] else "with neither a clock nor as many rows"


def _same(one: Any, other: Any) -> bool:
    """Tell a channel that was written twice, as a clock is that two groups share."""
    return len(one) == len(other) and np.array_equal(one.read_data(), other.read_data())


def _data(columns: Sequence[Column]) -> list[Column]:
    return [c for c in columns if c.kind in NUMERIC and recognise(c.header) != "time"]


def describe(channels: Sequence[Any]) -> list[Column]:
    """Describe channels, their clocks counted from the earliest start time among them."""
    earliest = min((start for c in channels if (start := _start_time(c)) is not None), default=None)
    return [
        Column(Header(c.name, _unit(c.properties)), c.group_name, c.name, len(c), c.dtype.kind, _waveform(c, earliest))
        for c in channels
    ]


def _unit(properties: Mapping[str, Any]) -> str | None:
    units = (str(properties[key]).strip() for key in UNIT_PROPERTIES if key in properties)
    return next((unit for unit in units if unit), None)


def _start_time(channel: Any) -> Any | None:
    start = channel.properties.get("wf_start_time")
    return start if isinstance(start, np.datetime64) and start > UNSET else None


def _waveform(channel: Any, earliest: Any | None) -> Waveform | None:
    """Read the clock of a waveform, its stamps counted from a moment. [s]"""
    step = _finite(channel.properties.get("wf_increment"))
    if step <= 0.0 or not _is_numeric(channel):
        return None
    start = _start_time(channel)
    late = 0.0 if start is None else float((start - earliest) / np.timedelta64(1, "us")) / 1e6
    return Waveform(step, late + _finite(channel.properties.get("wf_start_offset")))


def _finite(value: Any) -> float:
    """Take a property as a number; 0 for one that is absent or none."""
    return float(value) if isinstance(value, int | float | np.number) and np.isfinite(value) else 0.0
