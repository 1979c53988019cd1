"""Pairs of channels that follow one motion: whether one is late, or steps at a level that the other passes smoothly.

Two channels y and x that follow each other give `y(t) = a + b x(t - lag)`, to first order `a + b x - b lag dx/dt`. A regression
of y on x and its slope gives the lag, to a few milliseconds where the line starts and stops; it is applied and the regression
repeated. A meter that changes its range, or an offset that appears under load, leaves a step in what remains of y at one level.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import largest, white_noise
from winchcascade.core.run import Mask, Signal
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, REPORTED, Fault, PhasedLog, Span
from winchcascade.reduction.efficiency import SMALLEST

SAME_TIME = 1 / 6
"""Smallest lag that is reported between channels without a physical lag, as a share of the width that smooths the velocity, as
all times here: energies change by more than 0.5 %. [1]"""

OF_THE_MACHINE = 7 / 12
"""The same between velocity and Vdc, beside what the shaft winds up: rotor and capacitor lag by up to a half. [1]"""

SLOPE = 1 / 3
"""Time on either side over which slopes are taken, or one sample where samples are farther apart. [1]"""

SURE = 1 / 600
"""Smallest standard error of a lag that is stated. [1]"""

UNLIKE = 0.1
"""Two signals follow each other if the residual is less than this share of the variance; a lag explains their difference if it
leaves less than five times this share of it. [1]"""

FAR_LAGS = (-20 / 3, -10 / 3, -5 / 3, -5 / 6, 5 / 6, 5 / 3, 10 / 3, 20 / 3)
"""Lags from which the search starts where the signals do not follow each other without one; the last is the longest. [1]"""

LOWEST = 0.1
"""Lowest level of a step, as a share of the largest value, and its distance from that: beyond are zeros, and noise of the
plateau. [1]"""


class Pair(NamedTuple):
    """Two channels x and y of one payout: names, lag that physics explains [s], span [s], stamps [s], and the width that
    smooths the velocity [s].

    `rows` are x, y and what else y depends on, (m, n), `v` is the smoothed velocity, (n,) [m/s]. `degree` is that of the
    polynomial of x that y follows but for steps, 0 where the two are not compared for steps; `ramp` marks the samples outside
    the plateau, whose noise would set the slope.
    """

    names: tuple[str, str]
    limit: float
    degree: int
    span: Span
    t: Signal
    smoothing: float
    rows: Signal
    v: Signal
    ramp: Mask


class Fitted(NamedTuple):
    """Weights of columns, their standard errors, and the sum of squares of the residual as a share of the variance of y [1]."""

    weight: Signal
    error: Signal
    residual: float


class Lag(NamedTuple):
    """Lag of y behind x with its standard error [s], and what it leaves of the variance of y [1]."""

    seconds: float
    u: float
    residual: float


def in_step(log: PhasedLog) -> Iterator[Fault]:
    """Pairs of channels of which one is late or stepped, in the checked payouts whose onset the log holds."""
    cycles = [k for k in log.phased.chosen() if not log.phased.cycles[k].begins_inside]
    for group in zip(*(pairs_of(log, k) for k in cycles), strict=True):
        yield from late(log, group)
        if group[0].degree and not log.run.open_circuit:  # in open circuit friction alone makes the torque
            yield from stepped(log, group)


def pairs_of(log: PhasedLog, k: int) -> Iterator[Pair]:
    """The pairs that a log has in one payout.

    Displacement and the integral of the velocity, whose zero makes it drift; Vdc and Idc at a resistor; while the clutch
    drives, velocity and Vdc, which reactance bends; torque and line tension, whose rest grows with the displacement.
    """
    run, limits, cycle, plateau = log.run, log.rig.thresholds, log.phased.cycles[k], log.phased.plateaus[k]
    blur, channels, v = limits.smoothing, {"time": run.t, **run.channels}, log.phased.v_smooth
    end = braking = settled = cycle.payout_end
    if plateau is not None:
        settled, braking = plateau.begin + limits.settle, plateau.braking

    def pair(first: str, second: str, limit: float, degree: int, start: float, stop: float, *beside: str) -> Pair:
        inside = log.phased.rows(start, stop)
        t, rows = run.t[inside], np.array([channels[name][inside] for name in (first, second, *beside)])
        ramp = (t < settled) | (t > braking - limits.settle)
        return Pair((first, second), limit * blur, degree, (cycle.onset, end), t, blur, rows, v[inside], ramp)

    if {"displacement", "velocity"} <= channels.keys():
        of = pair("displacement", "velocity", SAME_TIME, 0, cycle.onset - blur, end + blur, "time")
        steps = 0.5 * (of.rows[1, 1:] + of.rows[1, :-1]) * np.diff(of.t)
        of.rows[1] = np.concatenate((np.zeros(min(1, of.t.size)), np.cumsum(steps)))
        yield of
    if {"vdc", "idc"} <= channels.keys() and not run.open_circuit:
        yield pair("vdc", "idc", SAME_TIME, 1, cycle.onset - blur, end + blur)
        channels |= {"velocity": v, "square": v * v}
        limit = OF_THE_MACHINE + wound(log) / blur
        yield pair("velocity", "vdc", limit, 0, cycle.onset - blur, braking, "square")
    if {"torque", "force"} <= channels.keys():  # at the onset the friction of the restoring module reverses
        along = next(name for name in ("pressure", "displacement", "time") if name in channels)
        yield pair("torque", "force", SAME_TIME, 2, cycle.onset + blur, braking, along)


def wound(log: PhasedLog) -> float:
    """Time by which the twist of the loaded shaft delays the generator, 0 where torque or shaft are unknown. [s]"""
    stiffness, radius, torque = log.rig.drivetrain.k_shaft, log.rig.r_drum, log.run.channels.get("torque")
    if stiffness is None or radius is None or torque is None:
        return 0.0
    return largest(torque) / stiffness.value * radius / largest(log.phased.v_smooth)


def fit(columns: Signal, y: Signal) -> Fitted | None:
    """Regress y, (n,), on columns, (m, n), and a constant; None where a column is not its own.

    The residual is correlated from sample to sample, so that fewer of them count.
    """
    if y.size < max(MIN_COMPARED, 5 * len(columns)):
        return None
    columns, y = columns - columns.mean(axis=1, keepdims=True), y - y.mean()
    product = np.einsum("ij,kj->ik", columns, columns)  # not by BLAS, whose threads wait for each other
    size, of_y = np.sqrt(product.diagonal()), float(y @ y)
    if not size.all() or of_y == 0.0:
        return None
    product /= size * size[:, None]
    if np.linalg.det(product) < 1e-9:
        return None
    inverse = np.linalg.inv(product)
    weight = inverse @ (np.einsum("ij,j->i", columns, y) / size)
    residual = y - np.einsum("i,ij->j", weight / size, columns)
    left = float(residual @ residual)
    following = float(residual[1:] @ residual[:-1]) / max(left, SMALLEST)
    fewer = max((1.0 + following) / max(1.0 - following, 1e-3), 1.0)
    error = np.sqrt(inverse.diagonal() * left * fewer / y.size)
    return Fitted(weight / size, error / size, left / of_y)


def late(log: PhasedLog, group: Sequence[Pair]) -> Iterator[Fault]:
    """A channel that was recorded late against another one, in the first or the last payout; no channel is shifted."""
    limit = max(group[0].limit, 1.0 / log.run.fs)
    lags = [(lag, pair.span) for pair in (group[0], group[-1]) if (lag := lag_of(pair, limit)) is not None]
    if lags:
        lag, _ = max(lags, key=lambda of: abs(of[0].seconds))
        early, behind = group[0].names if lag.seconds > 0.0 else group[0].names[::-1]
        values = {
            "early": early,
            "seconds": abs(lag.seconds),
            "u": max(lag.u, SURE * group[0].smoothing),
            "least": limit,
        }
        yield Fault("late", behind, sorted({span for _, span in lags}), values)


def lag_of(pair: Pair, limit: float) -> Lag | None:
    """Lag of the second signal behind the first; None if it is below a limit [s], uncertain, or explains no difference."""
    found = at_lag(pair, 0.0)
    alike = found is not None and found.residual < UNLIKE
    if found is not None and alike and abs(found.seconds) < 0.5 * limit:
        return None
    if any(np.ptp(x, axis=0) < 2.0 * CERTAIN * white_noise(x) for x in pair.rows[:2]):
        return None
    tried = [found, *(at_lag(pair, lag * pair.smoothing) for lag in (() if alike else FAR_LAGS))]
    for _ in range(4):  # a filter delays as its slope does, without a shift: then the first remains the best
        found = min((one for one in tried if one is not None), key=lambda one: one.residual, default=None)
        if found is None or abs(found.seconds) > FAR_LAGS[-1] * pair.smoothing:
            return None
        tried.append(at_lag(pair, found.seconds))
    unmoved = fit(np.delete(pair.rows, 1, axis=0), pair.rows[1])
    explains = found is not None and found.residual < 5.0 * UNLIKE * (1.0 if unmoved is None else unmoved.residual)
    certain = found is not None and abs(found.seconds) >= max(limit, CERTAIN * found.u)
    return found if certain and explains else None


def at_lag(pair: Pair, applied: float) -> Lag | None:
    """Lag of y behind x by one regression after a lag is applied; None where they do not rise alike."""
    if pair.t.size < MIN_COMPARED:
        return None
    at, half = pair.t - applied, max(SLOPE * pair.smoothing, float(pair.t[-1] - pair.t[0]) / (pair.t.size - 1))
    within = pair.t[-1] - pair.t[0] - 2.0 * half + 1e-6 * half  # as stamps are rounded
    kept = np.abs(2.0 * at - pair.t[0] - pair.t[-1]) <= within
    before, here, after = (np.interp(at[kept] + shift, pair.t, pair.rows[0]) for shift in (-half, 0.0, half))
    found = fit(np.array([here, (after - before) / (2.0 * half), *pair.rows[2:, kept]]), pair.rows[1, kept])
    if found is None or found.weight[0] <= 0.0:
        return None
    return Lag(
        applied - float(found.weight[1] / found.weight[0]), float(found.error[1] / found.weight[0]), found.residual
    )


def stepped(log: PhasedLog, group: Sequence[Pair]) -> Iterator[Fault]:
    """A channel that steps at a level which its partner passes smoothly: it changed its range, or has an offset under load.

    The ramps of all payouts count, and the more certain of the steps of both channels. Masses between the sensors add a
    difference in proportion to the acceleration, which steps where the line does.
    """
    ramps = []
    for pair in group:
        both = np.vstack((pair.v, pair.rows[:2]))
        slopes = (both[:, 2:] - both[:, :-2]) / (pair.t[2:] - pair.t[:-2])
        ramps.append(np.vstack((pair.rows[:, 1:-1], slopes))[:, pair.ramp[1:-1]])
    x, y, *beside, x_slope, y_slope = np.concatenate(ramps, axis=1)
    first, second = group[0].names
    steps = []
    for channel, partner, own, other, slope in ((second, first, y, x, x_slope), (first, second, x, y, y_slope)):
        smooth = np.array([*(other**power for power in range(1, group[0].degree + 1)), slope, *beside])
        steps.append((*largest_step(own, smooth, log.zero_limit(channel)), channel, partner))
    certain, share, change, level, channel, partner = max(steps)
    if certain:
        values = {"partner": partner, "share": share, "change": change, "level": level}
        yield Fault("stepped", channel, [pair.span for pair in group], values)


def largest_step(y: Signal, smooth: Signal, zero: float) -> tuple[float, float, float, float]:
    """The most certain step of y: in standard errors, as a share of the largest value, its size, and its level; else zeros.

    y, (n,), is fitted by smooth columns, (m, n), and a step at the level by which the residual divides most. The level is that
    which the columns give, so that noise of y chooses no side; that of x does, and a step of its size is none, nor is one that
    the zero of a sensor explains, or that hides in what the columns leave. At half of the scale, a gain is twice its step.
    """
    course = fit(smooth, y)
    if course is None or course.residual > UNLIKE:
        return 0.0, 0.0, 0.0, 0.0
    top, level = largest(y), course.weight @ smooth
    level += float(np.mean(y - level))
    order, place = np.argsort(level), np.arange(1, y.size)
    between = (level[order[1:]] > LOWEST * top) & (level[order[1:]] < (1.0 - LOWEST) * top)
    weight = np.where(between, np.sqrt(place * (y.size - place)), np.inf)
    best = level[order[int(np.argmax(np.abs(np.cumsum((y - level)[order])[:-1]) / weight)) + 1]]
    found = fit(np.vstack((smooth, level >= best)), y)
    if found is None or abs(found.weight[-1]) < (CERTAIN + 1.0) * found.error[-1]:  # as one of many levels
        return 0.0, 0.0, 0.0, 0.0
    change, left = float(found.weight[-1]), math.sqrt(found.residual) * float(np.std(y))
    if abs(change) < max(0.5 * REPORTED * top, left, zero, 2.0 * white_noise(level)):
        return 0.0, 0.0, 0.0, 0.0
    return abs(change / float(found.error[-1])), change / top, change, float(best)
