"""Uncertainty of the means of a reduction: one model of the errors of the sensors, differentiated for the budget of the GUM
(JCGM 100:2008) and drawn for the 95 % intervals (JCGM 101:2008); with it the repeatability of the cycles.

A sensor reads (1 + gain) x + zero, both unknown but the same over the whole run, so neither averages out over its cycles. As a
power is a product of two channels, its energy for any errors follows from four integrals, and nothing is integrated again.

The errors are drawn from a lattice that is shifted at random (Korobov 1959; Cranley and Patterson 1976). It fills the space of
the errors evenly, so that 8191 draws determine an interval better than 20 000 independent ones.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from itertools import combinations
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.accuracy import Basis, ErrorSource, error_sources
from winchcascade.core.arguments import SEED_NUMBER, check_arguments
from winchcascade.core.cascade import Cascade, Power, Stream
from winchcascade.core.errors import check_type
from winchcascade.core.integrate import integrals_of, quantiles_in_place
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.reduction.efficiency import NET_METRICS, NOTHING, Metrics
from winchcascade.reduction.energies import SIGN, spans_of
from winchcascade.reduction.reduction_result import Reduction

R_DRUM, SAMPLING = "r_drum", "sampling"
"""Sources of uncertainty that are no channels: the drum radius, where a rig file states one of it, and what every second or
third sample alone changes of an energy."""

TAKEN_AS_EXACT = ("velocity",)
"""Channels without a stated accuracy that count as exact: an encoder's counts have neither zero nor gain error."""

IMAGINARY_STEP = 1e-30
"""Imaginary step by which the model is differentiated: what it leaves out is below rounding (Squire and Trapp 1998). [1]"""

NORMAL_REACH = 3.0
"""Largest normal error that is considered, in standard uncertainties."""

GAIN_REACH = 0.9
"""Smallest error of a gain, as a share of one, with which a reading is no measurement."""

LINEAR_WITHIN = 0.02
"""Where the standard uncertainties of draws and budget differ by more than this share, that of the draws is stated."""

SEED = 20260
"""Seed of the shift of the lattice unless another is given, so that the same log gives the same interval."""

DRAWS, MULTIPLIER = 8191, 3483
"""Number of draws of all errors, and the multiplier of their lattice: of 400 one with the smallest errors of the intervals of
150 sums of 2 to 12 errors. The ends of an interval are then known to 1 % of its width."""

Errors = Mapping[tuple[str, str], NDArray[Any]]
"""Errors by channel and part, (n, 1) each, real or complex: n draws, or n sources one after the other."""

NOWHERE = ("", "")
"""Place of no error among errors: zeros."""

Method = Literal["gum", "monte_carlo"]


class BudgetRow(msgspec.Struct, frozen=True):
    """What a source contributes to the standard uncertainty of each mean, in its unit; without a source the bridged gaps."""

    source: ErrorSource | None
    of: Metrics


