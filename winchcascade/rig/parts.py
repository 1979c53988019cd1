"""Parts of a rig with their numbers, and the model that consists of them.

A part is a named tuple, which compiled code takes as it is. A number that is added to a part, with
its unit and what it is for, reaches simulations, exports and the documentation from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, get_type_hints

import msgspec
import numpy as np

from winchcascade.core.machine_parts import measures
from winchcascade.core.quantity import ATMOSPHERE, KGF
from winchcascade.core.rig_file import PARTS as SECTIONS
from winchcascade.core.run import Signal

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator


class Number(NamedTuple):
    """What is known of a number of a part beside its value: its unit, what it is, its name in a rig
    file, where that is another one, and the limits of what is physically possible.
    """

    unit: str
    what: str
    in_rig: str = ""
    least: float = -math.inf
    most: float = math.inf


ABOVE_ZERO = math.ulp(0.0)
"""Limit of a number that must be above 0."""


class WinchModel(NamedTuple):
    """Drum, rope, and what acts between line and torque sensor. The encoder turns with the drum.

    `goes_slack`: the line is a rope without gas that keeps it taut, so that no tension below zero
    is read: something else turns the drum then.
    """

    r_drum: Annotated[float, Number("m", "radius of the drum")]
    inertia: Annotated[float, Number("kg.m2", "inertia at the drum", least=0.0)]
    friction: Annotated[float, Number("N.m", "constant torque against the motion")] = 0.0
    drag: Annotated[float, Number("N.m.s/rad", "torque over the speed of the drum")] = 0.0
    layering: Annotated[
        float, Number("1/m", "change of the radius of the rope for each metre paid out")
    ] = 0.0
    stribeck: Annotated[float, Number("N.m", "friction at standstill beyond the constant one")] = (
        0.0
    )
    stribeck_speed: Annotated[
        float, Number("m/s", "speed of the line at which 1/e of that is left")
    ] = 0.1
    loss_share: Annotated[
        float, Number("1", "share of the tension lost between crane and drum")
    ] = 0.0
    goes_slack: bool = False


class RestoringModel(NamedTuple):
    """Screw, piston and gas, or a spring or a counterweight that pulls at the drum, or nothing, as
    by default.

    Pressure, volume and force are those at zero payout. Without a piston the gas is as the
    atmosphere, and nothing presses.
    """

    lead: Annotated[float, Number("m/rad", "lead of the screw")] = 0.0
    lead_angle: Annotated[float, Number("rad", "lead angle of the screw")] = 0.25 * math.pi
    half_angle: Annotated[float, Number("rad", "half angle of the thread")] = 0.0
    mu: Annotated[float, Number("1", "friction coefficient of the screw", "mu_screw", 0.0)] = 0.0
    area: Annotated[float, Number("m2", "area of the piston", "area_piston")] = 0.0
    pressure: Annotated[
        float, Number("Pa", "absolute pressure of the gas", "p_precharge", ABOVE_ZERO)
    ] = ATMOSPHERE
    volume: Annotated[float, Number("m3", "volume of the gas", "volume_gas", ABOVE_ZERO)] = 1.0
    exponent: Annotated[
        float, Number("1", "polytropic exponent of a fast motion; 1 is isothermal")
    ] = 1.0
    cooling: Annotated[float, Number("s", "time in which the gas gives back its heat")] = 6.0
    seal_friction: Annotated[float, Number("N", "constant friction of the piston")] = 0.0
    stribeck: Annotated[
        float, Number("N.m", "friction of the seals at standstill beyond that, at the drum")
    ] = 0.0
    force: Annotated[float, Number("N", "force of the spring")] = 0.0
    stiffness: Annotated[float, Number("N/m", "stiffness of the spring", least=0.0)] = 0.0
    mass: Annotated[float, Number("kg", "mass of the counterweight", least=0.0)] = 0.0
    friction: Annotated[float, Number("N", "friction of spring or counterweight", least=0.0)] = 0.0

    @property
    def has_gas(self) -> bool:
        """Whether there is a piston that gas presses on."""
        return self.area > 0.0

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


class DrivetrainModel(NamedTuple):
    """One-way clutch, shaft spring, gear, and the rotating parts on the high-speed shaft."""

    gear: Annotated[float, Number("1", "gear ratio", "gear_ratio")]
    eta_mesh: Annotated[float, Number("1", "mesh efficiency", least=ABOVE_ZERO, most=1.0)]
    b_rotor: Annotated[float, Number("N.m.s/rad", "viscous loss of the high-speed shaft")]
    k_shaft: Annotated[float, Number("N.m/rad", "stiffness of the PTO shaft")]
    c_shaft: Annotated[float, Number("N.m.s/rad", "damping of the PTO shaft")]
    inertia_rotor: Annotated[float, Number("kg.m2", "inertia of the high-speed shaft")]
    windage: Annotated[
        float, Number("N.m.s2/rad2", "drag of the high-speed shaft over its speed squared")
    ] = 0.0
    friction: Annotated[float, Number("N.m", "constant drag of the high-speed shaft")] = 0.0
    clutch_drag: Annotated[
        float, Number("N.m", "torque of the open clutch against the drum in haul-in")
    ] = 0.0
    coast_drag: Annotated[
        float, Number("N.m", "torque of the open clutch while the rotor overruns the drum")
    ] = 0.0
    quasi_static: Annotated[
        float, Number("1", "share of a solution with stiff shaft, without capacitor")
    ] = 0.0
    weightless: Annotated[
        float, Number("1", "share of one without the inertia of the rotor as well")
    ] = 0.0


ROLLOFF_KNOTS = (0.0, 0.5, 0.8, 1.0, 1.2, 1.4, 1.8, 2.2, 2.8, 4.0)
"""Stator currents (rms) over the rated one at which the roll-off of the back-EMF constant is given,
closest about 1, where it begins. Between them it is a monotone cubic, beyond the last one constant.
[1]"""

NO_ROLLOFF = (1.0,) * (len(ROLLOFF_KNOTS) - 1)
"""Roll-off of a constant back-EMF constant: the whole of it remains at every current. [1]"""


@lru_cache(maxsize=256)
def rolloff_curve(rolloff: tuple[float, ...]) -> PchipInterpolator:
    """Share of the back-EMF constant up to the last of `ROLLOFF_KNOTS`, by a monotone cubic [1]
    (Fritsch and Butland 1984).

    It is one of the stator current over the rated one. `rolloff` is as in `GeneratorModel`.
    """
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(ROLLOFF_KNOTS, (1.0, *rolloff))


class GeneratorModel(NamedTuple):
    """Machine of constant parameters, and the diodes of its bridge, two of which conduct.

    `rolloff` is the share of k_e that remains at the stator currents of `ROLLOFF_KNOTS` beyond the
    first [1].
    """

    pole_pairs: Annotated[float, Number("1", "pairs of poles")]
    k_e: Annotated[float, Number("V/rpm", "back-EMF constant, line to line, rms")]
    r_s: Annotated[float, Number("ohm", "resistance of a phase")]
    l_s: Annotated[float, Number("H", "inductance of a phase")]
    v_diode: Annotated[float, Number("V", "drop of a diode", least=0.0)]
    r_diode: Annotated[
        float, Number("ohm", "slope of that drop over its current, as a resistance of the phase")
    ] = 0.0
    i_rated: Annotated[float, Number("A", "rated stator current, rms", least=ABOVE_ZERO)] = 1.0
    rolloff: tuple[float, ...] = NO_ROLLOFF
    averaged: Annotated[
        float, Number("1", "share of the textbook average in place of the switched bridge")
    ] = 0.0
    uncommutated: Annotated[float, Number("1", "share of that average without commutation")] = 0.0

    @property
    def r_phase(self) -> float:
        """Resistance of a phase with its conducting diode: each phase current flows through one
        diode at a time. [ohm]
        """
        return self.r_s + self.r_diode


class DcLinkModel(NamedTuple):
    """Capacitor, and the resistor that bleeds it where no load is connected."""

    c_dc: Annotated[float, Number("F", "capacitor of the DC link")]
    r_bleed: Annotated[float, Number("ohm", "load of an open circuit")]
    load_change: Annotated[float, Number("1", "deviation of a load from its nominal value")] = 0.0

    def resistance(self, load: float) -> float:
        """Resistance at the DC link with a nominal load; inf is an open circuit, in which the
        bleed is the load. [ohm]
        """
        return self.r_bleed if math.isinf(load) else load * (1.0 + self.load_change)


PARTS: Mapping[str, Any] = {
    "winch": WinchModel,
    "restoring": RestoringModel,
    "drivetrain": DrivetrainModel,
    "generator": GeneratorModel,
    "dc_link": DcLinkModel,
}
"""Parts of a model by the sections of a rig file."""


@cache
def numbers_of(part: str) -> Mapping[str, Number]:
    """Every number of a part with its unit and what it is, by name."""
    hints = get_type_hints(PARTS[part], include_extras=True)
    return {
        name: hint.__metadata__[0] for name, hint in hints.items() if hasattr(hint, "__metadata__")
    }


ELECTRICAL = ("vdc", "idc")
"""Channels that `Sensors.electrical_lag` delays."""


@cache
def every_number() -> Mapping[str, Number]:
    """Every number of all parts, by its path."""
    return {f"{part}.{name}": number for part in PARTS for name, number in numbers_of(part).items()}


class Sensors(msgspec.Struct, frozen=True):
    """Errors of the sensors by channel, absent by default: relative `gain`, `zero` in SI units, and
    the time by which Vdc and Idc are recorded late, `electrical_lag` [s].

    `motion_scale` is the relative error of the logged velocity and displacement of the line, which
    drive the model [1].
    """

    gain: Mapping[str, float] = msgspec.field(default_factory=dict)
    zero: Mapping[str, float] = msgspec.field(default_factory=dict)
    electrical_lag: float = 0.0
    motion_scale: float = 0.0

    def read(self, name: str, x: Signal) -> Signal:
        """Reading of a sensor for the true values of its channel, (n,) in its unit."""
        return x * (1.0 + self.gain.get(name, 0.0)) + self.zero.get(name, 0.0)

    def late(self, name: str, t: Signal) -> Signal:
        """Times at which a channel had the values that are recorded at some stamps, (n,) [s]."""
        stamps: Signal = np.maximum(t - self.electrical_lag, t[0]) if name in ELECTRICAL else t
        return stamps

    def recorded(self, name: str, t: Signal, x: Signal) -> Signal:
        """Record of a sensor, with its lag, for a channel that is known at the stamps of the
        log, (n,) in its unit.
        """
        return self.read(name, np.interp(self.late(name, t), t, x))

    def corrected(self, name: str, t: Signal, x: Signal) -> Signal:
        """A recorded channel without gain, zero and lag of its sensor, (n,) in its unit."""
        then = np.interp(t + self.electrical_lag, t, x) if name in ELECTRICAL else x
        return (then - self.zero.get(name, 0.0)) / (1.0 + self.gain.get(name, 0.0))


class Model(msgspec.Struct, frozen=True):
    """A rig to be simulated: parts with numbers in SI units; laws that a rig file does not
    contain are absent.
    """

    winch: WinchModel
    restoring: RestoringModel
    drivetrain: DrivetrainModel
    generator: GeneratorModel
    dc_link: DcLinkModel
    sensors: Sensors = Sensors()

    @property
    def r_motion(self) -> float:
        """Logged motion of the line over the angle of the drum: its radius, unless the logged
        motion has another scale. [m]
        """
        return self.winch.r_drum * (1.0 + self.sensors.motion_scale)

    @property
    def physics(self) -> Model:
        """The rig with sensors that have no error: what a design is made with."""
        return msgspec.structs.replace(self, sensors=Sensors())


def numbers_by_part(model: Model) -> dict[str, dict[str, Any]]:
    """Numbers of a model as a file holds them."""
    return {part: getattr(model, part)._asdict() for part in PARTS}


def model_of_numbers(numbers: Mapping[str, Mapping[str, Any]]) -> Model:
    """A model of its numbers by part; those of a row may come as a list."""
    parts = {}
    for part, kind in PARTS.items():
        rows = {name: tuple(x) for name, x in numbers[part].items() if isinstance(x, list)}
        parts[part] = kind(**{**numbers[part], **rows})
    return Model(**parts)


IN_RIG = {"restoring.lead": 2.0 * math.pi, "restoring.mass": KGF}
"""Numbers of the rig file over those of the model, where their units differ: a lead for each turn,
a mass as its weight. [rad/rev, N/kg]"""

Operation = Literal["add", "scale", "compound"]
"""Change of a number: by an amount, by a share of it or, if it is itself a relative deviation,
by a further share.
"""

_CHANGED: Mapping[Operation, Callable[[float, float], float]] = {
    "add": lambda number, by: number + by,
    "scale": lambda number, by: number * (1.0 + by),
    "compound": lambda number, by: (1.0 + number) * (1.0 + by) - 1.0,
}

CHANGED_AGAIN: Mapping[Operation, Callable[[float, float], float]] = {
    **_CHANGED,
    "scale": _CHANGED["compound"],
}
"""The one change that is as two after each other."""


def path_in_rig(path: str) -> str:
    """Section and name in a rig file for the path of a number of the model, whether a file has it
    or not.

    >>> path_in_rig("drivetrain.gear"), path_in_rig("generator.r_s")
    ('drivetrain.gear_ratio', 'generator.r_s')
    """
    section, _, name = path.partition(".")
    number = every_number().get(path)
    return f"{section}.{number.in_rig or name}" if number is not None else path


@cache
def in_rig_file(part: str) -> Mapping[str, str]:
    """Numbers of a part that rig files have, and their names there."""
    names = {name: number.in_rig or name for name, number in numbers_of(part).items()}
    return {name: in_rig for name, in_rig in names.items() if in_rig in measures(SECTIONS[part])}


def stated_path(path: str) -> str:
    """Section and name of a number that rig files have; empty for one that no file has.

    >>> stated_path("drivetrain.gear"), stated_path("drivetrain.windage")
    ('drivetrain.gear_ratio', '')
    """
    section, _, name = path.partition(".")
    return path_in_rig(path) if section in PARTS and name in in_rig_file(section) else ""


def number_of(model: Model, path: str) -> float:
    """A number of a model by its path: part and name, such as `generator.r_s`, and the channel
    of a sensor. SI units.
    """
    part, name, *channel = path.split(".")
    held = getattr(getattr(model, part), name)
    number: float = held.get(channel[0], 0.0) if channel else held
    return number


def with_part(model: Model, part: str, **numbers: object) -> Model:
    """A model of which some numbers of one part are others."""
    before = getattr(model, part)
    other = (
        before._replace(**numbers) if part in PARTS else msgspec.structs.replace(before, **numbers)
    )
    return msgspec.structs.replace(model, **{part: other})


def with_number(model: Model, path: str, number: float) -> Model:
    """A model of which one number, by its path, is another one."""
    part, name, *channel = path.split(".")
    value = {**getattr(getattr(model, part), name), channel[0]: number} if channel else number
    return with_part(model, part, **{name: value})


def changed(model: Model, path: str, operation: Operation, by: float) -> Model:
    """A model of which one number, by its path, is changed; changes of one kind may come in
    either order.
    """
    if not by:
        return model
    return with_number(model, path, _CHANGED[operation](number_of(model, path), by))


def differences(model: Model, other: Model) -> dict[str, float] | None:
    """Numbers in which another model differs, by their paths, and by how much they are larger
    there; None where more than numbers differ.

    >>> from winchcascade.core.rig_toml import built_in
    >>> from winchcascade.rig.baseline import baseline
    >>> model = baseline(built_in("hsu2026"))
    >>> differences(model, with_part(model, "winch", r_drum=model.winch.r_drum + 0.5))
    {'winch.r_drum': 0.5}
    """
    scale, other_scale = model.sensors.motion_scale, other.sensors.motion_scale
    if model.sensors != msgspec.structs.replace(other.sensors, motion_scale=scale):
        return None
    found: dict[str, float] = (
        {} if scale == other_scale else {"sensors.motion_scale": other_scale - scale}
    )
    for part in PARTS:
        here, there = getattr(model, part), getattr(other, part)
        for name, one, another in zip(here._fields, here, there, strict=True):
            if one is another or one == another:
                continue
            if isinstance(one, float) and isinstance(another, float):
                found[f"{part}.{name}"] = another - one
            elif isinstance(one, tuple) and isinstance(another, tuple):
                by = {k: b - a for k, (a, b) in enumerate(zip(one, another, strict=True))}
                found |= {f"{part}.{name}.{k}": change for k, change in by.items() if change}
            else:
                return None
    return found


@cache
def limited() -> Mapping[str, Number]:
    """Numbers with a limit of what is physically possible, by their paths."""
    return {
        path: number
        for path, number in every_number().items()
        if (number.least, number.most) != (-math.inf, math.inf)
    }


def possible(model: Model) -> Model:
    """The nearest physically possible model: an effect and the tolerance of a number of the rig
    may together exceed a limit.
    """
    for path, number in limited().items():
        value = number_of(model, path)
        if not number.least <= value <= number.most:
            model = with_number(model, path, min(max(value, number.least), number.most))
    return model
