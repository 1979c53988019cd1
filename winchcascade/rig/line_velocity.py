"""Velocity of the line that drives a model: smoothed, and taken from the displacement too where
that is more precise.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from winchcascade.core.integrate import GAUSS, median, rms, white_noise
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.core.smooth import evenly_stamped, local_quadratic, smoothing_weights

SMOOTHING = 1.03
"""Width of the local quadratic over the ramp of the motion: it removes the noise of an encoder, and
braking keeps its edges (0.85 to 1.2 do). A width in samples would blur the motion of a coarse log.
[1]"""

INDEPENDENT = 0.15
"""A displacement is used if its white noise is below this share of that of the velocity times the
interval. One that a logger sums from its velocity by trapezoids has 0.19 of it, as sqrt(10 / 4 /
70), and cannot improve the velocity. [1]"""

CONSISTENT = (0.7, 1.5)
"""Range of the difference between the velocities without and with the displacement, as a root mean
square over what the noise of both channels makes. Below it the displacement follows from the
velocity: summed by trapezoids it gives 0.25 to 0.6. Above it the two differ by more than noise: by
a delay, a scale, or play. [1]"""


class LineVelocity(msgspec.Struct, frozen=True):
    """Smoothed velocity of a log at its stamps, (n,) [m/s], and what its noise follows from.

    `of_velocity` [1] and `of_displacement` [1/s] are the weights of 2 h + 1 neighbouring samples,
    `u_velocity` [m/s] and `u_displacement` [m] the white noise of these; without a precise
    displacement its weights are 0. `max_noise` is the standard deviation of a sample where the
    displacement is of least use [m/s].
    """

    value: Signal
    of_velocity: Signal
    of_displacement: Signal
    u_velocity: float
    u_displacement: float
    max_noise: float

    def noise(self, samples: int = 1) -> float:
        """Standard deviation of a mean over a number of samples. [m/s]"""
        mean = np.full(samples, 1.0 / samples)
        weights = np.convolve(mean, self.of_velocity), np.convolve(mean, self.of_displacement)
        return _noise_of((self.u_velocity, self.u_displacement), weights)


def line_velocity(run: Run, ramp: float) -> LineVelocity:
    """Smooth the velocity of a log over `SMOOTHING`, with its displacement where that is more
    precise and independent.

    Both enter one fit around each sample: a quadratic of the velocity and the cubic of the
    displacement that it integrates to, each weighted by its noise. Noise of the velocity does not
    average out of a diagnosis: an effect and the residual respond to the same noise, so that their
    product has a mean (errors in variables; Carroll, Ruppert, Stefanski and Crainiceanu 2006).

    Parameters
    ----------
    ramp : time in which the line speeds up [s]
    """
    velocity, width = run.channels["velocity"], SMOOTHING * ramp
    half = int(0.5 * width * run.fs + 1e-6)
    kernel, u_velocity = smoothing_weights(half), white_noise(velocity)
    alone = LineVelocity(
        value=local_quadratic(run.t, velocity, width),
        of_velocity=kernel,
        of_displacement=np.zeros_like(kernel),
        u_velocity=u_velocity,
        u_displacement=0.0,
        max_noise=u_velocity * float(np.linalg.norm(kernel)),
    )
    return _with_displacement(run, alone) or alone


def _with_displacement(run: Run, alone: LineVelocity) -> LineVelocity | None:
    """The velocity with the displacement; None where that is absent, less precise, or
    contradicts the velocity.
    """
    velocity, displacement = run.channels["velocity"], run.channels.get("displacement")
    half, interval = alone.of_velocity.size // 2, 1.0 / run.fs
    if displacement is None or half < 1 or alone.u_velocity == 0.0:
        return None
    of_stamps = (
        GAUSS
        * median(np.abs(np.diff(run.t, 2)))
        / math.sqrt(6.0)
        * float(np.max(np.abs(alone.value)))
    )
    u_velocity, u_displacement = alone.u_velocity, math.hypot(white_noise(displacement), of_stamps)
    if not 0.0 < u_displacement < INDEPENDENT * u_velocity * interval:
        return None
    usable = _usable(run, half)
    if np.count_nonzero(usable) < 0.5 * run.t.size:
        return None
    noise, channels = (u_velocity, u_displacement), (velocity, displacement)
    a, b = weights = rate_weights(half, interval, *noise)
    both = np.convolve(velocity, a[::-1], "same") + np.convolve(displacement, b[::-1], "same")
    difference = rms((both - alone.value)[usable])
    if (
        not CONSISTENT[0]
        < difference / _noise_of(noise, (a - alone.of_velocity, b))
        < CONSISTENT[1]
    ):
        return None
    max_noise = _noise_of(noise, weights)
    for at in range(
        1, half + 1
    ):  # the ends: a machine at rest would keep the voltage of a noisy first sample
        for middle, place in ((half, -at), (run.t.size - 1 - half, at)):
            of_end = rate_weights(half, interval, *noise, place)
            window = slice(middle - half, middle + half + 1)
            both[middle + place] = sum(
                float(w @ x[window]) for w, x in zip(of_end, channels, strict=True)
            )
            usable[middle + place] = usable[middle]
            max_noise = max(max_noise, _noise_of(noise, of_end))
    if not usable.all():
        max_noise = max(max_noise, alone.max_noise)
    return LineVelocity(
        np.where(usable, both, alone.value), a, b, u_velocity, u_displacement, max_noise
    )


def rate_weights(
    half: int, step: float, u_rate: float, u_position: float, at: int = 0
) -> tuple[Signal, Signal]:
    """Weights of the rate at one of 2 half + 1 even samples of a rate and of its position.

    A quadratic of the rate and the cubic of the position that it integrates to are fitted by
    weighted least squares.

    Parameters
    ----------
    step : between two samples [s]
    u_rate, u_position : white noise of the two, above 0
    at : the sample, from -half to half; 0 is the middle

    Returns
    -------
    (2 half + 1,) weights of the rate [1] and of the position [1/s]

    Examples
    --------
    >>> rate, position = rate_weights(2, 1.0, 1.0, 1e6)
    >>> bool(np.allclose(rate, smoothing_weights(2)) and np.allclose(position, 0.0))
    True
    """
    k = np.arange(-half, half + 1.0)
    share = u_position / (u_rate * step)
    one, nothing = np.ones_like(k), np.zeros_like(k)
    rate = np.column_stack([one, k, k**2 / 2.0, nothing])
    position = np.column_stack([k, k**2 / 2.0, k**3 / 6.0, one])
    fit = np.linalg.pinv(np.vstack([rate * min(share, 1.0), position / max(share, 1.0)]))
    solution = np.array([1.0, at, at * at / 2.0]) @ fit[:3]
    return solution[: k.size] * min(share, 1.0), solution[k.size :] / max(share, 1.0) / step


def _noise_of(noise: tuple[float, float], weights: tuple[Signal, Signal]) -> float:
    """Standard deviation of a sum of samples of velocity and displacement with these weights.
    [m/s]
    """
    return math.hypot(*(u * float(np.linalg.norm(w)) for u, w in zip(noise, weights, strict=True)))


def _usable(run: Run, half: int) -> Mask:
    """Samples whose neighbours within `half` are evenly stamped and were not bridged, in
    velocity and displacement.
    """
    usable = evenly_stamped(run.t, half)
    for channel in ("velocity", "displacement"):
        for last_good, first_good in run.gaps.get(channel, np.zeros((0, 2))):
            begin, end = (
                np.searchsorted(run.t, last_good, "right"),
                np.searchsorted(run.t, first_good, "left"),
            )
            usable[max(begin - half, 0) : end + half] = False
    return usable
