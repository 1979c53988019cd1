"""The owner's own simulation of a run on the stamps of its log: aligned in time, compared in its line motion, interpolated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.smooth import local_quadratic
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.line_velocity import SMOOTHING

if TYPE_CHECKING:
    from winchcascade.core.run import Run, Signal

SAME = 0.01
"""Maximum rms difference of the velocities of log and simulation, as a share of the rms velocity. [1]"""

AT_ONCE = 0.1
"""Smaller shifts between log and simulation, in intervals of the log, are noise of the velocity and count as none. [1]"""

BEYOND = 1.5
"""Number of intervals before the beginning and after the end of a simulation beyond which its line is at rest. [1]"""

NEAR = 0.5
"""The shift is refined within this, as the correlation of logs that begin or end within a motion deviates. [s]"""

FINER = 1.5
"""Minimum number of samples of a simulation for each of the log from which it is averaged over the intervals of the log. [1]"""


def onto_log(simulation: Run, log: Run, counted: slice) -> Run:
    """Bring a simulation to the stamps of its log.

    Parameters
    ----------
    counted : samples of the log whose cycles count

    Raises
    ------
    LogError : the simulation lacks a channel that the log has, or has another line motion
    """
    missing = [name for name in CHANNELS if name in log.channels and name not in simulation.channels]
    if missing:
        raise LogError(
            f"{simulation.path}: the simulation has no column for {', '.join(missing)}, which the log {log.name} has; found "
            f"{', '.join(simulation.channels)}. Export {'them' if len(missing) > 1 else 'it'} too, or name the column in the "
            "rig file under [columns]."
        )
    shift, difference = _aligned(simulation, log, counted)
    if difference > SAME:
        raise LogError(
            f"{simulation.path}: the simulation has another line motion than the log {log.name}: the velocities differ by "
            f"{100.0 * difference:.2g} % rms after a shift of {shift:.3g} s; expected {100.0 * SAME:g} % at most. Drive the "
            "simulation with the velocity of the log, over all cycles that count."
        )
    channels = {name: _sampled(simulation, x, log, shift) for name, x in simulation.channels.items()}
    return msgspec.structs.replace(
        simulation,
        t=log.t,
        channels=channels,
        fs=log.fs,
        samples=log.t.size,
        load=log.load,
        gaps={},
        findings=(),
        simulated=True,
    )


def _smoothed(run: Run) -> Signal:
    """Velocity without the noise of an encoder, as the model takes it, (n,). [m/s]"""
    return local_quadratic(run.t, run.channels["velocity"], SMOOTHING)


def _aligned(simulation: Run, log: Run, counted: slice) -> tuple[float, float]:
    """By how much the clock of a simulation is ahead of that of its log [s], and the difference of the velocities then [1].

    The clocks may be the same, begin with the first sample, or be related by the correlation of the velocities.
    """
    from scipy.optimize import minimize_scalar
    from scipy.signal import correlate

    step, velocity, other = 1.0 / log.fs, _smoothed(log), _smoothed(simulation)
    scale = max(float(np.sqrt(np.mean(velocity[counted] ** 2))), 1e-6)

    def difference(shift: float) -> float:
        at = log.t[counted] + shift
        beyond = np.maximum(simulation.t[0] - at, at - simulation.t[-1]) > BEYOND / simulation.fs
        moved = np.where(beyond, 0.0, np.interp(at, simulation.t, other))
        return float(np.sqrt(np.mean((moved - velocity[counted]) ** 2))) / scale

    at_log, at_other = (np.arange(run.t[0], run.t[-1], step) for run in (log, simulation))
    together = correlate(np.interp(at_other, simulation.t, other), np.interp(at_log, log.t, velocity), method="fft")
    begins = float(simulation.t[0] - log.t[0])
    near = min((0.0, begins, begins + (int(np.argmax(together)) - at_log.size + 1) * step), key=difference)
    found = minimize_scalar(difference, bounds=(near - NEAR, near + NEAR), method="bounded", options={"xatol": 1e-5})
    shift = float(found.x)
    if abs(shift) < AT_ONCE * step:
        shift = 0.0
    return shift, difference(shift)


def _sampled(simulation: Run, x: Signal, log: Run, shift: float) -> Signal:
    """A channel of a simulation at the stamps of its log, (n,): between two samples by a straight line, of many the mean."""
    at = log.t + shift
    if simulation.fs < FINER * log.fs:
        return np.interp(at, simulation.t, x)
    total = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(simulation.t) * (x[1:] + x[:-1]))))
    half = 0.5 / log.fs
    low, high = (np.clip(at + side, simulation.t[0], simulation.t[-1]) for side in (-half, half))
    width = high - low
    means = np.interp(high, simulation.t, total) - np.interp(low, simulation.t, total)
    return np.where(width > half, means / np.maximum(width, half), np.interp(at, simulation.t, x))
