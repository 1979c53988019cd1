"""Energies of irregular waves: of each, of the whole record, and by classes of payout and period; of one log or of several."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.accuracy import Shape
from winchcascade.core.cascade import Stream
from winchcascade.core.integrate import integrals
from winchcascade.core.run import Index, Signal
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.gap_error import all_gaps, energy_error
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.reduction.uncertainty import (
    ErrorModel,
    StageEnergy,
    energy_errors,
    error_model,
    without_accuracy,
)
from winchcascade.reduction.wave_bootstrap import (
    TINY,
    EnergyError,
    RatioOfSums,
    efficiency_or_none,
    mean_power,
    ratio_of_sums,
)

NORMAL: Shape = "normal"
"""Distribution of what bridged gaps may have changed."""

MAX_CLASSES = 6
"""Classes of payout, and of period, at most."""

Pairs = Mapping[str, tuple[str, str]]
"""Stages that each efficiency leads from and to, by its name."""


class WaveClass(msgspec.Struct, frozen=True):
    """Waves whose payout and period lie in a class: their number, their energies together [J], ratios of these sums [1].

    `payout` is in metres, in radians for a shaft without a line; `period` in seconds.
    """

    payout: tuple[float, float]
    period: tuple[float, float]
    count: int
    energy: Mapping[str, float | None]
    efficiency: Mapping[str, float | None]


class WaveEnergies(msgspec.Struct, frozen=True):
    """Energies of the complete waves of a log, or of several, and of the whole records.

    Parameters
    ----------
    cycle : numbers of the waves, (k,)
    payout, payout_unit : travel of the positive half, (k,), in m, or rad for a shaft without a line
    period : (k,) [s]
    energy : of each wave, (k,), by stage [J]
    counts : number of waves of each log
    pairs : stages of each efficiency
    record_duration : of the records without long gaps [s]
    record_energy : over that, by stage [J]
    efficiency : of all waves together, by name
    power : mean powers of the record with their intervals, by stage
    classes : of payout and period
    errors : what the sources of uncertainty of the sensors change of the energies of all waves, and of the record
    unknown : channels of a stage without a stated accuracy, by stage
    """

    cycle: Index
    payout: Signal
    payout_unit: str
    period: Signal
    energy: Mapping[str, Signal]
    counts: tuple[int, ...]
    pairs: Pairs
    record_duration: float
    record_energy: Mapping[str, float]
    efficiency: Mapping[str, RatioOfSums] = msgspec.field(default_factory=dict)
    power: Mapping[str, RatioOfSums] = msgspec.field(default_factory=dict)
    classes: tuple[WaveClass, ...] = ()
    errors: tuple[EnergyError, ...] = ()
    unknown: Mapping[str, tuple[str, ...]] = msgspec.field(default_factory=dict)

    @property
    def record_power(self) -> dict[str, float]:
        """Mean powers of the record, by stage; none where gaps leave nothing of it. [W]"""
        whole = self.record_energy if self.record_duration > 0.0 else {}
        return {stage: joule / self.record_duration for stage, joule in whole.items()}


def wave_energies(reduction: Reduction) -> WaveEnergies:
    """Energies of the waves of a log, or of any cycles of it."""
    waves, cascade = reduction.complete, reduction.rig.cascade
    energy = {
        stage: np.array([c.metrics.value(f"energy_{stage}") for c in waves])
        for stage in cascade.names
        if all(c.metrics[f"energy_{stage}"] is not None for c in waves)
    }
    payout, unit = _payouts(reduction, waves)
    duration, record = _record(reduction)
    errors, unknown = _sensor_errors(reduction, energy)
    return _with_sums(
        WaveEnergies(
            cycle=np.array([c.cycle for c in waves], dtype=np.intp),
            payout=payout,
            payout_unit=unit,
            period=np.array([_period(reduction, c) for c in waves]),
            energy=energy,
            counts=(len(waves),),
            pairs=_pairs(reduction),
            record_duration=duration,
            record_energy=record,
            errors=errors,
            unknown=unknown,
        )
    )


def waves_of(reduction: Reduction) -> WaveEnergies | None:
    """Energies of the waves of a log where cycles are waves by the rig file; None where they are not."""
    return wave_energies(reduction) if reduction.rig.phases.source == "waves" else None


def joined_waves(logs: Sequence[WaveEnergies]) -> WaveEnergies:
    """Energies of the waves of several logs together, of the same stages and with a payout in the same unit.

    A source of uncertainty of a sensor is the same in all logs: the same instrument took them.
    """
    first = logs[0]
    return _with_sums(
        WaveEnergies(
            cycle=np.arange(1, sum(log.cycle.size for log in logs) + 1),
            payout=np.concatenate([log.payout for log in logs]),
            payout_unit=first.payout_unit,
            period=np.concatenate([log.period for log in logs]),
            energy={stage: np.concatenate([log.energy[stage] for log in logs]) for stage in first.energy},
            counts=tuple(n for log in logs for n in log.counts),
            pairs=first.pairs,
            record_duration=sum(log.record_duration for log in logs),
            record_energy={stage: sum(log.record_energy[stage] for log in logs) for stage in first.record_energy},
            errors=_joined_errors(error for log in logs for error in log.errors),
            unknown={
                stage: tuple(sorted({name for log in logs for name in log.unknown.get(stage, ())}))
                for stage in first.energy
            },
        )
    )


def _joined_errors(errors: Iterable[EnergyError]) -> tuple[EnergyError, ...]:
    """Errors of the same source in several logs: sums of what is shared, else the root of the sum of squares."""
    found: dict[tuple[str, str], EnergyError] = {}
    for error in errors:
        key = (error.source, error.part)
        if key not in found:
            found[key] = error
            continue
        known = found[key]
        found[key] = msgspec.structs.replace(
            error,
            energy=_added(known.energy, error.energy, shared=error.shared),
            record=_added(known.record, error.record, shared=error.shared),
        )
    return tuple(found.values())


def _added(one: Mapping[str, float], other: Mapping[str, float], *, shared: bool) -> dict[str, float]:
    """Changes of energies of two logs together, by stage. [J]"""
    both = {stage: (one.get(stage, 0.0), other.get(stage, 0.0)) for stage in {**one, **other}}
    return {stage: a + b if shared else math.hypot(a, b) for stage, (a, b) in both.items()}


def _with_sums(waves: WaveEnergies) -> WaveEnergies:
    """The same with efficiencies of all waves together, mean powers of the record, and classes."""
    efficiency = {}
    for name, (into, out) in waves.pairs.items():
        if into in waves.energy and out in waves.energy:
            x, y = waves.energy[into], waves.energy[out]
            sums = (into, float(x.sum())), (out, float(y.sum()))
            known = not (waves.unknown.get(into) or waves.unknown.get(out)) and sums[0][1] > NOTHING
            errors = [(e.of_ratio(*sums), e.shape) for e in waves.errors] if known else None
            found = ratio_of_sums(x, y, counts=waves.counts, errors=errors)
            efficiency[name] = msgspec.structs.replace(found, between=(into, out))
    power = {}
    for stage, joule in waves.record_energy.items():
        known = stage in waves.unknown and not waves.unknown[stage] and waves.record_duration > 0.0
        errors = [(e.record.get(stage, 0.0) / waves.record_duration, e.shape) for e in waves.errors] if known else None
        of = (waves.period, waves.energy[stage]) if stage in waves.energy else None
        power[stage] = mean_power((waves.record_duration, joule), of, counts=waves.counts, errors=errors)
    return msgspec.structs.replace(waves, efficiency=efficiency, power=power, classes=_classes(waves))


def _sensor_errors(
    reduction: Reduction, stages: Collection[str]
) -> tuple[tuple[EnergyError, ...], dict[str, tuple[str, ...]]]:
    """What the sources of uncertainty change of the energies of a log, and the channels without an accuracy, by stage."""
    model = error_model(reduction)
    of_record = {stage: _of_record(reduction, energy) for stage, energy in model.stages.items() if stage in stages}
    whole = {
        source: {stage: float(x[0]) for stage, x in joules.items()}
        for source, joules in energy_errors(ErrorModel(model.cascade, of_record, model.sources, {}))
    }
    of = [c.complete for c in reduction.cycles]
    found = []
    for source, joules in energy_errors(model):
        changed = {stage: x[of] for stage, x in joules.items() if stage in stages}
        both = {
            stage: float(x.sum()) if source is not None else float(np.sqrt(np.sum(x**2)))
            for stage, x in changed.items()
        }
        channel, part, shape = (
            ("bridged gaps", "", NORMAL) if source is None else (source.channel, source.part, source.shape)
        )
        found.append(EnergyError(channel, part, shape, source is not None, both, whole.get(source, {})))
    return tuple(found), {stage: channels for stage, channels in without_accuracy(model).items() if stage in stages}


def _of_record(reduction: Reduction, waves: StageEnergy) -> StageEnergy:
    """What gives the energy of a stage over the record for any errors of its channels, by what gives those of its waves."""
    run, gaps = reduction.run, _short_gaps(reduction)
    channels = [run.channels[name] for name in (waves.first, waves.second) if name is not None]
    watts = waves.scale * np.prod(channels, axis=0)
    time = _over_record(reduction, np.ones(run.t.size).__getitem__)
    whole = np.array([[run.t[0], run.t[-1]]])
    return msgspec.structs.replace(
        waves,
        xy=np.array([_over_record(reduction, watts.__getitem__) / waves.scale]),
        x=np.array([_over_record(reduction, channels[0].__getitem__)]),
        y=np.array([_over_record(reduction, channels[-1].__getitem__) if waves.second is not None else time]),
        t=np.array([time]),
        bridged=energy_error(run.t, watts, gaps, whole, np.zeros(1)) if len(gaps) else np.zeros(1),
        sampled=np.array([float(waves.sampled.sum()) * time / max(float(waves.t.sum()), TINY)]),
    )


def _pairs(reduction: Reduction) -> dict[str, tuple[str, str]]:
    """Stages that each efficiency leads from and to, without those that an open circuit does not have."""
    cascade = reduction.rig.cascade
    names = [m for m in cascade.ratios if not (reduction.run.open_circuit and cascade.undelivered(m))]
    return {name: cascade.between(name) for name in names}


def _payouts(reduction: Reduction, waves: Sequence[CycleResult]) -> tuple[Signal, str]:
    """Travel of each payout and its unit: of the line, else the angle of the shaft."""
    run = reduction.run
    travel = np.array([c.summary.payout.travel for c in waves], dtype=np.float64)
    if np.isfinite(travel).all() or "speed" not in run.channels:
        return travel, "m"
    spans = np.array([(c.phases.onset, c.phases.payout_end) for c in waves]).reshape(-1, 2)
    return integrals(run.t, run.channels["speed"].__getitem__, spans), "rad"


def _period(reduction: Reduction, wave: CycleResult) -> float:
    """Time from one upward zero crossing to the next; of other cycles that from onset to onset. [s]"""
    if reduction.rig.phases.source == "waves":
        return wave.window.cutoff - wave.window.onset
    return wave.net.end - wave.net.begin


def _record(reduction: Reduction) -> tuple[float, dict[str, float]]:
    """Length of the record without long gaps [s], and the energy of each stage over it [J]."""
    run, rig = reduction.run, reduction.rig
    streams = {stage.name: stage.stream(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    energy = {name: _over_record(reduction, watts) for name, watts in streams.items() if watts is not None}
    return float(run.t[-1] - run.t[0]) - float(np.ptp(_long_gaps(reduction), axis=1).sum()), energy


def _over_record(reduction: Reduction, stream: Stream) -> float:
    """Integral of a signal over the log without long gaps."""
    t, unknown = reduction.run.t, _long_gaps(reduction)
    lost = float(integrals(t, stream, unknown).sum()) if len(unknown) else 0.0
    return float(integrals(t, stream, np.array([[t[0], t[-1]]]))[0]) - lost


def _long_gaps(reduction: Reduction) -> Signal:
    """Gaps that are left out of the record, without overlaps, (k, 2). [s]"""
    gaps = all_gaps(reduction.run, reduction.rig.cascade.channels)
    return _united(gaps[gaps[:, 1] - gaps[:, 0] > reduction.rig.thresholds.gap_max])


def _short_gaps(reduction: Reduction) -> Signal:
    """Gaps that are bridged in the record, (k, 2). [s]"""
    gaps = all_gaps(reduction.run, reduction.rig.cascade.channels)
    return gaps[gaps[:, 1] - gaps[:, 0] <= reduction.rig.thresholds.gap_max]


def _united(gaps: Signal) -> Signal:
    """Gaps in order of time without overlaps, (k, 2). [s]"""
    found: list[list[float]] = []
    for begin, end in gaps.tolist():
        if found and begin <= found[-1][1]:
            found[-1][1] = max(found[-1][1], end)
        else:
            found.append([begin, end])
    return np.array(found).reshape(-1, 2)


def _classes(waves: WaveEnergies) -> tuple[WaveClass, ...]:
    """Classes of payout and period that have a wave, in rising order."""
    payout, period = waves.payout, waves.period
    if not payout.size or not np.isfinite(payout).all():
        return ()
    across, along = class_width(payout), class_width(period)
    places = np.column_stack((np.floor(payout / across), np.floor(period / along))).astype(np.intp)
    found = []
    for a, b in np.unique(places, axis=0).tolist():
        of = (places == (a, b)).all(axis=1)
        joule = {stage: float(x[of].sum()) for stage, x in waves.energy.items()}
        ends = (a * across, (a + 1) * across), (b * along, (b + 1) * along)
        found.append(WaveClass(*ends, int(of.sum()), joule, _ratios(joule, waves.pairs)))
    return tuple(found)


def _ratios(joule: Mapping[str, float], pairs: Pairs) -> dict[str, float | None]:
    return {name: efficiency_or_none(joule.get(out), joule.get(into)) for name, (into, out) in pairs.items()}


def class_width(x: Signal) -> float:
    """Width of classes that begin at zero: 1, 2 or 5 times a power of ten, and no more classes than `MAX_CLASSES`.

    >>> class_width(np.array([0.3, 4.0])), class_width(np.array([11.9]))
    (1.0, 2.0)
    """
    top = float(np.max(np.abs(x)))
    if not top > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(top / MAX_CLASSES))
    return next(width * power for width in (1.0, 2.0, 5.0, 10.0) if top < MAX_CLASSES * width * power)
