"""Pairs of channels that follow one motion: whether one is late, smoothed, or steps at a level that the other passes smoothly.

Two channels y and x that follow each other give `y(t) = a + b x(t - lag)`, and to second order `y = a + b x - b lag dx/dt +
b w d2x/dt2` with w of a symmetric smoothing. A regression of y on x and its slopes therefore gives lag and smoothing, to a few
milliseconds where the line starts and stops. A lag that is found is applied and the regression repeated, until it is the whole
lag. A meter that changes its range, or an offset that appears under load, leaves a step in what remains of y at one level of x.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.channels import CHANNELS
from winchcascade.core.integrate import largest, median, white_noise
from winchcascade.core.run import Signal
from winchcascade.reduction.checks.load import losses
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, REPORTED, Fault, PhasedLog, Span
from winchcascade.reduction.phases import Plateau

SAME_TIME = 0.1
"""Smallest lag that is reported between channels without a physical lag: energies change by more than 0.5 %. [s]"""

OF_THE_ROTOR = 0.25
"""The same between torque and electrical power: rotor, capacitor and filters of the meters lag by up to 0.2 s. [s]"""

OF_THE_MACHINE = 0.35
"""The same between velocity and Vdc: as above, and a back-EMF that falls with the current changes Vdc like 0.15 s. [s]"""

SLOPE = 0.2
"""Time on either side over which slopes are taken, or one sample where samples are farther apart. [s]"""

UNLIKE = 0.1
"""Two signals follow each other if the residual is less than this share of the variance; a lag explains their difference if it
leaves less than five times this share of it. [1]"""

FAR_LAGS = (-4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0)
"""Lags from which the search starts where the signals do not follow each other without one; the last is the longest. [s]"""

LOWEST = 0.1
"""Lowest level of a step, as a share of the largest value, and its distance from that: beyond are zeros, and noise of the
plateau. [1]"""


class Pair(NamedTuple):
    """Two channels of one payout: names, lag that physics explains [s], stamps [s], signals, what else y depends on, (n,) each.

    `degree` is that of the polynomial of x that y follows but for steps, 0 where the two are not compared for steps.
    """

    first: str
    second: str
    limit: float
    degree: int
    t: Signal
    x: Signal
    y: Signal
    beside: tuple[Signal, ...] = ()


Group = tuple[list[Pair], list[Span], list[Plateau | None]]
"""One pair of channels in all checked payouts whose onset the log holds, with the spans and plateaus of these."""


class Fitted(NamedTuple):
    """Weights of columns, their standard errors, and the sum of squares of the residual as a share of the variance of y [1]."""

    weight: Signal
    error: Signal
    residual: float


def pairs_of(log: PhasedLog, k: int) -> Iterator[Pair]:
    """The pairs that a log has in one payout.

    Displacement and the integral of the velocity, whose zero makes it drift; Vdc and Idc at a resistor; the power of the shaft
    and the one that DC link, known losses and known storage need; velocity and Vdc; torque and line tension, whose rest grows
    with the displacement. While the clutch drives, the last three follow each other.
    """
    run, rig, cycle, plateau = log.phased.run, log.phased.rig, log.phased.cycles[k], log.phased.plateaus[k]
    blur, end, channels = rig.thresholds.smoothing, cycle.payout_end, run.channels
    braking = end if plateau is None else plateau.braking
    payout, driven = log.phased.rows(cycle.onset - blur, end + blur), log.phased.rows(cycle.onset - blur, braking)
    t, electrical = run.t[payout], "vdc" in channels and "idc" in channels and not run.open_circuit
    if {"displacement", "velocity"} <= channels.keys():
        v = channels["velocity"][payout]
        travel = np.concatenate((np.zeros(min(1, t.size)), np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))
        yield Pair("displacement", "velocity", SAME_TIME, 0, t, channels["displacement"][payout], travel, (t,))
    if electrical:
        yield Pair("vdc", "idc", SAME_TIME, 1, t, channels["vdc"][payout], channels["idc"][payout])
        t, v_dc, i_dc, v = run.t[driven], channels["vdc"][driven], channels["idc"][driven], log.phased.v_smooth[driven]
        shaft = BUILT_IN["mech"].stream(channels, rig.r_drum)
        if "torque" in channels and shaft is not None:
            omega = v * ((rig.rpm_per_velocity or 0.0) * math.pi / 30.0)
            needed = v_dc * i_dc + losses(rig, i_dc, omega)
            for part, x in ((rig.dc_link.c_dc, v_dc), (rig.drivetrain.inertia_rotor, omega)):
                needed += part.value * x * slope_of(t, x) if part is not None else 0.0
            yield Pair("torque", "Vdc x Idc", OF_THE_ROTOR, 0, t, shaft(driven), needed)
        yield Pair("velocity", "vdc", OF_THE_MACHINE, 0, t, v, v_dc)
    if "torque" in channels and "force" in channels:
        driven = log.phased.rows(cycle.onset + blur, braking)  # before, the friction of the restoring module reverses
        t, along = run.t[driven], channels.get("pressure", channels.get("displacement", run.t))[driven]
        yield Pair("torque", "force", SAME_TIME, 2, t, channels["torque"][driven], channels["force"][driven], (along,))


def slope_of(t: Signal, x: Signal) -> Signal:
    """Slope of a signal at each sample, by the mean of the steps on either side; zeros for fewer than three samples."""
    if t.size < 3:
        return np.zeros(t.size)
    step = np.diff(x) / np.diff(t)
    return np.concatenate((step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]))


def fit(columns: Signal, y: Signal) -> Fitted | None:
    """Regress y, (n,), on columns, (m, n), and a constant; None where a column is not its own.

    The residual is correlated from sample to sample, so that fewer of them count.
    """
    if y.size < MIN_COMPARED:
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
    following = float(residual[1:] @ residual[:-1]) / max(left, 1e-30)
    fewer = max((1.0 + following) / max(1.0 - following, 1e-3), 1.0)
    error = np.sqrt(inverse.diagonal() * left * fewer / y.size)
    return Fitted(weight / size, error / size, left / of_y)


def at_lag(pair: Pair, applied: float) -> tuple[float, float, Fitted] | None:
    """Lag of y behind x and its standard error [s] by one regression after a lag; None where they do not rise alike."""
    half = max(1, round(SLOPE * (pair.t.size - 1) / max(float(np.ptp(pair.t)), 1e-9))) if pair.t.size else 1
    inner = slice(half, -half)
    t = pair.t[inner]
    kept = (t - applied >= t[:1]) & (t - applied <= t[-1:])
    slope = (pair.x[2 * half :] - pair.x[: -2 * half]) / (pair.t[2 * half :] - pair.t[: -2 * half])
    moved = [np.interp(t[kept] - applied, t, signal) if t.size else t for signal in (pair.x[inner], slope)]
    found = fit(np.array([*moved, *(signal[inner][kept] for signal in pair.beside)]), pair.y[inner][kept])
    if found is None or found.weight[0] <= 0.0:
        return None
    return applied - float(found.weight[1] / found.weight[0]), float(found.error[1] / found.weight[0]), found


def groups(log: PhasedLog) -> Iterator[Group]:
    """The pairs of channels that a log has."""
    cycles = [k for k in log.phased.chosen() if not log.phased.cycles[k].begins_inside]
    spans = [(log.phased.cycles[k].onset, log.phased.cycles[k].payout_end) for k in cycles]
    for group in zip(*(pairs_of(log, k) for k in cycles), strict=True):
        yield list(group), spans, [log.phased.plateaus[k] for k in cycles]


def in_step(log: PhasedLog) -> Iterator[Fault]:
    """Pairs of channels of which one is late, smoothed or stepped."""
    found = list(groups(log))
    for check in (late, smoothed, stepped):
        yield from check(log, found)


def late(log: PhasedLog, found: Sequence[Group]) -> Iterator[Fault]:
    """Channels that were recorded late against each other, in each payout; no channel is shifted."""
    for group, spans, _ in found:
        pair, limit = group[0], max(group[0].limit, 1.0 / log.phased.run.fs)
        if not any(follows_late(one, 0.5 * limit) for one in (pair, group[-1])):
            continue
        lags = [(lag, span) for one, span in zip(group, spans, strict=True) if (lag := lag_of(one, limit)) is not None]
        if lags:
            seconds, u = max((lag for lag, _ in lags), key=lambda lag: abs(lag[0]))
            behind, ahead = (pair.second, pair.first) if seconds > 0.0 else (pair.first, pair.second)
            values = {"late": behind, "early": ahead, "seconds": abs(seconds), "u": max(u, 0.001), "limit": limit}
            yield Fault("late", behind if behind in CHANNELS else None, values, spans=[span for _, span in lags])


def follows_late(pair: Pair, limit: float) -> bool:
    """Whether one regression shows a lag beyond a limit [s], or signals that do not follow each other."""
    first = at_lag(pair, 0.0)
    return first is None or first[2].residual > UNLIKE or abs(first[0]) > limit


def lag_of(pair: Pair, limit: float) -> tuple[float, float] | None:
    """Lag of the second signal behind the first, and its standard error; None if it is below a limit, uncertain, or explains no
    difference. [s]
    """
    if pair.t.size < MIN_COMPARED or any(np.ptp(z) < 2.0 * CERTAIN * white_noise(z) for z in (pair.x, pair.y)):
        return None
    first = at_lag(pair, 0.0)
    far = () if first is not None and first[2].residual < UNLIKE else FAR_LAGS
    tried = [one for one in (first, *(at_lag(pair, lag) for lag in far)) if one is not None]
    found = min(tried, key=lambda one: one[2].residual, default=None)
    for _ in range(4):
        if found is not None and abs(found[0]) <= FAR_LAGS[-1]:
            step, found = found[0], at_lag(pair, found[0])
            if found is not None and abs(found[0] - step) < 0.05 * limit:
                break
    if found is None or abs(found[0]) > FAR_LAGS[-1]:
        return None
    if first is not None and first[2].residual < found[2].residual:
        found = first  # a filter delays as its slope does, without a shift
    unmoved = fit(np.array([pair.x, *pair.beside]), pair.y)
    explains = found[2].residual < 5.0 * UNLIKE * (1.0 if unmoved is None else unmoved.residual)
    certain = abs(found[0]) >= limit and abs(found[0]) > CERTAIN * found[1]
    return found[:2] if certain and explains else None


def smoothed(log: PhasedLog, found: Sequence[Group]) -> Iterator[Fault]:
    """A velocity that was smoothed before it was logged, beside the displacement: it begins too early and ends too late.

    A symmetric mean over w changes a signal by its second derivative times w^2 / 24.
    """
    run, widths = log.phased.run, []
    half = max(1, round(SLOPE * run.fs))
    group, spans, _ = found[0] if found else ([], [], [])
    for pair in group if group and group[0].first == "displacement" else ():
        if pair.t.size > 2 * half + MIN_COMPARED:
            x, inner, step = pair.x, slice(half, -half), 0.5 * (pair.t[2 * half :] - pair.t[: -2 * half])
            slope = 0.5 * (x[2 * half :] - x[: -2 * half]) / step
            bend = (x[2 * half :] - 2.0 * x[inner] + x[: -2 * half]) / step**2
            of = fit(np.array([x[inner], slope, bend, pair.t[inner]]), pair.y[inner])
            if of is not None and of.weight[2] > CERTAIN * of.error[2]:
                widths.append(math.sqrt(24.0 * of.weight[2] / of.weight[0]))
    if 2 * len(widths) > len(group) and median(np.array(widths)) > max(2.0 * SLOPE, 4.0 / run.fs):
        yield Fault("smoothed", "velocity", {"width": median(np.array(widths))}, spans=spans)


def stepped(log: PhasedLog, found: Sequence[Group]) -> Iterator[Fault]:
    """A channel that steps at a level which its partner passes smoothly: it changed its range, or has an offset under load.

    In open circuit friction alone makes the torque. The more certain of the steps of both channels counts.
    """
    for group, spans, plateaus in found:
        pair, settle, steps = group[0], log.phased.rig.thresholds.settle, []
        if pair.degree == 0 or log.phased.run.open_circuit:
            continue
        ramps = [ramp_of(one, plateau, settle) for one, plateau in zip(group, plateaus, strict=True)]
        x, y, x_slope, y_slope, *beside = np.concatenate(ramps, axis=1)
        for channel, partner, own, other, slope in (
            (pair.second, pair.first, y, x, x_slope),
            (pair.first, pair.second, x, y, y_slope),
        ):
            step = largest_step(own, other, [slope, *beside], pair.degree, log.zero_limit(channel))
            steps.append((*step, channel, partner))
        certain, share, change, level, channel, partner = max(steps)
        if certain >= CERTAIN + 1.0:  # as one of many levels
            yield Fault(
                "stepped", channel, {"partner": partner, "share": share}, {"change": change, "level": level}, spans
            )


def largest_step(
    y: Signal, x: Signal, beside: Sequence[Signal], degree: int, zero: float
) -> tuple[float, float, float, float]:
    """The most certain step of y: in standard errors, as a share of the largest value, its size, and its level; else zeros.

    The ramps of all payouts together are fitted by a polynomial of x, its slope, and a step at the level by which the residual
    divides most; on a plateau noise alone would set the slope. The level is that which the polynomial gives, so that noise of y
    chooses no side; that of x does, and a step of its size is none, nor is one that the zero of a sensor explains. At half of
    the scale, a gain is twice its step.
    """
    nothing = 0.0, 0.0, 0.0, 0.0
    if y.size < MIN_COMPARED:
        return nothing
    top, smooth = largest(y), np.array([*(x**power for power in range(1, degree + 1)), *beside])
    course = fit(smooth, y)
    if course is None or course.residual > UNLIKE:
        return nothing
    level = course.weight @ smooth
    level += float(np.mean(y - level))
    order, place = np.argsort(level), np.arange(1, y.size)
    between = (level[order[1:]] > LOWEST * top) & (level[order[1:]] < (1.0 - LOWEST) * top)
    weight = np.where(between, np.sqrt(place * (y.size - place)), np.inf)
    best = level[order[int(np.argmax(np.abs(np.cumsum((y - level)[order])[:-1]) / weight)) + 1]]
    found = fit(np.vstack((smooth, level >= best)), y)
    change = 0.0 if found is None else float(found.weight[-1])
    if found is None or abs(change) < max(0.5 * REPORTED * top, 2.0 * white_noise(level), zero):
        return nothing
    return abs(change / float(found.error[-1])), change / top, change, float(best)


def ramp_of(pair: Pair, plateau: Plateau | None, settle: float) -> Signal:
    """Both signals, their slopes, and what else the second depends on, outside the plateau, (m, n)."""
    rows = np.array([pair.x, pair.y, slope_of(pair.t, pair.x), slope_of(pair.t, pair.y), *pair.beside])
    if plateau is None:
        return rows
    return rows[:, (pair.t < plateau.begin + settle) | (pair.t > plateau.braking - settle)]
