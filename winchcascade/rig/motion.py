"""The line motion that drives a simulation: smoothed, so that inertia torques are not noise, at even steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.smooth import local_quadratic

if TYPE_CHECKING:
    from winchcascade.run import Run, Signal

SAMPLES = 11
"""Samples that the local quadratic spans: noise of an encoder is taken out, and braking keeps its edges (9 to 13 serve)."""


class Motion(msgspec.Struct, frozen=True):
    """A line motion at even steps: times, displacement, velocity and acceleration, (n,) each, payout positive. SI units."""

    t: Signal
    x: Signal
    v: Signal
    a: Signal
    step: float


def motion_of(run: Run, step: float) -> Motion:
    """Take the motion of a log: its velocity, smoothed over `SAMPLES` samples, and the displacement that it integrates to.

    The displacement begins where the log's does (0 without that channel), and follows its drift, so that gas and force
    know the true payout.

    Parameters
    ----------
    step : of the simulation [s]
    """
    v = local_quadratic(run.t, run.channels["velocity"], SAMPLES / run.fs)
    motion = even_motion(run.t, v, step)
    measured = run.channels.get("displacement")
    if measured is None:
        return motion
    integral = np.interp(run.t, motion.t, motion.x)
    drift = local_quadratic(run.t, measured - integral, DRIFT)
    return msgspec.structs.replace(motion, x=motion.x + np.interp(motion.t, run.t, drift))


DRIFT = 2.0
"""Width over which the difference of displacement and integrated velocity is taken for drift, not for noise. [s]"""


def even_motion(t: Signal, v: Signal, step: float) -> Motion:
    """Lay a velocity onto even steps by a monotone cubic, with its slope and its integral.

    Parameters
    ----------
    t, v : (k,) stamps that rise [s], velocities [m/s]
    """
    from scipy.interpolate import PchipInterpolator

    n = int((t[-1] - t[0]) / step) + 1
    even = t[0] + step * np.arange(n)
    curve = PchipInterpolator(t, v)
    speed, slope = curve(even), curve.derivative()(even)
    x = np.concatenate(([0.0], np.cumsum(0.5 * step * (speed[1:] + speed[:-1]))))
    return Motion(even, x, speed, slope, step)
