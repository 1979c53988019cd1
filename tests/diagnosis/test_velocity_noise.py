"""Noise of a coarse velocity in a fit: what it does to an inertia, and that a precise
displacement prevents it.
"""

import msgspec
import numpy as np
from rigs import calibrated_rig, suspects_on
from scipy.ndimage import gaussian_filter1d

from winchcascade.core.run import Run
from winchcascade.diagnosis.fit.expansion import marginal_about
from winchcascade.diagnosis.fit.fit_set import fit_set
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.rig.simulate import simulate

EVERY, FINE = 10, 1e-2
"""Samples of the true motion for each of the log, and their interval, so that the log has 10 Hz.
[1, s]
"""

NOISE = {"velocity": 0.015, "pressure": 1e3, "force": 4.0, "torque": 0.4, "vdc": 0.25, "idc": 0.015}
"""White noise: that of the velocity is five times as large as usual. SI units."""

QUIET = 1e-4
"""Noise of a velocity that moves no inertia. [m/s]"""

SEEDS = (2, 3, 4)

UNBIASED = 0.2
"""Largest mean change of the inertia over the seeds; a single log gives it to 0.5. [1]"""


def slow_log(seed: int, of_velocity: float = NOISE["velocity"]) -> Run:
    """A log of 10 Hz of the model of the built-in rig: two slow payouts against 4.5 ohm, hardly
    faster than the noise.
    """
    t = np.arange(0.0, 130.0, FINE)
    corners = np.array([4.0, 6.0, 35.0, 36.0, 44.0, 45.5, 52.0, 53.5])
    speeds = np.array([0.0, 0.3, 0.3, 0.0, 0.0, -1.2, -1.2, 0.0])
    v = gaussian_filter1d(
        sum(np.interp(t - 65.0 * k, corners, speeds) for k in range(2)), 0.3 / FINE
    )
    x = np.concatenate(([0.0], np.cumsum(0.5 * FINE * (v[1:] + v[:-1]))))
    whole = simulate(
        Run("made.csv", t, {"displacement": x, "velocity": v}, 1.0 / FINE, t.size, load=4.5)
    ).run
    channels, rng = (
        {name: values[::EVERY] for name, values in whole.channels.items()},
        np.random.default_rng(seed),
    )
    noise = {**NOISE, "velocity": of_velocity}
    channels |= {
        name: channels[name] + rng.normal(0.0, sd, channels[name].size)
        for name, sd in noise.items()
    }
    channels["displacement"] = np.round(channels["displacement"], 4)
    stamps = t[::EVERY]
    return msgspec.structs.replace(
        whole,
        t=stamps,
        channels=channels,
        fs=1.0 / (EVERY * FINE),
        samples=stamps.size,
        simulated=False,
    )


def found_inertia(run: Run) -> float:
    """Relative change of the rotor's inertia by the best fit. [1]"""
    rig = calibrated_rig()
    problem = RigProblem(Fitted([run], rig), suspects_on(rig, [run]))
    marginal = marginal_about(problem, [], np.zeros(problem.nuisances))
    return float(fit_set(problem, marginal, ("rotor_inertia",)).x[0])


def without_displacement(run: Run) -> Run:
    return msgspec.structs.replace(
        run, channels={k: x for k, x in run.channels.items() if k != "displacement"}
    )


def test_a_precise_displacement_keeps_noise_of_the_velocity_from_lowering_an_inertia() -> None:
    runs = [slow_log(seed) for seed in SEEDS]
    quiet = found_inertia(slow_log(SEEDS[0], QUIET))
    found = np.mean([found_inertia(run) for run in runs])
    alone = np.mean([found_inertia(without_displacement(run)) for run in runs])
    assert abs(found - quiet) < UNBIASED
    assert (
        alone < quiet - 1.5 * UNBIASED
    )  # the acceleration and the residual contain the same noise
