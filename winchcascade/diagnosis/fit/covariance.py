"""Covariance of the numbers of a fit, also where some lie at a bound and where residuals are not
independent.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.fit.block_means import PAYOUT, PHASES
from winchcascade.diagnosis.fit.evidence import Fit, inside_of
from winchcascade.diagnosis.fit.marginal import weights
from winchcascade.diagnosis.fit.misfit import Fitted, log_of
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.search import Found

if TYPE_CHECKING:
    from collections.abc import Collection

    from winchcascade.core.run import Signal


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


def joint_covariance(found: Found, fit: Fit | None = None, columns: Signal | None = None) -> Signal:
    """Covariance of all fields of a fit, the best one by default, and then of its nuisances, (k +
    n, k + n): these follow the fields, and scatter about that as the data and their tolerances
    leave them.

    Parameters
    ----------
    columns : as for `covariance_of`, where they are known
    """
    fit, marginal = fit or found.best, found.marginal
    columns = found.columns(fit) if columns is None else columns
    fields = covariance_of(found, fit, columns)
    follow = marginal.spread @ marginal.columns.onto(marginal.undone(columns))
    both = fields @ follow.T
    return np.block([[fields, both], [both.T, follow @ both + marginal.spread_in(found.scale)]])


def discrepancy_found(data: Fitted, nu: Signal, determined: Signal) -> Signal:
    """Variance of each nuisance over the one that is allowed, (n,): of the discrepancy of the model
    as the fit finds it, as most rigs have less than what is allowed of any.

    It is the mean square over one channel in one phase, with one that is as large as is allowed; no
    more than that.

    Parameters
    ----------
    nu : (n,) nuisances of the fit, in units of their tolerance
    determined : (n,) share of the allowed variance that the data determine
    """
    found = np.ones(nu.size)
    cells: dict[tuple[str, str], list[int]] = {}
    for j, n in enumerate(data.nuisances):
        if n.kind == "discrepancy":
            cells.setdefault((n.name, n.phase), []).append(j)
    for own in cells.values():
        found[own] = min(
            (float(np.sum(nu[own] ** 2)) + 1.0) / (float(np.sum(determined[own])) + 1.0), 1.0
        )
    return found


def predictive_covariance(data: Fitted, found: Found, fit: Fit | None = None) -> Signal:
    """Covariance as `joint_covariance` gives it, of the errors of what is predicted, (k + n, k +
    n): the discrepancy has the size that the fit finds.

    A fit weighs its logs by the discrepancy that is allowed. Its error by each part of this is S
    times the part, S being its covariance, so of a part that is smaller than allowed only a share
    of the square remains.
    """
    fit = fit or found.best
    columns = found.columns(fit)
    known, share = _known_and_found(data, found, fit, columns)
    excess = np.concatenate([np.zeros(fit.x.size), 1.0 - share])
    return np.asarray(joint_covariance(found, fit, columns) - (known * excess) @ known)


def voltage_of_a_load(data: Fitted, found: Found) -> float:
    """Standard deviation of Vdc in payout at one load beside that at all, as a share of its
    plateau: of the discrepancy of the model, with the size that the best fit finds. [1]
    """
    _, share = _known_and_found(data, found, found.best, found.columns(found.best))
    squares: dict[float, float] = {}
    for n, own in zip(data.nuisances, share, strict=True):
        if (n.kind, n.name, n.phase) == ("discrepancy", "vdc", PHASES[PAYOUT]):
            squares[n.load] = squares.get(n.load, 0.0) + float(own) * n.sd**2
    return math.sqrt(max((x for load, x in squares.items() if math.isfinite(load)), default=0.0))


def _known_and_found(
    data: Fitted, found: Found, fit: Fit, columns: Signal
) -> tuple[Signal, Signal]:
    """Covariance of a fit by least squares, (k + n, k + n), and the variance of each nuisance over
    the one that is allowed, (n,).
    """
    known = _known_by(data, found, fit, columns, np.ones(data.blocks.size))
    count = len(data.nuisances)
    return known, discrepancy_found(data, fit.nu, 1.0 - np.diag(known)[-count:])


def covariances_without(
    data: Fitted, found: Found, loads: Collection[float]
) -> dict[float, Signal]:
    """Covariance as `predictive_covariance` gives it, of the best fit without the logs of each load
    [ohm]: what these determine is added.

    What concerns one log alone stays as it is known, and a field at a bound stays there.
    """
    of_blocks = np.repeat([log.load for log in data.logs], data.sizes)
    known_by = partial(_known_by, data, found, found.best, found.columns(found.best))
    left = predictive_covariance(data, found) - known_by(np.ones(of_blocks.size))
    return {load: left + known_by((of_blocks != load).astype(np.float64)) for load in loads}


def _known_by(data: Fitted, found: Found, fit: Fit, columns: Signal, taking: Signal) -> Signal:
    """Covariance of the fields of a fit and then of its nuisances by least squares, (k + n, k + n);
    a field at a bound stays there.

    Parameters
    ----------
    columns : as for `covariance_of`
    taking : (M,) weight of each block; fields of one log alone keep all of theirs
    """
    fields = -found.marginal.undone(columns) * inside_of(fit)
    of_a_log = np.zeros(fit.x.size, dtype=bool)
    for name, effect in fit.acting(found.problem.suspects).items():
        of_a_log[fit.place[name]] = log_of(effect) >= 0
    prior = np.diag([*fit.free.sd**-2.0, *np.ones(len(data.nuisances))])
    rows = np.repeat(taking, len(CHANNELS))
    own = np.where(of_a_log, fields, fields * rows[:, None])
    others = found.marginal.masked(rows)
    across = others.columns.onto(own)
    information = np.block([[own.T @ own, across.T], [across, others.information]])
    return np.asarray(np.linalg.inv(information / found.scale + prior))
