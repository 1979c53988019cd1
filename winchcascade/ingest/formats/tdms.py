"""LabVIEW TDMS: the groups and channels that make one log, brought onto the clock of one of them where their clocks differ."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from nptdms import TdmsFile
from nptdms.log import log_manager

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.dialects import Header, recognise
from winchcascade.ingest.source import MAX_NAMED, LogSource, LogTable, choose, damage_reported, first_text, moves

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "Unit", "unit")

UNSET = np.datetime64("1904-01-02", "us")
"""A start time before this one was never set: LabVIEW counts from 1904 and writes a zero."""

AS_LONG = 0.01
"""Groups without clocks are one log if their lengths differ by at most this share: loops do not stop together."""

NUMERIC, STAMPS = "biuf", "M"


WHOLE = 0.01
"""A shift that is this close to a whole number of samples is one. [samples]"""

TRIM_REPORTED = 1.0
"""Longest stretch that may be cut from the ends without a finding. [s]"""


class Waveform(msgspec.Struct, frozen=True):
    """The stamps ``start + k * step`` of a channel. [s]"""

    step: float
    start: float


def shared(clocks: Iterable[Waveform | None]) -> Waveform | None:
    """Find the clock of most channels, the finer one of two alike."""
    counts = Counter(clock for clock in clocks if clock is not None)
    return max(counts, key=lambda clock: (counts[clock], -clock.step), default=None)


def alike(clocks: Sequence[Waveform]) -> bool:
    """Whether clocks tick together: their steps are the same and they start less than a step apart."""
    steps, starts = [clock.step for clock in clocks], [clock.start for clock in clocks]
    return max(steps) - min(steps) <= WHOLE * min(steps) and max(starts) - min(starts) <= min(steps)


def common_stamps(
    path: Path, reference: Waveform, tracks: Sequence[tuple[Waveform, int]]
) -> tuple[Signal, tuple[Finding, ...]]:
    """Find the stamps of the reference clock at which every channel was sampled, and report what lies outside. [s]

    Raises
    ------
    LogError
        there is no such stamp
    """
    begins = [clock.start for clock, _ in tracks]
    ends = [clock.start + clock.step * (length - 1) for clock, length in tracks]
    first = np.ceil((max(begins) - reference.start) / reference.step - WHOLE)
    last = np.floor((min(ends) - reference.start) / reference.step + WHOLE)
    if not np.isfinite([*begins, *ends, first, last]).all():
        raise LogError(
            f"{path.name}: one channel begins at {max(begins):g} s and another ends at {min(ends):g} s; times that a clock can "
            "have were expected; check their wf_start_time, wf_start_offset and wf_increment."
        )
    if last < first:
        raise LogError(
            f"{path.name}: one channel begins at {max(begins):.3f} s and another ends at {min(ends):.3f} s; channels "
            "that overlap in time were expected; check their wf_start_time and wf_start_offset."
        )
    t = reference.start + reference.step * np.arange(int(first), int(last) + 1, dtype=np.float64)
    trimmed = max(ends) - min(begins) - (t[-1] - t[0])
    if trimmed <= TRIM_REPORTED:
        return t, ()
    lost = round(trimmed / reference.step)
    return t, (
        Finding(
            "dropped_samples",
            f"the channels begin or end apart: {lost} samples between {min(begins):.3f} and {max(ends):.3f} s are not in "
            "every one",
            f"left out what lies outside {t[0]:.3f} to {t[-1]:.3f} s",
            count=lost,
            removed=lost,
        ),
    )


def at(t: Signal, values: Signal, clock: Waveform, step: float) -> Signal:
    """Take a channel at stamps of another clock: its own samples where they coincide, else interpolated. [s]"""
    shift = (t[0] - clock.start) / clock.step
    whole = round(shift)
    if abs(shift - whole) <= WHOLE and abs(clock.step - step) * len(t) / step <= WHOLE:
        return values[whole : whole + len(t)]
    return np.interp(t, clock.start + clock.step * np.arange(len(values)), values)


class TdmsChannel(msgspec.Struct, frozen=True):
    """One channel as its metadata describe it; the clock is None for a channel that is no waveform of numbers."""

    header: Header
    group: str
    length: int
    kind: str
    clock: Waveform | None


def one_log(
    groups: Sequence[Any], cut_off: bool, first: str | None, where: str
) -> tuple[list[Any], tuple[Finding, ...]]:
    """Choose the channels that make one log: of the group with the most numeric ones and of those that fit beside it.

    Also given are the findings on groups that are not read.

    A group fits if its channels have other names, but for a clock that both hold alike, and can be put beside the
    first in time. A channel without samples is none, but in a file that was cut off it is one that was lost.

    Parameters
    ----------
    first : name of the group to begin with

    Raises
    ------
    LogError : none is named, and groups that do not fit hold a motion as the chosen ones do
    """
    ranked = sorted(
        groups, key=lambda group: (group.name != first, -sum(_is_numeric(c) for c in _filled(group, cut_off)))
    )
    taken = _filled(ranked[0], cut_off) if ranked else []
    left: dict[str, list[str]] = {}
    others: list[str] = []
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
    if first is None and others and moves(Header(c.name) for c in taken if _is_numeric(c)):
        choose([ranked[0].name, *others], None, where, "group")
    findings = []
    for why, names in left.items():
        listed = ", ".join(map(repr, names[:MAX_NAMED])) + (", ..." if len(names) > MAX_NAMED else "")
        message = f"{len(names)} group{'s' * (len(names) > 1)} beside {ranked[0].name!r} {why}: {listed}"
        findings.append(Finding("unknown_column", message, "not read", count=len(names)))
    return taken, tuple(findings)


def _filled(group: Any, cut_off: bool) -> list[Any]:
    return [channel for channel in group.channels() if len(channel) or cut_off]


def _is_numeric(channel: Any) -> bool:
    return channel.dtype.kind in NUMERIC


def _obstacle(taken: Sequence[Any], channels: Sequence[Any]) -> str | None:
    """Describe why a group cannot be read beside the channels already taken; None where it can."""
    known = {c.name: c for c in taken}
    twins = [(known[c.name], c) for c in channels if c.name in known]
    # A channel may be written twice, as a clock is that two groups share.
    if len(twins) == len(channels) or not all(
        len(a) == len(b) and np.array_equal(a.read_data(), b.read_data()) for a, b in twins
    ):
        return "with channels of the same names, another recording"
    columns = describe([*taken, *channels])
    first, second = _data(columns[: len(taken)]), _data(columns[len(taken) :])
    if first and second and all(c.clock for c in first + second):
        begins, ends = zip(*(_span(data) for data in (first, second)), strict=True)
        return None if max(begins) <= min(ends) else "sampled at another time"
    rows = sorted(max(len(c) for c in side) for side in (taken, channels))
    return None if rows[1] - rows[0] <= AS_LONG * rows[1] else "with neither a clock nor as many rows"


def _data(columns: Sequence[TdmsChannel]) -> list[TdmsChannel]:
    return [c for c in columns if c.kind in NUMERIC and recognise(c.header) != "time"]


def _span(columns: Sequence[TdmsChannel]) -> tuple[float, float]:
    """First and last stamp of waveforms. [s]"""
    clocks = [(c.clock, c.length) for c in columns if c.clock]
    return min(clock.start for clock, _ in clocks), max(clock.start + clock.step * (n - 1) for clock, n in clocks)


def describe(channels: Sequence[Any]) -> list[TdmsChannel]:
    """Describe channels, their clocks counted from the earliest start time among them."""
    earliest = min((start for c in channels if (start := _start_time(c)) is not None), default=None)
    return [
        TdmsChannel(
            Header(c.name, first_text(c.properties, UNIT_PROPERTIES)),
            c.group_name,
            len(c),
            c.dtype.kind,
            _waveform(c, earliest),
        )
        for c in channels
    ]


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
        _reject_false_sizes(path, tdms)
        cut_off = tdms.file_status.incomplete_final_segment
        first = None if table is None else choose([g.name for g in tdms.groups()], table, path.name, "group")
        channels, not_read = one_log(tdms.groups(), cut_off, first, path.name)
        columns = describe(channels)
        if not any(column.kind in NUMERIC for column in columns):
            raise LogError(
                f"{path.name}: no group holds a channel of numbers; at least one was expected; export the log again with "
                "its samples."
            )
        groups = dict.fromkeys(column.group for column in reversed(columns))
        # The properties of groups replace those of the file; those of the first group count most.
        properties: dict[str, object] = {}
        for level in (tdms, *(tdms[group] for group in groups)):
            properties |= level.properties
    broken = Finding(
        "truncated",
        "the file breaks off inside its last segment",
        "read up to the last sample that every channel has",
    )
    clock = shared(column.clock for column in columns)
    return LogSource(
        headers=tuple(column.header for column in columns),
        load=partial(_load, path, columns, clock, (broken, *not_read) if cut_off else not_read),
        time_step=clock.step if clock else None,
        time_start=clock.start if clock else 0.0,
        properties={
            str(name): value if isinstance(value, str) else float(value)
            for name, value in properties.items()
            if isinstance(value, str | int | float | np.number)
        },
        table=first if first is not None else columns[0].group,
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file for as long as its channels are read."""
    log_manager.set_level(logging.CRITICAL)  # what the parser logs on stderr is reported by findings and errors
    # A stream, not a path: beside a path the parser would trust an index file that may be an old one.
    with (
        damage_reported(path, "TDMS file", "copy it again or export it as CSV"),
        path.open("rb") as stream,
        TdmsFile.open(stream) as tdms,
        np.errstate(all="ignore"),
    ):
        yield tdms


