"""LabVIEW TDMS: the groups and channels that make one log, brought onto the clock of one of them
where their clocks differ.
"""

from __future__ import annotations

import io
import logging
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
from nptdms import TdmsFile
from nptdms.log import log_manager
from nptdms.reader import TdmsReader

from winchcascade.core.errors import LogError
from winchcascade.core.plain_text import first_of
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.headers import Header, recognise
from winchcascade.ingest.limits import require_numbers
from winchcascade.ingest.source import (
    MAX_NAMED,
    LogSource,
    LogTable,
    choose,
    damage_reported,
    first_text,
    log_table,
    moves,
)

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "Unit", "unit")

CLOCK_SET_MIN = np.datetime64("1904-01-02", "us")
"""A start time before this one was never set: LabVIEW counts from 1904 and writes a zero."""

LENGTH_SHARE_MAX = 0.01
"""Groups without clocks are one log if their lengths differ by at most this share: loops do not
stop together.
"""

WHOLE_SAMPLE_SHARE = 0.01
"""A shift that is this close to a whole number of samples is one; so is a ratio of intervals to
one. [samples]
"""

TRIM_REPORTED_MIN = 1 / 40
"""Longest stretch that may be cut from the ends without a finding, as a share of the log: loops
do not stop together. [1]
"""

CHANNELS_MAX = 2000
"""Channels of a file; a log has a few dozen, and its groups are compared with each other."""

ENTRIES_MAX = 10_000_000
"""Objects of all segments together: 28 bytes can repeat all objects of the segment before, and each
takes time again.

A day of one segment each second, with a hundred channels, has 8.6 million. Ten million are parsed
in 2 to 7 s and 0.8 GB.
"""

NUMERIC, STAMPS = "biuf", "M"


class Waveform(NamedTuple):
    """The stamps ``start + k * step`` of a channel. [s]"""

    step: float
    start: float

    def end(self, length: int) -> float:
        """Stamp of the last of so many samples. [s]"""
        return self.start + self.step * (length - 1)


class TdmsChannel(NamedTuple):
    """One channel as its metadata describe it; the clock is None for a channel that is no
    waveform of numbers.
    """

    header: Header
    group: str
    length: int
    kind: str
    clock: Waveform | None


