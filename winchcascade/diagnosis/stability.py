"""Stability of each cause: its number from every run alone, and whether this drifts over the runs or depends on the load.

The objective is expanded about the joint fit, and every run gets a strength of the cause of its own. The other causes and the
nuisances are common to the runs: what a common nuisance can explain is no scatter of the runs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.diagnosis.causes import COVERED, LAW, covariance_of, slope_of_reported
from winchcascade.diagnosis.diagnosis_result import Along, NamedCause, RunValue, Stability, Trend
from winchcascade.diagnosis.evidence import Fit, inside_of
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.solve import Jacobian, weights
from winchcascade.diagnosis.suspects import Suspects, freedom, with_values

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted

    Rulers = Mapping[Along, Signal]

CHANCE = 1e-3
"""Trends and scatters are reported if runs that agree would show one as large, of any cause, with a smaller probability."""

TRIED = 3
"""What is tried of each cause: a trend with the order, one with the load, a scatter."""

MIN_RUNS = 3
"""Minimum number of runs with a number of their own for a trend or a scatter."""

NO_PART = 1e-9
"""Information of a run on a cause, as a share of that of all runs, below which the run does not depend on it."""


class RunNormal(NamedTuple):
    """Normal equations of one run: the parameters that it depends on (a,), their curvature (a, a) and slope (a,).

    Parameters are the nuisances, then the fields of all causes.
    """

    active: NDArray[np.intp]
    curve: Signal
    slope: Signal


class Expansion(NamedTuple):
    """The objective with a strength of one cause for each run, as a quadratic about the joint fit, unit noise.

    `common` (p,) are the parameters that the runs share, `curve` (p, p) and `slope` (p,) theirs with the priors. Of the
    strengths, as shares of that of the joint fit, `height` (r,) is the curvature, `pull` (r,) the slope, and `across` (p, r)
    what couples them to the common parameters.
    """

    common: NDArray[np.intp]
    curve: Signal
    slope: Signal
    height: Signal
    pull: Signal
    across: Signal

    @property
    def known(self) -> NDArray[np.bool_]:
        """Runs that depend on the cause, (r,)."""
        return self.height > NO_PART * float(self.height.sum())


def with_stability(
    data: Fitted, suspects: Suspects, fit: Fit, scale: float, causes: Sequence[NamedCause]
) -> tuple[NamedCause, ...]:
    """The causes of a joint fit with their numbers run by run."""
    found = stabilities(data, suspects, fit, scale)
    return tuple(msgspec.structs.replace(cause, stability=found[cause.effect]) for cause in causes)


def stabilities(data: Fitted, suspects: Suspects, fit: Fit, scale: float) -> dict[str, Stability]:
    """Numbers of the causes of a joint fit run by run, by effect.

    Parameters
    ----------
    fit : the joint fit, with the columns of its causes
    scale : square by which the noise exceeds its estimate [1]
    """
    normals, covariance = run_normals(data, fit), covariance_of(data, fit, scale)
    inverse = scale * np.linalg.pinv(fit.curve, hermitian=True)
    found = {}
    for name in fit.names:
        effect, place = suspects[name], fit.place[name]
        free = freedom(effect)
        ends = [with_values(effect, x).reported for x in (free.absent, fit.x[place], free.low, free.high)]
        size, step = ends[1] - ends[0], fit.x[place] - free.absent
        if size == 0.0:  # it acts by its other fields alone: no run determines the reported number
            runs = (RunValue(k, withheld=k in data.withheld) for k in range(len(data.rows)))
            found[name] = Stability(tuple(runs), ())
            continue
        by = slope_of_reported(effect, fit.x[place]) / size
        joint, curved = (float(by @ of[place, place] @ by) for of in (covariance, inverse))
        uncertain = _Uncertain(
            noise=scale * max(joint / max(curved, 1e-300), 1.0),
            joint=joint,
            span=abs((ends[3] - ends[2]) / size),
            chance=CHANCE / (TRIED * len(fit.names)),
        )
        found[name] = _in_unit(_stability(data, normals, expand(fit, normals, place, step), uncertain), ends[0], size)
    return found


def run_normals(data: Fitted, fit: Fit) -> list[RunNormal]:
    """Normal equations of every run about a fit."""
    w, fields, found = weights(fit.z), np.hstack([fit.columns[name] for name in fit.names]), []
    j = (fit.j_nu or data.jacobian(fit.nu, [])).beside(fields)
    for rows in data.rows:
        own = slice(rows.start * len(CHANNELS), rows.stop * len(CHANNELS))
        local = [
            msgspec.structs.replace(part, rows=part.rows - own.start)
            for part in j.local
            if part.rows.size and own.start <= part.rows[0] < own.stop
        ]
        of_run = Jacobian(j.size, j.dense[own], j.at, local)
        curve, slope = of_run.normal(w[own]), of_run.summed(w[own] * fit.z[own])
        active = np.flatnonzero(np.diag(curve))
        found.append(RunNormal(active, curve[np.ix_(active, active)], slope[active]))
    return found


def expand(fit: Fit, normals: Sequence[RunNormal], place: slice, step: Signal) -> Expansion:
    """Expand the objective about a fit; fields of other causes at a bound count as known.

    Parameters
    ----------
    place : of the fields of the cause
    step : (k,) what the strength moves, from the cause absent to the cause as fitted
    """
    n, size, bounds = fit.nu.size, fit.nu.size + fit.x.size, fit.bounds
    moved, free = np.zeros(size), np.ones(size, dtype=bool)
    moved[n:][place] = step
    free[n:] = inside_of(fit.x, bounds)
    free[n:][place] = False
    curve = np.diag(np.concatenate((np.ones(n), (bounds.inner_high - bounds.inner_low) ** -2.0)))
    beyond = 1.0 * (fit.x > bounds.inner_high) - 1.0 * (fit.x < bounds.inner_low)
    slope = np.concatenate((-fit.nu, -bounds.rate * beyond))
    across = np.zeros((size, len(normals)))
    for r, normal in enumerate(normals):
        curve[np.ix_(normal.active, normal.active)] += normal.curve
        slope[normal.active] += normal.slope
        across[normal.active, r] = normal.curve @ moved[normal.active]
    pull = np.array([moved[normal.active] @ normal.slope for normal in normals])
    common = np.flatnonzero(free)
    return Expansion(common, curve[np.ix_(common, common)], slope[common], moved @ across, pull, across[common])


def strengths(e: Expansion) -> tuple[Signal, Signal]:
    """Strengths of the runs that depend on the cause, (q,), beside the common parameters, and their covariance, (q, q)."""
    height, pull, across = e.height[e.known], e.pull[e.known], e.across[:, e.known]
    back = across / height
    rest = np.linalg.inv(e.curve - back @ across.T)
    shift = rest @ (e.slope - back @ pull)
    return 1.0 + pull / height - back.T @ shift, np.diag(1.0 / height) + back.T @ rest @ back


def strengths_alone(e: Expansion, normals: Sequence[RunNormal], given: Signal) -> tuple[Signal, Signal]:
    """Strength in each run that depends on the cause, (q,), and its variance, (q,), from that run alone.

    What concerns this run alone, as the zeros of its sensors, is fitted with it; what it shares with others is as the joint fit
    has it once the strengths of the runs are `given`, (r,).
    """
    shift = np.linalg.solve(e.curve, e.slope - e.across @ (given - 1.0))
    users = np.zeros((len(normals), e.common.size), dtype=bool)
    for r, normal in enumerate(normals):
        users[r] = np.isin(e.common, normal.active)
    found = []
    for r in np.flatnonzero(e.known).tolist():
        local = users[r] & (users.sum(axis=0) == 1)
        back = np.linalg.solve(e.curve[np.ix_(local, local)], e.across[local, r])
        height = e.height[r] - float(e.across[local, r] @ back)
        # the local parameters are at their optimum for the given strength, about which the strength of the run is then sought
        pull = e.pull[r] - float(e.across[:, r] @ shift) - e.height[r] * (given[r] - 1.0)
        found.append((given[r] + pull / height, 1.0 / height))
    share, variance = np.array(found).reshape(-1, 2).T
    return share, variance


class _Uncertain(NamedTuple):
    """Variance of the noise in units of the objective, that of the strength in the joint fit, its plausible range, and the
    probability below which a difference between runs is none of chance.
    """

    noise: float
    joint: float
    span: float
    chance: float


def _stability(data: Fitted, normals: Sequence[RunNormal], e: Expansion, uncertain: _Uncertain) -> Stability:
    """Stability of one cause, as shares of its strength in the joint fit.

    The uncertainty of a run alone has its own part and what the runs have in common, which is what the joint fit has beyond
    the own parts. The law of an effect is exact to a share of `LAW` only, alike in runs with the same load.
    """
    given, runs = np.ones(len(normals)), np.flatnonzero(e.known)
    free, covariance = strengths(e)
    own = uncertain.noise * strengths_alone(e, normals, given)[1]
    shared = max(uncertain.joint - 1.0 / float(np.sum(1.0 / own)), 0.0) + LAW**2
    half = COVERED * np.sqrt(own + shared)
    resolved = 2.0 * half < uncertain.span
    loads = np.array([log.load for log in data.logs])[runs]
    spread = uncertain.noise * covariance + LAW**2 * (loads[:, None] == loads)
    trends, course = trends_of(
        free[resolved],
        spread[np.ix_(resolved, resolved)],
        _rulers(np.array(data.order.begins)[runs[resolved]], loads[resolved]),
        uncertain.chance,
    )
    given[runs[resolved]] = course
    share = strengths_alone(e, normals, given)[0]
    numbers = zip(runs[resolved].tolist(), share[resolved].tolist(), half[resolved].tolist(), strict=True)
    values = {run: RunValue(run, x, x - u, x + u) for run, x, u in numbers}
    every = (values.get(k) or RunValue(k, withheld=k in data.withheld) for k in range(len(normals)))
    return Stability(tuple(every), tuple(trends))


def _in_unit(stability: Stability, absent: float, size: float) -> Stability:
    """Stability in the unit in which a cause is reported, of shares of a strength that moves it by `size` from `absent`."""
    runs = []
    for one in stability.runs:
        low, high = sorted((absent + size * one.low, absent + size * one.high))
        runs.append(msgspec.structs.replace(one, value=absent + size * one.value, low=low, high=high))
    trends = (msgspec.structs.replace(t, change=size * t.change, u=abs(size) * t.u) for t in stability.trends)
    return Stability(tuple(runs), tuple(trends))


# ------------------------------------------------------------------------------------------------------------ trends
def _rulers(order: Signal, loads: Signal) -> Rulers:
    """Order of some runs and conductance of their loads, (r,) each from 0 to 1, where these differ."""
    rulers: Rulers = {"order": order, "load": 1.0 / loads}
    return {along: (x - x.min()) / np.ptp(x) for along, x in rulers.items() if x.size and np.ptp(x) > 0.0}


def trends_of(x: Signal, covariance: Signal, rulers: Rulers, limit: float = CHANCE) -> tuple[list[Trend], Signal]:
    """What differs between numbers of several runs beyond their uncertainty, by generalised least squares (Aitken 1936).

    A straight line over each ruler is tried alone, and where several pass, all together. Where none passes, the scatter of the
    numbers about their mean is compared with a chi-square distribution.

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
    alone = {along: _slopes(x, covariance, {along: ruler})[0][along] for along, ruler in rulers.items()}
    passing = sorted((along for along in alone if alone[along].chance < limit), key=lambda a: alone[a].chance)
    if not passing:
        course = _slopes(x, covariance, {})[1]
        chance = float(chdtrc(x.size - 1, (x - course) @ np.linalg.solve(covariance, x - course)))
        return [Trend("scatter", float(np.ptp(x)), math.nan, chance)] if chance < limit else [], course
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
    """Change of x over the length of each ruler, fitted together with one level, and x by that fit, (r,)."""
    columns = np.column_stack([np.ones(x.size), *rulers.values()])
    weighted = np.linalg.solve(covariance, columns)
    spread = np.linalg.pinv(columns.T @ weighted, hermitian=True)
    fitted, u = spread @ (weighted.T @ x), np.sqrt(np.maximum(np.diag(spread), 1e-300))
    trends = {
        along: Trend(along, float(change), float(sd), math.erfc(abs(change) / (math.sqrt(2.0) * sd)))
        for along, change, sd in zip(rulers, fitted[1:], u[1:], strict=True)
    }
    return trends, columns @ fitted
