"""Standard uncertainty of every metric by the GUM (JCGM 100:2008): a budget of the sensors' errors, and repeatability.

A sensor reads (1 + gain) x + zero, both unknown but the same over the whole run, so neither averages out over its cycles.
As powers are products of two channels, the energy that the true channels would give follows from integrals that do not
depend on the errors; a Monte Carlo therefore never has to integrate again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.accuracy import Basis, ErrorSource, error_sources, replaced_sources
from winchcascade.core.cascade import Cascade, Term
from winchcascade.core.integrate import integrals_of
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.reduction.efficiency import NET_METRICS, NOTHING, Metrics
from winchcascade.reduction.energies import SIGN, spans_of
from winchcascade.reduction.reduction_result import Reduction

R_DRUM = "r_drum"
"""Name of the drum radius among the sources: it has an uncertainty where a rig file states one."""

SAMPLING = "sampling"
"""Name of the sampling among the sources: its limit is what every second or third sample alone changes of a mean energy."""

TAKEN_AS_EXACT = ("velocity",)
"""Channels without a stated accuracy that count as exact: an encoder's counts have neither zero nor gain error."""


NORMAL_REACH = 3.0
"""Largest normal error that is considered, in standard uncertainties."""

GAIN_REACH = 0.9
"""Smallest error of a gain, as a share of one, with which a reading is no measurement."""


class BudgetRow(msgspec.Struct, frozen=True):
    """One row of the budget: what a source contributes to the standard uncertainty of each mean, in its unit.

    The row without a source is what straight lines over gaps may have missed, by the intact data beside them.
    """

    source: ErrorSource | None
    of: Metrics


