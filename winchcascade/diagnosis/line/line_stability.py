"""Numbers of the causes of a winch cycle by cycle, and what differs between the cycles beyond their uncertainty."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.causes import COVERED, LAW
from winchcascade.diagnosis.diagnosis_result import Names, RunValue, Stability, Trend
from winchcascade.diagnosis.line.line_data import CyclePart, Lines, reported_number
from winchcascade.diagnosis.line.line_selection import Moments, coefficients
from winchcascade.diagnosis.stability import CHANCE, MIN_RUNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal


def cycle_names(parts: Sequence[CyclePart]) -> tuple[str, ...]:
    """Name of every cycle of some parts in a row."""
    return tuple(f"cycle {cycle} of {part.run.name}" for part in parts for cycle in np.unique(part.cycle).tolist())


def stability_of(lines: Lines, m: Moments, names: Names, cause: str) -> Stability:
    """Estimate the number of one cause from every cycle, the other numbers common to the cycles.

    The noise within the phases, not the scatter of their means, is the uncertainty: the scatter is what is looked for.

    Parameters
    ----------
    m : sums of all parts, the withheld ones too: they only show here whether the numbers are the same
    names : the set of the fit
    """
    x, covariance = _by_cycle(lines, m, names, cause)
    known = np.isfinite(x)
    own = lines.names.index(cause)
    joint = float(coefficients(m, lines, names)[own])
    spread = covariance + np.diag(np.full(x.size, (LAW * joint) ** 2))
    u, plausible = np.sqrt(np.diag(spread)), float(lines.bounds.inner_high[own] - lines.bounds.inner_low[own])
    known &= 2.0 * COVERED * u < plausible
    runs = []
    for k, (value, half) in enumerate(zip(x.tolist(), (COVERED * u).tolist(), strict=True)):
        low, high = sorted(reported_number(cause, end) for end in (value - half, value + half))
        runs.append(RunValue(k, reported_number(cause, value), low, high) if known[k] else RunValue(k))
    slope = -1.0 / (1.0 + joint) ** 2 if cause == "force_gain" else 1.0  # of the reported number over the coefficient
    trends = _trends(
        slope * x[known], slope**2 * spread[np.ix_(known, known)], np.flatnonzero(known).astype(np.float64)
    )
    return Stability(tuple(runs), trends)


def _by_cycle(lines: Lines, m: Moments, names: Names, cause: str) -> tuple[Signal, Signal]:
    """Coefficient of a cause in every cycle, (q,), and their covariance; NaN for a cycle that does not depend on it."""
    variance = m.variance.copy()
    for mean, within in zip(m.cells.of_mean, m.cells.within, strict=True):
        if mean >= 0:
            variance[mean] = min(variance[mean], variance[within])
    curve, slope = (
        np.einsum(f"gc{i},c->g{i}", own, 1.0 / variance) for i, own in (("ij", m.cells.curve), ("i", m.cells.slope))
    )
    cycles = np.unique(m.cycle)
    curve, slope = (np.array([own[m.cycle == c].sum(axis=0) for c in cycles]) for own in (curve, slope))
    k, common = lines.names.index(cause), [lines.names.index(name) for name in names if name != cause]
    size = len(common)
    whole, right = np.zeros((size + cycles.size, size + cycles.size)), np.zeros(size + cycles.size)
    whole[:size, :size], right[:size] = curve.sum(axis=0)[np.ix_(common, common)], slope.sum(axis=0)[common]
    own = size + np.arange(cycles.size)
    whole[own, own], right[own] = curve[:, k, k], slope[:, k]
    whole[:size, size:] = curve[:, common, k].T
    whole[size:, :size] = curve[:, common, k]
    silent = curve[:, k, k] <= 1e-9 * curve[:, k, k].max(initial=1e-300)
    whole[own[silent], own[silent]] = 1.0
    covariance: Signal = np.linalg.pinv(whole, hermitian=True).astype(np.float64)
    x: Signal = (covariance @ right)[size:]
    x[silent] = math.nan
    return x, covariance[size:, size:]


def _trends(x: Signal, covariance: Signal, order: Signal) -> tuple[Trend, ...]:
    """A straight line over the order of the cycles beyond their scatter about it, else a scatter beyond their uncertainty."""
    from scipy.special import chdtrc, stdtr

    if x.size < MIN_RUNS or np.ptp(order) <= 0.0:
        return ()
    inverse = np.linalg.pinv(covariance, hermitian=True)

    def fit(columns: Signal) -> tuple[Signal, Signal, float]:
        spread: Signal = np.linalg.pinv(columns.T @ inverse @ columns, hermitian=True).astype(np.float64)
        found = spread @ columns.T @ inverse @ x
        left = x - columns @ found
        return found, spread, max(float(left @ inverse @ left), 0.0)

    one, ruler = np.ones(x.size), (order - order[0]) / np.ptp(order)
    _, _, scatter = fit(one[:, None])
    chance = float(chdtrc(x.size - 1, scatter))
    if x.size > MIN_RUNS:
        line, spread, left = fit(np.column_stack([one, ruler]))
        u = math.sqrt(max(float(spread[1, 1]), 1e-300) * max(left / (x.size - 2), 1.0))
        of_line = 2.0 * float(stdtr(x.size - 2, -abs(float(line[1])) / u))
        if of_line < CHANCE:
            return (Trend("order", float(line[1]), u, of_line),)
    return (Trend("scatter", float(np.ptp(x)), math.nan, chance),) if chance < CHANCE else ()
