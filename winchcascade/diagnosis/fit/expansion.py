"""The objective about a fit as a quadratic in the fields of every suspect: what each set near to it
is worth, in closed form.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.evidence import Evidence, Fit, minimum_within, prior_of
from winchcascade.diagnosis.fit.fit_set import begun, columns_of, fit_set, located
from winchcascade.diagnosis.fit.marginal import Marginal, Problem, weights
from winchcascade.diagnosis.fit.suspects import Freedom, freedom, places_of
from winchcascade.diagnosis.verdict_limits import CLEARLY, REACH

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.rig.effects.effect import ActiveEffect


ROUGH = 0.02
"""Share of its gain to which a set is fitted that only leads on. [1]"""


PAIRED = 12
"""Number of the suspects with the most closed-form evidence that are tried with another one beside
them."""


def marginal_about(problem: Problem, effects: Sequence[ActiveEffect], nu: Signal) -> Marginal:
    """The nuisances of a problem integrated out about some effects and nuisances, these within
    `REACH`.
    """
    place = np.clip(nu, -REACH, REACH)
    return Marginal(place, problem.nuisance_columns(effects, place))


def start_of(fit: Fit) -> dict[str, Signal]:
    """Fields of a fit by suspect, for another fit to begin from."""
    return {name: fit.x[own] for name, own in fit.place.items()}


class Expansion(msgspec.Struct, frozen=True):
    """The objective about a fit as a quadratic in the fields of every suspect, nuisances integrated
    out.

    `columns` (n, K) are the derivative of the residuals, `curve` (K + m, K + m) and `slope` (K +
    m,) those of the objective without the prior over the K fields and over what m acting suspects
    do as a whole: without one, the last numbers are 1. `value` (K,) are the fields there; those of
    a suspect are at its `place`.
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

    def over(self, names: Names) -> Signal:
        """Derivative of the residuals over the fields of some suspects, (n, k)."""
        return self.columns[:, self.index(names)]

    def rated(self, sets: Iterable[Names]) -> dict[Names, float]:
        """Closed-form evidence for some sets, up to a constant."""
        by_size: dict[int, list[Names]] = {}
        for names in sets:
            by_size.setdefault(len(self.index(names)), []).append(names)
        return {
            names: found
            for alike in by_size.values()
            for names, found in zip(alike, self._rated(alike).tolist(), strict=True)
        }

    def _rated(self, sets: Sequence[Names]) -> Signal:
        """Closed-form evidence for each of some sets of equally many fields, (m,)."""
        own = np.array([self.index(names) for names in sets], dtype=np.intp)
        gone = np.array([[name not in names for name in self.acting] for names in sets], dtype=bool)
        scale, free, row = self.evidence.scale, self.free.some(own), np.arange(len(sets))[:, None]
        step, x = np.zeros((len(sets), self.slope.size)), np.tile(self.value, (len(sets), 1))
        step[:, self.value.size : self.value.size + len(self.acting)] = gone
        for name, without in zip(self.acting, gone.T, strict=True):
            x[without, self.place[name]] = self.free.absent[self.place[name]]
        sd, inside = free.sd, self.curve[own[:, :, None], own[:, None, :]]
        slope = (self.slope - step @ self.curve)[row, own] / scale
        slope -= (x[row, own] - free.absent) / sd**2
        prior = sd[:, :, None] ** -2.0 * np.eye(own.shape[1])
        bounds = free.minimum - x[row, own], free.maximum - x[row, own]
        step[row, own] = minimum_within(inside / scale + prior, slope, *bounds)
        x[row, own] += step[row, own]
        curved = step @ self.curve
        objective = np.sum(0.5 * curved * step - self.slope * step, axis=1) / scale
        left = (self.slope - curved)[row, own]
        objective += prior_of(x, self.free)
        return self.evidence.weighed(sets, x[row, own], free, inside, left, objective)

    def refitted(self, marginal: Marginal, names: Names, best: Fit) -> Fit:
        """The fit of another set, begun from the fit that this is expanded about."""
        start, columns = start_of(best), self.over(names)
        return fit_set(self.evidence.problem, marginal, names, start, columns, rough=ROUGH)

    def worth(self, sets: Iterable[Names]) -> dict[Names, float]:
        """Closed-form evidence by which sets of any size compare."""
        return {names: rated - CLEARLY * len(names) for names, rated in self.rated(sets).items()}


