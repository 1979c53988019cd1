"""Standard uncertainty of every metric by the GUM (JCGM 100:2008): a budget of the sensors' errors, and repeatability.

A sensor reads (1 + gain) x + zero, both unknown but the same over the whole run, so neither averages out over its cycles.
As powers are products of two channels, the energy that the true channels would give follows from integrals that do not
depend on the errors; a Monte Carlo therefore never has to integrate again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import ErrorSource, error_sources
from winchcascade.core.integrate import integrals
from winchcascade.core.quantity import Quantity
from winchcascade.reduction.efficiency import ALL_METRICS, ALL_RATIOS, NOTHING, Metrics
from winchcascade.reduction.energies import sources
from winchcascade.reduction.net_energy import PARTS, SIGN, spans_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.reduction.reduction_result import Reduction

R_DRUM = "r_drum"
"""Name of the drum radius among the sources: it has a tolerance where a rig file states one."""

SAMPLING = "sampling"
"""Name of the sampling among the sources: its limit is what every second or third sample alone changes of a mean energy."""

TAKEN_AS_EXACT = ("velocity",)
"""Channels without a stated accuracy that count as exact: an encoder's counts have neither zero nor gain error."""


NORMAL_REACH = 3.0
"""A normal error reaches to so many standard uncertainties."""

GAIN_REACH = 0.9
"""A gain that may be off by this share of one tells nothing of what was read."""


class Contribution(msgspec.Struct, frozen=True):
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
    the errors together could change.
    """

    rows: tuple[Contribution, ...]
    sensors: Metrics
    repeatability: Metrics
    mean: Metrics
    freedom: Metrics
    cycles: tuple[Metrics, ...]
    exact: tuple[str, ...]
    unknown: tuple[str, ...]
    undetermined: tuple[str, ...] = ()
    reach: float = 0.0


class Stage(msgspec.Struct, frozen=True):
    """Integrals over k spans that give one of the energies in `PARTS` for any errors of its two channels, each (k,).

    The product of the channels, each alone, and the length of the span [s], 0 for a cycle without this energy; `second` is
    None for a stage that is one logged power. `scale` turns the product into a power; it holds the drum's radius where
    `by_radius` says so. `bridged` is what gaps may have changed of each energy, `sampled` what thinning
    changes of it [J].
    """

    first: str
    second: str | None
    xy: Signal
    x: Signal
    y: Signal
    t: Signal
    scale: float
    by_radius: bool
    bridged: Signal
    sampled: Signal

    @property
    def energy(self) -> Signal:
        """Energies as reduced, (k,) [J]."""
        return self.scale * self.xy


def stage_integrals(reduction: Reduction) -> dict[str, Stage]:
    """Integrate what the energies of each measured stage are made of, over the window and the whole of every cycle."""
    run, rig, cycles = reduction.run, reduction.rig, reduction.cycles
    spans = spans_of([c.window for c in cycles], [c.phases for c in cycles], [c.net for c in cycles])
    alone: dict[str, dict[str, Signal]] = {}
    stages = {}
    for part, (stage, span) in PARTS.items():
        energy = [getattr(c.metrics, f"energy_{part}") for c in cycles]
        if all(joule is None for joule in energy):
            continue
        names = sources(run.channels, stage)
        for name in names:
            if name not in alone:
                whole = integrals(run.t, run.channels[name].__getitem__, np.concatenate(list(spans.values())))
                alone[name] = dict(zip(spans, np.split(whole, len(spans)), strict=True))
        t = spans[span][:, 1] - spans[span][:, 0]
        by_radius = stage == "mech" and len(names) == 2
        scale = 1.0 / rig.r_drum if by_radius and rig.r_drum is not None else SIGN.get(part, 1.0)
        stages[part] = Stage(
            first=names[0],
            second=names[1] if len(names) == 2 else None,
            xy=np.array([joule or 0.0 for joule in energy]) / scale,
            x=alone[names[0]][span],
            y=alone[names[1]][span] if len(names) == 2 else t,
            t=t,
            scale=scale,
            by_radius=by_radius,
            bridged=np.array(reduction.bridged.get(part, [0.0] * len(energy))),
            sampled=np.array(reduction.sampled.get(part, [0.0] * len(energy))),
        )
    return stages


def counted(reduction: Reduction) -> dict[str, NDArray[np.bool_]]:
    """Cycles over which the mean of each metric is taken, (k,)."""
    return {
        m: np.array([c.complete and getattr(c.metrics, m) is not None for c in reduction.cycles], dtype=bool)
        for m in ALL_METRICS
    }


def budget(reduction: Reduction) -> Budget:
    """Uncertainty budget of a reduction by the GUM: sensitivities times standard uncertainties, added in squares.

    Sensor errors are the same in every cycle and act on all means at once; repeatability is s/sqrt(N) of the cycles.
    """
    stages = stage_integrals(reduction)
    complete = np.array([c.complete for c in reduction.cycles], dtype=bool)
    known = run_sources(reduction.rig, stages)
    unknown = _without_accuracy(stages, known)
    given = [m for m in ALL_METRICS if getattr(reduction.mean, m) is not None]
    rows_of = counted(reduction)
    stated = [m for m in ALL_METRICS if not (channels_of(m, stages) & set(unknown)) and _stages_of(m) <= set(stages)]
    reach, gains = _reach(known, stages, complete)
    undetermined = [m for m in stated if m in given and _is_undetermined(m, reach, gains)]
    stated = [m for m in stated if m not in undetermined]
    rows = []
    square = {m: np.zeros(len(reduction.cycles)) for m in stated}
    mean_square = dict.fromkeys(stated, 0.0)
    changes: list[tuple[ErrorSource | None, dict[str, Signal]]] = [(s, _changes(s, stages, stated)) for s in known]
    if any(stage.bridged.any() for stage in stages.values()):
        changes.append((None, _bridging(stages, stated)))
    for source, changed in changes:
        of = {m: _of_mean(x[rows_of[m]], shared=source is not None) for m, x in changed.items() if m in given}
        rows.append(Contribution(source, Metrics(**of)))
        for m, x in changed.items():
            square[m] += x**2
            mean_square[m] += of.get(m, 0.0) ** 2
    sensors = {m: math.sqrt(mean_square[m]) for m in stated if m in given}
    scatter = _repeatability([c.metrics for c in reduction.complete], given)
    mean = {m: math.hypot(u, scatter.get(m, 0.0)) for m, u in sensors.items()}
    return Budget(
        rows=tuple(rows),
        sensors=Metrics(**sensors),
        repeatability=Metrics(**scatter),
        mean=Metrics(**mean),
        freedom=Metrics(**{m: _freedom(u, scatter.get(m, 0.0), int(rows_of[m].sum())) for m, u in mean.items()}),
        cycles=tuple(
            Metrics(**{m: math.sqrt(square[m][k]) for m in stated if getattr(c.metrics, m) is not None})
            for k, c in enumerate(reduction.cycles)
        ),
        exact=tuple(sorted(_channels(stages) & set(TAKEN_AS_EXACT) - {s.channel for s in known})),
        unknown=unknown,
        undetermined=tuple(undetermined),
        reach=max((reach[s] for pair in ALL_RATIOS.values() for s in map(_stage_of, pair) if s in reach), default=0.0),
    )


def _reach(
    known: Sequence[ErrorSource], stages: Mapping[str, Stage], complete: NDArray[np.bool_]
) -> tuple[dict[str, float], dict[str, float]]:
    """Largest share of each stage's energy, in any cycle, that all errors together could change, and that gains could."""
    reach, gains = dict.fromkeys(stages, 0.0), dict.fromkeys(stages, 0.0)
    for name, stage in stages.items():
        energy = np.maximum(np.abs(stage.energy), NOTHING)
        for source in known:
            most = NORMAL_REACH * source.u if source.limit is None else source.limit
            share = (np.abs(_energy_slope(source, stage)) / energy)[complete & (stage.t > 0)]
            reach[name] += most * float(np.max(share, initial=0.0))
            gains[name] += most * float(np.any(share)) if source.part == "gain" else 0.0
    return reach, gains


