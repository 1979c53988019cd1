"""Covariance of the numbers of a fit, also where some lie at a bound and where residuals are not
independent.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.fit.evidence import Fit, inside_of
from winchcascade.diagnosis.fit.marginal import weights
from winchcascade.diagnosis.fit.misfit import Fitted, log_of
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.search import Found

if TYPE_CHECKING:
    from winchcascade.core.run import Mask, Signal


FEW = 10
"""Minimum number of groups of residuals for an estimate of their scatter."""


def covariance_of(found: Found, fit: Fit, columns: Signal) -> Signal:
    """Covariance of the fields of a fit, (k, k): what data and priors leave, nuisances included.

    A field at a bound may lie away from it on one side, as far as the normal that is cut off there
    reaches, and the others follow it. The variance of a field within its bounds is at least that by
    the scatter of the groups of residuals, as in `grown`.

    Parameters
    ----------
    columns : (n, k) derivative of the residuals over the fields, nuisances integrated out
    """
    weighted = columns * weights(fit.r)[:, None]
    curve = weighted.T @ columns / found.scale + np.diag(fit.free.sd**-2.0)
    pull = weighted.T @ fit.r / found.scale + (fit.x - fit.free.absent) / fit.free.sd**2
    inside, at = np.flatnonzero(inside_of(fit)), np.flatnonzero(~inside_of(fit))
    inverse = np.linalg.inv(curve[np.ix_(inside, inside)]).astype(np.float64)
    by = np.sqrt(
        [grown(found, columns[:, inside], fit.r, inverse, way) for way in np.eye(inside.size)]
    )
    covariance = np.zeros_like(curve)
    covariance[np.ix_(inside, inside)] = inverse * np.outer(by, by)
    for k in at.tolist():
        way = np.zeros(fit.x.size)
        way[k], way[inside] = 1.0, -inverse @ curve[inside, k]
        spread = float(way @ curve @ way) ** -0.5
        covariance += (spread**2 * square_beyond(abs(float(pull[k])) * spread)) * np.outer(way, way)
    return covariance


def square_beyond(pull: float) -> float:
    """Mean square of what a unit normal, the maximum of which lies `pull` below 0, has above 0. [1]

    >>> square_beyond(0.0)
    1.0
    """
    from scipy.special import log_ndtr

    hazard = math.exp(-0.5 * pull**2 - float(log_ndtr(-pull))) / math.sqrt(2.0 * math.pi)
    return max(1.0 - pull * hazard + pull**2, 0.0)


def grown(found: Found, columns: Signal, r: Signal, covariance: Signal, way: Signal) -> float:
    """How much larger the variance of a sum of numbers is than their covariance says, at least 1.

    Residuals of one group are no independent numbers, in spite of the whitening: the sums of the
    scores of the groups vary as the variance does (Liang and Zeger 1986).

    Parameters
    ----------
    columns, r : (n, k) derivative of the residuals over the numbers, and what these leave of them,
        (n,)
    covariance, way : (k, k) of the numbers, and the weights of the sum, (k,)
    """
    groups, scores = (
        found.problem.groups,
        weights(r) * r * (columns @ (covariance @ way)) / found.scale,
    )
    sums = np.bincount(groups, scores, groups[-1] + 1)
    sums = sums[sums != 0.0]
    if sums.size < FEW:
        return 1.0
    together = float(sums.size / (sums.size - 1.0) * (sums @ sums))
    return max(together / float(way @ covariance @ way), 1.0)


def joint_covariance(found: Found, fit: Fit | None = None) -> Signal:
    """Covariance of all fields of a fit, the best one by default, and then of its nuisances, (k +
    n, k + n): these follow the fields, and scatter about that as the data and their tolerances
    leave them.
    """
    fit, marginal = fit or found.best, found.marginal
    columns = found.columns(fit)
    fields = covariance_of(found, fit, columns)
    follow = marginal.spread @ marginal.columns.onto(marginal.undone(columns))
    both = fields @ follow.T
    return np.block([[fields, both], [both.T, follow @ both + marginal.spread_in(found.scale)]])


def covariance_without(data: Fitted, found: Found, load: float) -> Signal:
    """Covariance as `joint_covariance` gives it, of a fit without the logs of a load [ohm]: what
    these determine is added.

    What concerns one log alone stays as it is known, and a field at a bound stays there.
    """
    best, loads = found.best, np.repeat([log.load for log in data.logs], data.sizes)
    fields = -found.marginal.undone(found.expansion.over(best.names)) * inside_of(best)
    of_a_log = np.zeros(best.x.size, dtype=bool)
    for name, effect in zip(best.names, best.effects(found.problem.suspects), strict=True):
        of_a_log[best.place[name]] = log_of(effect) >= 0
    prior = np.diag([*best.free.sd**-2.0, *np.ones(len(data.nuisances))])

    def left_by(blocks: Mask) -> Signal:
        rows = np.repeat(blocks.astype(np.float64), len(CHANNELS))
        own, others = (
            np.where(of_a_log, fields, fields * rows[:, None]),
            found.marginal.columns.masked(rows),
        )
        across = others.onto(own)
        information = np.block([[own.T @ own, across.T], [across, others.squared()]])
        return np.asarray(np.linalg.inv(information / found.scale + prior))

    return (
        joint_covariance(found) + left_by(loads != load) - left_by(np.ones(loads.size, dtype=bool))
    )
