"""What a rig in waves states: mean power of each sea with its band, energy of a year, loads
compared, losses, peaks.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from winchcascade.core.version import __version__
from winchcascade.report.content import (
    Cell,
    Column,
    Note,
    Picture,
    Report,
    section,
    shown,
    table,
)
from winchcascade.report.figures import sea_figures as figures
from winchcascade.report.results.common import provenance
from winchcascade.report.results.judgement import (
    band_cell,
    band_record,
    band_span,
    finite,
    judgement_banner,
    judgement_note,
    judgement_record,
)
from winchcascade.rig.ledger import LEDGER
from winchcascade.sea.in_sea import PEAKS
from winchcascade.sea.sea_study import UNCOVERED, InSea, SeaStudy
from winchcascade.sea.wave_spectra import PIERSON_MOSKOWITZ

PEAK_HEADS = {
    "force_n": ("tension", "N"),
    "rpm": ("speed", "rpm"),
    "i_s_a": ("current", "A"),
    "i_dc_rms_a": ("DC, rms", "A"),
}
"""Heads and units of the columns of peaks."""


# ------------------------------------------------------------------------------------------- JSON
def sea_record(found: SeaStudy) -> dict[str, Any]:
    """Seas as JSON: SI units, loads in ohm, 95 % intervals as low and high; null where there is
    no result.
    """
    seas, control = found.seas, found.schedule
    return {
        "schema": "winchcascade/sea/1",
        "version": __version__,
        "title": found.tested.title,
        "rig": found.tested.rig,
        **judgement_record(found.tested.judgement),
        "line_moved_by": found.moved_by,
        "spectrum": {"gamma": finite(seas.states[0].gamma)},
        "seed": seas.seed,
        "minutes": seas.minutes,
        "froude_scale": seas.froude,
        "draws": found.draws,
        "payout_in_still_water_m": found.payout,
        "load_ohm": found.load,
        "schedule": control and [{"rpm": rpm, "load_ohm": load} for rpm, load in zip(control.rpm, control.loads, strict=True)],
        "limits": {quantity: found.limits.get(name) for name, quantity in PEAKS.items()},
        "energy_mwh_per_year": found.year and band_record(found.year),
        "hours_with_a_result": finite(found.hours),
        "rows": [_row(row) for row in found.rows],
    }  # fmt: skip


def _row(row: InSea) -> dict[str, Any]:
    """One sea."""
    return {
        "hs_m": row.hs,
        "tp_s": row.tp,
        "hours_per_year": finite(row.hours),
        **{name: band_record(band) for name, band in row.values.items()},
        "lost_w": row.lost,
        "outside_of_logs": finite(row.outside),
        "over_limit": bool(row.exceeds),
        "exceeds": list(row.exceeds),
        "best_load_ohm": finite(row.best_load),
        **{f"outside_of_logs_{name}": share for name, share in row.beyond.items()},
        **{f"p_gen_{name}_w": band_record(band) for name, band in row.power.items()},
        **{
            f"gain_{name}": band_record(band) | {"within_domain": row.covered(name)}
            for name, band in row.gain.items()
        },
        "reason": row.reason or None,
    }


def sea_csv(found: SeaStudy) -> str:
    """A row for each sea: mean power at the DC link with its interval, what the logs do not
    cover, limits, and the verdict.
    """
    verdict = found.tested.judgement.verdict
    lines = ["hs_m,tp_s,hours_per_year,p_gen_w,low,high,outside_of_logs,exceeds,verdict"]
    for row in found.rows:
        power = row.values.get("p_gen_w")
        numbers = [
            row.hours,
            *((math.nan,) * 3 if power is None else (power.value, power.low, power.high)),
            row.outside,
        ]
        cells = ["" if math.isnan(x) else f"{x:.6g}" for x in numbers]
        lines.append(
            ",".join([f"{row.hs:g}", f"{row.tp:g}", *cells, " ".join(row.exceeds), verdict])
        )
    return "\n".join(lines) + "\n"


# ----------------------------------------------------------------------------------------- report
def sea_report(found: SeaStudy, *, command: str = "") -> Report:
    """Report of a rig in waves."""
    tested, seas = found.tested, found.seas
    rows = [row for row in found.rows if not row.reason]
    outside = max(row.outside for row in rows)
    over = sum(bool(row.exceeds) for row in rows)
    gamma = seas.states[0].gamma
    name = "Pierson-Moskowitz" if gamma == PIERSON_MOSKOWITZ else f"JONSWAP, gamma {gamma:g}"
    spectrum = name if seas.log is None else "waves of a log"
    scale = (
        ""
        if seas.froude == 1.0
        else f" · scaled by Froude, 1:{seas.froude:g}; ohm, volt and ampere are those of the rig"
    )
    control = "" if found.schedule is None else "; the schedule is compared with it"
    return Report(
        kind="Rig in waves",
        title=f"{tested.title}: {len(found.rows)} {'sea' if len(found.rows) == 1 else 'seas'}",
        subtitle=f"rig {tested.rig} · line moved by {found.moved_by} · {spectrum}{scale}",
        points=[
            Note("Predicted by the corrected rig without errors of its sensors; no value was "
                 "measured.", "Data", "warn"),
            judgement_note(tested.judgement),
            Note(f"{shown(found.load)} ohm in all seas{control}.", "Load"),
            _year_note(found),
            Note(f"Up to {100.0 * outside:.0f} % of the time of payout lies outside what the logs "
                 f"cover.", "Domain",
                 "warn") if outside > UNCOVERED else None,
            Note(f"{over} of {len(rows)} seas exceed a limit.", "Limits", "warn") if over else None,
            *(Note(f"{row.hs:g} m, {row.tp:g} s: {row.reason}", "No result", "warn") for row in found.rows if row.reason),
        ],
        sections=[
            section("power", "Mean power", Picture(
                "power",
                "Mean power at the DC link in each sea [W]; italic or hollow where the logs do "
                "not cover the motion.",
                "Mean power over wave height and period; the values are in the table.",
                partial(figures.power_figure, found),
            ), _power_table(found)),
            section("losses", "Losses", Picture(
                "losses",
                "Where the net power of the line goes in each sea.",
                "Stacked shares for each sea; the values are in the table.",
                partial(figures.losses_figure, found),
            ), _losses_table(found)),
            *([section("gains", "Loads compared", Picture(
                "gains",
                "Gain of mean power of one way to choose the load over another; hollow where the "
                "logs do not cover both.",
                "Points with intervals for each sea; the values are in the table.",
                partial(figures.gains_figure, found),
            ), _gains_table(found))] if any(row.gain for row in rows) else []),
            section("peaks", "Peaks", Picture(
                "peaks",
                "Largest values of each sea, and the limits that are set.",
                "Points with intervals for each sea; the values are in the table.",
                partial(figures.peaks_figure, found),
            ), _peaks_table(found)),
            provenance(
                [("Loads of the logs (ohm)", ", ".join(f"{load:g}" for load in tested.loads)),
                 ("Length of each sea (min)", seas.minutes), ("Seed", float(seas.seed)), ("Draws", float(found.draws)),
                 ("Payout in still water (m)", found.payout)],
                command,
            ),
        ],
        banner=judgement_banner(tested.judgement),
    )  # fmt: skip


def _year_note(found: SeaStudy) -> Note | None:
    """The energy of a year."""
    if found.year is None:
        return None
    year = f"{shown(band_cell(found.year))} MWh in {found.hours:.0f} h"
    interval = (
        ""
        if math.isnan(found.year.low)
        else f" (95 %: {found.year.low:.3g} to {found.year.high:.3g})"
    )
    return Note(f"{year}{interval}.", "Year")


SEA: tuple[Column[InSea], ...] = (
    Column("Hs", lambda row: row.hs, "m", 2),
    Column("Tp", lambda row: row.tp, "s", 2),
)
"""Columns that name a sea."""


def _known(found: SeaStudy) -> list[InSea]:
    return [row for row in found.rows if not row.reason]


def _power_table(found: SeaStudy) -> Any:
    """Powers and efficiencies of each sea."""
    columns: list[Column[InSea]] = [
        *SEA,
        *([Column[InSea]("hours", lambda row: row.hours, "h", 0)] if found.seas.yearly else []),
        Column("P_line", lambda row: band_cell(row.values["p_line_w"]), "W"),
        Column("P_gen", lambda row: band_cell(row.values["p_gen_w"]), "W"),
        Column("95 % interval", lambda row: band_span(row.values["p_gen_w"]), "W"),
        Column("eta_pto", lambda row: band_cell(row.values["eta_pto"]), brief=False),
        Column("eta_net", lambda row: band_cell(row.values["eta_net"])),
        Column("outside", lambda row: 100.0 * row.outside, "%", 0),
        Column("slack", lambda row: 100.0 * row.values["slack"].value, "%", 1, brief=False),
    ]
    caption = (
        "Mean powers of each sea, net over the whole time; eta_pto is over the line power of the "
        "payouts, eta_net over its net "
        "power; outside: share of the time of payout that the logs do not cover; slack: share of "
        "the time in which the line "
        "would have to push."
    )
    return table("power", caption, columns, _known(found))


def _losses_table(found: SeaStudy) -> Any:
    """Mean power by each loss."""
    rows = _known(found)
    named = [name for name in rows[0].lost if any(row.lost[name] != 0.0 for row in rows)]
    parts = [Column[InSea](LEDGER[name].group, partial(_lost, name), "W") for name in named]
    return table(
        "losses", "Mean power that is lost in each part.", [*SEA, *parts], rows, brief=False
    )


def _lost(name: str, row: InSea) -> Cell:
    return row.lost[name]


def _gains_table(found: SeaStudy) -> Any:
    """Gains of one way to choose the load over another."""
    rows = [row for row in found.rows if row.gain]
    best = Column[InSea]("best load", lambda row: row.best_load, "ohm")
    gains = [
        Column[InSea](name.replace("_", " "), partial(_gain, name), "%")
        for name in figures.COMPARED
        if any(name in row.gain for row in rows)
    ]
    domain = Column[InSea]("not covered", _not_covered)
    caption = (
        "Gain of mean power, 95 % intervals: best is the best fixed load of the sea, fixed the "
        "load of all seas; not covered: "
        "gains of loads with which the logs do not cover the sea, which may be wrong by more."
    )
    return table("gains", caption, [*SEA, best, *gains, domain], rows)


def _not_covered(row: InSea) -> Cell:
    return ", ".join(name.replace("_", " ") for name in row.gain if not row.covered(name))


def _gain(name: str, row: InSea) -> Cell:
    return band_span(row.gain[name], 100.0) if name in row.gain else None


def _peaks_table(found: SeaStudy) -> Any:
    """Largest values of each sea."""
    columns: list[Column[InSea]] = [
        *SEA,
        *(
            Column[InSea](
                head,
                lambda row, name=name: band_cell(row.values[name]),  # type: ignore[misc]
                unit,
            )
            for name, (head, unit) in PEAK_HEADS.items()
        ),
        Column("over", lambda row: ", ".join(row.exceeds)),
    ]
    caption = "Largest tension, generator speed and stator current (rms), and DC current (rms over the sea)."
    return table("peaks", caption, columns, _known(found))
