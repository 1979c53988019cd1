"""What a simulation states: where the energy of the line went, powers of the stages, time
histories.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from msgspec.structs import replace

from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Signal
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import Column, Note, Report, Table, Tile, section, shown, table
from winchcascade.report.figures.histories import powers_of
from winchcascade.report.glossary import STAGE_PLACES
from winchcascade.report.results.common import data_note, histories, provenance, samples_row
from winchcascade.report.wording import banner, load_words
from winchcascade.rig.ledger import LEDGER
from winchcascade.rig.simulate import Simulation

ENTRY_SHARE_MIN = 5e-4
"""Entries below this share of the energy of the line are left out: they round to 0.0 %, as
shares have one decimal. [1]
"""


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
    found = reduce(
        run, rig=_as_simulated(simulation, given_rig("write_report", rig, run.rig)), window=window
    )
    end = int(simulation.energy["line"].argmax())
    joule = {entry: float(energy[end]) for entry, energy in simulation.energy.items()}
    about = (f"with {effects}" if effects else "", f"rig {name}" if name else "", run.about)
    return Report(
        kind="Simulation of a rig",
        title=f"{run.name}: simulated at "
        f"{load_words(run.load, 'ohm', before='load ', unknown='load unknown')}",
        subtitle=" · ".join(filter(None, about)),
        tiles=_tiles(joule),
        points=[
            data_note([run.origin]),
            Note(f"{', '.join(left_out)}: errors of sensors, which are left out.", "Sensors")
            if left_out
            else None,
            Note("`winchcascade reduce` on the written log finds its cycles.", "Next", brief=False),
        ],
        sections=[
            section("energies", f"Energies up to {run.t[end]:.2f} s", _ledger_table(joule)),
            histories(found),
            section("stages", "Stages", _stages_table(found), folded=True),
            provenance(_sources(simulation, source), command),
        ],
        banner=banner([run.origin]),
    )


def _as_simulated(simulation: Simulation, rig: Rig) -> Rig:
    """The rig with the drum of the model, which an effect may have changed."""
    radius = Quantity(simulation.model.winch.r_drum, "m", "the simulated model")
    return replace(rig, winch=replace(rig.winch, r_drum=radius))


def _significant(joule: Mapping[str, float]) -> dict[str, float]:
    """Entries of the ledger that are not small beside the energy of the line. [J]"""
    return {
        entry: energy
        for entry, energy in joule.items()
        if abs(energy) >= ENTRY_SHARE_MIN * abs(joule["line"])
    }


def _percent_of_line(entry: str, joule: Mapping[str, float]) -> float | None:
    """Share of an entry in the energy of the line, None where the line delivers none. [%]"""
    return 100.0 * joule[entry] / joule["line"] if joule["line"] else None


def _tiles(joule: Mapping[str, float]) -> list[Tile]:
    """Energies of the line, the restoring module and the DC link."""
    listed = [entry for entry in ("line", "gas", "pull", "dc") if entry in _significant(joule)]
    shares = {entry: _percent_of_line(entry, joule) for entry in listed}
    return [
        Tile(
            entry,
            LEDGER[entry].words,
            f"{shown(joule[entry], 0)} J",
            "" if share is None else f"{share:.1f} % of the line",
        )
        for entry, share in shares.items()
    ]


def _ledger_table(joule: Mapping[str, float]) -> Table[str]:
    """Entries of the ledger with their shares in the energy of the line."""
    columns: list[Column[str]] = [
        Column("energy", str),
        Column("value", joule.__getitem__, "J", 0),
        Column("share", lambda entry: _percent_of_line(entry, joule), "%", 1),
        Column("what it is", lambda entry: LEDGER[entry].words),
    ]
    return table(
        "ledger", "Energies when that of the line is largest.", columns, _significant(joule)
    )


def _stages_table(found: Reduction) -> Table[tuple[str, Signal]]:
    """Powers of the stages of a simulated log."""
    t = found.run.t
    columns: list[Column[tuple[str, Signal]]] = [
        Column("stage", lambda row: STAGE_PLACES.get(row[0], row[0])),
        Column("largest power", lambda row: float(row[1].max()), "W", 1),
        Column("smallest power", lambda row: float(row[1].min()), "W", 1),
        Column("energy delivered", lambda row: float(np.trapezoid(row[1].clip(0.0), t)), "J", 0),
        Column("energy returned", lambda row: float(np.trapezoid((-row[1]).clip(0.0), t)), "J", 0),
    ]
    powers = powers_of(found).items()
    return table(
        "stages", "Powers of the stages over the whole motion.", columns, powers, brief=False
    )


def _sources(simulation: Simulation, source: str) -> list[tuple[str, str | None]]:
    """Where every number comes from."""
    run = simulation.run
    return [
        ("Line motion from", source or run.path),
        ("SHA-256 of that file", run.sha256),
        samples_row(run),
        ("Step of the simulation", f"{1e3 * simulation.motion.step:.3g} ms"),
    ]
