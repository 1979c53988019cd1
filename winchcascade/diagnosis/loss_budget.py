"""Where the energy of the line goes in a simulation: the ledger booked over the integration windows, in groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.reduction.reduction_result import CycleResult
from winchcascade.rig.simulate import Simulation


class Group(NamedTuple):
    """Entries of `rig.simulate.LEDGER` that are shown together: `behind` the torque sensor, seen from the line, or before.

    `about` describes the group where its name is not enough.
    """

    name: str
    behind: tuple[str, ...] = ()
    before: tuple[str, ...] = ()
    about: str = ""


GROUPS = {
    "dc": Group("DC link", ("dc",), about="delivered"),
    "diodes": Group("diodes", ("diodes",), about="drop of the bridge"),
    "copper": Group("copper", ("copper",), about="resistance of the stator"),
    "damper": Group("damper", ("damper",), about="viscous drag of the fast shaft"),
    "windage": Group("windage", ("windage",)),
    "friction": Group("friction", ("friction",)),
    "mesh": Group("mesh", ("mesh",), about="gear teeth"),
    "clutch": Group("clutch", ("clutch",)),
    "shaft": Group("shaft", ("shaft", "shaft_loss"), about="its spring and damping"),
    "capacitor": Group("capacitor", ("capacitor",), about="charge of the DC link"),
    "inertia": Group("inertia", ("rotor",), ("drum",), "rotor and drum still turning"),
    "line": Group("line losses", (), ("line_loss",), "between line and torque sensor"),
    "seal": Group("seal", (), ("seal",)),
    "screw": Group("screw", (), ("screw",), "friction of the ball screw"),
    "stored": Group("stored gas", (), ("gas",), "held by the accumulator when the window ends"),
}
"""Where the energy of the line goes, from the DC link back to the line. Inertia is of rotor and drum, shaft of spring and
damping, line losses arise between line and torque sensor."""


class LossBudget(msgspec.Struct, frozen=True):
    """Means over the windows of the compared cycles [J]: of the simulated line, and of each of `GROUPS`.

    `drum` is what of the inertia belongs to the drum. `log` holds the energies that the log gives, by stage: line, mech, gen.
    """

    line: float
    groups: dict[str, float]
    drum: float
    log: dict[str, float]

    @property
    def shares(self) -> dict[str, float]:
        """Each group over the line's energy. [1]"""
        return {name: joule / self.line for name, joule in self.groups.items()}

    @property
    def mech(self) -> float:
        """Simulated share of the line's energy that reaches the torque sensor. [1]"""
        return (sum(self.groups[name] for name, group in GROUPS.items() if group.behind) - self.drum) / self.line


def budget_of(simulation: Simulation, cycles: Sequence[CycleResult]) -> LossBudget | None:
    """Book the energy of a simulation between onset and cutoff of each cycle, as a mean over the cycles."""
    run = simulation.run
    ends = np.array([(c.window.onset, c.window.cutoff) for c in cycles]).T
    joule = {name: float(np.mean(np.diff(np.interp(ends, run.t, x), axis=0))) for name, x in simulation.energy.items()}
    if joule["line"] <= 0.0:
        return None
    logged = {
        stage: [c.metrics[f"energy_{stage}"] for c in cycles]
        for stage in (("line",) if run.open_circuit else ("line", "mech", "gen"))
    }
    return LossBudget(
        line=joule["line"],
        groups={name: sum(joule[entry] for entry in (*g.behind, *g.before)) for name, g in GROUPS.items()},
        drum=joule["drum"],
        log={
            stage: sum(known) / len(known)
            for stage, x in logged.items()
            if None not in x and (known := [*filter(None, x)])
        },
    )
