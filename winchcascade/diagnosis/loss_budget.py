"""Where the energy of the line goes in a simulation: the ledger booked over the integration windows, in groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.reduction.reduction_result import CycleResult
from winchcascade.rig.ledger import LEDGER
from winchcascade.rig.simulate import Simulation


class Group(NamedTuple):
    """What the entries of the ledger are that are shown together, and these: behind the torque sensor, seen from the line, and
    before it.
    """

    about: str
    behind: tuple[str, ...] = ()
    before: tuple[str, ...] = ()


def _groups() -> dict[str, Group]:
    """The groups of the ledger by their names, from the DC link back to the line."""
    found: dict[str, Group] = {}
    for entry, booked in LEDGER.items():
        if entry != "line":
            about, behind, before = found.get(booked.group, Group(booked.about))
            found[booked.group] = (
                Group(about, behind, (*before, entry)) if booked.before else Group(about, (*behind, entry), before)
            )
    return found


GROUPS = _groups()
"""Where the energy of the line goes, from the DC link back to the line."""


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
