"""One test by several loggers: how far their clocks are apart, and one run of all their channels.

The motion that both logs hold gives the difference of the clocks: a correlation finds it to a
sample, a linear fit to a fraction of one, and the scatter of the stretches of the log gives its
uncertainty. Without such a motion the dates of the stamps give it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from winchcascade.core.accuracy import NORMAL, student
from winchcascade.core.checked_run import sealed, sealed_channels
from winchcascade.core.errors import LogError
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import CLOCK, Finding, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.core.store import joint_digest
from winchcascade.ingest.source import MIN_ROWS

MOTIONS = ("velocity", "displacement", "speed")
"""Channels that may show the motion, the best one first."""

SMOOTHED = 12.0
"""Width in which the motions are smoothed, in samples of the slower logger: noise that is
interpolated would draw the difference towards whole and half samples."""

GRID_MAX = 1 << 20
"""Samples of the correlation; a longer log is correlated at a lower rate first."""

ALIKE = 0.98
"""Correlation over the largest from which another difference explains the motions as well: cycles
repeat. The dates of the stamps choose among them, else the longest common motion. [1]"""

COMMON_MIN = 0.5
"""Share of the squared motion of one log at least that must lie in the common time. [1]"""

CORRELATION_MIN = 0.8
"""Smaller correlations are not of one motion: unlike motions of a winch reach 0.5. [1]"""

STRETCHES = (12, 48)
"""Numbers of parts of the common time whose scatter gives the uncertainty, the larger one counts:
long parts show a drift of the clocks, short ones average over more of the noise."""

STEPS_MAX = 20
"""Steps of the linear fit; two or three are enough for a motion that is smooth over a sample."""

NOT_OF_THE_RUN = ("missing_channel", "rig_assumed", "thresholds_assumed")
"""Findings on a further log that do not concern the run of all loggers."""


class ClockDifference(NamedTuple):
    """Time on the clock of the first log minus that on the clock of another one at the same
    instant, with its standard uncertainty (NaN where it is unknown) [s]; `channel` shows the
    motion, None where dates alone count; `others` are further differences that the motions
    allow.
    """

    value: float
    u: float
    channel: str | None = None
    others: tuple[float, ...] = ()


def joined(runs: Sequence[Run], rig: Rig) -> Run:
    """One run of the logs of several loggers, on the clock and in the time of the first.

    A channel that several logs hold is that of the first of them. The others are averaged over the
    sampling interval of the first log.

    Parameters
    ----------
    rig : with which the logs were read, as the campaign names it

    Raises
    ------
    LogError : the logs hold no common motion and no dates, or no common time
    """
    run, *others = runs
    for other in others:
        run = _joined(run, other, clock_difference(run, other))
    digest = joint_digest([one.sha256 for one in runs])
    return replace(run, sha256=digest, rig=_with_lags(run, with_thresholds(rig, [run])))


def _with_lags(run: Run, rig: Rig) -> Rig:
    """The rig with the uncertainty of the clocks as that of the lags of the channels that were
    aligned; channels without a sensor in the rig file have none.
    """
    own = {} if run.rig is None else run.rig.sensors
    lags = {name: own[name].u_lag for name in own if own[name].u_lag is not None}
    sensors = {
        name: replace(sensor, u_lag=lags.get(name, sensor.u_lag))
        for name, sensor in rig.sensors.items()
    }
    return replace(rig, sensors=sensors)


def clock_difference(run: Run, other: Run) -> ClockDifference:
    """Difference of the clocks of two logs of one test, by the motion that both hold, else by the
    dates of their stamps.

    Raises
    ------
    LogError : they hold no common motion and no dates, or their motions are not alike
    """
    dated = None
    if run.started is not None and other.started is not None:
        dated = float(other.started - other.t[0] - (run.started - run.t[0]))
    channel = next(
        (name for name in MOTIONS if {name} <= run.channels.keys() & other.channels), None
    )
    if channel is None and dated is None:
        raise LogError(
            f"{run.name} and {other.name}: have no motion in common and no dates in both; expected "
            f"velocity, displacement or speed in both logs, or stamps with a date. Log the motion "
            f"with both loggers, or join the columns in one file."
        )
    if channel is None:
        return ClockDifference(dated or 0.0, math.nan)
    return _by_motion(run, other, channel, dated)


def _by_motion(run: Run, other: Run, channel: str, dated: float | None) -> ClockDifference:
    """The difference at which the motions of two logs agree best."""
    width = SMOOTHED / min(run.fs, other.fs)
    motions = [local_quadratic(log.t, log.channels[channel], width) for log in (run, other)]
    rates = motions
    if channel == "displacement":  # its zero is arbitrary
        rates = [np.gradient(x, log.t) for x, log in zip(motions, (run, other), strict=True)]
    coarse = _correlated(run, other, rates, dated)
    if coarse is None:
        raise LogError(
            f"{run.name} and {other.name}: their {channel} shows no common motion; expected two "
            f"logs of one test. Check the files of this run in campaign.toml."
        )
    return _refined(run, other, motions, coarse._replace(channel=channel))


def _correlated(
    run: Run, other: Run, motions: Sequence[Signal], dated: float | None
) -> ClockDifference | None:
    """The difference to a sample; None where the motions are not alike."""
    spans = [float(log.t[-1] - log.t[0]) for log in (run, other)]
    step = max(1.0 / max(run.fs, other.fs), sum(spans) / GRID_MAX)
    a, b = (
        np.interp(np.arange(log.t[0], log.t[-1], step), log.t, motion)
        for log, motion in zip((run, other), motions, strict=True)
    )
    size = 1 << (a.size + b.size - 1).bit_length()

    def sums(x: Signal, y: Signal) -> Signal:
        """Of x(i) y(i - k) over i, at each k from 1 - y.size on."""
        found = np.fft.irfft(np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size)), size)
        return np.concatenate((found[size - b.size + 1 :], found[: a.size]))

    power_a, power_b = sums(a * a, np.ones(b.size)), sums(np.ones(a.size), b * b)
    enough = np.maximum(power_a / (a @ a or 1.0), power_b / (b @ b or 1.0)) >= COMMON_MIN
    known = enough & (power_a > 0.0) & (power_b > 0.0)
    correlation = np.zeros(known.size)
    correlation[known] = sums(a, b)[known] / np.sqrt(power_a[known] * power_b[known])
    best = float(correlation.max(initial=0.0))
    if best < CORRELATION_MIN:
        return None
    inner = correlation[1:-1]
    peaks = 1 + np.flatnonzero((inner >= correlation[:-2]) & (inner >= correlation[2:]))
    peaks = peaks[correlation[peaks] >= ALIKE * best]
    differences = run.t[0] - other.t[0] + step * (peaks - (b.size - 1))
    order = -power_a[peaks] if dated is None else np.abs(differences - dated)
    first, *rest = differences[np.argsort(order)].tolist()
    return ClockDifference(first, step, others=tuple(sorted(rest)))


def _refined(
    run: Run, other: Run, motions: Sequence[Signal], coarse: ClockDifference
) -> ClockDifference:
    """The difference by a linear fit of its change beside gain and zero of the motions, with its
    uncertainty by the scatter of the stretches of the common time.
    """
    slope, value = np.gradient(motions[1], other.t), coarse.value
    for _ in range(STEPS_MAX):
        inside = (run.t - value >= other.t[0]) & (run.t - value <= other.t[-1])
        t, x = run.t[inside] - value, motions[0][inside]
        shape = np.stack((np.interp(t, other.t, motions[1]), np.ones(t.size)), axis=1)
        rate = np.interp(t, other.t, slope)
        fit = np.linalg.lstsq(shape, np.stack((x, rate), axis=1), rcond=None)[0]
        gain = float(fit[0, 0])
        rest, own = (np.stack((x, rate), axis=1) - shape @ fit).T
        error, weight = -own * rest, gain * own * own
        change = float(error.sum() / weight.sum())
        value += change
        if abs(change) < 1e-9 * max(1.0, abs(value)):
            break
    u = max(_by_scatter(error - change * weight, weight, count) for count in STRETCHES)
    return coarse._replace(value=value, u=u)


def _by_scatter(error: Signal, weight: Signal, count: int) -> float:
    """Standard uncertainty of a weighted mean by the scatter of its stretches, widened as those
    with weight are few. [s]

    Parameters
    ----------
    error, weight : of each sample, its weight times its error [s], and its weight
    count : number of the stretches
    """
    ends = np.linspace(0, weight.size, count, endpoint=False).astype(np.intp)
    errors, weights = np.add.reduceat(error, ends), np.add.reduceat(weight, ends)
    share = float(weights @ weights) / float(weights.sum()) ** 2
    widened = student(max(1.0 / share - 1.0, 1.0)) / NORMAL
    scatter = math.sqrt(float(errors @ errors) / max(1.0 - share, 0.5)) / float(weights.sum())
    return widened * scatter


def _joined(run: Run, other: Run, difference: ClockDifference) -> Run:
    """The run with the channels of another log that it lacks, in the time that both hold."""
    there = other.t + difference.value
    inside = (run.t >= there[0]) & (run.t <= there[-1])
    t = run.t[inside]
    if t.size < MIN_ROWS:
        raise LogError(
            f"{run.name} and {other.name}: have {t.size} samples in common time; expected at "
            f"least {MIN_ROWS}. Check the dates of their stamps."
        )
    added = [name for name in other.channels if name not in run.channels]
    channels = {name: x[inside] for name, x in run.channels.items()} | {
        name: _averaged(there, other.channels[name], t, 1.0 / run.fs) for name in added
    }
    shifted = {name: gaps + difference.value for name, gaps in other.gaps.items()}
    lost = [shifted.get(CLOCK, np.empty((0, 2)))]
    gaps = {name: np.concatenate([*lost, shifted.get(name, lost[0][:0])]) for name in added}
    gaps = {name: found[np.argsort(found[:, 0])] for name, found in gaps.items() if found.size}
    sensors = {} if run.rig is None else dict(run.rig.sensors)
    for name in added:
        if name in sensors and math.isfinite(difference.u):
            u_lag = math.hypot(sensors[name].u_lag or 0.0, difference.u)
            sensors[name] = replace(sensors[name], u_lag=u_lag)
    kept = [f for f in run.findings if f.kind != "missing_channel" or f.channel not in added]
    further = [
        replace(f.at_times(other.t, there), message=f"{other.name}: {f.message}")
        for f in other.findings
        if f.kind not in NOT_OF_THE_RUN
    ]
    t = sealed(t)
    return replace(
        run,
        t=t,
        channels=sealed_channels(channels, t, run.fs),
        gaps={**run.gaps, **gaps},
        labels=None if run.labels is None else run.labels[inside],
        signs={**{name: other.signs[name] for name in added if name in other.signs}, **run.signs},
        load=other.load if run.load is None else run.load,
        load_source=other.load_source if run.load is None else run.load_source,
        temperature=other.temperature if run.temperature is None else run.temperature,
        rig=None if run.rig is None else replace(run.rig, sensors=sensors),
        simulated=run.simulated or other.simulated,
        findings=(*kept, *further, _finding(other, difference, added)),
    )


def _averaged(t: Signal, x: Signal, at: Signal, width: float) -> Signal:
    """Means of a signal over an interval around each time, by its integral; at both ends over the
    part that there is.
    """
    area = np.concatenate(([0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t))))
    ends = [np.clip(at + side * width, t[0], t[-1]) for side in (-0.5, 0.5)]
    whole = [_integral(t, x, area, end) for end in ends]
    return sealed((whole[1] - whole[0]) / (ends[1] - ends[0]))


def _integral(t: Signal, x: Signal, area: Signal, at: Signal) -> Signal:
    """Integral of a signal that is linear between its samples, up to each time."""
    last = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    part = at - t[last]
    slope = (x[last + 1] - x[last]) / (t[last + 1] - t[last])
    return area[last] + part * (x[last] + 0.5 * slope * part)


def _finding(other: Run, difference: ClockDifference, added: Sequence[str]) -> Finding:
    """What was found of the clock of another log, and what was taken from it."""
    by = "the dates of the stamps" if difference.channel is None else difference.channel
    u = f"u = {difference.u:.2g} s" if math.isfinite(difference.u) else "u unknown"
    message = f"the clock of {other.name} is {-difference.value:.6g} s ahead by {by}, {u}"
    if difference.others:
        apart = ", ".join(f"{-value:.4g}" for value in difference.others[:3])
        message += f"; the motion repeats, and {apart} s would fit as well"
    return Finding("loggers_aligned", message, f"{', '.join(added) or 'no channel'} taken from it")
