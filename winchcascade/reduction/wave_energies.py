"""Energies of irregular waves: of each and of the whole record, of one log or of several, and the block `waves` of the JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

import msgspec
import numpy as np
from msgspec import UNSET
from msgspec.structs import asdict

from winchcascade.core.cascade import Stream, field_of
from winchcascade.core.integrate import integrals, integrals_of
from winchcascade.core.run import Index, Signal
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.gap_error import all_gaps, energy_error
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import CampaignWavesRecord, RunRecord, WavesRecord
from winchcascade.reduction.uncertainty import Energy, error_model, integrands, without_accuracy
from winchcascade.reduction.wave_bootstrap import (
    DRAWS,
    SEED,
    TINY,
    EnergyError,
    RatioOfSums,
    mean_power,
    ratio_of_sums,
)


class WaveEnergies(msgspec.Struct, frozen=True):
    """Energies of the complete waves of a log, or of several, and of the whole records.

    Parameters
    ----------
    cycle : numbers of the waves, (k,)
    payout, payout_unit : travel of the positive half, (k,), in m, or rad for a shaft without a line
    period : (k,) [s]
    energy : of each wave, (k,), by stage [J]
    counts : number of waves of each log
    pairs : stages that each efficiency leads from and to
    record_duration : of the records without long gaps [s]
    record_energy : over that, by stage [J]
    efficiency : of all waves together, by name
    power : mean powers of the record with their intervals, by stage
    errors : what the sources of uncertainty of the sensors change of the energies of all waves, and of the record
    unknown : channels of a stage without a stated accuracy, by stage
    """

    cycle: Index
    payout: Signal
    payout_unit: str
    period: Signal
    energy: Mapping[str, Signal]
    counts: tuple[int, ...]
    pairs: Mapping[str, tuple[str, str]]
    record_duration: float
    record_energy: Mapping[str, float]
    efficiency: Mapping[str, RatioOfSums] = msgspec.field(default_factory=dict)
    power: Mapping[str, RatioOfSums] = msgspec.field(default_factory=dict)
    errors: tuple[EnergyError, ...] = ()
    unknown: Mapping[str, tuple[str, ...]] = msgspec.field(default_factory=dict)

    @property
    def record_power(self) -> dict[str, float]:
        """Mean powers of the record, by stage; none where gaps leave nothing of it. [W]"""
        whole = self.record_energy if self.record_duration > 0.0 else {}
        return {stage: joule / self.record_duration for stage, joule in whole.items()}


def waves_of(reduction: Reduction) -> WaveEnergies | None:
    """Energies of the waves of a log where cycles are waves by the rig file; None where they are not."""
    return wave_energies(reduction) if reduction.rig.phases.source == "waves" else None


def wave_energies(reduction: Reduction) -> WaveEnergies:
    """Energies of the waves of a log, or of any cycles of it."""
    run, rig, waves = reduction.run, reduction.rig, reduction.complete
    energy = {
        stage: np.array([c.metrics.value(f"energy_{stage}") for c in waves])
        for stage in rig.cascade.names
        if all(c.metrics[f"energy_{stage}"] is not None for c in waves)
    }
    payout, unit = np.array([c.summary.payout.travel for c in waves], dtype=np.float64), "m"
    if not np.isfinite(payout).all() and "speed" in run.channels:  # a shaft without a line
        spans = np.array([(c.phases.onset, c.phases.payout_end) for c in waves]).reshape(-1, 2)
        payout, unit = integrals(run.t, run.channels["speed"].__getitem__, spans), "rad"
    between_zeros = rig.phases.source == "waves"  # from one upward zero crossing to the next
    ends = [(c.window.onset, c.window.cutoff) if between_zeros else (c.net.begin, c.net.end) for c in waves]
    etas = [m for m in rig.cascade.ratios if not (run.open_circuit and rig.cascade.undelivered(m))]
    streams = {stage.name: stage.stream(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    measured = {name: watts for name, watts in streams.items() if watts is not None}
    errors, unknown = _sensor_errors(reduction, energy)
    return _with_ratios(
        WaveEnergies(
            cycle=np.array([c.cycle for c in waves], dtype=np.intp),
            payout=payout,
            payout_unit=unit,
            period=np.ptp(np.array(ends).reshape(-1, 2), axis=1),
            energy=energy,
            counts=(len(waves),),
            pairs={name: rig.cascade.between(name) for name in etas},
            record_duration=float(run.t[-1] - run.t[0]) - float(np.ptp(_long_gaps(reduction), axis=1).sum()),
            record_energy=dict(zip(measured, _over_record(reduction, [*measured.values()]).tolist(), strict=True)),
            errors=errors,
            unknown=unknown,
        )
    )


def joined_waves(logs: Sequence[WaveEnergies]) -> WaveEnergies:
    """Energies of the waves of several logs together, of the same stages and with a payout in the same unit.

    A source of uncertainty of a sensor is the same in all logs: the same instrument took them.
    """
    first = logs[0]
    return _with_ratios(
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
            errors=_together(error for log in logs for error in log.errors),
            unknown={
                stage: tuple(sorted({name for log in logs for name in log.unknown.get(stage, ())}))
                for stage in first.energy
            },
        )
    )


def _with_ratios(waves: WaveEnergies) -> WaveEnergies:
    """The same with efficiencies of all waves together, and mean powers of the record."""
    efficiency, power = {}, {}
    for name, (into, out) in waves.pairs.items():
        if into in waves.energy and out in waves.energy:
            x, y = waves.energy[into], waves.energy[out]
            sums = (into, float(x.sum())), (out, float(y.sum()))
            known = not (waves.unknown.get(into) or waves.unknown.get(out)) and sums[0][1] > NOTHING
            errors = [(e.of_ratio(*sums), e.shape) for e in waves.errors] if known else None
            found = ratio_of_sums(x, y, counts=waves.counts, errors=errors)
            efficiency[name] = msgspec.structs.replace(found, between=(into, out))
    for stage, joule in waves.record_energy.items():
        known = waves.unknown.get(stage) == () and waves.record_duration > 0.0
        errors = [(e.record.get(stage, 0.0) / waves.record_duration, e.shape) for e in waves.errors] if known else None
        of = (waves.period, waves.energy[stage]) if stage in waves.energy else None
        power[stage] = mean_power((waves.record_duration, joule), of, counts=waves.counts, errors=errors)
    return msgspec.structs.replace(waves, efficiency=efficiency, power=power)


def _sensor_errors(
    reduction: Reduction, stages: Iterable[str]
) -> tuple[tuple[EnergyError, ...], dict[str, tuple[str, ...]]]:
    """What the sources of uncertainty change of the energies of a log, and the channels without an accuracy, by stage."""
    model = error_model(reduction)
    rows = np.flatnonzero([c.complete for c in reduction.cycles])
    energies = {stage: model.energies[stage] for stage in stages if stage in model.energies}
    waves = {s: model.changes(e.times(np.ones(rows.size), rows).total())[:, 0] for s, e in energies.items()}
    record = {s: model.changes(_of_record(reduction, s, e))[:, 0] for s, e in energies.items()}
    found = []
    for k, source in enumerate(model.sources):
        of_gaps = source.part == "gap"
        name, part = ("bridged gaps", "") if of_gaps else (source.channel, source.part)
        changes = ({stage: float(x[k]) for stage, x in of.items()} for of in (waves, record))
        found.append(EnergyError(name, part, source.shape, not of_gaps, *changes))
    lacking = {stage: channels for stage, channels in without_accuracy(model).items() if stage in energies}
    return _together(found), lacking


def _together(errors: Iterable[EnergyError]) -> tuple[EnergyError, ...]:
    """Errors of the same source together: sums of what is shared, else the root of the sum of squares."""
    groups: dict[tuple[str, str], list[EnergyError]] = {}
    for error in errors:
        groups.setdefault((error.source, error.part), []).append(error)

    def added(parts: Sequence[Mapping[str, float]], *, shared: bool) -> dict[str, float]:
        of_stages = {stage: [part.get(stage, 0.0) for part in parts] for stage in dict.fromkeys(chain(*parts))}
        return {stage: sum(joules) if shared else math.hypot(*joules) for stage, joules in of_stages.items()}

    return tuple(
        msgspec.structs.replace(
            group[0],
            energy=added([e.energy for e in group], shared=group[0].shared),
            record=added([e.record for e in group], shared=group[0].shared),
        )
        for group in groups.values()
    )


def _of_record(reduction: Reduction, stage: str, waves: Energy) -> Energy:
    """What gives the energy of a stage over the record for any errors of its channels, by what gives those of its waves."""
    run, rig = reduction.run, reduction.rig
    power = next(s for s in rig.cascade.stages if s.name == stage).power(run.channels, rig.r_drum)
    if power is None:
        return waves.total()
    gaps = all_gaps(run, rig.cascade.channels)
    short = gaps[np.ptp(gaps, axis=1) <= rig.thresholds.gap_max]  # which are bridged
    missed = energy_error(
        run.t, power.stream(run.channels, rig.r_drum)(slice(None)), short, run.t[[[0, -1]]], np.zeros(1)
    )
    duration = float(np.ptp(run.t)) - float(np.ptp(_long_gaps(reduction), axis=1).sum())
    sampled = waves.integrals[-1].sum() * duration / max(float(waves.t.sum()), TINY)
    whole = _over_record(reduction, integrands(run, power, rig.r_drum))
    return msgspec.structs.replace(
        waves, integrals=np.append(whole, sampled)[:, None], t=np.array([duration]), bridged=missed / math.sqrt(3.0)
    )


def _over_record(reduction: Reduction, streams: Sequence[Stream]) -> Signal:
    """Integrals of some signals over the log without long gaps, (m,)."""
    t = reduction.run.t
    parts = integrals_of(t, streams, np.vstack((t[[[0, -1]]], _long_gaps(reduction))))
    return np.asarray(parts[:, 0] - parts[:, 1:].sum(axis=1))


def _long_gaps(reduction: Reduction) -> Signal:
    """Gaps that are left out of the record, without overlaps, (k, 2). [s]"""
    gaps = all_gaps(reduction.run, reduction.rig.cascade.channels)
    gaps = gaps[np.ptp(gaps, axis=1) > reduction.rig.thresholds.gap_max]
    united: list[list[float]] = []
    for begin, end in gaps.tolist():
        if united and begin <= united[-1][1]:
            united[-1][1] = max(united[-1][1], end)
        else:
            united.append([begin, end])
    return np.array(united).reshape(-1, 2)


def wave_record(found: WaveEnergies) -> WavesRecord:
    """The block `waves` of the JSON: each wave, the record, and efficiencies with intervals."""
    each = {"cycle": found.cycle, f"payout_{found.payout_unit}": found.payout, "period_s": found.period}
    each |= {field_of(f"energy_{stage}"): x for stage, x in found.energy.items()}
    return WavesRecord(
        record={
            "duration_s": found.record_duration,
            **{field_of(f"energy_{stage}"): joule for stage, joule in found.record_energy.items()},
            **{field_of(f"power_{stage}"): watt for stage, watt in found.record_power.items()},
        },
        mean_power=dict(found.power),
        efficiency=dict(found.efficiency),
        bootstrap={"draws": DRAWS, "seed": SEED},
        waves=found.cycle.size,
        waves_of_logs=found.counts,
        payout_unit=found.payout_unit,
        stages=tuple(found.energy),
        sensors=found.errors,
        without_accuracy=dict(found.unknown),
        each=tuple(dict(zip(each, row, strict=True)) for row in zip(*(x.tolist() for x in each.values()), strict=True)),
    )


def waves_from_record(of: WavesRecord) -> WaveEnergies:
    """The energies of waves of a written record; of some waves alone where it holds these alone."""

    def column(name: str) -> Signal:
        return np.array([wave[name] for wave in of.each], dtype=np.float64)

    return WaveEnergies(
        cycle=column("cycle").astype(np.intp),
        payout=column(f"payout_{of.payout_unit}"),
        payout_unit=of.payout_unit,
        period=column("period_s"),
        energy={stage: column(field_of(f"energy_{stage}")) for stage in of.stages},
        counts=of.waves_of_logs,
        pairs={name: eta.between for name, eta in of.efficiency.items() if eta.between is not UNSET},
        record_duration=of.record["duration_s"],
        record_energy={
            key.removeprefix("energy_").removesuffix("_j"): x
            for key, x in of.record.items()
            if key.startswith("energy_")
        },
        efficiency=of.efficiency,
        power=of.mean_power,
        errors=of.sensors,
        unknown=of.without_accuracy,
    )


class LogWaves(msgspec.Struct, frozen=True):
    """The waves of one log: its name, its load [ohm], inf for an open circuit."""

    name: str
    load: float | None
    waves: WaveEnergies

    @property
    def kind(self) -> tuple[object, ...]:
        """What logs have in common whose waves can be taken together."""
        return self.waves.payout_unit, *self.waves.energy, *self.waves.pairs.items()


class CampaignWaves(msgspec.Struct, frozen=True):
    """The waves of several logs together, those of each, and sentences on logs that are left out."""

    together: WaveEnergies
    logs: tuple[LogWaves, ...]
    left_out: tuple[str, ...] = ()


def campaign_waves(records: Iterable[tuple[str, RunRecord]]) -> CampaignWaves | None:
    """Combine the waves of logs of the same stages, by the names of the logs; None without any.

    Open circuits are left out where other logs have a load: they deliver nothing, and would lower every ratio of sums.
    """
    logs = [LogWaves(name, of.log.load, waves_from_record(of.waves)) for name, of in records if of.waves]
    loaded = [log for log in logs if log.load != math.inf] or logs
    if not loaded:
        return None
    alike = [log for log in loaded if log.kind == loaded[0].kind]
    why = [(log, "its load is an open circuit") for log in logs if log not in loaded]
    why += [(log, "its stages, or the unit of its payouts, are others") for log in loaded if log not in alike]
    left_out = tuple(f"{log.name} is not among the waves together: {reason}." for log, reason in why)
    return CampaignWaves(joined_waves([log.waves for log in alike]), tuple(logs), left_out)


def campaign_waves_record(found: CampaignWaves) -> CampaignWavesRecord:
    """The waves of a campaign as they are written."""
    logs = [(log, wave_record(log.waves)) for log in found.logs]
    each = tuple(
        {"run": log.name, "load_ohm": log.load, "record": of.record, "efficiency": of.efficiency, "waves": of.waves}
        for log, of in logs
    )
    together = asdict(wave_record(found.together)) | {"each": ()}
    return CampaignWavesRecord(**together, logs=each, left_out=found.left_out)
