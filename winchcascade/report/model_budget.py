"""The loss budget of a simulation: where the line's energy of a window goes, stored, lost part by part, or delivered."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

if TYPE_CHECKING:
    from winchcascade.report.model_data import Comparison


class Group(NamedTuple):
    """Entries of `rig.ledger.LEDGER` that are told together: those behind the torque sensor, and those before it."""

    name: str
    behind: tuple[str, ...] = ()
    before: tuple[str, ...] = ()


GROUPS = {
    "dc": Group("DC link", ("dc",)),
    "diodes": Group("diodes", ("diodes",)),
    "copper": Group("copper", ("copper",)),
    "damper": Group("damper", ("damper",)),
    "windage": Group("windage", ("windage",)),
    "friction": Group("friction", ("friction",)),
    "mesh": Group("mesh", ("mesh",)),
    "clutch": Group("clutch", ("clutch",)),
    "shaft": Group("shaft", ("shaft", "shaft_loss")),
    "capacitor": Group("capacitor", ("capacitor",)),
    "inertia": Group("inertia", ("rotor",), ("drum",)),
    "line": Group("line losses", (), ("line_loss",)),
    "seal": Group("seal", (), ("seal",)),
    "screw": Group("screw", (), ("screw",)),
    "stored": Group("stored gas", (), ("gas",)),
}
"""Where the line's energy goes, from the DC link back to the line. Inertia is of rotor and drum, shaft of spring and damping,
line losses arise between line and torque sensor."""

ALWAYS = ("stored", "screw", "line", "inertia", "mesh", "damper", "copper", "diodes", "dc")
"""Groups that a table shows in any case, from the line to the DC link; others only where there is something in them."""

NOTHING = 5e-4
"""A share of the line's energy below this is nothing to be named. [1]"""


class Budget(msgspec.Struct, frozen=True):
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
        behind = [name for name, group in GROUPS.items() if group.behind]
        return (sum(self.groups[name] for name in behind) - self.drum) / self.line


def budget_of(comparison: Comparison) -> Budget | None:
    """Book the energy of the simulation between onset and cutoff of each compared cycle, as a mean over the cycles."""
    booked, t = comparison.simulation.energy, comparison.run.t
    ends = np.array([(c.window.onset, c.window.cutoff) for c in comparison.cycles]).T
    joule = {name: float(np.mean(np.diff(np.interp(ends, t, x), axis=0))) for name, x in booked.items()}
    if joule["line"] <= 0.0:
        return None
    return Budget(
        line=joule["line"],
        groups={name: sum(joule[entry] for entry in (*g.behind, *g.before)) for name, g in GROUPS.items()},
        drum=joule["drum"],
        log=_logged(comparison),
    )


def _logged(comparison: Comparison) -> dict[str, float]:
    """Mean energies of the same cycles as the log gives them, by stage; none of shaft and DC link in open circuit. [J]"""
    stages = ("line",) if comparison.run.open_circuit else ("line", "mech", "gen")
    found = {}
    for stage in stages:
        values = [getattr(c.metrics, f"energy_{stage}") for c in comparison.cycles]
        if all(value is not None for value in values):
            found[stage] = float(np.mean(values))
    return found
