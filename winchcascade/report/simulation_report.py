"""The report of a simulation: what its energies cover, where the energy of the line went, stages, and time histories."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_file import banner
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Signal
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report import sheet as content
from winchcascade.report.digits import NumberText, number, upper
from winchcascade.report.document import histories_section
from winchcascade.report.figures import powers_of
from winchcascade.report.sheet import TableColumn
from winchcascade.report.style import house_style
from winchcascade.report.terminal import LEDGER_WORDS, energy_shares, energy_span
from winchcascade.report.time_histories import readout
from winchcascade.report.wording import PLACES, load_words, subscripts_of, symbols_section
from winchcascade.rig.simulate import Simulation


@house_style()
def simulation_report(
    simulation: Simulation,
    *,
    rig: Rig | None = None,
    window: str | float | None = None,
    source: str = "",
    effects: str = "",
    command: str = "",
) -> content.Report:
    """Make the rows and figures of the report of a simulation; phases and windows are marked as `reduce` finds them.

    Parameters
    ----------
    rig : that was simulated; the paper's by default
    window : rule of the integration windows; by default the rig's
    source : log or profile whose line motion drove the rig
    effects : that were switched on, in words
    """
    run, name = simulation.run, "" if rig is None else rig.name
    found = reduce(run, rig=_as_simulated(simulation, rig or built_in()), window=window)
    joule = dict(energy_shares(simulation))
    line = joule.get("line", 0.0)
    load = load_words(run.load, before="load ", unknown="load unknown")
    about = (load, f"with {effects}" if effects else "", f"rig {name}" if name else "", run.about)
    return content.Report(
        kind="Simulation of a rig",
        title=run.name,
        subtitle=" · ".join(part for part in about if part),
        tiles=tuple(_tile(part, joule[part], line) for part in ("line", "gas", "dc") if part in joule and line),
        points=(
            content.data_point([run.origin]),
            content.Point("Energies", f"They count {energy_span(simulation)}."),
            content.Point("Effects", f"{upper(effects)}." if effects else "None beyond the model of the rig file."),
        ),
        sections=content.filled(
            content.section("energies", "Energies", _ledger(joule, line)),
            content.section("stages", "Stages", _stages(found)),
            histories_section(found),
            symbols_section(found.rig.cascade, cycles=False),
            content.provenance_section(
                [
                    ("Line motion from", source or run.path),
                    ("SHA-256 of that file", run.sha256),
                    ("Load", load_words(run.load, unknown="unknown")),
                    ("Samples", f"{run.samples} at {run.fs:.6g} Hz, {run.t[-1] - run.t[0]:.1f} s"),
                    ("Step of the simulation", f"{1e3 * simulation.motion.step:.3g} ms"),
                    ("Rig", name),
                    ("Effects", effects or "none"),
                ],
                command,
            ),
        ),
        traces=readout(found, powers_of(found)),
        banner=banner([run.origin]),
        subscripts=subscripts_of(found.rig.cascade),
    )


def _as_simulated(simulation: Simulation, rig: Rig) -> Rig:
    """The rig with the drum of the model, which an effect may have changed."""
    radius = Quantity(simulation.model.winch.r_drum, "m", "the simulated model")
    return replace(rig, winch=replace(rig.winch, r_drum=radius))


def _tile(name: str, joule: float, line: float) -> content.Tile:
    return content.Tile(name, LEDGER_WORDS[name], f"{number(joule, 0)} J", f"{100.0 * joule / line:.1f} % of the line")


def _ledger(joule: dict[str, float], line: float) -> content.Table:
    return content.ItemTable[tuple[str, float]](
        "ledger",
        "Where the energy of the line went." if joule else "No energy was moved.",
        [
            TableColumn("Energy", text=True, of=lambda item: item[0]),
            TableColumn("Value", "J", of=lambda item: NumberText(f"{item[1]:.0f}", item[1])),
            TableColumn("Share of the line", "%", 1, of=lambda item: 100.0 * item[1] / line if line else None),
            TableColumn("What it is", text=True, of=lambda item: LEDGER_WORDS[item[0]]),
        ],
    ).always(list(joule.items()))


def _stages(found: Reduction) -> content.Table | None:
    """Powers of each stage over the whole motion: largest, smallest, and the energies delivered and returned."""
    t = found.run.t
    return content.ItemTable[tuple[str, Signal]](
        "stages",
        "Powers of the stages over the whole motion.",
        [
            TableColumn("Stage", text=True, of=lambda item: PLACES.get(item[0], item[0])),
            TableColumn("Largest power", "W", 1, of=lambda item: float(item[1].max())),
            TableColumn("Smallest power", "W", 1, of=lambda item: float(item[1].min())),
            TableColumn("Energy delivered", "J", of=lambda item: float(np.trapezoid(item[1].clip(0.0), t))),
            TableColumn("Energy returned", "J", of=lambda item: float(np.trapezoid((-item[1]).clip(0.0), t))),
        ],
    ).of(list(powers_of(found).items()))
