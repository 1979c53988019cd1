"""Which causes: the smallest sufficient set of suspects, screened in closed form and decided by refits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.evidence import Fit, all_columns, cost_of, fit_set
from winchcascade.diagnosis.solve import box_minimum, huber, quadratic, weights
from winchcascade.diagnosis.suspects import Suspects, freedom
from winchcascade.rig.effects.catalogue import EFFECTS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted

BEAM = 8
"""So many sets are grown at once."""

REFITTED = 3
"""So many of the sets that the closed form prefers are refitted in each round."""

DOUBTFUL = 5.0
"""The closed form is trusted to so much evidence."""

ROUNDS = 8
"""Rounds of screening and refitting at most."""

MOST = 9
"""No set is larger."""

CLEARLY = 5.0
"""The smaller set wins unless the larger one has so much more evidence, prices paid: very strong by Kass and Raftery (1995),
odds of a hundred and fifty to one."""

MANY, HOPELESS = 5, 2.0
"""So many causes that still leave blocks this far beyond their noise, in mean squares, will not be saved by one more."""

FURTHER = 2
"""The closed form is trusted with so many causes beyond those of the fit about which it was expanded."""

Names = tuple[str, ...]


class Linear(msgspec.Struct, frozen=True):
    """The objective about a fit as a quadratic in the fields of every suspect, nuisances done away with.

    `curve` (k, k) and `slope` (k,) are in the fields' own units; `value`, `absent`, `low` and `high` (k,) are the fields where
    it was expanded, where they are absent, and their bounds. `place` tells which fields belong to a suspect.
    """

    curve: Signal
    slope: Signal
    value: Signal
    absent: Signal
    low: Signal
    high: Signal
    place: dict[str, slice]

    def best(self, names: Names) -> tuple[float, Signal]:
        """Lowest objective of a set, against the place of expansion, and its fields, (k,)."""
        chosen = np.zeros(self.value.size, dtype=bool)
        for name in names:
            chosen[self.place[name]] = True
        step = np.where(chosen, 0.0, self.absent - self.value)
        if chosen.any():
            pull = self.slope[chosen] - self.curve[np.ix_(chosen, ~chosen)] @ step[~chosen]
            low, high = (self.low - self.value)[chosen], (self.high - self.value)[chosen]
            step[chosen] = box_minimum(self.curve[np.ix_(chosen, chosen)], pull, low, high)
        objective = 0.5 * float(step @ self.curve @ step) - float(self.slope @ step)
        return objective, self.value + step

    def evidence(self, names: Names, scale: float) -> float:
        """Logarithm of a set's evidence, up to a constant, residuals scaled by the square `scale`."""
        if not names:
            return -self.best(names)[0] / scale
        objective, x = self.best(names)
        index = np.concatenate([np.arange(self.value.size)[self.place[name]] for name in names])
        curve = self.curve[np.ix_(index, index)] / scale
        slope = (self.slope - self.curve @ (x - self.value))[index] / scale
        return -objective / scale - cost_of(curve, slope, x[index], self.low[index], self.high[index]) - price(names)


def price(names: Names) -> float:
    """Evidence that the causes must bring beyond their own freedom.

    Each is one of the catalogue, and all are as likely; also where only a few of them are suspects.
    """
    return len(names) * math.log(len(EFFECTS))


def scale_of(fit: Fit) -> float:
    """Mean square of a fit's whitened residuals, robustly, at least 1: by how much the noise exceeds what was reckoned."""
    seen = fit.z != 0.0
    return max(2.0 * huber(fit.z) / max(int(np.count_nonzero(seen)), 1), 1.0)


def linearise(data: Fitted, suspects: Suspects, about: Fit) -> tuple[Linear, Fit]:
    """Expand the objective about a fit in the fields of every suspect; and the fit with all their columns, found anew."""
    names = tuple(suspects)
    made = about.effects(suspects)
    about = msgspec.structs.replace(about, j_nu=data.nuisance_columns(about.nu, made, data.predict(about.nu, made)))
    begun = dict(zip(about.names, about.values, strict=True))
    free = {name: freedom(suspects[name]) for name in names}
    columns = all_columns(data, suspects, about.nu, begun, names)
    q = quadratic(about.z, weights(about.z), about.j_nu, np.hstack([columns[name] for name in names]), about.nu)
    ends = np.cumsum([0, *(free[name].absent.size for name in names)]).tolist()
    linear = Linear(
        curve=q.curve,
        slope=q.slope,
        value=np.concatenate([begun.get(name, free[name].absent) for name in names]),
        absent=np.concatenate([free[name].absent for name in names]),
        low=np.concatenate([free[name].low for name in names]),
        high=np.concatenate([free[name].high for name in names]),
        place={name: slice(a, b) for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)},
    )
    return linear, msgspec.structs.replace(about, columns=columns)


