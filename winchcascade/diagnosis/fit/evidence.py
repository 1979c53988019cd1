"""What a fitted set is worth: its objective, its evidence, and the minimum of a quadratic within
bounds.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.marginal import Problem, huber
from winchcascade.diagnosis.fit.suspects import Freedom, places_of, with_values
from winchcascade.diagnosis.verdict_limits import CLEARLY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect


ROUNDING = 1e-12
"""Share of the diagonal of a matrix that its rounding may take."""


GUESSES = 8
"""Maximum number of guesses of which fields lie at which bound, before these are found one by
one.
"""


class Fit(msgspec.Struct, frozen=True):
    """A set of suspects, fitted.

    `x` (k,) are the fields of the suspects in a row, those of each at its `place`, `loss` the
    robust objective with the priors, `r` (n,) the residuals with the nuisances integrated out,
    `curve` (k, k) and `slope` (k,) the curvature of the objective over the fields and its slope
    downwards, both without their prior. Whitened residuals without any nuisance are `given`, (n,).
    The nuisances that explain most of them are `nu`, in units of their tolerance, and `z` (n,) is
    what these leave. A further step of the fit promises to lower the objective by `open`.
    """

    names: Names
    place: dict[str, slice]
    x: Signal
    loss: float
    r: Signal
    curve: Signal
    slope: Signal
    free: Freedom
    given: Signal
    nu: Signal
    z: Signal
    open: float = 0.0

    @property
    def scale(self) -> float:
        """Mean square of the residuals, robustly, at least 1: by how much the noise exceeds its
        estimate.
        """
        return max(2.0 * huber(self.r) / max(int(np.count_nonzero(self.r)), 1), 1.0)

    def effects(self, suspects: Suspects) -> list[ActiveEffect]:
        """The suspects with the values that were found."""
        return [*self.acting(suspects).values()]

    def acting(self, suspects: Suspects) -> dict[str, ActiveEffect]:
        """The same by name."""
        return {name: with_values(suspects[name], self.x[self.place[name]]) for name in self.names}


class Evidence(msgspec.Struct, frozen=True):
    """What weighs the evidence for a set: the problem, and the square by which the noise exceeds
    its estimate.
    """

    problem: Problem
    scale: float

    def of(self, fit: Fit) -> float:
        """Logarithm of the evidence for a fit, up to a constant (Laplace)."""
        prior = float(prior_of(fit.x, fit.free))
        objective = np.array([(fit.loss - prior) / self.scale + prior])
        curve, slope = fit.curve[None], fit.slope[None]
        (found,) = self.weighed([fit.names], fit.x[None], fit.free, curve, slope, objective)
        return float(found)

    def weighed(
        self,
        sets: Sequence[Names],
        x: Signal,
        free: Freedom,
        curve: Signal,
        slope: Signal,
        objective: Signal,
    ) -> Signal:
        """Logarithm of the evidence for each of some sets of equally many fields whose objective
        is known, (m,).

        Parameters
        ----------
        x, curve, slope : (m, k) fields of each set in a row, and (m, k, k) the curvature of the
            objective there and (m, k) its slope downwards, both without their prior
        """
        suspects, information = self.problem.suspects, curve / self.scale
        open_to = volume_within(x, free, information, slope / self.scale)
        each = zip(sets, x, np.broadcast_to(free.sd, x.shape), information, strict=True)
        usual = np.array([usual_gain(suspects, *one) for one in each])
        prices = np.array([sum(map(self.problem.price, names)) for names in sets])
        return np.asarray(usual - objective + open_to - prices)

    def worth(self, fit: Fit) -> float:
        """Evidence by which sets of any size compare."""
        return self.of(fit) - CLEARLY * len(fit.names)


def prior_of(x: Signal, free: Freedom) -> Signal:
    """Part of the objective of the prior of some fields, (...,) of (..., k): normal about their
    absence, wide as what is plausible.
    """
    return np.asarray(0.5 * np.sum(((x - free.absent) / free.sd) ** 2, axis=-1))


def prior_beyond_range(fit: Fit) -> float:
    """Part of the objective that the prior adds because fields lie beyond their plausible range,
    over that at the nearest end of the range; 0 within it.
    """
    within_range = np.clip(fit.x, fit.free.low, fit.free.high)
    return float(prior_of(fit.x, fit.free) - prior_of(within_range, fit.free))


def usual_gain(
    suspects: Suspects, names: Names, x: Signal, sd: Signal, information: Signal
) -> float:
    """Evidence that wrong entries gain or lose, as part of their prior lies at usual multiples and
    not even over their range.

    Parameters
    ----------
    x, sd, information : (k,) fields in a row and the standard deviations of their priors, (k, k)
        what the data tell of them
    """
    entries = {name: suspects[name].fields[0] for name in names}
    usual = {name: one for name, one in entries.items() if one.role == "entry" and one.usual}
    if not usual:
        return 0.0
    gain, place = 0.0, places_of(suspects, names)
    variances = np.diag(np.linalg.inv(information + np.diag(sd**-2.0)))
    for name, entry in usual.items():
        k = place[name].start
        multiples = 1.0 + np.array(entry.usual)
        spread = np.sqrt(variances[k] + (entry.scatter * multiples) ** 2)
        density = np.exp(-0.5 * ((1.0 + x[k] - multiples) / spread) ** 2) / (
            math.sqrt(2.0 * math.pi) * spread
        )
        peaked = float(np.mean(density) * 2.0 * sd[k])
        gain += math.log(max((1.0 - entry.usual_share) + entry.usual_share * peaked, 1e-30))
    return gain


def volume_within(x: Signal, free: Freedom, information: Signal, slope: Signal) -> Signal:
    """Logarithm of the volume that the posterior of some fields leaves open over that of their
    prior, within what is possible, (...,).

    Both are normal and end at the bounds. The spread of each field is that with those before it
    known, the product of which is the volume where there are no bounds.

    Parameters
    ----------
    x : (..., k)
    information, slope : (..., k, k) and (..., k) curvature of the objective and its slope
        downwards, without the prior
    """
    sd = free.sd
    with_prior = np.eye(x.shape[-1]) + information * sd[..., :, None] * sd[..., None, :]
    narrower = _diagonal(root_of(with_prior[..., ::-1, ::-1]))[..., ::-1]
    spread, at = sd / narrower, ~within(x, free)
    pull = np.where(at, (x - free.absent) / sd**2 - slope, 0.0)
    posterior = log_mass(free.minimum - x, free.maximum - x, pull, spread)
    prior = log_mass(free.minimum - free.absent, free.maximum - free.absent, 0.0, sd)
    return np.asarray(np.sum(posterior - prior - np.log(narrower), axis=-1))


def log_mass(low: Signal, high: Signal, pull: Signal | float, spread: Signal) -> Signal:
    """Logarithm of the integral of exp(-pull t - (t / spread)^2 / 2) from `low` to `high` over
    that of the normal, (..., k).
    """
    from scipy.special import log_ndtr

    shift = pull * spread
    a, b = low / spread + shift, high / spread + shift
    near, far = np.where(a > 0.0, -a, b), np.where(a > 0.0, -b, a)
    more, less = log_ndtr(near), log_ndtr(far)
    return np.asarray(0.5 * shift**2 + more + np.log(-np.expm1(np.minimum(less - more, -ROUNDING))))


def _diagonal(matrices: Signal) -> Signal:
    """Diagonals of some matrices, (..., k)."""
    return np.diagonal(matrices, axis1=-2, axis2=-1)


def _scaled(curve: Signal) -> tuple[Signal, Signal]:
    """Positive definite matrices, (..., k, k), with a diagonal of 1 also where rounding hides that
    they are definite, and what each row and column was divided by, (..., k).
    """
    size = np.sqrt(_diagonal(curve))
    scaled = curve / (size[..., :, None] * size[..., None, :])
    return scaled + ROUNDING * np.eye(size.shape[-1]), size


def root_of(curve: Signal) -> Signal:
    """Lower triangular root of positive definite matrices, (..., k, k)."""
    scaled, size = _scaled(curve)
    return np.asarray(size[..., :, None] * np.linalg.cholesky(scaled))


def minimum_within(curve: Signal, slope: Signal, low: Signal, high: Signal) -> Signal:
    """Where x' curve x / 2 - slope' x is least within bounds, which may be infinite, (..., k).

    Which fields lie at a bound is guessed (Hintermueller, Ito and Kunisch 2003); in the rare case
    that no guess settles, the bounds are taken one by one.
    """
    scaled, size = _scaled(curve)
    aim, below, above = slope / size, low * size, high * size
    now_low = now_high = np.zeros(aim.shape, dtype=bool)
    for _ in range(GUESSES):
        at_low, at_high = now_low, now_high & ~now_low
        held = at_low | at_high
        fixed = np.where(at_low, below, np.where(at_high, above, 0.0))
        rest = aim - (scaled @ fixed[..., None])[..., 0]
        joined = held[..., :, None] | held[..., None, :]
        x = np.linalg.solve(
            np.where(joined, np.eye(held.shape[-1]), scaled),
            np.where(held, fixed, rest)[..., None],
        )[..., 0]
        force = aim - (scaled @ x[..., None])[..., 0]
        now_low = np.where(at_low, force <= 0.0, x < below)
        now_high = np.where(at_high, force >= 0.0, x > above)
        unsettled = np.any((now_low != at_low) | (now_high != at_high), axis=-1)
        if not unsettled.any():
            break
    for one in map(tuple, np.argwhere(unsettled)):
        x[one] = _by_active_sets(scaled[one], aim[one], below[one], above[one])
    return np.clip(x / size, low, high)


def _by_active_sets(curve: Signal, slope: Signal, low: Signal, high: Signal) -> Signal:
    """`minimum_within` of one matrix, (k,), bound by bound."""
    from scipy.optimize import lsq_linear

    root = np.linalg.cholesky(curve)
    bounds = low - ROUNDING, high + ROUNDING
    found = lsq_linear(root.T, np.linalg.solve(root, slope), bounds=bounds, method="bvls")
    return np.asarray(found.x)


def inside_of(fit: Fit) -> NDArray[np.bool_]:
    """Whether the fields of a fit lie at none of the bounds of what is possible, (k,)."""
    return within(fit.x, fit.free)


def within(x: Signal, free: Freedom) -> NDArray[np.bool_]:
    """Whether fields lie at none of the bounds of what is possible, (..., k)."""
    margin = 1e-9 * (free.high - free.low)
    return np.asarray((x > free.minimum + margin) & (x < free.maximum - margin))
