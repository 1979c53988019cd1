"""What is reported of each law that acts: its number, its probability, its alternatives, its number
cycle by cycle, and the next run, at another speed or load, that would best distinguish a cause from
its strongest alternative.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    Experiment,
    NamedCause,
    Names,
    RunValue,
    Spot,
    Stability,
)
from winchcascade.diagnosis.fit.marginal import weights
from winchcascade.diagnosis.fit.suspects import with_values
from winchcascade.diagnosis.judge.causes import (
    COVERED,
    chance_with,
    parameters_of,
    posterior_of,
    swap,
)
from winchcascade.diagnosis.judge.stability import trends_of
from winchcascade.diagnosis.stages.stage_fit import FOLDS, StageFit, noise_of
from winchcascade.diagnosis.stages.stage_laws import MOTIONS
from winchcascade.diagnosis.verdict_limits import AS_GOOD, LAW, OPEN

if TYPE_CHECKING:
    from winchcascade.diagnosis.fit.evidence import Fit
    from winchcascade.diagnosis.stages.stage_laws import Suspected

MATERIAL = 0.01
"""Share of the power of the winch, root mean squares, that a cause must take to be named: in logs
of an hour far smaller ones are significant, and force cells and powers of field winches are no
better than to one per cent."""

AMBIGUOUS = 0.95
"""Maximum probability of a cause that another suspect can replace: the list of suspects is not
complete. [1]"""

UNSTEADY_SHARE = 0.5
"""Change of a number from cycle to cycle, as a share of it, beyond which it is no cause but
imitates one: a friction that falls as oil warms changes less. Assumed. [1]"""

ALTERNATIVES_FITTED = 4
"""Number of suspects that are fitted in place of a cause, nearest first by the closed form."""

TOP_OF_RUN = 0.97
"""Quantile of the magnitude of speed and load that a planned run takes for its top."""

SCALES_TRIED = (0.5, 1.0, 1.5)
"""Multiples of the speed and of the load of the campaign that are tried for the next run. [1]"""


def stage_causes(fit: StageFit) -> tuple[NamedCause, ...]:
    """Every suspect of the best set with its numbers, the one that closes most first."""
    found, suspects = fit.found, fit.data.suspects
    posterior, gap = (
        posterior_of(found, found.best),
        max(float(np.sum(fit.data.judged.gap**2)), 1e-300),
    )
    several = _stabilities(fit) if found.best.names else {}
    closed, causes = 1.0 - float(np.sum(fit.residual(found.best) ** 2)) / gap, []
    for name in found.best.names:
        without = found.without(name)
        ablation, alike = (
            1.0 - float(np.sum(fit.residual(without) ** 2)) / gap,
            _look_alikes(fit, name),
        )
        stability, numbers = several[name], parameters_of(posterior, suspects[name], name)
        doubtful = stability.trends or any(number.beyond_range for number in numbers.values())
        most = OPEN if doubtful else AMBIGUOUS if alike else 1.0
        causes.append(
            NamedCause(
                effect=name,
                stage=suspects[name].stage,
                probability=min(chance_with(fit.probability, name), most),
                parameters=numbers,
                weight=closed - ablation,
                stability=stability,
                look_alikes=alike,
                ablation=ablation,
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def is_material(fit: StageFit, cause: str) -> bool:
    """Whether the power that a cause takes is a share of that of its stages that matters."""
    rows, best = fit.data.fitted, fit.found.best
    column = rows.columns[:, fit.data.names.index(cause)]
    powers = column * best.x[best.place[cause]], rows.gap + rows.given
    taken, flowing = (np.bincount(rows.path, x**2) for x in powers)
    return bool(np.any((taken > 0.0) & (taken >= MATERIAL**2 * flowing)))


def is_steady(cause: NamedCause) -> bool:
    """Whether the number of a cause is plausible, and about the same in every cycle."""
    number = next(iter(cause.parameters.values()))
    changes = [abs(trend.change) for trend in cause.trends]
    return not (number.beyond_range or number.at_limit) and max(
        changes, default=0.0
    ) <= UNSTEADY_SHARE * abs(number.value)


def _look_alikes(fit: StageFit, name: str) -> tuple[Alternative, ...]:
    """Suspects that explain the logs without a cause, the most likely first: those of the smallest
    sets for which the evidence is not clearly lower, and those that fit as well in its place, as a
    prior must not hide that logs do not distinguish them.
    """
    found, chosen = fit.found, fit.found.best.names
    least = fit.probability[chosen] * math.exp(-AS_GOOD)
    good = [names for names, p in fit.probability.items() if name not in names and p >= least]
    smallest = [names for names in good if not any(set(other) < set(names) for other in good)]
    best: dict[str, Names] = {}
    for names in sorted(smallest, key=lambda names: -fit.probability[names]):
        for other in names:
            if other not in chosen:
                best.setdefault(other, names)
    swaps = {other: swap(chosen, name, other) for other in fit.data.names if other not in chosen}
    rated = found.expansion.rated(swaps.values())
    near = sorted(swaps, key=lambda other: -rated[swaps[other]])[:ALTERNATIVES_FITTED]
    for other in near:
        if found.fit(swaps[other]).loss - found.best.loss <= AS_GOOD * found.scale:
            best.setdefault(other, swaps[other])
    return tuple(
        Alternative(other, chance_with(fit.probability, other), _difference(fit, names))
        for other, names in best.items()
    )


def _difference(fit: StageFit, other: Names) -> Spot:
    """In which path and phase the best set and another one differ most, as a root mean square."""
    rows = fit.data.rows
    squares = (fit.power(rows, fit.found.best) - fit.power(rows, fit.found.fit(other))) ** 2
    sums, counts = (np.bincount(rows.kind, x) for x in (squares, np.ones(squares.size)))
    worst = int(np.argmax(sums))
    path, phase = fit.data.named(worst)
    return Spot(path.channel, phase, bias=math.sqrt(float(sums[worst] / counts[worst])))


# --------------------------------------------------------------------------------- cycle by cycle
def _stabilities(fit: StageFit) -> dict[str, Stability]:
    """The number of each cause from every cycle alone, the other numbers as the joint fit has them.

    The noise within the phases, not the scatter of their means, is the uncertainty: the scatter is
    what is looked for. Withheld cycles count too: they only show here whether the numbers are the
    same.
    """
    data, best = fit.data, fit.found.best
    noise = noise_of(data, data.rows)
    rows, columns = noise.whitened(noise.within), fit.columns_of(best)
    given = rows[:, -1] - rows[:, columns] @ best.x - rows[:, len(data.names) : -1] @ best.nu
    cycles = np.unique(data.rows.blocks.cycle)
    cycle, weight = (
        noise.fold // -(-FOLDS // cycles.size),
        weights(given),
    )  # the folds of a cycle together
    found = {}
    for k, name in enumerate(best.names):
        column = rows[:, columns[k]]
        height = np.maximum(np.bincount(cycle, weight * column**2, cycles.size), 1e-300)
        values = best.x[k] + np.bincount(cycle, weight * column * given, cycles.size) / height
        u = np.hypot(height**-0.5, LAW * best.x[k])
        known, whole = (
            COVERED * u < 2.0 * best.free.sd[k],
            with_values(data.suspects[name], np.zeros(1)).reported,
        )
        runs = [
            RunValue(row, whole + x, whole + x - half, whole + x + half) if good else RunValue(row)
            for row, (x, half, good) in enumerate(
                zip(values.tolist(), (COVERED * u).tolist(), known, strict=True)
            )
        ]
        order = np.flatnonzero(known)
        order = (order - order.min(initial=0)) / max(int(np.ptp(order)) if order.size else 1, 1)
        trends, _ = trends_of(values[known], np.diag(u[known] ** 2), {"order": order})
        found[name] = Stability(tuple(runs), tuple(trends))
    return found


# ----------------------------------------------------------------------------------- the next run
def plan(fit: StageFit, causes: tuple[NamedCause, ...]) -> Experiment | None:
    """Choose the speed and the load at which the causes and the set that comes nearest with one of
    them swapped differ most.

    The rows of the campaign are scaled: a signal that grows with the motion by its multiple, one
    that grows with the load by its.
    """
    chosen, data = fit.found.best.names, fit.data
    others = [name for name in data.names if name not in chosen]
    swaps = [
        (swap(chosen, cause.effect, other), cause.effect, other)
        for cause in causes
        for other in others
    ]
    if not swaps or data.beside_model:
        return None
    rated = fit.found.expansion.rated(names for names, _, _ in swaps)
    swapped, name, other = max(swaps, key=lambda one: rated[one[0]])
    tried = {
        pair: _significance(fit, fit.found.fit(swapped), *pair)
        for pair in product(SCALES_TRIED, SCALES_TRIED)
    }
    motion, load = max(tried, key=lambda pair: tried[pair])
    path = data.laws[name].paths[0]
    rows = data.fitted.some(data.fitted.path == path)
    top, pull = (
        float(np.quantile(np.abs(x), TOP_OF_RUN)) if x.size else math.nan for x in rows.axes.T
    )
    z, axes = tried[motion, load], data.axes[path]
    return Experiment("scaled", motion * top, (name, other), z, force=load * pull, axes=axes)


def _significance(fit: StageFit, other: Fit, motion: float, load: float) -> float:
    """Significance with which a run distinguishes the best set from another one, whose numbers may
    adapt. [sigma]

    Parameters
    ----------
    motion, load : multiples of those of the campaign [1]
    """
    best, data = fit.found.best, fit.data
    factors = np.array([_factor(one, motion, load) for one in data.laws.values()])
    planned = fit.rows[:, : factors.size] * factors
    j = planned[:, fit.columns_of(other)]
    z = planned[:, fit.columns_of(best)] @ best.x - j @ other.x
    pull, precision = j.T @ z, np.linalg.pinv(fit.covariance(other), hermitian=True)
    return math.sqrt(
        max(float(z @ z - pull @ np.linalg.pinv(j.T @ j + precision, hermitian=True) @ pull), 0.0)
    )


def _factor(suspected: Suspected, motion: float, load: float) -> float:
    """Multiple of the power of a law where motion and load are multiples of those of the
    campaign.
    """
    law = suspected.law
    if law.kind == "gain":
        return motion * load
    if law.kind == "zero":
        return load if suspected.of_motion else motion
    powers = {name: (2 if law.kind == "store" else power) for name, power in law.over.items()}
    scales = {"power": motion * load} | {
        name: motion if grows else load for name, grows in MOTIONS.items()
    }
    return math.prod(scales[name] ** power for name, power in powers.items())
