"""How sure each cause is, what its numbers are, and which suspects explain the same data as well."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnose.fit import Fit, fit_set
from winchcascade.diagnose.rank import Found, Names, evidence_of
from winchcascade.diagnose.suspects import Suspects, with_values
from winchcascade.fit.blocks import PHASES
from winchcascade.fit.predict import CHANNELS

if TYPE_CHECKING:
    from winchcascade.fit.campaign import Fitted
    from winchcascade.run import Signal

AS_GOOD = 3.0
"""A set is a rival while its evidence falls short of the best by less than this: odds of twenty to one."""

TRIED = 3
"""So many rivals of each cause are refitted at most."""

RIVALS = 2
"""So many rivals of each cause are named at most."""

COVERED = 1.96
"""Standard deviations on either side of a 95 % interval."""


class Reported(msgspec.Struct, frozen=True):
    """A number that a diagnosis reports, with its 95 % interval, which includes the tolerance of what the effect changes."""

    value: float
    low: float
    high: float
    unit: str


class Rival(msgspec.Struct, frozen=True):
    """A suspect that explains the same data as well in place of a cause, and what would tell the two apart."""

    effect: str
    probability: float
    told_apart_by: str


class Cause(msgspec.Struct, frozen=True):
    """An effect that is needed: its probability, its numbers, its rivals, and how much of the objective it carries."""

    effect: str
    stage: str
    probability: float
    parameters: dict[str, Reported]
    rivals: tuple[Rival, ...]
    weight: float


def causes_of(data: Fitted, suspects: Suspects, found: Found) -> tuple[Cause, ...]:
    """Every cause of the best set, most important first."""
    best = found.best
    swapped = {name: _rivals(data, suspects, found, name) for name in best.names}
    everything = {**found.fits, **{fit.names: fit for fits in swapped.values() for fit in fits}}
    chance = probabilities(everything, found.scale)
    causes = []
    for name in best.names:
        without = tuple(n for n in best.names if n != name)
        weight = found.linear.best(without)[0] - found.linear.best(best.names)[0]
        causes.append(
            Cause(
                effect=name,
                stage=suspects[name].stage,
                probability=sum(p for names, p in chance.items() if name in names),
                parameters=parameters_of(suspects, best, name, found.scale),
                rivals=tuple(_named(data, best, fit, chance) for fit in swapped[name])[:RIVALS],
                weight=weight,
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def probabilities(fits: dict[Names, Fit], scale: float) -> dict[Names, float]:
    """Posterior probability of each set among those that were fitted."""
    evidence = {tuple(sorted(names)): evidence_of(fit, scale) for names, fit in fits.items()}
    top = max(evidence.values())
    odds = {names: math.exp(max(e - top, -700.0)) for names, e in evidence.items()}
    total = sum(odds.values())
    return {names: p / total for names, p in odds.items()}


def parameters_of(suspects: Suspects, fit: Fit, name: str, scale: float) -> dict[str, Reported]:
    """What is reported of one cause, with 95 % intervals; fields at a bound count as known."""
    kind = suspects[name]
    place = _place(fit, name)
    values = fit.values[fit.names.index(name)]
    covariance = covariance_of(fit, scale)[place, place]
    made = with_values(kind, values).reported()
    found = {}
    for reported, value in made.items():
        gradient = np.zeros(values.size)
        for k in range(values.size):
            step = 1e-3 * float(fit.high[place][k] - fit.low[place][k])
            step = -step if values[k] + step > fit.high[place][k] else step
            moved = values.copy()
            moved[k] += step
            gradient[k] = (with_values(kind, moved).reported()[reported] - value) / step
        u = math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
        found[reported] = Reported(value, value - COVERED * u, value + COVERED * u, kind.reports[reported])
    return found


def covariance_of(fit: Fit, scale: float) -> Signal:
    """Covariance of all fields of a fit, (k, k): what its data leave, nuisances included; 0 for fields at a bound."""
    x = np.concatenate(fit.values)
    eps = 1e-9 * (fit.high - fit.low)
    inside = np.flatnonzero((x > fit.low + eps) & (x < fit.high - eps))
    covariance = np.zeros((x.size, x.size))
    if inside.size:
        covariance[np.ix_(inside, inside)] = np.linalg.pinv(fit.curve[np.ix_(inside, inside)] / scale, hermitian=True)
    return covariance


def _place(fit: Fit, name: str) -> slice:
    ends = np.cumsum([0, *(x.size for x in fit.values)])
    k = fit.names.index(name)
    return slice(int(ends[k]), int(ends[k + 1]))


def _rivals(data: Fitted, suspects: Suspects, found: Found, name: str) -> list[Fit]:
    """Refits with another suspect in place of one cause that are about as good, best first."""
    kept = tuple(n for n in found.best.names if n != name)
    best = evidence_of(found.best, found.scale)
    about = found.linear.evidence(found.best.names, found.scale)
    others = {r: found.linear.evidence((*kept, r), found.scale) for r in suspects if r not in found.best.names}
    near = sorted((r for r in others if others[r] > about - 4.0 * AS_GOOD), key=lambda r: -others[r])[:TRIED]
    fits = []
    for r in near:
        names = tuple(sorted((*kept, r)))
        fit = found.fits.get(names) or fit_set(data, suspects, names, start=found.best, quick=True)
        if evidence_of(fit, found.scale) > best - AS_GOOD:
            fits.append(fit)
    return sorted(fits, key=lambda fit: -evidence_of(fit, found.scale))


def _named(data: Fitted, best: Fit, rival: Fit, chance: dict[Names, float]) -> Rival:
    effect = next(n for n in rival.names if n not in best.names)
    return Rival(effect, chance[tuple(sorted(rival.names))], _told_apart(data, best, rival))


def _told_apart(data: Fitted, best: Fit, rival: Fit) -> str:
    """Where two fits of the same data differ most: channel, phase and load."""
    difference = (best.z - rival.z).reshape(-1, len(CHANNELS))
    most, words = 0.0, "nothing that these logs measure"
    for rows, log in zip(data.rows, data.logs, strict=True):
        for k, channel in enumerate(CHANNELS):
            for phase, phase_name in enumerate(PHASES):
                here = difference[rows, k][log.course.blocks.phase == phase]
                size = float(np.sqrt(np.sum(here**2)))
                if size > most:
                    load = "open circuit" if math.isinf(log.load) else f"{log.load:g} ohm"
                    name = phase_name.replace("_", "-")
                    most, words = size, f"{channel} during {name} at {load}, where they differ by {size:.1f} sigma"
    return words
