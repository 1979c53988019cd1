"""Energies of irregular waves: of each and of the whole record, of one log or of a campaign, as
they are written.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import Any

import msgspec
import numpy as np
from msgspec import UNSET
from msgspec.structs import asdict, replace

from winchcascade.core.accuracy import ErrorSource, Shape
from winchcascade.core.cascade import field_of
from winchcascade.core.integrate import integrals
from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import not_negative, ratio
from winchcascade.reduction.error_model import Energy, ErrorModel, error_model, integrated
from winchcascade.reduction.gap_error import all_gaps, energy_error
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.wave_bootstrap import BOOTSTRAP, RatioOfSums, ratio_of_sums

GAPS = "bridged gaps"
"""Source of the errors by gaps, which each stage and each log has of its own."""

WRITTEN_WAVES = {
    "power": "mean_power", "counts": "waves_of_logs", "errors": "sensors", "unknown": "without_accuracy",
}  # fmt: skip
"""Names of the fields of waves in written files."""


class EnergyError(msgspec.Struct, frozen=True):
    """What one standard uncertainty of a source changes of the energies of all waves together, and
    of the record, by stage. [J]

    `shared`: of a sensor, and so the same in all stages; else each stage has its own, as of bridged
    gaps.
    """

    source: str
    part: str
    shape: Shape
    shared: bool
    energy: Mapping[str, float]
    record: Mapping[str, float] = {}

    def of_ratio(self, into: str, out: str, energy: Mapping[str, Signal]) -> float:
        """Change of the efficiency from one stage to another with it; `energy` is that of each
        wave by stage. [1]
        """
        taken, given = float(energy[into].sum()), float(energy[out].sum())
        up, down = (
            self.energy.get(out, 0.0) / taken,
            given / taken * self.energy.get(into, 0.0) / taken,
        )
        return up - down if self.shared else math.hypot(up, down)


class WaveEnergies(msgspec.Struct, frozen=True, kw_only=True, dict=True, rename=WRITTEN_WAVES):
    """Energies of the complete waves of a log, or of several, and of the whole records: the block
    `waves` of the JSON.

    Parameters
    ----------
    record : duration without long gaps [s], energies [J] and mean powers [W] of the records over
        that, with stages and units in the names
    power : mean powers of the record with their intervals, by stage
    efficiency : of all waves together, by name
    waves, counts : number of waves, and of those of each log
    payout_unit : m, or rad for a shaft without a line
    stages : of which the waves have the energy
    errors : what the sources of uncertainty of the sensors change of the energies of all waves, and
        of the record
    unknown : channels of a stage without a stated accuracy, by stage
    each : number, travel of the positive half, period and energies of each wave, with units in the
        names; empty where left out
    """

    record: dict[str, float]
    power: dict[str, RatioOfSums] = {}
    efficiency: dict[str, RatioOfSums] = {}
    bootstrap: dict[str, int] = msgspec.field(default_factory=BOOTSTRAP.copy)
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
        return {
            name: eta.between for name, eta in self.efficiency.items() if eta.between is not UNSET
        }

    @property
    def record_duration(self) -> float:
        """Length of the records without long gaps. [s]"""
        return self.record["duration_s"]

    @property
    def record_energy(self) -> dict[str, float]:
        """Energies of the records, by stage. [J]"""
        return {
            key[len("energy_") : -len("_j")]: x
            for key, x in self.record.items()
            if key.startswith("energy_")
        }

    @property
    def record_power(self) -> dict[str, float]:
        """Mean powers of the records, by stage; none where gaps leave nothing of them. [W]"""
        return {
            key[len("power_") : -len("_w")]: x
            for key, x in self.record.items()
            if key.startswith("power_")
        }


def waves_of(reduction: Reduction) -> WaveEnergies | None:
    """Energies of the waves of a log where cycles are waves by the rig file; None where they are
    not.
    """
    return wave_energies(reduction) if reduction.rig.phases.source == "waves" else None


def wave_energies(reduction: Reduction) -> WaveEnergies:
    """Energies of the waves of a log, or of any cycles of it."""
    run, rig, waves = reduction.run, reduction.rig, reduction.complete
    model = error_model(reduction)
    record, duration = _record(reduction, model)
    payout, unit = np.array([c.summary.payout.travel for c in waves], dtype=np.float64), "m"
    if not np.isfinite(payout).all() and "speed" in run.channels:  # a shaft without a line
        spans = np.array([(c.phases.onset, c.phases.payout_end) for c in waves]).reshape(-1, 2)
        payout, unit = integrals(run.t, run.channels["speed"].__getitem__, spans), "rad"
    between_zeros = rig.phases.source == "waves"  # from one upward zero crossing to the next
    ends = [
        (c.window.onset, c.window.cutoff) if between_zeros else (c.net.begin, c.net.end)
        for c in waves
    ]
    columns = {
        "cycle": [c.cycle for c in waves],
        f"payout_{unit}": payout.tolist(),
        "period_s": [end - begin for begin, end in ends],
        **{
            field_of(f"energy_{s}"): [c.metrics.value(f"energy_{s}") for c in waves] for s in record
        },
    }
    etas = [m for m in rig.cascade.ratios if not (run.open_circuit and rig.cascade.undelivered(m))]
    found = WaveEnergies(
        record=_written(
            duration, {stage: float(energy.joules[0]) for stage, energy in record.items()}
        ),
        waves=len(waves),
        counts=(len(waves),),
        payout_unit=unit,
        stages=tuple(record),
        errors=tuple(_errors(reduction, model, record)),
        unknown=ErrorModel(record, model.sources).lacking,
        each=tuple(
            dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)
        ),
    )
    return _with_ratios(found, {name: rig.cascade.pairs[name] for name in etas})


def _record(reduction: Reduction, model: ErrorModel) -> tuple[dict[str, Energy], float]:
    """Energy of each stage over the log without long gaps, as one span, and the length of that.
    [s]
    """
    run, rig = reduction.run, reduction.rig
    gaps = all_gaps(run, rig.cascade.channels)
    bridged = np.ptp(gaps, axis=1) <= rig.thresholds.gap_max
    begins = np.maximum.accumulate([run.t[0], *gaps[~bridged, 1]])
    pieces = np.column_stack((begins, [*gaps[~bridged, 0], run.t[-1]]))
    pieces = pieces[pieces[:, 0] < pieces[:, 1]]
    duration, found = float(np.ptp(pieces, axis=1).sum()), {}
    for stage, (terms, joules, _) in integrated(reduction, pieces).items():
        watts = next(s for s in rig.cascade.stages if s.name == stage).watts(
            run.channels, rig.r_drum
        )
        missed = energy_error(
            run.t,
            np.asarray(watts),
            gaps[bridged],
            run.t[[[0, -1]]],
            np.zeros(1),
            rig.thresholds.smoothing,
        )
        waves = model.energies.get(stage)
        per_second = (
            0.0 if waves is None else waves.integrals[-1].sum() / (waves.t.sum() or math.inf)
        )
        whole = np.append(joules.sum(axis=1), per_second * duration)[:, None]
        found[stage] = Energy(terms, whole, np.array([duration]), missed / math.sqrt(3.0))
    return found, duration


def _errors(
    reduction: Reduction, model: ErrorModel, record: Mapping[str, Energy]
) -> Iterable[EnergyError]:
    """What the sources of uncertainty change of the energies of a log; a sensor and its
    acquisition system are one source.
    """
    sources: dict[tuple[str, str], ErrorSource] = {}
    for source in model.sources:
        other = sources.get(key := (source.channel, source.part))
        sources[key] = (
            source
            if other is None
            else replace(source, u=math.hypot(other.u, source.u), limit=None)
        )
    together, complete = tuple(sources.values()), [c.complete for c in reduction.cycles]
    waves, whole = (
        ErrorModel(model.energies, together).changes(),
        ErrorModel(record, together).changes(),
    )
    stages = [stage for stage in record if stage in waves]
    for k, source in enumerate(together):
        energy = {stage: float(waves[stage][k, complete].sum()) for stage in stages}
        of_record = {stage: float(whole[stage][k, 0]) for stage in stages}
        yield EnergyError(
            source.channel, source.part, source.shape, shared=True, energy=energy, record=of_record
        )
    missed = {
        stage: float(np.linalg.norm(model.energies[stage].gaps[complete])) for stage in stages
    }
    if any(model.energies[stage].gaps.any() for stage in stages):
        of_record = {stage: float(record[stage].gaps[0]) for stage in stages}
        yield EnergyError(GAPS, "", "normal", shared=False, energy=missed, record=of_record)


def joined_waves(logs: Sequence[WaveEnergies]) -> WaveEnergies:
    """Energies of the waves of several logs together, of the same stages and with a payout in the
    same unit.

    A source of uncertainty of a sensor is the same in all logs, as the same instrument took them;
    gaps are independent.
    """
    first, each = logs[0], chain.from_iterable(log.each for log in logs)
    groups: dict[tuple[str, str], list[EnergyError]] = {}
    for error in chain.from_iterable(log.errors for log in logs):
        groups.setdefault((error.source, error.part), []).append(error)

    def added(of: EnergyError, parts: Sequence[Mapping[str, float]]) -> dict[str, float]:
        changes = {stage: [part.get(stage, 0.0) for part in parts] for stage in first.stages}
        return {stage: sum(x) if of.shared else math.hypot(*x) for stage, x in changes.items()}

    errors = [
        replace(
            of[0],
            energy=added(of[0], [e.energy for e in of]),
            record=added(of[0], [e.record for e in of]),
        )
        for of in groups.values()
    ]
    joules = {stage: sum(log.record_energy[stage] for log in logs) for stage in first.record_energy}
    unknown = {
        stage: sorted({name for log in logs for name in log.unknown.get(stage, ())})
        for stage in first.stages
    }
    found = WaveEnergies(
        record=_written(sum(log.record_duration for log in logs), joules),
        waves=sum(log.waves for log in logs),
        counts=tuple(n for log in logs for n in log.counts),
        payout_unit=first.payout_unit,
        stages=first.stages,
        errors=tuple(errors),
        unknown={stage: tuple(channels) for stage, channels in unknown.items()},
        each=tuple(wave | {"cycle": k} for k, wave in enumerate(each, 1)),
    )
    return _with_ratios(found, first.pairs)


def _written(duration: float, energy: Mapping[str, float]) -> dict[str, float]:
    """Duration [s], energies [J] and mean powers [W] of the record, by their names in written
    files.
    """
    power = {
        field_of(f"power_{stage}"): joule / duration
        for stage, joule in energy.items()
        if duration > 0.0
    }
    return {
        "duration_s": duration,
        **{field_of(f"energy_{stage}"): joule for stage, joule in energy.items()},
        **power,
    }


def _with_ratios(waves: WaveEnergies, pairs: Mapping[str, tuple[str, str]]) -> WaveEnergies:
    """The same with efficiencies of all waves together, by the stages that each leads from and
    to, and mean powers.
    """
    efficiency, power = {}, {}
    energy, periods, duration = (
        waves.energy,
        waves.column("period_s"),
        waves.record_duration or math.inf,
    )
    known = {stage for stage in waves.stages if waves.unknown.get(stage) == ()}
    for name, (into, out) in pairs.items():
        if into in energy and out in energy:
            taken, given = float(energy[into].sum()), float(energy[out].sum())
            eta = ratio(given, taken)
            errors = [
                (e.of_ratio(into, out, energy), e.shape) for e in waves.errors if eta is not None
            ]
            found = ratio_of_sums(
                not_negative(eta), energy[into], energy[out], counts=waves.counts,
                errors=errors if known >= {into, out} and eta is not None else None,
            )  # fmt: skip
            efficiency[name] = replace(found, between=(into, out))
    for stage, joule in waves.record_energy.items():
        errors = [(e.record.get(stage, 0.0) / duration, e.shape) for e in waves.errors]
        power[stage] = ratio_of_sums(
            ratio(joule, waves.record_duration), periods, energy[stage], share=float(periods.sum()) / duration,
            counts=waves.counts, errors=errors if stage in known and waves.record_duration > 0.0 else None,
        )  # fmt: skip
    return replace(waves, efficiency=efficiency, power=power)


# ------------------------------------------------------------------------------------- a campaign
class CampaignWavesRecord(WaveEnergies, frozen=True, kw_only=True, dict=True, rename=WRITTEN_WAVES):
    """The block `waves` of the record of a campaign: all logs together, and each; single waves
    are in the results.
    """

    logs: tuple[dict[str, Any], ...]
    left_out: tuple[str, ...]


class LogWaves(msgspec.Struct, frozen=True):
    """The waves of one log: its name, its load [ohm], inf for an open circuit."""

    name: str
    load: float | None
    waves: WaveEnergies

    @property
    def kind(self) -> tuple[object, ...]:
        """What logs have in common whose waves can be taken together."""
        return self.waves.payout_unit, *self.waves.stages, *self.waves.pairs.items()


class CampaignWaves(msgspec.Struct, frozen=True):
    """The waves of several logs together, those of each, and sentences on logs that are left
    out.
    """

    together: WaveEnergies
    logs: tuple[LogWaves, ...]
    left_out: tuple[str, ...] = ()

    @property
    def record(self) -> CampaignWavesRecord:
        """The waves of the campaign as they are written."""
        each = tuple(
            {
                "run": log.name,
                "load_ohm": log.load,
                "record": of.record,
                "efficiency": of.efficiency,
                "waves": of.waves,
            }
            for log, of in ((log, log.waves) for log in self.logs)
        )
        return CampaignWavesRecord(
            **asdict(self.together) | {"each": ()}, logs=each, left_out=self.left_out
        )


def campaign_waves(of_logs: Iterable[LogWaves]) -> CampaignWaves | None:
    """Combine the waves of logs of the same stages; None without any.

    Open circuits are left out where other logs have a load: they deliver nothing, and would lower
    every ratio of sums.
    """
    logs = [*of_logs]
    loaded = [log for log in logs if log.load != math.inf] or logs
    if not loaded:
        return None
    alike = [log for log in loaded if log.kind == loaded[0].kind]
    why = [(log, "its load is an open circuit") for log in logs if log not in loaded]
    why += [
        (log, "its stages, or the unit of its payouts, are others")
        for log in loaded
        if log not in alike
    ]
    left_out = tuple(
        f"{log.name} is not among the waves together: {reason}." for log, reason in why
    )
    return CampaignWaves(joined_waves([log.waves for log in alike]), tuple(logs), left_out)
