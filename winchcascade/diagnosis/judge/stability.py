"""Stability of each cause: its number in every run, and whether this drifts over the runs or
depends on the load.

The objective is expanded about the joint fit, and every run gets a separate strength of the cause.
The other causes and the nuisances are common to the runs: what a common nuisance can explain
is no scatter of the runs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import Along, RunValue, Stability, Trend
from winchcascade.diagnosis.fit.covariance import grown
from winchcascade.diagnosis.fit.evidence import inside_of
from winchcascade.diagnosis.fit.marginal import weights
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import freedom, with_values
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.verdict_limits import CHANCE, LAW, MIN_RUNS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.fit.search import Found

    Rulers = Mapping[Along, Signal]

TRENDS_TRIED = 3
"""What is tried of each cause: a trend with the order, one with the load, a scatter."""

INFORMATION_MIN = 1e-9
"""Information of a run on a cause, as a share of that of all runs, below which the run does not
depend on it.
"""


def stabilities(data: Fitted, found: Found) -> dict[str, Stability]:
    """Numbers of the causes of the best fit run by run, by effect."""
    fit, several = found.best, {}
    for name in fit.names:
        effect, place = found.problem.suspects[name], fit.place[name]
        free = freedom(effect)
        ends = [
            with_values(effect, x).reported
            for x in (free.absent, fit.x[place], free.low, free.high)
        ]
        size = ends[1] - ends[0]
        if size == 0.0:  # it acts by its other fields alone: no run determines the reported number
            several[name] = Stability(_of_every_run(data, {}), ())
            continue
        runs, share, covariance = strengths(data, found, name)
        stability = _stability(
            data, runs, share, covariance, abs((ends[3] - ends[2]) / size), len(fit.names)
        )
        several[name] = _in_unit(stability, ends[0], size)
    return several


def strengths(data: Fitted, found: Found, name: str) -> tuple[NDArray[np.intp], Signal, Signal]:
    """Strength of one cause in each run, as shares of that in the best fit; other causes and
    nuisances are common to all runs.

    Returns
    -------
    Numbers of the runs that depend on it, (q,), strengths, (q,), and their covariance, (q, q)
    """
    fit, expansion = found.best, found.expansion
    columns, place = expansion.over(fit.names), fit.place[name]
    way = found.marginal.undone(columns[:, place] @ (fit.x[place] - fit.free.absent[place]))
    sizes = [float(np.sum(way[_rows(rows)] ** 2)) for rows in data.rows]
    runs = np.flatnonzero(np.array(sizes) > INFORMATION_MIN * sum(sizes))
    parts = np.zeros((way.size, runs.size))
    for column, run in enumerate(runs.tolist()):
        parts[_rows(data.rows[run]), column] = way[_rows(data.rows[run])]
    others = inside_of(fit)
    others[place] = False
    both = np.hstack([found.marginal(parts), columns[:, others]])
    weighted, prior = (
        both * weights(fit.r)[:, None],
        np.concatenate((np.zeros(runs.size), fit.free.sd[others] ** -2.0)),
    )
    pulled = np.concatenate((np.zeros(runs.size), (fit.x - fit.free.absent)[others]))
    information = weighted.T @ both / found.scale + np.diag(prior)
    covariance = np.linalg.pinv(information, hermitian=True).astype(np.float64)
    step = covariance @ (-weighted.T @ fit.r / found.scale - prior * pulled)
    together = np.where(np.arange(step.size) < runs.size, 1.0, 0.0)
    by = grown(found, both, fit.r + both @ step, covariance, together)
    return runs, 1.0 + step[: runs.size], np.asarray(by * covariance[: runs.size, : runs.size])


def _rows(blocks: slice) -> slice:
    """Residuals of some blocks in a row."""
    return slice(blocks.start * len(CHANNELS), blocks.stop * len(CHANNELS))


def _stability(
    data: Fitted,
    runs: NDArray[np.intp],
    share: Signal,
    covariance: Signal,
    span: float,
    causes: int,
) -> Stability:
    """Stability of one cause, in shares of its strength in the joint fit.

    The law of an effect is exact to a share of `LAW` only, alike in runs with the same load.

    Parameters
    ----------
    runs, share, covariance : as `strengths` gives them
    span : plausible range of the cause
    causes : number of causes that are judged
    """
    half = COVERED * np.sqrt(np.diag(covariance) + LAW**2)
    resolved = 2.0 * half < span
    loads = np.array([log.load for log in data.logs])[runs]
    spread = covariance + LAW**2 * (loads[:, None] == loads)
    rulers = _rulers(np.array(data.order.begins)[runs[resolved]], loads[resolved])
    trends, _ = trends_of(
        share[resolved],
        spread[np.ix_(resolved, resolved)],
        rulers,
        CHANCE / (TRENDS_TRIED * causes),
    )
    numbers = zip(
        runs[resolved].tolist(), share[resolved].tolist(), half[resolved].tolist(), strict=True
    )
    values = {run: RunValue(run, x, x - u, x + u) for run, x, u in numbers}
    return Stability(_of_every_run(data, values), tuple(trends))


def _of_every_run(data: Fitted, known: Mapping[int, RunValue]) -> tuple[RunValue, ...]:
    """Numbers of some runs, and NaN for the others."""
    return tuple(
        known.get(k) or RunValue(k, withheld=k in data.withheld) for k in range(len(data.rows))
    )


def _in_unit(stability: Stability, absent: float, size: float) -> Stability:
    """Stability in the unit in which a cause is reported, of shares of a strength that moves it
    by `size` from `absent`.
    """
    runs = []
    for one in stability.runs:
        low, high = sorted((absent + size * one.low, absent + size * one.high))
        runs.append(
            msgspec.structs.replace(one, value=absent + size * one.value, low=low, high=high)
        )
    trends = (
        msgspec.structs.replace(t, change=size * t.change, u=abs(size) * t.u)
        for t in stability.trends
    )
    return Stability(tuple(runs), tuple(trends))


# ----------------------------------------------------------------------------------------- trends
def _rulers(order: Signal, loads: Signal) -> Rulers:
    """Order of some runs and conductance of their loads, (r,) each from 0 to 1, where these
    differ.
    """
    rulers: Rulers = {"order": order, "load": 1.0 / loads}
    return {
        along: (x - x.min()) / np.ptp(x)
        for along, x in rulers.items()
        if x.size and np.ptp(x) > 0.0
    }


def trends_of(
    x: Signal, covariance: Signal, rulers: Rulers, limit: float = CHANCE
) -> tuple[list[Trend], Signal]:
    """What differs between numbers of several runs beyond their uncertainty, by generalised least
    squares (Aitken 1936).

    A straight line over each ruler is tried alone, and where several pass, all together. Where none
    passes, the scatter of the numbers about their mean is compared with a chi-square distribution.

    Parameters
    ----------
    x, covariance : (r,) numbers and (r, r) their covariance
    rulers : (r,) each, from 0 to 1
    limit : probability below which a difference is none of chance

    Returns
    -------
    What differs, and the numbers by the lines that are reported, (r,): their mean without any.
    """
    from scipy.special import chdtrc

    if x.size < MIN_RUNS:
        return [], np.ones(x.size)
    alone = {
        along: _slopes(x, covariance, {along: ruler})[0][along] for along, ruler in rulers.items()
    }
    passing = sorted(
        (along for along in alone if alone[along].chance < limit), key=lambda a: alone[a].chance
    )
    if not passing:
        course = _slopes(x, covariance, {})[1]
        chance = float(chdtrc(x.size - 1, (x - course) @ np.linalg.solve(covariance, x - course)))
        return [
            Trend("scatter", float(np.ptp(x)), math.nan, chance)
        ] if chance < limit else [], course
    first, *others = passing
    together = _slopes(x, covariance, rulers)[0] if others and x.size > MIN_RUNS else {}
    clear: list[Along] = [along for along in together if together[along].chance < limit]
    if len(clear) > 1:
        return [together[along] for along in clear], _slopes(x, covariance, rulers)[1]
    leading = clear[0] if clear else first
    instead = others[0] if others and not clear else None
    course = _slopes(x, covariance, {leading: rulers[leading]})[1]
    return [msgspec.structs.replace(alone[leading], instead=instead)], course


def _slopes(x: Signal, covariance: Signal, rulers: Rulers) -> tuple[dict[Along, Trend], Signal]:
    """Change of x over the length of each ruler, fitted together with one level, and x by that
    fit, (r,).
    """
    columns = np.column_stack([np.ones(x.size), *rulers.values()])
    weighted = np.linalg.solve(covariance, columns)
    spread = np.linalg.pinv(columns.T @ weighted, hermitian=True)
    fitted, u = spread @ (weighted.T @ x), np.sqrt(np.maximum(np.diag(spread), 1e-300))
    trends = {
        along: Trend(
            along, float(change), float(sd), math.erfc(abs(change) / (math.sqrt(2.0) * sd))
        )
        for along, change, sd in zip(rulers, fitted[1:], u[1:], strict=True)
    }
    return trends, columns @ fitted
