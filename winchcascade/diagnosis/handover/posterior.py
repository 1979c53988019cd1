"""The rig as a diagnosis leaves it: its corrected numbers and what is not known of them, without
the errors of its sensors.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.covariance import predictive_covariance
from winchcascade.diagnosis.fit.misfit import log_of
from winchcascade.diagnosis.fit.nuisances import LOAD
from winchcascade.diagnosis.fit.suspects import freedom, with_values
from winchcascade.diagnosis.judge.causes import look_alikes_of
from winchcascade.diagnosis.verdict_limits import LAW
from winchcascade.rig.effects.effect import ActiveEffect, Parameter
from winchcascade.rig.parts import PARTS, Model, possible

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.fit.evidence import Fit

OF_THE_RIG = ("rig", "law")
"""Kinds of nuisances that are numbers of the rig; the others concern sensors, single loads or
the comparison.
"""

IDLE = 1e-9
"""A direction of the posterior whose variance is below this share of the largest, in squares of
the tolerances, is known.
"""


class Band(msgspec.Struct, frozen=True):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


class RigPosterior(msgspec.Struct, frozen=True):
    """A corrected rig with the joint uncertainty of its numbers.

    `nominal` is the model of the rig file without errors of its sensors. It is changed by `numbers`
    of the rig, each by its value of `moves` in its own unit, and then by `effects`. `covariance` (n
    + k, n + k) is that of the moves and then of all fields of the effects. An effect that changes
    from run to run acts as in the run that shows it most.

    `others` are the rig as the best fits with look-alikes in place of its causes leave it; the
    `weight` of each of these and of the rig itself is its posterior probability among them.
    """

    nominal: Model
    numbers: tuple[Parameter, ...]
    moves: tuple[float, ...]
    effects: tuple[ActiveEffect, ...]
    covariance: Signal
    weight: float = 1.0
    others: tuple[RigPosterior, ...] = ()

    @property
    def members(self) -> tuple[RigPosterior, ...]:
        """The rig by the best fit and by those with look-alikes."""
        return self, *self.others

    @property
    def best(self) -> Signal:
        """Moves of the numbers, then fields of the effects, (n + k,)."""
        return np.array(
            [*self.moves, *(value for effect in self.effects for value in effect.values)]
        )

    def model(self, at: Signal | None = None, without: str = "") -> Model:
        """The corrected rig.

        Parameters
        ----------
        at : (n + k,) other moves and fields than the best ones
        without : name of an effect that is repaired
        """
        values, model = (self.best if at is None else at).tolist(), self.nominal
        place = len(self.numbers)
        for number, move in zip(self.numbers, values[:place], strict=True):
            model = number.apply(model, move)
        for effect in self.effects:
            own = np.array(values[place : place + len(effect.values)])
            place += own.size
            if effect.effect.name != without:
                free = freedom(effect.effect)
                model = with_values(effect.effect, np.clip(own, free.minimum, free.maximum)).apply(
                    model
                )
        return possible(model)

    def directions(self) -> Signal:
        """Moves and fields one standard deviation away along independent directions, (r, n + k),
        the least known first.
        """
        scale = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        known = np.where(scale > 0.0, scale, 1.0)
        variance, ways = np.linalg.eigh(self.covariance / np.outer(known, known))
        keep = np.flatnonzero(variance > IDLE * variance[-1])[::-1]
        return np.asarray((ways[:, keep] * np.sqrt(variance[keep])).T * known)

    def models(self, without: str = "") -> list[Model]:
        """The corrected rig, then the same moved along each of `directions`."""
        return [
            self.model(self.best, without),
            *(self.model(self.best + way, without) for way in self.directions()),
        ]

    def draws(self, count: int, seed: int) -> list[tuple[Model, Model]]:
        """Corrected rigs drawn from the posterior: of its `members` by their weights and of their
        numbers and fields, each for what the logs cover and for what they do not.

        What an effect does in the logs is known as the posterior has it. Beyond these logs it is
        drawn, too, how much it does by its law.
        """
        rng, members = np.random.default_rng(seed), self.members
        ends = np.cumsum([one.weight for one in members])
        places = np.searchsorted(ends, (np.arange(count) + rng.uniform()) / count * ends[-1])
        return [
            members[min(place, len(members) - 1)].draw(rng) for place in rng.permutation(places)
        ]

    def draw(self, rng: np.random.Generator) -> tuple[Model, Model]:
        """A rig drawn from this member of the posterior alone, as `draws` gives it."""
        ways = self.directions()
        at = self.best + rng.standard_normal(len(ways)) @ ways
        drawn = found = self.model(at)
        for one in self.effects:
            if one.effect.entry is None:
                found = stretched(
                    found,
                    (self.model(at, one.effect.name), drawn),
                    max(LAW, one.effect.law_u) * rng.standard_normal(),
                )
        return drawn, possible(found)


def stretched(model: Model, change: tuple[Model, Model], share: float) -> Model:
    """A model whose numbers are moved by a share of the change between two others."""
    parts = {}
    for part in PARTS:
        own, before, after = (getattr(one, part)._asdict() for one in (model, *change))
        moved = {
            name: value + share * (np.subtract(after[name], before[name]))
            for name, value in own.items()
            if after[name] != before[name]
        }
        parts[part] = getattr(model, part)._replace(
            **{name: tuple(x.tolist()) if np.ndim(x) else float(x) for name, x in moved.items()}
        )
    return msgspec.structs.replace(model, **parts)


MEMBERS = 4
"""Maximum number of fits of which a corrected rig is a mixture: each takes as long to simulate
as the best alone.
"""


def posterior_of_rig(found: ModelDiagnosis) -> RigPosterior:
    """The rig that a diagnosis leaves, by its best fit and by those with look-alikes in place of
    its causes.

    Fits in which another effect is an error of a sensor, or is none, come first, as they change the
    energies most.
    """
    best = found.found.best
    alike = {
        one.fit.names: one for several in look_alikes_of(found.found).values() for one in several
    }
    sensors = _of_sensors(found, best)
    first = sorted(
        alike.values(), key=lambda one: (_of_sensors(found, one.fit) == sensors, one.short)
    )[: MEMBERS - 1]
    odds = np.array([1.0, *(math.exp(-max(one.short, 0.0)) for one in first)])
    fits = best, *(one.fit for one in first)
    itself, *others = (
        msgspec.structs.replace(_left_by(found, fit), weight=float(weight))
        for fit, weight in zip(fits, odds / odds.sum(), strict=True)
    )
    return msgspec.structs.replace(itself, others=tuple(others))


def _of_sensors(found: ModelDiagnosis, fit: Fit) -> set[str]:
    """Effects of a fit that are errors of sensors."""
    return {name for name in fit.names if found.suspects[name].of_a_sensor}


def _left_by(found: ModelDiagnosis, fit: Fit) -> RigPosterior:
    """The rig of one fit, with every effect of it but errors of sensors and of single logs or
    loads.
    """
    data = found.data
    chosen = [j for j, n in enumerate(data.nuisances) if n.kind in OF_THE_RIG]
    kept = {
        name: effect
        for name, effect in fit.acting(found.suspects).items()
        if not effect.effect.of_a_sensor and log_of(effect) < 0 and effect.effect.path != LOAD
    }
    fields = [k for name in kept for k in range(fit.place[name].start, fit.place[name].stop)]
    places = [*(fit.x.size + j for j in chosen), *fields]
    unit = np.array([*(data.nuisances[j].sd for j in chosen), *np.ones(len(fields))])
    nominal = data.nominal
    for effect in data.stated_by_run:
        nominal = effect.apply(nominal)
    return RigPosterior(
        nominal=nominal.physics,
        numbers=tuple(data.nuisances[j] for j in chosen),
        moves=tuple(float(fit.nu[j]) * data.nuisances[j].sd for j in chosen),
        effects=tuple(kept.values()),
        covariance=predictive_covariance(data, found.found, fit)[np.ix_(places, places)]
        * np.outer(unit, unit),
    )
