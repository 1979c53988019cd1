"""Read a file of any known format as a checked Run; a file that cannot be used raises LogError
with the reason.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
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
from winchcascade.ingest.assign import Assignment, assign, load_column, of_machine
from winchcascade.ingest.checks.quality import check
from winchcascade.ingest.clock import Clock
from winchcascade.ingest.clock_steps import without_steps
from winchcascade.ingest.headers import nameless
from winchcascade.ingest.log_clock import first_stamp, is_clock, log_clock, start_of
from winchcascade.ingest.open_log import open_log
from winchcascade.ingest.phase_labels import label_column, phase_labels, steps_of_rows
from winchcascade.ingest.source import MIN_ROWS, LogSource, LogTable
from winchcascade.ingest.stated_load import stated_load

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = LateModule("pandas")

OVERFLOW = 1e30
"""Instruments write 9.9e37 where they have no reading (SCPI); nothing measured comes near."""

READS_MAX = 3
"""A file that changed each of so many times while it was read is one that a logger still writes."""

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

    What is not given comes from the campaign.toml beside the log, if that lists it, as for the
    command `reduce`: rig, load, sheet, title, origin, and the window and cycles for the call
    `reduce`.

    Parameters
    ----------
    path : CSV of any dialect, LabVIEW's .lvm, TDMS, MATLAB .mat, NetCDF, Parquet or Excel; the
        content decides which. Or a DataFrame with the columns of a log and its clock in a column or the
        index; it is not changed
    rig : the rig whose sensors and columns are expected; by default that of the campaign, else the
        paper's, as assumed. The run keeps it for `reduce`.
    load : resistance at the DC link, inf for an open circuit; by default that of the campaign, else
        what a property of the file states, else None [ohm]
    table : name or number of the sheet of a workbook, of the run in a MATLAB file or of the TDMS
        group; needed where several could be the log
    load_source, about : source of the load, and a description of the log, for the reports
    origin : whether the data are measured and where they come from; the mark of `simulate`
        overrides it
    simulated : the log has no sensors that could be stuck or out of range, also without the mark of
        `simulate`
    units : of a DataFrame alone: units of its columns by their names, such as {"force": "kN"}
    name : of the run, in messages and reports; by default that of the file, or `data frame`
    campaign : False to read a file without the campaign.toml beside it
    repairs : "off" keeps what was logged, and the findings list what would be repaired. All the
        same cells without a number are bridged, stamps that do not rise are put in order, and signs
        are corrected

    Raises
    ------
    LogError : the log cannot be used; the message is one sentence
    CampaignError, RigError : the campaign.toml beside the log, or the rig that it names, cannot be
        used
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
    file = Path(path) if isinstance(path, str | os.PathLike) else None
    if file is not None:
        check_arguments("read_run", ("path", path, PATH))
    if file is not None and units is not None:
        raise OptionError(
            f"{file}: units are given for a file, which names its own; expected them with a "
            f"DataFrame alone. Leave units "
            "out, or state them in a rig file under [columns]."
        )
    sheet = None if table is None else str(table)
    settings = LogSettings(given_rig("read_run", rig))
    if campaign and file is not None:
        settings = settings_beside(file, rig, sheet)
    given = {
        "repairs": repairs,
        "load": load,
        "about": about or None,
        "origin": origin,
        "sheet": sheet,
    }
    given["load_source"] = None if load is None else load_source
    settings = replace(
        settings, **{key: value for key, value in given.items() if value is not None}
    )
    named = name or ("data frame" if file is None else file.name)
    run = read_by(
        path if file is None else file, settings, simulated=simulated, units=units or {}, name=named
    )
    return run if name is None else replace(run, name=one_line(name))


def read_by(
    log: Path | pd.DataFrame,
    settings: LogSettings,
    *,
    simulated: bool = False,
    units: Mapping[str, str] | None = None,
    name: str = "data frame",
) -> Run:
    """Read a log by settings that leave nothing open: LogError as `read_run`. `units` and `name`
    are those of a frame.
    """
    if isinstance(log, Path):
        run = _read_unchanged(log, settings, simulated=simulated)
        if settings.beside:
            from winchcascade.ingest.two_loggers import joined

            alone = replace(settings, sheet=None)
            others = [_read_unchanged(one, alone, simulated=simulated) for one in settings.beside]
            run = joined([run, *others], settings.rig)
    else:
        from winchcascade.ingest.formats.data_frame import frame_digest, open_frame

        loaded = _loaded(
            open_frame(log, where=name, units=units, table=settings.sheet), settings.rig, name
        )
        assumed = {
            finding.channel for finding in loaded.found.findings if finding.kind == "unit_assumed"
        }
        for channel, match in loaded.found.channels.items():
            column = loaded.source.headers[match.index].name
            if channel in assumed and units and units.get(column):
                raise LogError(
                    f"{name}: units gives {column!r} the unit {units[column]!r}, which is none of "
                    f"{channel}."
                )
        run = replace(
            _run_of(loaded, settings, where=name, simulated=simulated), sha256=frame_digest(log)
        )
    run = _with_origin(run, settings.origin)
    return run if settings.parts is None else replace(run, findings=(*run.findings, settings.parts))


def _read_unchanged(path: Path, settings: LogSettings, *, simulated: bool) -> Run:
    """Read a file that no logger writes to meanwhile; LogError for one that changes each time."""
    for _ in range(READS_MAX):
        before = _state(path)
        try:
            run = _read(path, settings, simulated=simulated)
        except LogError:
            if _state(path) == before:
                raise
            continue
        if _state(path) == before:
            return run
    raise LogError(
        f"{path}: changed each of {READS_MAX} times while it was read; expected a file that is "
        f"complete. Wait until the logger "
        "has closed it, or reduce a copy."
    )


def _state(path: Path) -> tuple[int, ...] | None:
    """Which file it is, its size and when it changed [ns]; None for a file that is not there."""
    try:
        about = os.stat(path)
    except OSError:  # its reader reports it
        return None
    return about.st_dev, about.st_ino, about.st_size, about.st_ctime_ns, about.st_mtime_ns


def _read(path: Path, settings: LogSettings, *, simulated: bool) -> Run:
    """Read and check a log that does not change meanwhile."""
    numbered = any(column.number is not None for column in settings.rig.columns.values())
    source = open_log(path, settings.sheet, numbered=numbered)
    try:
        loaded = _loaded(source, settings.rig, path.name)
    finally:
        source.close()
    run, digest = side_by_side(  # hashing leaves the interpreter free for other work
        lambda: _run_of(loaded, settings, where=path.name, simulated=simulated),
        lambda: fingerprint(path),
        samples=loaded.samples,
    )
    if not digest:
        raise LogError(f"{path}: could not be read to its end; check that the file is still there.")
    return replace(run, path=one_line(str(path)), sha256=digest)


class _Loaded(NamedTuple):
    """A log with its columns loaded; `labels` are the phases of its rows where a column states
    them, (n,).
    """

    source: LogSource
    found: Assignment
    table: LogTable
    labels: Signal | None

    @property
    def samples(self) -> int:
        return len(next(iter(self.table.values.values())))


def _loaded(source: LogSource, rig: Rig, where: str) -> _Loaded:
    """Load the channels, with the clock of a named column or else of the only column without a name
    that is one.

    A data frame may have its clock in the index, which has no name.
    """
    found = assign(source.headers, rig, where)
    label = (
        label_column(source.headers, rig.phases, where) if rig.phases.source == "column" else None
    )
    matched = [
        match.index for match in (*found.channels.values(), found.temperature) if match is not None
    ]
    wanted = list(
        dict.fromkeys(
            [*matched, *(k for k in (label, load_column(source.headers)) if k is not None)]
        )
    )
    table = None
    if found.time is None and source.time_step is None:
        columns = [
            k for k, header in enumerate(source.headers) if nameless(header) and k not in wanted
        ]
        clocks = [(k, loaded) for k in columns if is_clock(loaded := source.load(wanted, k))]
        if len(clocks) == 1:
            found, table = assign(source.headers, rig, where, clock=clocks[0][0]), clocks[0][1]
    if table is None:
        table = source.load(wanted, None if found.time is None else found.time.index)
    return _Loaded(
        source,
        found,
        table,
        None if label is None else phase_labels(table, label, rig.phases, where),
    )


def _run_of(loaded: _Loaded, settings: LogSettings, *, where: str, simulated: bool) -> Run:
    """Check the loaded columns of a log; the load is that of the settings, else that of a
    property of the log.
    """
    source, found, table, labels = loaded
    rig, load, load_source = settings.rig, settings.load, settings.load_source
    rows = rig.phases.source == "rows"
    if loaded.samples < (1 if rows else MIN_ROWS):
        raise LogError(
            f"{where}: the log has {loaded.samples} row{'' if loaded.samples == 1 else 's'} of "
            f"data; expected at least "
            f"{1 if rows else MIN_ROWS}, as of a test with a cycle. Where each row is the mean of "
            f"a step, set "
            'from = "rows" under [phases] of the rig file.'
        )
    clock = log_clock(source, table, found, rig, loaded.samples, where)
    load_findings: list[Finding] = []
    if load is None:
        load, load_source, load_findings = stated_load(source, table)
    channels = _channels(table, found, clock)
    if not (rows or found.simulated or simulated):
        clock = without_steps(clock, channels, where, settings.repairs)
    if rows:
        checked = steps_of_rows(channels, rig)
    else:
        simulated, open_circuit = found.simulated or simulated, load == math.inf
        checked = check(
            clock.t,
            channels,
            rig,
            simulated=simulated,
            open_circuit=open_circuit,
            repairs=settings.repairs,
        )
    if not checked.channels:
        raise LogError(
            f"{where}: the columns of motion and power hold no number; expected those of one "
            f"stage at least."
        )
    gaps = clock.gaps if rows else np.interp(clock.gaps, clock.t, checked.t).reshape(-1, 2)
    lost, t = np.concatenate((gaps, checked.clock)), sealed(checked.t)
    return Run(
        name=one_line(where),
        t=t,
        channels=sealed_channels(checked.channels, t, clock.fs),
        fs=clock.fs,
        samples=loaded.samples,
        gaps=dict(checked.gaps) | ({CLOCK: lost[np.argsort(lost[:, 0])]} if lost.size else {}),
        labels=labels if labels is None or clock.rows is None else labels[clock.rows],
        signs=checked.signs,
        load=load,
        load_source=load_source,
        about=settings.about,
        findings=(
            *found.findings,
            *load_findings,
            *table.findings,
            *clock.findings,
            *checked.findings,
        ),
        simulated=found.simulated,
        table=None if source.table is None else one_line(source.table),
        first_stamp=first_stamp(table.stamps),
        started=start_of(table, float(checked.t[0])),
        temperature=_temperature(table, found, checked.channels, rig),
        rig=checked.rig,
        window=settings.window,
        cycles=settings.cycles,
        repairs=settings.repairs,
    )


def _temperature(
    table: LogTable, found: Assignment, channels: Mapping[str, Signal], rig: Rig
) -> float | None:
    """Median of the temperature of the machine, in a channel of the rig's own or another column;
    None without exactly one.

    [K]
    """
    own = [
        name
        for name, one in rig.channels.items()
        if one.dimension == "temperature" and of_machine(name)
    ]
    read = [channels[name] for name in own if name in channels]
    if not read and found.temperature is not None:
        unit = found.temperature.unit or Unit("temperature", 1.0)
        column = table.values[found.temperature.index]
        read = [unit.factor * column[np.isfinite(column)] + unit.offset]
    return median(read[0]) if len(read) == 1 and read[0].size else None


def _with_origin(run: Run, stated: Origin) -> Run:
    """The log with its origin: that of its mark where `simulate` made it, with a finding if the
    campaign states otherwise.
    """
    if not run.simulated:
        return replace(run, origin=stated)
    if not stated.measured:
        origin = joint_origin([SIMULATED, stated]) if stated.measured is False else SIMULATED
        return replace(run, origin=origin)
    conflict = Finding(
        "origin_conflict",
        "the campaign states measured = true, but the log has the columns of a log made by "
        "winchcascade simulate",
        "taken as not measured",
    )
    return replace(run, origin=SIMULATED, findings=(conflict, *run.findings))


def _channels(table: LogTable, found: Assignment, clock: Clock) -> dict[str, Signal]:
    """Columns in SI units, in the rows that the clock kept."""
    channels = {}
    for name, match in found.channels.items():
        x = (
            table.values[match.index]
            if clock.rows is None
            else table.values[match.index][clock.rows]
        )
        x = x if x.flags.writeable else x.copy()
        if not (x.max(initial=0.0) < OVERFLOW and x.min(initial=0.0) > -OVERFLOW):
            x[np.abs(x) >= OVERFLOW] = np.nan
        if match.factor != 1.0:
            x *= match.factor
        if match.unit is not None and match.unit.offset:
            x += match.unit.offset
        channels[name] = x
    return channels
