"""The search for the smallest set of effects that explains a problem: sets are screened in
closed form and then refitted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.evidence import Evidence, Fit
from winchcascade.diagnosis.fit.expansion import (
    Centre,
    Expansion,
    begun_at,
    expand,
    expanded,
    marginal_about,
    neighbours,
    start_of,
)
from winchcascade.diagnosis.fit.fit_set import WORTHWHILE, columns_of, fit_set
from winchcascade.diagnosis.fit.marginal import Marginal, Problem, huber
from winchcascade.diagnosis.fit.nearby import SERVES
from winchcascade.diagnosis.fit.suspects import with_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names


DOUBTFUL = 5.0
"""Error of the closed form, in evidence, that is expected."""


REFITTED = 3
"""Number of the sets with the most closed-form evidence that are refitted in each round."""


MANY, HOPELESS = 5, 2.0
"""Number of causes, and residual mean square in squares of the noise, with which the search
ends: more causes do not help.
"""


MUCH_LOWER = 0.7
"""Share of the objective that a suspect may leave far from its absence for a fit to begin there.
[1]
"""


FAR = 12.0
"""Evidence by which a set is so far behind the best that its fit may stay rough: e^-12 of its
probability.
"""

BEHIND = 0.05
"""Share of the evidence that a set lacks to the best one, beyond `2 FAR`, to which its fit may stay
rough: it is never the best, and what it leaves of the gap changes by less than this share. [1]
"""

NEAR_ZERO = 2.0
"""Magnitude of the nuisances, in their tolerances, up to which residuals are linear in them
about 0. [1]
"""

ANEW = 4
"""Number of times that the objective is expanded about one set at most: each takes the nuisances
most of the way. [1]"""

SINGLES = 3
"""Number of the single suspects with the most evidence from which the search starts too."""


NEARLY = 0.2
"""Share of the evidence that a set lacks to the best one that the closed form about it may be wrong
by: it weighs residuals as they are there, and so foresees too little where they are large. [1]"""


class Found(msgspec.Struct, frozen=True):
    """What a search found: the best fit, the newest fit of each set, and the expansion about the
    best.

    `centres` are all fits that were expanded about, by their sets. No set of `rejected`, and none
    with one of the `imitators`, is the best, whatever its evidence. `tried` are sets with the best
    set from which they were fitted again.
    """

    best: Fit
    fits: dict[Names, Fit]
    expansion: Expansion
    marginal: Marginal
    centres: dict[Names, Centre] = {}
    rejected: frozenset[Names] = frozenset()
    imitators: frozenset[str] = frozenset()
    tried: set[tuple[Names, Names]] = set()

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

    @property
    def top(self) -> Fit:
        """The fit that is worth the most of those that may be the best."""
        return max(self.sets().values(), key=weighing(self).worth)

    def columns(self, fit: Fit) -> Signal:
        """Derivative of the residuals over the fields of a fit, (n, k), taken anew for one that is
        not the best.
        """
        if fit is self.best:
            return self.expansion.over(fit.names)
        return columns_of(self.problem, self.marginal, fit, fit.names, SERVES)

    def fit(self, names: Names, start: Mapping[str, Signal] | None = None) -> Fit:
        """The fit of a set, begun from the best one where the search made none, or one that is
        worse than foreseen there; from fields of some suspects where these are named.
        """
        ordered = tuple(sorted(names))
        known, way = self.fits.get(ordered), (self.best.names, ordered)
        if known is None or (way not in self.tried and (start or self._foresees_more(known))):
            self.tried.add(way)
            columns = None if start else self.expansion.over(ordered)
            begin = start_of(self.best) | dict(start or {})
            settled = max(BEHIND * (self._lacks(ordered) - 2.0 * FAR) * self.scale, WORTHWHILE)
            made = fit_set(self.problem, self.marginal, ordered, begin, columns, settled)
            if known is None or _is_more(self.evidence, made, known):
                self.fits[ordered] = made
        return self.fits[ordered]

    def without(self, name: str) -> Fit:
        """The fit of the best set without one cause."""
        return self.fit(tuple(n for n in self.best.names if n != name))

    def _lacks(self, names: Names) -> float:
        """Evidence that a set lacks to the best one, as the expansion about this foresees it."""
        rated = self.expansion.rated([names, self.best.names])
        return rated[self.best.names] - rated[names]

    def _foresees_more(self, known: Fit) -> bool:
        """Whether the expansion about the best foresees clearly more of a set than its fit has."""
        lacked = self.evidence.of(self.best) - self.evidence.of(known)
        return self._lacks(known.names) < lacked - DOUBTFUL

    def allowed(self, names: Names) -> bool:
        """Whether a set may be the best."""
        together = any(
            all(group.intersection(names) for group in groups) for groups in self.problem.exclusive
        )
        return not together and names not in self.rejected and self.imitators.isdisjoint(names)

    def sets(self) -> dict[Names, Fit]:
        """The fits of all sets that may be the best."""
        return {names: fit for names, fit in self.fits.items() if self.allowed(names)}

    def singles(self) -> list[Fit]:
        """Fits of the single suspects with the most evidence, best first."""
        found = [fit for names, fit in self.fits.items() if len(names) == 1]
        return sorted(found, key=weighing(self).of, reverse=True)[:SINGLES]

    def about(self, fit: Fit) -> Centre:
        """The expansion of the objective about a fit, which replaces older fits of its set; made
        anew, `ANEW` times at most, as long as the nuisances move by more than `NEAR_ZERO`.
        """
        problem = self.problem
        for _ in range(ANEW):
            marginal = marginal_about(problem, fit.effects(problem.suspects), fit.nu)
            begin, there = begun_at(problem, marginal, fit.names, start_of(fit))
            if np.max(np.abs(there.nu - fit.nu), initial=0.0) <= NEAR_ZERO:
                break
            fit = there
        expansion = expanded(problem, marginal, begin, there, weighing(self).scale)
        self.fits[fit.names] = there
        self.centres[fit.names] = Centre(there, expansion, marginal)
        return self.centres[fit.names]

    def led_by(self, names: Names) -> Found:
        """The same with another set as its best, about which the objective was expanded."""
        centre = self.centres[names]
        expansion = msgspec.structs.replace(centre.expansion, evidence=weighing(self))
        return msgspec.structs.replace(
            self, best=centre.fit, expansion=expansion, marginal=centre.marginal
        )


def opened(problem: Problem, on_progress: Callable[[str], None] = lambda _: None) -> Found:
    """A search at its start: expanded where no suspect acts, with fits of the most promising sets
    near to that.

    Parameters
    ----------
    on_progress : called with a sentence on each step
    """
    marginal = marginal_about(problem, [], np.zeros(problem.nuisances))
    given = fit_set(problem, marginal, ())
    if np.max(np.abs(given.nu), initial=0.0) > NEAR_ZERO:
        marginal = marginal_about(problem, [], given.nu)
    found = _at_none(problem, marginal)
    _fit_near(found, found.centres[()], on_progress)
    return found


def _at_none(problem: Problem, marginal: Marginal) -> Found:
    """A search that knows nothing but where no suspect acts."""
    null, expansion = expand(problem, marginal, (), {}, 1.0)
    return Found(null, {(): null}, expansion, marginal, {(): Centre(null, expansion, marginal)})


def search(
    problem: Problem,
    on_progress: Callable[[str], None] = lambda _: None,
    before: Found | None = None,
) -> Found:
    """Find the set of suspects with the most evidence.

    Paths of sets lead from none, and from the single suspects with the most evidence, to the best
    one.

    Parameters
    ----------
    on_progress : called with a sentence on each step
    before : a search to go on from, of this problem or of one with another noise: of that, the best
        set is the first one here
    """
    found = before = before or opened(problem, on_progress)
    if before.problem != problem:
        place = before.centres[()].marginal.place
        found = _at_none(problem, marginal_about(problem, [], place))
    _go(found, found.centres.get(before.top.names) or found.about(before.top), on_progress)
    found = gone_on(found, on_progress)
    for fit in _single_starts(found):
        if fit.names not in found.centres:
            _go(found, found.about(fit), on_progress)
    return _settled(gone_on(found, on_progress), on_progress)


def _settled(found: Found, on_progress: Callable[[str], None]) -> Found:
    """A search at its end, with an exact fit of each set that may be nearly as good as the best."""
    evidence = weighing(found)
    least = evidence.of(found.best) - FAR
    for names, fit in found.sets().items():
        if fit.open > WORTHWHILE and evidence.of(fit) + fit.open > least:
            columns = found.expansion.over(names)
            found.fits[names] = fit_set(
                found.problem, found.marginal, names, start_of(fit), columns
            )
    return gone_on(found, on_progress)


def gone_on(found: Found, on_progress: Callable[[str], None] = lambda _: None) -> Found:
    """A search led by its best set, and gone on from each set with more evidence that was fitted
    and not yet expanded about.
    """
    while (top := found.top).names not in found.centres:
        if _is_hopeless(top):
            break
        _go(found, found.about(top), on_progress)
    expanded = (fit for names, fit in found.sets().items() if names in found.centres)
    return found.led_by(max(expanded, key=weighing(found).worth).names)


def _go(found: Found, last: Centre, on_progress: Callable[[str], None]) -> None:
    """Go from a set to the best one near it, and on from this, as long as it was not there; the
    nuisances are expanded anew about each.
    """
    while not _is_hopeless(last.fit):
        top = _fit_near(found, last, on_progress)
        if top.names in found.centres:
            return
        last = found.about(top)


def _fit_near(found: Found, last: Centre, on_progress: Callable[[str], None]) -> Fit:
    """Refit the most promising of the sets near to one, as they are screened in closed form; the
    fit that is worth the most of these and of that.
    """
    problem, fits = found.problem, found.fits
    evidence = weighing(found)
    best = max(fits.values(), key=evidence.worth)
    on_progress(
        f"{len(found.centres)} sets expanded, best so far: {', '.join(best.names) or 'none'}"
    )
    expansion = msgspec.structs.replace(last.expansion, evidence=evidence)
    near = {
        names: expansion.refitted(last.marginal, names, last.fit)
        for names in _promising(found, expansion)
    }
    if near and not last.fit.names:
        far = {one.names: one for one in _far_starts(problem, last.marginal)}
        near |= {
            names: one
            for names, one in far.items()
            if names not in near or one.loss < near[names].loss
        }
    evidence = _weighing(problem, [*fits.values(), *near.values()])
    fits |= {
        names: one
        for names, one in near.items()
        if names not in fits or _is_more(evidence, one, fits[names])
    }
    return max((last.fit, *(fits[names] for names in near)), key=evidence.worth)


def _is_more(evidence: Evidence, fit: Fit, other: Fit) -> bool:
    """Whether a fit has more evidence than another of the same set."""
    return evidence.of(fit) > evidence.of(other)


def _is_hopeless(fit: Fit) -> bool:
    """Whether a fit has many causes and leaves much: more causes do not help."""
    return len(fit.names) > MANY and fit.scale > HOPELESS


def _promising(found: Found, expansion: Expansion) -> list[Names]:
    """Sets near to that of an expansion that are to be fitted: they may be as good as the best, and
    no fit shows it yet.

    The expansion must foresee of them about as much as of the best set, too: it errs alike in both.
    """
    evidence, here = expansion.evidence, expansion.acting
    worth = {names: evidence.worth(fit) for names, fit in found.sets().items()}
    level, best = evidence.worth(found.fits[here]), max(worth.values())
    least = best - max(NEARLY * (best - level), DOUBTFUL)
    top, near = max(worth, key=worth.__getitem__), neighbours(expansion, here)
    known = expansion.worth([top])[top]
    chosen: list[Names] = []
    for names, there in near.items():
        foreseen = level + there - near[here]
        if len(chosen) == REFITTED or foreseen <= least:
            break
        unknown = foreseen > worth.get(names, -math.inf) + DOUBTFUL and names not in found.centres
        if unknown and there > known - DOUBTFUL and found.allowed(names):
            chosen.append(names)
    return chosen


def _single_starts(found: Found) -> list[Fit]:
    """Fits of the best single suspects that were not expanded about, near which the closed form
    foresees a better set.
    """
    null, evidence = found.centres[()], weighing(found)
    expansion = msgspec.structs.replace(null.expansion, evidence=evidence)
    rated = expansion.rated((name,) for name in found.problem.suspects)
    for one in sorted(rated, key=rated.__getitem__, reverse=True)[:SINGLES]:
        if one not in found.fits:
            found.fits[one] = expansion.refitted(null.marginal, one, null.fit)
    others = [fit for fit in found.singles() if fit.names not in found.centres]
    return [fit for fit in others if _promising(found, null.moved_to(fit, evidence))]


def weighing(found: Found) -> Evidence:
    """What weighs the fits of a search."""
    return _weighing(found.problem, found.fits.values())


def _weighing(problem: Problem, fits: Iterable[Fit]) -> Evidence:
    """What weighs some fits: the best residuals among them tell by how much the noise exceeds
    its estimate.
    """
    return Evidence(problem, min(fit.scale for fit in fits))


def _far_starts(problem: Problem, marginal: Marginal) -> list[Fit]:
    """Fits of single suspects that begin where the objective is lowest of the places that the
    problem names: far from where a suspect is absent no expansion holds.
    """
    begins = [
        (name, np.array([value])) for name, values in problem.begins.items() for value in values
    ]
    effects = [[], *([with_values(problem.suspects[name], x)] for name, x in begins)]
    given, *losses = (
        huber(marginal(marginal.centred(z))) for z in problem.residuals(effects, marginal.place).T
    )
    lower = [k for k in np.argsort(losses).tolist()[:REFITTED] if losses[k] < MUCH_LOWER * given]
    return [fit_set(problem, marginal, (begins[k][0],), dict([begins[k]])) for k in lower]