class Budget(msgspec.Struct, frozen=True):
    """Standard uncertainties of a reduction and what they consist of, in the units of the metrics.

    `sensors` (type B) and `repeatability` (type A, s/sqrt(N) of the complete cycles; None for a single one) make `mean`.
    `freedom` are effective degrees of freedom (Welch and Satterthwaite, GUM G.4). `cycles` are those of every cycle, without
    repeatability. `by_limits` and `cycles_by_limits` are what the accuracies of the sensors that are calibrated in place would
    leave of means and cycles: no part of `mean`, but of a table whose reader knows these alone.
    A metric that needs a channel of `unknown` has none, as the rig file states no accuracy for it; nor has one of
    `undetermined`, where the errors could take away all of what it is divided by.
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


class Interval(NamedTuple):
    """Ends of a 95 % interval, in the unit of the metric."""

    low: float
    high: float


class Uncertainty(msgspec.Struct, frozen=True):
    """Uncertainty of the means of a reduction: the budget, the draws and what is stated of them.

    `standard` is that of the budget where the draws confirm it, else that of the draws (`drawn`), by `method`. `interval_95`
    holds the mean over cycles of this kind, sensors and repeatability together; `interval_95_sensors` the mean of these very
    cycles, sensors alone.
    """

    budget: Budget
    seed: int
    draws: int
    drawn: Metrics
    standard: Metrics
    method: Mapping[str, Method]
    interval_95: Mapping[str, Interval]
    interval_95_sensors: Mapping[str, Interval]


class Energy(msgspec.Struct, frozen=True, dict=True):
    """One energy in k spans for any errors of the channels that the terms of its power are made of.

    Parameters
    ----------
    terms : channels of each term of the power, and the power of the stated drum radius that it is proportional to
    integrals : (m, k), of the `integrands`, and the change by thinning the log per unit of the error of the sampling
    t : (k,) length of the spans [s]
    bridged : (k,) standard uncertainty by gaps, independent from span to span [J]
    """

    name: str
    terms: tuple[tuple[tuple[str, ...], int], ...]
    integrals: Signal
    t: Signal
    bridged: Signal

    @cached_property
    def joules(self) -> Signal:
        """Energies as reduced, (k,). [J]"""
        return np.asarray(self.without({NOWHERE: np.zeros((1, 1))})[0])

    @property
    def channels(self) -> set[str]:
        """Channels of all terms."""
        return {name for channels, _ in self.terms for name in channels}

    def without(self, errors: Errors) -> NDArray[Any]:
        """Energy that channels without these errors would have given, (n, k): what is read too high has to be taken off. [J]"""
        *integrals, sampled = self.integrals
        rows = iter(integrals)
        joules = errors[NOWHERE] + sampled * errors.get((SAMPLING, "gain"), 0.0)
        joules = joules + self.bridged * errors.get((self.name, "gap"), 0.0)
        for channels, radius_power in self.terms:
            factor = (1.0 + errors.get((R_DRUM, "gain"), 0.0)) ** -radius_power
            for name in channels:
                factor = factor / (1.0 + errors.get((name, "gain"), 0.0))
            for zeros in _subsets(channels):
                row, keys = next(rows), [(name, "zero") for name in zeros]
                if all(key in errors for key in keys):
                    joules = joules + row * math.prod((-errors[key] for key in keys), start=factor)
        return np.asarray(joules)

    def times(self, factors: Signal, rows: Index) -> Energy:
        """Some spans, each times a factor."""
        scaled = {name: getattr(self, name)[..., rows] * factors for name in ("integrals", "t", "bridged")}
        return msgspec.structs.replace(self, **scaled)

    def total(self, factor: float = 1.0) -> Energy:
        """Sum of the spans times a factor, as one span."""
        return msgspec.structs.replace(
            self,
            integrals=factor * self.integrals.sum(axis=1, keepdims=True),
            t=factor * self.t.sum(keepdims=True),
            bridged=np.array([factor * math.sqrt(self.bridged @ self.bridged)]),
        )


@cache
def _subsets(channels: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The subsets of the channels of a term, from none to all of them."""
    return [some for size in range(len(channels) + 1) for some in combinations(channels, size)]


def integrands(run: Run, power: Power, r_drum: float | None) -> list[Stream]:
    """What (x - zero_x)(y - zero_y) of each term multiplies out to, without the zeros: of each subset of channels the rest."""

    def stream(factor: float, names: Collection[str]) -> Stream:
        columns = [run.channels[name] for name in names]
        return lambda part: math.prod((column[part] for column in columns), start=np.full(run.t[part].shape, factor))

    return [
        stream(term.scale(r_drum), [name for name in term.channels if name not in zeros])
        for term in power.terms
        for zeros in _subsets(term.channels)
    ]


class Ratio(NamedTuple):
    """A metric in k cycles for any errors: an energy, over the relative energy that goes in for an efficiency."""

    out: Energy
    into: Energy | None

    def without(self, errors: Errors) -> NDArray[Any]:
        """The metric without these errors, (n, k)."""
        out = self.out.without(errors)
        return out if self.into is None else out / self.into.without(errors) * self.into.joules

    def mean(self) -> Ratio:
        """Mean of the cycles: of a ratio exact to the first order of the errors, and beyond where the cycles are alike."""
        share = 1.0 / self.out.t.size
        return Ratio(self.out.total(share), None if self.into is None else self.into.total(share))


