"""Uncertainty of the means of a reduction by the GUM (JCGM 100:2008): a model of the errors of the
sensors, differentiated for the budget, with the repeatability of the cycles, and 95 % intervals by
Student's distribution.

A sensor reads (1 + gain) x + zero, both unknown but the same over the whole run, so neither
averages out over its cycles. As a power is a product of two channels, its energy for any errors
follows from four integrals, and nothing is integrated again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from functools import cache, cached_property
from itertools import accumulate, combinations, compress
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import (
    Basis,
    ErrorSource,
    Interval,
    Scatter,
    effective_freedom,
    error_sources,
    interval_95,
)
from winchcascade.core.cascade import Term
from winchcascade.core.errors import check_type
from winchcascade.core.integrate import Stretch, integrals_of, largest, slope_of
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.reduction.efficiency import NOTHING, Metrics
from winchcascade.reduction.energies import SIGN, spans_of
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.timing import lag_sources

R_DRUM, SAMPLING = "r_drum", "sampling"
"""Sources of uncertainty that are no channels: the drum radius, where a rig file states one of it,
and what every second or third sample alone changes of an energy."""

TAKEN_AS_EXACT = ("velocity",)
"""Channels without a stated accuracy that count as exact: an encoder's counts have neither zero
nor gain error.
"""

NORMAL_REACH = 3.0
"""Largest normal error that is considered, in standard uncertainties."""

Terms = tuple[tuple[tuple[str, ...], int], ...]
"""Channels of each term of a power, and the power of the stated drum radius that the term is
proportional to.
"""


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


class Integrated(NamedTuple):
    """Integrals of a stage over k spans: terms of its power; of what (x - zero_x)(y - zero_y) of each
    term multiplies out to, (r, k), without the zeros: of each subset of its channels the rest; and
    by channel what the spans lose per second by which it is late, (k,) each [W].
    """

    terms: Terms
    joules: Signal
    rates: dict[str, Signal]


# ---------------------------------------------------------------------------- the model of errors
class Energy(msgspec.Struct, frozen=True, dict=True):
    """One energy in k spans, as the sum of some integrals times `factors` that the errors of its
    channels decide.

    Parameters
    ----------
    integrals : (r, k), of the `integrands`, the change by thinning the log per unit of the error of
        the sampling, and that by each lag [J/s]
    t : (k,) length of the spans [s]
    gaps : (k,) standard uncertainty by bridged gaps, independent from span to span [J]
    """

    terms: Terms
    integrals: Signal
    t: Signal
    gaps: Signal

    @cached_property
    def joules(self) -> Signal:
        """Energies as reduced, (k,). [J]"""
        sizes = [len(_subsets(channels)) for channels, _ in self.terms]
        whole = accumulate(sizes[:-1], initial=0)  # of each term the product of all its channels
        return np.asarray(sum(self.integrals[row] for row in whole))

    @property
    def channels(self) -> set[str]:
        """Channels of all terms."""
        return {name for channels, _ in self.terms for name in channels}


def slopes(terms: Terms, sources: Sequence[ErrorSource]) -> Signal:
    """Change of the factor of each integral of an energy with each of m errors, (r, m), where there
    are none yet.

    An energy of channels without their errors has the factors (x - zero_x)(y - zero_y) /
    ((1 + gain_x)(1 + gain_y)) multiplied out. So a gain changes that of the product of all
    channels, and a zero that of the product without its channel. The integrals of the sampling and
    of each lag follow.
    """
    products = [(of, zeros, power) for of, power in terms for zeros in _subsets(of)]
    found = np.zeros((len(products) + 1 + sum(s.part == "lag" for s in sources), len(sources)))
    late = len(products)
    for k, source in enumerate(sources):
        if source.part == "lag":
            late += 1
            found[late, k] = 1.0
        elif source.channel == SAMPLING:
            found[len(products), k] = 1.0
        elif source.part == "zero":
            found[: len(products), k] = [
                -float(zeros == (source.channel,)) for _, zeros, _ in products
            ]
        else:
            found[: len(products), k] = [
                0.0 if zeros else -(power if source.channel == R_DRUM else of.count(source.channel))
                for of, zeros, power in products
            ]
    return found


@cache
def _subsets(channels: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The subsets of the channels of a term, from none to all of them."""
    return [some for size in range(len(channels) + 1) for some in combinations(channels, size)]


class ErrorModel(msgspec.Struct, frozen=True):
    """The measured energies by their names in the parts of the cascade, and the m sources of
    uncertainty of all spans.
    """

    energies: Mapping[str, Energy]
    sources: tuple[ErrorSource, ...]

    @property
    def lacking(self) -> dict[str, tuple[str, ...]]:
        """Channels of each energy for which the rig file states no accuracy, without those that
        count as exact.
        """
        stated = {source.channel for source in self.sources}.union(TAKEN_AS_EXACT)
        return {
            name: tuple(sorted(energy.channels - stated)) for name, energy in self.energies.items()
        }

    def changes(self) -> dict[str, Signal]:
        """Change of each energy with one standard uncertainty of each source, (m, k). [J]"""
        u = np.array([source.u for source in self.sources])
        of_terms = {
            terms: (slopes(terms, self.sources) * u).T
            for terms in {energy.terms for energy in self.energies.values()}
        }
        return {
            name: of_terms[energy.terms] @ energy.integrals
            for name, energy in self.energies.items()
        }


