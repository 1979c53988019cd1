"""Noise of the power of a winch where the machine works: by phase, and by the time over which it lasts.

The residual of a fit is no white noise: blurred accelerations make it large from sample to sample, and losses that vary make it
last. Haar's orthonormal transform of each phase of each cycle separates the two: a coefficient compares the means of two
neighbouring stretches, of 1, 2, 4 ... samples, and the last one is the mean of the phase, which is its energy. Between lengths
the coefficients of correlated noise are nearly independent (McCoy and Walden 1996), so that weights by their variances, one for
each phase and length, make generalised least squares: energies count by how well they repeat, not by their share of squares.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES

if TYPE_CHECKING:
    from winchcascade.core.run import Index, Signal

MEAN = 99
"""Level that the mean of a stretch carries, above those of all differences within it."""

FEW = 8
"""Minimum number of coefficients for a variance of their own; longer stretches that have fewer are taken together."""


class Cells(msgspec.Struct, frozen=True):
    """Sums of Haar coefficients over G folds and C cells, each of one phase and some neighbouring lengths.

    Of the columns `curve` (G, C, k, k), of columns and gap `slope` (G, C, k), of the gap `square` (G, C) [W2]; `count` (G,
    C) are coefficients. `phase` (C,) is an index of `PHASES`; `of_mean` and `within`, by phase, are the cell of the means
    and the one of the longest differences within a stretch, -1 where the phase is missing. Where means are few, both are
    one cell.
    """

    curve: Signal
    slope: Signal
    square: Signal
    count: Signal
    phase: Index
    of_mean: tuple[int, ...]
    within: tuple[int, ...]

    def residual(self, x: Signal) -> Signal:
        """Squared residual of some coefficients by fold and cell, (G, C). [W2]"""
        squares = self.square - 2.0 * self.slope @ x + np.einsum("i,gcij,j->gc", x, self.curve, x)
        return np.asarray(np.maximum(squares, 0.0), dtype=np.float64)


def haar(values: Signal, owner: Index) -> tuple[Signal, Index, Index]:
    """Transform stretches of samples: coefficients (n, k), their level (n,) and the stretch of each, (n,).

    A difference of the means of two neighbours has the level 0 for single samples and 1 more for each doubling. An odd node is
    passed on, so that the transform is orthonormal for any length.

    Parameters
    ----------
    values : (n, k) of the samples
    owner : (n,) stretch of each sample, equal ones side by side

    >>> coefficients, level, _ = haar(np.array([[1.0], [3.0], [8.0]]), np.array([0, 0, 0]))
    >>> level.tolist(), round(float(np.sum(coefficients**2)), 9)
    ([0, 1, 99], 74.0)
    """
    total, count, found = values, np.ones(owner.size), []
    level = 0
    while True:
        first = np.concatenate(([True], owner[1:] != owner[:-1]))
        begin = np.flatnonzero(first)
        rank = np.arange(owner.size) - np.repeat(begin, np.diff(np.append(begin, owner.size)))
        left = np.flatnonzero((rank[:-1] % 2 == 0) & ~first[1:])
        if not left.size:
            break
        a, b = count[left, None], count[left + 1, None]
        difference = np.sqrt(a * b / (a + b)) * (total[left + 1] / b - total[left] / a)
        found.append((difference, np.full(left.size, level), owner[left]))
        total, count = total.copy(), count.copy()
        total[left] += total[left + 1]
        count[left] += count[left + 1]
        kept = np.ones(owner.size, dtype=bool)
        kept[left + 1] = False
        total, count, owner, level = total[kept], count[kept], owner[kept], level + 1
    found.append((total / np.sqrt(count)[:, None], np.full(owner.size, MEAN), owner))
    coefficients, levels, owners = (np.concatenate(each) for each in zip(*found, strict=True))
    return coefficients, levels, owners


def cells_of(columns: Signal, gap: Signal, fold: Index, phase: Index) -> Cells:
    """Transform the samples of each phase of each fold and sum their coefficients.

    Parameters
    ----------
    columns, gap : (n, k) and (n,) at the samples, in order of time within a fold [W]
    fold, phase : (n,) each, of the samples
    """
    stretch = fold * len(PHASES) + phase
    order = np.argsort(stretch, kind="stable")
    values, level, owner = haar(np.column_stack([columns, gap])[order], stretch[order])
    own_fold, own_phase = np.divmod(owner, len(PHASES))
    cell, phases, of_mean, within = _numbered(own_phase, level)
    folds, size = int(fold.max()) + 1, phases.size
    code = own_fold * size + cell

    def summed(weights: Signal | None = None) -> Signal:
        return np.bincount(code, weights, folds * size).astype(np.float64).reshape(folds, size)

    k = columns.shape[1]
    products = np.zeros((folds, size, k + 1, k + 1))
    for i in range(k + 1):
        for j in range(i + 1):
            products[:, :, i, j] = products[:, :, j, i] = summed(values[:, i] * values[:, j])
    return Cells(
        products[..., :k, :k], products[..., :k, k], products[..., k, k], summed(), phases, of_mean, within
    )  # fmt: skip


def _numbered(phase: Index, level: Index) -> tuple[Index, Index, tuple[int, ...], tuple[int, ...]]:
    """Cell of each coefficient, phase of each cell, and the cells of means and of the longest differences by phase."""
    cell, phases = np.zeros(phase.size, dtype=np.intp), list[int]()
    of_mean, within = [-1] * len(PHASES), [-1] * len(PHASES)
    for p in range(len(PHASES)):
        here = phase == p
        levels, counts = np.unique(level[here], return_counts=True)
        held, begun, own = 0, len(phases), 0
        for one, count in zip(levels[::-1].tolist(), counts[::-1].tolist(), strict=True):
            if held == 0 and (not own or int(counts[levels <= one].sum()) >= FEW):
                phases.append(p)
                own += 1
            cell[here & (level == one)] = len(phases) - 1
            held = 0 if held + count >= FEW else held + count
        if own:
            of_mean[p], within[p] = begun, min(begun + 1, len(phases) - 1)
    return cell, np.array(phases, dtype=np.intp), tuple(of_mean), tuple(within)
