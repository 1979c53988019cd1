"""What a simulation states: where the energy of the line went, powers of the stages, time histories."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_file import banner
from winchcascade.core.named_rig import given_rig
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Signal
from winchcascade.reduction.reduce import reduce
from winchcascade.report.content import Column, Note, Report, Tile, section, shown, table
from winchcascade.report.figures.histories import powers_of
from winchcascade.report.figures.style import house_style
from winchcascade.report.glossary import STAGE_PLACES
from winchcascade.report.results.common import data_note, histories, provenance
from winchcascade.report.wording import load_words
from winchcascade.rig.simulate import Simulation

LEDGER = {
    "line": "delivered by the line",
    "gas": "stored in the gas",
    "drum": "stored in the drum",
    "shaft": "stored in the torsion of the shaft",
    "rotor": "stored in the rotor",
    "capacitor": "stored in the capacitor of the DC link",
    "screw": "lost to friction of the screw",
    "seal": "lost to friction of the seals",
    "line_loss": "lost between line and torque sensor",
    "clutch": "lost in the clutch",
    "shaft_loss": "lost in the shaft",
    "mesh": "lost in the gear mesh",
    "damper": "lost in the damper of the fast shaft",
    "windage": "lost to windage of the fast shaft",
    "friction": "lost to friction of the fast shaft",
    "copper": "lost in the copper of the generator",
    "diodes": "lost in the diodes",
    "dc": "delivered by the DC link",
}
"""Entries of the ledger of a simulation."""

SMALL = 5e-4
"""Entries below this share of the energy of the line are left out. [1]"""


@house_style()
def simulation_report(
    simulation: Simulation,
    *,
    rig: Rig | None = None,
    window: str | float | None = None,
    source: str = "",
    effects: str = "",
    left_out: Sequence[str] = (),
    command: str = "",
) -> Report:
    """Report of a simulation; phases and windows are marked as `reduce` finds them.

    Parameters
    ----------
    rig : that was simulated; by default the one that the log of the motion was read with
    window : rule of the integration windows; by default that of the run, else the rig's
    source : log or profile whose line motion drove the rig
    effects : that were switched on, in words
    left_out : errors of sensors that the rig file states and the simulation does not contain
    """
    run, name = simulation.run, "" if rig is None else rig.name
    found = reduce(run, rig=_as_simulated(simulation, given_rig("write_report", rig, run.rig)), window=window)
    end = int(simulation.energy["line"].argmax())
    joule = {part: float(energy[end]) for part, energy in simulation.energy.items()}
    line = joule["line"]
    ledger = {part: energy for part, energy in joule.items() if abs(energy) >= SMALL * abs(line)}
    load = load_words(run.load, "ohm", before="load ", unknown="load unknown")
    about = (f"with {effects}" if effects else "", f"rig {name}" if name else "", run.about)
    return Report(
        kind="Simulation of a rig",
        title=f"{run.name}: simulated at {load}",
        subtitle=" · ".join(part for part in about if part),
        tiles=[
            Tile(part, LEDGER[part], f"{shown(joule[part], 0)} J", _of_line(joule[part], line))
            for part in ("line", "gas", "dc")
            if part in ledger
        ],
        points=[
            data_note([run.origin]),
            Note(f"{', '.join(left_out)}: errors of sensors, which are left out.", "Sensors") if left_out else None,
            Note("`winchcascade reduce` on the written log finds its cycles.", "Next", brief=False),
        ],
        sections=[
            section(
                "energies", f"Energies up to {run.t[end]:.2f} s",
                table(
                    "ledger", "Energies when that of the line is largest.",
                    [
                        Column("energy", lambda row: row[0]),
                        Column("value", lambda row: row[1], "J", 0),
                        Column("share", lambda row: 100.0 * row[1] / line if line else None, "%", 1),
                        Column("what it is", lambda row: LEDGER[row[0]]),
                    ],
                    ledger.items(),
                ),
            ),
            histories(found),
            section(
                "stages", "Stages",
                table("stages", "Powers of the stages over the whole motion.", _stages(run.t), powers_of(found).items(),
                      brief=False),
                folded=True,
            ),
            provenance(
                [
                    ("Line motion from", source or run.path),
                    ("SHA-256 of that file", run.sha256),
                    ("Samples", f"{run.samples} at {run.fs:.6g} Hz, {run.t[-1] - run.t[0]:.1f} s"),
                    ("Step of the simulation", f"{1e3 * simulation.motion.step:.3g} ms"),
                ],
                command,
            ),
        ],
        banner=banner([run.origin]),
    )  # fmt: skip


def _as_simulated(simulation: Simulation, rig: Rig) -> Rig:
    """The rig with the drum of the model, which an effect may have changed."""
    radius = Quantity(simulation.model.winch.r_drum, "m", "the simulated model")
    return replace(rig, winch=replace(rig.winch, r_drum=radius))


def _stages(t: Signal) -> list[Column[tuple[str, Signal]]]:
    """Columns of the power of a stage over the instants of a log. [s]"""
    return [
        Column("stage", lambda row: STAGE_PLACES.get(row[0], row[0])),
        Column("largest power", lambda row: float(row[1].max()), "W", 1),
        Column("smallest power", lambda row: float(row[1].min()), "W", 1),
        Column("energy delivered", lambda row: float(np.trapezoid(row[1].clip(0.0), t)), "J", 0),
        Column("energy returned", lambda row: float(np.trapezoid((-row[1]).clip(0.0), t)), "J", 0),
    ]


def _of_line(part: float, line: float) -> str:
    return f"{100.0 * part / line:.1f} % of the line" if line else ""
