"""What the cross-checks are given: a run with its phases, and the rows of some of its cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import error_sources, zero_uncertainty
from winchcascade.core.integrate import median

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.phase_summary import PhaseSummary
    from winchcascade.reduction.phases import Cycle
    from winchcascade.reduction.windows import Plateau

MOST_CYCLES = 12
"""Number of cycles that are checked: an even selection of a longer log's. Faults of a sensor concern all of them."""


class Phased(msgspec.Struct, frozen=True):
    """A run, its smoothed line velocity [m/s], its cycles, and of each its plateau and its summary."""

    run: Run
    rig: Rig
    v_smooth: Signal
    cycles: Sequence[Cycle]
    plateaus: Sequence[Plateau | None]
    summaries: Sequence[PhaseSummary]

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


def middle(values: Sequence[float]) -> tuple[float, float]:
    """Median of some values and its standard uncertainty by their median deviation, 0 for a single one.

    >>> middle([1.0, 2.0, 9.0])[0]
    2.0
    """
    x = np.array(values)
    centre = median(x)
    return centre, 1.4826 * median(np.abs(x - centre)) * float(np.sqrt(0.5 * np.pi / x.size))
