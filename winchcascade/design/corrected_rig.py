"""A corrected rig with what its diagnosis leaves open: bands of its operating points, the gain of
a load, and what a repair is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.design.design_result import Repair, Share
from winchcascade.design.operating import PLACE, Motion, Path, path_of, points
from winchcascade.diagnosis.handover.posterior import Band, RigPosterior
from winchcascade.diagnosis.handover.tested import Tested
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.verdict_limits import LAW

if TYPE_CHECKING:
    from winchcascade.core.run import Mask, Signal

JOULES_PER_KWH = 3.6e6
"""Energy of one kWh. [J]"""


class Explanation:
    """A corrected rig by one fit: models by which its operating points have uncertainties, of its
    posterior and of its laws.

    What an effect does in the logs is known as the posterior has it, whatever its law: how well the
    law is known counts beyond these logs, and for the rig without the effect.

    `moved` are the best model and it moved along every direction of the posterior, `repaired` the
    same without each effect that acts, `laws` how well the law of each is known [1], and `each` are
    `moved` and the best models without each effect.
    """

    def __init__(self, posterior: RigPosterior) -> None:
        self.moved, self.weight = posterior.models(), posterior.weight
        self.laws = {
            one.effect.name: max(LAW, one.effect.law_u)
            for one in posterior.effects
            if one.effect.entry is None
        }
        self.repaired = {name: posterior.models(name) for name in self.laws}
        self.each = [*self.moved, *(models[0] for models in self.repaired.values())]

    def u(self, found: Signal, covered: Mask | np.bool_) -> Signal:
        """Standard uncertainty of what `each` gives, (models, ...): by the posterior and, where the
        logs do not cover it, by the laws of the effects.
        """
        changes, count = np.moveaxis(found[1:] - found[0], 0, -1), len(self.moved) - 1
        posterior = np.linalg.norm(changes[..., :count], axis=-1)
        laws = np.linalg.norm(changes[..., count:] * [*self.laws.values()], axis=-1)
        return np.asarray(np.hypot(posterior, np.where(covered, 0.0, laws)))


class CorrectedRig:
    """A corrected rig whose operating points have bands: a mixture over the explanations that the
    logs do not distinguish.

    `moved` are the models of the best one, `causes` the effects that a repair is valued of.
    """

    def __init__(self, posterior: RigPosterior, tested: Tested) -> None:
        self.tested = tested
        self.explanations = [Explanation(one) for one in posterior.members]
        self.weights = np.array([one.weight for one in self.explanations])
        self.moved = self.explanations[0].moved
        self.causes = [
            name for name in self.explanations[0].repaired if name in tested.judgement.causes
        ]

    def path(self, motion: Motion) -> Path:
        """A motion as the rig takes it, with its payouts as the reduction of the logs finds
        them.
        """
        return path_of(motion, self.moved[0], self.tested.rules)

    def bands(self, paths: Sequence[Path], loads: Sequence[float]) -> Signal:
        """Quantities along each motion at each load, low and high ends of their bands, (3,
        motions, loads, quantities).
        """
        found = [points(one.each, paths, loads) for one in self.explanations]
        covered = self.covers(paths, found[0][0])[:, :, None]
        return self._mixture(
            [
                (every[0], one.u(every, covered))
                for one, every in zip(self.explanations, found, strict=True)
            ]
        )

    def _mixture(self, each: Sequence[tuple[Signal, Signal]]) -> Signal:
        """The value of the best explanation and the 95 % interval over all, (3, ...), of the
        value and u of each.
        """
        values, u = (np.array(several) for several in zip(*each, strict=True))
        return np.stack([values[0], *mixed(self.weights, values, u)])

    def gain(self, path: Path, load: float, fixed: float, metric: str) -> tuple[Band, bool]:
        """How much larger a metric is with a load than with a fixed one [1], and whether the logs
        cover both.
        """
        found = [points(one.each, [path], [load, fixed]) for one in self.explanations]
        covered, each = self.covers([path], found[0][0]).all(), []
        u_ratio = self.tested.u_ratio([load], [fixed])
        for one, every in zip(self.explanations, found, strict=True):
            with_load, with_fixed = every[:, 0, :, PLACE[metric]].T
            gains = with_load / with_fixed - 1.0
            u = np.hypot(one.u(gains, covered), u_ratio * (1.0 + gains[0]))
            each.append((gains[0], u))
        return Band(*self._mixture(each).tolist()), bool(covered)

    def covers(self, paths: Sequence[Path], found: Signal) -> Mask:
        """Whether the logs cover quantities along some motions, (motions, loads) of (motions,
        loads, quantities).
        """
        speed = np.repeat([path.speed for path in paths], found.shape[1])
        current, force = (found[:, :, PLACE[name]].ravel() for name in ("i_dc_a", "force_n"))
        covered = self.tested.covers(speed, current, force)
        return np.asarray(covered, dtype=np.bool_).reshape(found.shape[:2])

    def worth(self, name: str, shares: Sequence[Share], load: float) -> Repair:
        """What a repair brings over some motions at a load; nothing by an explanation without the
        effect.

        It is within the domain if the logs cover the rig with the effect and the repaired one.
        """
        paths = [self.path(share.motion) for share in shares]
        several = [one for one in self.explanations if name in one.repaired]
        repaired, acting = (
            [points(models, paths, [load]) for models in of]
            for of in ([one.repaired[name] for one in several], [one.moved for one in several])
        )
        number = np.array([share.per_year for share in shares])
        yearly = bool(np.all(np.isfinite(number)))
        weights = number / number.sum() if yearly else np.full(len(shares), 1.0 / len(shares))

        def change(quantity: str, per: float = 1.0) -> Band:
            each = {}
            for one, without, within in zip(several, repaired, acting, strict=True):
                own = per * (without - within)[:, :, 0, PLACE[quantity]] @ weights
                law = one.laws[name] * own[0]
                each[one] = own[0], np.hypot(np.linalg.norm(own[1:] - own[0]), law)
            nothing = np.float64(0.0), np.float64(0.0)
            value, low, high = self._mixture(
                [each.get(one, nothing) for one in self.explanations]
            ).tolist()
            if len(several) < len(self.explanations):
                return Band(value, min(low, 0.0), max(high, 0.0))
            return Band(value, low, high)

        per_year = change("e_gen_j", float(number.sum()) / JOULES_PER_KWH) if yearly else None
        covered = all(self.covers(paths, found[0][0]).all() for found in (acting, repaired))
        return Repair(name, change("e_gen_j"), per_year, change("e_line_j", -1.0), covered)


def mixed(weights: Signal, values: Signal, u: Signal) -> tuple[Signal, Signal]:
    """Ends of the 95 % interval of a mixture of normals, (...) each.

    Parameters
    ----------
    weights : (m,) of the normals, 1 in sum
    values, u : (m, ...) mean and standard deviation of each

    Examples
    --------
    >>> low, high = mixed(np.ones(1), np.array([5.0]), np.array([1.0]))
    >>> float(low), float(high)
    (3.04, 6.96)
    """
    from scipy.special import ndtr

    ends = []
    for side in (-COVERED, COVERED):
        of_each = values + side * u
        low, high = of_each.min(axis=0), of_each.max(axis=0)
        for _ in range(HALVED if len(weights) > 1 else 0):
            middle = 0.5 * (low + high)
            below = np.tensordot(
                weights, ndtr((middle - values) / np.maximum(u, TINY)), axes=1
            ) < ndtr(side)
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        ends.append(0.5 * (low + high))
    return ends[0], ends[1]


HALVED, TINY = 40, 1e-300
"""Number of times that the span of an end of an interval is halved, and a standard deviation for
what has none. [1]
"""