def _reject_false_sizes(path: Path, tdms: Any) -> None:
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


def _load(
    path: Path,
    columns: Sequence[TdmsChannel],
    usual: Waveform | None,
    findings: tuple[Finding, ...],
    wanted: Sequence[int],
    time: int | None,
) -> LogTable:
    """Read the wanted channels: on one clock, or row by row where a time channel or nothing has the stamps.

    Raises
    ------
    LogError
        a channel has no samples
    """
    with _opened(path) as tdms:
        used = {i: columns[i] for i in (wanted if time is None else [*wanted, time])}
        raw = {i: tdms[column.group][column.header.name].read_data() for i, column in used.items()}
    empty = [column.header.name for i, column in used.items() if len(raw[i]) == 0]
    if empty:
        raise LogError(
            f"{path.name}: the channels {', '.join(empty)} have no samples; as many as in the others were "
            "expected; copy the file again or leave these channels out of the rig file."
        )
    own = [columns[i].clock for i in wanted]
    reference = _reference([clock for clock in own if clock])
    # A column of stamps belongs to every row, unless it is that of one of several clocks.
    apart = all(own) and not alike([clock for clock in own if clock])
    if reference is None or (time is not None and not apart):
        return _by_rows(raw, wanted, time, findings)
    clocks = {i: columns[i].clock or reference for i in wanted}
    t, cut = common_stamps(path, reference, [(clocks[i], len(raw[i])) for i in wanted])
    values = {i: at(t, _numbers(raw[i]), clocks[i], reference.step) for i in wanted}
    findings += _slower(reference, [columns[i] for i in wanted])
    as_stated = reference == usual and t[0] == reference.start
    # These stamps are seconds, whatever the unit of a column of stamps, as `stamped` states.
    return LogTable(values, stamps=None if as_stated else t, stamped=time is not None, findings=findings + cut)


