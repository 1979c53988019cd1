"""What small changes move about one place of a fit, by derivatives that are each taken once.

A tolerance of the rig file and a suspect often change the same number, and a load that of one log
alone: the derivative serves all that change it. Derivatives that foresee what leads from their
place to another one serve for uncertainties there, too.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.fit.predict import without_sensors
from winchcascade.rig.parts import differences

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.predict import Course
    from winchcascade.rig.effects.effect import ActiveEffect, Values
    from winchcascade.rig.parts import Model


SERVES = 0.2
"""Share of the way from another place that its derivatives may miss to serve for uncertainties. A
fit takes its own: sets are compared by logs that are held out, which magnify what they miss. [1]
"""


ROUNDING = 1e-6
"""Share of a change, or of what cancels it, that remains by rounding: a derivative along so little
would be one of rounding alone. [1]
"""


class Slope(NamedTuple):
    """What a change of some numbers of a model, by their paths, moves in the blocks of a log, (m,
    5); the first number is what it is kept by. `missed` is the share of the way from where it was
    taken that its place does not foresee. [1]
    """

    along: dict[str, float]
    moves: Signal
    missed: float = 0.0


class Nearby:
    """A place of a fit: the model of each log, the delay of the reading of each channel, (5,) [s],
    the prediction `at` it, (M, 5) in SI units, and the derivatives of each log.
    """

    def __init__(
        self, courses: Sequence[Course], models: Sequence[Model], skew: Signal, at: Signal
    ) -> None:
        self._courses, self._models, self._skew, self.at = courses, models, skew, at
        self._sizes = [course.blocks.size for course in courses]
        self._rows = [slice(a, b) for a, b in pairwise(np.cumsum([0, *self._sizes]).tolist())]
        self._read = [self._predicted(k, model, skew) for k, model in enumerate(models)]
        true = (without_sensors(model) for model in models)
        self._true = [self._predicted(k, model, None) for k, model in enumerate(true)]
        self._slopes: list[dict[str, Slope]] = [{} for _ in courses]

    def take(self, known: Nearby, missed: float, *, inert: bool) -> None:
        """Use the derivatives of another place, which miss a share of the way from there, where
        none that is known misses less.

        Those that move nothing in a log but something in another one miss nothing: no current
        reaches a roll-off in open circuit.

        Parameters
        ----------
        inert : whether those serve, too, that move nothing in any log
        """
        moving = {n for own in known._slopes for n, one in own.items() if one.moves.any()}
        for own, there in zip(self._slopes, known._slopes, strict=True):
            for number, one in there.items():
                still = number in moving and not one.moves.any()
                least = 0.0 if still else one.missed + missed
                better = number not in own or least < own[number].missed
                if better and (inert or number in moving):
                    own[number] = one._replace(missed=least)

    def _predicted(self, k: int, model: Model, skew: Signal | None) -> Signal:
        return self._courses[k].predict(model, skew=skew)

    def predictions(
        self, models: Sequence[list[Model]], skews: Sequence[Signal], serves: float
    ) -> Signal:
        """Blocks by some models of each log and delays of the readings, (M, 5, variants).

        Zeros of sensors and discrepancy of the model are as here.

        Parameters
        ----------
        serves : share of the way from another place that its derivatives may miss [1]
        """

        def of_log(k: int) -> Signal:
            at = self.at[self._rows[k]]
            found = np.empty((*at.shape, len(skews)))
            for one, (own, skew) in enumerate(zip(models, skews, strict=True)):
                found[:, :, one] = at + self._moved(k, own[k], skew, serves)
            return found

        jobs = [partial(of_log, k) for k in range(len(self._courses))]
        return np.concatenate(all_at_once(jobs, self._sizes))

    def _moved(self, k: int, model: Model, skew: Signal, serves: float) -> Signal:
        """What another model and other delays move in the blocks of a log, (m, 5)."""
        change = differences(self._models[k], model) if np.array_equal(skew, self._skew) else None
        if change is None:
            return self._predicted(k, model, skew) - self._read[k]
        foreseen, left = foreseen_of(self._slopes[k], change, serves)
        if not left:
            return np.zeros_like(self._read[k]) + foreseen
        # what derivatives of other places miss belongs to no number
        foreseen, left = foreseen_of(self._slopes[k], change, min(serves, 0.0))
        moved = self._predicted(k, model, skew) - self._read[k]
        self._slopes[k][min(left)] = Slope(left, moved - foreseen)
        return moved

    def way_to(self, other: Nearby) -> tuple[Signal, Signal] | None:
        """What leads from here to another place in the blocks, (M, 5), and what derivatives here
        foresee of it, both without errors of sensors; None where they know only a part of the way.
        """
        moved, foreseen = [], []
        for k, (here, there) in enumerate(zip(self._models, other._models, strict=True)):
            way = differences(without_sensors(here), without_sensors(there))
            known, left = foreseen_of(self._slopes[k], way or {}, math.inf)
            if way is None or left:
                return None
            foreseen.append(np.zeros_like(self._true[k]) + known)
            moved.append(other._true[k] - self._true[k])
        return np.concatenate(moved), np.concatenate(foreseen)


PLACES = 4
"""Number of places of which the derivatives are kept: the first, at which nothing acts, and the
newest; a search returns to few."""


class Places:
    """Places of a fit, of which the newest `PLACES` and their derivatives are kept."""

    def __init__(self) -> None:
        self._known: dict[tuple[bytes, tuple[tuple[str, Values], ...]], Nearby] = {}

    def of(
        self,
        nu: Signal,
        effects: Sequence[ActiveEffect],
        made: Callable[[], Nearby],
        whiten: Callable[[Signal], Signal],
    ) -> Nearby:
        """The place of some nuisances and effects, with the derivatives of all others that are
        kept, each with the share of the way that it misses.

        Where more acts than where they were taken, what moves nothing there does not serve: what
        the cooling of a gas moves depends on whether it heats.

        Parameters
        ----------
        made : makes it where it is not kept
        whiten : makes blocks, (M, 5), independent numbers of unit variance
        """
        acting = {one.effect.name: one.values for one in effects}
        key = nu.tobytes(), tuple(acting.items())
        if key not in self._known:
            found = made()
            for (_, others), known in self._known.items():
                if (missed := _missed(known.way_to(found), whiten)) < math.inf:
                    found.take(known, missed, inert=acting.keys() <= dict(others).keys())
            self._known[key] = found
            if len(self._known) > PLACES:
                del self._known[[*self._known][1]]
        return self._known[key]


def _missed(way: tuple[Signal, Signal] | None, whiten: Callable[[Signal], Signal]) -> float:
    """Share that derivatives miss of what leads from their place to another one, as
    `Nearby.way_to` gives it; infinite where they know only a part. [1]
    """
    if way is None or not np.isfinite(way[0]).all():
        return math.inf
    moved, missed = (float(np.linalg.norm(whiten(one))) for one in (way[0], way[1] - way[0]))
    return missed / max(moved, 1.0)


def foreseen_of(
    slopes: Mapping[str, Slope], change: Mapping[str, float], serves: float
) -> tuple[Signal | float, dict[str, float]]:
    """What a change of some numbers moves in the blocks of a log by derivatives, (m, 5), and what
    is left of it, along which there is none.

    Each derivative is along numbers that follow the one that it is kept by, so that one pass in
    their order suffices.
    """
    moved: Signal | float = 0.0
    left, ahead = dict(change), sorted(change)
    size = {number: abs(by) for number, by in change.items()}
    while ahead:
        number = ahead.pop(0)
        if number not in slopes or slopes[number].missed > serves:
            continue
        along, moves, _ = slopes[number]
        share = left.pop(number) / along[number]
        moved = moved + share * moves
        for other, by in along.items():
            was, taken = left.pop(other, 0.0), share * by
            size[other] = max(size.get(other, 0.0), abs(taken))
            if other != number and abs(was - taken) > ROUNDING * size[other]:
                left[other] = was - taken
        ahead = sorted(one for one in left if one > number)
    return moved, left
