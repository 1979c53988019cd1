"""The groups of a TDMS file: which of them are parts of one log, and what their channels are."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from nptdms import TdmsFile
from nptdms.log import log_manager

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding
from winchcascade.ingest.align import Waveform, alike, at, common_stamps, overlap, shared
from winchcascade.ingest.dialects import recognise
from winchcascade.ingest.source import Header, LogSource, LogTable, damage_reported
from winchcascade.ingest.table_choice import choose, moves

if TYPE_CHECKING:
    from winchcascade.core.run import Signal


UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "Unit", "unit")

UNSET = np.datetime64("1904-01-02", "us")
"""A start time before this one was never set: LabVIEW counts from 1904 and writes a zero."""

AS_LONG = 0.01
"""Groups without clocks are one log if their lengths differ by at most this share: loops do not stop together."""

NUMERIC, STAMPS = "biuf", "M"


class TdmsChannel(msgspec.Struct, frozen=True):
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
            known = {c.name for c in taken}
            taken = taken + [c for c in channels if c.name not in known]
        else:
            left.setdefault(obstacle, []).append(group.name)
            others += [group.name] if moves(Header(c.name) for c in channels if _is_numeric(c)) else []
    several = [ranked[0].name, *others] if others and moves(Header(c.name) for c in taken if _is_numeric(c)) else []
    findings = []
    for why, names in left.items():
        listed = ", ".join(map(repr, names[:12])) + (", ..." if len(names) > 12 else "")
        message = f"{len(names)} group{'s' * (len(names) > 1)} beside {ranked[0].name!r} {why}: {listed}"
        findings.append(Finding("unknown_column", message, "not read", count=len(names)))
    return taken, tuple(findings), several


def _filled(group: Any, cut_off: bool) -> list[Any]:
    return [channel for channel in group.channels() if len(channel) or cut_off]


def _is_numeric(channel: Any) -> bool:
    return channel.dtype.kind in NUMERIC


def _obstacle(taken: Sequence[Any], channels: Sequence[Any]) -> str | None:
    """Describe why a group cannot be read beside the channels already taken; None where it can."""
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


def _data(columns: Sequence[TdmsChannel]) -> list[TdmsChannel]:
    return [c for c in columns if c.kind in NUMERIC and recognise(c.header) != "time"]


def describe(channels: Sequence[Any]) -> list[TdmsChannel]:
    """Describe channels, their clocks counted from the earliest start time among them."""
    earliest = min((start for c in channels if (start := _start_time(c)) is not None), default=None)
    return [
        TdmsChannel(
            Header(c.name, _unit(c.properties)), c.group_name, c.name, len(c), c.dtype.kind, _waveform(c, earliest)
        )
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


def open_tdms(path: Path, *, table: str | None = None) -> LogSource:
    """Open the group with the most numeric channels, and those that hold other channels of the same log.

    Parameters
    ----------
    table : name or number of the group to begin with, where several hold a motion of their own

    Raises
    ------
    LogError
        the file is damaged, claims more than it holds, or has no numeric channel, here or while channels are read
    """
    with _opened(path) as tdms:
        _refuse_lies(path, tdms)
        cut_off = tdms.file_status.incomplete_final_segment
        first = None if table is None else choose([g.name for g in tdms.groups()], table, path.name, "group")
        channels, not_read, others = one_log(tdms.groups(), cut_off, first)
        if first is None and others:
            first = choose(others, None, path.name, "group")
        columns = describe(channels)
        if not any(column.kind in NUMERIC for column in columns):
            raise LogError(
                f"{path.name}: no group holds a channel of numbers; at least one was expected; export the log again with "
                "its samples."
            )
        groups = dict.fromkeys(column.group for column in reversed(columns))
        properties = _properties([tdms.properties, *(tdms[group].properties for group in groups)])
        message, action = (
            "the file breaks off inside its last segment",
            "read up to the last sample that every channel has",
        )
        findings = ((Finding("truncated", message, action),) if cut_off else ()) + not_read
    clock = shared(column.clock for column in columns)
    return LogSource(
        headers=tuple(column.header for column in columns),
        load=partial(_load, path, columns, clock, findings),
        time_step=clock.step if clock else None,
        time_start=clock.start if clock else 0.0,
        properties=properties,
        table=first if first is not None else columns[0].group,
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file for as long as its channels are read."""
    log_manager.set_level(logging.CRITICAL)  # what the parser logs on stderr is reported by findings and errors
    # A stream, not a path: beside a path the parser would trust an index file that may be an old one.
    with damage_reported(path, "TDMS file", "copy it again or export it as CSV"), path.open("rb") as stream:
        if stream.read(4) != b"TDSm":
            raise ValueError("no TDMS segment at the start")
        stream.seek(0)
        with TdmsFile.open(stream) as tdms, np.errstate(all="ignore"):
            yield tdms


