"""The report of a simulation: what its energies cover, where the energy of the line went, stages, and time histories."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.campaign_file import banner
from winchcascade.core.cascade import PAPER
from winchcascade.core.run import Signal
from winchcascade.report.digits import NumberText, significant, upper
from winchcascade.report.glossary import symbols_section
from winchcascade.report.provenance import data_point, provenance_table
from winchcascade.report.report_model import Note, Point, Report, Tile, picture, section
from winchcascade.report.style import (
    COLOURS,
    Room,
    house_style,
    label_panel,
    legend_above,
    line_entry,
    look_of,
    panel_figure,
)
from winchcascade.report.table_model import Table, TableColumn, items_table, make_table
from winchcascade.report.terminal import LEDGER_WORDS, energy_shares, energy_span
from winchcascade.report.traces import envelope
from winchcascade.report.wording import load_words
from winchcascade.rig.simulate import Simulation

_DRAWN = 3000
"""Points of a trace that are drawn at most."""

_CHANNELS = (
    ("displacement", "Line displacement (m)", 1.0),
    ("velocity", "Line velocity (m/s)", 1.0),
    ("pressure", "Pressure, gauge (bar)", 1e-5),
    ("force", "Line tension (N)", 1.0),
    ("torque", "Shaft torque (N·m)", 1.0),
    ("vdc", "DC voltage (V)", 1.0),
    ("idc", "DC current (A)", 1.0),
)
"""Channels of a simulated log that are drawn: name, label with the unit, factor from SI."""

_STAGES = {"line": "line", "mech": "shaft", "gen": "DC link"}


def simulation_report(
    simulation: Simulation, *, source: str = "", rig: str = "", effects: str = "", command: str = ""
) -> Report:
    """Make the rows and figures of the report of a simulation.

    Parameters
    ----------
    source : log or profile whose line motion drove the rig
    rig : name of the rig
    effects : that were switched on, in words
    """
    run = simulation.run
    shares = energy_shares(simulation)
    joule = dict(shares)
    line = joule.get("line", 0.0)
    with house_style():
        sections = (
            section("energies", "Energies", Note(f"The energies count {energy_span(simulation)}."), _ledger(shares, line)),
            section(
                "histories", "Time histories",
                picture(
                    histories(simulation), "histories", "Channels of the simulated log, and powers of the stages.",
                    "Line plots of every simulated channel and of the powers over time.",
                ),
            ),
            section("stages", "Stages", _stages(simulation)),
            symbols_section(PAPER, cycles=False),
            section("provenance", "Provenance", _provenance(simulation, source or run.path, rig, effects, command)),
        )  # fmt: skip
    load = load_words(run.load, before="load ", unknown="load unknown")
    about = (load, f"with {effects}" if effects else "", f"rig {rig}" if rig else "", run.about)
    shown = [name for name in ("line", "gas", "dc") if name in joule]
    return Report(
        kind="Simulation of a rig",
        title=run.name,
        subtitle=" · ".join(part for part in about if part),
        tiles=tuple(_tile(name, joule[name], line) for name in shown if line),
        points=(
            data_point([run.origin]),
            Point("Energies", f"They count {energy_span(simulation)}."),
            Point("Effects", f"{upper(effects)}." if effects else "None beyond the model of the rig file."),
        ),
        sections=sections,
        banner=banner([run.origin]),
    )


def _tile(name: str, joule: float, line: float) -> Tile:
    share = f"{100.0 * joule / line:.1f} % of the line"
    return Tile(name, LEDGER_WORDS[name], f"{significant(joule, 4)} J", share)


def _ledger(shares: list[tuple[str, float]], line: float) -> Table:
    columns: list[TableColumn[tuple[str, float]]] = [
        TableColumn("Energy", text=True, of=lambda item: item[0]),
        TableColumn("Value", "J", of=lambda item: NumberText(f"{item[1]:.0f}", item[1])),
        TableColumn("Share of the line", "%", 1, of=lambda item: 100.0 * item[1] / line if line else None),
        TableColumn("What it is", text=True, of=lambda item: LEDGER_WORDS[item[0]]),
    ]
    found = items_table("ledger", "Where the energy of the line went.", columns, shares)
    return found or make_table("ledger", "No energy was moved.", columns, [])


def stage_powers(simulation: Simulation) -> dict[str, Signal]:
    """Powers of line, shaft and DC link of a simulated log, (n,) each. [W]"""
    channels, r_drum = simulation.run.channels, simulation.model.winch.r_drum
    found = {stage.name: stage.watts(channels, r_drum) for stage in PAPER.stages}
    return {name: watts for name, watts in found.items() if watts is not None}


def histories(simulation: Simulation) -> Figure:
    """Draw every channel of a simulated log and the powers of its stages over time."""
    run, powers = simulation.run, stage_powers(simulation)
    rows = [row for row in _CHANNELS if row[0] in run.channels]
    figure, axes = panel_figure(
        0.95 + 0.98 * (len(rows) + 1), len(rows) + 1, room=Room(left=0.11, head=0.5), gaps={"hspace": 0.42}, share="x"
    )
    for k, (ax, (name, label, factor)) in enumerate(zip(axes, rows, strict=False)):
        x = run.channels[name] * factor
        drawn = envelope(x, _DRAWN)
        ax.plot(run.t[drawn], x[drawn], color=COLOURS["ink"])
        title, _, unit = label.rpartition(" (")
        label_panel(ax, "abcdefgh"[k], title, unit=unit.rstrip(")"))
    for stage, x in powers.items():
        drawn, look = envelope(x, _DRAWN), look_of(stage)
        axes[-1].plot(run.t[drawn], x[drawn], color=COLOURS[look.colour], ls=look.dashes)
    label_panel(axes[-1], "abcdefgh"[len(rows)], "Power", x="Time (s)", unit="W")
    axes[-1].set_xlim(float(run.t[0]), float(run.t[-1]))
    legend_above(figure, [line_entry(_STAGES[s], look_of(s).colour, ls=look_of(s).dashes) for s in powers])
    figure.align_ylabels(axes)
    return figure


def _stages(simulation: Simulation) -> Table:
    """Powers of each stage over the whole motion: largest, smallest, and the energies delivered and returned."""
    t = simulation.run.t
    columns: list[TableColumn[tuple[str, Signal]]] = [
        TableColumn("Stage", text=True, of=lambda item: _STAGES[item[0]]),
        TableColumn("Largest power", "W", of=lambda item: significant(float(item[1].max()), 4)),
        TableColumn("Smallest power", "W", of=lambda item: significant(float(item[1].min()), 4)),
        TableColumn("Energy delivered", "J", of=lambda item: significant(float(np.trapezoid(item[1].clip(0.0), t)), 4)),
        TableColumn(
            "Energy returned", "J", of=lambda item: significant(float(np.trapezoid((-item[1]).clip(0.0), t)), 4)
        ),
    ]
    found = items_table(
        "stages", "Powers of the stages over the whole motion.", columns, list(stage_powers(simulation).items())
    )
    assert found is not None  # there are three stages
    return found


def _provenance(simulation: Simulation, source: str, rig: str, effects: str, command: str) -> Table:
    run = simulation.run
    rows = [
        ("Line motion from", source),
        ("SHA-256 of that file", run.sha256),
        ("Load", load_words(run.load, unknown="unknown")),
        ("Samples", f"{run.samples} at {run.fs:.6g} Hz, {run.t[-1] - run.t[0]:.1f} s"),
        ("Step of the simulation", f"{1e3 * simulation.motion.step:.3g} ms"),
        ("Rig", rig),
        ("Effects", effects or "none"),
    ]
    return provenance_table(rows, command)
