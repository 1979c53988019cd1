"""What each cause contributes to the difference between the model of the rig file and the log,
metric by metric.

A metric of a run is simulated with each subset of the causes at their fitted values, tolerances
nominal. The contribution of a cause is what it adds, averaged over all orders in which the causes
may be added: the value of Shapley (1953, A value for n-person games). It depends on no order, and
all add up to what the causes do together. Then numbers and sensors of the rig move within their
tolerances as the fit found them. The rest is the residual.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.diagnosis_result import (
    Contribution,
    ContributionKind,
    ContributionPart,
    LargestChange,
    NamedCause,
    Names,
)
from winchcascade.diagnosis.explain.shapley import split, subsets_of
from winchcascade.diagnosis.explain.windowed import (
    QUANTITIES,
    WindowedLog,
    quantities_of,
)
from winchcascade.diagnosis.fit.covariance import (
    covariances_without,
    joint_covariance,
    predictive_covariance,
)
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.nuisances import stated_share
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import Suspects, varied
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.verdict_limits import LAW

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from winchcascade.core.run import Mask, Signal
    from winchcascade.diagnosis.fit.evidence import Fit
    from winchcascade.diagnosis.fit.search import Found
    from winchcascade.rig.effects.effect import ActiveEffect, Effect
    from winchcascade.rig.parts import Model


MOVED = 0.02
"""Share of the plausible range of a field by which its derivative is taken."""


INPUTS = ("rig", "law", "load")
"""Kinds of nuisances that are inputs of the model; those of sensors belong to the data."""


OF_DISCREPANCY = 0.1
"""Share of the discrepancy of the model that may belong to the law of one effect, as a standard
uncertainty of its contribution to any metric. Assumed; a twin with laws of its own scatters about
as much. [1]"""


ROUNDED = 1e-8
"""Largest contribution of a cause, as a share of the quantity, that is rounding of the
simulation and counts as none. [1]
"""


class Accounts(NamedTuple):
    """What the parts of each of L runs come to, SI units; NaN for what a log lacks.

    `measured` and `as_given` are (L, 14); `parts` and their standard uncertainties `u` (L, k + 2,
    14) are those of k causes, of tolerances and residual. `by_model` (L, k, 14) is what each cause
    changes by the model, whether the log can give the quantity or not. `u_input` (L, 2, 14) are
    standard uncertainties by the inputs of the model, within the tolerances of the rig file and as
    the fit leaves them.
    """

    measured: Signal
    as_given: Signal
    parts: Signal
    u: Signal
    by_model: Signal
    u_input: Signal


class Ways(NamedTuple):
    """Small changes of a fit with all causes that are split: fields one after the other, of the
    causes `owners` and at `places` of all fields, then nuisances that are simulated.

    `moved` (M, 5, p) is what each moves in the blocks, SI units, by a change of `steps` (p,).
    """

    moved: Signal
    steps: Signal
    owners: list[int]
    places: list[int]


def ways_of(data: Fitted, suspects: Suspects, best: Fit, names: Names) -> Ways:
    """What moves the accounts of a fit with some of its causes.

    Fields move by derivatives of this place: a fit without the logs of a load leaves some of them
    so open that it magnifies what those of another place miss.
    """
    acting = best.acting(suspects)
    fields = [
        (owner, place, [moved if other == name else acting[other] for other in names], step)
        for owner, name in enumerate(names)
        for place, (moved, step) in enumerate(
            varied(suspects[name], best.x[best.place[name]], MOVED), best.place[name].start
        )
    ]
    here = best.nu, [acting[name] for name in names]
    by_nuisance = data.tolerances(*here)
    variants = [(best.nu, effects) for _, _, effects, _ in fields]
    by_field = data.predictions_near(here, variants, serves=0.0)
    return Ways(
        np.concatenate([by_field - data.nearby(here).at[:, :, None], by_nuisance], axis=2),
        np.array([*(field[3] for field in fields), *np.ones(data.simulated)]),
        [field[0] for field in fields],
        [field[1] for field in fields],
    )


class Split(NamedTuple):
    """A fit to be split among its `causes`: the model of every log with each subset of them, and
    that of the fit; the nuisances `nu`, the `ways`, and the `covariance` of its fields and then of
    its nuisances, (p + n, p + n).
    """

    causes: Names
    models: list[list[Model]]
    nu: Signal
    ways: Ways
    covariance: Signal


def account_of(data: Fitted, one: WindowedLog, fit: Split, of_inputs: Signal) -> Accounts:
    """Split the difference between the model of the rig file and one run among causes, tolerances
    and residual; L is 1.

    A contribution moves with a field of its cause as all causes together do, and has the error of a
    drawn split.

    Parameters
    ----------
    of_inputs : the covariance of the fit that the run is compared with
    """
    *subsets, model = (of_logs[one.number] for of_logs in fit.models)
    read = one.log.at_stamps(model, data.skew(fit.nu), data.zeros(fit.nu)[one.number])
    fitted, measured = one.quantities(read), quantities_of(one.log.run, one.rig, one.windows)
    values, causes, covariance = _values(one, subsets), len(fit.causes), fit.covariance
    moved = np.moveaxis(fit.ways.moved[data.rows[one.number]], 2, 0)
    changes = np.array(
        [
            one.quantities(read + one.log.course.blocks.spread(way, len(read))) - fitted
            for way in moved
        ]
    )
    by_field, by_nuisance = np.split(changes / fit.ways.steps[:, None], [len(fit.ways.places)])
    first = covariance.shape[0] - len(data.nuisances)
    slopes = np.zeros((causes + 2, covariance.shape[0], len(QUANTITIES)))
    slopes[fit.ways.owners, fit.ways.places] = by_field
    slopes[-2, first : first + data.simulated] = by_nuisance
    for j, n in enumerate(data.nuisances):
        if n.kind == "zero" and n.log == one.number:
            zero = np.where(np.array(CHANNELS) == n.name, n.sd, 0.0)
            slopes[-2, first + j] = one.quantities(read + zero) - fitted
    slopes[-1, fit.ways.places] = -by_field
    slopes[-1] -= slopes[-2]
    u = _spread_of(slopes, covariance)
    of_the_model = np.array([n.kind in INPUTS for n in data.nuisances[: data.simulated]])
    by_input = np.where(of_the_model[:, None], by_nuisance, 0.0)
    after = np.zeros_like(slopes[0])
    after[fit.ways.places] = by_field
    after[first : first + data.simulated] = by_input
    stated = np.array([stated_share(data.rig, n) for n in data.nuisances[: data.simulated]])
    before = np.sqrt(np.sum((stated[:, None] * by_input) ** 2, axis=0))
    u_input = np.array([before, _spread_of(after, of_inputs)])
    shares, drawn = split(values, causes)
    u[:causes] = np.hypot(u[:causes], drawn)
    missing = np.where(np.isnan(measured + fitted), math.nan, 0.0)
    parts = np.vstack([shares, fitted - values[-1], measured - fitted])
    of_run = measured + missing, values[0] + missing, parts + missing, u + missing, shares, u_input
    return Accounts(*(x[None] for x in of_run))


def _spread_of(slopes: Signal, covariance: Signal) -> Signal:
    """Standard uncertainties by slopes over numbers, (..., 14) from (..., p, 14)."""
    return np.asarray(np.sqrt(np.maximum(np.sum(slopes * (covariance @ slopes), axis=-2), 0.0)))


def _values(one: WindowedLog, models: Sequence[Model]) -> Signal:
    """Quantities of one run by several models without errors of zeros and timing, (models, 14);
    what does not concern the run is not simulated again.
    """
    known: list[tuple[Model, Signal]] = []
    for model in models:
        if all(model != other for other, _ in known):
            nothing = np.zeros(len(CHANNELS))
            known.append((model, one.simulated(model, nothing, nothing)))
    return np.array([next(x for other, x in known if other == model) for model in models])


# ------------------------------------------------------------------------- all runs of a campaign
def contributions_of(
    data: Fitted,
    found: Found,
    causes: Sequence[NamedCause],
    logs: Sequence[WindowedLog],
    held_out: Collection[int] = (),
) -> tuple[tuple[Contribution, ...], dict[str, list[LargestChange]], Signal]:
    """Split every metric of every run among the causes that are named, tolerances and residual, the
    parts in this order.

    Also what each cause changes of each efficiency of each run by the model, whether the log can
    give that or not, and the uncertainties of the quantities by the inputs of the model, as in
    `Accounts`.

    Parameters
    ----------
    causes : named ones among those of the best fit
    logs : all of them with their windows
    held_out : numbers of logs that are compared with a fit without the logs of their load
    """
    names, suspects = tuple(cause.effect for cause in causes), found.problem.suspects
    best, nothing = found.best, np.zeros(len(data.nuisances))
    acting = best.acting(suspects)
    subsets = [
        [acting[name] for bit, name in enumerate(names) if subset >> bit & 1]
        for subset in subsets_of(len(names))
    ]
    models = [data.models(nothing, effects) for effects in subsets]
    models.append(data.models(best.nu, subsets[-1]))
    ways, covariance = ways_of(data, suspects, best, names), joint_covariance(found)
    fit = Split(names, models, best.nu, ways, covariance)
    predictive = predictive_covariance(data, found)
    without_load = covariances_without(data, found, {data.logs[k].load for k in held_out})

    def account(one: WindowedLog) -> Accounts:
        of_inputs = without_load[one.log.load] if one.number in held_out else predictive
        return account_of(data, one, fit, of_inputs)

    each = all_at_once([partial(account, one) for one in logs], data.sizes)
    accounts = Accounts(*map(np.concatenate, zip(*each, strict=True)))
    loaded = np.array([math.isfinite(one.log.run.load or math.inf) for one in logs])
    u = with_uncertain_laws(accounts, loaded, data.rig.model.discrepancy)
    accounts = accounts._replace(u=u)
    kinds: list[tuple[str | None, ContributionKind]] = [
        *((name, kind_of(suspects[name])) for name in names),
        (None, "tolerances"),
        (None, "residual"),
    ]
    recorded = (
        _recorded(one, accounts, row, kinds, k)
        for row, one in enumerate(logs)
        for k in range(len(QUANTITIES))
    )
    changes = {
        name: [
            change
            for row, one in enumerate(logs)
            for change in _changes(one, accounts.by_model[row, cause])
        ]
        for cause, name in enumerate(names)
    }
    return tuple(recorded), changes, accounts.u_input


def _recorded(
    one: WindowedLog,
    accounts: Accounts,
    row: int,
    kinds: Sequence[tuple[str | None, ContributionKind]],
    quantity: int,
) -> Contribution:
    """The account of one quantity of one run, of one `row` of the accounts."""
    measured = float(accounts.measured[row, quantity])
    values, spreads = accounts.parts[row, :, quantity], COVERED * accounts.u[row, :, quantity]
    parts = zip(
        kinds,
        values.tolist(),
        (values - spreads).tolist(),
        (values + spreads).tolist(),
        strict=True,
    )
    return Contribution(
        log=one.number,
        load=one.log.run.load,
        plateau_speed=one.plateau_speed,
        metric=QUANTITIES[quantity],
        as_given=float(accounts.as_given[row, quantity]),
        measured=measured,
        parts=tuple(ContributionPart(*kind, *ends) for kind, *ends in parts)
        if math.isfinite(measured)
        else (),
    )


def _changes(one: WindowedLog, changed: Signal) -> list[LargestChange]:
    """Changes of the efficiencies of one run, of those of all quantities, (14,); without what the
    model cannot give.
    """
    by = {metric: float(changed[QUANTITIES.index(metric)]) for metric in EFFICIENCIES}
    return [
        LargestChange(metric, change, load=one.log.run.load)
        for metric, change in by.items()
        if math.isfinite(change)
    ]


def with_uncertain_laws(accounts: Accounts, loaded: Mask, discrepancy: float) -> Signal:
    """Standard uncertainties of the parts of every run, (L, k + 2, 14), those of the causes with
    that of their laws, too.

    It is a share of the largest contribution of the cause, relative to the quantity, in any run
    with a load; for a run without one, in any of these. A law errs also where the contribution
    passes zero. A share of the discrepancy of the model is added.

    Parameters
    ----------
    loaded : (L,) whether each run has a load
    discrepancy : standard deviation of the model, as a share of the level [1]
    """
    causes = accounts.by_model.shape[1]
    size, level = np.abs(accounts.parts[:, :causes]), np.abs(accounts.as_given)[:, None]
    relative = np.divide(size, level, where=level > 0.0, out=np.zeros_like(size))
    alike = [np.fmax.reduce(relative[loaded == own], axis=0) for own in loaded.tolist()]
    largest = np.maximum(np.array(alike) * level, size)
    of_model = np.where(largest > ROUNDED * level, OF_DISCREPANCY * discrepancy * level, 0.0)
    u = accounts.u.copy()
    u[:, :causes] = np.sqrt(u[:, :causes] ** 2 + (LAW * largest) ** 2 + of_model**2)
    return u


def quantities_by(
    data: Fitted, nu: Signal, effects: Sequence[ActiveEffect], logs: Sequence[WindowedLog]
) -> list[Signal]:
    """Quantities of every run by the model, (14,) each.

    Parameters
    ----------
    nu : nuisances of the fit
    logs : as for `contributions_of`
    """
    models, skew, zeros = data.models(nu, effects), data.skew(nu), data.zeros(nu)
    jobs = [partial(one.simulated, models[one.number], skew, zeros[one.number]) for one in logs]
    return all_at_once(jobs, data.sizes)


def efficiency_changes(
    logs: Sequence[WindowedLog], before: Sequence[Signal], after: Sequence[Signal]
) -> list[LargestChange]:
    """What changes of each efficiency of each run, between two lists of `quantities_by`."""
    several = zip(logs, before, after, strict=True)
    return [one for log, old, new in several for one in _changes(log, new - old)]


def kind_of(effect: Effect) -> ContributionKind:
    """Whether an effect costs energy, changes only what is read, or is a wrong entry."""
    return (
        "sensor" if effect.stage == "sensor" else "entry" if effect.stage == "entry" else "physical"
    )


EFFICIENCIES = ("eta_pto", "eta_gen", "eta_trans")
"""Efficiencies in the order in which one that a campaign has decides the order of the causes."""


def leading_metric(contributions: Sequence[Contribution]) -> str | None:
    """The first of `EFFICIENCIES` that some run has; None where no run has any."""
    known = {one.metric for one in contributions if one.parts}
    return next((metric for metric in EFFICIENCIES if metric in known), None)


def loaded_part(contributions: Sequence[Contribution], metric: str | None) -> list[Contribution]:
    """Contributions to one metric of the runs with a load that have it."""
    return [
        one
        for one in contributions
        if one.metric == metric and one.parts and math.isfinite(one.load or math.inf)
    ]


def by_cost(
    causes: Sequence[NamedCause], contributions: Sequence[Contribution]
) -> tuple[NamedCause, ...]:
    """Causes in the order of what they change in eta_pto, on average over the loaded runs, the
    largest first; entries lead.

    Without eta_pto another efficiency decides; without any the order stays.
    """
    cost: dict[str | None, list[float]] = {}
    for one in loaded_part(contributions, leading_metric(contributions)):
        for part in one.parts:
            cost.setdefault(part.effect, []).append(part.value)
    mean = {name: abs(sum(values) / len(values)) for name, values in cost.items()}
    return tuple(
        sorted(causes, key=lambda cause: (cause.stage != "entry", -mean.get(cause.effect, 0.0)))
    )


def without(
    contributions: Sequence[Contribution],
    effects: Collection[str],
    among: ContributionKind = "tolerances",
) -> tuple[Contribution, ...]:
    """Contributions in which the parts of some effects, which are no causes, count among another
    kind of parts.
    """
    if not effects:
        return tuple(contributions)
    return tuple(
        msgspec.structs.replace(one, parts=_joined(one.parts, effects, among))
        for one in contributions
    )


def _joined(
    parts: Sequence[ContributionPart], effects: Collection[str], among: ContributionKind
) -> tuple[ContributionPart, ...]:
    """Parts with those of some effects joined to the part of another kind, their half-widths in
    quadrature.
    """
    joined = [part for part in parts if part.effect in effects or part.kind == among]
    value = sum(part.value for part in joined)
    half = math.hypot(*(0.5 * (part.high - part.low) for part in joined))
    return tuple(
        msgspec.structs.replace(part, value=value, low=value - half, high=value + half)
        if part.kind == among
        else part
        for part in parts
        if part.effect not in effects
    )


def reordered(
    contributions: Sequence[Contribution], causes: Sequence[NamedCause]
) -> tuple[Contribution, ...]:
    """Contributions whose parts follow the order of the causes, then tolerances and what follows
    them.
    """
    place = {cause.effect: k for k, cause in enumerate(causes)}
    return tuple(
        msgspec.structs.replace(
            one,
            parts=tuple(
                sorted(one.parts, key=lambda part: place.get(part.effect or "", len(place)))
            ),
        )
        for one in contributions
    )