def screen(linear: Linear, scale: float, begin: Sequence[Names]) -> list[Names]:
    """Sets in the order of their closed-form evidence: grown, pruned and swapped one cause at a time from some sets."""
    known: dict[Names, float] = {}

    def rate(names: Names) -> float:
        if names not in known:
            known[names] = _worth(linear, names, scale)
        return known[names]

    beam = sorted({tuple(sorted(names)) for names in begin}, key=rate, reverse=True)
    best, most = -math.inf, min(max(len(names) for names in begin) + FURTHER, MOST)
    while rate(beam[0]) > best + 1e-9:
        best = rate(beam[0])
        near: set[Names] = set(beam)
        for names in beam:
            if len(names) < most:
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

    def evidence(self, names: Names) -> float:
        """Logarithm of a refitted set's evidence, up to a constant, prices paid."""
        return evidence_of(self.fits[names], self.scale)


def evidence_of(fit: Fit, scale: float) -> float:
    """Logarithm of a fit's evidence, up to a constant, residuals scaled by the square `scale`."""
    return -fit.loss / scale - fit.cost(scale) - price(fit.names)


def search(data: Fitted, suspects: Suspects, tell: Callable[[str], None] = lambda _: None) -> Found:
    """Find the set of suspects with the most evidence.

    Parameters
    ----------
    tell : is told what is being done
    """
    null = fit_set(data, suspects, (), quick=True)
    if scale_of(null) < HOPELESS:
        null = fit_set(data, suspects, (), start=null)
    best, scale = null, scale_of(null)
    fits: dict[Names, Fit] = {(): null}
    linear, start = linearise(data, suspects, _at_nominal(data, null))
    visited: dict[Names, Linear] = {(): linear}
    for _ in range(ROUNDS):
        tell(f"{len(fits)} sets fitted, best so far: {', '.join(best.names) or 'none'}")
        for names in _promising(linear, scale, [best.names], {best.names}):
            fits[names] = _better(fits.get(names), _light(fit_set(data, suspects, names, start=start, quick=True)))
        scale = min(scale_of(fit) for fit in fits.values())
        top = max(fits.values(), key=lambda fit: evidence_of(fit, scale) - CLEARLY * len(fit.names))
        if top.names in visited or (len(best.names) >= MANY and scale_of(best) > HOPELESS):
            break
        linear, start = linearise(data, suspects, top)
        fits[top.names] = best = start
        visited[top.names] = linear
    best = max((fits[names] for names in visited), key=lambda fit: evidence_of(fit, scale) - CLEARLY * len(fit.names))
    best, linear = _smallest(data, suspects, fits, best, visited[best.names], scale)
    return Found(best, null, fits, linear, scale)


def _smallest(
    data: Fitted, suspects: Suspects, fits: dict[Names, Fit], best: Fit, linear: Linear, scale: float
) -> tuple[Fit, Linear]:
    """The smallest set that is not clearly worse: causes whose loss costs little evidence are left out, one by one."""
    while best.names:
        best = _finished(data, suspects, best)
        fits[best.names] = best
        least: tuple[float, Fit] | None = None
        for gone in best.names:
            names = tuple(n for n in best.names if n != gone)
            if linear.evidence(best.names, scale) - linear.evidence(names, scale) > 3.0 * CLEARLY:
                continue
            fits[names] = _better(fits.get(names), _light(fit_set(data, suspects, names, start=best, quick=True)))
            lost = evidence_of(best, scale) - evidence_of(fits[names], scale)
            if lost < CLEARLY and (least is None or lost < least[0]):
                least = lost, fits[names]
        if least is None:
            break
        linear, best = linearise(data, suspects, least[1])
    return best, linear


def _finished(data: Fitted, suspects: Suspects, fit: Fit) -> Fit:
    """A fit carried to its end, with the columns of every suspect."""
    final = fit_set(data, suspects, fit.names, start=fit)
    return msgspec.structs.replace(final, columns={**fit.columns, **final.columns})


def _light(fit: Fit) -> Fit:
    """A fit without its columns, which are most of its memory; `linearise` finds them anew where they are wanted."""
    return msgspec.structs.replace(fit, j_nu=fit.j_nu[:0], columns={})


def _better(one: Fit | None, other: Fit) -> Fit:
    return other if one is None or other.loss < one.loss else one


def _promising(linear: Linear, scale: float, begin: Sequence[Names], known: set[Names]) -> list[Names]:
    """Sets that the closed form prefers to those that are known about this place, or holds about as good."""
    ranked = screen(linear, scale, begin)
    least = max(_worth(linear, names, scale) for names in known) - DOUBTFUL
    return [n for n in ranked[: 3 * REFITTED] if n not in known and _worth(linear, n, scale) > least][:REFITTED]


def _worth(linear: Linear, names: Names, scale: float) -> float:
    """Closed-form evidence by which sets of any size compare: each further cause must be clearly worth it."""
    return linear.evidence(names, scale) - CLEARLY * len(names)


def _at_nominal(data: Fitted, null: Fit) -> Fit:
    """The rig as given, with the columns of its nuisances: where the first expansion is made."""
    nothing = np.zeros_like(null.nu)
    return msgspec.structs.replace(null, nu=nothing, z=data.residual(nothing, []))
