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
its rest, which any law fits. Without it, 22 of 270 relations in clean logs of drawn machines are
lost at such a shift. [1]"""

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


class Sums(NamedTuple):
    """What a fit of a signal needs at k shifts: j flat points; values of m columns of unit norm,
    (m, j), and their norms, (m,); the signal, (p, n); the inverse of the factor of their products,
    (m, m), what it makes of their products with the signal, (m, k), and squares of that, (k,)."""

    points: Index
    values: Signal
    size: Signal
    y: Signal
    factor: Signal
    along: Signal
    power: Signal


class Known(NamedTuple):
    """Weight of the last column of a law with its standard uncertainty, as the rig file gives
    it."""

    weight: float
    u: float


class Shift(NamedTuple):
    """Lag of a signal with its standard uncertainty [s], and the standard deviation of the residual
    as a share of the range of the signal [1]."""

    lag: float
    u: float
    misfit: float


def on_grids(
    t: Signal, channels: Mapping[str, Signal], spans: Signal, reach: float, width: float
) -> Payouts | None:
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
        integrals_to(t, [x.__getitem__ for x in channels.values()], edges.ravel()).reshape(
            -1, *edges.shape
        )
    )
    cells = (
        np.clip(np.arange(count), first, last).astype(np.intp)
        + count * np.arange(len(edges))[:, None]
    )
    means = areas.reshape(len(areas), -1)[:, cells] / step
    kernel = smoothing_weights(half) if half else np.ones(1)
    smooth = np.convolve(means.ravel(), kernel, "same").reshape(means.shape)
    for ends in (
        slice(0, half),
        slice(count - half, count),
    ):  # which have neighbours of another channel
        smooth[..., ends] = means[..., ends]
    unbraked = inside & (middle < spans[long, 1:2])
    return Payouts(middle, step, inside, unbraked, dict(zip(channels, smooth, strict=True)))


def rate_of(x: Signal, step: float) -> Signal:
    """Central differences of signals on even grids, (p, n), per second; 0 at both ends, which are
    not compared."""
    rate = np.zeros_like(x)
    np.subtract(x[:, 2:], x[:, :-2], out=rate[:, 1:-1])
    rate *= 0.5 / step
    return rate


def sums_of(
    payouts: Payouts, laws: Sequence[tuple[str, Sequence[str]]], inside: Mask, reach: float
) -> list[Sums]:
    """Average, factorise and transform the columns of several laws at once.

    Parameters
    ----------
    laws : name of the signal, and m names of the columns of its law; a constant comes before these
    inside : (p, n) points of the laws; of very many a part counts
    reach : largest lag [s]
    """
    names = list(dict.fromkeys(name for _, columns in laws for name in columns))
    points = np.flatnonzero(inside)
    points = points[:: max(1, points.size // POINTS)]
    values = np.zeros((len(names) + 2, points.size))  # the last one fills up short laws
    values[0] = max(points.size, 1) ** -0.5
    for row, name in zip(values[1:-1], names, strict=True):
        row[:] = payouts.signals[name].ravel()[points]
    values[1:] -= np.einsum("ij->i", values[1:])[:, None] / max(points.size, 1)
    size = np.sqrt(np.einsum("ij,ij->i", values, values))
    values /= np.where(size > 0.0, size, 1.0)[:, None]
    whole = np.zeros((len(values), inside.size))
    whole[:, points] = values
    waves = np.fft.rfft(whole.reshape(-1, *inside.shape))
    np.conjugate(waves, out=waves)

    most = max(len(columns) for _, columns in laws)
    rows = np.full((len(laws), most + 1), len(values) - 1)
    for own, (_, columns) in zip(rows, laws, strict=True):
        own[: len(columns) + 1] = 0, *(1 + names.index(name) for name in columns)
    y = np.array([payouts.signals[name] for name, _ in laws])
    y -= y[:, :1, :1]
    of_y, of_squares = np.fft.rfft(y), np.fft.rfft(y * y)
    products = np.empty((len(laws), most + 2, waves.shape[2]), dtype=np.complex128)
    np.einsum(
        "lmpf,lpf->lmf", waves[rows], of_y, out=products[:, :-1]
    )  # a product of all would be large
    np.einsum("pf,lpf->lf", waves[0], of_squares, out=products[:, -1])
    shifts = np.arange(-int(reach / payouts.step), int(reach / payouts.step) + 1)
    sums = np.fft.irfft(products, inside.shape[1])[..., shifts]
    own = (values @ values.T)[rows[:, :, None], rows[:, None, :]] + RANK * np.eye(most + 1)
    factor = np.linalg.inv(np.linalg.cholesky(own))
    along, power = factor @ sums[:, :-1], sums[:, -1] * points.size**0.5
    found = []
    for k, (_, columns) in enumerate(laws):
        m = len(columns) + 1
        of_law = rows[k, :m]
        found.append(
            Sums(
                points,
                values[of_law],
                size[of_law],
                y[k],
                factor[k, :m, :m],
                along[k, :m],
                power[k],
            )
        )
    return found


def shifted(
    sums: Sums, step: float, *, beside: int, left_out: float, known: Known | None = None
) -> Shift | None:
    """Fit the lag of a signal behind its law; None where too few points show it.

    Parameters
    ----------
    step : of the grids [s]
    beside : number of columns, the first ones, that are no motion
    left_out : standard deviation of what the law leaves out, as a share of the range of the signal
        [1]
    known : weight of the last column, which is not negative
    """
    points, values, size, y, factor, along, power = sums
    if points.size < max(MIN_POINTS, 5 * len(size)) or not size.all():
        return None
    shifts = np.arange(power.size) - power.size // 2
    explained = along**2
    unmoved = power - explained[: beside + 1].sum(axis=0)
    if unmoved[shifts.size // 2] <= RANK * power[shifts.size // 2]:
        return None
    moves = unmoved > MOVES * unmoved[shifts.size // 2]
    squares, weights = np.where(moves, power - explained.sum(axis=0), math.inf), factor.T @ along

    def spread(best: int) -> tuple[float, float]:
        signal = y.ravel()[points + shifts[best]]
        least, extent = points.size / (CORNERS * len(y)), float(signal.max() - signal.min())
        return _variance(signal - weights[:, best] @ values, left_out * extent, least), extent

    best = int(squares.argmin())
    variance, extent = spread(best)
    if known is not None:
        equation, off = variance / (known.u * size[-1]) ** 2, known.weight * size[-1] - weights[-1]
        equation /= 1.0 + equation * factor[-1, -1] ** 2
        tied = squares + equation * off**2
        if tied.min() - squares[best] < CONTRADICTS * variance or weights[-1, best] < 0.0:
            weights = weights + np.outer(factor[-1] * factor[-1, -1], equation * off)
            squares, best = tied, int(tied.argmin())
            variance, extent = spread(best)
    if not extent:
        return None
    chi = (squares - squares[best]) / variance
    lag, u = _vertex(chi, best)
    near = np.flatnonzero(chi < 4.0)  # also about another minimum, which explains the log as well
    u = max(u, 0.5 * float(max(near[-1] - best, best - near[0]) - 1))
    misfit = math.sqrt(max(float(squares[best]), 0.0) / points.size) / extent
    return Shift(step * float(shifts[best] + lag), step * u, misfit)


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
    before, after = (float(chi[k]) if 0 <= k < chi.size else math.inf for k in (best - 1, best + 1))
    bend = 0.5 * (before + after)
    if math.isinf(bend):
        return 0.0, float(chi.size)
    return 0.25 * (before - after) / bend, 1.0 / math.sqrt(bend)