class ErrorModel(msgspec.Struct, frozen=True, dict=True):
    """The measured energies by their names in the parts of the cascade, and the m sources of uncertainty that act on them."""

    cascade: Cascade
    energies: Mapping[str, Energy]
    sources: tuple[ErrorSource, ...]

    def errors(self, values: NDArray[Any]) -> Errors:
        """Errors by values of each source, (m, n): those of a sensor and its acquisition system add up."""
        found = {NOWHERE: np.zeros((values.shape[1], 1))}
        for source, value in zip(self.sources, values, strict=True):
            key = source.channel, source.part
            found[key] = found.get(key, found[NOWHERE]) + value[:, None]
        return found

    @cached_property
    def steps(self) -> Errors:
        """A small imaginary share of one standard uncertainty of one source after the other."""
        return self.errors(1j * IMAGINARY_STEP * np.diag(np.array([source.u for source in self.sources])))

    def changes(self, of: Energy | Ratio) -> Signal:
        """Change with one standard uncertainty of each source, (m, k)."""
        return np.asarray(of.without(self.steps).imag / IMAGINARY_STEP)

    def ratio(self, metric: str, rows: Index) -> Ratio:
        """A metric of some cycles that have it."""
        out, *into = (self.energies[name] for name in parts_of(self.cascade, metric))
        if into:
            joules = into[0].joules[rows]
            eta = np.maximum(out.joules[rows] / joules, NOTHING)
            return Ratio(out.times(1.0 / joules, rows), into[0].times(eta / joules, rows))
        power = metric.startswith("power_")
        return Ratio(out.times(1.0 / out.t[rows] if power else np.ones(rows.size), rows), None)


def parts_of(cascade: Cascade, metric: str) -> tuple[str, ...]:
    """Energies of the parts of the cascade that a metric is made of; what an efficiency divides by comes last."""
    names = cascade.all_ratios.get(metric, (metric.replace("power_", "energy_"),))
    return tuple(name.removeprefix("energy_") for name in names)


def error_model(reduction: Reduction) -> ErrorModel:
    """Integrate what the energies of a reduction are made of, and list their sources of uncertainty."""
    rig, energies = reduction.rig, _energies(reduction)
    sources = _of_sensors(rig.sensors, energies)
    radius = rig.winch.r_drum
    on_radius = any(radius_power for energy in energies.values() for _, radius_power in energy.terms)
    if on_radius and radius is not None and radius.u:
        u = radius.u / radius.value
        basis: Basis = "limits" if radius.rectangular else "standard_uncertainty"
        limit = math.sqrt(3.0) * u if radius.rectangular else None
        sources.append(ErrorSource(R_DRUM, "gain", u, limit, radius.source, basis))
    joules = {name: abs(float(energy.joules.sum())) for name, energy in energies.items()}
    thinned = [abs(float(energies[name].integrals[-1].sum())) / x for name, x in joules.items() if x > NOTHING]
    if share := max(thinned, default=0.0):
        origin = "reduction of every second and third sample"
        sources.append(ErrorSource(SAMPLING, "gain", share / math.sqrt(3.0), share, origin, "resampling"))
        for energy in energies.values():
            energy.integrals[-1] /= share
    sources += [ErrorSource(name, "gap", 1.0) for name, energy in energies.items() if energy.bridged.any()]
    return ErrorModel(rig.cascade, energies, tuple(sources))


