"""How far a gap shrinks on held-out logs, with the interval by other choices of their cycles."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import GapClosure, Shrunk
from winchcascade.diagnosis.fit.evidence import Fit, minimum_within
from winchcascade.diagnosis.fit.fit_set import located
from winchcascade.diagnosis.fit.marginal import Marginal, weights
from winchcascade.diagnosis.fit.misfit import LOCAL, Fitted, log_of
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.search import Found
from winchcascade.diagnosis.fit.suspects import places_of
from winchcascade.diagnosis.verdict_limits import MIN_EXCESS, REACH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect


DRAWS = 400
"""Resampled sets of cycles for the interval."""


class ModelClosure(GapClosure, frozen=True):
    """Share of the explainable gap that the causes close on logs that took no part in their fit.

    `residual` (M, 5) are measured minus predicted blocks after, zeros taken off, NaN for logs that
    were not withheld. `predictions` are, by number of the `withheld` log, the fits without it.
    `draws` (draws,) are shares with other choices of the cycles of these logs, alike for all
    closures of them.
    """

    withheld: tuple[int, ...]
    residual: Signal
    predictions: dict[int, Fit]
    draws: Signal

    def closes_more_than(self, other: ModelClosure) -> bool:
        """Whether it closes more of the gap on the same held-out logs than another, beyond what
        another choice of cycles changes with a probability of 95 %.
        """
        more = self.share > other.share
        return more and bool(np.quantile(self.draws - other.draws, 0.025) > 0.0)


def close(data: Fitted, found: Found, fit: Fit, withheld: Sequence[int], seed: int) -> ModelClosure:
    """Predict each withheld log from a fit without the logs of its load, or its cycles in turn
    as `predicted_together` gives them.

    Each such fit is one step of Gauss and Newton away from the fit to all logs. What the other logs
    do not determine, as a roll-off at currents that they do not reach, stays as it was found.

    Parameters
    ----------
    fit : has the causes; where it already lacks the withheld logs it serves as it is
    withheld : numbers of logs; of those that take part in the fit the logs of each load are held
        out in turn
    """
    suspects, predictions, nu = found.problem.suspects, dict[int, Fit](), fit.nu
    best = fit if fit is found.best else located(found.problem, found.marginal, fit.names, fit.x)
    moved = found.marginal.undone(found.expansion.over(best.names))
    after = np.full_like(data.measured, math.nan)
    for here, held in predicted_together(data, withheld):
        fit = best
        known: list[ActiveEffect] = []
        if not data.withheld.issuperset(here):
            rows = np.ones_like(data.measured)
            rows[held] = 0.0
            acting = best.acting(suspects)
            # a wrong entry of a log shows in this log alone
            known = [one for one in acting.values() if log_of(one) in here]
            names = tuple(name for name, one in acting.items() if one not in known)
            fit = _without(found, best, names, rows.ravel(), moved, nu)
        predicted = data.predict(_of_the_rig(data, fit), [*fit.effects(suspects), *known], here)
        after[held] = data.measured[held] - predicted[np.isin(_blocks_of(data, here), held)]
        predictions |= dict.fromkeys(here, fit)
    seen = np.isfinite(after)
    after = np.where(seen, data.without_zeros(np.where(seen, after, 0.0)), math.nan)
    return closure_between(data, data.gap(data.stated), after, predictions, seed)


def _without(
    found: Found, fit: Fit, names: Names, rows: Signal, moved: Signal, begin: Signal
) -> Fit:
    """Numbers of some suspects of a fit and nuisances, by the residuals with some weights, (n,),
    and near the fit.

    The prior is about the fit, and not about the absence of the suspects.

    Parameters
    ----------
    moved : (n, k) derivative of the whitened residuals over the fields of the fit
    begin : nuisances near to those that are sought, in units of their tolerance
    """
    fields = [k for name in names for k in range(fit.x.size)[fit.place[name]]]
    marginal, free, x = found.marginal.masked(rows), fit.free.some(fields), fit.x[fields]
    moved = moved[:, fields]
    columns, r = marginal(moved * rows[:, None]), marginal(fit.given * rows)
    weighted = columns * weights(r)[:, None]
    curve = weighted.T @ columns + np.diag(free.sd**-2.0)
    step = minimum_within(curve, -weighted.T @ r, free.minimum - x, free.maximum - x)
    nu, _ = marginal.best((fit.given + moved @ step) * rows, begin)
    place = places_of(found.problem.suspects, names)
    return msgspec.structs.replace(fit, names=names, place=place, x=x + step, free=free, nu=nu)


class HeldOut:
    """Closures of sets on the logs that take part in a diagnosis, held out in turn; each is found
    once.

    Parameters
    ----------
    seed : of the resampling of cycles
    """

    def __init__(self, data: Fitted, seed: int) -> None:
        self.data, self.seed = data, seed
        self._closures: dict[tuple[Marginal, Names], ModelClosure] = {}

    def of(self, found: Found, fit: Fit) -> ModelClosure:
        """The closure of a set, by the derivatives about the best set of a search."""
        which = found.marginal, fit.names
        if which not in self._closures:
            self._closures[which] = close(self.data, found, fit, judging(self.data), self.seed)
        return self._closures[which]


def judging(data: Fitted) -> list[int]:
    """Numbers of the logs that are held out in turn, of those that take part in a fit: all with
    a load, or all without any.
    """
    return [k for k in data.taking if math.isfinite(data.logs[k].load)] or data.taking


def share_closed(data: Fitted, suspects: Suspects, fit: Fit) -> float:
    """Share of the explainable gap that causes close on the logs of their own fit, numbers of
    the rig within `REACH`. [1]
    """
    fitted = data.predict(_of_the_rig(data, fit), fit.effects(suspects))
    squares = _squares(data, data.gap(data.stated), data.gap(fitted))
    by_log = _sums(squares, [data.rows[k] for k in data.taking])
    return float(_share_of(_excess(by_log).sum(axis=1)))


def _of_the_rig(data: Fitted, fit: Fit) -> Signal:
    """Nuisances of a fit that concern the rig and its sensors, within `REACH`; zeros and
    discrepancies of the model are 0.
    """
    return np.where([n.kind in LOCAL for n in data.nuisances], 0.0, np.clip(fit.nu, -REACH, REACH))


CYCLE_PARTS = 3
"""Number of parts in which the cycles of the only load are held out."""


def predicted_together(
    data: Fitted, withheld: Sequence[int]
) -> list[tuple[list[int], NDArray[np.intp]]]:
    """Blocks that are predicted together from a fit to the others, by their numbers, in increasing
    order, and the logs that they are of.

    These are those of all logs of a load. Where no other run with a load would remain, as in a
    campaign of one load and an open circuit, an open circuit cannot determine what the load makes
    visible: then its cycles are held out in turn.
    """
    loaded = {data.logs[k].load for k in data.taking if math.isfinite(data.logs[k].load)}
    found = []
    for load in dict.fromkeys(data.logs[k].load for k in withheld):
        here = sorted(k for k in withheld if data.logs[k].load == load)
        blocks = _blocks_of(data, here)
        cycles = np.unique(data.blocks.cycle[blocks])
        if data.withheld.issuperset(here) or loaded - {load} or cycles.size < 2:
            found.append((here, blocks))
            continue
        parts = min(CYCLE_PARTS, cycles.size)
        part = np.searchsorted(cycles, data.blocks.cycle[blocks]) * parts // cycles.size
        log = np.repeat(np.arange(len(data.sizes)), data.sizes)
        several = [blocks[part == number] for number in range(parts)]
        found += [(np.unique(log[held]).tolist(), held) for held in several]
    return found


def _blocks_of(data: Fitted, logs: Sequence[int]) -> NDArray[np.intp]:
    """Numbers of the blocks of some logs."""
    return np.concatenate([np.arange(data.rows[k].start, data.rows[k].stop) for k in logs])


def by_cycles(data: Fitted, withheld: Sequence[int]) -> bool:
    """Whether the only load of a campaign is judged on its cycles, held out in turn."""
    return len(predicted_together(data, withheld)) > len({data.logs[k].load for k in withheld})


def closure_between(
    data: Fitted, before: Signal, after: Signal, predictions: dict[int, Fit], seed: int
) -> ModelClosure:
    """Compare the gaps of the withheld logs before and after. Only the noise of the logs is
    subtracted, not the discrepancy of the model.

    Parameters
    ----------
    before, after : (M, 5) measured minus predicted blocks, zeros taken off; `after` is NaN for logs
        that were not withheld
    predictions : fits by number of the withheld log
    """
    withheld, squares = sorted(predictions), _squares(data, before, after)
    by_log = _sums(squares, [data.rows[k] for k in withheld])
    share = float(_share_of(_excess(by_log).sum(axis=1)))
    by_cycle = [_sums(squares, _cycles(data, data.rows[k])) for k in withheld]
    draws = _resampled([_excess(cells) for cells in by_cycle], seed)
    low, high = np.clip(np.quantile(draws, (0.025, 0.975)), -1.0, 1.0).tolist()
    total = by_log.sum(axis=0)
    return ModelClosure(
        withheld=tuple(withheld),
        channels={
            name: Shrunk(*np.sqrt(total[:3, k] / total[3, k]).tolist())
            for k, name in enumerate(CHANNELS)
            if total[3, k]
        },
        share=share,
        low=min(low, share),
        high=max(high, share),
        residual=after,
        predictions=predictions,
        draws=draws,
    )


def _resampled(by_log: Sequence[Signal], seed: int) -> Signal:
    """Share that is closed with `DRAWS` choices of the cycles of some logs, (draws,).

    Parameters
    ----------
    by_log : what exceeds noise in the cycles of each log, (3, cycles) as `_excess` gives it
    """
    chosen = _choices(tuple(excess.shape[1] for excess in by_log), seed)
    return _share_of(np.hstack(by_log)[:, chosen].sum(axis=2))


@lru_cache(maxsize=2)
def _choices(sizes: tuple[int, ...], seed: int) -> NDArray[np.intp]:
    """Numbers of the cycles of logs with so many of them, drawn `DRAWS` times, (draws, cycles)."""
    rng, first = np.random.default_rng(seed), np.cumsum([0, *sizes])
    draws = [
        [at + rng.integers(size, size=size) for at, size in zip(first, sizes, strict=False)]
        for _ in range(DRAWS)
    ]
    return np.array([np.concatenate(one) for one in draws])


def _cycles(data: Fitted, rows: slice) -> list[NDArray[np.intp]]:
    """Blocks of each cycle of a log, by their numbers."""
    cycle = data.blocks.cycle[rows]
    return [rows.start + np.flatnonzero(cycle == c) for c in np.unique(cycle)]


def _squares(data: Fitted, before: Signal, after: Signal) -> Signal:
    """Squares of the gap before, after, of noise, and ones, of every block, (M, 4, 5); 0 where a
    block does not count.
    """
    each = np.stack([before, after, data.logged_noise, np.ones_like(after)], 1)
    return np.where((data.seen & np.isfinite(after))[:, None], each**2, 0.0)


def _sums(squares: Signal, cells: Sequence[slice | NDArray[np.intp]]) -> Signal:
    """Sums over the blocks of logs or cycles, (cells, 4, 5)."""
    return np.array([squares[rows].sum(axis=0) for rows in cells])


def _excess(sums: Signal) -> Signal:
    """What exceeds noise before and after over all channels, in mean squares of it, and how many
    channels count, (3, cells).

    Parameters
    ----------
    sums : (cells, 4, 5) sums of squares of the gap before, after, of noise, and the number of
        blocks, by channel
    """
    before, after, noise, count = np.moveaxis(sums, 1, 0)
    counted = count >= 3.0
    noise = np.where(counted, noise, 1.0)
    each = [(before - noise) / noise, (after - noise) / noise, np.ones_like(noise)]
    return np.array([np.where(counted, one, 0.0).sum(axis=1) for one in each])


def _share_of(excess: Signal) -> Signal:
    """Share that is closed of what exceeds noise, (...) from (3, ...); 0 where it is too small to
    be closed.
    """
    old, new, count = excess
    gap = old > MIN_EXCESS * np.maximum(count, 1.0)
    return np.where(gap, 1.0 - new / np.where(gap, old, 1.0), 0.0)
