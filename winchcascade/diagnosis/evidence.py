"""The fit of a set of suspects to a campaign, nuisances beside them, the evidence for the set, and the search for the smallest
sufficient set: sets are screened in closed form and decided by refits.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.entries import price_of, usual_gain, usual_values
from winchcascade.diagnosis.solve import (
    Bounds,
    Effort,
    Jacobian,
    gauss_newton,
    huber,
    minimum_within,
    normal_equations,
    quadratic,
)
from winchcascade.diagnosis.suspects import Suspects, freedom, places_of, varied, with_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.misfit import Fitted, Variant
    from winchcascade.rig.effects.effect import ActiveEffect

STEP = 0.02
"""Share of the plausible range of a field by which its derivative is taken."""

WHOLE = Effort(rounds=12, renewals=12, settled=0.05, foreseen=0.8)
"""Of a fit that is carried to its end."""

QUICK = Effort(rounds=5, renewals=1, settled=0.5, foreseen=0.5)
"""Of a fit that is enough to find which of some sets is best."""

BEAM = 8
"""Beam width: number of sets kept in each round."""

REFITTED = 3
"""Number of the sets with the most closed-form evidence that are refitted in each round."""

DOUBTFUL = 5.0
"""Error of the closed form, in evidence, that is expected."""

ROUNDS = 8
"""Maximum number of rounds of screening and refitting."""

MAX_SUSPECTS = 9
"""Maximum number of suspects in a set."""

CLEARLY = 5.0
"""The smaller set wins unless the larger one has so much more evidence, prices paid: very strong by Kass and Raftery (1995),
odds of a hundred and fifty to one."""

MANY, HOPELESS = 5, 2.0
"""Number of causes, and residual mean square in squares of the noise, with which the search ends: more causes do not help."""

MUCH_LOWER = 0.7
"""Share of the objective that a wrong entry at a usual multiple may leave for a fit to begin there. [1]"""

FURTHER = 2
"""Number of causes, beyond those of the fit about which it was expanded, up to which the closed form is used."""


class Fit(msgspec.Struct, frozen=True):
    """A set of suspects, fitted.

    `x` (k,) are the fields of the suspects in a row, those of each at its `place`, `nu` the nuisances in units of their
    tolerance, `loss` the robust objective with the priors, `z` the whitened residuals. Of the fields, nuisances eliminated:
    `curve` (k, k) and `slope` (k,) of the objective, and their `bounds`. `j_nu` are the columns of the nuisances, `columns`
    those of suspects; a fit that is kept for comparison has neither. One that has not `settled` may lie far above its minimum.
    """

    names: Names
    place: dict[str, slice]
    x: Signal
    nu: Signal
    loss: float
    z: Signal
    curve: Signal
    slope: Signal
    bounds: Bounds
    j_nu: Jacobian | None
    columns: Mapping[str, Signal]
    settled: bool

    def evidence(self, scale: float) -> float:
        """Logarithm of the evidence, up to a constant, residuals scaled by the square `scale`."""
        cost = cost_of(self.curve / scale, self.slope / scale, self.x, self.bounds)
        return -self.loss / scale - cost + self.gain(scale) - price(self.names)

    def gain(self, scale: float) -> float:
        """Evidence that its wrong entries gain or lose by how near they are to usual multiples, as in `usual_gain`."""
        return usual_gain(self.names, self.place, self.x, self.bounds, self.curve / scale)

    def effects(self, suspects: Suspects) -> list[ActiveEffect]:
        """The suspects with the values that were found."""
        return [with_values(suspects[name], self.x[self.place[name]]) for name in self.names]


class RigProblem:
    """The fit of some suspects to the logs of a rig as a `Problem`: nuisances, then the fields of the suspects in a row.

    Parameters
    ----------
    names : of the suspects that act
    rows : (M * 5,) weights of the residuals, 0 for what takes no part; 1 for all by default
    reach : bound of the magnitude of a nuisance, in units of its tolerance
    """

    def __init__(
        self, data: Fitted, suspects: Suspects, names: Names, rows: Signal | None = None, reach: float = math.inf
    ) -> None:
        self.data, self.suspects, self.names = data, suspects, names
        self.nuisances, self.place = len(data.nuisances), places_of(suspects, names)
        self.free = freedom(*(suspects[name] for name in names))
        edge = np.full(self.nuisances, reach)
        self.bounds = Bounds.of(-edge, edge).beside(self.free.bounds)
        self.rows = np.ones(data.measured.size) if rows is None else rows

    def effects(self, x: Signal) -> dict[str, ActiveEffect]:
        """The suspects with their values."""
        phi = x[self.nuisances :]
        return {name: with_values(self.suspects[name], phi[own]) for name, own in self.place.items()}

    def residual(self, x: Signal) -> Signal:
        """Whitened residuals, (M * 5,)."""
        return self.data.residual(x[: self.nuisances], [*self.effects(x).values()]) * self.rows

    def jacobian(self, x: Signal) -> Jacobian:
        """Whitened derivative of the prediction over the nuisances and the fields."""
        return self.joined(*self.all_columns(x, self.names))

    def joined(self, j_nu: Jacobian, columns: Mapping[str, Signal]) -> Jacobian:
        """Columns of the nuisances and of the suspects that act, rows weighted."""
        fields = [columns[name] for name in self.names]
        both = j_nu.beside(np.hstack(fields)) if fields else j_nu
        return both if np.all(self.rows == 1.0) else both.weighted(self.rows)

    def nuisance_columns(self, x: Signal) -> Jacobian:
        """Whitened derivative of the prediction over the nuisances."""
        return self.data.jacobian(x[: self.nuisances], [*self.effects(x).values()])

    def all_columns(self, x: Signal, wanted: Iterable[str]) -> tuple[Jacobian, dict[str, Signal]]:
        """What `nuisance_columns` and `columns` give, from one pass through the logs."""
        place, variants, steps = self._variants(x, wanted)
        if not variants:
            return self.nuisance_columns(x), {}
        nu, acting = x[: self.nuisances], [*self.effects(x).values()]
        j_nu, columns = self.data.jacobian_beside(nu, acting, variants, np.array(steps))
        return j_nu, {name: columns[:, own] for name, own in place.items()}

    def columns(self, x: Signal, wanted: Iterable[str]) -> dict[str, Signal]:
        """Whitened derivative of the prediction over the fields of some suspects, which need not act, each (M * 5, k)."""
        place, variants, steps = self._variants(x, wanted)
        if not variants:
            return {}
        moves = self.data.differences(x[: self.nuisances], [*self.effects(x).values()], variants)
        columns = self.data.whiten(moves / np.array(steps))
        return {name: columns[:, own] for name, own in place.items()}

    def _variants(self, x: Signal, wanted: Iterable[str]) -> tuple[dict[str, slice], list[Variant], list[float]]:
        """Places of the fields of some suspects in a row, and the variant and step by which each is differentiated."""
        acting, place = self.effects(x), places_of(self.suspects, wanted)
        variants: list[Variant] = []
        steps: list[float] = []
        for name in place:
            effect, others = self.suspects[name], [one for other, one in acting.items() if other != name]
            here = x[self.nuisances :][self.place[name]] if name in acting else freedom(effect).absent
            for moved, step in varied(effect, here, STEP):
                variants.append((x[: self.nuisances], [*others, moved]))
                steps.append(step)
        return place, variants, steps


def fit_set(problem: RigProblem, start: Fit | None = None, *, quick: bool = False) -> Fit:
    """Fit a set of suspects, nuisances beside them.

    Parameters
    ----------
    start : a fit to begin from, with its columns if it has any; suspects that it lacks begin absent
    quick : a few steps
    """
    n, names, bounds = problem.nuisances, problem.names, problem.bounds
    x = np.concatenate((np.zeros(n), problem.free.absent))
    known: dict[str, Signal] = {}
    if start is not None:
        x[:n] = np.clip(start.nu, bounds.low[:n], bounds.high[:n])
        for name in set(names) & set(start.names):
            x[n:][problem.place[name]] = start.x[start.place[name]]
        known = {name: start.columns[name] for name in names if name in start.columns}
    new = [name for name in names if name not in known]
    if start is None or start.j_nu is None:
        j_nu, found_columns = problem.all_columns(x, new)
    else:
        j_nu, found_columns = start.j_nu, problem.columns(x, new)
    known |= found_columns
    found = gauss_newton(problem, x, problem.joined(j_nu, known), QUICK if quick else WHOLE)
    q = quadratic(*normal_equations(found.z, found.j, found.x[:n]), n)
    j_nu, fields = found.j.split(n)
    columns = {name: fields[:, own] for name, own in problem.place.items()}
    x = found.x
    place, bounds = problem.place, problem.free.bounds
    return Fit(names, place, x[n:], x[:n], found.loss, found.z, q.curve, q.slope, bounds, j_nu, columns, found.settled)


def scale_of(fit: Fit) -> float:
    """Mean square of the whitened residuals of a fit, robustly, at least 1: by how much the noise exceeds its estimate."""
    return max(2.0 * huber(fit.z) / max(int(np.count_nonzero(fit.z)), 1), 1.0)


class Linear(msgspec.Struct, frozen=True):
    """The objective about a fit as a quadratic in the fields of every suspect, nuisances eliminated.

    `curve` (k, k) and `slope` (k,) are in the units of the fields; `value` and `absent` (k,) are the fields at the place of
    expansion and where they are absent. The fields of a suspect are at its `place`.
    """

    curve: Signal
    slope: Signal
    value: Signal
    absent: Signal
    bounds: Bounds
    place: Mapping[str, slice]

    def index(self, names: Names) -> list[int]:
        """Numbers of the fields of some suspects, in their order."""
        return [k for name in names for k in range(self.value.size)[self.place[name]]]

    def best(self, names: Names) -> tuple[float, Signal]:
        """Lowest objective of a set, relative to the place of expansion, and its fields, (k,)."""
        chosen = np.zeros(self.value.size, dtype=bool)
        chosen[self.index(names)] = True
        step = np.where(chosen, 0.0, self.absent - self.value)
        if names:
            pull = self.slope[chosen] - self.curve[np.ix_(chosen, ~chosen)] @ step[~chosen]
            bounds = self.bounds.some(chosen).about(self.value[chosen])
            step[chosen] = minimum_within(self.curve[np.ix_(chosen, chosen)], pull, bounds)
        objective = 0.5 * float(step @ self.curve @ step) - float(self.slope @ step)
        x = self.value + step
        return objective + self.bounds.penalty(x) - self.bounds.penalty(self.value), x

    def evidence(self, names: Names, scale: float) -> float:
        """Logarithm of the evidence for a set, up to a constant, residuals scaled by the square `scale`."""
        own, (objective, x) = self.index(names), self.best(names)
        slope = (self.slope - self.curve @ (x - self.value))[own] / scale
        curve, bounds = self.curve[np.ix_(own, own)] / scale, self.bounds.some(np.array(own, dtype=np.intp))
        gain = usual_gain(names, self._among(names), x[own], bounds, curve)
        return -objective / scale - cost_of(curve, slope, x[own], bounds) + gain - price(names)

    def _among(self, names: Names) -> dict[str, slice]:
        """Where each of some suspects has its fields in a row of theirs alone."""
        ends = np.cumsum([0, *(self.place[name].stop - self.place[name].start for name in names)]).tolist()
        return {name: slice(a, b) for name, (a, b) in zip(names, pairwise(ends), strict=True)}


def linearise(data: Fitted, suspects: Suspects, about: Fit) -> tuple[Linear, Fit]:
    """Expand the objective about a fit in the fields of every suspect; and the fit with all their columns, found anew."""
    problem, here = RigProblem(data, suspects, about.names), np.concatenate((about.nu, about.x))
    j_nu, columns = problem.all_columns(here, suspects)
    q = quadratic(*normal_equations(about.z, j_nu.beside(np.hstack([*columns.values()])), about.nu), about.nu.size)
    free, place = freedom(*suspects.values()), places_of(suspects, suspects)
    value = free.absent.copy()
    for name in about.names:
        value[place[name]] = about.x[about.place[name]]
    linear = Linear(q.curve, q.slope, value, free.absent, free.bounds, place)
    return linear, msgspec.structs.replace(about, j_nu=j_nu, columns=columns)


def price(names: Names) -> float:
    """Evidence that the causes must bring beyond their own freedom."""
    return sum(price_of(name) for name in names)


def cost_of(curve: Signal, slope: Signal, x: Signal, bounds: Bounds) -> float:
    """What the freedom of fields costs: the share of their plausible ranges that the data leave (Laplace).

    A field at one of its bounds keeps a half of its normal or, where the objective rises from the bound, an exponential.

    Parameters
    ----------
    curve, slope : (k, k) and (k,) of the objective at the fields `x`, (k,)
    """
    span, inside = bounds.inner_high - bounds.inner_low, inside_of(x, bounds)
    cost = 0.0
    if inside.any():
        scaled = curve[np.ix_(inside, inside)] * np.outer(span[inside], span[inside]) + np.eye(int(inside.sum()))
        cost += 0.5 * float(np.linalg.slogdet(scaled)[1]) - 0.5 * int(inside.sum()) * math.log(2.0 * math.pi)
    for k in np.flatnonzero(~inside):
        width = math.sqrt(0.5 * math.pi / max(float(curve[k, k]), 1e-300))
        cost += math.log(span[k] / min(width, 1.0 / max(abs(float(slope[k])), 1e-300), span[k]))
    return max(cost, 0.0)


def inside_of(x: Signal, bounds: Bounds) -> NDArray[np.bool_]:
    """Whether fields lie at none of their bounds, inner or outer, (k,)."""
    eps = 1e-9 * (bounds.inner_high - bounds.inner_low)
    ends = (bounds.low, bounds.high, bounds.inner_low, bounds.inner_high)
    return np.asarray(np.all([np.abs(x - end) > eps for end in ends], axis=0))


def screen(linear: Linear, scale: float, begin: Names) -> list[Names]:
    """Sets in the order of their closed-form evidence: grown, pruned and swapped one cause at a time from one set."""
    known: dict[Names, float] = {}

    def rate(names: Names) -> float:
        if names not in known:
            known[names] = _worth(linear, names, scale)
        return known[names]

    beam, best, maximum = [tuple(sorted(begin))], -math.inf, min(len(begin) + FURTHER, MAX_SUSPECTS)
    while rate(beam[0]) > best + 1e-9:
        best = rate(beam[0])
        near: set[Names] = set(beam)
        for names in beam:
            if len(names) < maximum:
                near |= {tuple(sorted((*names, name))) for name in linear.place if name not in names}
            near |= {tuple(n for n in names if n != gone) for gone in names}
        beam = sorted(near, key=rate, reverse=True)[:BEAM]
    return sorted(known, key=rate, reverse=True)


class Found(msgspec.Struct, frozen=True):
    """What a search found: the best fit, the one without any cause, every refit by its set, the expansion about the best."""

    best: Fit
    null: Fit
    fits: dict[Names, Fit]
    linear: Linear
    scale: float


def search(data: Fitted, suspects: Suspects, on_progress: Callable[[str], None] = lambda _: None) -> Found:
    """Find the set of suspects with the most evidence.

    Parameters
    ----------
    on_progress : called with a sentence on each step
    """
    rig_alone = RigProblem(data, suspects, ())
    null = fit_set(rig_alone, quick=True)
    if scale_of(null) < HOPELESS:
        null = fit_set(rig_alone, null)
    best, scale = null, scale_of(null)
    fits: dict[Names, Fit] = {(): null}
    nothing = np.zeros_like(null.nu)
    as_given = msgspec.structs.replace(null, nu=nothing, z=data.residual(nothing, []), j_nu=None, columns={})
    for name, begin in _usual_starts(data, suspects, as_given):
        _refit(data, suspects, fits, (name,), begin, quick=False)
    linear, start = _first_expansion(data, suspects, null, as_given)
    visited: dict[Names, Linear] = {(): linear}
    for _ in range(ROUNDS):
        on_progress(f"{len(fits)} sets fitted, best so far: {', '.join(best.names) or 'none'}")
        promising = _promising(linear, scale, best.names)
        for names in promising:
            _refit(data, suspects, fits, names, start)
        top, scale = _top(fits)
        if top.names in visited:  # before the search ends: a quick fit may have stopped short of its minimum
            for names in promising:
                if not fits[names].settled or linear.evidence(names, scale) - fits[names].evidence(scale) > DOUBTFUL:
                    _refit(data, suspects, fits, names, fits[names], quick=False)
            top, scale = _top(fits)
        if top.names in visited or (len(best.names) >= MANY and scale_of(best) > HOPELESS):
            break
        linear, start = linearise(data, suspects, top)
        fits[top.names] = best = start
        visited[top.names] = linear
    best = max((fits[names] for names in visited), key=lambda fit: fit.evidence(scale) - CLEARLY * len(fit.names))
    best, linear = _smallest(data, suspects, fits, best, visited[best.names], scale)
    return Found(best, null, fits, linear, scale)


def _first_expansion(data: Fitted, suspects: Suspects, null: Fit, as_given: Fit) -> tuple[Linear, Fit]:
    """The expansion about the fit without causes if no set is worth more there, else about the model of the rig file.

    Where the rig cannot do without causes, tolerances moved in place of these, and the fit may be far from the right one.
    """
    scale = scale_of(null)
    if scale < HOPELESS:
        linear, start = linearise(data, suspects, null)
        if screen(linear, scale, ())[0] == ():
            return linear, start
    return linearise(data, suspects, as_given)


def _top(fits: Mapping[Names, Fit]) -> tuple[Fit, float]:
    """The fit with the most evidence, each cause paid for, and the scale of the best residuals."""
    scale = min(scale_of(fit) for fit in fits.values())
    return max(fits.values(), key=lambda fit: fit.evidence(scale) - CLEARLY * len(fit.names)), scale


def _usual_starts(data: Fitted, suspects: Suspects, as_given: Fit) -> list[tuple[str, Fit]]:
    """Wrong entries at the usual multiples that lower the objective most: far from the rig file no expansion holds.

    Parameters
    ----------
    as_given : the model of the rig file
    """
    if scale_of(as_given) < HOPELESS:
        return []
    limit, nu = MUCH_LOWER * as_given.loss, as_given.nu
    tried = [
        (huber(data.residual(nu, [effect])), name, value)
        for name, value, effect in usual_values(suspects)
        if _loss_of_one(data, nu, effect) < limit
    ]
    lower = sorted(one for one in tried if one[0] < limit)[:REFITTED]
    return [
        (name, msgspec.structs.replace(as_given, names=(name,), place={name: slice(0, 1)}, x=np.array([value])))
        for _, name, value in lower
    ]


def _loss_of_one(data: Fitted, nu: Signal, effect: ActiveEffect) -> float:
    """Robust loss of the log with the lowest load, which all effects of the rig move: the least that the whole loss can be."""
    lowest = min((log.load, k) for k, log in enumerate(data.logs) if k not in data.withheld)[1]
    residual = data.measured[data.rows[lowest]] - data.predict(nu, [effect], [lowest])
    return huber(data.whiten(residual, lowest))


def _smallest(
    data: Fitted, suspects: Suspects, fits: dict[Names, Fit], best: Fit, linear: Linear, scale: float
) -> tuple[Fit, Linear]:
    """The smallest set that is not clearly worse: causes whose loss costs little evidence are left out, one by one."""
    while best.names:
        whole = fit_set(RigProblem(data, suspects, best.names), best)
        fits[best.names] = best = msgspec.structs.replace(whole, columns={**best.columns, **whole.columns})
        fewer = [tuple(n for n in best.names if n != gone) for gone in best.names]
        known = linear.evidence(best.names, scale)
        near = [names for names in fewer if known - linear.evidence(names, scale) <= 3.0 * CLEARLY]
        for names in near:
            _refit(data, suspects, fits, names, best)
            if not fits[names].settled and best.evidence(scale) - fits[names].evidence(scale) >= CLEARLY:
                _refit(data, suspects, fits, names, fits[names], quick=False)
        smaller = max(near, key=lambda names: fits[names].evidence(scale), default=None)
        if smaller is None or best.evidence(scale) - fits[smaller].evidence(scale) >= CLEARLY:
            break
        linear, best = linearise(data, suspects, fits[smaller])
    return best, linear


def _refit(
    data: Fitted, suspects: Suspects, fits: dict[Names, Fit], names: Names, start: Fit, *, quick: bool = True
) -> None:
    """Fit a set, and keep the fit unless there is a better one; without its columns, most of its memory."""
    fit = fit_set(RigProblem(data, suspects, names), start, quick=quick)
    if names not in fits or fit.loss <= fits[names].loss:
        fits[names] = msgspec.structs.replace(fit, j_nu=None, columns={})


def _promising(linear: Linear, scale: float, about: Names) -> list[Names]:
    """Sets for which the closed form has more evidence than for the set that it is expanded about, or about as much."""
    minimum = _worth(linear, about, scale) - DOUBTFUL
    ranked = screen(linear, scale, about)[: 3 * REFITTED]
    return [names for names in ranked if names != about and _worth(linear, names, scale) > minimum][:REFITTED]


def _worth(linear: Linear, names: Names, scale: float) -> float:
    """Closed-form evidence by which sets of any size compare: each further cause must be clearly worth it."""
    return linear.evidence(names, scale) - CLEARLY * len(names)
