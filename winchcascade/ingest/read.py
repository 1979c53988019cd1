"""Read a file of any known format as a checked Run; a file that cannot be used raises LogError with the reason."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from msgspec.structs import replace

from winchcascade.core.arguments import (
    FLAG,
    LOAD,
    NAME,
    ON_OFF,
    PATH,
    SHEET,
    TEXT,
    UNITS_OF_COLUMNS,
    Expected,
    check_arguments,
)
from winchcascade.core.campaign_file import SIMULATED, Origin, joint_origin
from winchcascade.core.campaign_settings import LogSettings, settings_beside
from winchcascade.core.checked_run import sealed, sealed_channels
from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.integrate import median
from winchcascade.core.jobs import side_by_side
from winchcascade.core.plain_text import one_line
from winchcascade.core.quantity import Unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import CLOCK, Finding, Repairs, Run, Signal
from winchcascade.core.store import fingerprint
from winchcascade.core.viewed import LateModule
from winchcascade.ingest.assign import Assignment, assign, listed, load_column, of_machine
from winchcascade.ingest.cells import looks_like_a_stamp, moment, seconds
from winchcascade.ingest.checks.quality import check
from winchcascade.ingest.clock import Clock, clock_of_digits, even_clock, read_clock, require_rising
from winchcascade.ingest.dialects import nameless
from winchcascade.ingest.open_log import open_log
from winchcascade.ingest.source import MIN_ROWS, LogSource, LogTable
from winchcascade.ingest.stated_load import stated_load

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = LateModule("pandas")

OVERFLOW = 1e30
"""Instruments write 9.9e37 where they have no reading (SCPI); nothing measured comes near."""

_TRIES = 3
"""A file that changed each time while it was read is one that a logger still writes."""

_SECOND = 1_000_000_000
"""One second. [ns]"""

_FRESH, _FRESH_IN_SECONDS = _SECOND // 20, 3 * _SECOND
"""Two changes of a file within one step of its file system's time have the same stamp: steps are 1 to 16 ms or, where stamps
are whole seconds (FAT), up to 2 s. [ns]
"""

FEW_ROWS = 200
"""Largest number of rows of a table without clock that may be step means."""

_MIN_STAMPS = 3
"""Fewer stamps show no clock."""


_ORIGIN = Expected("an Origin", lambda value: value is None or isinstance(value, Origin))


@np.errstate(invalid="ignore")  # a file of binary numbers may hold NaN of the kind that signals
def read_run(
    path: str | Path | pd.DataFrame,
    *,
    rig: Rig | None = None,
    load: float | None = None,
    load_source: str = "given",
    about: str = "",
    origin: Origin | None = None,
    table: str | None = None,
    simulated: bool = False,
    units: Mapping[str, str] | None = None,
    name: str | None = None,
    campaign: bool = True,
    repairs: Repairs = "on",
) -> Run:
    """Read a log, a file of any known format or a pandas DataFrame, and check it.

    What is not given comes from the campaign.toml beside the log, if that lists it, as for the command `reduce`: rig, load,
    sheet, title, origin, and the window and cycles for the call `reduce`.

    Parameters
    ----------
    path : CSV of any dialect, LabVIEW's .lvm, TDMS, MATLAB .mat, Parquet or Excel; the content decides which. Or a DataFrame
        with the columns of a log and its clock in a column or the index; it is not changed
    rig : the rig whose sensors and columns are expected; by default that of the campaign, else the paper's, as assumed. The run
        keeps it for `reduce`.
    load : resistance at the DC link, inf for an open circuit; by default that of the campaign, else what a property of the file
        states, else None [ohm]
    table : name or number of the sheet of a workbook, of the run in a MATLAB file or of the TDMS group; needed where several
        could be the log
    load_source, about : source of the load, and a description of the log, for the reports
    origin : whether the data are measured and where they come from; the mark of `simulate` overrides it
    simulated : the log has no sensors that could be stuck or out of range, also without the mark of `simulate`
    units : of a DataFrame alone: units of its columns by their names, such as {"force": "kN"}
    name : of the run, in messages and reports; by default that of the file, or `data frame`
    campaign : False to read a file without the campaign.toml beside it
    repairs : "off" keeps what was logged, and the findings list what would be repaired. All the same cells without a number are
        bridged, stamps that do not rise are put in order, and signs are corrected

    Raises
    ------
    LogError : the log cannot be used; the message is one sentence
    CampaignError, RigError : the campaign.toml beside the log, or the rig that it names, cannot be used
    OptionError : `units` are given for a file, which names its own, or `load` is none

    Examples
    --------
    >>> run = read_run("fixtures/campaign/r36ohm.csv")
    >>> run.samples, run.load, run.window
    (2767, 36.0, 5.48)
    """
    check_arguments(
        "read_run",
        ("load", load, LOAD),
        ("load_source", load_source, TEXT),
        ("about", about, TEXT),
        ("table", table, SHEET),
        ("simulated", simulated, FLAG),
        ("units", units, UNITS_OF_COLUMNS),
        ("name", name, NAME),
        ("campaign", campaign, FLAG),
        ("origin", origin, _ORIGIN),
        ("repairs", repairs, ON_OFF),
    )
    file = _file(path, units)
    sheet = None if table is None else str(table)
    settings = LogSettings(given_rig("read_run", rig))
    if campaign and file is not None:
        settings = settings_beside(file, rig, sheet)
    given = {"repairs": repairs, "load": load, "about": about or None, "origin": origin, "sheet": sheet}
    given["load_source"] = None if load is None else load_source
    settings = replace(settings, **{key: value for key, value in given.items() if value is not None})
    if file is None:
        return read_by(path, settings, simulated=simulated, units=units or {}, name=name or "data frame")
    run = read_by(file, settings, simulated=simulated)
    return run if name is None else replace(run, name=one_line(name))


def _file(path: str | Path | pd.DataFrame, units: Mapping[str, str] | None) -> Path | None:
    """Path of a log that is a file, None for a frame; OptionError for what is no path, and for units of a file."""
    if not isinstance(path, str | os.PathLike):
        return None
    check_arguments("read_run", ("path", path, PATH))
    if units is not None:
        raise OptionError(
            f"{path}: units are given for a file, which names its own; expected them with a DataFrame alone. Leave units "
            "out, or state them in a rig file under [columns]."
        )
    return Path(path)


def read_by(
    log: Path | pd.DataFrame,
    settings: LogSettings,
    *,
    simulated: bool = False,
    units: Mapping[str, str] | None = None,
    name: str = "data frame",
) -> Run:
    """Read a log by settings that leave nothing open: LogError as `read_run`. `units` and `name` are those of a frame."""
    if isinstance(log, Path):
        run = _read_unchanged(log, settings, simulated=simulated)
    else:
        from winchcascade.ingest.formats.data_frame import frame_digest, open_frame

        loaded = _opened(open_frame(log, where=name, units=units, table=settings.sheet), settings.rig, name)
        _check_units(loaded, units or {}, name)
        run = replace(_run_of(loaded, settings, where=name, simulated=simulated), sha256=frame_digest(log))
    run = _with_origin(run, settings.origin)
    return run if settings.parts is None else replace(run, findings=(*run.findings, settings.parts))


def _check_units(opened: _Opened, units: Mapping[str, str], where: str) -> None:
    """Reject a unit that a call states of a column and that is none of its channel: LogError."""
    assumed = {finding.channel for finding in opened.found.findings if finding.kind == "unit_assumed"}
    for channel, match in opened.found.channels.items():
        column = opened.source.headers[match.index].name
        if channel in assumed and units.get(column):
            raise LogError(f"{where}: units gives {column!r} the unit {units[column]!r}, which is none of {channel}.")


def _read_unchanged(path: Path, settings: LogSettings, *, simulated: bool) -> Run:
    """Read a file that no logger writes to meanwhile; LogError for one that changes each time."""
    for _ in range(_TRIES):
        seen = _Seen(path)
        try:
            run = _read(path, settings, simulated=simulated)
        except LogError:
            if seen.is_same():
                raise
            continue
        if seen.is_same(run.sha256):
            return run
    raise LogError(
        f"{path}: changed each of {_TRIES} times while it was read; expected a file that is complete. Wait until the logger "
        "has closed it, or reduce a copy."
    )


def _read(path: Path, settings: LogSettings, *, simulated: bool) -> Run:
    """Read and check a log that does not change meanwhile."""
    numbered = any(column.number is not None for column in settings.rig.columns.values())
    source = open_log(path, settings.sheet, numbered=numbered)
    try:
        loaded = _opened(source, settings.rig, path.name)
    finally:
        source.close()
    # Hashing leaves the interpreter free for other work.
    run, digest = side_by_side(
        lambda: _run_of(loaded, settings, where=path.name, simulated=simulated),
        lambda: fingerprint(path),
        samples=len(next(iter(loaded.table.values.values()))),
    )
    if not digest:
        raise LogError(f"{path}: could not be read to its end; check that the file is still there.")
    return replace(run, path=one_line(str(path)), sha256=digest)


class _Opened(NamedTuple):
    """A log with its columns loaded; `labels` are the phases of its rows where a column states them."""

    source: LogSource
    found: Assignment
    table: LogTable
    labels: Signal | None


def _opened(source: LogSource, rig: Rig, where: str) -> _Opened:
    """Load the columns that a rig needs."""
    found, table = _loaded(source, rig, where)
    return _Opened(source, found, table, _labels(source, found, table, rig, where))


def _run_of(opened: _Opened, settings: LogSettings, *, where: str, simulated: bool) -> Run:
    """Check the loaded columns of a log; the load is that of the settings, else that of a property of the log."""
    source, found, table, labels = opened
    rig, load, load_source = settings.rig, settings.load, settings.load_source
    samples = len(next(iter(table.values.values())))
    minimum = 1 if rig.phases.source == "rows" else MIN_ROWS
    if samples < minimum:
        raise LogError(
            f"{where}: the log has {samples} row{'' if samples == 1 else 's'} of data; expected at least {minimum}, as of a "
            'test with a cycle. Where each row is the mean of a step, set from = "rows" under [phases] of the rig file.'
        )
    clock, time_findings = _clock(source, table, found, rig, samples, where)
    if load is None:
        load, load_source, load_faults = stated_load(source, table)
        time_findings += load_faults
    channels, simulated = _channels(table, found, clock), found.simulated or simulated
    if rig.phases.source == "rows":
        from winchcascade.ingest.phase_labels import steps_of_rows

        checked = steps_of_rows(channels)
    else:
        open_circuit = load == math.inf
        checked = check(
            clock.t, channels, rig, simulated=simulated, open_circuit=open_circuit, repairs=settings.repairs
        )
    if not checked.channels:
        raise LogError(
            f"{where}: the columns of motion and power hold no number; expected those of one stage at least."
        )
    lost = checked.clock
    if clock.gaps.size:
        lost = np.concatenate((np.interp(clock.gaps, clock.t, checked.t), lost))
    return Run(
        name=one_line(where),
        t=sealed(checked.t),
        channels=sealed_channels(checked.channels),
        fs=clock.fs,
        samples=samples,
        gaps=dict(checked.gaps) | ({CLOCK: lost[np.argsort(lost[:, 0])]} if lost.size else {}),
        labels=labels if labels is None or clock.rows is None else labels[clock.rows],
        load=load,
        load_source=load_source,
        about=settings.about,
        findings=(*found.findings, *time_findings, *table.findings, *clock.findings, *checked.findings),
        simulated=found.simulated,
        table=None if source.table is None else one_line(source.table),
        first_stamp=_first_stamp(table.stamps),
        started=_started(table.stamps, float(checked.t[0])) if table.began is None else table.began,
        temperature=_temperature(table, found, checked.channels, rig),
        rig=rig,
        window=settings.window,
        cycles=settings.cycles,
        repairs=settings.repairs,
    )


def _first_stamp(stamps: Signal | Sequence[str] | None) -> str:
    """The first stamp as the log writes it; nothing where stamps are numbers."""
    if stamps is None or isinstance(stamps, np.ndarray):
        return ""
    return one_line(next((str(stamp) for stamp in stamps[:FEW_ROWS] if str(stamp).strip()), ""))


_DATED = 1e9, 5e9
"""Seconds since 1970 or, by LabVIEW, 1904, with which a clock of this century begins. [s]"""


def _started(stamps: Signal | Sequence[str] | None, first: float) -> float | None:
    """When the run began, on a clock that other logs share; None where its stamps carry no date. [s]

    Parameters
    ----------
    first : time of the first sample on the clock of the log [s]
    """
    if _DATED[0] <= first < _DATED[1]:
        return first
    if stamps is None:
        return None
    if not isinstance(stamps, np.ndarray):
        return next((moment(text) for text in stamps if looks_like_a_stamp(text)), None)
    good = stamps[np.isfinite(stamps)]
    digits = f"{good[0]:.0f}" if first == 0.0 and good.size else ""  # of a clock of digits, which begins at 0
    return moment(f"{digits[:8]}T{digits[8:]}") if len(digits) == _DIGITS else None


_DIGITS = len("YYYYMMDDHHMMSS")


def _temperature(table: LogTable, found: Assignment, channels: Mapping[str, Signal], rig: Rig) -> float | None:
    """Median of the temperature of the machine, in a channel of the rig's own or another column; None without exactly one.

    [K]
    """
    own = [name for name, one in rig.channels.items() if one.dimension == "temperature" and of_machine(name)]
    read = [channels[name] for name in own if name in channels]
    if not read and found.temperature is not None:
        unit = found.temperature.unit or Unit("temperature", 1.0)
        column = table.values[found.temperature.index]
        read = [unit.factor * column[np.isfinite(column)] + unit.offset]
    return median(read[0]) if len(read) == 1 and read[0].size else None


def _with_origin(run: Run, stated: Origin) -> Run:
    """The log with its origin: that of its mark where `simulate` made it, with a finding if the campaign states otherwise."""
    if not run.simulated:
        return replace(run, origin=stated)
    if not stated.measured:
        origin = joint_origin([SIMULATED, stated]) if stated.measured is False else SIMULATED
        return replace(run, origin=origin)
    conflict = Finding(
        "origin_conflict",
        "the campaign states measured = true, but the log has the columns of a log made by winchcascade simulate",
        "taken as not measured",
    )
    return replace(run, origin=SIMULATED, findings=(conflict, *run.findings))


def _loaded(source: LogSource, rig: Rig, where: str) -> tuple[Assignment, LogTable]:
    """The channels, with the clock of a named column or else of the only column without a name that is one.

    A data frame may have its clock in the index, which has no name.
    """
    found = assign(source.headers, rig, where)
    wanted = [match.index for match in found.channels.values()]
    wanted += [] if found.temperature is None else [found.temperature.index]
    if rig.phases.source == "column":
        from winchcascade.ingest.phase_labels import label_column

        wanted = list(dict.fromkeys([*wanted, label_column(source.headers, rig.phases, where)]))
    written = load_column(source.headers)
    wanted += [] if written is None else [written]
    table = None
    if found.time is None and source.time_step is None:
        columns = [k for k, header in enumerate(source.headers) if nameless(header) and k not in wanted]
        clocks = [(k, loaded) for k in columns if _is_clock(loaded := source.load(wanted, k))]
        if len(clocks) == 1:
            found, table = assign(source.headers, rig, where, clock=clocks[0][0]), clocks[0][1]
    if table is None:
        table = source.load(wanted, found.time.index if found.time else None)
    return found, table


def _labels(source: LogSource, found: Assignment, table: LogTable, rig: Rig, where: str) -> Signal | None:
    """Phase of each row where the rig names a column of them, (n,)."""
    if rig.phases.source != "column":
        return None
    from winchcascade.ingest.phase_labels import label_column, phase_labels

    column, time = label_column(source.headers, rig.phases, where), None if found.time is None else found.time.index
    return phase_labels(source, table, column, rig.phases, where, time=time)


def _is_clock(table: LogTable) -> bool:
    """Whether a column holds stamps, or numbers that rise throughout; whole numbers are no clock, as they count rows."""
    stamps = table.stamps
    if stamps is None:
        return False
    if not isinstance(stamps, np.ndarray):
        return 2 * sum(map(looks_like_a_stamp, stamps)) > len(stamps)
    good = stamps[np.isfinite(stamps)]
    if good.size < _MIN_STAMPS or table.stamped:
        return good.size >= _MIN_STAMPS and bool(good[-1] > good[0])
    return bool(np.all(good[1:] > good[:-1]) and np.any(good != np.rint(good)))


class _Seen:
    """A file as it was before it was read, to find out whether the digest is of the bytes that were parsed.

    Stamps show that, as long as the last change lies further back than the steps in which a file system counts time; of a file
    that was changed just now the digest is taken before it is read, too.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before = self._stamps()
        self._sha256 = fingerprint(path) if self._is_fresh() else ""

    def _stamps(self) -> tuple[int, ...] | None:
        try:
            about = os.stat(self._path)
        except OSError:  # its reader reports it
            return None
        return about.st_dev, about.st_ino, about.st_size, about.st_ctime_ns, about.st_mtime_ns

    def _is_fresh(self) -> bool:
        if self._before is None or not self._path.is_file():
            return False
        *_, changed, written = self._before
        step = _FRESH if written % _SECOND else _FRESH_IN_SECONDS
        return time.time_ns() - max(changed, written) < step

    def is_same(self, sha256: str = "") -> bool:
        """Whether the file is still the same, and of this digest where it is given."""
        return self._stamps() == self._before and (not (self._sha256 and sha256) or self._sha256 == sha256)


