"""Energies of irregular waves in a report: of one log, and of a campaign, all its logs together and each beside the others."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from msgspec import UNSET

from winchcascade.core.cascade import BUILT_IN, Cascade, Stage
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import CampaignWavesRecord, LogWavesRecord, RunRecord
from winchcascade.reduction.wave_energies import WaveEnergies, classes_of_payout, joined_waves, wave_energies
from winchcascade.report import sheet as content
from winchcascade.report.digits import NumberText, interval_text, significant
from winchcascade.report.sheet import TableColumn
from winchcascade.report.text_table import wrapped
from winchcascade.report.wave_text import (
    classes_table,
    record_table,
    wave_efficiencies_table,
    wave_lines,
    wave_record,
    waves_from_record,
)
from winchcascade.report.wording import SYMBOL, load_words, tex

if TYPE_CHECKING:
    from matplotlib.figure import Figure


DOTS = 1500
"""Waves that are drawn at most; of more, an even selection."""


def wave_section(reduction: Reduction) -> content.Section:
    """Energies and efficiencies of waves over their payout, the whole record, and classes of payout and period."""
    return content.section("waves", "Waves", *wave_blocks(wave_energies(reduction), reduction.rig.cascade))


def wave_blocks(found: WaveEnergies, cascade: Cascade) -> tuple[content.Picture | content.Table | None, ...]:
    """Figure and tables of waves, of one log or of several."""
    return (
        content.picture(
            wave_figure(found, cascade), "wave-energies",
            "Energy and efficiency of each wave over its payout, the travel of its positive half. Lines are the ratios of sums "
            "of classes of payout. A single wave may take energy from the gas, or leave energy in it: its efficiency scatters."
            if found.efficiency else "Energy of each wave over its payout, the travel of its positive half.",
            "Dots of energies and efficiencies over payout; sums by class are in the table.",
        ),
        record_table(found),
        wave_efficiencies_table(found),
        classes_table(found),
    )  # fmt: skip


def wave_figure(found: WaveEnergies, cascade: Cascade) -> Figure | None:
    """Energies and efficiencies of the waves over their payout; None without waves."""
    from winchcascade.report.figures import stage_of
    from winchcascade.report.style import COLOURS, label_panel, look_of, panel_figure

    if not found.cycle.size or not np.isfinite(found.payout).all():
        return None
    figure, (left, *others) = panel_figure(2.9, 1, 1 + bool(found.efficiency), gaps={"wspace": 0.25})
    rows = np.unique(np.linspace(0, found.cycle.size - 1, min(found.cycle.size, DOTS)).astype(np.intp))
    for stage, joule in found.energy.items():
        look = look_of(stage)
        left.plot(
            found.payout[rows], joule[rows], look.mark, ms=2.6, color=COLOURS[look.colour], label=tex(f"energy_{stage}")
        )
    for name in found.efficiency:
        into, out = cascade.between(name)
        look = look_of(stage_of(cascade, name))
        x, y = found.energy[into][rows], found.energy[out][rows]
        eta = np.divide(y, x, out=np.full(x.size, np.nan), where=x > 0.0)
        eta[(eta < 0.0) | (eta > 1.0)] = np.nan
        colour = COLOURS[look.colour]
        others[0].plot(found.payout[rows], eta, look.mark, ms=2.6, color=colour, alpha=0.5)
        steps = [(*of.payout, of.efficiency[name]) for of in classes_of_payout(found)]
        ends = np.array([(low, high, np.nan) for low, high, _ in steps]).ravel()
        levels = np.array([3 * [np.nan if value is None else value] for *_, value in steps], dtype=float).ravel()
        others[0].plot(ends, levels, color=colour, lw=1.6, ls=look.dashes, label=tex(name))
    payout = f"Payout ({found.payout_unit})"
    label_panel(left, "a", "Energy of each wave", x=payout, y="Energy (J)")
    for right in others:
        label_panel(right, "b", "Efficiency of each wave", x=payout, y="Efficiency (1)")
    for axes in (left, *others):
        axes.legend(loc="best")
    return figure


LISTED_LOGS = content.Limit(60, "logs")
"""Logs that the table lists; of more the first and the last half of that."""


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


def _log_waves(name: str, record: RunRecord) -> LogWaves | None:
    """The waves of a log, None where its cycles are no waves."""
    if record.waves is UNSET:
        return None
    load = float("inf") if record.log.open_circuit else record.log.load_ohm
    return LogWaves(name, load, waves_from_record(record.waves))


def campaign_waves(records: Iterable[tuple[str, RunRecord]]) -> CampaignWaves | None:
    """Combine the waves of logs of the same stages, by the names of the logs; None without any.

    Open circuits are left out where other logs have a load: they deliver nothing, and would lower every ratio of sums.
    """
    logs = [log for name, record in records if (log := _log_waves(name, record)) is not None]
    loaded = [log for log in logs if log.load != float("inf")] or list(logs)
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
    each = tuple(LogWavesRecord(log.name, log.load, of.record, of.efficiency, of.waves) for log, of in logs)
    together = msgspec.structs.asdict(wave_record(found.together)) | {"each": ()}
    return CampaignWavesRecord(**together, logs=each, left_out=found.left_out)


def campaign_waves_lines(record: CampaignWavesRecord) -> list[str]:
    """The waves of a campaign in the terminal, by the block of its record."""
    notes = [line for sentence in record.left_out for line in wrapped(f"note: {sentence}")]
    return [*wave_lines(waves_from_record(record)), *notes]


def campaign_waves_section(found: CampaignWaves) -> content.Section:
    """Waves of all logs together over their payout, by class, and each log beside the others."""
    first, *rest = wave_blocks(
        found.together,
        Cascade(tuple(BUILT_IN.get(name) or Stage(name, ()) for name in found.together.record_energy), configured=True),
    )
    return content.section(
        "waves", "Waves", first, _logs_table(found), *rest, *(content.Note(text) for text in found.left_out)
    )


def _logs_table(found: CampaignWaves) -> content.Table | None:
    waves = found.together
    return content.ItemTable[LogWaves](
        "wave-logs",
        "Mean powers of the whole record of each log, and ratios of the sums of its waves.",
        [
            TableColumn("Log", text=True, of=lambda log: log.name),
            TableColumn("Load", text=True, of=lambda log: load_words(log.load, unknown="–")),
            TableColumn("Waves", of=lambda log: sum(log.waves.counts)),
            TableColumn("Record", "s", 1, of=lambda log: log.waves.record_duration),
            *(TableColumn(SYMBOL[f"power_{stage}"], "W", of=partial(_power, stage)) for stage in waves.record_energy),
            *(column for name in waves.efficiency for column in _efficiency_columns(name)),
        ],
        limit=LISTED_LOGS,
    ).of(found.logs)


def _power(stage: str, log: LogWaves) -> NumberText | None:
    """Mean power of the record of a log."""
    power = log.waves.record_power.get(stage)
    return None if power is None else significant(power, 4)


def _efficiency_columns(name: str) -> list[TableColumn[LogWaves]]:
    """An efficiency of all waves of a log, and its interval."""

    def interval(log: LogWaves) -> str | None:
        eta = log.waves.efficiency.get(name)
        return None if eta is None or eta.interval is None else interval_text(*eta.interval, eta.u_waves or 1e-3)

    return [
        TableColumn(
            SYMBOL[name], "", 3, of=lambda log: None if (eta := log.waves.efficiency.get(name)) is None else eta.value
        ),
        TableColumn(f"95 % of {SYMBOL[name]}", "", text=True, of=interval),
    ]