class Budget(msgspec.Struct, frozen=True):
    """What is known of the uncertainty of a reduction, all as standard uncertainties in the metrics' units.

    `sensors` and `repeatability` are the two parts of `mean`: the sensors' errors, systematic over the run (type B), and
    s/sqrt(N) of the complete cycles (type A; None for a single cycle, whose repeatability is unknown). `cycles` are those
    of every cycle, without repeatability. `freedom` are effective degrees of freedom (Welch and Satterthwaite, GUM G.4).
    A metric that needs a channel of `unknown` has none: the rig file states no accuracy for it. Nor has one of
    `undetermined`: the errors could take away all of what it is divided by. `reach` is the largest share of an energy that
    the errors together could change. `by_limits` and `cycles_by_limits` are what the accuracies of the sensors that are
    calibrated in place would leave of the means and of every cycle: no part of `mean`, but of a table whose reader knows
    these alone.
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
    reach: float = 0.0


class StageEnergy(msgspec.Struct, frozen=True):
    """Integrals over k spans that give one energy of a cascade for any errors of its two channels, each (k,).

    The product of the channels, each alone, and the length of the span [s], 0 for a cycle without this energy; `second` is
    None for a stage that is one logged power. `scale` turns the product into a power. `radius_power` is the power of the stated
    drum radius that the energy is proportional to. `bridged` is what gaps may have changed of each energy, `sampled` what
    thinning changes of it [J].
    """

    first: str
    second: str | None
    xy: Signal
    x: Signal
    y: Signal
    t: Signal
    scale: float
    radius_power: int
    bridged: Signal
    sampled: Signal

    @property
    def energy(self) -> Signal:
        """Energies as reduced, (k,) [J]."""
        return self.scale * self.xy

    @property
    def channels(self) -> set[str]:
        """Channels of which the stage is made."""
        return {self.first} if self.second is None else {self.first, self.second}


class ErrorModel(msgspec.Struct, frozen=True):
    """What errors act on: the measured energies by their names in the parts of the cascade, the sources of uncertainty of the
    run, and the indices of the cycles over which the mean of each metric is taken."""

    cascade: Cascade
    stages: Mapping[str, StageEnergy]
    sources: tuple[ErrorSource, ...]
    rows: Mapping[str, Index]


def error_model(reduction: Reduction) -> ErrorModel:
    """Integrate the stages of a reduction, and list its sources of uncertainty."""
    stages = _stage_integrals(reduction)
    complete = [(k, c.metrics) for k, c in enumerate(reduction.cycles) if c.complete]
    of_metrics = {m: tuple(k for k, of in complete if of[m] is not None) for m in reduction.rig.cascade.all_metrics}
    indices = {own: np.array(own, dtype=np.intp) for own in set(of_metrics.values())}
    rows = {m: indices[own] for m, own in of_metrics.items()}
    return ErrorModel(reduction.rig.cascade, stages, tuple(_sources(reduction.rig, stages)), rows)


def _stage_integrals(reduction: Reduction) -> dict[str, StageEnergy]:
    """Integrate what the energies of each measured stage are made of, over the window and the whole of every cycle."""
    run, rig, cycles = reduction.run, reduction.rig, reduction.cycles
    spans = spans_of([c.window for c in cycles], [c.phases for c in cycles], [c.net for c in cycles])
    powers = {stage.name: stage.power(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    products = {name: power.terms[0] for name, power in powers.items() if power and len(power.terms) == 1}
    channels = dict.fromkeys(name for product in products.values() for name in product.channels)
    streams = [run.channels[name].__getitem__ for name in channels]
    whole = integrals_of(run.t, streams, np.concatenate(list(spans.values()))).reshape(
        len(channels), len(spans), len(cycles)
    )
    alone = {name: dict(zip(spans, of_spans, strict=True)) for name, of_spans in zip(channels, whole, strict=True)}
    stages, on_drum = {}, _is_on_drum(run, rig)
    for part, (stage, span) in rig.cascade.parts.items():
        energy, product = [c.metrics[f"energy_{part}"] for c in cycles], products.get(stage)
        if product is None or all(joule is None for joule in energy):
            continue
        names = product.channels
        t = spans[span][:, 1] - spans[span][:, 0]
        scale = SIGN.get(part, 1.0) * product.scale(rig.r_drum)
        stages[part] = StageEnergy(
            first=names[0],
            second=names[1] if len(names) == 2 else None,
            xy=np.array([joule or 0.0 for joule in energy]) / scale,
            x=alone[names[0]][span],
            y=alone[names[1]][span] if len(names) == 2 else t,
            t=t,
            scale=scale,
            radius_power=_radius_power(product, on_drum=on_drum),
            bridged=np.array(reduction.bridged.get(part, [0.0] * len(energy))),
            sampled=np.array(reduction.sampled.get(part, [0.0] * len(energy))),
        )
    return stages


def _is_on_drum(run: Run, rig: Rig) -> bool:
    """Whether the line velocity is the stated drum radius times the speed of the drum, and not measured on the line."""
    motion, speed = run.channels.get("velocity"), run.channels.get("speed")
    if rig.winch.motion == "drum" or motion is None or speed is None or rig.r_drum is None:
        return rig.winch.motion == "drum"
    return bool(np.allclose(motion, speed * rig.r_drum, rtol=1e-9, atol=1e-9))


def _radius_power(product: Term, *, on_drum: bool) -> int:
    """Power of the stated drum radius that a power is proportional to.

    An encoder on the drum counts v = r omega: F v is proportional to r, tau v / r = tau omega is not. Of a velocity that is
    measured on the line it is the other way round.
    """
    return (on_drum and "velocity" in product.channels) - product.by_radius


def budget(reduction: Reduction, model: ErrorModel | None = None) -> Budget:
    """Uncertainty budget of a reduction by the GUM: sensitivities times standard uncertainties, added in squares.

    Sensor errors are the same in every cycle and act on all means at once; repeatability is s/sqrt(N) of the cycles.

    Parameters
    ----------
    model : of this reduction, if it is made already
    """
    model = model or error_model(reduction)
    stages, rows_of = model.stages, model.rows
    channels, with_accuracy = _channels(stages), {s.channel for s in model.sources}
    unknown = {channel for of_stage in without_accuracy(model).values() for channel in of_stage}
    measured = {name for name, stage in stages.items() if not stage.channels & unknown}
    cascade, names = model.cascade, model.cascade.all_metrics
    given = [m for m in cascade.all_metrics if reduction.mean[m] is not None]
    stated = [m for m in cascade.all_metrics if _stages_of(cascade, m) <= measured]
    slopes = _energy_slopes(model)
    reach, gains = _reach(model, slopes, np.array([c.complete for c in reduction.cycles], dtype=bool))
    undetermined = [m for m in stated if m in given and _is_undetermined(cascade, m, reach, gains)]
    stated = [m for m in stated if m not in undetermined]
    rows: list[BudgetRow] = []
    square = {m: np.zeros(len(reduction.cycles)) for m in stated}
    mean_square = dict.fromkeys(stated, 0.0)
    for sources, joules in _errors_alike(model, slopes):
        shared = sources != (None,)
        changed = _of_metrics(joules, model, stated, independent=not shared)
        of = {m: _of_mean(x[:, rows_of[m]], shared=shared) for m, x in changed.items() if m in given}
        rows += [
            BudgetRow(source, Metrics({m: float(u[k]) for m, u in of.items()}, names))
            for k, source in enumerate(sources)
        ]
        for m, x in changed.items():
            square[m] += (x * x).sum(axis=0)
            mean_square[m] += float(of[m] @ of[m]) if m in of else 0.0
    sensors = {m: math.sqrt(mean_square[m]) for m in stated if m in given}
    columns = {m: [reduction.cycles[k].metrics.value(m) for k in rows_of[m].tolist()] for m in given}
    repeats = reduction.rig.phases.repeats
    scatter = {m: _error_of_mean(x) for m, x in columns.items() if repeats and len(x) > 1}
    mean = {m: math.hypot(u, scatter.get(m, 0.0)) for m, u in sensors.items()}
    by_limits, cycles_by_limits = _by_limits(reduction, model, stated)
    return Budget(
        rows=tuple(rows),
        sensors=Metrics(sensors, names),
        repeatability=Metrics(scatter, names),
        mean=Metrics(mean, names),
        freedom=Metrics({m: _freedom(u, scatter.get(m, 0.0), rows_of[m].size) for m, u in mean.items()}, names),
        cycles=tuple(
            Metrics({m: math.sqrt(square[m][k]) for m in stated if c.metrics[m] is not None}, names)
            for k, c in enumerate(reduction.cycles)
        ),
        by_limits=by_limits,
        cycles_by_limits=cycles_by_limits,
        exact=tuple(sorted(channels & set(TAKEN_AS_EXACT) - with_accuracy)),
        unknown=tuple(sorted(unknown)),
        undetermined=tuple(undetermined),
        reach=max((reach[s] for m in cascade.all_ratios for s in _stages_of(cascade, m) if s in reach), default=0.0),
    )


def _by_limits(reduction: Reduction, model: ErrorModel, metrics: Sequence[str]) -> tuple[Metrics, tuple[Metrics, ...]]:
    """Standard uncertainties of means and cycles by the accuracies that calibrations in place replace; empty without any."""
    sources = _of_sensors(reduction.rig, model.stages, replaced_sources)
    if not sources:
        return Metrics(), (Metrics(),) * len(reduction.cycles)
    limited, names = msgspec.structs.replace(model, sources=tuple(sources)), model.cascade.all_metrics
    ((_, joules), *_) = _errors_alike(limited, _energy_slopes(limited))
    changed = _of_metrics(joules, limited, metrics, independent=False)
    means = {m: _of_mean(x[:, model.rows[m]], shared=True) for m, x in changed.items() if model.rows[m].size}
    cycles = {m: np.sqrt((x * x).sum(axis=0)) for m, x in changed.items()}
    return Metrics({m: math.sqrt(u @ u) for m, u in means.items()}, names), tuple(
        Metrics({m: float(u[k]) for m, u in cycles.items() if c.metrics[m] is not None}, names)
        for k, c in enumerate(reduction.cycles)
    )


def _reach(
    model: ErrorModel, slopes: Mapping[str, Signal], complete: Mask
) -> tuple[dict[str, float], dict[str, float]]:
    """Largest share of the energy of each stage, in any cycle, that all errors together could change, and that gains could."""
    maximum = np.array([NORMAL_REACH * s.u if s.limit is None else s.limit for s in model.sources])
    is_gain = np.array([s.part == "gain" for s in model.sources], dtype=bool)
    reach, gains = {}, {}
    for name, stage in model.stages.items():
        energy = np.maximum(np.abs(stage.energy), NOTHING)
        share = (np.abs(slopes[name]) / energy)[:, complete & (stage.t > 0)].max(axis=1, initial=0.0)
        reach[name], gains[name] = float(maximum @ share), float(maximum[is_gain & (share > 0.0)].sum())
    return reach, gains


def _is_undetermined(cascade: Cascade, metric: str, reach: Mapping[str, float], gains: Mapping[str, float]) -> bool:
    """Whether the errors could take away all of what a metric is divided by: an energy, or one plus a gain."""
    divided = metric in cascade.all_ratios and reach[_stage_of(cascade.all_ratios[metric][1])] >= 1.0
    return divided or any(gains[s] >= GAIN_REACH for s in _stages_of(cascade, metric))


def without_accuracy(model: ErrorModel) -> dict[str, tuple[str, ...]]:
    """Channels of each stage for which the rig file states no accuracy, without those that count as exact."""
    stated = {s.channel for s in model.sources}.union(TAKEN_AS_EXACT)
    return {name: tuple(sorted(stage.channels - stated)) for name, stage in model.stages.items()}


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


def _sources(rig: Rig, stages: Mapping[str, StageEnergy]) -> list[ErrorSource]:
    """Every source of uncertainty of the stages of a run: sensors of their channels, drum radius, and coarse sampling."""
    found = _of_sensors(rig, stages, error_sources)
    radius = rig.winch.r_drum
    if any(s.radius_power for s in stages.values()) and radius is not None and radius.u:
        u = radius.u / radius.value
        basis: Basis = "limits" if radius.rectangular else "standard_uncertainty"
        limit = math.sqrt(3.0) * u if radius.rectangular else None
        found.append(ErrorSource(R_DRUM, "gain", u, limit, radius.source, basis))
    if limit := sampling_limit(stages):
        origin = "reduction of every second and third sample"
        found.append(ErrorSource(SAMPLING, "gain", limit / math.sqrt(3.0), limit, origin, "resampling"))
    return found


def _of_sensors(
    rig: Rig, stages: Mapping[str, StageEnergy], of: Callable[[str, Sensor], tuple[ErrorSource, ...]]
) -> list[ErrorSource]:
    """Errors of the sensors of all channels that the stages are made of."""
    sensors = {name: rig.sensors[name] for name in sorted(_channels(stages)) if name in rig.sensors}
    return [source for name, sensor in sensors.items() for source in of(name, sensor)]


def sampling_limit(stages: Mapping[str, StageEnergy]) -> float:
    """Largest share of a stage's energy, all cycles together, that thinning the log changes. [1]"""
    energies = [(abs(float(s.sampled.sum())), abs(float(s.energy.sum()))) for s in stages.values()]
    return max((changed / energy for changed, energy in energies if energy > NOTHING), default=0.0)


