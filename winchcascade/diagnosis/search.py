"""The search for the smallest set of effects that explains a problem: sets are screened in closed form and then refitted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.marginal import Marginal, Problem, huber, weights
from winchcascade.diagnosis.suspects import Freedom, freedom, places_of, varied, with_values
from winchcascade.diagnosis.verdict_limits import CLEARLY, REACH

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect

STEP = 0.02
"""Share of the plausible range of a field by which its derivative is taken."""

AT_ONCE = 16
"""Number of derivatives that are computed at once, so that those of many logs keep to their memory."""

STEPS, WORTHWHILE = 8, 0.05
"""Maximum number of steps of a fit, and the improvement of the objective below which it has settled."""

FORESEEN = 0.7
"""Share of the improvement that a step promises from which the derivative serves on. [1]"""

SHARES = (1.0, 0.4, 0.15, 0.05)
"""Shares of a step that are tried until one lowers the objective."""

DOUBTFUL = 5.0
"""Error of the closed form, in evidence, that is expected."""

REFITTED, PAIRED = 3, 12
"""Number of the sets with the most closed-form evidence that are refitted in each round, and of suspects that are tried with
another one beside them."""

MANY, HOPELESS = 5, 2.0
"""Number of causes, and residual mean square in squares of the noise, with which the search ends: more causes do not help."""

MUCH_LOWER = 0.7
"""Share of the objective that a suspect may leave far from its absence for a fit to begin there. [1]"""

FEW = 10
"""Minimum number of groups of residuals for an estimate of their scatter."""


class Fit(msgspec.Struct, frozen=True):
    """A set of suspects, fitted.

    `x` (k,) are the fields of the suspects in a row, those of each at its `place`, `loss` the robust objective with the priors,
    `r` (n,) the residuals with the nuisances integrated out, `curve` (k, k) the curvature of the objective over the fields
    without their prior. Whitened residuals without any nuisance are `given`, (n,). The nuisances that explain most of them
    are `nu`, in units of their tolerance, and `z` (n,) is what these leave.
    """

    names: Names
    place: dict[str, slice]
    x: Signal
    loss: float
    r: Signal
    curve: Signal
    free: Freedom
    given: Signal
    nu: Signal
    z: Signal

    @property
    def scale(self) -> float:
        """Mean square of the residuals, robustly, at least 1: by how much the noise exceeds its estimate."""
        return max(2.0 * huber(self.r) / max(int(np.count_nonzero(self.r)), 1), 1.0)

    def effects(self, suspects: Suspects) -> list[ActiveEffect]:
        """The suspects with the values that were found."""
        return [with_values(suspects[name], self.x[self.place[name]]) for name in self.names]


class Evidence(msgspec.Struct, frozen=True):
    """What weighs the evidence for a set: the problem, and the square by which the noise exceeds its estimate."""

    problem: Problem
    scale: float

    def of(self, fit: Fit) -> float:
        """Logarithm of the evidence for a fit, up to a constant (Laplace)."""
        prior = prior_of(fit.x, fit.free)
        return self.weighed(fit.names, fit.x, fit.free, fit.curve, (fit.loss - prior) / self.scale + prior)

    def weighed(self, names: Names, x: Signal, free: Freedom, curve: Signal, objective: float) -> float:
        """Logarithm of the evidence for a set whose objective is known.

        Parameters
        ----------
        x, curve : (k,) fields of the set in a row, and (k, k) the curvature of the objective there without their prior
        """
        suspects, information = self.problem.suspects, curve / self.scale
        freed = 0.5 * float(np.linalg.slogdet(np.eye(x.size) + information * np.outer(free.sd, free.sd))[1])
        usual = usual_gain(suspects, names, x, free, information)
        return usual - objective - freed - sum(self.problem.price(name) for name in names)

    def worth(self, fit: Fit) -> float:
        """Evidence by which sets of any size compare."""
        return self.of(fit) - CLEARLY * len(fit.names)


def prior_of(x: Signal, free: Freedom) -> float:
    """Part of the objective of the prior of some fields, (k,): normal about their absence, wide as what is plausible."""
    return 0.5 * float(np.sum(((x - free.absent) / free.sd) ** 2))


def usual_gain(suspects: Suspects, names: Names, x: Signal, free: Freedom, information: Signal) -> float:
    """Evidence that wrong entries gain or lose, as part of their prior lies at usual multiples and not even over their range.

    Parameters
    ----------
    x, information : (k,) fields in a row, (k, k) what the data tell of them
    """
    gain, place = 0.0, places_of(suspects, names)
    for name in names:
        entry = suspects[name].fields[0]
        if entry.role != "entry" or not entry.usual:
            continue
        k = place[name].start
        variance = float(np.linalg.inv(information + np.diag(free.sd**-2.0))[k, k])
        multiples = 1.0 + np.array(entry.usual)
        sd = np.sqrt(variance + (entry.scatter * multiples) ** 2)
        density = np.exp(-0.5 * ((1.0 + float(x[k]) - multiples) / sd) ** 2) / (math.sqrt(2.0 * math.pi) * sd)
        peaked = float(np.mean(density) * (free.high[k] - free.low[k]))
        gain += math.log(max((1.0 - entry.usual_share) + entry.usual_share * peaked, 1e-30))
    return gain


def minimum_within(curve: Signal, slope: Signal, low: Signal, high: Signal) -> Signal:
    """Where x' curve x / 2 - slope' x is least within bounds, (k,)."""
    from scipy.optimize import lsq_linear

    root = np.linalg.cholesky(curve)
    aim = np.linalg.solve(root, slope)
    free = np.linalg.solve(root.T, aim)
    if np.all((free >= low) & (free <= high)):
        return np.asarray(free)
    gap = 1e-12 * (1.0 + np.abs(low) + np.abs(high))
    return np.asarray(lsq_linear(root.T, aim, bounds=(low - gap, high + gap), method="bvls").x).clip(low, high)


def columns_of(problem: Problem, marginal: Marginal, fit: Fit, wanted: Sequence[str]) -> Signal:
    """Derivative of the residuals of a fit over the fields of some suspects, which need not act, nuisances integrated out."""
    acting = dict(zip(fit.names, fit.effects(problem.suspects), strict=True))
    variants, steps = [], []
    for name in wanted:
        others = [one for other, one in acting.items() if other != name]
        here = fit.x[fit.place[name]] if name in acting else freedom(problem.suspects[name]).absent
        for moved, step in varied(problem.suspects[name], here, STEP):
            variants.append([*others, moved])
            steps.append(step)
    columns = np.zeros((fit.given.size, len(variants)))
    for first in range(0, len(variants), AT_ONCE):
        several = slice(first, first + AT_ONCE)
        z = marginal.centred(problem.residuals(variants[several], marginal.place))
        columns[:, several] = marginal((z - fit.given[:, None]) / np.array(steps[several]))
    return columns


def begun(suspects: Suspects, names: Names, start: Mapping[str, Signal]) -> Signal:
    """Fields of a set in a row, (k,), as they are known by suspect; suspects that are not known are absent."""
    own = [start.get(name, freedom(suspects[name]).absent) for name in names]
    return np.concatenate([np.zeros(0), *own])


def located(problem: Problem, marginal: Marginal, names: Names, x: Signal, free: Freedom | None = None) -> Fit:
    """A set of suspects with given fields, (k,), not fitted."""
    suspects = problem.suspects
    place, free = places_of(suspects, names), free or freedom(*(suspects[name] for name in names))
    effects = [with_values(suspects[name], x[own]) for name, own in place.items()]
    given = marginal.centred(problem.residuals([effects], marginal.place)[:, 0])
    r = marginal(given)
    return Fit(names, place, x, huber(r) + prior_of(x, free), r, np.zeros((x.size, x.size)), free, given, r, r)


def fit_set(
    problem: Problem,
    marginal: Marginal,
    names: Names,
    start: Mapping[str, Signal] | None = None,
    columns: Signal | None = None,
    *,
    centred: bool = False,
) -> Fit:
    """Fit a set of suspects by Gauss and Newton, each step bounded.

    Parameters
    ----------
    start : fields to begin from by suspect; suspects without any begin absent
    columns : (n, k) derivative of the residuals there or near, which serves as long as it foresees what a step brings
    centred : the prior is about where the fit begins and not about the absence of the suspects
    """
    names = tuple(sorted(names))
    free, x = freedom(*(problem.suspects[name] for name in names)), begun(problem.suspects, names, start or {})

    if centred:
        free = msgspec.structs.replace(free, absent=x.copy())

    def at(x: Signal) -> Fit:
        return located(problem, marginal, names, x, free)

    fit, fresh = at(np.clip(x, free.minimum, free.maximum)), columns is None
    columns = columns_of(problem, marginal, fit, names) if columns is None else columns
    for _ in range(STEPS):
        weighted = columns * weights(fit.r)[:, None]
        fit = msgspec.structs.replace(fit, curve=weighted.T @ columns)
        slope = -weighted.T @ fit.r - (fit.x - free.absent) / free.sd**2
        curve = fit.curve + np.diag(free.sd**-2.0)
        step = minimum_within(curve, slope, free.minimum - fit.x, free.maximum - fit.x)
        promised = fit.loss - huber(fit.r + columns @ step) - prior_of(fit.x + step, free)
        if promised < WORTHWHILE:
            break
        tried = (at(np.clip(fit.x + share * step, free.minimum, free.maximum)) for share in SHARES)
        there = next((one for one in tried if one.loss < fit.loss), None)
        if there is None and fresh:
            break
        gained = 0.0 if there is None else fit.loss - there.loss
        fit = there or fit
        fresh = gained < FORESEEN * promised
        if fresh:
            columns = columns_of(problem, marginal, fit, names)
    nu, left = marginal.best(fit.given)
    return msgspec.structs.replace(fit, nu=nu, z=left)


class Expansion(msgspec.Struct, frozen=True):
    """The objective about a fit as a quadratic in the fields of every suspect, nuisances integrated out.

    `columns` (n, K) are the derivative of the residuals, `curve` (K + m, K + m) and `slope` (K + m,) those of the objective
    without the prior over the K fields and over what m acting suspects do as a whole: without one, the last numbers are 1.
    `value` (K,) are the fields there; those of a suspect are at its `place`.
    """

    evidence: Evidence
    columns: Signal
    curve: Signal
    slope: Signal
    value: Signal
    free: Freedom
    place: dict[str, slice]
    acting: Names

    def index(self, names: Names) -> list[int]:
        """Numbers of the fields of some suspects, in their order."""
        return [k for name in names for k in range(self.value.size)[self.place[name]]]

    def rated(self, names: Names) -> float:
        """Closed-form evidence for a set, up to a constant."""
        own, free, scale, size = self.index(names), self.free, self.evidence.scale, self.value.size
        step, x = np.zeros(self.slope.size), self.value.copy()
        gone = [name for name in self.acting if name not in names]
        step[[size + self.acting.index(name) for name in gone]] = 1.0
        x[self.index(tuple(gone))] = free.absent[self.index(tuple(gone))]
        inside = np.ix_(own, own)
        if own:
            sd = free.sd[own]
            slope = (self.slope[own] - self.curve[own] @ step) / scale - (x - free.absent)[own] / sd**2
            bounds = free.minimum[own] - x[own], free.maximum[own] - x[own]
            step[own] = minimum_within(self.curve[inside] / scale + np.diag(sd**-2.0), slope, *bounds)
            x[own] += step[own]
        objective = (0.5 * float(step @ self.curve @ step) - float(self.slope @ step)) / scale + prior_of(x, free)
        return self.evidence.weighed(names, x[own], free.some(own), self.curve[inside], objective)

    def refitted(self, marginal: Marginal, names: Names, best: Fit) -> Fit:
        """The fit of another set, begun from the fit that this is expanded about."""
        return fit_set(self.evidence.problem, marginal, names, start_of(best), self.columns[:, self.index(names)])

    def worth(self, names: Names) -> float:
        """Closed-form evidence by which sets of any size compare."""
        return self.rated(names) - CLEARLY * len(names)


def expand(
    problem: Problem, marginal: Marginal, names: Names, start: Mapping[str, Signal], scale: float
) -> tuple[Fit, Expansion]:
    """Fit a set, and expand the objective about it in the fields of every suspect.

    Parameters
    ----------
    start : fields to begin from by suspect, near which the derivatives are taken
    scale : square by which the noise exceeds its estimate
    """
    suspects, effects = problem.suspects, tuple(problem.suspects)
    place, free = places_of(suspects, effects), freedom(*suspects.values())
    columns = columns_of(problem, marginal, located(problem, marginal, names, begun(suspects, names, start)), effects)
    own = [k for name in names for k in range(free.absent.size)[place[name]]]
    fit, value = fit_set(problem, marginal, names, start, columns[:, own]), free.absent.copy()
    value[own] = fit.x
    acting = dict(zip(names, fit.effects(suspects), strict=True))
    without = [[one for other, one in acting.items() if other != name] for name in names]
    removed = np.zeros((fit.r.size, 0))
    if names:
        removed = marginal(marginal.centred(problem.residuals(without, marginal.place)) - fit.given[:, None])
    both = np.hstack([columns, removed])
    weighted = both * weights(fit.r)[:, None]
    curve, slope = weighted.T @ both, -weighted.T @ fit.r
    return fit, Expansion(Evidence(problem, scale), columns, curve, slope, value, free, place, names)


def neighbours(expansion: Expansion, names: Names) -> list[Names]:
    """Sets near to one in the order of their closed-form worth: grown by one or two causes, pruned, one cause swapped."""
    others = [name for name in expansion.place if name not in names]
    grown = [(*names, name) for name in others]
    swapped = [(*(n for n in names if n != gone), name) for gone in names for name in others]
    first = sorted(grown, key=expansion.worth, reverse=True)[:PAIRED]
    twice = [(*one, name) for one in first for name in others if name not in one]
    pruned = [tuple(n for n in names if n != gone) for gone in names]
    near = {tuple(sorted(one)) for one in (names, *grown, *swapped, *twice, *pruned)}
    worth = {one: expansion.worth(one) for one in sorted(near)}
    return sorted(worth, key=lambda one: worth[one], reverse=True)


class Found(msgspec.Struct, frozen=True):
    """What a search found: the best fit, that without any cause, every refit by its set, and the expansion about the best."""

    best: Fit
    null: Fit
    fits: dict[Names, Fit]
    expansion: Expansion
    marginal: Marginal

    @property
    def evidence(self) -> Evidence:
        """What weighs the fits."""
        return self.expansion.evidence

    @property
    def scale(self) -> float:
        """Square by which the noise exceeds its estimate."""
        return self.expansion.evidence.scale

    @property
    def problem(self) -> Problem:
        """What was searched."""
        return self.expansion.evidence.problem

    def fit(self, names: Names, start: Mapping[str, Signal] | None = None) -> Fit:
        """The fit of a set, found by the search or else begun from its best fit."""
        ordered = tuple(sorted(names))
        if ordered not in self.fits:
            columns = None if start else self.expansion.columns[:, self.expansion.index(ordered)]
            begin = start_of(self.best) | dict(start or {})
            self.fits[ordered] = fit_set(self.problem, self.marginal, ordered, begin, columns)
        return self.fits[ordered]


def start_of(fit: Fit) -> dict[str, Signal]:
    """Fields of a fit by suspect, for another fit to begin from."""
    return {name: fit.x[own] for name, own in fit.place.items()}


def marginal_about(problem: Problem, effects: Sequence[ActiveEffect], nu: Signal) -> Marginal:
    """The nuisances of a problem integrated out about some effects and nuisances, these within `REACH`."""
    place = np.clip(nu, -REACH, REACH)
    return Marginal(place, problem.nuisance_columns(effects, place))


def search(problem: Problem, on_progress: Callable[[str], None] = lambda _: None) -> Found:
    """Find the set of suspects with the most evidence.

    Round by round, sets near to the best one are screened in closed form and the most promising refitted. If one of these is
    worth more, the nuisances are expanded anew about it, and it is the next.

    Parameters
    ----------
    on_progress : called with a sentence on each step
    """
    marginal = marginal_about(problem, [], np.zeros(problem.nuisances))
    given = fit_set(problem, marginal, ())
    marginal = marginal_about(problem, [], given.nu)
    null, expansion = expand(problem, marginal, (), {}, 1.0)
    best = null
    fits: dict[Names, Fit] = {(): null}
    visited: set[Names] = {()}
    while True:
        on_progress(f"{len(visited)} sets expanded, best so far: {', '.join(best.names) or 'none'}")
        expansion = msgspec.structs.replace(expansion, evidence=_weighing(problem, fits))
        least = expansion.worth(best.names) - DOUBTFUL
        promising = [names for names in neighbours(expansion, best.names) if names not in fits][:REFITTED]
        promising = [names for names in promising if expansion.worth(names) > least]
        fits |= {names: expansion.refitted(marginal, names, best) for names in promising}
        if promising and not best.names:
            far = {one.names: one for one in _far_starts(problem, marginal)}
            fits |= {names: one for names, one in far.items() if names not in fits or one.loss < fits[names].loss}
        weighing = _weighing(problem, fits)
        top = max(fits.values(), key=weighing.worth)
        if top.names in visited or (len(best.names) > MANY and best.scale > HOPELESS):
            return Found(best, null, fits, msgspec.structs.replace(expansion, evidence=weighing), marginal)
        visited.add(top.names)
        marginal = marginal_about(problem, top.effects(problem.suspects), top.nu)
        best, expansion = expand(problem, marginal, top.names, start_of(top), weighing.scale)
        fits = {best.names: best}


def _weighing(problem: Problem, fits: Mapping[Names, Fit]) -> Evidence:
    """What weighs some fits: the best residuals among them tell by how much the noise exceeds its estimate."""
    return Evidence(problem, min(fit.scale for fit in fits.values()))


def _far_starts(problem: Problem, marginal: Marginal) -> list[Fit]:
    """Fits of single suspects that begin where the objective is lowest of the places that the problem names: far from where a
    suspect is absent no expansion holds.
    """
    begins = [(name, np.array([value])) for name, values in problem.begins.items() for value in values]
    effects = [[], *([with_values(problem.suspects[name], x)] for name, x in begins)]
    given, *losses = (huber(marginal(marginal.centred(z))) for z in problem.residuals(effects, marginal.place).T)
    lower = [k for k in np.argsort(losses).tolist()[:REFITTED] if losses[k] < MUCH_LOWER * given]
    return [fit_set(problem, marginal, (begins[k][0],), dict([begins[k]])) for k in lower]


def covariance_of(found: Found, fit: Fit, columns: Signal) -> Signal:
    """Covariance of the fields of a fit, (k, k): what data and priors leave, nuisances included; 0 for those at a bound.

    The variance of a field is at least that by the scatter of the groups of residuals, as in `grown`.

    Parameters
    ----------
    columns : (n, k) derivative of the residuals over the fields, nuisances integrated out
    """
    inside, covariance = np.flatnonzero(inside_of(fit)), np.zeros((fit.x.size, fit.x.size))
    if inside.size:
        own = columns[:, inside]
        weighted = own * weights(fit.r)[:, None]
        information = weighted.T @ own / found.scale + np.diag(fit.free.sd[inside] ** -2.0)
        inverse = np.linalg.inv(information).astype(np.float64)
        by = np.sqrt([grown(found, own, fit.r, inverse, way) for way in np.eye(inside.size)])
        covariance[np.ix_(inside, inside)] = inverse * np.outer(by, by)
    return covariance


def grown(found: Found, columns: Signal, r: Signal, covariance: Signal, way: Signal) -> float:
    """How much larger the variance of a sum of numbers is than their covariance says, at least 1.

    Residuals of one group are no independent numbers, in spite of the whitening: the sums of the scores of the groups vary as
    the variance does (Liang and Zeger 1986).

    Parameters
    ----------
    columns, r : (n, k) derivative of the residuals over the numbers, and what these leave of them, (n,)
    covariance, way : (k, k) of the numbers, and the weights of the sum, (k,)
    """
    groups, scores = found.problem.groups, weights(r) * r * (columns @ (covariance @ way)) / found.scale
    sums = np.bincount(groups, scores, groups[-1] + 1)
    sums = sums[sums != 0.0]
    if sums.size < FEW:
        return 1.0
    together = float(sums.size / (sums.size - 1.0) * (sums @ sums))
    return max(together / float(way @ covariance @ way), 1.0)


def inside_of(fit: Fit) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether the fields of a fit lie at none of the bounds of what is possible, (k,)."""
    margin = 1e-9 * (fit.free.high - fit.free.low)
    return np.asarray((fit.x > fit.free.minimum + margin) & (fit.x < fit.free.maximum - margin))