def _is_undetermined(metric: str, reach: Mapping[str, float], gains: Mapping[str, float]) -> bool:
    """Whether the errors could take away all of what a metric is divided by: an energy, or one plus a gain."""
    into = _stage_of(ALL_RATIOS[metric][1]) if metric in ALL_RATIOS else None
    return any(gains[s] >= GAIN_REACH for s in _stages_of(metric)) or (into is not None and reach[into] >= 1.0)


def shares(part: Metrics, whole: Metrics) -> Metrics:
    """Share of the variance of each metric that one contribution makes. [1]

    >>> shares(Metrics(eta_trans=3.0), Metrics(eta_trans=5.0)).eta_trans
    0.36
    """
    pairs = {m: (getattr(part, m), getattr(whole, m)) for m in ALL_METRICS}
    return Metrics(**{m: (a / b) ** 2 for m, (a, b) in pairs.items() if a is not None and b})


def run_sources(rig: Rig, stages: Mapping[str, Stage]) -> list[ErrorSource]:
    """Every source of uncertainty of the stages of a run: sensors of their channels, drum radius, and coarse sampling."""
    found: list[ErrorSource] = []
    for channel in sorted(_channels(stages)):
        if channel in rig.sensors:
            found += error_sources(channel, rig.sensors[channel])
    radius: Quantity | None = rig.winch.r_drum
    if any(s.by_radius for s in stages.values()) and radius is not None and radius.tolerance:
        found.append(ErrorSource(R_DRUM, "gain", radius.tolerance / radius.value, None, radius.source))
    limit = sampling_limit(stages)
    if limit > 0.0:
        found.append(
            ErrorSource(SAMPLING, "gain", limit / math.sqrt(3.0), limit, "reduction of every second and third sample")
        )
    return found