def _reference(clocks: Sequence[Waveform]) -> Waveform | None:
    """The clock that channels are taken at: that of most of them or, where their rates differ, of most of the fastest."""
    fastest = min((clock.step for clock in clocks), default=0.0)
    return shared(clock for clock in clocks if clock.step <= (1.0 + WHOLE) * fastest)


def _slower(reference: Waveform, channels: Sequence[TdmsChannel]) -> tuple[Finding, ...]:
    """Report channels with a slower clock than that which they are taken at."""
    by_step: dict[float, list[str]] = {}
    for channel in channels:
        if channel.clock is not None and channel.clock.step > (1.0 + WHOLE) * reference.step:
            by_step.setdefault(channel.clock.step, []).append(channel.header.name)
    return tuple(
        Finding(
            "coarse_sampling",
            f"{', '.join(names)}: sampled every {step:g} s, where the fastest channel has a sample every {reference.step:g} s",
            "interpolated by straight lines",
            count=len(names),
        )
        for step, names in by_step.items()
    )


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
    stamps: Any = None if time is None else raw[time][:rows]
    kind = "" if stamps is None else stamps.dtype.kind
    began = None
    if kind == STAMPS and len(stamps):
        began = float((stamps[0] - np.datetime64(0, "s")) / np.timedelta64(1, "s"))
        stamps = (stamps - stamps[0]) / np.timedelta64(1, "s")
    elif kind:
        stamps = [*map(str, stamps)] if kind == "O" else _numbers(stamps)
    return LogTable(values, stamps, kind == STAMPS, findings, began)


def _numbers(samples: Any) -> Signal:
    """Convert samples to numbers; NaN for texts, stamps and complex numbers."""
    return np.asarray(samples if samples.dtype.kind in NUMERIC else np.full(len(samples), np.nan), dtype=np.float64)
