"""What is reported of each cause: its probability, its numbers, and the suspects that explain
the same data as well.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import Alternative, NamedCause, Names, Reported, Spot
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.covariance import covariance_of
from winchcascade.diagnosis.fit.entries import is_entry, same_in_logs
from winchcascade.diagnosis.fit.evidence import Fit, inside_of, prior_beyond_range, usual_gain
from winchcascade.diagnosis.fit.marginal import are_together, weights
from winchcascade.diagnosis.fit.nuisances import quantity_of
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.search import Found
from winchcascade.diagnosis.fit.suspects import freedom, varied, with_values
from winchcascade.diagnosis.judge.closure import share_closed
from winchcascade.diagnosis.verdict_limits import AS_GOOD, LAW, MIN_RUNS, UNCONFUSED
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.parts import IN_RIG, number_of, path_in_rig

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.fit.undetermined import Direction
    from winchcascade.rig.effects.effect import Effect

SAME_FIT = 0.3
"""Two explanations that differ by less are the same: fits end within it. [sigma]"""

ENTRIES = "entry"
"""Stage of wrong entries."""

ALTERNATIVES_REFITTED = 4
"""Maximum number of alternatives of each cause that are refitted, nearest first by the closed
form.
"""

COVERED = 1.96
"""Standard deviations on either side of a 95 % interval."""

ONE_SIDED = 1.645
"""Standard deviations on the open side of a one-sided 95 % interval."""


OPEN_SHARE = 1.0 / (1.0 + 0.25)
"""Share of the variance of its prior above which a number is not determined: the data add less
than a quarter to what was known before. [1]"""


class LookAlike(NamedTuple):
    """A set with other suspects in place of a cause: its fit, and by how much evidence it falls
    short of the best [nats].
    """

    fit: Fit
    short: float


def causes_of(
    data: Fitted, found: Found, directions: Sequence[Direction]
) -> tuple[NamedCause, ...]:
    """Every cause of the best set: wrong entries first, then the most important.

    The posterior of a cause is no larger than its look-alikes leave: a prior or the exact form of a
    law must not hide them.
    """
    best, suspects, swapped = found.best, found.problem.suspects, look_alikes_of(found)
    without = {name: found.without(name) for name in best.names}
    odds = {
        name: 1.0 + sum(map(_weight, swapped[name])) + _unseen(data, name) for name in best.names
    }
    chance, posterior = chances_of(found), posterior_of(found, best)
    product_of = partial(_product, data, directions, posterior)
    causes = [
        NamedCause(
            effect=name,
            stage=suspects[name].stage,
            probability=min(chance_with(chance, name), 1.0 / odds[name]),
            parameters=parameters_of(posterior, suspects[name], name)
            | product_of(suspects[name], name),
            look_alikes=tuple(
                _named(data, found, one.fit, name, _weight(one) / odds[name])
                for one in swapped[name]
            ),
            weight=without[name].loss - best.loss,
            ablation=share_closed(data, suspects, without[name]),
        )
        for name in best.names
    ]
    return tuple(sorted(causes, key=lambda cause: (cause.stage != ENTRIES, -cause.weight)))


def look_alikes_of(found: Found) -> dict[str, list[LookAlike]]:
    """Look-alikes of each cause of the best set, best first; fits that they need are kept."""
    return {name: _look_alikes(found, name, found.without(name)) for name in found.best.names}


def _weight(one: LookAlike) -> float:
    """Posterior odds of a look-alike over the cause, which it does not exceed. [1]"""
    return math.exp(-max(one.short, 0.0))


def _unseen(data: Fitted, name: str) -> float:
    """Posterior odds over a cause of what changes from run to run and looks like it, where the runs
    are too few to suspect it: fewer logs must not make a cause more certain. [1]
    """
    if len(data.rows) >= MIN_RUNS:
        return 0.0
    over_runs = [other for other, effect in EFFECTS.items() if effect.over_runs is not None]
    return math.exp(-AS_GOOD) * sum(same_in_logs(name, other) for other in over_runs)


def chances_of(found: Found) -> dict[Names, float]:
    """Posterior probability of each set among those that were fitted."""
    return probabilities({names: found.evidence.of(fit) for names, fit in found.sets().items()})


def probabilities(evidence: Mapping[Names, float]) -> dict[Names, float]:
    """Posterior probability of each of some sets, by the logarithm of its evidence. [1]"""
    each = np.array([*evidence.values()])
    odds = np.exp(np.maximum(each - each.max(), -700.0))
    return dict(zip(evidence, (odds / odds.sum()).tolist(), strict=True))


def chance_with(probability: Mapping[Names, float], name: str) -> float:
    """Probability of all sets that contain a suspect. [1]"""
    return sum(p for names, p in probability.items() if name in names)


# ----------------------------------------------------------------------------- numbers of a cause
class Posterior(NamedTuple):
    """What the data leave open of the fields of a fit: `covariance` (k, k), `curve` (k, k),
    `slope` (k,) of the objective.
    """

    fit: Fit
    covariance: Signal
    curve: Signal
    slope: Signal


def posterior_of(found: Found, fit: Fit) -> Posterior:
    """What the data leave open of the fields of a fit."""
    columns = found.columns(fit)
    weighted, prior = columns * weights(fit.r)[:, None], fit.free.sd**-2.0
    return Posterior(
        fit,
        covariance_of(found, fit, columns),
        weighted.T @ columns / found.scale + np.diag(prior),
        -weighted.T @ fit.r / found.scale - prior * (fit.x - fit.free.absent),
    )


def parameters_of(posterior: Posterior, effect: Effect, name: str) -> dict[str, Reported]:
    """What is reported of one cause, with 95 % intervals, and with the uncertainty `LAW` of its
    law.

    A wrong entry follows no law of nature.
    """
    place = posterior.fit.place[name]
    x, reported = posterior.fit.x[place], {}
    value, absent = (with_values(effect, at).reported for at in (x, freedom(effect).absent))
    law = max(LAW, effect.law_u) * abs(value - absent) if effect.entry is None else 0.0
    reported[effect.parameter] = _interval(
        posterior, place, slope_of_reported(effect, x), (value, law), effect.unit
    )
    for k, field in enumerate(effect.fields):
        if field.name in effect.beside:
            number = float(x[k]), LAW * abs(float(x[k]) - field.absent)
            reported[field.name] = _interval(
                posterior, place, np.eye(x.size)[k], number, field.unit
            )
    return reported


def _product(
    data: Fitted, directions: Sequence[Direction], posterior: Posterior, effect: Effect, name: str
) -> dict[str, Reported]:
    """The product of two numbers that the logs know together alone, where a cause changes one of
    them by a share of it.
    """
    for direction in directions:
        pair = direction.product
        if pair is None or effect.path not in pair or effect.fields[0].operation != "scale":
            continue
        stated = math.prod(number_of(data.nominal, path) * IN_RIG.get(path, 1.0) for path in pair)
        place, (first, second) = (
            posterior.fit.place[name],
            (path_in_rig(path).split(".")[1] for path in pair),
        )
        change = float(posterior.fit.x[place][0])
        gradient = stated * np.eye(len(effect.fields))[0]
        law = 0.0 if effect.entry is not None else LAW * abs(stated * change)
        number = stated * (1.0 + change), law
        return {
            f"{second}_x_{first}": _interval(
                posterior, place, gradient, number, _unit_of(data.rig, pair)
            )
        }
    return {}


def _unit_of(rig: Rig, pair: tuple[str, str]) -> str:
    """Unit of the product of two numbers of a rig file."""
    numbers = [quantity_of(rig, *path_in_rig(path).split(".")) for path in pair]
    units = [number.unit for number in numbers if number is not None and number.unit != "1"]
    return ".".join(units) or "1"


def _interval(
    posterior: Posterior, place: slice, gradient: Signal, of: tuple[float, float], unit: str
) -> Reported:
    """A number that follows from the fields of a cause, with its 95 % interval.

    The interval is infinite where the data do not determine the number, and one-sided where one
    field at a bound gives it.

    Parameters
    ----------
    gradient : (k,) derivative of the number over the fields
    of : the number, and the standard uncertainty of its law
    """
    (value, law), fit = of, posterior.fit
    free, x = fit.free.some(range(place.start, place.stop)), fit.x[place]
    used, variance = (
        np.flatnonzero(gradient),
        float(gradient @ posterior.covariance[place, place] @ gradient),
    )
    margin = 1e-9 * (free.high - free.low)
    at = (x >= free.maximum - margin) * 1 - (x <= free.minimum + margin) * 1
    beyond = bool(np.any(((x > free.high) | (x < free.low)) & (gradient != 0.0)))
    if variance > OPEN_SHARE * float(np.sum((gradient * free.sd) ** 2)):
        return Reported(value, -math.inf, math.inf, unit, beyond_range=beyond)
    if used.size == 1 and at[used[0]]:
        slope = float(gradient[used[0]])
        away = math.hypot(
            abs(slope) * _one_sided(posterior, place.start + int(used[0])),
            ONE_SIDED / COVERED * law,
        )
        upper = bool(at[used[0]] * slope > 0.0)
        number = Reported(value, value - away * upper, value + away * (not upper), unit)
        if abs(x - free.absent)[used[0]] <= margin[used[0]]:
            return number
        return msgspec.structs.replace(number, at_limit="high" if upper else "low")
    u = COVERED * math.sqrt(max(variance, 0.0) + law**2)
    return Reported(value, value - u, value + u, unit, beyond_range=beyond)


def _one_sided(posterior: Posterior, k: int) -> float:
    """How far below a bound that it is pushed against a field lies with a probability of 5 %, in
    its unit.

    The posterior there is a normal one cut off at the bound, beyond which its maximum lies.
    """
    from scipy.special import log_ndtr, ndtri_exp

    others, curve = inside_of(posterior.fit), posterior.curve
    across = curve[k, others]
    left = float(curve[k, k] - across @ np.linalg.solve(curve[np.ix_(others, others)], across))
    sd = 1.0 / math.sqrt(left)
    beyond = abs(float(posterior.slope[k])) * sd
    return sd * (-float(ndtri_exp(math.log(0.05) + log_ndtr(-beyond))) - beyond)


def slope_of_reported(effect: Effect, values: Signal) -> Signal:
    """Derivative of the reported number of a suspect over its fields, (k,)."""
    value = with_values(effect, values).reported
    return np.array(
        [(moved.reported - value) / step for moved, step in varied(effect, values, 1e-3)]
    )


# ------------------------------------------------------------------------------------ look-alikes
def _look_alikes(found: Found, name: str, without: Fit) -> list[LookAlike]:
    """Sets of equal size without one cause that are about as good, best first.

    Where one of the two is a wrong entry only the fit counts, as a prior must not hide that the
    logs cannot distinguish them. Suspects that change numbers which the logs know together alone
    always explain each other: the logs are the same with the other numbers of that direction moved
    too. Two of one class explain each other if the fit keeps most of what the cause explains: the
    exact form of their laws is not known so well. A suspect that falls short because its number
    lies beyond its range is an alternative too: the range says what is plausible, and the logs do
    not contradict it.
    """
    best, problem, expansion = found.best, found.problem, found.expansion
    others = [other for other in problem.suspects if other not in best.names]
    same = [other for other in others if same_in_logs(name, other)]
    together = [other for other in others if are_together(problem.exclusive, name, other)]
    swaps = {other: swap(best.names, name, other) for other in others if other not in same}
    rated = expansion.rated([best.names, *swaps.values()])
    foreseen: dict[str, float] = {}
    for other, swapped in swaps.items():
        foreseen[other] = rated[best.names] - rated[swapped]
        if is_entry(name) or is_entry(other):
            foreseen[other] += problem.price(name) - problem.price(other)
    near = [other for other in foreseen if foreseen[other] < 4.0 * AS_GOOD]
    near = sorted(near, key=lambda other: foreseen[other])[:ALTERNATIVES_REFITTED]
    alike = []
    for other in dict.fromkeys((*near, *same, *together)):
        start = _start(found, name, other) if other in same else None
        fit = found.fit(swap(best.names, name, other), start)
        if is_entry(name) or is_entry(other):
            short = _short_by_fit(found, fit, other, other in together)
        else:
            short = _short_by_evidence(found, fit, without, other in same)
        alike.append(LookAlike(fit, short))
    alike += [
        LookAlike(fit, found.evidence.of(best) - found.evidence.of(fit))
        for names, fit in found.sets().items()
        if len(names) == len(best.names)
        and name not in names
        and len(set(names) - set(best.names)) > 1
    ]
    return sorted((one for one in alike if one.short <= AS_GOOD), key=lambda one: one.short)


def _short_by_fit(found: Found, fit: Fit, other: str, is_together: bool) -> float:
    """By how much a set with another suspect in place of a cause fits worse, of which one is a
    wrong entry. [nats]
    """
    suspects = found.problem.suspects
    usual = usual_gain(suspects, fit.names, fit.x, fit.free.sd, fit.curve / found.scale)
    unusual = -min(usual, 0.0)
    short = (fit.loss - found.best.loss) / found.scale + unusual
    if not is_together:
        return short
    return min(short, AS_GOOD + unusual * (suspects[other].fields[0].usual_share == 1.0))


def _short_by_evidence(found: Found, fit: Fit, without: Fit, is_same: bool) -> float:
    """By how much evidence a set with another suspect in place of a cause falls short. [nats]"""
    best = found.best
    short = found.evidence.of(best) - found.evidence.of(fit)
    nearly = UNCONFUSED * (without.loss - best.loss) + AS_GOOD * found.scale
    held_back = short - prior_beyond_range(fit) <= AS_GOOD
    if held_back or (is_same and fit.loss - best.loss < nearly):
        return min(short, AS_GOOD)
    return short


def _start(found: Found, name: str, other: str) -> dict[str, Signal]:
    """Where the fit of a suspect that looks the same in place of a cause begins.

    Where both change one number by a share of it, that is the same change or its inverse, so that
    no expansion about the absent effect is needed.
    """
    suspects, share = found.problem.suspects, found.best.x[found.best.place[name]]
    if not (is_entry(name) or is_entry(other)) or len(suspects[name].fields) != len(
        suspects[other].fields
    ):
        return {}
    kept = [one for of, one in found.best.acting(suspects).items() if of != name]
    changes = share, 1.0 / (1.0 + share) - 1.0
    z = found.problem.residuals(
        [[*kept, with_values(suspects[other], change)] for change in changes], found.marginal.place
    )
    return {other: changes[int(np.argmin(np.sum(z**2, axis=0)))]}


def swap(names: Names, name: str, other: str) -> Names:
    """A set with another suspect in place of one."""
    return tuple(sorted((*(n for n in names if n != name), other)))


def _named(data: Fitted, found: Found, other: Fit, name: str, probability: float) -> Alternative:
    """The alternative of a fit, and where the two differ most; nowhere if nothing that the logs
    measure distinguishes them.

    Where the fit has several other suspects, the first that takes the place of the cause.
    """
    best = found.best
    gone, new = (
        sorted(set(a) - set(b)) for a, b in ((best.names, other.names), (other.names, best.names))
    )
    effect = new[min(gone.index(name), len(new) - 1)]
    number = _number_in(found, other, effect)
    if are_together(found.problem.exclusive, name, effect):
        return Alternative(effect, probability, None, number)
    clearest: Spot | None = None
    difference = (best.z - other.z).reshape(-1, len(CHANNELS))
    for log, k, phase, here in data.cells():
        size = float(np.sqrt(np.sum(difference[here, k] ** 2)))
        if size > (clearest.z if clearest else 0.0):
            clearest = Spot(CHANNELS[k], PHASES[phase], data.logs[log].load, z=size)
    seen = clearest if clearest and clearest.z > SAME_FIT else None
    return Alternative(effect, probability, seen, number)


def _number_in(found: Found, fit: Fit, name: str) -> Reported:
    """The number of one suspect of a fit, without an interval."""
    effect, own = found.problem.suspects[name], fit.place[name]
    free, x = fit.free.some(range(own.start, own.stop)), fit.x[own]
    decides = slope_of_reported(effect, x) != 0.0
    beyond = bool(np.any(decides & ((x > free.high) | (x < free.low))))
    value = with_values(effect, x).reported
    return Reported(value, -math.inf, math.inf, effect.unit, beyond_range=beyond)