def open_tdms(path: Path, *, table: str | None = None) -> LogSource:
    """Open the group with the most numeric channels, and those that hold other channels of the same
    log.

    Parameters
    ----------
    table : name or number of the group to begin with, where several hold a motion of their own

    Raises
    ------
    LogError the file is damaged, claims more than it holds, or has no numeric channel, here or
        while channels are read
    """
    with _opened(path) as tdms:
        _reject_false_sizes(path, tdms)
        cut_off = tdms.file_status.incomplete_final_segment
        first = (
            None
            if table is None
            else choose([g.name for g in tdms.groups()], table, path.name, "group")
        )
        columns, findings = _one_log(tdms.groups(), cut_off, first, path.name)
        # The properties of groups replace those of the file; those of the first group count most.
        properties = dict(tdms.properties)
        for group in dict.fromkeys(column.group for column in reversed(columns)):
            properties |= tdms[group].properties
    if not any(column.kind in NUMERIC for column in columns):
        raise LogError(
            f"{path.name}: no group holds a channel of numbers; at least one was expected; export "
            f"the log again with "
            "its samples."
        )
    if cut_off:
        action = "read up to the last sample that every channel has"
        findings = (
            Finding("truncated", "the file breaks off inside its last segment", action),
            *findings,
        )
    clock = _shared(column.clock for column in columns)
    return LogSource(
        headers=tuple(column.header for column in columns),
        load=partial(_load, path, columns, clock, findings),
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
    log_manager.set_level(
        logging.CRITICAL
    )  # what the parser logs on stderr is reported by findings and errors
    # A stream, not a path: beside a path the parser would trust an index file that may be an old
    # one.
    with (
        damage_reported(path, "TDMS file", "copy it again or export it as CSV"),
        _BoundedStream(path) as stream,
        np.errstate(all="ignore"),
    ):
        _CountedReader(stream, path.name).read_metadata()
        stream.seek(0)
        with TdmsFile.open(stream) as tdms:
            yield tdms


class _BoundedStream(io.BufferedReader):
    """A file of which a read takes no more memory than the file is long, whatever length a
    damaged text claims.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self.length = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read so many bytes, or all."""
        return super().read(self.length if size is None else min(size, self.length))


class _CountedReader(TdmsReader):  # type: ignore[misc]
    """The parser of the metadata, which rejects segments that list more objects than those of a
    log: LogError.
    """

    def __init__(self, stream: BinaryIO, where: str) -> None:
        super().__init__(stream)
        self.entries, self.where = 0, where

    def _update_object_metadata(self, segment: Any) -> None:
        self.entries += len(segment.ordered_objects)
        if self.entries > ENTRIES_MAX:
            raise LogError(
                f"{self.where}: {len(self._segments) + 1} segments list {self.entries} objects; "
                f"at most {ENTRIES_MAX} "
                "were expected of a log; defragment the file in LabVIEW, or export the channels "
                "of the log alone."
            )
        super()._update_object_metadata(segment)


def _reject_false_sizes(path: Path, tdms: Any) -> None:
    """Compare what the channels claim to hold with the size of the file, before anything of that
    size is made: LogError.
    """
    size, status = path.stat().st_size, tdms.file_status
    last = {} if status.incomplete_final_segment else status.channel_statuses or {}
    channels = [channel for group in tdms.groups() for channel in group.channels()]
    if len(channels) > CHANNELS_MAX:
        raise LogError(
            f"{path.name}: holds {len(channels)} channels; at most {CHANNELS_MAX} were expected; "
            f"export the channels of the "
            "log alone."
        )
    for channel in channels:
        claimed = max(
            len(channel), last[channel.path].expected_length if channel.path in last else 0
        )
        if claimed * (getattr(channel.data_type, "size", None) or 1) > size:
            raise LogError(
                f"{path.name}: the channel {' '.join(channel.name.split())!r} claims {claimed} "
                f"samples; no more than "
                f"the {size} bytes of the file were expected; copy the file again."
            )


def _one_log(
    groups: Sequence[Any], cut_off: bool, first: str | None, where: str
) -> tuple[list[TdmsChannel], tuple[Finding, ...]]:
    """Choose the channels that make one log: of the group with the most numeric ones and of those
    that fit beside it.

    Also given is a finding on the groups that are not read. A group fits if it repeats no name but
    that of the clock, and can be put beside the first in time. A channel without samples is none,
    but for one that a file that was cut off has lost.

    Parameters
    ----------
    first : name of the group to begin with

    Raises
    ------
    LogError : none is named, and groups that do not fit hold a motion as the chosen ones do
    """
    channels_of = {(g.name, c.name): c for g in groups for c in g.channels() if len(c) or cut_off}
    columns = describe([*channels_of.values()])
    filled = {group.name: [c for c in columns if c.group == group.name] for group in groups}
    counts = {name: sum(c.kind in NUMERIC for c in channels) for name, channels in filled.items()}
    ranked = sorted(filled, key=lambda name: (name != first, -counts[name]))
    taken, left = list(filled[ranked[0]]) if ranked else [], dict[str, str]()
    for name in ranked[1:]:
        if any(c.kind in NUMERIC + STAMPS for c in filled[name]):
            known = {c.header.name for c in taken}
            obstacle = _obstacle(taken, filled[name])
            if obstacle is None:
                taken += [c for c in filled[name] if c.header.name not in known]
            else:
                left[name] = obstacle
    others = [name for name in left if moves(c.header for c in filled[name] if c.kind in NUMERIC)]
    if first is None and others and moves(c.header for c in taken if c.kind in NUMERIC):
        choose([ranked[0], *others], None, where, "group")
    taken = describe([channels_of[c.group, c.header.name] for c in taken])
    if not left:
        return taken, ()
    listed = first_of([f"{name!r} {why}" for name, why in left.items()], MAX_NAMED)
    message = f"{len(left)} group{'s' * (len(left) > 1)} beside {ranked[0]!r}: {listed}"
    return taken, (Finding("unknown_column", message, "not read", count=len(left)),)


def _obstacle(taken: Sequence[TdmsChannel], channels: Sequence[TdmsChannel]) -> str | None:
    """Describe why a group cannot be read beside the channels already taken; None where it can."""
    known = {c.header.name for c in taken}
    if any(c.header.name in known and recognise(c.header) != "time" for c in channels):
        return "with channels of the same names, another recording"
    first, second = (
        [c for c in side if c.kind in NUMERIC and recognise(c.header) != "time"]
        for side in (taken, channels)
    )
    spans = [
        [(c.clock.start, c.clock.end(c.length)) for c in side if c.clock]
        for side in (first, second)
    ]
    if first and second and len(spans[0] + spans[1]) == len(first + second):
        begins, ends = (
            [min(b for b, _ in span) for span in spans],
            [max(e for _, e in span) for span in spans],
        )
        return None if max(begins) <= min(ends) else "sampled at another time"
    rows = sorted(max(c.length for c in side) for side in (taken, channels))
    return (
        None
        if rows[1] - rows[0] <= LENGTH_SHARE_MAX * rows[1]
        else "with neither a clock nor as many rows"
    )


def describe(channels: Sequence[Any]) -> list[TdmsChannel]:
    """Describe channels, their clocks counted from the earliest start time among them."""

    def number(value: Any) -> float:
        return (
            float(value)
            if isinstance(value, int | float | np.number) and np.isfinite(value)
            else 0.0
        )

    starts = [c.properties.get("wf_start_time") for c in channels]
    starts = [
        start if isinstance(start, np.datetime64) and start > CLOCK_SET_MIN else None
        for start in starts
    ]
    earliest = min((start for start in starts if start is not None), default=None)
    described = []
    for c, begun in zip(channels, starts, strict=True):
        step, clock = number(c.properties.get("wf_increment")), None
        if step > 0.0 and c.dtype.kind in NUMERIC:
            late = (
                0.0 if begun is None else float((begun - earliest) / np.timedelta64(1, "us")) / 1e6
            )
            clock = Waveform(step, late + number(c.properties.get("wf_start_offset")))
        header = Header(c.name, first_text(c.properties, UNIT_PROPERTIES))
        described.append(TdmsChannel(header, c.group_name, len(c), c.dtype.kind, clock))
    return described


def _shared(clocks: Iterable[Waveform | None]) -> Waveform | None:
    """Find the clock of most channels, the finer one of two alike."""
    counts = Counter(clock for clock in clocks if clock is not None)
    return max(counts, key=lambda clock: (counts[clock], -clock.step), default=None)


def _load(
    path: Path,
    columns: Sequence[TdmsChannel],
    usual: Waveform | None,
    findings: tuple[Finding, ...],
    wanted: Sequence[int],
    time: int | None,
) -> LogTable:
    """Read the wanted channels: on one clock, or row by row where a time channel or nothing has the
    stamps.

    The clock is that of most channels or, where their rates differ, of most of the fastest.
    LogError for an empty channel.
    """
    used = {k: columns[k] for k in (wanted if time is None else [*wanted, time])}
    require_numbers(path, max((c.length for c in used.values()), default=0), len(used))
    with _opened(path) as tdms:
        raw = {k: tdms[column.group][column.header.name].read_data() for k, column in used.items()}
    empty = [column.header.name for k, column in used.items() if len(raw[k]) == 0]
    if empty:
        raise LogError(
            f"{path.name}: the channels {', '.join(empty)} have no samples; as many as in the "
            f"others were "
            "expected; copy the file again or leave these channels out of the rig file."
        )
    clocks = [clock for k in wanted if (clock := columns[k].clock) is not None]
    fastest = min((clock.step for clock in clocks), default=0.0)
    reference = _shared(
        clock for clock in clocks if clock.step <= (1.0 + WHOLE_SAMPLE_SHARE) * fastest
    )
    one_clock = all(
        c.step <= (1.0 + WHOLE_SAMPLE_SHARE) * fastest
        and c.start - min(o.start for o in clocks) <= fastest
        for c in clocks
    )
    # A column of stamps belongs to every row, unless it is that of one of several clocks.
    if reference is None or (time is not None and (one_clock or len(clocks) < len(wanted))):
        return _by_rows(raw, wanted, time, findings)
    tracks = {k: columns[k].clock or reference for k in wanted}
    t, cut = common_stamps(path, reference, [(tracks[k], len(raw[k])) for k in wanted])
    values = {k: _at(t, _numbers(raw[k]), tracks[k], reference.step) for k in wanted}
    slow = [k for k in wanted if tracks[k].step > (1.0 + WHOLE_SAMPLE_SHARE) * reference.step]
    if slow:
        listed = ", ".join(f"{columns[k].header.name} every {tracks[k].step:g} s" for k in slow)
        message = (
            f"sampled more slowly than the fastest channel, every {reference.step:g} s: {listed}"
        )
        cut = (
            Finding("coarse_sampling", message, "interpolated by straight lines", count=len(slow)),
            *cut,
        )
    # These stamps are seconds, whatever the unit of a column of stamps, as `stamped` states.
    stamps = None if reference == usual and t[0] == reference.start else t
    return LogTable(values, stamps, stamped=time is not None, findings=(*findings, *cut))


def common_stamps(
    path: Path, reference: Waveform, tracks: Sequence[tuple[Waveform, int]]
) -> tuple[Signal, tuple[Finding, ...]]:
    """Find the stamps of the reference clock at which every channel was sampled, and report what
    lies outside. [s]

    Raises
    ------
    LogError
        there is no such stamp
    """
    begins, ends = (
        [clock.start for clock, _ in tracks],
        [clock.end(length) for clock, length in tracks],
    )
    first = np.ceil((max(begins) - reference.start) / reference.step - WHOLE_SAMPLE_SHARE)
    last = np.floor((min(ends) - reference.start) / reference.step + WHOLE_SAMPLE_SHARE)
    if not np.isfinite([*begins, *ends, first, last]).all() or last < first:
        raise LogError(
            f"{path.name}: one channel begins at {max(begins):g} s and another ends at "
            f"{min(ends):g} s; channels that overlap "
            "in time were expected; check their wf_start_time, wf_start_offset and wf_increment."
        )
    t = reference.start + reference.step * np.arange(int(first), int(last) + 1, dtype=np.float64)
    trimmed = max(ends) - min(begins) - (t[-1] - t[0])
    if trimmed <= TRIM_REPORTED_MIN * (max(ends) - min(begins)):
        return t, ()
    lost = round(trimmed / reference.step)
    span = f"between {min(begins):.3f} and {max(ends):.3f} s"
    message = f"the channels begin or end apart: {lost} samples {span} are not in every one"
    action = f"left out what lies outside {t[0]:.3f} to {t[-1]:.3f} s"
    return t, (Finding("dropped_samples", message, action, count=lost, removed=lost),)


def _at(t: Signal, values: Signal, clock: Waveform, step: float) -> Signal:
    """Take a channel at stamps of another clock: its own samples where they coincide, else
    interpolated. [s]
    """
    shift = (t[0] - clock.start) / clock.step
    whole = round(shift)
    if (
        abs(shift - whole) <= WHOLE_SAMPLE_SHARE
        and abs(clock.step - step) * len(t) / step <= WHOLE_SAMPLE_SHARE
    ):
        return values[whole : whole + len(t)]
    return np.interp(t, clock.start + clock.step * np.arange(len(values)), values)


def _by_rows(
    raw: Mapping[int, Any], wanted: Sequence[int], time: int | None, findings: tuple[Finding, ...]
) -> LogTable:
    """Put the channels side by side, as far as the shortest goes."""
    rows = min(map(len, raw.values()), default=0)
    lost = max(map(len, raw.values()), default=0) - rows
    if lost:
        message = f"the channels differ in length: the last {lost} samples are not in every one"
        findings += (Finding("dropped_samples", message, "left out", count=lost, removed=lost),)
    columns = {
        k: pa.array(x[:rows] if x.dtype.kind in "OM" else _numbers(x[:rows]))
        for k, x in raw.items()
    }
    return log_table([columns], wanted, time, findings)


def _numbers(samples: Any) -> Signal:
    """Convert samples to numbers; NaN for texts, stamps and complex numbers."""
    return np.asarray(
        samples if samples.dtype.kind in NUMERIC else np.full(len(samples), np.nan),
        dtype=np.float64,
    )
