"""What a log shows before a rig file exists: columns with units and ranges, clock, and what its
currents show of the load.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_settings import LogSettings
from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median
from winchcascade.core.log_thresholds import LogScales, log_scales
from winchcascade.core.quantity import Unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.ingest.headers import Header, nameless, read_header, recognise
from winchcascade.ingest.open_log import open_log
from winchcascade.ingest.read import read_by
from winchcascade.ingest.source import MIN_ROWS

COLUMNS_MAX = 300
"""Columns of a log that are looked at: one with more is read once a rig file names its columns."""

CARRIES = 0.5
"""Share of the usual top of a current or a speed beyond which a sample counts for a ratio. [1]"""

TOP = 0.95
"""Quantile that is taken as the top of a channel: some samples may be spikes. [1]"""


ANY_RATE = 1.0
"""Rate by which a log without a readable clock is looked at: loads and units show at any. [Hz]"""


class ColumnFacts(msgspec.Struct, frozen=True):
    """One column: its header as the file has it, its unit and the channel that its name means, None
    for none of them, and the range of its values in the unit of the file.
    """

    header: Header
    unit: Unit | None
    channel: str | None
    low: float
    high: float

    @property
    def name(self) -> str:
        """Name by which a rig file names the column."""
        return self.header.name.strip()

    @property
    def electrical(self) -> bool:
        """Whether the column is a voltage or a current."""
        return self.channel in ("vdc", "idc") or (
            self.unit is not None and self.unit.dimension in ("voltage", "current")
        )


class LogFacts(msgspec.Struct, frozen=True):
    """One log, and in `fault` why it cannot be read by the rig as it is.

    What needs a run is then None or empty, unless a rate of samples is all that is missing.

    Parameters
    ----------
    channels, without_unit : that were read, and those of them whose columns name no unit
    started : when it began, of a local time as if it were UTC, since 1970; None where its stamps
        have no date [s]
    load, load_source : load that the file states of itself [ohm], and where
    top_current : top of the current, None without one [A]
    ratio : Vdc over Idc while the current flows, None without both [ohm]
    turn : speed of rotation over velocity of the line in motion, None without both [rad/m]
    simulated : the log carries the mark of `simulate`
    has_clock : whether a time column or the file itself gives times of the samples that can be read
    scales : of its motion and its torque, None where it cannot be read
    """

    path: Path
    columns: tuple[ColumnFacts, ...]
    fault: str = ""
    channels: tuple[str, ...] = ()
    without_unit: tuple[str, ...] = ()
    started: float | None = None
    load: float | None = None
    load_source: str = ""
    top_current: float | None = None
    ratio: float | None = None
    turn: float | None = None
    simulated: bool = False
    has_clock: bool = True
    scales: LogScales | None = None


def log_facts(path: Path, rig: Rig) -> LogFacts:
    """Look at one log, read by a rig that may name some of its columns.

    LogError where it cannot be opened, or has no table of numbers.
    """
    numbered = any(column.number is not None for column in rig.columns.values())
    source = open_log(path, numbered=numbered)
    try:
        headers = tuple(source.headers[:COLUMNS_MAX])
        table = source.load(range(len(headers)), None)
        values = [table.values[k] for k in range(len(headers))]
    finally:
        source.close()
    columns = tuple(map(_column, headers, values))
    if not any(np.isfinite(x).sum() >= 1 for x in values) or max(map(len, values)) < MIN_ROWS:
        raise LogError(f"{path.name}: has no table of at least {MIN_ROWS} rows of numbers.")
    timed = source.time_step is not None or any(
        c.channel == "time" or nameless(c.header) for c in columns
    )
    fault = ""
    try:
        run = read_by(path, LogSettings(rig))
    except LogError as found:
        fault = str(found)
        try:
            run = read_by(path, LogSettings(replace(rig, sample_rate=ANY_RATE)))
        except LogError:
            return LogFacts(path, columns, fault, has_clock=timed)
    return LogFacts(
        path,
        columns,
        fault,
        channels=tuple(run.channels),
        without_unit=tuple(
            f.channel for f in run.findings if f.kind == "unit_assumed" and f.channel
        ),
        started=run.started,
        load=run.load,
        load_source=run.load_source,
        top_current=_top(run, "idc"),
        ratio=_ratio(run, "vdc", "idc"),
        turn=_ratio(run, "speed", "velocity"),
        simulated=run.simulated,
        has_clock=timed and not fault,
        scales=log_scales(run.t, run.channels, rig),
    )


def _column(header: Header, values: Signal) -> ColumnFacts:
    good = values[np.isfinite(values)]
    ends = (float(good.min()), float(good.max())) if good.size else (np.nan, np.nan)
    return ColumnFacts(header, read_header(header).unit, recognise(header), *ends)


def _top(run: Run, channel: str) -> float | None:
    """Top of the size of a channel, in its SI unit."""
    return (
        float(np.quantile(np.abs(run.channels[channel]), TOP)) if channel in run.channels else None
    )


def _ratio(run: Run, over: str, under: str) -> float | None:
    """Median of the quotient of two channels where the lower one is large, in SI units."""
    top = _top(run, under)
    if over not in run.channels or not top:
        return None
    large = run.channels[under] > CARRIES * top
    return median(run.channels[over][large] / run.channels[under][large]) if large.any() else None
