"""The lag at which a signal follows a law: a linear fit of the columns of the law at every shift of
the signal.

All signals of a payout are averaged over the cells of one even grid and smoothed alike, so that
neither moves one of them against another. The columns are factorised once: the fit at a shift needs
no more of the signal than its sums with them, which transforms give at all shifts. A weight that is
known beforehand, as the rig file gives the inertia, enters as one more equation; a log that
contradicts it is fitted without it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winchcascade.core.integrate import integrals_to
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.core.smooth import smoothing_weights
from winchcascade.reduction.efficiency import SMALLEST

GRID = 1 / 12
"""Smallest step of the grid, as a share of the width that smooths the velocity. [1]"""

POINTS = 600
"""Number of points of all payouts together in a fit; more of them repeat what their neighbours
show."""

MIN_POINTS = 20
"""Minimum number of points that shows how one signal follows others."""

RANK = 1e-12
"""Share of a column that counts as its own whatever the other ones are, in squares: less is
rounding. [1]"""

EVEN_LENGTH = 16
"""A grid has a multiple of this number of points, so that its transform is fast."""

MOVES = 0.3
"""Smallest variance of a signal at a shift, as a share of that without: with less it is shifted to
its rest, which any law fits. [1]"""

CORNERS = 4.0
"""Number of independent places in a payout that show a lag: the ends of both ramps."""

CONTRADICTS = 6.0
"""A known weight is contradicted if minus twice the log likelihood falls by this without it: once
in 70 logs by chance. [1]"""


class Payouts(NamedTuple):
    """Signals of p payouts on even grids of n points, (p, n) each, and the times of the points [s]:
    the step of all grids [s], and masks of the points that are compared, and of those of them
    before the braking.

    The grid goes on beyond these, so that signals can be shifted."""

    t: Signal
    step: float
    inside: Mask
    unbraked: Mask
    signals: dict[str, Signal]


class Columns(NamedTuple):
    """What the fits of several laws share: m names, j points, values of unit norm, (m, j), norms,
    (m,), products, (m, m), and conjugate transforms, (m, p, f)."""

    names: tuple[str, ...]
    points: Index
    values: Signal
    size: Signal
    products: Signal
    waves: NDArray[np.complex128]


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


def on_grids(t: Signal, channels: Mapping[str, Signal], spans: Signal, reach: float, width: float) -> Payouts | None:
    """Average channels over the cells of grids and smooth them; None where no span is long enough.

    Before the first sample and after the last one a signal is held.

    Parameters
    ----------
    t, channels : (n,) stamps that rise [s], and channels
    spans : (p, 3) begin of what is compared, of the braking, and end [s]
    reach : largest lag [s]
    width : of the local quadratic [s]
    """
    step = max(float(t[-1] - t[0]) / (t.size - 1), GRID * width)
    half = int(0.5 * width / step + 1e-6)
    beyond = int(reach / step) + 1 + half
    count = int((spans[:, 2] - spans[:, 0]).max() / step) + 1 + 2 * beyond
    count += -count % EVEN_LENGTH
    begins = spans[:, :1] - beyond * step
    middle = begins + step * (np.arange(count) + 0.5)
    inside = (middle >= spans[:, :1]) & (middle <= np.minimum(spans[:, 2:], t[-1]))
    long = np.count_nonzero(inside, axis=1) >= MIN_POINTS
    if not long.any():
        return None
    begins, middle, inside = begins[long], middle[long], inside[long]
    first, last = np.ceil((t[0] - begins) / step), np.floor((t[-1] - begins) / step) - 1
    edges = begins + step * np.arange(count + 1)
    areas = np.diff(
        integrals_to(t, [x.__getitem__ for x in channels.values()], edges.ravel()).reshape(-1, *edges.shape)
    )
    cells = np.clip(np.arange(count), first, last).astype(np.intp) + count * np.arange(len(edges))[:, None]
    means = areas.reshape(len(areas), -1)[:, cells] / step
    kernel = smoothing_weights(half) if half else np.ones(1)
    smooth = np.convolve(means.ravel(), kernel, "same").reshape(means.shape)  # ends are not compared
    unbraked = inside & (middle < spans[long, 1:2])
    return Payouts(middle, step, inside, unbraked, dict(zip(channels, smooth, strict=True)))


def columns_of(payouts: Payouts, names: Sequence[str], inside: Mask) -> Columns:
    """Factors of laws: a constant and some signals, of unit norm without their mean.

    Parameters
    ----------
    inside : (p, n) points of the laws; of very many a part counts
    """
    points = np.flatnonzero(inside)
    points = points[:: max(1, points.size // POINTS)]
    values = np.empty((len(names) + 1, points.size))
    values[0] = max(points.size, 1) ** -0.5
    for row, name in zip(values[1:], names, strict=True):
        row[:] = payouts.signals[name].ravel()[points]
    values[1:] -= np.einsum("ij->i", values[1:])[:, None] / max(points.size, 1)
    size = np.sqrt(np.einsum("ij,ij->i", values, values))
    values /= np.where(size > 0.0, size, 1.0)[:, None]
    whole = np.zeros((len(values), inside.size))
    whole[:, points] = values
    waves = np.fft.rfft(whole.reshape(-1, *inside.shape)).conj()
    return Columns(("constant", *names), points, values, size, values @ values.T, waves)


def shifted(
    payouts: Payouts,
    columns: Columns,
    name: str,
    law: Sequence[str],
    *,
    reach: float,
    beside: int,
    left_out: float,
    known: Known | None = None,
) -> Shift | None:
    """Fit the lag of a signal behind its law; None where too few points show it.

    Parameters
    ----------
    columns : of several laws
    name : of the signal
    law : names of its columns; a constant is added
    reach : largest lag [s]
    beside : number of columns, the first ones, that are no motion
    left_out : standard deviation of what the law leaves out, as a share of the range of the signal
        [1]
    known : weight of the last column, which is not negative
    """
    step, points, rows = payouts.step, columns.points, [0, *(columns.names.index(column) for column in law)]
    y, size = payouts.signals[name], columns.size[rows]
    y = y - y[0, 0]
    if points.size < max(MIN_POINTS, 5 * len(rows)) or not size.all() or not y.any():
        return None
    shifts = np.arange(-int(reach / step), int(reach / step) + 1)
    both, power = _at_shifts(columns.waves[rows], y, shifts)
    power *= points.size**0.5
    factor = np.linalg.inv(np.linalg.cholesky(columns.products[rows][:, rows] + RANK * np.eye(len(rows))))
    along = factor @ both
    explained = along**2
    unmoved = power - explained[: beside + 1].sum(axis=0)
    moves = unmoved > MOVES * unmoved[shifts.size // 2]
    shifts, unmoved = shifts[moves], unmoved[moves]
    squares, weights = power[moves] - explained[:, moves].sum(axis=0), factor.T @ along[:, moves]
    values = columns.values[rows]

    def variance(best: int) -> float:
        signal = y.ravel()[points + shifts[best]]
        least = points.size / (CORNERS * len(payouts.inside))
        return _variance(signal - weights[:, best] @ values, left_out * float(np.ptp(signal)), least)

    found = variance(int(squares.argmin()))
    if known is not None:
        equation, off = found / (known.u * size[-1]) ** 2, known.weight * size[-1] - weights[-1]
        equation /= 1.0 + equation * factor[-1, -1] ** 2
        tied = squares + equation * off**2
        if tied.min() - squares.min() < CONTRADICTS * found or weights[-1, squares.argmin()] < 0.0:
            weights = weights + np.outer(factor[-1] * factor[-1, -1], equation * off)
            squares = tied
            found = variance(int(squares.argmin()))
    best, chi = int(squares.argmin()), (squares - squares.min()) / found
    lag, u = _vertex(chi, best)
    near = np.flatnonzero(chi < 4.0)  # also about another minimum, which explains the log as well
    u = max(u, 0.5 * float(np.abs(near - best).max() - 1))
    misfit = math.sqrt(max(float(squares[best]), 0.0) / points.size) / float(np.ptp(y.ravel()[points + shifts[best]]))
    return Shift(step * float(shifts[best] + lag), step * u, float(squares[best] / unmoved[best]), misfit)


def _at_shifts(columns: NDArray[np.complex128], y: Signal, shifts: Index) -> tuple[Signal, Signal]:
    """Sums of products of a signal, (p, n), with m columns, and of its square with the first one,
    at k shifts, (m, k) and (k,).

    Parameters
    ----------
    columns : (m, p, f) their transforms, conjugate
    """
    wave, power = np.fft.rfft(np.array((y, y * y)))
    products = np.concatenate((columns * wave, columns[:1] * power))
    sums = np.fft.irfft(products.sum(axis=1), y.shape[1])[:, shifts]
    return sums[:-1], sums[-1]


def _variance(residual: Signal, size: float, least: float) -> float:
    """Variance of a residual, (j,), that counts as one sum of its own: it is correlated, so that
    fewer points count.

    Parameters
    ----------
    size : least standard deviation of the residual
    least : least number of points that count as one
    """
    left = float(residual @ residual)
    following = float(residual[1:] @ residual[:-1]) / max(left, SMALLEST)
    fewer = max((1.0 + following) / max(1.0 - following, 1e-3), least)
    return fewer * max(left / residual.size, size * size, SMALLEST)


def _vertex(chi: Signal, best: int) -> tuple[float, float]:
    """Place of the minimum beside the best shift, and the distance at which chi squared rises by 1.
    [shifts]"""
    if not 0 < best < chi.size - 1:
        return 0.0, float(chi.size)
    before, after = float(chi[best - 1]), float(chi[best + 1])
    bend = 0.5 * (before + after)
    return 0.25 * (before - after) / bend, 1.0 / math.sqrt(bend)
