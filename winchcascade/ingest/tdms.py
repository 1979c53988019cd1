"""LabVIEW TDMS: one group of channels, brought onto one clock where they were sampled apart."""

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

from winchcascade.errors import LogError
from winchcascade.ingest.align import Waveform, at, common_stamps, shared
from winchcascade.ingest.source import Header, Source, Table
from winchcascade.run import Finding

if TYPE_CHECKING:
    from winchcascade.run import Signal

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "Unit", "unit")

UNSET = np.datetime64("1904-01-02", "us")
"""A start time before this one was never set: LabVIEW counts from 1904 and writes a zero."""

class _Column(msgspec.Struct, frozen=True):
    """One channel as its metadata describe it; the clock is None for a channel that is no waveform of numbers."""

    header: Header
    group: str
    channel: str
    length: int
    clock: Waveform | None


def open_tdms(path: Path) -> Source:
    """Open the group with the most numeric channels.

    Raises
    ------
    LogError
        the file is damaged, claims more than it holds, or has no numeric channel, here or while channels are read
    """
    with _opened(path) as tdms:
        groups = _groups(path, tdms)
        columns = _columns(groups, tdms.file_status.incomplete_final_segment)
        properties = _properties([tdms.properties, groups[0].properties])
        findings = _truncation(tdms)
    clock = shared(column.clock for column in columns)
    return Source(
        headers=tuple(column.header for column in columns),
        load=partial(_load, path, columns, clock, findings),
        form="LabVIEW TDMS",
        time_step=clock.step if clock else None,
        time_start=clock.start if clock else 0.0,
        properties=properties,
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file and turn whatever its parser trips over into one sentence."""
    log_manager.set_level(logging.CRITICAL)  # what the parser logs on stderr is said here by findings and errors
    try:
        # A stream, not a path: beside a path the parser would trust an index file that may be an old one.
        with path.open("rb") as stream:
            if stream.read(4) != b"TDSm":
                raise ValueError("no TDMS segment at the start")
            stream.seek(0)
            with TdmsFile.open(stream) as tdms, np.errstate(all="ignore"):
                yield tdms
    except LogError:
        raise
    except Exception as fault:  # the parser itself raises bare Exceptions
        raise LogError(
            f"{path.name}: the file is damaged or breaks off ({type(fault).__name__}); a whole TDMS file was expected; "
            "copy it again or export it as CSV."
        ) from fault


def _groups(path: Path, tdms: Any) -> list[Any]:
    """Pick the group with the most numeric channels, and behind it those that name their channels alike.

    Raises
    ------
    LogError
        no group has a numeric channel, or a channel claims more samples than the file has bytes for
    """
    _refuse_lies(path, tdms)
    names = {group.name: {c.name for c in group.channels() if _is_numeric(c)} for group in tdms.groups()}
    groups = sorted(tdms.groups(), key=lambda group: -len(names[group.name]))
    if not groups or not names[groups[0].name]:
        raise LogError(
            f"{path.name}: no group holds a channel of numbers; at least one was expected; export the log again with "
            "its samples."
        )
    return [group for group in groups if group is groups[0] or names[group.name] == names[groups[0].name]]


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


def _is_numeric(channel: Any) -> bool:
    return channel.dtype.kind in "biuf"


def _columns(groups: Sequence[Any], cut_off: bool) -> list[_Column]:
    """Describe the channels; their names carry the group where two groups name them alike.

    A channel without samples is no column, but in a file that was cut off it is one that was lost.
    """
    channels = [channel for group in groups for channel in group.channels() if len(channel) or cut_off]
    starts = [start for c in channels if (start := _start_time(c)) is not None]
    return [
        _Column(
            Header(f"{c.group_name}/{c.name}" if len(groups) > 1 else c.name, _unit(c.properties)),
            c.group_name,
            c.name,
            len(c),
            _clock(c, min(starts, default=None)),
        )
        for c in channels
    ]


def _unit(properties: Mapping[str, Any]) -> str | None:
    units = (str(properties[key]).strip() for key in UNIT_PROPERTIES if key in properties)
    return next((unit for unit in units if unit), None)


def _start_time(channel: Any) -> Any | None:
    start = channel.properties.get("wf_start_time")
    return start if isinstance(start, np.datetime64) and start > UNSET else None


def _clock(channel: Any, earliest: Any | None) -> Waveform | None:
    """Read the clock of a waveform, its stamps counted from the earliest start time of all channels."""
    step = _finite(channel.properties.get("wf_increment"))
    if step <= 0.0 or not _is_numeric(channel):
        return None
    start = _start_time(channel)
    late = 0.0 if start is None else float((start - earliest) / np.timedelta64(1, "us")) / 1e6
    return Waveform(step, late + _finite(channel.properties.get("wf_start_offset")))


def _finite(value: Any) -> float:
    """Take a property as a number; 0 for one that is absent or none."""
    return float(value) if isinstance(value, int | float | np.number) and np.isfinite(value) else 0.0


def _properties(levels: Sequence[Mapping[str, Any]]) -> dict[str, str | float]:
    """Merge the texts and numbers of the file and of the group; the group's win."""
    merged = {str(name): value for level in levels for name, value in level.items()}
    return {
        name: value if isinstance(value, str) else float(value)
        for name, value in merged.items()
        if isinstance(value, str | int | float | np.number)
    }


def _truncation(tdms: Any) -> tuple[Finding, ...]:
    if not tdms.file_status.incomplete_final_segment:
        return ()
    message = "the file breaks off inside its last segment"
    return (Finding("truncated", message, "read up to the last sample that every channel has"),)


def _load(
    path: Path,
    columns: Sequence[_Column],
    usual: Waveform | None,
    findings: tuple[Finding, ...],
    wanted: Sequence[int],
    time: int | None,
) -> Table:
    """Read the wanted channels: on one clock, or row by row where a time channel or nothing has the stamps."""
    with _opened(path) as tdms:
        needed = [*wanted] if time is None else [*wanted, time]
        raw = {i: tdms[columns[i].group][columns[i].channel].read_data() for i in needed}
        empty = [columns[i].header.name for i in needed if len(raw[i]) == 0]
        if empty:
            raise LogError(
                f"{path.name}: the channels {', '.join(empty)} have no samples; as many as in the others were "
                "expected; copy the file again or leave these channels out of the rig file."
            )
        reference = shared(columns[i].clock for i in wanted) if time is None else None
        if reference is None:
            return _by_rows(raw, wanted, time, findings)
        clocks = {i: columns[i].clock or reference for i in wanted}
        t, cut = common_stamps(path, reference, [(clocks[i], len(raw[i])) for i in wanted])
        values = {i: at(t, _numbers(raw[i]), clocks[i], reference.step) for i in wanted}
        told = reference == usual and t[0] == reference.start
        return Table(values, stamps=None if told else t, findings=findings + cut)


def _by_rows(raw: Mapping[int, Any], wanted: Sequence[int], time: int | None, findings: tuple[Finding, ...]) -> Table:
    """Put the channels side by side, as far as the shortest goes."""
    rows = min(map(len, raw.values()), default=0)
    lost = max(map(len, raw.values()), default=0) - rows
    if lost:
        message = f"the channels differ in length: the last {lost} samples are not in every one"
        findings += (Finding("dropped_samples", message, "left out", count=lost, removed=lost),)
    values = {i: _numbers(raw[i][:rows]) for i in wanted}
    if time is None:
        return Table(values, findings=findings)
    stamps = raw[time][:rows]
    if stamps.dtype.kind == "M":
        seconds: Signal = (stamps - stamps[0]) / np.timedelta64(1, "s")
        return Table(values, stamps=seconds, stamped=True, findings=findings)
    return Table(
        values, stamps=[*map(str, stamps)] if stamps.dtype.kind == "O" else _numbers(stamps), findings=findings
    )


def _numbers(samples: Any) -> Signal:
    """Convert samples to numbers; NaN for texts, stamps and complex numbers."""
    if samples.dtype.kind not in "biuf":
        return np.full(len(samples), np.nan)
    return np.asarray(samples, dtype=np.float64)
