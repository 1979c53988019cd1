"""Logs of an open circuit made with known numbers: the rig's model along a smooth crane motion,
read by sensors with noise.
"""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.fit.nuisances import quantity_of, with_quantity
from winchcascade.reduction.phases import detect, find_plateau, smoothed_velocity
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import simulate

Signal = NDArray[np.float64]

FS = 25.0

NOISE = {"velocity": 2e-3, "pressure": 300.0, "force": 4.0, "torque": 0.15, "vdc": 0.2, "idc": 5e-3}
"""Standard deviations of white noise, about those of the crane's logs. SI units."""

DECIMALS = 4
"""Digits of a noisy displacement in metres after the point, as in the crane's logs."""


def estimated_rig() -> Rig:
    """The built-in rig with the three numbers that an open circuit determines known to a tenth
    only.
    """
    rig = built_in()
    for place in (("generator", "k_e"), ("restoring", "mu_screw"), ("drivetrain", "b_rotor")):
        number = quantity_of(rig, *place)
        assert number is not None
        rig = with_quantity(rig, *place, msgspec.structs.replace(number, u=0.1 * number.value))
    return rig


def crane_velocity(t: Signal, speed: float, cycles: int) -> Signal:
    """Payouts of about 9 m with a smooth start, holds of 6 s and haul-ins, every 36 s. [m/s]"""
    v = np.zeros_like(t)
    for k in range(cycles):
        at = t - 36.0 * k - 4.0
        top = speed * (1.0 - 0.05 * k)
        payout = np.interp(at, (0.0, 4.0, 4.0 + 7.0 / top, 5.5 + 7.0 / top), (0.0, 1.0, 1.0, 0.0))
        rise = payout * payout * (3.0 - 2.0 * payout)
        back = at - 12.0 - 7.0 / top
        haul = np.interp(back, (0.0, 1.5, 8.0, 9.5), (0.0, 1.0, 1.0, 0.0))
        v += top * rise - 1.2 * haul * haul * (3.0 - 2.0 * haul)
    return v


def motion_run(speed: float = 0.95, cycles: int = 3, load: float | None = math.inf) -> Run:
    """A log that holds a line motion alone, without noise."""
    t = np.arange(0.0, 36.0 * cycles + 4.0, 1.0 / FS)
    v = crane_velocity(t, speed, cycles)
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) / FS)))
    return Run(
        "made.csv", t, {"displacement": x, "velocity": v}, FS, t.size, load=load, load_source="made"
    )


def made_log(model: Model | None = None, seed: int | None = None, **motion: float) -> Run:
    """A log of a model (the built-in rig's by default) along that motion; without a seed it has
    no noise.
    """
    run = simulate(motion_run(**motion), model or baseline(built_in())).run  # type: ignore[arg-type]
    channels = dict(run.channels)
    if seed is not None:
        rng = np.random.default_rng(seed)
        for name, sd in NOISE.items():
            channels[name] = channels[name] + rng.normal(0.0, sd, run.t.size)
        channels["displacement"] = np.round(channels["displacement"], DECIMALS)
    return msgspec.structs.replace(run, channels=channels, simulated=seed is None)


def steady_payouts(run: Run) -> list[tuple[float, float]]:
    """From the onset of each payout to the start of its braking. [s]"""
    limits = built_in().thresholds
    v = smoothed_velocity(run, limits)
    cycles = detect(run, v, limits)
    plateaus = [(cycle.onset, find_plateau(run.t, v, cycle, limits)) for cycle in cycles]
    return [(onset, plateau.braking) for onset, plateau in plateaus if plateau is not None]