def _stages_of(cascade: Cascade, metric: str) -> set[str]:
    """Energies, by their names in the parts of the cascade, that a metric is made of."""
    return {_stage_of(name) for name in cascade.all_ratios.get(metric, (metric.replace("power_", "energy_"),))}


def _stage_of(energy: str) -> str:
    return energy.removeprefix("energy_")


def _channels(stages: Mapping[str, StageEnergy]) -> set[str]:
    return set().union(*(stage.channels for stage in stages.values()))


def _of_mean(changed: Signal, *, shared: bool) -> Signal:
    """Changes of a mean by those of its cycles, (n,) from (n, k): what all share moves them together, the rest averages out."""
    whole = np.abs(changed.sum(axis=1)) if shared else np.sqrt((changed * changed).sum(axis=1))
    return np.asarray(whole / changed.shape[1])


def _error_of_mean(values: Sequence[float]) -> float:
    """Standard deviation of the mean of two or more values, s / sqrt(N)."""
    x = np.asarray(values)
    about = x - x.sum() / x.size
    return math.sqrt(float(about @ about) / (x.size - 1) / x.size)


def energy_errors(model: ErrorModel) -> list[tuple[ErrorSource | None, dict[str, Signal]]]:
    """Change of the energy of each stage in each cycle with one standard uncertainty of a source, (k,) each [J].

    The last row, without a source, is what bridged gaps may have changed, as a standard uncertainty.
    """
    return [
        (source, {name: changed[k] for name, changed in joules.items()})
        for sources, joules in _errors_alike(model, _energy_slopes(model))
        for k, source in enumerate(sources)
    ]