def _refuse_lies(path: Path, tdms: Any) -> None:
    """Compare what each channel claims to hold with the size of the file, before anything of that size is made."""
    size = path.stat().st_size
    status = tdms.file_status
    last = {} if status.incomplete_final_segment else status.channel_statuses or {}
    for channel in (channel for group in tdms.groups() for channel in group.channels()):
        claimed = max(len(channel), last[channel.path].expected_length if channel.path in last else 0)
        if claimed * (getattr(channel.data_type, "size", None) or 1) > size:
            raise LogError(
                f"{path.name}: the channel {' '.join(channel.name.split())!r} claims {claimed} samples; no more than "
                f"the {size} bytes of the file were expected; copy the file again."
            )


def _properties(levels: Sequence[Mapping[str, Any]]) -> dict[str, str | float]:
    """Merge the texts and numbers of the file and of its groups; the later ones win."""
    merged = {str(name): value for level in levels for name, value in level.items()}
    return {
        name: value if isinstance(value, str) else float(value)
        for name, value in merged.items()
        if isinstance(value, str | int | float | np.number)
    }


def _load(
    path: Path,
    columns: Sequence[TdmsChannel],
    usual: Waveform | None,
    findings: tuple[Finding, ...],
    wanted: Sequence[int],
    time: int | None,
) -> LogTable:
    """Read the wanted channels: on one clock, or row by row where a time channel or nothing has the stamps."""
    raw = _samples(path, columns, wanted if time is None else [*wanted, time])
    own = [columns[i].clock for i in wanted]
    reference = shared(own)
    # A column of stamps belongs to every row, unless it is that of one of several clocks.
    apart = all(own) and not alike([clock for clock in own if clock])
    if reference is None or (time is not None and not apart):
        return _by_rows(raw, wanted, time, findings)
    clocks = {i: columns[i].clock or reference for i in wanted}
    t, cut = common_stamps(path, reference, [(clocks[i], len(raw[i])) for i in wanted])
    values = {i: at(t, _numbers(raw[i]), clocks[i], reference.step) for i in wanted}
    as_stated = reference == usual and t[0] == reference.start
    # These stamps are seconds, whatever the unit of a column of stamps: `stamped` says so.
    return LogTable(values, stamps=None if as_stated else t, stamped=time is not None, findings=findings + cut)


def _samples(path: Path, columns: Sequence[TdmsChannel], needed: Sequence[int]) -> dict[int, Any]:
    """Read the samples of channels as they are stored.

    Raises
    ------
    LogError
        a channel has none
    """
    with _opened(path) as tdms:
        raw = {i: tdms[columns[i].group][columns[i].channel].read_data() for i in needed}
    empty = [columns[i].header.name for i in needed if len(raw[i]) == 0]
    if empty:
        raise LogError(
            f"{path.name}: the channels {', '.join(empty)} have no samples; as many as in the others were "
            "expected; copy the file again or leave these channels out of the rig file."
        )
    return raw


def _by_rows(
    raw: Mapping[int, Any], wanted: Sequence[int], time: int | None, findings: tuple[Finding, ...]
) -> LogTable:
    """Put the channels side by side, as far as the shortest goes."""
    rows = min(map(len, raw.values()), default=0)
    lost = max(map(len, raw.values()), default=0) - rows
    if lost:
        message = f"the channels differ in length: the last {lost} samples are not in every one"
        findings += (Finding("dropped_samples", message, "left out", count=lost, removed=lost),)
    values = {i: _numbers(raw[i][:rows]) for i in wanted}
    if time is None:
        return LogTable(values, findings=findings)
    stamps = raw[time][:rows]
    if stamps.dtype.kind == "M":
        seconds: Signal = (stamps - stamps[0]) / np.timedelta64(1, "s")
        return LogTable(values, stamps=seconds, stamped=True, findings=findings)
    return LogTable(
        values, stamps=[*map(str, stamps)] if stamps.dtype.kind == "O" else _numbers(stamps), findings=findings
    )


def _numbers(samples: Any) -> Signal:
    """Convert samples to numbers; NaN for texts, stamps and complex numbers."""
    if samples.dtype.kind not in NUMERIC:
        return np.full(len(samples), np.nan)
    return np.asarray(samples, dtype=np.float64)