def _clock(
    source: LogSource, table: LogTable, found: Assignment, rig: Rig, samples: int, where: str
) -> tuple[Clock, list[Finding]]:
    """Stamps from the time column, else from the increment that the file or the rig file states; rows of step means have
    none.
    """
    if rig.phases.source == "rows":
        return even_clock(samples, 1.0, 0.0), []
    if table.stamps is None:
        step = source.time_step or (rig.sample_rate and 1.0 / rig.sample_rate)
        if step is None:
            means = ' For rows that are step means, set from = "rows" under [phases].' if samples <= FEW_ROWS else ""
            raise LogError(
                f"{where}: no time column and no sampling interval; the log has "
                f"{listed([h.name.strip() for h in source.headers])}. Name the column in a rig file under [columns], or "
                f"its rate as sample_rate_hz under [log].{means}"
            )
        clock = even_clock(samples, step, source.time_start if source.time_step else 0.0)
        require_rising(clock.t, where)
        return clock, []
    stamps = table.stamps if isinstance(table.stamps, np.ndarray) else seconds(table.stamps)
    if table.stamped or stamps is not table.stamps or found.time is None:
        return read_clock(stamps, where), []
    factor = found.time.factor
    findings = []
    if found.time.unit is None:
        digits = clock_of_digits(stamps)
        if digits is not None:
            return read_clock(digits, where), []
        factor, finding = _assumed_time(stamps, table, found)
        findings.append(finding)
    return read_clock(stamps if factor == 1.0 else stamps * factor, where, unit=factor), findings


