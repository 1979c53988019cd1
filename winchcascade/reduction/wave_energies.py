"""Energies of irregular waves: of each and of the whole record, of one log or of several, as they are written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import Any

import msgspec
import numpy as np
from msgspec import UNSET

from winchcascade.core.cascade import Stream, field_of
from winchcascade.core.integrate import integrals, integrals_of
from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.gap_error import all_gaps, energy_error
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Energy, error_model, integrands, without_accuracy
from winchcascade.reduction.wave_bootstrap import (
    BOOTSTRAP_DRAWS,
    BOOTSTRAP_SEED,
    RECORD_MIN,
    EnergyError,
    RatioOfSums,
    mean_power,
    ratio_of_sums,
)

WRITTEN_WAVES = {
    "power": "mean_power", "counts": "waves_of_logs", "errors": "sensors", "unknown": "without_accuracy",
}  # fmt: skip
"""Names of the fields of waves in written files."""


class WaveEnergies(msgspec.Struct, frozen=True, kw_only=True, dict=True, rename=WRITTEN_WAVES):
    """Energies of the complete waves of a log, or of several, and of the whole records: the block `waves` of the JSON.

    Parameters
    ----------
    record : duration without long gaps [s], energies [J] and mean powers [W] of the records over that, with stages and units in
        the names
    power : mean powers of the record with their intervals, by stage
    efficiency : of all waves together, by name
    waves, counts : number of waves, and of those of each log
    payout_unit : m, or rad for a shaft without a line
    stages : of which every wave has the energy
    errors : what the sources of uncertainty of the sensors change of the energies of all waves, and of the record
    unknown : channels of a stage without a stated accuracy, by stage
    each : number, travel of the positive half, period and energies of each wave, with units in the names; empty where left out
    """

    record: dict[str, float]
    power: dict[str, RatioOfSums] = {}
    efficiency: dict[str, RatioOfSums] = {}
    bootstrap: dict[str, int]
    waves: int
    counts: tuple[int, ...]
    payout_unit: str
    stages: tuple[str, ...]
    errors: tuple[EnergyError, ...]
    unknown: dict[str, tuple[str, ...]]
    each: tuple[dict[str, int | float], ...]

    def column(self, name: str) -> Signal:
        """A number of each wave, (k,)."""
        return np.array([wave[name] for wave in self.each], dtype=np.float64)

    @cached_property
    def payout(self) -> Signal:
        """Travel of the positive half of each wave, (k,). [m or rad]"""
        return self.column(f"payout_{self.payout_unit}")

    @cached_property
    def energy(self) -> dict[str, Signal]:
        """Energy of each wave, (k,), by stage. [J]"""
        return {stage: self.column(field_of(f"energy_{stage}")) for stage in self.stages}

    @property
    def pairs(self) -> dict[str, tuple[str, str]]:
        """Stages that each efficiency leads from and to."""
        return {name: eta.between for name, eta in self.efficiency.items() if eta.between is not UNSET}

    @property
    def record_duration(self) -> float:
        """Length of the records without long gaps. [s]"""
        return self.record["duration_s"]

    @property
    def record_energy(self) -> dict[str, float]:
        """Energies of the records, by stage. [J]"""
        return {key[len("energy_") : -len("_j")]: x for key, x in self.record.items() if key.startswith("energy_")}

    @property
    def record_power(self) -> dict[str, float]:
        """Mean powers of the records, by stage; none where gaps leave nothing of them. [W]"""
        return {key[len("power_") : -len("_w")]: x for key, x in self.record.items() if key.startswith("power_")}


class CampaignWavesRecord(WaveEnergies, frozen=True, kw_only=True, dict=True, rename=WRITTEN_WAVES):
    """The block `waves` of the record of a campaign: all logs together, and each; single waves are in the results."""

    logs: tuple[dict[str, Any], ...]
    left_out: tuple[str, ...]


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
    columns = {
        "cycle": [c.cycle for c in waves],
        f"payout_{unit}": payout.tolist(),
        "period_s": [end - begin for begin, end in ends],
        **{field_of(f"energy_{stage}"): joules.tolist() for stage, joules in energy.items()},
    }
    streams = {stage.name: stage.stream(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    measured = {name: watts for name, watts in streams.items() if watts is not None}
    joules = dict(zip(measured, _over_record(reduction, [*measured.values()]).tolist(), strict=True))
    errors, unknown = _sensor_errors(reduction, energy)
    found = WaveEnergies(
        record=_record(float(np.ptp(run.t)) - float(np.ptp(_long_gaps(reduction), axis=1).sum()), joules),
        bootstrap={"draws": BOOTSTRAP_DRAWS, "seed": BOOTSTRAP_SEED},
        waves=len(waves),
        counts=(len(waves),),
        payout_unit=unit,
        stages=tuple(energy),
        errors=errors,
        unknown=unknown,
        each=tuple(dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)),
    )
    etas = [m for m in rig.cascade.ratios if not (run.open_circuit and rig.cascade.undelivered(m))]
    return _with_ratios(found, {name: rig.cascade.between(name) for name in etas})


def joined_waves(logs: Sequence[WaveEnergies]) -> WaveEnergies:
    """Energies of the waves of several logs together, of the same stages and with a payout in the same unit.

    A source of uncertainty of a sensor is the same in all logs: the same instrument took them.
    """
    first, each = logs[0], chain.from_iterable(log.each for log in logs)
    joules = {stage: sum(log.record_energy[stage] for log in logs) for stage in first.record_energy}
    names = {stage: {name for log in logs for name in log.unknown.get(stage, ())} for stage in first.stages}
    found = WaveEnergies(
        record=_record(sum(log.record_duration for log in logs), joules),
        bootstrap=first.bootstrap,
        waves=sum(log.waves for log in logs),
        counts=tuple(n for log in logs for n in log.counts),
        payout_unit=first.payout_unit,
        stages=first.stages,
        errors=_together(error for log in logs for error in log.errors),
        unknown={stage: tuple(sorted(channels)) for stage, channels in names.items()},
        each=tuple(wave | {"cycle": k} for k, wave in enumerate(each, 1)),
    )
    return _with_ratios(found, first.pairs)


def _record(duration: float, energy: Mapping[str, float]) -> dict[str, float]:
    """Duration [s], energies [J] and mean powers [W] of the record, by their names in written files."""
    power = {field_of(f"power_{stage}"): joule / duration for stage, joule in energy.items() if duration > 0.0}
    return {"duration_s": duration, **{field_of(f"energy_{stage}"): joule for stage, joule in energy.items()}, **power}


def _with_ratios(waves: WaveEnergies, pairs: Mapping[str, tuple[str, str]]) -> WaveEnergies:
    """The same with efficiencies of all waves together, by the stages that each leads from and to, and mean powers."""
    efficiency, power, periods = {}, {}, waves.column("period_s")
    for name, (into, out) in pairs.items():
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
        of = (periods, waves.energy[stage]) if stage in waves.energy else None
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
    sampled = waves.integrals[-1].sum() * duration / max(float(waves.t.sum()), RECORD_MIN)
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
