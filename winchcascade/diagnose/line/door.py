"""What a log must hold to be diagnosed without a model, and which of its samples count."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.cascade.power import power
from winchcascade.errors import LogError
from winchcascade.rig.stages import line_power
from winchcascade.run import CLOCK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.rigfile import Rig
    from winchcascade.run import Run, Signal

    Index = NDArray[np.intp]

AGAINST = -0.2
"""Power and line force times speed that are correlated below this run against each other: one has the other sign."""


def measured_power(run: Run, rig: Rig) -> Signal:
    """Mechanical power of the winch, (n,) [W].

    Raises
    ------
    LogError : the log lacks line force or power, or they run against each other
    """
    for channel, what in (("force", "line force"), ("velocity", "line velocity")):
        if channel not in run.channels:
            raise LogError(
                f"{run.name}: no {what}; a rig without a model ({rig.name}) is diagnosed from line force, velocity and "
                "mechanical power, so log it, or name its column under [columns] in the rig file."
            )
    found = power(run.channels, "mech", rig.r_drum)
    if found is None:
        raise LogError(
            f"{run.name}: no mechanical power of the winch, nor a torque with a drum radius in the rig file; a rig without a "
            f"model ({rig.name}) is diagnosed from line force, velocity and mechanical power, so log it."
        )
    return found


def good_samples(run: Run, reach: float) -> NDArray[np.bool_]:
    """Samples in which line force, velocity and power were logged, (n,); beside a gap of the velocity none has a slope.

    Parameters
    ----------
    reach : half of the width over which the slope is taken [s]
    """
    good = np.ones(run.t.size, dtype=bool)
    for channel, gaps in run.gaps.items():
        beside = reach if channel in (CLOCK, "velocity") else 0.0
        if channel in (CLOCK, "velocity", "force", "power_mech", "torque"):
            for a, b in gaps.tolist():
                good &= ~((run.t > a - beside) & (run.t < b + beside))
    return good


def check_sign(run: Run, gap: Signal, here: Index) -> None:
    """Refuse a power that runs against line force times speed: its sign, or that of the force, is the other one."""
    given = line_power(run)[here]
    together = float(np.dot(gap + given, given))
    size = float(np.linalg.norm(gap + given) * np.linalg.norm(given))
    if size > 0.0 and together / size < AGAINST:
        raise LogError(
            f"{run.name}: the mechanical power has the other sign: it is negative where line force times velocity is positive "
            f"(correlation {together / size:.2f}); it must be positive while the line drives the winch, so turn that column."
        )