def _energies(reduction: Reduction) -> dict[str, Energy]:
    """Integrals of the energies that the log has, over the window and the whole of every cycle."""
    run, rig, cycles, found = reduction.run, reduction.rig, reduction.cycles, {}
    spans = spans_of([c.window for c in cycles], [c.phases for c in cycles], [c.net for c in cycles])
    powers = {stage.name: stage.power(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    on_drum, nothing = _is_on_drum(run, rig), np.zeros(len(cycles))
    for part, (stage, span) in rig.cascade.parts.items():
        power = powers[stage]
        if power is None or all(c.metrics[f"energy_{part}"] is None for c in cycles):
            continue
        whole = SIGN.get(part, 1.0) * integrals_of(run.t, integrands(run, power, rig.r_drum), spans[span])
        found[part] = Energy(
            name=part,
            # An encoder on the drum counts v = r omega: F v is proportional to r, tau v / r = tau omega is not.
            terms=tuple((t.channels, (on_drum and "velocity" in t.channels) - t.by_radius) for t in power.terms),
            integrals=np.vstack((whole, reduction.sampled.get(part, nothing))),
            t=np.ptp(spans[span], axis=1),
            bridged=np.array(reduction.bridged.get(part, nothing)) / math.sqrt(3.0),
        )
    return found


def _is_on_drum(run: Run, rig: Rig) -> bool:
    """Whether the line velocity is the stated drum radius times the speed of the drum, and not measured on the line."""
    motion, speed = run.channels.get("velocity"), run.channels.get("speed")
    if rig.winch.motion == "drum" or motion is None or speed is None or rig.r_drum is None:
        return rig.winch.motion == "drum"
    return bool(np.allclose(motion, speed * rig.r_drum, rtol=1e-9, atol=1e-9))


def _of_sensors(sensors: Mapping[str, Sensor], energies: Mapping[str, Energy]) -> list[ErrorSource]:
    """Errors of the sensors of all channels that some energies are made of."""
    channels = sorted({name for energy in energies.values() for name in energy.channels} & sensors.keys())
    return [source for name in channels for source in error_sources(name, sensors[name])]


def without_accuracy(model: ErrorModel) -> dict[str, tuple[str, ...]]:
    """Channels of each energy for which the rig file states no accuracy, without those that count as exact."""
    stated = {s.channel for s in model.sources if s.part != "gap"}.union(TAKEN_AS_EXACT)
    return {name: tuple(sorted(energy.channels - stated)) for name, energy in model.energies.items()}


def _undetermined(model: ErrorModel, complete: Mask, metrics: Sequence[str]) -> tuple[str, ...]:
    """Metrics where the errors could take away all of the energy that they divide by, or of one plus a gain."""
    sources = [s for s in model.sources if s.part != "gap"]
    maximum = np.array([NORMAL_REACH * s.u if s.limit is None else s.limit for s in sources])
    u, is_gain = np.array([s.u for s in sources]), np.array([s.part == "gain" for s in sources], dtype=bool)
    reach, gains = {}, {}
    for name, energy in model.energies.items():
        shares = np.abs(model.changes(energy)[: u.size]) / np.maximum(np.abs(energy.joules), NOTHING)
        share = shares[:, complete & (energy.t > 0)].max(axis=1, initial=0.0)
        reach[name], gains[name] = float(maximum / u @ share), float(maximum[is_gain & (share > 0.0)].sum())
    parts = {m: parts_of(model.cascade, m) for m in metrics}
    divided = {m for m, names in parts.items() if len(names) > 1 and reach[names[1]] >= 1.0}
    return tuple(m for m in metrics if m in divided or any(gains[name] >= GAIN_REACH for name in parts[m]))


def budget(reduction: Reduction, model: ErrorModel | None = None) -> Budget:
    """Uncertainty budget of a reduction by the GUM: sensitivities times standard uncertainties, added in squares.

    Parameters
    ----------
    model : of this reduction, if it is made already
    """
    model = model or error_model(reduction)
    names, lacking = model.cascade.all_metrics, without_accuracy(model)
    measured = {name for name, channels in lacking.items() if not channels}
    given = [m for m in names if reduction.mean[m] is not None]
    stated = [m for m in names if measured.issuperset(parts_of(model.cascade, m))]
    complete = np.array([c.complete for c in reduction.cycles], dtype=bool)
    undetermined = _undetermined(model, complete, [m for m in stated if m in given])
    stated = [m for m in stated if m not in undetermined]
    parts, cycles = _contributions(reduction, model, stated)
    rows: dict[ErrorSource | None, dict[str, float]] = {}
    for k, source in enumerate(model.sources):  # gaps of all energies make one row
        row = rows.setdefault(source if source.part != "gap" else None, {})
        row.update({m: math.hypot(row.get(m, 0.0), x[k]) for m, x in parts.items()})
    values = {m: [c.metrics.value(m) for c in reduction.complete if c.metrics[m] is not None] for m in given}
    repeated = {m: x for m, x in values.items() if reduction.rig.phases.repeats and len(x) > 1}
    scatter = {m: float(np.std(x, ddof=1)) / math.sqrt(len(x)) for m, x in repeated.items()}
    sensors = {m: math.hypot(*x) for m, x in parts.items()}
    mean = {m: math.hypot(u, scatter.get(m, 0.0)) for m, u in sensors.items()}
    in_place = {n: s for n, s in reduction.rig.sensors.items() if s.u_zero is not None or s.u_gain is not None}
    bare = {n: msgspec.structs.replace(s, u_zero=None, u_gain=None) for n, s in in_place.items()}
    limited = msgspec.structs.replace(model, sources=tuple(_of_sensors(bare, model.energies)))
    by_limits, cycles_by_limits = _contributions(reduction, limited, stated if limited.sources else ())
    used = {name for energy in model.energies.values() for name in energy.channels}
    return Budget(
        rows=tuple(BudgetRow(source, Metrics(of, names)) for source, of in rows.items()),
        sensors=Metrics(sensors, names),
        repeatability=Metrics(scatter, names),
        mean=Metrics(mean, names),
        freedom=Metrics({m: _freedom(u, scatter.get(m, 0.0), len(values[m])) for m, u in mean.items()}, names),
        cycles=cycles,
        by_limits=Metrics({m: math.hypot(*x) for m, x in by_limits.items()}, names),
        cycles_by_limits=cycles_by_limits,
        exact=tuple(sorted(used.intersection(TAKEN_AS_EXACT) - {s.channel for s in model.sources})),
        unknown=tuple(sorted({channel for channels in lacking.values() for channel in channels})),
        undetermined=undetermined,
    )


def _cycles_with(reduction: Reduction, metric: str, counted: Mask | bool = True) -> Index:
    """Cycles, of those that are counted, that have a metric."""
    return np.flatnonzero(np.array([c.metrics[metric] is not None for c in reduction.cycles], dtype=bool) & counted)


def _contributions(
    reduction: Reduction, model: ErrorModel, metrics: Sequence[str]
) -> tuple[dict[str, Signal], tuple[Metrics, ...]]:
    """Change of the mean of each metric with each of m sources, (m,), and the uncertainties of every cycle."""
    complete = np.array([c.complete for c in reduction.cycles], dtype=bool)
    alone = np.array([source.part == "gap" for source in model.sources], dtype=bool)  # in each cycle
    parts, cycles = {}, [Metrics({}, model.cascade.all_metrics) for _ in reduction.cycles]
    for metric in metrics:
        rows = _cycles_with(reduction, metric)
        changes = model.changes(model.ratio(metric, rows))
        for k, u in zip(rows.tolist(), np.sqrt((changes**2).sum(axis=0)).tolist(), strict=True):
            cycles[k][metric] = u
        if reduction.mean[metric] is not None:
            counted = changes[:, complete[rows]]
            added = np.where(alone, np.sqrt((counted**2).sum(axis=1)), np.abs(counted.sum(axis=1)))
            parts[metric] = added / counted.shape[1]
    return parts, tuple(cycles)


def _freedom(combined: float, scatter: float, n: int) -> float:
    """Effective degrees of freedom: those of the scatter, n - 1, times (combined / scatter)^4 (GUM G.2b)."""
    return math.inf if scatter <= 1e-9 * combined else (n - 1) * (combined / scatter) ** 4


def uncertainty(reduction: Reduction, *, seed: int = SEED) -> Uncertainty:
    """State the uncertainty of the means of a reduction: budget by the GUM, intervals by draws of all errors.

    The mean of the cycles is drawn from Student's distribution, as few of them determine it only roughly (JCGM 101, 6.4.9). A
    single cycle does not show it, so its interval is that of the sensors alone.

    Parameters
    ----------
    seed : of the shift of the lattice

    Raises
    ------
    OptionError
        If `seed` is no whole number from 0 on, or `reduction` is something else.

    Examples
    --------
    >>> from winchcascade.reduction.reduce import reduce
    >>> from winchcascade.ingest.read import read_run
    >>> found = uncertainty(reduce(read_run("fixtures/campaign/r36ohm.csv"), window=5.48))
    >>> round(found.standard.eta_trans, 4), found.method["eta_trans"]
    (0.0019, 'gum')
    """
    check_type("uncertainty", reduction, Reduction, "reduce(run)")
    check_arguments("uncertainty", ("seed", seed, SEED_NUMBER))
    model = error_model(reduction)
    known, names = budget(reduction, model), model.cascade.all_metrics
    of_sources = zip(model.sources, *(of[1:] for of in _lattice(seed, 1 + len(model.sources))), strict=True)
    values = [s.u * normal if s.limit is None else s.limit * (2.0 * below - 1.0) for s, below, normal in of_sources]
    errors = model.errors(np.array(values).reshape(-1, DRAWS))
    complete = np.array([c.complete for c in reduction.cycles], dtype=bool)
    drawn, whole, alone = {}, {}, {}
    method: dict[str, Method] = {}
    for metric in known.mean:
        rows, scatter = _cycles_with(reduction, metric, complete), known.repeatability[metric] or 0.0
        x = model.ratio(metric, rows).mean().without(errors)[:, 0]
        drawn[metric] = math.hypot(float(np.std(x)), scatter)
        agree = abs(drawn[metric] - known.mean.value(metric)) <= LINEAR_WITHIN * drawn[metric]
        method[metric] = "gum" if agree else "monte_carlo"
        repeated = x + scatter * _student(seed, rows.size - 1) if scatter else x.copy()
        alone[metric], whole[metric] = (Interval(*quantiles_in_place(of, (0.025, 0.975))) for of in (x, repeated))
    stated = {m: known.mean[m] if way == "gum" else drawn[m] for m, way in method.items()}
    return Uncertainty(known, seed, DRAWS, Metrics(drawn, names), Metrics(stated, names), method, whole, alone)


@lru_cache(maxsize=4)
def _lattice(seed: int, errors: int) -> tuple[Signal, Signal]:
    """Share of its distribution that lies below each draw of each error, (errors, draws), evenly between 0 and 1; the standard
    normal values of these shares. They are kept for the next log of a campaign, which has the same sensors.
    """
    from scipy.special import ndtri

    shifts, draw = np.random.default_rng(seed).integers(DRAWS, size=(errors, 1)), np.arange(DRAWS)
    steps = np.array([pow(MULTIPLIER, k, DRAWS) for k in range(errors)])[:, None]
    below = ((draw * steps + shifts) % DRAWS + 0.5) / DRAWS
    return below, ndtri(below)


@lru_cache(maxsize=4)
def _student(seed: int, freedom: int) -> Signal:
    """Values of Student's distribution at the first error of the lattice, (draws,), kept for logs of as many cycles."""
    from scipy.special import stdtrit

    return np.asarray(stdtrit(freedom, _lattice(seed, 1)[0][0]))


def shares(part: Metrics, whole: Metrics) -> Metrics:
    """Share of the variance of each metric that one contribution makes. [1]

    >>> shares(Metrics(eta_trans=3.0), Metrics(eta_trans=5.0)).eta_trans
    0.36
    """
    return Metrics({m: (a / b) ** 2 for m, a in part.items() if a is not None and (b := whole[m])}, whole.known)


def budgeted(mean: Metrics) -> list[str]:
    """Metrics whose budget is shown: efficiencies, then energies of the window."""
    etas = [m for m in mean if m.startswith("eta")]
    return [*etas, *(m for m in mean if m.startswith("energy") and m not in NET_METRICS)]
