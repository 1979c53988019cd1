"""What is reported of each cause: its probability, its numbers, the suspects that explain the same data as well, and the run
that would best distinguish the leading cause from its strongest alternative.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.block_means import PHASES, blocks_of
from winchcascade.diagnosis.closure import share_closed
from winchcascade.diagnosis.diagnosis_result import Alternative, Experiment, NamedCause, Names, Reported, Spot
from winchcascade.diagnosis.entries import LOAD, is_entry, same_in_logs
from winchcascade.diagnosis.evidence import Fit, Found, RigProblem, fit_set, inside_of
from winchcascade.diagnosis.predict import CHANNELS, Course
from winchcascade.diagnosis.solve import Bounds, Jacobian, Quadratic, huber, normal_equations, quadratic, weights
from winchcascade.diagnosis.suspects import Suspects, freedom, varied, with_values
from winchcascade.rig.effects.run_order import warming

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.rig.effects.effect import Effect
    from winchcascade.rig.parts import Model

ALIKE = 0.3
"""Two explanations that differ by less are the same: fits end within it. [sigma]"""

ENTRIES = "entry"
"""Stage of wrong entries."""

AS_GOOD = 3.0
"""Evidence by which a set may fall short of the best and still be an alternative: odds of twenty to one."""

TRIED = 4
"""Maximum number of alternatives of each cause that are refitted, nearest first by the closed form."""

UNCONFUSED = 0.1
"""Two suspects of nearly the same law explain each other if one in place of the other loses less than this share of what that
explains: the exact form of neither is known so well. [1]"""

SAME_ORDER = 0.9
"""Rank correlation from which the order of the runs is that of their loads: one pair of neighbours of seven may be swapped."""

ORDER_ALONE = (1e6, 0.0)
"""Time constant and share by the current with which warming follows the order of the runs alone. [1]"""

LAW = 0.01
"""No rig follows the law of an effect exactly: minimum standard uncertainty of what an effect does, as a share of it. Assumed;
about the scatter of twins that follow laws of their own."""

COVERED = 1.96
"""Standard deviations on either side of a 95 % interval."""

ONE_SIDED = 1.645
"""Standard deviations on the open side of a one-sided 95 % interval."""

FEW = 10
"""Minimum number of phases of cycles for an estimate of their scatter."""

SPEEDS = (0.5, 1.0, 1.3)
"""Plateau speeds that are tried, as shares of the fastest of the campaign."""

RAMP, HOLD, REST = 1.5, 4.0, 2.0
"""Ramp of a planned payout, hold and rest before it [s]."""

BACK = 0.6
"""Haul-in of a planned cycle, as a share of the speed of its payout."""


class LookAlike(NamedTuple):
    """A set with other suspects in place of a cause: its fit, and by how much evidence it falls short of the best [nats]."""

    fit: Fit
    short: float


def causes_of(data: Fitted, suspects: Suspects, found: Found) -> tuple[NamedCause, ...]:
    """Every cause of the best set: wrong entries first, then the most important.

    The posterior of a cause is no larger than its look-alikes leave: a prior or the exact form of a law must not hide them.
    """
    best = found.best
    without = {name: _refit(data, suspects, found, tuple(n for n in best.names if n != name)) for name in best.names}
    swapped = {name: _look_alikes(data, suspects, found, name, without[name]) for name in best.names}
    refitted = {one.fit.names: one.fit for several in swapped.values() for one in several}
    chance = probabilities({**found.fits, **refitted}, found.scale)
    causes = [
        NamedCause(
            effect=name,
            stage=suspects[name].stage,
            probability=min(sum(p for names, p in chance.items() if name in names), 1.0 / _odds(swapped[name])),
            parameters=parameters_of(data, suspects, best, name, found.scale),
            look_alikes=tuple(
                _named(data, best, one.fit, name, _weight(one) / _odds(swapped[name])) for one in swapped[name]
            ),
            weight=without[name].loss - best.loss,
            ablation=share_closed(data, suspects, without[name]),
        )
        for name in best.names
    ]
    return tuple(sorted(causes, key=lambda cause: (cause.stage != ENTRIES, -cause.weight)))


def _weight(one: LookAlike) -> float:
    """Posterior odds of a look-alike over the cause, which it does not exceed. [1]"""
    return math.exp(-max(one.short, 0.0))


def _odds(look_alikes: Sequence[LookAlike]) -> float:
    """Posterior odds of a cause and all its look-alikes over the cause. [1]"""
    return 1.0 + sum(map(_weight, look_alikes))


def probabilities(fits: dict[Names, Fit], scale: float) -> dict[Names, float]:
    """Posterior probability of each set among those that were fitted."""
    evidence = np.array([fit.evidence(scale) for fit in fits.values()])
    odds = np.exp(np.maximum(evidence - evidence.max(), -700.0))
    return dict(zip((tuple(sorted(names)) for names in fits), (odds / odds.sum()).tolist(), strict=True))


def parameters_of(data: Fitted, suspects: Suspects, fit: Fit, name: str, scale: float) -> dict[str, Reported]:
    """What is reported of one cause, with 95 % intervals, and with the uncertainty `LAW` of its law.

    A field at a bound counts as known, unless the reported number follows from it alone: its interval is then one-sided.
    A wrong entry follows no law of nature.
    """
    effect = suspects[name]
    fields = [field.name for field in effect.fields]
    return _parameter_of(data, suspects, fit, name, scale) | {
        other: _field_of(data, suspects, fit, (name, fields.index(other)), scale) for other in effect.beside
    }


def _field_of(data: Fitted, suspects: Suspects, fit: Fit, at: tuple[str, int], scale: float) -> Reported:
    """What is reported of one field of a cause beside its parameter, with its 95 % interval."""
    name, number = at
    field, k = suspects[name].fields[number], fit.place[name].start + number
    value = float(fit.x[k])
    end = _limit_of(value, field.absent, fit.bounds.some(slice(k, k + 1)))
    if end:
        away = one_sided(fit, k, scale)
        return Reported(
            value, value - away * (end > 0), value + away * (end < 0), field.unit, "high" if end > 0 else "low"
        )
    u = COVERED * math.hypot(
        math.sqrt(max(float(covariance_of(data, fit, scale)[k, k]), 0.0)), LAW * (value - field.absent)
    )
    beyond = bool(fit.bounds.excess(fit.x)[k] > 0.0)
    return Reported(value, value - u, value + u, field.unit, beyond_range=beyond)


def _parameter_of(data: Fitted, suspects: Suspects, fit: Fit, name: str, scale: float) -> dict[str, Reported]:
    """The parameter that is reported of one cause, by its name."""
    effect, place = suspects[name], fit.place[name]
    x, bounds = fit.x[place], fit.bounds.some(place)
    value, absent = (with_values(effect, at).reported for at in (x, freedom(effect).absent))
    gradient = slope_of_reported(effect, x)
    of_law = LAW * abs(value - absent) if effect.entry is None else 0.0
    if np.count_nonzero(gradient) == 1:
        k = int(np.flatnonzero(gradient)[0])
        end = _limit_of(x[k], freedom(effect).absent[k], bounds.some(slice(k, k + 1)))
        if end:
            away = abs(float(gradient[k])) * one_sided(fit, place.start + k, scale)
            away = math.hypot(away, ONE_SIDED / COVERED * of_law)
            upper = end * float(gradient[k]) > 0.0
            low, high = (value - away, value) if upper else (value, value + away)
            return {effect.parameter: Reported(value, low, high, effect.unit, "high" if upper else "low")}
    variance = float(gradient @ covariance_of(data, fit, scale)[place, place] @ gradient)
    u = COVERED * math.hypot(math.sqrt(max(variance, 0.0)), of_law)
    beyond = bool(np.any(bounds.excess(x)[gradient != 0.0] > 0.0))
    return {effect.parameter: Reported(value, value - u, value + u, effect.unit, beyond_range=beyond)}


def _limit_of(x: float, absent: float, bounds: Bounds) -> int:
    """1 for a field at an upper bound, -1 at a lower one, 0 between them or where the effect is absent."""
    eps = 1e-9 * float(bounds.inner_high[0] - bounds.inner_low[0])
    if abs(x - absent) <= eps:
        return 0
    upper, lower = (min(abs(x - float(end[0])) for end in ends) <= eps for ends in _ends(bounds))
    return int(upper) - int(lower)


def _ends(bounds: Bounds) -> tuple[tuple[Signal, Signal], tuple[Signal, Signal]]:
    """Upper and lower bounds, the outer and the inner one of each."""
    return (bounds.high, bounds.inner_high), (bounds.low, bounds.inner_low)


def one_sided(fit: Fit, k: int, scale: float) -> float:
    """How far below a bound that it is pushed against a field lies with a probability of 5 %, in its unit.

    The posterior there is a normal one cut off at the bound, beyond which its maximum lies.
    """
    from scipy.special import log_ndtr, ndtri_exp

    others = inside_of(fit.x, fit.bounds)
    across = fit.curve[k, others]
    curve = float(fit.curve[k, k] - across @ np.linalg.pinv(fit.curve[np.ix_(others, others)], hermitian=True) @ across)
    sd = 1.0 / math.sqrt(max(curve / scale, 1e-300))
    beyond = abs(float(fit.slope[k])) / scale * sd
    return sd * (-float(ndtri_exp(math.log(0.05) + log_ndtr(-beyond))) - beyond)


def slope_of_reported(effect: Effect, values: Signal) -> Signal:
    """Derivative of the reported number of a suspect over its fields, (k,)."""
    value = with_values(effect, values).reported
    return np.array([(moved.reported - value) / step for moved, step in varied(effect, values, 1e-3)])


def covariance_of(data: Fitted, fit: Fit, scale: float) -> Signal:
    """Covariance of all fields of a fit, (k, k): what its data leave, nuisances included; 0 for fields at a bound.

    Residuals of one phase of a cycle are no independent numbers, in spite of the whitening: the variance of a field is at least
    that of the sums of the scores of these phases (Liang and Zeger 1986).
    """
    inside = np.flatnonzero(inside_of(fit.x, fit.bounds))
    covariance = np.zeros((fit.x.size, fit.x.size))
    if inside.size:
        within = np.ix_(inside, inside)
        inverse = np.linalg.pinv(fit.curve[within], hermitian=True)
        own, together = scale * np.diag(inverse), np.diag(inverse @ _scattered(data, fit)[within] @ inverse)
        grown = np.sqrt(np.maximum(together / np.maximum(own, 1e-300), 1.0))
        covariance[within] = scale * inverse * np.outer(grown, grown)
    return covariance


def joint_covariance(data: Fitted, fit: Fit, scale: float) -> Signal:
    """Covariance of all fields of a fit and then of its nuisances, (k + n, k + n): these follow the fields, and scatter about
    that as the data and their tolerances leave them.
    """
    fields, (q, _, _) = covariance_of(data, fit, scale), _expanded(data, fit)
    own = np.eye(fit.nu.size)
    inner = np.linalg.inv((q.inner - own) / scale + own)
    return np.block([[fields, -fields @ q.back.T], [-q.back @ fields, q.back @ fields @ q.back.T + inner]])


def _expanded(data: Fitted, fit: Fit) -> tuple[Quadratic, Jacobian, Signal]:
    """The objective of a fit in its own fields and nuisances, and the columns of nuisances and fields."""
    j_phi = np.hstack([np.zeros((fit.z.size, 0)), *(fit.columns[name] for name in fit.names)])
    j_nu = fit.j_nu or data.jacobian(fit.nu, [])
    return quadratic(*normal_equations(fit.z, j_nu.beside(j_phi), fit.nu), fit.nu.size), j_nu, j_phi


def _scattered(data: Fitted, fit: Fit) -> Signal:
    """Scatter of the slope of the objective over the fields of a fit, (k, k): of phases of cycles, and of the priors."""
    expanded, j_nu, j_phi = _expanded(data, fit)
    back = expanded.back
    scores = (weights(fit.z) * fit.z)[:, None] * (j_phi - j_nu @ back)
    stretch = np.cumsum(~data.blocks.joined) - 1
    total = np.zeros((int(stretch[-1]) + 1, j_phi.shape[1]))
    np.add.at(total, np.repeat(stretch, len(CHANNELS)), scores)
    total = total[np.any(total != 0.0, axis=1)]
    count = total.shape[0]
    return count / (count - 1.0) * total.T @ total + back.T @ back if count >= FEW else np.zeros_like(fit.curve)


def _look_alikes(data: Fitted, suspects: Suspects, found: Found, name: str, without: Fit) -> list[LookAlike]:
    """Sets of equal size without one cause that are about as good, best first.

    Where one of the two is a wrong entry only the fit counts, as a prior must not hide that the logs cannot distinguish them.
    Two whose laws are nearly the same explain each other if the fit keeps most of what the cause explains. A change with the
    order of the runs and one with the load always do where these are the same sequence: only the exact form of both
    distinguishes them.
    """
    best, scale, linear = found.best, found.scale, found.linear
    swapped = {other: _swap(best.names, name, other) for other in suspects if other not in best.names}
    same = [other for other in swapped if same_in_logs(suspects, name, other)]
    confused = [other for other in swapped if _confused(data, suspects, name, other)]
    short = {other: linear.evidence(best.names, scale) - linear.evidence(swapped[other], scale) for other in swapped}
    entries = [other for other in swapped if is_entry(name) or is_entry(other)]
    short |= {other: (linear.best(swapped[other])[0] - linear.best(best.names)[0]) / scale for other in entries}
    near = sorted(
        (other for other in short if short[other] < 4.0 * AS_GOOD and other not in same), key=lambda r: short[r]
    )
    fits = {other: _refit(data, suspects, found, swapped[other]) for other in (*near[:TRIED], *confused)}
    fits |= {other: _refit_same(data, suspects, found, name, other) for other in same}
    by_size = [fit for names, fit in found.fits.items() if len(names) == len(best.names) and name not in names]
    several = [fit for fit in by_size if len(set(fit.names) - set(best.names)) > 1]
    found_alike = [LookAlike(fit, best.evidence(scale) - fit.evidence(scale)) for fit in several]
    for other, fit in fits.items():
        by_evidence, lost = best.evidence(scale) - fit.evidence(scale), fit.loss - best.loss
        if other in entries:
            by_evidence = lost / scale - min(fit.gain(scale), 0.0)
        elif other in confused or (other in same and lost < UNCONFUSED * (without.loss - best.loss)):
            by_evidence = min(by_evidence, AS_GOOD)
        found_alike.append(LookAlike(fit, by_evidence))
    return sorted((one for one in found_alike if one.short <= AS_GOOD), key=lambda one: one.short)


def _confused(data: Fitted, suspects: Suspects, name: str, other: str) -> bool:
    """Whether of two suspects one changes with the order of the runs and the other with the current, and these are the same."""
    pair = {suspects[name].name, suspects[other].name}
    return pair == {"heating", "ke_rolloff"} and abs(order_of_loads(data)) > SAME_ORDER


def order_of_loads(data: Fitted) -> float:
    """Rank correlation (Spearman 1904) of the conductance of the loads with the warming of the machine over the runs. [1]"""
    from scipy.stats import rankdata

    taking = [k for k in range(len(data.logs)) if k not in data.withheld]
    rise = warming(data.order, *ORDER_ALONE)
    ranks = np.array([rankdata([rise[k] for k in taking]), rankdata([1.0 / data.logs[k].load for k in taking])])
    return float(np.corrcoef(ranks)[0, 1]) if np.all(np.ptp(ranks, axis=1) > 0.0) else 0.0


def _swap(names: Names, name: str, other: str) -> Names:
    """A set with another suspect in place of one."""
    return tuple(sorted((*(n for n in names if n != name), other)))


def _refit(data: Fitted, suspects: Suspects, found: Found, names: Names) -> Fit:
    """The fit of a set, found by the search or else begun from its best fit."""
    return found.fits.get(names) or fit_set(RigProblem(data, suspects, names), found.best, quick=True)


def _refit_same(data: Fitted, suspects: Suspects, found: Found, name: str, other: str) -> Fit:
    """The fit with another suspect that looks the same in place of a cause.

    Where both change one number by a share of it, the fit begins from the same change or its inverse, so that no expansion
    about the absent effect is needed.
    """
    best, problem = found.best, RigProblem(data, suspects, _swap(found.best.names, name, other))
    if not (is_entry(name) or is_entry(other)) or len(suspects[name].fields) != len(suspects[other].fields):
        return fit_set(problem, best)
    share = float(best.x[best.place[name]][0])
    x = np.concatenate([best.x[best.place[n]] if n != other else np.zeros(1) for n in problem.names])
    begins = []
    for value in (share, 1.0 / (1.0 + share) - 1.0):
        x[problem.place[other]] = value
        loss = huber(problem.residual(np.concatenate((best.nu, x))))
        begins.append(
            (loss, msgspec.structs.replace(best, names=problem.names, place=problem.place, x=x.copy(), columns={}))
        )
    return fit_set(problem, min(begins, key=lambda begin: begin[0])[1], quick=True)


def _named(data: Fitted, best: Fit, other: Fit, name: str, probability: float) -> Alternative:
    """The alternative of a fit, and where the two differ most; nowhere if nothing that the logs measure distinguishes them.

    Where the fit has several other suspects, the first that takes the place of the cause.
    """
    gone, new = (sorted(set(a) - set(b)) for a, b in ((best.names, other.names), (other.names, best.names)))
    effect = new[min(gone.index(name), len(new) - 1)]
    clearest: Spot | None = None
    difference = (best.z - other.z).reshape(-1, len(CHANNELS))
    for log, k, phase, here in data.cells():
        size = float(np.sqrt(np.sum(difference[here, k] ** 2)))
        if size > (clearest.z if clearest else 0.0):
            clearest = Spot(CHANNELS[k], PHASES[phase], data.logs[log].load, z=size)
    return Alternative(effect, probability, clearest if clearest and clearest.z > ALIKE else None)


class _Explanations(NamedTuple):
    """Two explanations of the same data as models, and the other with one number moved after the other.

    Of the other, `tolerances` moves numbers of the rig by one tolerance each and `fields` those of its effects, each by a step;
    `precision` (k, k) is the information of the data on these fields.
    """

    best: Model
    other: Model
    tolerances: Sequence[Model]
    fields: Sequence[tuple[Model, float]]
    precision: Signal


def plan_run(data: Fitted, suspects: Suspects, found: Found, causes: Sequence[NamedCause]) -> Experiment | None:
    """Choose the run in which a cause and its alternative differ most beyond noise, tolerances and what the latter can adapt.

    The cause is the first with an alternative that a run could distinguish from it, else the leading one, whose alternative is
    then the physical suspect with the most evidence in its place. A wrong load of one run is checked on the rig, not by a run.
    """
    others = [name for name in suspects if name not in found.best.names and suspects[name].stage != "entry"]
    causes = [cause for cause in causes if suspects[cause.effect].name != LOAD]
    if not causes or not others:
        return None
    apart = {cause.effect: [r.effect for r in cause.look_alikes if suspects[r.effect].name != LOAD] for cause in causes}
    apart = {
        name: [other for other in rivals if not same_in_logs(suspects, name, other)] for name, rivals in apart.items()
    }
    drifting = [
        cause for cause in causes if cause.stability and any(t.along == "order" for t in cause.stability.trends)
    ]
    lead = next((cause for cause in causes if apart[cause.effect]), (drifting or causes)[0])
    near = apart[lead.effect][:1] or [name for name in others if not same_in_logs(suspects, lead.effect, name)]
    if not near:
        return None
    other = max(near, key=lambda r: found.linear.evidence(_swap(found.best.names, lead.effect, r), found.scale))
    fit = _refit(data, suspects, found, _swap(found.best.names, lead.effect, other))
    speed, length = _usual(data)
    loads = sorted({log.load for log in data.logs})
    tried = dict.fromkeys([loads[0], loads[len(loads) // 2], loads[-1]])
    options = [(load, share * speed) for load in tried for share in SPEEDS]
    repeats = bool(drifting) or _confused(data, suspects, lead.effect, other)
    if repeats:  # a light load again, after all others
        options = [(load, speed) for load in loads[-2:]]
    both = {load: _explanations(data, suspects, found.best, fit, load) for load, _ in options}
    scores = all_at_once([partial(_score, data, both[load], _planned(load, v, length, data)) for load, v in options])
    z, (load, v) = max(zip(scores, options, strict=True), key=lambda pair: pair[0])
    again = next(log.run.name for log in data.logs if log.load == load) if repeats else ""
    return Experiment("cycle", v, (lead.effect, other), z, load=load, length=length, repeats=again)


def _explanations(data: Fitted, suspects: Suspects, best: Fit, fit: Fit, load: float) -> _Explanations:
    """Two explanations in a run with a load that is made after all others."""
    heat = float(np.mean([data.order.heat[k] for k, log in enumerate(data.logs) if log.load == load]))
    effects, one = fit.effects(suspects), np.eye(fit.nu.size)
    fields = []
    for name, effect in zip(fit.names, effects, strict=True):
        for moved, step in varied(suspects[name], fit.x[fit.place[name]], 0.02):
            model = data.model_after(fit.nu, [moved if other is effect else other for other in effects], heat)
            fields.append((model, step))
    return _Explanations(
        best=data.model_after(best.nu, best.effects(suspects), heat),
        other=data.model_after(fit.nu, effects, heat),
        tolerances=[
            data.model_after(fit.nu + one[k], effects, heat) for k, n in enumerate(data.nuisances) if n.kind == "rig"
        ],
        fields=fields,
        precision=fit.curve + np.diag((fit.bounds.inner_high - fit.bounds.inner_low) ** -2.0),
    )


def _usual(data: Fitted) -> tuple[float, float]:
    """Fastest plateau [m/s] and median length of a payout [m] of the campaign."""
    fastest = max(float(np.quantile(log.run.channels["velocity"], 0.97)) for log in data.logs)
    lengths = []
    for log in data.logs:
        blocks, x = log.course.blocks, log.course.displacement
        for cycle in np.unique(blocks.cycle[blocks.phase == 0]):
            own = np.flatnonzero((blocks.cycle == cycle) & (blocks.phase == 0))
            lengths.append(float(x[blocks.stop[own[-1]] - 1] - x[blocks.start[own[0]]]))
    return max(fastest, 0.0), float(np.median(lengths)) if lengths else 1.0


def _planned(load: float, speed: float, length: float, data: Fitted) -> Run:
    """A run of one trapezoid out and one back, without noise."""
    out, back = max(length / speed - RAMP, 0.5), max(length / (BACK * speed) - RAMP, 0.5)
    corners = np.cumsum([0.0, REST, RAMP, out, RAMP, HOLD, RAMP, back, RAMP, REST])
    v = np.array([0.0, 0.0, speed, speed, 0.0, 0.0, -BACK * speed, -BACK * speed, 0.0, 0.0])
    fs = data.logs[0].run.fs
    t = np.arange(0.0, corners[-1], 1.0 / fs)
    velocity = np.interp(t, corners, v)
    return Run(name="planned", t=t, channels={"velocity": velocity}, fs=fs, samples=t.size, load=load)


def _score(data: Fitted, both: _Explanations, run: Run) -> float:
    """Significance with which a planned run distinguishes two explanations. [sigma]"""
    course = Course(run, blocks_of(run, data.rig))
    predicted = course.predict(both.other)
    moves = [course.predict(model) - predicted for model in both.tolerances]
    for k, name in enumerate(CHANNELS):
        for kind, size in (("gain", predicted[:, k]), ("zero", 1.0)):
            sd = max((n.sd for n in data.nuisances if n.kind == kind and n.name == name), default=0.0)
            moves.append(np.zeros_like(predicted))
            moves[-1][:, k] = sd * size
    moves += [(course.predict(model) - predicted) / step for model, step in both.fields]
    noise = _planned_noise(data, course.blocks.phase)
    z, j = (
        ((course.predict(both.best) - predicted) / noise).ravel(),
        np.column_stack([(x / noise).ravel() for x in moves]),
    )
    prior, own = np.eye(j.shape[1]), len(both.fields)
    prior[j.shape[1] - own :, j.shape[1] - own :] = both.precision
    pull = j.T @ z
    return math.sqrt(max(float(z @ z - pull @ np.linalg.solve(j.T @ j + prior, pull)), 0.0))


def _planned_noise(data: Fitted, phase: NDArray[np.intp]) -> Signal:
    """Noise of planned blocks, (m, 5): the median of the campaign in the same phase; inf where a channel has no information."""
    sd = np.full((phase.size, len(CHANNELS)), math.inf)
    for p in range(len(PHASES)):
        for k in range(len(CHANNELS)):
            own = data.noise[data.seen[:, k] & (data.blocks.phase == p), k]
            if own.size:
                sd[phase == p, k] = float(np.median(own))
    return sd
