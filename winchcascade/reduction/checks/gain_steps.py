"""Steps of a channel at a level that its partner passes smoothly: a meter that changes its range,
an offset under load.

Vdc and Idc follow each other at a resistor, torque and line tension while the clutch drives. What a
smooth function of the one leaves of the other steps at one level."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import largest, white_noise
from winchcascade.core.run import Signal
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, REPORTED, Fault, PhasedLog
from winchcascade.reduction.efficiency import SMALLEST

FOLLOWS = 0.1
"""A signal follows its partner if the residual is less than this share of its variance. [1]"""

LOWEST = 0.1
"""Lowest level of a step, as a share of the largest value, and its distance from that: beyond are
zeros, and noise of the plateau. [1]"""

NO_STEP = (0.0, 0.0, 0.0, 0.0)
"""A step that is none."""

OWN = 1e-9
"""Least determinant of the products of columns of unit norm that count as their own, and least
share of the square of one more column that the others do not give. [1]"""

PARTNERS = (("vdc", "idc", 1), ("torque", "force", 2))
"""Two channels of which each is a polynomial of this degree of the other. At the onset the friction
of the restoring module reverses, so that the tension counts after it."""


class Fitted(NamedTuple):
    """Least squares of y, (n,), by columns: these without their means and of unit norm, (m, n); the
    inverse of their products, (m, m); what they give of y, (n,); and what they leave of it, (n,)."""

    columns: Signal
    inverse: Signal
    level: Signal
    residual: Signal


class Step(NamedTuple):
    """Height of a step that a fit lacks, its standard error, and the standard deviation of what it
    leaves."""

    height: float
    error: float
    left: float


def stepped(log: PhasedLog) -> Iterator[Fault]:
    """Channels that step at a level which the partner passes smoothly; not in open circuit, where
    friction makes the torque.

    The ramps of all payouts count, and the more certain of the steps of both channels. Masses
    between the sensors add a difference in proportion to the acceleration, which steps where the
    line does."""
    cycles = [k for k in log.phased.chosen() if not log.phased.cycles[k].begins_inside]
    spans = [(log.phased.cycles[k].onset, log.phased.cycles[k].payout_end) for k in cycles]
    for first, second, degree in () if log.run.open_circuit else PARTNERS:
        if not spans or not {first, second} <= log.run.channels.keys():
            continue
        ramps = np.concatenate(
            [ramp_of(log, k, (first, second), of_line=degree > 1) for k in cycles], axis=1
        )
        x, y, *beside, x_slope, y_slope = ramps
        steps = []
        for channel, partner, own, other, slope in (
            (second, first, y, x, x_slope),
            (first, second, x, y, y_slope),
        ):
            smooth = np.array([*(other**power for power in range(1, degree + 1)), slope, *beside])
            steps.append((*largest_step(own, smooth, log.zero_limit(channel)), channel, partner))
        certain, share, change, level, channel, partner = max(steps)
        if certain:
            values = {"partner": partner, "share": share, "change": change, "level": level}
            yield Fault("stepped", channel, spans, values)


def ramp_of(log: PhasedLog, k: int, partners: tuple[str, str], *, of_line: bool) -> Signal:
    """Samples of one payout outside its plateau, whose noise would set the slope, (m, n).

    Rows are both channels, what the tension at rest grows with, and the slopes of velocity and both
    channels."""
    channels, limits, cycle, plateau = (
        log.run.channels,
        log.rig.thresholds,
        log.phased.cycles[k],
        log.phased.plateaus[k],
    )
    settled = braking = cycle.payout_end
    if plateau is not None:
        settled, braking = plateau.begin + limits.settle, plateau.braking
    begin, end = cycle.onset - limits.smoothing, cycle.payout_end + limits.smoothing
    beside = []
    if of_line:
        begin, end = cycle.onset + limits.smoothing, braking
        beside = [
            next((channels[n] for n in ("pressure", "displacement") if n in channels), log.run.t)
        ]
    inside = log.phased.rows(begin, end)
    t, rows = (
        log.run.t[inside],
        np.array(
            [
                x[inside]
                for x in (log.phased.v_smooth, *(channels[name] for name in partners), *beside)
            ]
        ),
    )
    slopes = (rows[:3, 2:] - rows[:3, :-2]) / (t[2:] - t[:-2])
    ramp = (t < settled) | (t > braking - limits.settle)
    return np.vstack((rows[1:, 1:-1], slopes))[:, ramp[1:-1]]


def fit(columns: Signal, y: Signal) -> Fitted | None:
    """Regress y, (n,), on columns, (m, n), and a constant; None where a column is not its own."""
    if y.size < max(MIN_COMPARED, 5 * len(columns)):
        return None
    columns = columns - columns.mean(axis=1, keepdims=True)
    size = np.sqrt(np.einsum("ij,ij->i", columns, columns))
    if not size.all():
        return None
    columns /= size[:, None]
    product = np.einsum("ij,kj->ik", columns, columns)  # not by BLAS, whose threads wait
    if np.linalg.det(product) < OWN:
        return None
    inverse = np.linalg.inv(product)
    weight = inverse @ np.einsum("ij,j->i", columns, y)
    level = np.einsum("i,ij->j", weight, columns) + y.mean()
    return Fitted(columns, inverse, level, y - level)


def step_beside(course: Fitted, column: Signal) -> Step | None:
    """Regress on one more column, (n,), too; None where it is not its own.

    The residual is correlated from sample to sample, so that fewer of them count.
    """
    column = column - column.mean()
    along = course.inverse @ np.einsum("ij,j->i", course.columns, column)
    own = column - np.einsum("i,ij->j", along, course.columns)
    square, n = float(own @ own), column.size
    if n < 5 * (len(along) + 1) or square <= OWN * (column @ column):
        return None
    height = float(own @ course.residual) / square
    residual = course.residual - height * own
    left = float(residual @ residual)
    following = float(residual[1:] @ residual[:-1]) / max(left, SMALLEST)
    fewer = max((1.0 + following) / max(1.0 - following, 1e-3), 1.0)
    error = math.sqrt(left * fewer / n / square)
    return Step(height, error, math.sqrt(left / n))


def largest_step(y: Signal, smooth: Signal, zero: float) -> tuple[float, float, float, float]:
    """The most certain step of y: in standard errors, as a share of the largest value, its size,
    and its level; else zeros.

    y, (n,), is fitted by smooth columns, (m, n), and a step at the level by which the residual
    divides most. The level is that which the columns give, so that noise of y chooses no side; that
    of x does, and a step of its size is none, nor is one that the zero of a sensor explains, or
    that hides in what the columns leave. At half of the scale, a gain is twice its step."""
    course = fit(smooth, y)
    if course is None or np.var(course.residual) >= FOLLOWS * np.var(y):
        return NO_STEP
    top, level, residual = largest(y), course.level, course.residual
    order, place = np.argsort(level), np.arange(1, y.size)
    between = (level[order[1:]] > LOWEST * top) & (level[order[1:]] < (1.0 - LOWEST) * top)
    weight = np.where(between, np.sqrt(place * (y.size - place)), np.inf)
    best = level[order[int(np.argmax(np.abs(np.cumsum(residual[order])[:-1]) / weight)) + 1]]
    step = step_beside(course, (level >= best).astype(np.float64))
    if step is None:
        return NO_STEP
    size, certain = abs(step.height), CERTAIN + 1.0  # as one of many levels
    if size < max(certain * step.error, 0.5 * REPORTED * top, step.left, zero):
        return NO_STEP
    if size < 2.0 * white_noise(level):
        return NO_STEP
    return size / step.error, step.height / top, step.height, float(best)
