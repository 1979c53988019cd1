"""The step of a simulation that resolves how fast the rotor of a rig answers to its machine and
its shaft.
"""

from __future__ import annotations

import math

from winchcascade.core.errors import RigError
from winchcascade.core.scales import MotionScale
from winchcascade.rig import physics
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import RPM

RESOLVED = 2.0
"""Product of a step and the fastest rate of the rotor up to which the energy of a simulation closes
within 0.1 %, and a small change of a number changes little; with 6 a tenth of the energy is lost.
That of the rig of the paper is 1.9 with the coarse step of a fit. [1]"""

STEP = 1 / 430
"""Step of a simulation over the ramp of its motion: half of it changes no channel by more than
0.05 % of its plateau. [1]
"""

COARSE = 1 / 172
"""The same of the solutions that a fit compares with one another, and of a design. [1]"""

FINEST = 32
"""Parts of that step at most: a rotor that needs more is lighter than any that turns with such a
machine. [1]
"""

SLOW_LINE = 0.1
"""Share of the top speed of the line at which the reactance of the machine counts: heavy loads
are run so slowly. [1]
"""


def resolving(model: Model, motion: MotionScale, share: float = STEP) -> float:
    """Step that resolves a motion or, for a light rotor, a whole part of it. [s]

    Parameters
    ----------
    share : of the ramp of the motion [1]

    Raises
    ------
    RigError : the rotor is too light for its machine or its shaft, so that no practical step
        resolves it
    """
    rate, step = rate_of_the_rotor(model, motion.speed), share * motion.ramp
    parts = math.ceil(rate * step / RESOLVED)
    if parts > FINEST * max(1.0, share / STEP):
        shaft, machine = model.drivetrain, model.generator
        practical = shaft.inertia_rotor * rate * STEP * motion.ramp / RESOLVED / FINEST
        raise RigError(
            f"the model's inertia of the high-speed shaft is {shaft.inertia_rotor:.3g} kg.m2, "
            f"which a machine of {machine.k_e:.3g} V/rpm or the shaft spring stops within "
            f"{1e3 / rate:.2g} ms; expected about {practical:.2g} kg.m2 or more, so give the "
            "inertia_rotor of all that turns with the machine, and check k_e, r_s and k_shaft."
        )
    return step / max(parts, 1)


def rate_of_the_rotor(model: Model, speed: float) -> float:
    """Fastest rate at which machine, spring and damping of the shaft change the speed of the rotor.
    [1/s]

    The machine on a stiff DC link brakes by E^2 / R for each rad/s of speed, E the peak of its line
    voltage for each rad/s.

    Parameters
    ----------
    speed : top speed of the line [m/s]
    """
    shaft, machine = model.drivetrain, model.generator
    inertia = max(shaft.inertia_rotor, math.ulp(0.0))
    reactance = physics.reactance(SLOW_LINE * speed / model.winch.r_drum * shaft.gear, machine)
    ohm = max(2.0 * machine.r_phase + 3.0 / math.pi * reactance, math.ulp(0.0))
    braking = (math.sqrt(2.0) * machine.k_e * RPM) ** 2 / ohm
    at_rotor = inertia * shaft.gear**2
    return max(braking / inertia, math.sqrt(shaft.k_shaft / at_rotor), shaft.c_shaft / at_rotor)
