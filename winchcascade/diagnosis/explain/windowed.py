"""Quantities of a log over its integration windows, and the same of a model along its motion."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import means_of
from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.fit.fitted_log import Log
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.reduction.efficiency import METRICS
from winchcascade.reduction.phase_summary import mean_plateau_speed
from winchcascade.reduction.reduce import metrics_within, reduce

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.rig.parts import Model


QUANTITIES = (*METRICS, *CHANNELS)
"""The nine metrics of the integration windows, and the means of the channels over these windows."""


# ----------------------------------------------------------------------------- metrics of one run
def quantities_of(
    run: Run, rig: Rig, windows: Signal, channels: Mapping[str, Signal] | None = None
) -> Signal:
    """Means over the windows, (k, 2) [s], of each of `QUANTITIES`, (14,) SI units; NaN for what
    the run cannot give.

    Parameters
    ----------
    channels : (n,) each, those of the run by default
    """
    if not windows.size:
        return np.full(len(QUANTITIES), math.nan)
    channels = channels or run.channels
    cycles = [list(one.values()) for one in metrics_within(run, rig, windows, channels)]
    known = [k for k, name in enumerate(CHANNELS) if name in channels]
    means = np.full(len(CHANNELS), math.nan)
    means[known] = means_of(
        run.t, [channels[CHANNELS[k]].__getitem__ for k in known], windows
    ).mean(axis=1)
    return np.concatenate([np.mean(np.array(cycles, dtype=np.float64), axis=0), means])


def reduction_of(
    run: Run, rig: Rig, window: float | None, cycles: tuple[int, int] | None
) -> Reduction | None:
    """Reduction of a run; None where it has no window of that length [s]."""
    try:
        return reduce(run, rig=rig, window=window, cycles=cycles)
    except OptionError:
        return None


def complete_cycles(
    run: Run, rig: Rig, window: float | None, cycles: tuple[int, int] | None
) -> tuple[CycleResult, ...]:
    """Complete cycles of a run; none where it has no window of that length [s]."""
    found = reduction_of(run, rig, window, cycles)
    return () if found is None else found.complete


def windows_of(cycles: Sequence[CycleResult]) -> Signal:
    """Integration windows of some cycles, (k, 2) [s]."""
    found = [(one.window.onset, one.window.cutoff) for one in cycles]
    return np.array(found, dtype=np.float64).reshape(-1, 2)


class WindowedLog(NamedTuple):
    """A log with its integration windows, (k, 2) [s], whose metrics are simulated many times.

    `number` is that of the log, `plateau_speed` the mean over the cycles, None where they have no
    plateau [m/s]; `reduction` is that of the log, None where it has no window.
    """

    number: int
    log: Log
    rig: Rig
    windows: Signal
    plateau_speed: float | None
    reduction: Reduction | None

    def simulated(self, model: Model, skew: Signal, zeros: Signal) -> Signal:
        """What `quantities_of` gives for a model, (14,), also of channels that the log lacks.

        Parameters
        ----------
        skew, zeros : (5,) delay of the reading of each channel [s], and its zero
        """
        return self.quantities(self.log.at_stamps(model, skew, zeros))

    def quantities(self, read: Signal) -> Signal:
        """What `quantities_of` gives for readings at the stamps of the log, (14,) from (n, 5)."""
        run, channels = self.log.run, dict(zip(CHANNELS, read.T, strict=True))
        channels["velocity"] = run.channels["velocity"]
        return quantities_of(run, self.rig, self.windows, channels)


def windowed_logs(data: Fitted, windows: Sequence[float | None] | None = None) -> list[WindowedLog]:
    """Find the windows of all logs of a fit.

    Parameters
    ----------
    windows : of each log the length of its windows [s], None for the rule of the rig
    """
    lengths = enumerate(windows or [None] * len(data.logs))
    return all_at_once([partial(windowed, data, k, length) for k, length in lengths], data.sizes)


def windowed(data: Fitted, number: int, window: float | None = None) -> WindowedLog:
    """Find the windows of one log of a fit.

    Parameters
    ----------
    window : length of the windows [s]; by default the rule of the rig
    """
    log = data.logs[number]
    found = reduction_of(log.run, data.rig, window, data.cycles[number])
    cycles = () if found is None else found.complete
    speed = mean_plateau_speed(cycle.summary.payout for cycle in cycles)
    return WindowedLog(number, log, data.rig, windows_of(cycles), speed, found)
