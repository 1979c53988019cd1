"""Parts of a rig with their numbers, and the model that consists of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from winchcascade.core.run import Signal

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator


class WinchModel(msgspec.Struct, frozen=True):
    """Drum: radius [m], inertia [kg m2]; absent by default: friction, drag and layers of rope.

    `friction` is a constant torque against the motion [N m], `drag` one in proportion to the drum's speed [N m s/rad].
    `stribeck` is the torque by which the friction between line and torque sensor is larger at standstill [N m]; it fades by
    exp(-(v / stribeck_speed)^2) with the speed of the line [m/s].
    `layering` is the relative change of the effective radius of the rope for each metre that is paid out [1/m]. The encoder
    turns with the drum, so that layering changes the line tension but not the logged motion.
    `loss_share` is the share of the tension that is lost between crane and drum, in the bending rope, at sheaves [1]: in
    payout the line pulls F / (1 - s) for a tension F at the drum, in haul-in F (1 - s).
    """

    r_drum: float
    inertia: float
    friction: float = 0.0
    drag: float = 0.0
    layering: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.1
    loss_share: float = 0.0


class RestoringModel(msgspec.Struct, frozen=True):
    """Screw, piston and gas.

    Screw: `lead` [m/rad], `lead_angle` and `half_angle` of the thread [rad], friction `mu` [1]. Piston: `area` [m2]. Gas at
    zero payout: `pressure`, absolute [Pa], `volume` [m3]. Absent by default: `exponent` of a gas that heats when it is
    compressed (1: isothermal) and cools back over `cooling` [s], and `seal_friction` of the piston [N].
    `stribeck` is the torque at the drum, before the losses of the screw, by which that friction is larger at standstill; it
    fades as that of the winch [N m].
    """

    lead: float
    lead_angle: float
    half_angle: float
    mu: float
    area: float
    pressure: float
    volume: float
    exponent: float = 1.0
    cooling: float = 6.0
    seal_friction: float = 0.0
    stribeck: float = 0.0

    @property
    def eta_forward(self) -> float:
        """Efficiency of the screw while the line pays out: torque into thrust (Table 3). [1]"""
        return _thread(self.half_angle, self.mu, math.tan(self.lead_angle))

    @property
    def eta_reverse(self) -> float:
        """Efficiency of the screw while the line is hauled in: thrust into torque (Table 3). [1]"""
        return _thread(self.half_angle, self.mu, 1.0 / math.tan(self.lead_angle))


def _thread(half_angle: float, mu: float, tangent: float) -> float:
    """Efficiency of a screw that drives.

    >>> round(_thread(math.radians(4.5), 0.04, math.tan(math.radians(5.0))), 3)
    0.683
    """
    flank = math.cos(half_angle)
    return (flank - mu * tangent) / (flank + mu / tangent)


class DrivetrainModel(msgspec.Struct, frozen=True):
    """One-way clutch, shaft spring, gear, and the rotating parts on the fast shaft.

    `gear` [1], mesh efficiency `eta_mesh` [1], viscous damper `b_rotor` [N m s/rad] and inertia `inertia_rotor` [kg m2] of the
    fast shaft; `k_shaft` [N m/rad] and `c_shaft` [N m s/rad] of the slow one. Absent by default: `windage` in proportion to
    speed squared [N m s2/rad2] and constant `friction` [N m] on the fast shaft, and `clutch_drag` [N m], the torque of the
    overrunning clutch against the drum during haul-in, which the torque sensor measures, and `coast_drag` [N m], the same
    while the coasting rotor overruns the drum, which brakes the rotor; `quasi_static` and `weightless`, shares of solutions
    with a stiff shaft and without the capacitor, in the latter also without the inertia of the rotor [1].
    """

    gear: float
    eta_mesh: float
    b_rotor: float
    k_shaft: float
    c_shaft: float
    inertia_rotor: float
    windage: float = 0.0
    friction: float = 0.0
    clutch_drag: float = 0.0
    coast_drag: float = 0.0
    quasi_static: float = 0.0
    weightless: float = 0.0


ROLLOFF_KNOTS = (0.0, 4.0, 5.0, 6.0, 7.0, 9.0, 11.0, 14.0, 20.0)
"""Stator currents (rms) at which the roll-off of the back-EMF constant is given, closest about the rated 5.16 A, where it
begins. Between them it is a monotone cubic, beyond the last one constant. [A]"""

NO_ROLLOFF = (1.0,) * (len(ROLLOFF_KNOTS) - 1)
"""Roll-off of a constant back-EMF constant: the whole of it remains at every current. [1]"""


@lru_cache(maxsize=256)
def rolloff_curve(rolloff: tuple[float, ...]) -> PchipInterpolator:
    """Share of the back-EMF constant over the stator current up to the last of `ROLLOFF_KNOTS`, by a monotone cubic [1]
    (Fritsch and Butland 1984). `rolloff` is as in `GeneratorModel`.
    """
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(ROLLOFF_KNOTS, (1.0, *rolloff))


class GeneratorModel(msgspec.Struct, frozen=True):
    """Machine of constant parameters: `pole_pairs`, back-EMF `k_e` line to line, rms [V/rpm], `r_s` [ohm] and `l_s` [H] of a
    phase, and `v_diode`, the drop of each of the two conducting diodes [V].

    Absent by default: `r_diode`, the slope of a diode's drop over its current, which acts as a resistance of the phase [ohm];
    `rolloff`, share of k_e that remains at the stator currents of `ROLLOFF_KNOTS` beyond the first [1];
    `averaged` and `uncommutated`, shares of the textbook average in place of the switched bridge, of the latter without the
    voltage that commutation takes [1].
    """

    pole_pairs: float
    k_e: float
    r_s: float
    l_s: float
    v_diode: float
    r_diode: float = 0.0
    rolloff: tuple[float, ...] = NO_ROLLOFF
    averaged: float = 0.0
    uncommutated: float = 0.0

    @property
    def r_phase(self) -> float:
        """Resistance of a phase with its conducting diode: each phase current flows through one diode at a time. [ohm]"""
        return self.r_s + self.r_diode


class DcLinkModel(msgspec.Struct, frozen=True):
    """Capacitor [F], and the resistance that bleeds it where no load is connected [ohm].

    `load_change` is the relative deviation of a load from its nominal value, absent by default [1].
    """

    c_dc: float
    r_bleed: float
    load_change: float = 0.0

    def resistance(self, load: float) -> float:
        """Resistance at the DC link with a nominal load; inf is an open circuit, in which the bleed is the load. [ohm]"""
        return self.r_bleed if math.isinf(load) else load * (1.0 + self.load_change)


ELECTRICAL = ("vdc", "idc")
"""Channels that `Sensors.electrical_lag` delays."""


class Sensors(msgspec.Struct, frozen=True):
    """Errors of the sensors by channel, absent by default: relative `gain`, `zero` in SI units, and the time by which Vdc
    and Idc are recorded late, `electrical_lag` [s].

    `motion_scale` is the relative error of the logged velocity and displacement of the line, which drive the model [1].
    """

    gain: Mapping[str, float] = msgspec.field(default_factory=dict)
    zero: Mapping[str, float] = msgspec.field(default_factory=dict)
    electrical_lag: float = 0.0
    motion_scale: float = 0.0

    def read(self, name: str, x: Signal) -> Signal:
        """Reading of a sensor for the true values of its channel, (n,) in its unit."""
        return x * (1.0 + self.gain.get(name, 0.0)) + self.zero.get(name, 0.0)

    def late(self, t: Signal) -> Signal:
        """Times at which Vdc and Idc had the values that are recorded at some stamps, (n,) [s]."""
        stamps: Signal = np.maximum(t - self.electrical_lag, t[0])
        return stamps

    def _delays(self, name: str) -> bool:
        return name in ELECTRICAL and self.electrical_lag != 0.0

    def recorded(self, name: str, t: Signal, x: Signal) -> Signal:
        """Record of a sensor, with its lag, for a channel that is known at the stamps of the log, (n,) in its unit."""
        return self.read(name, np.interp(self.late(t), t, x) if self._delays(name) else x)

    def corrected(self, name: str, t: Signal, x: Signal) -> Signal:
        """A recorded channel without gain, zero and lag of its sensor, (n,) in its unit."""
        then = np.interp(t + self.electrical_lag, t, x) if self._delays(name) else x
        return (then - self.zero.get(name, 0.0)) / (1.0 + self.gain.get(name, 0.0))


class Model(msgspec.Struct, frozen=True):
    """A rig to be simulated: parts with numbers in SI units; laws that a rig file does not contain are absent."""

    winch: WinchModel
    restoring: RestoringModel
    drivetrain: DrivetrainModel
    generator: GeneratorModel
    dc_link: DcLinkModel
    sensors: Sensors = Sensors()

    @property
    def r_motion(self) -> float:
        """Logged motion of the line over the angle of the drum: its radius, unless the logged motion has another scale. [m]"""
        return self.winch.r_drum * (1.0 + self.sensors.motion_scale)

    @property
    def physics(self) -> Model:
        """The rig with sensors that have no error: what a design is made with."""
        return msgspec.structs.replace(self, sensors=Sensors())


Operation = Literal["add", "scale", "compound"]
"""Change of a number: by an amount, by a share of it or, if it is itself a relative deviation, by a further share."""

_CHANGED: Mapping[Operation, Callable[[float, float], float]] = {
    "add": lambda number, by: number + by,
    "scale": lambda number, by: number * (1.0 + by),
    "compound": lambda number, by: (1.0 + number) * (1.0 + by) - 1.0,
}

CHANGED_AGAIN: Mapping[Operation, Callable[[float, float], float]] = {
    "add": lambda first, second: first + second,
    "scale": lambda first, second: (1.0 + first) * (1.0 + second) - 1.0,
    "compound": lambda first, second: (1.0 + first) * (1.0 + second) - 1.0,
}
"""The one change that is as two after each other."""


_REQUIRED = {
    section: {field.name for field in msgspec.structs.fields(kind) if field.required}
    for section, kind in (
        ("winch", WinchModel),
        ("restoring", RestoringModel),
        ("drivetrain", DrivetrainModel),
        ("generator", GeneratorModel),
        ("dc_link", DcLinkModel),
    )
}
"""Numbers that a rig file must state, by part."""

NAMES_IN_RIG = {
    "restoring.mu": "mu_screw",
    "restoring.area": "area_piston",
    "restoring.pressure": "p_precharge",
    "restoring.volume": "volume_gas",
    "drivetrain.gear": "gear_ratio",
}
"""Names that a rig file has for numbers of the model, where they differ; its sections are the parts of the model."""


def path_in_rig(path: str) -> str:
    """Section and name in a rig file for the path of a number of the model, whether a file has it or not.

    >>> path_in_rig("drivetrain.gear"), path_in_rig("generator.r_s")
    ('drivetrain.gear_ratio', 'generator.r_s')
    """
    section, _, name = path.partition(".")
    return f"{section}.{NAMES_IN_RIG.get(path, name)}"


def stated_path(path: str) -> str:
    """Section and name of a number that every rig file states, as every part needs it; empty for one that no file has.

    >>> stated_path("drivetrain.gear"), stated_path("drivetrain.windage")
    ('drivetrain.gear_ratio', '')
    """
    section, _, name = path.partition(".")
    return path_in_rig(path) if name in _REQUIRED.get(section, ()) else ""


def number_of(model: Model, path: str) -> float:
    """A number of a model by its path: part and name, such as `generator.r_s`, and the channel of a sensor. SI units."""
    part, name, *channel = path.split(".")
    held = getattr(getattr(model, part), name)
    number: float = held.get(channel[0], 0.0) if channel else held
    return number


def changed(model: Model, path: str, operation: Operation, by: float) -> Model:
    """A model of which one number, by its path, is changed; changes of one kind may come in either order."""
    if not by:
        return model
    number = _CHANGED[operation](number_of(model, path), by)
    part, name, *channel = path.split(".")
    own = getattr(model, part)
    value = {**getattr(own, name), channel[0]: number} if channel else number
    return msgspec.structs.replace(model, **{part: msgspec.structs.replace(own, **{name: value})})


def possible(model: Model) -> Model:
    """The nearest physically possible model: no negative friction coefficient, no mesh efficiency above 1.

    An effect and the tolerance of a number of the rig may together exceed such a limit.
    """
    mu, eta_mesh = model.restoring.mu, model.drivetrain.eta_mesh
    if mu >= 0.0 and eta_mesh <= 1.0:
        return model
    return msgspec.structs.replace(
        model,
        restoring=msgspec.structs.replace(model.restoring, mu=max(mu, 0.0)),
        drivetrain=msgspec.structs.replace(model.drivetrain, eta_mesh=min(eta_mesh, 1.0)),
    )
