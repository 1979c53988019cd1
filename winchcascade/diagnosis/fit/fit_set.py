"""The fit of one set of suspects, nuisances integrated out: Gauss and Newton with bounded steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.evidence import Fit, minimum_within, prior_of
from winchcascade.diagnosis.fit.marginal import WILD, Marginal, Problem, huber, weights
from winchcascade.diagnosis.fit.suspects import freedom, places_of, varied, with_values

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.fit.suspects import Suspects


STEP = 0.02
"""Share of the plausible range of a field by which its derivative is taken."""


AT_ONCE = 16
"""Number of derivatives that are computed at once, so that those of many logs keep to their
memory.
"""


STEPS, WORTHWHILE = 8, 0.05
"""Maximum number of steps of a fit, and the improvement of the objective below which it has
settled.
"""


REWEIGHTED = 20
"""Maximum number of times that residuals are weighed anew in one step. [1]"""


FORESEEN = 0.3
"""Share of the improvement that a step promises from which the derivative serves on. [1]"""


SHARES = (1.0, 0.4, 0.15, 0.05)
"""Shares of a step that are tried until one lowers the objective."""


def columns_of(
    problem: Problem,
    marginal: Marginal,
    fit: Fit,
    wanted: Sequence[str],
    serves: float = 0.0,
) -> Signal:
    """Derivative of the residuals of a fit over the fields of some suspects, which need not act,
    nuisances integrated out.

    Parameters
    ----------
    serves : share of the way from another place that its derivatives may miss [1]
    """
    acting = fit.acting(problem.suspects)
    variants, steps = [], []
    for name in wanted:
        here = fit.x[fit.place[name]] if name in acting else freedom(problem.suspects[name]).absent
        for moved, step in varied(problem.suspects[name], here, STEP):
            variants.append([*(acting | {name: moved}).values()])
            steps.append(step)
    columns = np.zeros((fit.given.size, len(variants)))
    for first in range(0, len(variants), AT_ONCE):
        several = slice(first, first + AT_ONCE)
        raw = problem.residuals(variants[several], marginal.place, [*acting.values()], serves)
        moved = (marginal.centred(raw) - fit.given[:, None]) / np.array(steps[several])
        # a number with which nothing can be simulated has no derivative
        columns[:, several] = marginal(np.where(np.any(np.abs(raw) >= WILD, axis=0), 0.0, moved))
    return columns


def begun(suspects: Suspects, names: Names, start: Mapping[str, Signal]) -> Signal:
    """Fields of a set in a row, (k,), as they are known by suspect; suspects that are not known
    are absent.
    """
    own = [start.get(name, freedom(suspects[name]).absent) for name in names]
    return np.concatenate([np.zeros(0), *own])


def located(problem: Problem, marginal: Marginal, names: Names, x: Signal) -> Fit:
    """A set of suspects with given fields, (k,), not fitted."""
    suspects = problem.suspects
    place, free = places_of(suspects, names), freedom(*(suspects[name] for name in names))
    effects = [with_values(suspects[name], x[own]) for name, own in place.items()]
    given = marginal.centred(problem.residuals([effects], marginal.place)[:, 0])
    r = marginal(given)
    loss, unknown = huber(r) + float(prior_of(x, free)), np.zeros(x.size)
    return Fit(names, place, x, loss, r, np.zeros((x.size, x.size)), unknown, free, given, r, r)


def _best_step(fit: Fit, columns: Signal) -> tuple[Signal, float]:
    """Step from a fit to the least objective where residuals are linear, (k,), and by how much it
    is less there.

    Weights of least squares follow the residuals (Huber 1964), so they are found step by step, at
    no simulation.

    Parameters
    ----------
    columns : (n, k) derivative of the residuals
    """
    free, step, r, loss = fit.free, np.zeros(fit.x.size), fit.r, fit.loss
    for _ in range(REWEIGHTED):
        x = fit.x + step
        weighted = columns * weights(r)[:, None]
        slope = -weighted.T @ r - (x - free.absent) / free.sd**2
        curve = weighted.T @ columns + np.diag(free.sd**-2.0)
        further = step + minimum_within(curve, slope, free.minimum - x, free.maximum - x)
        left = fit.r + columns @ further
        now = huber(left) + float(prior_of(fit.x + further, free))
        if loss - now < WORTHWHILE:
            break
        step, r, loss = further, left, now
    return step, fit.loss - loss


def fit_set(
    problem: Problem,
    marginal: Marginal,
    names: Names,
    start: Mapping[str, Signal] | None = None,
    columns: Signal | None = None,
    settled: float = WORTHWHILE,
    rough: float = 0.0,
) -> Fit:
    """Fit a set of suspects by Gauss and Newton, each step bounded.

    Parameters
    ----------
    start : fields to begin from by suspect; suspects without any begin absent
    columns : (n, k) derivative of the residuals there or near, which serves as long as it foresees
        what a step brings
    settled, rough : improvement of the objective below which a further step is not worth it, and
        as a share of what the fit has gained [1]
    """
    names = tuple(sorted(names))
    free, x = (
        freedom(*(problem.suspects[name] for name in names)),
        begun(problem.suspects, names, start or {}),
    )

    def at(x: Signal) -> Fit:
        return located(problem, marginal, names, x)

    fit, fresh = at(np.clip(x, free.minimum, free.maximum)), columns is None
    columns = columns_of(problem, marginal, fit, names) if columns is None else columns
    begin, promised = fit.loss, 0.0
    for taken in range(STEPS):
        step, promised = _best_step(fit, columns)
        if promised < (max(settled, rough * (begin - fit.loss)) if taken else WORTHWHILE):
            break
        tried = (at(np.clip(fit.x + share * step, free.minimum, free.maximum)) for share in SHARES)
        there = next((one for one in tried if one.loss < fit.loss), None)
        if there is None and fresh:
            break
        gained = 0.0 if there is None else fit.loss - there.loss
        fit = there or fit
        fresh = gained < FORESEEN * promised
        if fresh:
            columns = columns_of(problem, marginal, fit, names)
    nu, left = marginal.best(fit.given)
    weighted = columns * weights(fit.r)[:, None]
    return msgspec.structs.replace(
        fit, curve=weighted.T @ columns, slope=-weighted.T @ fit.r, nu=nu, z=left, open=promised
    )