def _errors_alike(
    model: ErrorModel, slopes: Mapping[str, Signal]
) -> list[tuple[tuple[ErrorSource | None, ...], dict[str, Signal]]]:
    """The n sources that act on all cycles at once, and None for the bridged gaps, which do not; each with the changes of the
    energies by one standard uncertainty, (n, k). [J]
    """
    u = np.array([source.u for source in model.sources])[:, None]
    errors: list[tuple[tuple[ErrorSource | None, ...], dict[str, Signal]]] = []
    if model.sources:
        errors.append((model.sources, {name: u * slope for name, slope in slopes.items()}))
    bridged = {name: stage.bridged[None] / math.sqrt(3.0) for name, stage in model.stages.items()}
    return [*errors, ((None,), bridged)] if any(part.any() for part in bridged.values()) else errors


def _energy_slopes(model: ErrorModel) -> dict[str, Signal]:
    """Change of the energy of each stage with each of n sources, (n, k)."""
    return {name: _stage_slopes(model.sources, stage) for name, stage in model.stages.items()}


def _stage_slopes(sources: Sequence[ErrorSource], stage: StageEnergy) -> Signal:
    """Change of a stage's energy with each of n sources, (n, k): what is read too high has to be taken off."""
    slopes = np.zeros((len(sources), stage.xy.size))
    for slope, source in zip(slopes, sources, strict=True):
        if source.channel == SAMPLING:
            slope[:] = stage.sampled / (source.limit or 1.0)
        elif source.channel == R_DRUM:
            slope[:] = -stage.radius_power * stage.energy
        elif source.channel in (stage.first, stage.second):
            other = stage.y if source.channel == stage.first else stage.x
            slope[:] = -stage.energy if source.part == "gain" else -stage.scale * other
    return slopes


def _of_metrics(
    joules: Mapping[str, Signal],
    model: ErrorModel,
    metrics: Sequence[str],
    *,
    independent: bool,
) -> dict[str, Signal]:
    """Carry changes of energies, (n, k) each, over to the metrics; those of two stages cancel unless independent."""
    changed, stages, ratios = {}, model.stages, model.cascade.all_ratios
    for metric in metrics:
        if metric in ratios:
            out, into = map(_stage_of, ratios[metric])
            energy = stages[into].energy
            taken = np.where(np.abs(energy) > NOTHING, energy, np.inf)  # nothing divided by nothing is no ratio
            up, down = joules[out] / taken, stages[out].energy / taken * (joules[into] / taken)
            changed[metric] = np.hypot(up, down) if independent else up - down
        else:
            kind, stage = metric.split("_", 1)
            per = np.maximum(stages[stage].t, 1e-12) if kind == "power" else 1.0
            changed[metric] = joules[stage] / per
    return changed


def _freedom(combined: float, scatter: float, n: int) -> float:
    """Effective degrees of freedom: those of the scatter, n - 1, times (combined / scatter)^4 (GUM G.2b)."""
    return math.inf if scatter <= 1e-9 * combined else (n - 1) * (combined / scatter) ** 4