def error_model(reduction: Reduction) -> ErrorModel:
    """Integrate what the energies of all cycles are made of, and list their sources of
    uncertainty.
    """
    rig, cycles = reduction.rig, reduction.cycles
    spans = spans_of(
        [c.window for c in cycles], [c.phases for c in cycles], [c.net for c in cycles]
    )
    every, nothing = np.concatenate([*spans.values()]), np.zeros(len(cycles))
    in_time = np.zeros(len(every))
    lags = lag_sources(reduction)
    of_stage = integrated(reduction, every, {name for _, moved in lags for name in moved})
    energies = {}
    for part, (stage, span) in rig.cascade.parts.items():
        if stage in of_stage and any(c.metrics[f"energy_{part}"] is not None for c in cycles):
            terms, joules, rates = of_stage[stage]
            late = [
                sum((rates[name] for name in moved if name in rates), start=in_time)
                for _, moved in lags
            ]
            first = [*spans].index(span) * len(cycles)
            here = slice(first, first + len(cycles))
            sign, bridged = SIGN.get(part, 1.0), reduction.bridged.get(part, nothing)
            rows = sign * joules[:, here], reduction.sampled.get(part, nothing)
            energies[part] = Energy(
                terms,
                np.vstack((*rows, *(sign * rate[here] for rate in late))),
                every[here, 1] - every[here, 0],
                np.array(bridged) / math.sqrt(3.0),
            )
    sources = _of_sensors(rig.sensors, energies)
    radius = rig.winch.r_drum
    on_radius = any(
        radius_power for energy in energies.values() for _, radius_power in energy.terms
    )
    if on_radius and radius is not None and radius.u:
        u = radius.u / radius.value
        basis: Basis = "limits" if radius.rectangular else "standard_uncertainty"
        limit = math.sqrt(3.0) * u if radius.rectangular else None
        sources.append(ErrorSource(R_DRUM, "gain", u, limit, radius.source, basis))
    sampling = -1 - len(lags)
    sums = [(abs(e.integrals[sampling].sum()), abs(e.joules.sum())) for e in energies.values()]
    least = NOTHING * max((float(joules) for _, joules in sums), default=0.0)
    if share := max(
        (float(thinned / joules) for thinned, joules in sums if joules > least), default=0.0
    ):
        origin = "reduction of every second and third sample"
        sources.append(
            ErrorSource(SAMPLING, "gain", share / math.sqrt(3.0), share, origin, "resampling")
        )
        for energy in energies.values():
            energy.integrals[sampling] /= share
    return ErrorModel(energies, (*sources, *(source for source, _ in lags)))


def integrated(
    reduction: Reduction, spans: Signal, late: Collection[str] = ()
) -> dict[str, Integrated]:
    """Integrate what the power of each measured stage is made of over k spans, (k, 2) [s].

    Parameters
    ----------
    late : channels that may be recorded late
    """
    run, rig = reduction.run, reduction.rig
    powers, on_drum = rig.cascade.powers(run.channels, rig.r_drum), _is_on_drum(run, rig)

    def stream(term: Term, without: Sequence[str], *more: Stretch) -> Stretch:
        factors = [run.channels[name].__getitem__ for name in term.channels if name not in without]
        scale = term.scale(rig.r_drum)
        return lambda part: math.prod(
            (x(part) for x in (*factors, *more)), start=np.full(run.t[part].shape, scale)
        )

    made_of = {}
    for stage, power in powers.items():
        products = [stream(t, zeros) for t in power.terms for zeros in _subsets(t.channels)]
        moved = [
            (name, stream(term, (name,), slope_of(run.t, run.channels[name])))
            for term in power.terms
            for name in term.channels
            if name in late
        ]
        made_of[stage] = products, moved
    streams = [
        x for products, moved in made_of.values() for x in (*products, *(y for _, y in moved))
    ]
    rows, found = iter(integrals_of(run.t, streams, spans)), dict[str, Integrated]()
    for stage, (products, moved) in made_of.items():
        # An encoder on the drum counts v = r omega: F v is proportional to r, tau v / r = tau omega
        # is not.
        terms = tuple(
            (t.channels, (on_drum and "velocity" in t.channels) - t.by_radius)
            for t in powers[stage].terms
        )
        joules, rates = np.array([next(rows) for _ in products]), dict[str, Signal]()
        for name, _ in moved:
            rates[name] = rates.get(name, 0.0) + next(rows)
        found[stage] = Integrated(terms, joules, rates)
    return found


def _is_on_drum(run: Run, rig: Rig) -> bool:
    """Whether the line velocity is the stated drum radius times the speed of the drum, and not
    measured on the line.
    """
    motion, speed = run.channels.get("velocity"), run.channels.get("speed")
    if rig.winch.motion == "drum" or motion is None or speed is None or rig.r_drum is None:
        return rig.winch.motion == "drum"
    return bool(np.allclose(motion, speed * rig.r_drum, rtol=1e-9, atol=1e-9 * largest(motion)))


def _of_sensors(sensors: Mapping[str, Sensor], energies: Mapping[str, Energy]) -> list[ErrorSource]:
    """Errors of the sensors of all channels that some energies are made of."""
    channels = sorted(
        {name for energy in energies.values() for name in energy.channels} & sensors.keys()
    )
    return [source for name in channels for source in error_sources(name, sensors[name])]


# -------------------------------------------------------------------------- the budget by the GUM
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
    own, limits = len(model.sources), _of_sensors(bare, energies)
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
    squares = np.nansum((values - np.nansum(values, axis=0) / number) ** 2, axis=0)
    u = np.sqrt(squares / (np.maximum(number - 1, 1) * number))
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
