"""Energies of irregular waves as JSON: of one log, and of the logs of a campaign together and each."""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec
import numpy as np
from msgspec import UNSET
from msgspec.structs import asdict

from winchcascade.core.cascade import field_of
from winchcascade.reduction.run_record import CampaignWavesRecord, Numbers, RunRecord, WavesRecord
from winchcascade.reduction.wave_bootstrap import DRAWS, SEED
from winchcascade.reduction.wave_energies import WaveClass, WaveEnergies, joined_waves


def wave_record(found: WaveEnergies) -> WavesRecord:
    """The block `waves` of the JSON: each wave, the record, efficiencies with intervals, and classes."""
    payout = f"payout_{found.payout_unit}"
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
        each=tuple(
            {
                "cycle": int(found.cycle[k]),
                payout: float(found.payout[k]),
                "period_s": float(found.period[k]),
                **{field_of(f"energy_{stage}"): float(x[k]) for stage, x in found.energy.items()},
            }
            for k in range(found.cycle.size)
        ),
        classes=tuple(
            {
                payout: c.payout,
                "period_s": c.period,
                "count": c.count,
                **{field_of(f"energy_{stage}"): joule for stage, joule in c.energy.items()},
                **c.efficiency,
            }
            for c in found.classes
        ),
    )


def waves_from_record(of: WavesRecord) -> WaveEnergies:
    """The energies of waves of a written record; of some waves alone where it holds these alone."""
    payout, energy = f"payout_{of.payout_unit}", {stage: field_of(f"energy_{stage}") for stage in of.stages}
    return WaveEnergies(
        cycle=np.array([wave["cycle"] for wave in of.each], dtype=np.intp),
        payout=np.array([wave[payout] for wave in of.each], dtype=np.float64),
        payout_unit=of.payout_unit,
        period=np.array([wave["period_s"] for wave in of.each], dtype=np.float64),
        energy={stage: np.array([wave[key] for wave in of.each], dtype=np.float64) for stage, key in energy.items()},
        counts=of.waves_of_logs,
        pairs={name: eta.between for name, eta in of.efficiency.items() if eta.between is not UNSET},
        record_duration=of.record["duration_s"],
        record_energy={
            key[len("energy_") : -len("_j")]: x for key, x in of.record.items() if key.startswith("energy_")
        },
        efficiency=of.efficiency,
        power=of.mean_power,
        classes=tuple(
            WaveClass(
                payout=msgspec.convert(one[payout], tuple[float, float]),
                period=msgspec.convert(one["period_s"], tuple[float, float]),
                count=msgspec.convert(one["count"], int),
                energy=msgspec.convert({stage: one[key] for stage, key in energy.items()}, Numbers),
                efficiency=msgspec.convert({name: one.get(name) for name in of.efficiency}, Numbers),
            )
            for one in of.classes
        ),
        errors=of.sensors,
        unknown=of.without_accuracy,
    )


class LogWaves(msgspec.Struct, frozen=True):
    """The waves of one log: its name, its load [ohm], inf for an open circuit."""

    name: str
    load: float | None
    waves: WaveEnergies


class CampaignWaves(msgspec.Struct, frozen=True):
    """The waves of several logs together, those of each, and sentences on logs that are left out."""

    together: WaveEnergies
    logs: tuple[LogWaves, ...]
    left_out: tuple[str, ...] = ()


def campaign_waves(records: Iterable[tuple[str, RunRecord]]) -> CampaignWaves | None:
    """Combine the waves of logs of the same stages, by the names of the logs; None without any.

    Open circuits are left out where other logs have a load: they deliver nothing, and would lower every ratio of sums.
    """
    logs = [
        LogWaves(name, record.log.load, waves_from_record(record.waves)) for name, record in records if record.waves
    ]
    loaded = [log for log in logs if log.load != math.inf] or logs
    if not loaded:
        return None
    alike = [log for log in loaded if _kind(log) == _kind(loaded[0])]
    why = [(log, "its load is an open circuit") for log in logs if log not in loaded]
    why += [(log, "its stages, or the unit of its payouts, are others") for log in loaded if log not in alike]
    left_out = tuple(f"{log.name} is not among the waves together: {reason}." for log, reason in why)
    return CampaignWaves(joined_waves([log.waves for log in alike]), tuple(logs), left_out)


def _kind(log: LogWaves) -> tuple[object, ...]:
    return log.waves.payout_unit, *log.waves.energy, *log.waves.pairs.items()


def campaign_waves_record(found: CampaignWaves) -> CampaignWavesRecord:
    """The waves of a campaign as they are written."""
    logs = [(log, wave_record(log.waves)) for log in found.logs]
    each = tuple(
        {"run": log.name, "load_ohm": log.load, "record": of.record, "efficiency": of.efficiency, "waves": of.waves}
        for log, of in logs
    )
    together = asdict(wave_record(found.together)) | {"each": ()}
    return CampaignWavesRecord(**together, logs=each, left_out=found.left_out)
