"""Uncertainty of the means of a reduction by the GUM (JCGM 100:2008): the budget of the errors of
the sensors with the repeatability of the cycles, and 95 % intervals by Student's distribution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import compress

import msgspec
import numpy as np

from winchcascade.core.accuracy import (
    ErrorSource,
    Interval,
    Scatter,
    effective_freedom,
    interval_95,
)
from winchcascade.core.errors import check_type
from winchcascade.core.run import Mask, Signal
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.error_model import (
    TAKEN_AS_EXACT,
    ErrorModel,
    error_model,
    errors_of_sensors,
)
from winchcascade.reduction.reduction_result import Reduction

NORMAL_REACH = 3.0
"""Largest normal error that is considered, in standard uncertainties."""


class BudgetRow(msgspec.Struct, frozen=True):
    """What a source contributes to the standard uncertainty of each mean, in its unit; without a
    source the bridged gaps.
    """

    source: ErrorSource | None
    of: Metrics


class Budget(msgspec.Struct, frozen=True):
    """Standard uncertainties of a reduction and what they consist of, in the units of the metrics.

    `sensors` (type B) and `repeatability` (type A, s/sqrt(N) of the complete cycles; None for a
    single one) make `mean`. `freedom` are effective degrees of freedom (Welch and Satterthwaite,
    GUM G.4). `cycles` are those of every cycle, without repeatability. `by_limits` and
    `cycles_by_limits` are what the accuracies of the sensors that are calibrated in place would
    leave of means and cycles: no part of `mean`, but of a table whose reader knows these alone. A
    metric that needs a channel of `unknown` has none, as the rig file states no accuracy for it;
    nor has one of `undetermined`, where the errors could take away all of what it is divided by.
    """

    rows: tuple[BudgetRow, ...]
    sensors: Metrics
    repeatability: Metrics
    mean: Metrics
    freedom: Metrics
    cycles: tuple[Metrics, ...]
    by_limits: Metrics
    cycles_by_limits: tuple[Metrics, ...]
    exact: tuple[str, ...]
    unknown: tuple[str, ...]
    undetermined: tuple[str, ...] = ()


class Uncertainty(msgspec.Struct, frozen=True):
    """Uncertainty of the means of a reduction.

    Parameters
    ----------
    budget : contributions by the GUM
    interval_95 : of the mean over cycles of this kind, by sensors and repeatability together
    interval_95_sensors : of the mean of these very cycles, by sensors alone
    """

    budget: Budget
    interval_95: Mapping[str, Interval]
    interval_95_sensors: Mapping[str, Interval]

    @property
    def standard(self) -> Metrics:
        """Standard uncertainty of each mean, in the unit of the metric."""
        return self.budget.mean


def _weights(reduction: Reduction, model: ErrorModel) -> tuple[dict[str, str], Signal]:
    """The metrics whose channels have a known accuracy, with the energy that each is divided by, ""
    for none; and the change of each with each energy of a cycle, (m, e, k), NaN for a cycle without
    the metric.
    """
    cascade, energies = reduction.rig.cascade, model.energies
    known, place = {n for n, lacks in model.lacking.items() if not lacks}, [*energies]
    divisors, found = dict[str, str](), list[Signal]()
    for metric in cascade.all_metrics:
        names = cascade.all_ratios.get(metric, (metric.replace("power_", "energy_"), ""))
        out, into = (name.removeprefix("energy_") for name in names)
        if known.issuperset({out, into or out}):
            of_cycles = np.array([c.metrics[metric] for c in reduction.cycles], dtype=np.float64)
            span = energies[out].t if metric.startswith("power_") else 1.0
            divisor = energies[into].joules if into else span
            weights = np.zeros((len(energies), of_cycles.size))
            divided = np.where(np.isfinite(of_cycles), divisor, np.nan)
            weights[place.index(out)] = 1.0 / divided
            if into:
                weights[place.index(into)] = -of_cycles / divided
            divisors[metric] = into
            found.append(weights)
    return divisors, np.reshape(found, (len(found), len(energies), len(reduction.cycles)))


def budget(reduction: Reduction, model: ErrorModel | None = None) -> Budget:
    """Uncertainty budget of a reduction by the GUM: sensitivities times standard uncertainties,
    added in squares.

    Parameters
    ----------
    model : of this reduction, if it is made already
    """
    model = model or error_model(reduction)
    sensors, energies, names = (
        reduction.rig.sensors,
        model.energies,
        reduction.rig.cascade.all_metrics,
    )
    in_place = {n: s for n, s in sensors.items() if s.u_zero is not None or s.u_gain is not None}
    bare = {n: msgspec.structs.replace(s, u_zero=None, u_gain=None) for n, s in in_place.items()}
    own, limits = len(model.sources), errors_of_sensors(bare, energies)
    changes = ErrorModel(energies, (*model.sources, *limits)).changes()
    divisors, weights = _weights(reduction, model)
    complete = np.array([cycle.complete for cycle in reduction.cycles], dtype=bool)
    counted = np.isfinite(weights).all(axis=1) & complete
    lost, has_mean = _lost(model, changes), [reduction.mean[m] is not None for m in divisors]
    taken = [
        bool(into) and given and bool(np.any(lost[into] & cycles))
        for into, given, cycles in zip(divisors.values(), has_mean, counted, strict=True)
    ]
    weights[taken] = np.nan
    shape = len(energies), own + len(limits), len(reduction.cycles)
    moved = np.einsum("mek,esk->msk", weights, np.reshape([*changes.values()], shape))
    missed = np.reshape([energy.gaps for energy in energies.values()], shape[::2])
    gaps = np.sqrt(np.einsum("mek,ek->mk", weights**2, missed**2))
    number = np.where(has_mean, counted.sum(axis=1), np.nan)[:, None]
    means = np.abs(np.where(counted[:, None], moved, 0.0).sum(axis=2)) / number
    bridged = np.linalg.norm(np.where(counted, gaps, 0.0), axis=1, keepdims=True) / number
    parts = np.hstack((means[:, :own], bridged))
    by_sensors, scatters = np.linalg.norm(parts, axis=1), _scatters(reduction)
    mean = np.hypot(by_sensors, [scatters[m].u if m in scatters else 0.0 for m in divisors])

    def named(values: Signal) -> Metrics:
        known = zip(divisors, values.tolist(), strict=True)
        return Metrics({m: value for m, value in known if math.isfinite(value)}, names)

    sources = [*model.sources, *([None] if missed.any() else [])]
    nothing, of_mean = Metrics({}, names), named(mean)
    used = {name for energy in energies.values() for name in energy.channels}
    freedom = {
        m: effective_freedom([scatters[m]] if m in scatters else [], u)
        for m, u in of_mean.items()
        if u is not None
    }
    return Budget(
        rows=tuple(BudgetRow(source, named(parts[:, k])) for k, source in enumerate(sources)),
        sensors=named(by_sensors),
        repeatability=Metrics({m: scatter.u for m, scatter in scatters.items()}, names),
        mean=of_mean,
        freedom=Metrics(freedom, names),
        cycles=tuple(map(named, np.hypot(np.linalg.norm(moved[:, :own], axis=1), gaps).T)),
        by_limits=named(np.linalg.norm(means[:, own:], axis=1)) if limits else nothing,
        cycles_by_limits=tuple(
            named(u) if limits else nothing for u in np.linalg.norm(moved[:, own:], axis=1).T
        ),
        exact=tuple(sorted(used.intersection(TAKEN_AS_EXACT) - {s.channel for s in model.sources})),
        unknown=tuple(sorted({name for lacks in model.lacking.values() for name in lacks})),
        undetermined=tuple(compress(divisors, taken)),
    )


def _lost(model: ErrorModel, changes: Mapping[str, Signal]) -> dict[str, Mask]:
    """Cycles in which the errors of all sources could take away all of an energy, (k,) each.

    Parameters
    ----------
    changes : of each energy with each source; those beyond the sources of the model do not count
    """
    reach = np.array([NORMAL_REACH if s.limit is None else s.limit / s.u for s in model.sources])
    return {
        name: reach @ np.abs(changes[name][: reach.size]) >= np.abs(energy.joules)
        for name, energy in model.energies.items()
    }


def _scatters(reduction: Reduction) -> dict[str, Scatter]:
    """Repeatability of the means: of metrics that several complete cycles have, where cycles
    repeat.
    """
    if not reduction.rig.phases.repeats:
        return {}
    metrics = [m for m, mean in reduction.mean.items() if mean is not None]
    rows = [[cycle.metrics[metric] for metric in metrics] for cycle in reduction.complete]
    values = np.reshape(np.array(rows, dtype=np.float64), (len(rows), len(metrics)))
    number = np.count_nonzero(np.isfinite(values), axis=0)
    means = np.nansum(values, axis=0) / np.maximum(number, 1)
    squares = np.nansum((values - means) ** 2, axis=0)
    u = np.sqrt(squares / np.maximum((number - 1) * number, 1))
    known = zip(metrics, u.tolist(), number.tolist(), strict=True)
    return {metric: Scatter(of, n - 1.0) for metric, of, n in known if n > 1}


def uncertainty(reduction: Reduction) -> Uncertainty:
    """State the uncertainty of the means of a reduction: budget and 95 % intervals by the GUM, as
    `compare` states them.

    An interval is t times the standard uncertainty, with the effective degrees of freedom of the
    budget. A single cycle shows no scatter, so its interval is that of the sensors alone.

    Raises
    ------
    OptionError : `reduction` is something else

    Examples
    --------
    >>> from winchcascade.reduction.reduce import reduce
    >>> from winchcascade.ingest.read import read_run
    >>> round(uncertainty(reduce(read_run("fixtures/campaign/r36ohm.csv"), window=5.48)).standard.value("eta_trans"), 4)
    0.002
    """
    check_type("uncertainty", reduction, Reduction, "reduce(run)")
    known, mean = budget(reduction), reduction.mean
    return Uncertainty(
        known,
        {
            m: interval_95(mean.value(m), u, known.freedom.value(m))
            for m, u in known.mean.items()
            if u is not None
        },
        {m: interval_95(mean.value(m), u) for m, u in known.sensors.items() if u is not None},
    )


def shares(part: Metrics, whole: Metrics) -> Metrics:
    """Share of the variance of each metric that one contribution makes. [1]

    >>> shares(Metrics(eta_trans=3.0), Metrics(eta_trans=5.0)).eta_trans
    0.36
    """
    return Metrics(
        {m: (a / b) ** 2 for m, a in part.items() if a is not None and (b := whole[m])}, whole.known
    )