def sampling_limit(stages: Mapping[str, Stage]) -> float:
    """Largest share of a stage's energy, all cycles together, that thinning the log changes. [1]"""
    energies = [(abs(float(s.sampled.sum())), abs(float(s.energy.sum()))) for s in stages.values()]
    return max((changed / energy for changed, energy in energies if energy > NOTHING), default=0.0)


def channels_of(metric: str, stages: Mapping[str, Stage]) -> set[str]:
    """Channels that a metric is made of."""
    found = [(stages[s].first, stages[s].second) for s in _stages_of(metric) if s in stages]
    return {name for pair in found for name in pair if name is not None}


def _stages_of(metric: str) -> set[str]:
    """Stages, by their names in `PARTS`, that a metric is made of."""
    return {_stage_of(name) for name in ALL_RATIOS.get(metric, (metric.replace("power_", "energy_"),))}


def _stage_of(energy: str) -> str:
    return energy.removeprefix("energy_")


def _channels(stages: Mapping[str, Stage]) -> set[str]:
    return {name for s in stages.values() for name in (s.first, s.second) if name is not None}


def _without_accuracy(stages: Mapping[str, Stage], known: Sequence[ErrorSource]) -> tuple[str, ...]:
    return tuple(sorted(_channels(stages) - {s.channel for s in known} - set(TAKEN_AS_EXACT)))


def _of_mean(changed: Signal, *, shared: bool) -> float:
    """Change of a mean by those of its cycles: an error that all share moves them together, others average out."""
    return abs(float(np.mean(changed))) if shared else math.sqrt(float(np.sum(changed**2))) / changed.size


def _changes(source: ErrorSource, stages: Mapping[str, Stage], metrics: Sequence[str]) -> dict[str, Signal]:
    """Change of each metric of each cycle with one standard uncertainty of a source, (k,) each."""
    joules = {name: source.u * _energy_slope(source, stage) for name, stage in stages.items()}
    return _of_metrics(joules, stages, metrics, independent=False)


def _energy_slope(source: ErrorSource, stage: Stage) -> Signal:
    """Change of a stage's energy with a source, (k,): what is read too high has to be taken off."""
    if source.channel == R_DRUM:
        return -stage.energy if stage.by_radius else np.zeros_like(stage.xy)
    if source.channel == SAMPLING:
        return stage.sampled / (source.limit or 1.0)
    if source.channel not in (stage.first, stage.second):
        return np.zeros_like(stage.xy)
    if source.part == "gain":
        return -stage.energy
    return -stage.scale * (stage.y if source.channel == stage.first else stage.x)


def _bridging(stages: Mapping[str, Stage], metrics: Sequence[str]) -> dict[str, Signal]:
    """What bridged gaps may have changed of each metric of each cycle, (k,), as a standard uncertainty."""
    errors = {name: stage.bridged / math.sqrt(3.0) for name, stage in stages.items()}
    return _of_metrics(errors, stages, metrics, independent=True)


def _of_metrics(
    joules: Mapping[str, Signal],
    stages: Mapping[str, Stage],
    metrics: Sequence[str],
    *,
    independent: bool,
) -> dict[str, Signal]:
    """Carry changes of the stages' energies over to the metrics; those of two stages cancel unless independent."""
    changed = {}
    for metric in metrics:
        if metric in ALL_RATIOS:
            out, into = map(_stage_of, ALL_RATIOS[metric])
            taken = stages[into].energy
            taken = np.where(np.abs(taken) > NOTHING, taken, np.inf)  # no ratio is made of nothing
            up, down = joules[out] / taken, stages[out].energy / taken * (joules[into] / taken)
            changed[metric] = np.hypot(up, down) if independent else up - down
        else:
            kind, stage = metric.split("_", 1)
            per = np.maximum(stages[stage].t, 1e-12) if kind == "power" else 1.0
            changed[metric] = joules[stage] / per
    return changed


def _repeatability(cycles: Sequence[Metrics], given: Sequence[str]) -> dict[str, float]:
    """Standard uncertainty of each mean from the scatter of the cycles, s/sqrt(N); nothing for a single one."""
    columns = {m: [x for c in cycles if (x := getattr(c, m)) is not None] for m in given}
    return {m: float(np.std(x, ddof=1)) / math.sqrt(len(x)) for m, x in columns.items() if len(x) > 1}


def _freedom(combined: float, scatter: float, n: int) -> float:
    """Effective degrees of freedom: those of the scatter, n - 1, times (combined / scatter)^4 (GUM G.2b)."""
    return math.inf if scatter <= 1e-9 * combined else (n - 1) * (combined / scatter) ** 4
