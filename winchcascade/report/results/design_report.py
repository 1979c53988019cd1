"""What a design states: the best load of each speed, maps with intervals, and what each repair
is worth; its figures, its JSON, and the schedule of a controller.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.core.version import __version__
from winchcascade.design.design_result import (
    LIMITED,
    METRIC,
    Design,
    OperatingPoint,
    Repair,
    Scheduled,
)
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.report.content import (
    Column,
    Measured,
    Note,
    Picture,
    Report,
    Section,
    Span,
    section,
    shown,
    table,
)
from winchcascade.report.figures.style import (
    COLOURS,
    Entry,
    LineStyle,
    from_zero,
    label_panel,
    legend_above,
    line_entry,
    load_looks,
    panel_figure,
)
from winchcascade.report.results.common import provenance
from winchcascade.report.results.effects import call_all, called
from winchcascade.report.results.judgement import (
    band_cell,
    band_record,
    band_span,
    judgement_banner,
    judgement_note,
    judgement_record,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from winchcascade.core.run import Mask, Signal


SHOWN = (
    ("p_line_w", "P_line", "W"), ("p_gen_w", "P_gen", "W"), ("eta_pto", "eta_pto", ""),
    ("plateau_p_gen_w", "P_gen, plateau", "W"), ("torque_nm", "torque", "N.m"),
    ("i_s_a", "current", "A"), ("force_n", "tension", "N"),
)  # fmt: skip
"""Quantities of the table of operating points, with their heads and units."""


# ------------------------------------------------------------------------------------------- JSON
def design_record(found: Design) -> dict[str, Any]:
    """The design as JSON: SI units, loads in ohm, 95 % intervals as low and high."""
    alike = found.tested.judgement.look_alikes
    return {
        "schema": "winchcascade/design/1",
        "version": __version__,
        "title": found.tested.title,
        "rig": found.tested.rig,
        **judgement_record(found.tested.judgement),
        "motion": found.motion,
        "limits": {
            quantity: limit if math.isfinite(limit := getattr(found.limits, name)) else None
            for name, (quantity, _) in LIMITED.items()
        },
        "rows": [
            {"load_ohm": row.load, "speed_mps": row.speed}
            | {name: band_record(band) for name, band in row.values.items()}
            | {
                "within_domain": row.within_domain,
                "over_limit": bool(row.exceeds),
                "exceeds": list(row.exceeds),
            }
            for row in found.rows
        ],
        "schedule": [
            {
                "rpm_low": one.rpm_low,
                "rpm_high": one.rpm_high,
                "load_ohm": one.load,
                "criterion": one.criterion,
            }
            | {"gain_over_fixed": one.gain and one.gain.value, "low": one.gain and one.gain.low}
            | {
                "high": one.gain and one.gain.high,
                "within_domain": one.within_domain,
                "gain_within_domain": one.gain_within_domain,
                "reason": one.reason or None,
            }
            for one in found.schedule
        ],
        "fixed_load_ohm": {
            name: None if math.isnan(load) else load for name, load in found.fixed.items()
        },
        "repairs": [
            _repair(one) | {"look_alikes": list(alike.get(one.effect, ()))} for one in found.repairs
        ],
        "repaired_at_load_ohm": found.repaired_at,
    }


def _repair(one: Repair) -> dict[str, Any]:
    """A repair, with what it brings in a year where the motions have a number."""
    record = {
        "effect": one.effect,
        "energy_j_per_cycle": one.per_cycle.value,
        "low": one.per_cycle.low,
    }
    record |= {"high": one.per_cycle.high, "line_energy_saved_j_per_cycle": band_record(one.saved)}
    record |= {"within_domain": one.within_domain}
    return record | (
        {} if one.per_year is None else {"energy_kwh_per_year": band_record(one.per_year)}
    )


def schedule_csv(found: Design, criterion: str = "power") -> str:
    """The schedule as a controller reads it: in each row a band of generator speed [rpm], its load
    [ohm], whether the logs cover that, and the verdict of the diagnosis; bands without a load are
    left out.
    """
    verdict = found.tested.judgement.verdict
    rows = [one for one in found.schedule if one.criterion == criterion and one.load is not None]
    lines = [
        f"{one.rpm_low:.1f},{one.rpm_high:.1f},{one.load:.4g},{str(one.within_domain).lower()},{verdict}"
        for one in rows
    ]
    return "\n".join(["rpm_low,rpm_high,load_ohm,within_domain,verdict", *lines]) + "\n"


# ----------------------------------------------------------------------------------------- report
def design_report(found: Design, *, command: str = "") -> Report:
    """Report of a design."""
    tested = found.tested
    outside = sum(not row.within_domain for row in found.rows)
    over = sum(bool(row.exceeds) for row in found.rows)
    repaired = {one.effect for one in found.repairs}
    alike = {
        name: others for name, others in tested.judgement.look_alikes.items() if name in repaired
    }
    best = [
        f"{shown(load)} ohm for {criterion}"
        for criterion, load in found.fixed.items()
        if not math.isnan(load)
    ]
    return Report(
        kind="Design with a corrected rig",
        title=f"{tested.title}: other loads and speeds",
        subtitle=f"rig {tested.rig} · {found.motion}",
        points=[
            Note("Predicted by the corrected rig without errors of its sensors; no value was "
                 "measured.", "Data", "warn"),
            judgement_note(tested.judgement),
            Note("; ".join(call_all([name, *others], between=" or ") for name, others in alike.items())
                 + ": the logs do not distinguish them, and a repair is worth what is stated only if the first acts.",
                 "Alike", "warn") if alike else None,
            Note("; ".join(best), "Best fixed load"),
            Note(f"{outside} of {len(found.rows)} points lie outside what the logs cover.", "Domain") if outside else None,
            Note(f"{over} of {len(found.rows)} points exceed {_limits(found)}.", "Limits", "warn") if over else None,
        ],
        sections=[
            section("schedule", "Schedule", Picture(
                "schedule",
                "Best load over generator speed.",
                "Load in ohm over generator speed for most power and for most efficiency; the "
                "values are in the table.",
                partial(schedule_figure, found),
            ), _schedule_table(found)),
            section("map", "Map", Picture(
                "map",
                "Power at the DC link and eta_pto over line speed at each load, with 95 % bands.",
                "Lines over speed for each load; the values are in the table.",
                partial(map_figure, found),
            ), _map_table(found)),
            _repairs_section(found),
            provenance(
                [("Loads of the logs (ohm)", ", ".join(f"{load:g}" for load in tested.loads)),
                 ("Fastest plateau of the logs (m/s)", tested.speed)],
                command,
            ),
        ],
        banner=judgement_banner(tested.judgement),
    )  # fmt: skip


def _limits(found: Design) -> str:
    """The limits that are set."""
    each = {name: (getattr(found.limits, name), unit) for name, (_, unit) in LIMITED.items()}
    return " or ".join(
        f"{name} {limit:.4g} {unit}" for name, (limit, unit) in each.items() if math.isfinite(limit)
    )


def _schedule_table(found: Design) -> Any:
    """The bands of both criteria."""
    columns: list[Column[Scheduled]] = [
        Column("for most", lambda one: one.criterion),
        Column("speed", lambda one: Span(one.rpm_low, one.rpm_high), "rpm", 0),
        Column("load", lambda one: one.load, "ohm"),
        Column(
            "gain over fixed",
            lambda one: None if one.gain is None else 100.0 * one.gain.value,
            "%",
            2,
        ),
        Column(
            "95 % interval",
            lambda one: None if one.gain is None else band_span(one.gain, 100.0),
            "%",
            2,
        ),
        Column("domain", _domain),
    ]
    return table("schedule", "Best load of each band of generator speed.", columns, found.schedule)


def _domain(one: Scheduled) -> str:
    """Whether the logs cover a scheduled load, and the fixed load that its gain is over."""
    if one.reason or not one.within_domain:
        return one.reason or "not covered"
    return "covered" if one.gain is None or one.gain_within_domain else "gain not covered"


def _map_table(found: Design) -> Any:
    """Every operating point."""
    columns: list[Column[OperatingPoint]] = [
        Column("load", lambda row: row.load, "ohm"),
        Column("speed", lambda row: row.speed, "m/s", 3),
        *(
            Column(head, lambda row, name=name: band_cell(row.values[name]), unit)  # type: ignore[misc]
            for name, head, unit in SHOWN
        ),
        Column("outside", lambda row: "" if row.within_domain else "logs"),
        Column("over", lambda row: ", ".join(row.exceeds)),
    ]
    caption = "Operating points: mean powers of the payout; largest torque, stator current and tension; standard uncertainties."
    return table("map", caption, columns, found.rows, brief=False)


def net_worth(one: Repair) -> Measured:
    """Energy that a repair delivers more and takes less from the line, together, with the digits
    that the largest uncertainty of this sum allows. [J a cycle]
    """
    bands = one.per_cycle, one.saved
    u = sum(0.5 * (band.high - band.low) / COVERED for band in bands)
    return Measured(sum(band.value for band in bands), u, signed=True)


def _repairs_section(found: Design) -> Section:
    """What each repair is worth."""
    yearly = any(one.per_year is not None for one in found.repairs)
    columns: list[Column[Repair]] = [
        Column("without", lambda one: called(one.effect), named=True),
        Column("delivered", lambda one: band_cell(one.per_cycle), "J a cycle"),
        Column("95 % interval", lambda one: band_span(one.per_cycle), "J a cycle"),
        *([Column("a year", lambda one: None if one.per_year is None else band_cell(one.per_year), "kWh")]
          if yearly else []),
        Column("saved of the line", lambda one: band_cell(one.saved), "J a cycle"),
        Column("net", net_worth, "J a cycle"),
        Column("domain", lambda one: "covered" if one.within_domain else "not covered"),
    ]  # fmt: skip
    caption = (
        f"At {shown(found.repaired_at)} ohm without each effect: energy delivered more, and taken "
        f"less from the line; "
        "negative: the reverse; net: both together."
    )
    return section(
        "repairs", "Worth of a repair", table("repairs", caption, columns, found.repairs)
    )


LOOKS = {"power": ("gen", "o"), "efficiency": ("mech", "s")}
"""Colour and marker of each criterion."""


OUTSIDE: LineStyle = {"ls": "--", "marker": "o", "ms": 4, "mfc": COLOURS["paper"]}
"""Look of points that the logs do not cover, in a legend."""


def _outside_entry() -> Entry:
    return line_entry("outside what the logs cover", "soft", **OUTSIDE)


def schedule_figure(found: Design) -> Figure | None:
    """Best load over generator speed by criterion; None without any."""
    known = [one for one in found.schedule if one.load is not None]
    if not known:
        return None
    figure, (axes,) = panel_figure(2.4)
    for criterion in METRIC:
        colour, mark = LOOKS[criterion]
        own = [one for one in known if one.criterion == criterion]
        middle = np.array([0.5 * (one.rpm_low + one.rpm_high) for one in own])
        load = np.array([one.load for one in own], dtype=np.float64)
        inside = np.array([one.within_domain for one in own], dtype=bool)
        _points(axes, middle, load, inside, colour, mark)
    axes.set(xlabel="Generator speed (rpm)", ylabel="Load (Ω)")
    from_zero(axes)
    most = [
        line_entry(f"most {name}", colour, marker=mark, ms=4)
        for name, (colour, mark) in LOOKS.items()
    ]
    outside = [] if all(one.within_domain for one in known) else [_outside_entry()]
    legend_above(figure, [*most, *outside])
    return figure


def _points(axes: Axes, x: Signal, y: Signal, inside: Mask, colour: str, mark: str) -> None:
    """A curve with its points: dashed and hollow outside what the logs cover."""
    covered = inside[1:] & inside[:-1]
    for dashes, along in (("-", covered), ("--", ~covered)):
        for k in np.flatnonzero(along):
            axes.plot(x[k : k + 2], y[k : k + 2], dashes, color=COLOURS[colour], lw=1.0)
    axes.plot(x[inside], y[inside], mark, color=COLOURS[colour], ms=4)
    axes.plot(x[~inside], y[~inside], mark, mec=COLOURS[colour], mfc=COLOURS["paper"], ms=4)


def map_figure(found: Design) -> Figure:
    """Power and efficiency over line speed at each load, with bands."""
    figure, panels = panel_figure(3.4, columns=2)
    loads = sorted({row.load for row in found.rows})
    looks, entries = load_looks([*found.tested.loads, *loads]), []
    for load in loads:
        colour, mark = looks[load]
        own = [row for row in found.rows if row.load == load]
        speed = np.array([row.speed for row in own])
        inside = np.array([row.within_domain for row in own], dtype=bool)
        over = np.array([bool(row.exceeds) for row in own], dtype=bool)
        for axes, name in zip(panels, ("p_gen_w", "eta_pto"), strict=True):
            value, low, high = (
                np.array([getattr(row.values[name], end) for row in own])
                for end in ("value", "low", "high")
            )
            axes.fill_between(speed, low, high, color=COLOURS[colour], alpha=0.2, lw=0)
            _points(axes, speed, value, inside, colour, mark)
            axes.plot(speed[over], value[over], "x", color=COLOURS["ink"], ms=7, mew=1.2)
        entries.append(line_entry(f"{load:g} Ω", colour, marker=mark, ms=4))
    label_panel(panels[0], "a", "Power at the DC link", x="Line speed (m/s)", unit="W")
    label_panel(panels[1], "b", r"Efficiency $\eta_{pto}$", x="Line speed (m/s)")
    if not all(row.within_domain for row in found.rows):
        entries.append(_outside_entry())
    if any(row.exceeds for row in found.rows):
        entries.append(line_entry("over a limit", ls="none", marker="x", ms=7, mew=1.2))
    legend_above(figure, entries)
    return figure
