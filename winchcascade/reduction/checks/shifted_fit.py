"""The lag at which a signal follows a law: a linear fit of the columns of the law at every shift of
the signal.

All signals of a payout are averaged over the cells of one even grid and smoothed alike, so that
neither moves one of them against another. A weight that is known beforehand, as the rig file gives
the inertia, enters as one more equation; a log that contradicts it is fitted without it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import means_of
from winchcascade.core.run import Index, Signal
from winchcascade.core.smooth import smoothing_weights
from winchcascade.reduction.efficiency import SMALLEST

GRID = 1 / 12
"""Smallest step of the grid, as a share of the width that smooths the velocity. [1]"""

POINTS = 600
"""Number of points of all payouts together in a fit; more of them repeat what their neighbours
show."""

MIN_POINTS = 20
"""Minimum number of points that shows how one signal follows others."""

RANK = 1e-6
"""Smallest singular value of a law over the largest: less is rounding. [1]"""

MOVES = 0.3
"""Smallest variance of a signal at a shift, as a share of that without: with less it is shifted to
its rest, which any law fits. [1]"""

CORNERS = 4.0
"""Number of independent places in a payout that show a lag: the ends of both ramps."""

CONTRADICTS = 6.0
"""A known weight is contradicted if minus twice the log likelihood falls by this without it: once
in 70 logs by chance. [1]"""


class Payout(NamedTuple):
    """Signals of one payout on an even grid: times of its points [s], their step [s], and the
    points that are compared, (j,).

    The grid goes on beyond these, so that signals can be shifted. `braking` is the number of points
    before the braking."""

    t: Signal
    step: float
    inside: Index
    braking: int
    signals: dict[str, Signal]


class Known(NamedTuple):
    """Weight of the last column of a law with its standard uncertainty, as the rig file gives
    it."""

    weight: float
    u: float


class Shift(NamedTuple):
    """Lag of a signal with its standard uncertainty [s], the residual as a share of what the
    columns beside the motion leave [1], and its standard deviation as a share of the range of the
    signal [1]."""

    lag: float
    u: float
    residual: float
    misfit: float


def on_grid(
    t: Signal, channels: Mapping[str, Signal], span: tuple[float, float, float], reach: float, width: float
) -> Payout | None:
    """Average channels over the cells of a grid and smooth them; None for too short a span.

    Parameters
    ----------
    t, channels : (n,) stamps that rise [s], and channels
    span : begin of what is compared, of the braking, and end [s]
    reach : length of the grid beyond both [s]
    width : of the local quadratic [s]
    """
    rows = slice(int(t.searchsorted(span[0] - reach)), int(t.searchsorted(span[2] + reach)))
    t = t[rows]
    if t.size < MIN_POINTS:
        return None
    step = max(float(t[-1] - t[0]) / (t.size - 1), GRID * width)
    edges = np.arange(float(t[0]), float(t[-1]), step)
    cells = np.column_stack((edges[:-1], edges[1:]))
    means = means_of(t, [channels[name][rows].__getitem__ for name in channels], cells)
    half = int(0.5 * width / step + 1e-6)
    kernel = smoothing_weights(half) if half else np.ones(1)
    first, last = means[:, :1].repeat(half, axis=1), means[:, -1:].repeat(half, axis=1)
    smooth = [np.convolve(x, kernel, "valid") for x in np.hstack((first, means, last))]
    at = cells.mean(axis=1)
    inside = np.flatnonzero((at >= span[0]) & (at <= span[2]))
    braking = int(np.count_nonzero(at[inside] < span[1]))
    return Payout(at, step, inside, braking, dict(zip(channels, smooth, strict=True)))


def shifted(
    payouts: Sequence[Payout],
    columns: Sequence[Signal],
    name: str,
    *,
    reach: float,
    beside: int,
    left_out: float,
    known: Known | None = None,
) -> Shift | None:
    """Fit the lag of a signal behind its law; None where too few points show it.

    Parameters
    ----------
    columns : (m, j) of the law for each payout, at its points `inside`; a constant is added
    name : of the signal
    reach : largest lag [s]
    beside : number of columns, the first ones, that are no motion
    left_out : standard deviation of what the law leaves out, as a share of the range of the signal
        [1]
    known : weight of the last column, which is not negative
    """
    step = payouts[0].step
    every = max(1, sum(p.inside.size for p in payouts) // POINTS)
    shifts = np.arange(-int(reach / step), int(reach / step) + 1)
    places = [np.clip(p.inside[::every, None] + shifts, 0, p.t.size - 1) for p in payouts]
    y = np.concatenate([p.signals[name][place] for p, place in zip(payouts, places, strict=True)])
    law = np.concatenate([column[:, ::every] for column in columns], axis=1)
    law = np.vstack((np.ones(law.shape[1]), law)).T
    size = np.linalg.norm(law, axis=0)
    if len(law) < max(MIN_POINTS, 5 * law.shape[1]) or not size.all() or not np.ptp(y):
        return None
    unmoved = _squares(np.linalg.qr(law[:, : beside + 1])[0], y)
    moves = unmoved > MOVES * unmoved[shifts.size // 2]
    shifts, y, unmoved = shifts[moves], y[:, moves], unmoved[moves]
    least = len(y) / (CORNERS * len(payouts))
    free = _least_squares(law / size, y, left_out, least)
    found, squares = free, free.squares
    if known is not None:
        row = np.zeros((1, size.size))
        row[0, -1] = math.sqrt(free.variance) / known.u / size[-1]
        right = np.full((1, shifts.size), math.sqrt(free.variance) * known.weight / known.u)
        tied = _least_squares(np.vstack((law / size, row)), np.vstack((y, right)), left_out, least)
        worse = float(tied.squares.min() - free.squares.min()) / free.variance
        if worse < CONTRADICTS or free.weights[-1] < 0.0:
            found, squares = tied, tied.squares
    best, chi = int(squares.argmin()), (squares - squares.min()) / found.variance
    lag, u = _vertex(chi, best)
    near = np.flatnonzero(chi < 4.0)  # also about another minimum, which explains the log as well
    u = max(u, 0.5 * float(np.abs(near - best).max() - 1))
    misfit = math.sqrt(max(float(squares[best]), 0.0) / len(y)) / float(np.ptp(y[:, best]))
    return Shift(step * float(shifts[best] + lag), step * u, float(squares[best] / unmoved[best]), misfit)


def _squares(basis: Signal, y: Signal) -> Signal:
    """Sums of squares of k signals, (n, k), beside an orthonormal basis, (n, m)."""
    along = basis.T @ y
    return np.asarray(np.einsum("ij,ij->j", y, y) - np.einsum("ij,ij->j", along, along))


class _Fit(NamedTuple):
    """Sums of squares at every shift, (k,), and variance of a residual that counts as one sum of
    its own, at the best one; weights of the columns there."""

    squares: Signal
    variance: float
    weights: Signal


def _least_squares(law: Signal, y: Signal, left_out: float, least: float) -> _Fit:
    """Fit columns, (n, m), to a signal at k shifts, (n, k). The residual is correlated, so that
    fewer points count.

    Parameters
    ----------
    left_out : least standard deviation of the residual, as a share of the range of the signal [1]
    least : least number of points that count as one
    """
    u, s, v = np.linalg.svd(law, full_matrices=False)
    kept = s > RANK * s[0]
    u, s, v = u[:, kept], s[kept], v[kept]
    squares = _squares(u, y)
    best = int(squares.argmin())
    along = u.T @ y[:, best]
    residual = y[:, best] - u @ along
    left = float(residual @ residual)
    following = float(residual[1:] @ residual[:-1]) / max(left, SMALLEST)
    fewer = max((1.0 + following) / max(1.0 - following, 1e-3), least)
    size = left_out * float(np.ptp(y[:, best]))
    return _Fit(squares, fewer * max(left / len(y), size * size), v.T @ (along / s))


def _vertex(chi: Signal, best: int) -> tuple[float, float]:
    """Place of the minimum beside the best shift, and the distance at which chi squared rises by 1.
    [shifts]"""
    if not 0 < best < chi.size - 1:
        return 0.0, float(chi.size)
    before, after = float(chi[best - 1]), float(chi[best + 1])
    bend = 0.5 * (before + after)
    return 0.25 * (before - after) / bend, 1.0 / math.sqrt(bend)