_TIME_UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


def _assumed_time(stamps: Signal, table: LogTable, found: Assignment) -> tuple[float, Finding]:
    """Unit of a time column that names none: the one with which the velocity gives the displacement, else by its steps."""
    step = np.diff(stamps[np.isfinite(stamps)])
    usual = median(step) if step.size else 0.0
    unit, why = ("ms", "its steps are long") if usual >= 2 else ("s", "the usual unit")
    moved, speed = found.channels.get("displacement"), found.channels.get("velocity")
    if moved is not None and speed is not None and usual > 0:
        with np.errstate(over="ignore", invalid="ignore"):
            travelled = float(np.nansum(np.abs(np.diff(table.values[moved.index])))) * moved.factor
            expected = float(np.nansum(np.abs(table.values[speed.index]))) * speed.factor * usual
        if 0 < travelled < math.inf and 0 < expected < math.inf:
            ratio = math.log(travelled) - math.log(expected)  # the quotient itself may be too small for a number
            unit = min(_TIME_UNITS, key=lambda name: abs(math.log(_TIME_UNITS[name]) - ratio))
            why = "with which velocity and displacement agree"
    column = "the time column names no unit" if found.time_named else "the clock is a column without name or unit"
    return _TIME_UNITS[unit], Finding("unit_assumed", f"{column}; taken as {unit}, {why}", "assumed")


def _channels(table: LogTable, found: Assignment, clock: Clock) -> dict[str, Signal]:
    """Columns in SI units, in the rows that the clock kept."""
    channels = {}
    for name, match in found.channels.items():
        x = table.values[match.index] if clock.rows is None else table.values[match.index][clock.rows]
        x = x if x.flags.writeable else x.copy()
        if not (x.max(initial=0.0) < OVERFLOW and x.min(initial=0.0) > -OVERFLOW):
            x[np.abs(x) >= OVERFLOW] = np.nan
        if match.factor != 1.0:
            x *= match.factor
        if match.unit is not None and match.unit.offset:
            x += match.unit.offset
        channels[name] = x
    return channels
