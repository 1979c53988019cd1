"""Irregular waves of the logs of a campaign, together and each."""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec
from msgspec.structs import asdict

from winchcascade.reduction.run_record import RunRecord
from winchcascade.reduction.wave_energies import CampaignWavesRecord, WaveEnergies, joined_waves


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
    logs = [LogWaves(name, of.log.load, of.waves) for name, of in records if of.waves]
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
    logs = [(log, log.waves) for log in found.logs]
    each = tuple(
        {"run": log.name, "load_ohm": log.load, "record": of.record, "efficiency": of.efficiency, "waves": of.waves}
        for log, of in logs
    )
    return CampaignWavesRecord(**asdict(found.together) | {"each": ()}, logs=each, left_out=found.left_out)
