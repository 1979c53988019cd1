"""The owner's own simulation of a run on the stamps of its log: aligned in time, compared in its line motion, interpolated."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.smooth import local_quadratic
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.simulate import SMOOTHING

if TYPE_CHECKING:
    from winchcascade.core.run import Run, Signal

SAME = 0.01
"""Maximum rms difference of the velocities of log and simulation, as a share of the rms velocity. [1]"""

AT_ONCE = 0.1
"""Smaller shifts between log and simulation, in intervals of the log, are noise of the velocity and count as none. [1]"""

FINER = 1.5
"""A simulation with so many samples for each of the log is averaged over the intervals of the log. [1]"""


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
    shift = _shift(simulation, log)
    velocity = _smoothed(log)[counted]
    other = np.interp(log.t[counted] + shift, simulation.t, _smoothed(simulation), left=0.0, right=0.0)
    difference = math.sqrt(float(np.mean((other - velocity) ** 2) / max(float(np.mean(velocity**2)), 1e-12)))
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


def _shift(simulation: Run, log: Run) -> float:
    """By how much the clock of a simulation is ahead of that of its log, by the correlation of the velocities. [s]"""
    from scipy.optimize import minimize_scalar
    from scipy.signal import correlate

    step = 1.0 / log.fs
    at_log, at_other = (np.arange(run.t[0], run.t[-1] + step, step) for run in (log, simulation))
    velocity, other = np.interp(at_log, log.t, _smoothed(log)), np.interp(at_other, simulation.t, _smoothed(simulation))
    lag = int(np.argmax(correlate(other, velocity, method="fft"))) - (velocity.size - 1)
    about = float(at_other[0] - at_log[0]) + lag * step

    def difference(shift: float) -> float:
        moved = np.interp(at_log + shift, at_other, other, left=0.0, right=0.0)
        return float(np.sum((moved - velocity) ** 2))

    found = minimize_scalar(difference, bounds=(about - step, about + step), method="bounded")
    shift = float(found.x)
    return 0.0 if abs(shift) < AT_ONCE * step else shift


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
