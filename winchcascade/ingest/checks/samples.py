"""A log while it is checked: which of its samples are lost, what its channels usually do, how
holes are bridged.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import msgspec
import numpy as np

from winchcascade.core.channels import Channel
from winchcascade.core.integrate import (
    ENOUGH,
    between,
    distinct,
    positive_median,
    stretches_of,
    usual_interval,
)
from winchcascade.core.quantity import find_unit
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Finding, FindingKind, Index, Mask, Repair, Signal
from winchcascade.core.smooth import local_quadratic

if TYPE_CHECKING:
    from numpy.typing import NDArray

SLOPE_WIDTH = 2 / 3
"""Width of the local quadratic of a displacement whose slope is a velocity, as a share of that
which smooths a velocity: the steps of an encoder do not show. [1]"""

SPREAD = 20_000
"""Number of samples, evenly over the log, that show the range of a channel. [1]"""

OF_RANGE = 0.02
"""Smallest size of a fault of one sample, in ranges of its channel: in a payout of a hundred
samples, less moves no energy by a thousandth. [1]"""

LONGER = 5.0
"""The same of a fault of several samples, in sizes of one sample. [1]"""

OF_NOISE = 8.0
"""And in standard deviations of white noise: once in 1e15 samples of a normal distribution. [1]"""

FAR = 5.0
"""Distance of a value from the range of a channel, in ranges, beyond which it is no measurement.
[1]
"""


ROUNDED_STAMPS = 1e-6
"""Share of an interval by which stamps are rounded. [1]"""

Directions: TypeAlias = "NDArray[np.int8]"
"""1, -1 or 0 for each sample."""


class Level(NamedTuple):
    """What a channel usually does, in its unit.

    Parameters
    ----------
    low, high, span, top : ends of the range in which it moves, their distance, and the largest
        magnitude
    noise, step : white noise, and resolution
    fault : smallest jump of a fault: beyond noise, and two neighbouring values of a coarse channel
    long_fault : the same of several samples, which the machine may make more easily than one
    moves : whether it contains more than noise
    """

    low: float
    high: float
    noise: float
    step: float
    span: float
    top: float
    fault: float
    long_fault: float
    moves: bool

    def is_far(self, x: Signal) -> Mask:
        """Whether values are no measurements; every machine may rest at zero."""
        low, high = min(self.low, 0.0), max(self.high, 0.0)
        reach = FAR * (high - low) if self.moves else np.inf
        if x.min() >= low - reach and x.max() <= high + reach:  # not so with a hole
            return np.zeros(x.shape, dtype=bool)
        return (x < low - reach) | (x > high + reach)


def level_of(x: Signal) -> Level:
    """Describe a channel, NaN where it has holes; a value to which it jumps again and again does
    not belong to its range.
    """
    spread = x[:: max(1, x.size // SPREAD)]
    spread, begin = spread[np.isfinite(spread)], x[:ENOUGH]
    begin = begin[np.isfinite(begin)]
    if begin.size < 4 or not spread.size:
        return _level(0.0, 0.0, 0.0, 0.0)
    steps = np.diff(begin)
    changes = np.abs(steps)
    # Medians of white noise are 0.954 and 1.652 standard deviations; a ramp shows in the one, a
    # ringing in the other.
    noise = min(positive_median(changes) / 0.954, positive_median(np.abs(np.diff(steps))) / 1.652)
    low, high = _ends(spread)
    step = float(changes.min(initial=math.inf, where=changes > 0.0))
    step = step if math.isfinite(step) else 0.0
    large = np.flatnonzero(changes > _level(low, high, noise, step).fault)
    beside = np.sort(begin[np.concatenate((large, large + 1))])
    more = max(3, math.ceil(0.05 * large.size)) - 1
    codes = distinct(beside[more:][beside[more:] == beside[:-more]])  # equal ones follow each other
    if codes.size:
        others = spread[~np.isin(spread, codes)]
        if others.size > 0.05 * spread.size:
            low, high = _ends(others)
    return _level(low, high, noise, step)


def _ends(x: Signal) -> tuple[float, float]:
    """Ends of the range of a signal, each value once: a log may rest for hours."""
    values = distinct(x)
    return between(values, 0.005), between(values, 0.995)


def _level(low: float, high: float, noise: float, step: float) -> Level:
    """The level of a range, a noise and a resolution, with the sizes of its faults."""
    span = high - low
    fault = max(OF_RANGE * span, OF_NOISE * noise, 2.5 * step)
    long_fault, moves = max(LONGER * OF_RANGE * span, fault), span > 2.0 * OF_NOISE * noise
    return Level(low, high, noise, step, span, max(abs(low), abs(high)), fault, long_fault, moves)


class Samples(msgspec.Struct):
    """A log while it is checked.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    channels : (n,) each, SI units, NaN where samples are lost
    open_circuit : no current flows, and a voltage does not show a load
    lost : (n,) which samples were taken out of each channel
    logged : places and values of those that were taken out as spikes
    levels, moving : what was found of the channels, and of the motion by one of them, until samples
        are taken out
    usual_interval : the same of the interval between samples, 0 until it is asked for [s]
    """

    t: Signal
    channels: dict[str, Signal]
    rig: Rig
    open_circuit: bool = False
    findings: list[Finding] = []
    lost: dict[str, Mask] = {}
    logged: dict[str, tuple[Index, Signal]] = {}
    levels: dict[str, Level] = {}
    moving: tuple[Signal, Directions] | None = None
    usual_interval: float = 0.0

    def level(self, name: str) -> Level:
        """What a channel usually does."""
        if name not in self.levels:
            self.levels[name] = level_of(self.channels[name])
        return self.levels[name]

    @property
    def smoothing(self) -> float:
        """Width over which detection smooths a velocity: the time in which the machine does
        something else. [s]
        """
        return self.rig.thresholds.smoothing

    @property
    def interval(self) -> float:
        """Usual interval between samples. [s]"""
        if not self.usual_interval:
            self.usual_interval = usual_interval(self.t)
        return self.usual_interval

    def rows(self, seconds: float) -> int:
        """Number of samples in a time, however its digits and those of the stamps are rounded."""
        return round(min(seconds / self.interval, float(self.t.size)) - ROUNDED_STAMPS)

    @property
    def by_line(self) -> bool:
        """Whether the log has the motion of a line."""
        return "velocity" in self.channels or "displacement" in self.channels

    def has_travel(self, name: str) -> bool:
        """Whether a channel is the velocity of a line whose displacement is logged, too."""
        return name == "velocity" and "displacement" in self.channels

    def stages(self) -> list[tuple[str, ...]]:
        """Channels of each product of which the powers of the stages are sums, in the direction
        in which power flows.
        """
        powers = self.rig.cascade.powers(self.channels, self.rig.r_drum).values()
        return [term.channels for power in powers for term in power.terms if term.channels]

    def motion(self) -> Directions:
        """Direction of the line, or the shaft of a bench without one, (n,): 1, -1, 0 at rest; 1
        if it is unknown.
        """
        for name, onset in (
            ("velocity", self.rig.thresholds.v_onset),
            ("speed", self.rig.phases.omega_onset),
        ):
            x = self.channels.get(name)
            if x is not None and (np.isfinite(x[0]) or np.isfinite(x).any()):
                if self.moving is None or self.moving[0] is not x:
                    bridged = whole(self.t, x)
                    self.moving = (
                        x,
                        (bridged > onset).astype(np.int8) - (bridged < -onset).astype(np.int8),
                    )
                return self.moving[1]
        return np.ones(self.t.size, dtype=np.int8)

    def take_out(self, name: str, bad: Mask) -> None:
        """Mark samples of a channel as lost."""
        at = np.flatnonzero(bad & np.isfinite(self.channels[name]))
        earlier = self.logged.get(name, (at[:0], np.empty(0)))
        self.logged[name] = (
            np.concatenate((earlier[0], at)),
            np.concatenate((earlier[1], self.channels[name][at])),
        )
        self.channels[name][bad] = np.nan
        self.lost[name] = self.lost[name] | bad if name in self.lost else bad
        self.levels.pop(name, None)
        self.moving = None

    def report(
        self,
        kind: FindingKind,
        name: str,
        bad: Mask,
        what: str,
        *,
        removed: bool = True,
        bridged: int = 0,
    ) -> None:
        """Report the samples of a channel where `bad` is set.

        Parameters
        ----------
        removed : they were taken out
        bridged : number of those, of samples that are kept, that another finding has taken out
        """
        places = stretches_of(bad)
        spans = tuple((begin, last) for begin, last in self.t[places - (0, 1)].tolist())
        count = int(np.count_nonzero(bad))
        message = f"{count} {name} samples {what}, in {len(places)} place{'s' * (len(places) > 1)}"
        repair = Repair("bridged by straight lines", count, spans) if removed else None
        action = (
            repair.what
            if repair
            else "reported and kept" + f", but for {bridged} bridged as spikes" * (bridged > 0)
        )
        start, end = spans[0][0], spans[-1][1]
        self.findings.append(
            Finding(kind, message, action, name, start, end, count, count * removed, repair=repair)
        )

    def bridge(self) -> dict[str, Signal]:
        """Bridge the holes of all channels, those of the velocity by the displacement.

        Returns
        -------
        The last good and the first good stamp around each hole, (k, 2) by channel. [s]
        """
        gaps = {}
        for name, bad in self.lost.items():
            if name in self.channels and bad.any():
                x = whole(self.t, self.channels[name])
                if name == "velocity" and "displacement" in self.channels:
                    x = np.where(bad, self.slope(), x)
                self.channels[name] = x
                first, after = stretches_of(bad).T
                gaps[name] = self.t[
                    np.column_stack((np.maximum(first - 1, 0), np.minimum(after, self.t.size - 1)))
                ]
        return gaps

    def slope(self) -> Signal:
        """Velocity from the displacement, smoothed so that the steps of the encoder do not show.
        [m/s]
        """
        travel = whole(self.t, self.channels["displacement"])
        return np.gradient(local_quadratic(self.t, travel, SLOPE_WIDTH * self.smoothing), self.t)


def whole(t: Signal, x: Signal) -> Signal:
    """The channel with straight lines over its holes; the channel itself if it has none."""
    good = np.isfinite(x)
    return x if good.all() or not good.any() else np.interp(t, t[good], x[good])


def text_of(channel: Channel, value: float, digits: int = 5) -> str:
    """Format a value of a channel, given in its SI unit, in the unit in which a log has it."""
    unit = find_unit(channel.unit)
    assert unit is not None
    return f"{(value - unit.offset) / unit.factor:.{digits}g}"


def limits_of(sensor: Sensor | None) -> tuple[float, float]:
    """Limits of a sensor, infinite where none is stated; its zero error may carry a reading
    below an end at zero.
    """
    low, high = (None, None) if sensor is None else (sensor.low, sensor.high)
    top = math.inf if high is None else high
    if sensor is None or low is None:
        return -math.inf, top
    return low - (
        (sensor.accuracy_full_scale or 0.0) * top if low == 0 and math.isfinite(top) else 0.0
    ), top
