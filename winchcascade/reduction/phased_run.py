"""A run whose phases are known: cycles, plateaus and payouts, found by the rules of the rig."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import error_sources, zero_uncertainty
from winchcascade.core.integrate import extremes, integrals, median
from winchcascade.reduction.phases import check_cycles, detect, find_plateau, smoothed_velocity

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig, WindowRule
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.phases import Cycle, Plateau

MOST_CYCLES = 12
"""Number of cycles that are checked: an even selection of a longer log's. Faults of a sensor concern all of them."""


class PhasedRun(msgspec.Struct, frozen=True):
    """A run with the phases of those of its cycles that count.

    Parameters
    ----------
    rule : of the windows
    v_smooth : (n,) line velocity, smoothed [m/s]
    first : number of the first cycle that counts
    next_onset : of the payout that follows the last of the cycles [s], None if there is none
    plateaus, travel, speed_max : of each payout: its plateau, its travel [m] and its top smoothed speed [m/s]
    """

    run: Run
    rig: Rig
    rule: WindowRule
    v_smooth: Signal
    first: int
    cycles: Sequence[Cycle]
    next_onset: float | None
    plateaus: Sequence[Plateau | None]
    travel: Sequence[float]
    speed_max: Sequence[float]

    def chosen(self) -> list[int]:
        """Indices of the cycles that are checked."""
        n = len(self.cycles)
        return list(range(n)) if n <= MOST_CYCLES else np.linspace(0, n - 1, MOST_CYCLES).round().astype(int).tolist()

    def rows(self, start: float, end: float) -> slice:
        """Rows of the log from one instant to another."""
        first, last = np.searchsorted(self.run.t, (start, end))
        return slice(int(first), int(last))

    def u_gain(self, channel: str) -> float:
        """Standard uncertainty of a sensor's gain by its stated accuracy, 0 where none is stated. [1]"""
        sensor = self.rig.sensors.get(channel)
        return 0.0 if sensor is None else sum(s.u for s in error_sources(channel, sensor) if s.part == "gain")

    def u_zero(self, channel: str) -> float:
        """Standard uncertainty of a sensor's zero, 0 where none is stated. [SI unit of the channel]"""
        return zero_uncertainty(self.rig.sensors.get(channel))


def find_phases(run: Run, rig: Rig, rule: WindowRule, cycles: tuple[int, int] | None = None) -> PhasedRun:
    """Find the cycles of a run and what their payouts were like.

    Parameters
    ----------
    rule : of the windows
    cycles : first and last cycle that count, numbered by payout; all by default

    Raises
    ------
    OptionError : the log has none of these cycles
    """
    v_smooth = smoothed_velocity(run, rig.thresholds)
    detected = detect(run, v_smooth, rig.thresholds)
    if cycles is not None:
        check_cycles(cycles, detected, run.name)
    first, last = cycles or (1, len(detected))
    found, following = detected[first - 1 : last], detected[last:]
    payouts = np.array([(c.onset, c.payout_end) for c in found]).reshape(-1, 2)
    return PhasedRun(
        run=run,
        rig=rig,
        rule=rule,
        v_smooth=v_smooth,
        first=first,
        cycles=found,
        next_onset=following[0].onset if following else None,
        plateaus=[find_plateau(run.t, v_smooth, c, rig.thresholds) for c in found],
        travel=travel_in(run, payouts),
        speed_max=extremes(run.t, v_smooth, payouts)[1].tolist(),
    )


def travel_in(run: Run, spans: Signal) -> list[float]:
    """Net travel of the line in each span, (k, 2) [s], from the displacement, else the integral of the velocity. [m]"""
    displacement = run.channels.get("displacement")
    if displacement is None:
        return list(map(float, integrals(run.t, run.channels["velocity"].__getitem__, spans)))
    return list(map(float, np.diff(np.interp(spans, run.t, displacement), axis=1)[:, 0]))


def middle(values: Sequence[float]) -> tuple[float, float]:
    """Median of some values and its standard uncertainty by their median deviation, 0 for a single one.

    >>> middle([1.0, 2.0, 9.0])[0]
    2.0
    """
    x = np.array(values)
    centre = median(x)
    return centre, 1.4826 * median(np.abs(x - centre)) * float(np.sqrt(0.5 * np.pi / x.size))
