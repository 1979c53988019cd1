"""The velocity that drives a model: taken from the displacement too where that is more precise
than the velocity.
"""

import math
from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from openlog import crane_velocity

from winchcascade.core.run import Run, Signal
from winchcascade.core.scales import motion_of_runs
from winchcascade.core.smooth import local_quadratic
from winchcascade.rig.line_velocity import SMOOTHING, line_velocity

FINE = 1e-3
"""Interval at which the true motion is known. [s]"""

RESOLUTION = 1e-4
"""Of the displacement. [m]"""

T = np.arange(0.0, 112.0, FINE)
V = crane_velocity(T, 0.95, 3)
X = np.concatenate(([0.0], np.cumsum(0.5 * FINE * (V[1:] + V[:-1]))))

RAMP = motion_of_runs([Run("true", T, {"velocity": V}, 1.0 / FINE, T.size)]).ramp
"""Time in which the line speeds up. [s]"""

WITHIN = 0.15
"""The noise of a log of two minutes is found to this share."""


def log_of(fs: float, sd: float, seed: int = 3) -> Run:
    """The true motion, read with noise of the velocity and a displacement of a fine resolution."""
    t = np.arange(0.0, T[-1], 1.0 / fs)
    velocity = np.interp(t, T, V) + np.random.default_rng(seed).normal(0.0, sd, t.size)
    displacement = np.round(np.interp(t, T, X) / RESOLUTION) * RESOLUTION
    return Run(
        "made.csv", t, {"displacement": displacement, "velocity": velocity}, fs, t.size, load=4.5
    )


def with_displacement(run: Run, displacement: Signal | None) -> Run:
    """The log with another displacement, or without one."""
    channels = {"velocity": run.channels["velocity"]}
    return msgspec.structs.replace(
        run, channels=channels | ({} if displacement is None else {"displacement": displacement})
    )


def alone(run: Run) -> Signal:
    """The smoothed velocity without the displacement. [m/s]"""
    return local_quadratic(run.t, run.channels["velocity"], SMOOTHING * RAMP)


@pytest.mark.parametrize("fs", [5.0, 10.0, 25.0])
def test_a_precise_displacement_takes_more_than_half_of_the_noise_from_a_velocity(
    fs: float,
) -> None:
    run = log_of(fs, 0.015)
    found, exact = (
        line_velocity(run, RAMP),
        line_velocity(with_displacement(log_of(fs, 0.0), None), RAMP).value,
    )
    without, with_it = (float(np.std(value - exact)) for value in (alone(run), found.value))
    assert with_it < 0.5 * without
    assert found.noise() < 0.5 * without
    rest = np.concatenate([found.value[:5], found.value[-5:]])  # the ends are as precise
    assert np.max(np.abs(rest)) < 4.0 * found.max_noise


@pytest.mark.parametrize("samples", [1, 4])
def test_the_noise_of_a_velocity_with_its_displacement_is_that_of_its_means(samples: int) -> None:
    run, quiet = log_of(10.0, 0.015), log_of(10.0, 0.0)
    scatter = np.random.default_rng(4).normal(0.0, 1.5e-4, run.t.size)
    noisy = with_displacement(run, run.channels["displacement"] + scatter)
    found, channels = line_velocity(noisy, RAMP), ("velocity", "displacement")
    parts = [
        np.convolve(noisy.channels[name] - quiet.channels[name], kernel[::-1], "valid")
        for name, kernel in zip(channels, (found.of_velocity, found.of_displacement), strict=True)
    ]
    means = np.convolve(parts[0] + parts[1], np.full(samples, 1.0 / samples), "valid")
    assert found.of_displacement.any()
    assert found.noise(samples) == pytest.approx(float(np.std(means)), rel=WITHIN)


def summed(run: Run, velocity: Signal) -> Signal:
    """The displacement that a logger sums from a velocity by trapezoids. [m]"""
    return np.concatenate(([0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) / run.fs)))


DISPLACEMENTS: dict[str, Callable[[Run], Signal | None]] = {
    "none": lambda _: None,
    "summed from the velocity": lambda run: summed(run, run.channels["velocity"]),
    "summed from the filtered velocity": lambda run: np.round(
        summed(run, np.convolve(run.channels["velocity"], np.ones(4) / 4, "same")), 4
    ),
    "in steps of 5 mm": lambda run: np.round(np.interp(run.t, T, X) / 5e-3) * 5e-3,
    "read 0.3 of an interval late": lambda run: np.round(np.interp(run.t - 0.3 / run.fs, T, X), 4),
    "of a scale that is 3 % too large": lambda run: np.round(1.03 * np.interp(run.t, T, X), 4),
}
"""Displacements from which the velocity must not be taken."""


@pytest.mark.parametrize("what", DISPLACEMENTS)
def test_a_displacement_that_is_not_more_precise_or_contradicts_the_velocity_is_not_used(
    what: str,
) -> None:
    run = log_of(10.0, 0.006)
    assert line_velocity(run, RAMP).of_displacement.any()
    found = line_velocity(with_displacement(run, DISPLACEMENTS[what](run)), RAMP)
    assert np.array_equal(found.value, alone(run))
    assert found.noise() == pytest.approx(
        0.006 * math.sqrt(59.0 / 231.0), rel=WITHIN
    )  # a quadratic of 9 samples


def test_uneven_stamps_count_as_noise_of_the_displacement() -> None:
    run = log_of(10.0, 0.006)
    jitter = np.random.default_rng(5).uniform(-1e-3, 1e-3, run.t.size)
    assert not line_velocity(
        msgspec.structs.replace(run, t=run.t + jitter), RAMP
    ).of_displacement.any()


def test_a_bridged_displacement_is_not_used() -> None:
    run = log_of(10.0, 0.006)
    gap = msgspec.structs.replace(run, gaps={"displacement": np.array([[run.t[90], run.t[110]]])})
    found, whole = line_velocity(gap, RAMP), line_velocity(run, RAMP)
    assert np.array_equal(found.value[90:111], alone(run)[90:111])
    assert found.value[200:] == pytest.approx(whole.value[200:], abs=1e-12)


@pytest.mark.parametrize("samples", [1, 2, 4, 12])
def test_a_short_log_has_the_smoothed_velocity(samples: int) -> None:
    run = log_of(10.0, 0.006)
    channels = {name: x[:samples] for name, x in run.channels.items()}
    short = msgspec.structs.replace(run, t=run.t[:samples], channels=channels, samples=samples)
    assert np.array_equal(line_velocity(short, RAMP).value, alone(short))
