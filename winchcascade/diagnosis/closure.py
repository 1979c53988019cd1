"""How far a gap shrinks: fitted without a log, its causes predict that log."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import GapClosure, Shrunk
from winchcascade.diagnosis.evidence import Fit, fit_set
from winchcascade.diagnosis.gap_map import without_zeros
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.suspects import Suspects

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted

DRAWS = 400
"""Resampled sets of cycles for the interval."""

REACH = 3.0
"""A prediction keeps the rig's numbers and its sensors within so many of their standard uncertainties: the causes shall close
the gap, not a rig that nobody has."""

LEAST = 0.2
"""A channel of a log whose misfit before exceeds its noise by less than this share of it has no gap to close."""


class Prediction(msgspec.Struct, frozen=True):
    """A log predicted by a fit that did not know it: the nuisances and effects of that fit."""

    log: int
    fit: Fit


class ModelClosure(GapClosure, frozen=True):
    """Share of the explainable gap that the causes close on logs that took no part in their fit.

    `residual` (M, 5) are measured minus predicted blocks after, zeros taken off, NaN for logs that were not withheld.
    """

    withheld: tuple[int, ...]
    residual: Signal
    predictions: tuple[Prediction, ...]


def close(data: Fitted, suspects: Suspects, best: Fit, withheld: Sequence[int], seed: int) -> ModelClosure:
    """Predict each withheld log from a fit without it.

    Parameters
    ----------
    best : the chosen causes; where the fit already lacks the withheld logs it serves as it is
    withheld : numbers of logs; of those that take part in the fit each is left out in turn
    """
    predictions = []
    for k in withheld:
        fit = best
        if k not in data.withheld or np.any(np.abs(best.nu) > REACH):
            rows = np.ones(data.measured.size)
            rows.reshape(-1, len(CHANNELS))[data.rows[k]] = 0.0
            fit = fit_set(data, suspects, best.names, start=best, rows=rows, quick=True, reach=REACH)
        predictions.append(Prediction(k, fit))
    after = np.full_like(data.measured, math.nan)
    for one in predictions:
        rows_of = data.rows[one.log]
        predicted = data.predict(_no_zeros(data, one.fit.nu), one.fit.effects(suspects), [one.log])
        after[rows_of] = data.measured[rows_of] - predicted
    known = np.isfinite(after[:, :1])
    after = np.where(known, without_zeros(data, np.where(known, after, 0.0)), math.nan)
    before = without_zeros(data, data.measured - data.predict(np.zeros(len(data.nuisances)), []))
    parts = _parts(data, before, after, withheld)
    share = _share(parts)
    draws = _resampled(data, before, after, withheld, seed)
    low, high = (
        (min(max(float(np.quantile(draws, q)), -1.0), 1.0) for q in (0.025, 0.975)) if draws.size else (share, share)
    )
    return ModelClosure(
        withheld=tuple(withheld),
        channels=_channels(data, before, after, withheld),
        share=share,
        low=min(low, share),
        high=max(high, share),
        residual=after,
        predictions=tuple(predictions),
    )


def _no_zeros(data: Fitted, nu: Signal) -> Signal:
    return np.where([n.kind == "zero" for n in data.nuisances], 0.0, nu)


def _parts(data: Fitted, before: Signal, after: Signal, withheld: Sequence[int]) -> list[tuple[float, float]]:
    """Excess over noise, before and after, of each channel of each withheld log, in mean squares of noise."""
    parts = []
    for log in withheld:
        for k in range(len(CHANNELS)):
            one = _excess(data, before, after, log, k, np.ones(data.sizes[log], dtype=bool))
            if one is not None:
                parts.append(one)
    return parts


def _excess(
    data: Fitted, before: Signal, after: Signal, log: int, k: int, these: np.ndarray[tuple[int], np.dtype[np.bool_]]
) -> tuple[float, float] | None:
    noise = data.logs[log].noise
    seen = noise.seen[:, k] & these
    if np.count_nonzero(seen) < 3:
        return None
    rows = data.rows[log]
    floor = float(np.mean(noise.total[seen, k] ** 2))
    old, new = (float(np.mean(r[rows, k][seen] ** 2)) for r in (before, after))
    return (old - floor) / floor, (new - floor) / floor


def _share(parts: Sequence[tuple[float, float]]) -> float:
    """Share that is closed, over channels and logs."""
    old = sum(before for before, _ in parts)
    new = sum(after for _, after in parts)
    return 1.0 - new / old if old > LEAST * max(len(parts), 1) else 0.0


def _resampled(data: Fitted, before: Signal, after: Signal, withheld: Sequence[int], seed: int) -> Signal:
    """Shares of sets of cycles drawn with replacement, log by log."""
    rng = np.random.default_rng(seed)
    table = []
    for log in withheld:
        cycle = data.logs[log].course.blocks.cycle
        cells = [
            [_excess(data, before, after, log, k, cycle == c) for k in range(len(CHANNELS))] for c in np.unique(cycle)
        ]
        table.append(cells)
    shares = []
    for _ in range(DRAWS):
        parts: list[tuple[float, float]] = []
        for cells in table:
            for pick in rng.integers(len(cells), size=len(cells)):
                parts += [cell for cell in cells[pick] if cell is not None]
        shares.append(_share(parts))
    return np.array(shares)


def _channels(data: Fitted, before: Signal, after: Signal, withheld: Sequence[int]) -> dict[str, Shrunk]:
    found = {}
    for k, name in enumerate(CHANNELS):
        sums = np.zeros(4)
        for log in withheld:
            noise, rows = data.logs[log].noise, data.rows[log]
            seen = noise.seen[:, k]
            sums += [
                float(np.sum(before[rows, k][seen] ** 2)),
                float(np.sum(after[rows, k][seen] ** 2)),
                float(np.sum(noise.total[seen, k] ** 2)),
                float(np.count_nonzero(seen)),
            ]
        if sums[3]:
            found[name] = Shrunk(*(math.sqrt(x / sums[3]) for x in sums[:3]))
    return found