def begun_at(
    problem: Problem, marginal: Marginal, names: Names, start: Mapping[str, Signal]
) -> tuple[Fit, Fit]:
    """Where the fit of a set begins, and the fit from there.

    Parameters
    ----------
    start : fields to begin from by suspect
    """
    begin = located(problem, marginal, names, begun(problem.suspects, names, start))
    columns = columns_of(problem, marginal, begin, names)
    return begin, fit_set(problem, marginal, names, start, columns)


def expand(
    problem: Problem, marginal: Marginal, names: Names, start: Mapping[str, Signal], scale: float
) -> tuple[Fit, Expansion]:
    """Fit a set, and expand the objective about it, with the parameters of `begun_at` and
    `expanded`.
    """
    begin, fit = begun_at(problem, marginal, names, start)
    return fit, expanded(problem, marginal, begin, fit, scale)


def expanded(problem: Problem, marginal: Marginal, begin: Fit, fit: Fit, scale: float) -> Expansion:
    """The objective about a fit, expanded in the fields of every suspect.

    Parameters
    ----------
    begin : place near the fit at which the derivatives are taken
    scale : square by which the noise exceeds its estimate
    """
    suspects, effects, names = problem.suspects, tuple(problem.suspects), fit.names
    place, free = places_of(suspects, effects), freedom(*suspects.values())
    columns = columns_of(problem, marginal, begin, effects)
    own = [k for name in names for k in range(free.absent.size)[place[name]]]
    value = free.absent.copy()
    value[own] = fit.x
    acting = fit.acting(suspects)
    without = [[one for other, one in acting.items() if other != name] for name in names]
    removed = np.zeros((fit.r.size, 0))
    if names:
        removed = marginal(
            marginal.centred(problem.residuals(without, marginal.place)) - fit.given[:, None]
        )
    both = np.hstack([columns, removed])
    weighted = both * weights(fit.r)[:, None]
    curve, slope = weighted.T @ both, -weighted.T @ fit.r
    return Expansion(Evidence(problem, scale), columns, curve, slope, value, free, place, names)


def neighbours(expansion: Expansion, names: Names) -> dict[Names, float]:
    """Sets near to one with their closed-form worth, best first: pruned, one cause swapped, grown
    by one or two causes, or by as many as are worth it.
    """
    others = [name for name in expansion.place if name not in names]
    pruned = [_without(names, gone) for gone in names]
    swapped = [_with(kept, name) for kept in pruned for name in others]
    grown = [_with(names, name) for name in others]
    worth = expansion.worth({names, *pruned, *swapped, *grown})
    first = sorted(grown, key=worth.__getitem__, reverse=True)[:PAIRED]
    twice = {_with(one, name) for one in first for name in others if name not in one}
    worth |= expansion.worth(twice)
    if twice:
        worth |= _grown_further(expansion, max(sorted(twice), key=worth.__getitem__), worth)
    return dict(sorted(sorted(worth.items()), key=lambda one: one[1], reverse=True))


def _grown_further(
    expansion: Expansion, names: Names, worth: Mapping[Names, float]
) -> dict[Names, float]:
    """Sets that grow from one by the best further cause in turn, as long as it is worth it, with
    their worth.
    """
    found, least = {}, worth[names]
    while further := expansion.worth(
        _with(names, name) for name in expansion.place if name not in names
    ):
        names = max(further, key=further.__getitem__)
        if further[names] <= least:
            break
        found[names] = least = further[names]
    return found


def _with(names: Names, name: str) -> Names:
    return tuple(sorted((*names, name)))


def _without(names: Names, gone: str) -> Names:
    return tuple(name for name in names if name != gone)


class Centre(msgspec.Struct, frozen=True):
    """A fit about which the objective is expanded, and the nuisances are integrated out."""

    fit: Fit
    expansion: Expansion
    marginal: Marginal

    def moved_to(self, fit: Fit, evidence: Evidence) -> Expansion:
        """From where nothing acts to about a single suspect: with the derivatives from here,
        which is rough but at no cost.
        """
        here = self.expansion
        fit = located(evidence.problem, self.marginal, fit.names, fit.x)
        value = here.free.absent.copy()
        value[here.index(fit.names)] = fit.x
        both = np.column_stack([here.columns, self.fit.r - fit.r])
        weighted = both * weights(fit.r)[:, None]
        curve, slope = weighted.T @ both, -weighted.T @ fit.r
        return Expansion(
            evidence, here.columns, curve, slope, value, here.free, here.place, fit.names
        )
