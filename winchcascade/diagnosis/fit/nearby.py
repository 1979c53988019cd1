"""What small changes move about one place of a fit, with one derivative for each number of the
model and log.

A tolerance of the rig file and a suspect often change the same number, and a load that of one log
alone: the derivative over a number is taken once, and serves all that change it.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.rig.parts import only_change

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.predict import Course
    from winchcascade.rig.parts import Model


class Nearby:
    """A place of a fit: the model of each log, the delay of the reading of each channel, (5,) [s],
    the prediction `at` it, (M, 5) in SI units, and the derivatives that were taken there.
    """

    def __init__(
        self, courses: Sequence[Course], models: Sequence[Model], skew: Signal, at: Signal
    ) -> None:
        self._courses, self._models, self._skew, self.at = courses, models, skew, at
        self._sizes = [course.blocks.size for course in courses]
        self._rows = [slice(a, b) for a, b in pairwise(np.cumsum([0, *self._sizes]).tolist())]
        here = zip(self._courses, self._models, strict=True)
        self._read = [course.predict(model, skew=self._skew) for course, model in here]
        self._slopes: list[dict[str, Signal]] = [{} for _ in courses]

    def predictions(self, models: Sequence[list[Model]], skews: Sequence[Signal]) -> Signal:
        """Blocks by some models of each log and delays of the readings, (M, 5, variants).

        Zeros of sensors and discrepancy of the model are as here.
        """

        def of_log(k: int) -> Signal:
            each = [self._moved(k, own[k], skew) for own, skew in zip(models, skews, strict=True)]
            return self.at[self._rows[k]][:, :, None] + np.stack(each, axis=2)

        jobs = [partial(of_log, k) for k in range(len(self._courses))]
        return np.concatenate(all_at_once(jobs, self._sizes))

    def _moved(self, k: int, model: Model, skew: Signal) -> Signal:
        """What another model and other delays move in the blocks of a log, (m, 5)."""
        change = only_change(self._models[k], model) if np.array_equal(skew, self._skew) else None
        if change is not None and not change[0]:
            return np.zeros_like(self.at[self._rows[k]])
        slopes = self._slopes[k]
        if change is not None and change[0] in slopes:
            return slopes[change[0]] * change[1]
        moved = self._courses[k].predict(model, skew=skew) - self._read[k]
        if change is not None:
            slopes[change[0]] = moved / change[1]
        return moved
