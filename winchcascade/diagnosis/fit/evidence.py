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
        prior = prior_of(fit.x, fit.free)
        objective = (fit.loss - prior) / self.scale + prior
        return self.weighed(fit.names, fit.x, fit.free, fit.curve, fit.slope, objective)

    def weighed(
        self, names: Names, x: Signal, free: Freedom, curve: Signal, slope: Signal, objective: float
    ) -> float:
        """Logarithm of the evidence for a set whose objective is known.

        Parameters
        ----------
        x, curve, slope : (k,) fields of the set in a row, and (k, k) the curvature of the objective
            there and (k,) its slope downwards, both without their prior
        """
        suspects, information = self.problem.suspects, curve / self.scale
        open_to = volume_within(x, free, information, slope / self.scale)
        usual = usual_gain(suspects, names, x, free, information)
        return usual - objective + open_to - sum(self.problem.price(name) for name in names)

    def worth(self, fit: Fit) -> float:
        """Evidence by which sets of any size compare."""
        return self.of(fit) - CLEARLY * len(fit.names)


def prior_of(x: Signal, free: Freedom) -> float:
    """Part of the objective of the prior of some fields, (k,): normal about their absence, wide
    as what is plausible.
    """
    return 0.5 * float(np.sum(((x - free.absent) / free.sd) ** 2))


def prior_beyond_range(fit: Fit) -> float:
    """Part of the objective that the prior adds because fields lie beyond their plausible range,
    over that at the nearest end of the range; 0 within it.
    """
    within_range = np.clip(fit.x, fit.free.low, fit.free.high)
    return prior_of(fit.x, fit.free) - prior_of(within_range, fit.free)


def usual_gain(
    suspects: Suspects, names: Names, x: Signal, free: Freedom, information: Signal
) -> float:
    """Evidence that wrong entries gain or lose, as part of their prior lies at usual multiples and
    not even over their range.

    Parameters
    ----------
    x, information : (k,) fields in a row, (k, k) what the data tell of them
    """
    gain, place = 0.0, places_of(suspects, names)
    for name in names:
        entry = suspects[name].fields[0]
        if entry.role != "entry" or not entry.usual:
            continue
        k = place[name].start
        variance = float(np.linalg.inv(information + np.diag(free.sd**-2.0))[k, k])
        multiples = 1.0 + np.array(entry.usual)
        sd = np.sqrt(variance + (entry.scatter * multiples) ** 2)
        density = np.exp(-0.5 * ((1.0 + float(x[k]) - multiples) / sd) ** 2) / (
            math.sqrt(2.0 * math.pi) * sd
        )
        peaked = float(np.mean(density) * (free.high[k] - free.low[k]))
        gain += math.log(max((1.0 - entry.usual_share) + entry.usual_share * peaked, 1e-30))
    return gain


def volume_within(x: Signal, free: Freedom, information: Signal, slope: Signal) -> float:
    """Logarithm of the volume that the posterior of some fields leaves open over that of their
    prior, within what is possible.

    Both are normal and end at the bounds. The spread of each field is that with those before it
    known, the product of which is the volume where there are no bounds.

    Parameters
    ----------
    information, slope : (k, k) and (k,) curvature of the objective and its slope downwards, without
        the prior
    """
    if not x.size:
        return 0.0
    with_prior = np.eye(x.size) + information * np.outer(free.sd, free.sd)
    narrower = np.diag(root_of(with_prior[::-1, ::-1]))[::-1]
    spread, at = free.sd / narrower, ~within(x, free)
    pull = np.where(at, (x - free.absent) / free.sd**2 - slope, 0.0)
    posterior = log_mass(free.minimum - x, free.maximum - x, pull, spread)
    prior = log_mass(
        free.minimum - free.absent, free.maximum - free.absent, np.zeros(x.size), free.sd
    )
    return float(np.sum(posterior - prior - np.log(narrower)))


def log_mass(low: Signal, high: Signal, pull: Signal, spread: Signal) -> Signal:
    """Logarithm of the integral of exp(-pull t - (t / spread)^2 / 2) from `low` to `high` over
    that of the normal, (k,).
    """
    from scipy.special import log_ndtr

    shift = pull * spread
    a, b = low / spread + shift, high / spread + shift
    near, far = np.where(a > 0.0, -a, b), np.where(a > 0.0, -b, a)
    more, less = log_ndtr(near), log_ndtr(far)
    return np.asarray(0.5 * shift**2 + more + np.log(-np.expm1(np.minimum(less - more, -ROUNDING))))


def root_of(curve: Signal) -> Signal:
    """Lower triangular root of a positive definite matrix, (k, k), also where rounding hides
    that it is one.
    """
    size = np.sqrt(np.diag(curve))
    scaled = curve / np.outer(size, size) + ROUNDING * np.eye(size.size)
    return np.asarray(size[:, None] * np.linalg.cholesky(scaled))


def minimum_within(curve: Signal, slope: Signal, low: Signal, high: Signal) -> Signal:
    """Where x' curve x / 2 - slope' x is least within bounds, which may be infinite, (k,).

    Which fields lie at a bound is guessed (Hintermueller, Ito and Kunisch 2003); in the rare case
    that no guess settles, the bounds are taken one by one.
    """
    from scipy.optimize import lsq_linear

    size = np.sqrt(np.diag(curve))
    scaled, aim = curve / np.outer(size, size) + ROUNDING * np.eye(size.size), slope / size
    below, above = low * size, high * size
    at_low, at_high = np.zeros(size.size, dtype=bool), np.zeros(size.size, dtype=bool)
    for _ in range(GUESSES):
        x = np.where(at_low, below, np.where(at_high, above, 0.0))
        free = np.flatnonzero(~(at_low | at_high))
        x[free] = np.linalg.solve(scaled[np.ix_(free, free)], aim[free] - scaled[free] @ x)
        force = aim - scaled @ x
        now_low = np.where(at_low, force <= 0.0, x < below)
        now_high = np.where(at_high, force >= 0.0, x > above)
        if np.array_equal(now_low, at_low) and np.array_equal(now_high, at_high):
            return np.asarray(np.clip(x / size, low, high))
        at_low, at_high = now_low, now_high & ~now_low
    root = np.linalg.cholesky(scaled)
    bounds = below - ROUNDING, above + ROUNDING
    found = lsq_linear(root.T, np.linalg.solve(root, aim), bounds=bounds, method="bvls")
    return np.asarray(np.clip(found.x / size, low, high))


def inside_of(fit: Fit) -> NDArray[np.bool_]:
    """Whether the fields of a fit lie at none of the bounds of what is possible, (k,)."""
    return within(fit.x, fit.free)


def within(x: Signal, free: Freedom) -> NDArray[np.bool_]:
    """Whether fields, (k,), lie at none of the bounds of what is possible, (k,)."""
    margin = 1e-9 * (free.high - free.low)
    return np.asarray((x > free.minimum + margin) & (x < free.maximum - margin))
