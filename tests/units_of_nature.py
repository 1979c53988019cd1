"""A rig and its logs in other units of nature: every dimensionless number stays, and so do
pressures, as the atmosphere does.

By similarity (Buckingham 1914) all that is found of them must be the same, each number times its
factor.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import msgspec
import numpy as np
from hypothesis import strategies as st

from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Run
from winchcascade.core.scales import MotionScale
from winchcascade.rig.effects.effect import Effect, Parameter
from winchcascade.rig.parts import path_in_rig

SPAN = 8.0
"""Largest factor of a drawn unit, and the inverse of the smallest. [1]"""

EXACTLY = 1e-6
"""Relative difference of what is found in two systems of units: rounding, which the steps of a
fit enlarge. [1]
"""


class Nature(NamedTuple):
    """Factors of the units that are free, and of what follows from them. [1]"""

    length: float = 1.0
    time: float = 1.0
    force: float = 1.0
    volt: float = 1.0
    gear: float = 1.0
    lead: float = 1.0

    @property
    def torque(self) -> float:
        """Torque at the drum, an energy, and an amount of gas at a pressure."""
        return self.force * self.length

    @property
    def ampere(self) -> float:
        """Current."""
        return self.torque / self.time / self.volt

    @property
    def ohm(self) -> float:
        """Resistance."""
        return self.volt / self.ampere

    @property
    def rotor(self) -> float:
        """Speed of the rotor."""
        return self.gear / self.time

    def of(self, product: str) -> float:
        """A product of factors and of inverse ones, such as `force * length / time`; 1 for none."""
        first, *below = product.split("/")
        value = math.prod(getattr(self, word.strip()) for word in first.split("*") if word.strip())
        return float(value / math.prod(getattr(self, word.strip()) for word in below))


BENCH = Nature(length=0.36, time=0.6, force=0.05, volt=0.5, gear=0.2, lead=0.5)
"""Units in which a rig of 500 W is one of 15 W; the acceleration of gravity stays."""


@st.composite
def natures(draw: st.DrawFn, *, with_weights: bool = False) -> Nature:
    """Draw units of nature; `with_weights` such that the acceleration of gravity stays."""
    factor = st.floats(-1.0, 1.0).map(lambda x: SPAN**x)
    drawn = Nature(*(draw(factor) for _ in Nature._fields))
    return drawn._replace(length=drawn.time**2) if with_weights else drawn


NUMBERS = {
    "winch.r_drum": "length",
    "winch.inertia": "torque * time * time",
    "winch.friction": "torque",
    "winch.drag": "torque * time",
    "winch.layering": "/ length",
    "winch.stribeck": "torque",
    "winch.stribeck_speed": "length / time",
    "restoring.lead": "lead",
    "restoring.area_piston": "torque / lead",
    "restoring.volume_gas": "torque",
    "restoring.cooling": "time",
    "restoring.seal_friction": "torque / lead",
    "restoring.stribeck": "torque",
    "restoring.force": "force",
    "restoring.stiffness": "force / length",
    "restoring.mass": "force",
    "restoring.friction": "force",
    "drivetrain.gear_ratio": "gear",
    "drivetrain.b_rotor": "torque / gear / rotor",
    "drivetrain.k_shaft": "torque",
    "drivetrain.c_shaft": "torque * time",
    "drivetrain.inertia_rotor": "torque * time * time / gear / gear",
    "drivetrain.windage": "torque / gear / rotor / rotor",
    "drivetrain.friction": "torque / gear",
    "drivetrain.clutch_drag": "torque",
    "drivetrain.coast_drag": "torque",
    "generator.k_e": "volt / rotor",
    "generator.r_s": "ohm",
    "generator.r_diode": "ohm",
    "generator.pole_pairs": "/ gear",
    "generator.l_s": "ohm * time",
    "generator.v_diode": "volt",
    "generator.speed_rated": "rotor",
    "generator.i_rated": "ampere",
    "dc_link.c_dc": "time / ohm",
    "dc_link.r_bleed": "ohm",
    "sensors.electrical_lag": "time",
    "sensors.zero.force": "force",
}
"""Numbers that change, by their names in a rig file or else in the model; any other has no unit, or
is a pressure. Pole pairs change with the gear so that the electrical period keeps its share of a
ramp.
"""

OF_LAWS = {
    "clutch_drag.torque": "torque",
    "stribeck.torque": "torque",
    "stribeck.speed": "length / time",
    "gas_polytropic.cooling": "time",
}
"""Fields of effects that change no number of the model by themselves."""

CHANNELS = {
    "displacement": "length",
    "velocity": "length / time",
    "force": "force",
    "torque": "torque",
    "vdc": "volt",
    "idc": "ampere",
}
"""Channels of a log; pressures stay."""

THRESHOLDS = {
    "v_onset": "length / time",
    "smoothing": "time",
    "stroke_min": "length",
    "plateau_hold": "time",
    "settle": "time",
    "tau_engaged": "torque",
    "rpm_bin": "rotor",
    "gap_max": "time",
}
"""Thresholds of a rig file."""


def run_in(nature: Nature, run: Run) -> Run:
    """A log in other units."""
    channels = {name: x * nature.of(CHANNELS.get(name, "")) for name, x in run.channels.items()}
    gaps = {name: x * nature.time for name, x in run.gaps.items()}
    load = None if run.load is None else run.load * nature.ohm
    return msgspec.structs.replace(
        run,
        t=run.t * nature.time,
        channels=channels,
        gaps=gaps,
        fs=run.fs / nature.time,
        load=load,
        findings=(),
    )


def rig_in(nature: Nature, rig: Rig) -> Rig:
    """A rig in other units."""
    sections = {
        part: _part_in(nature, part, getattr(rig, part))
        for part in ("winch", "restoring", "drivetrain")
    }
    sections |= {
        part: _part_in(nature, part, getattr(rig, part)) for part in ("generator", "dc_link")
    }
    sensors = {
        name: _sensor_in(nature.of(CHANNELS.get(name, "")), sensor)
        for name, sensor in rig.sensors.items()
    }
    limits = {
        name: getattr(rig.thresholds, name) * nature.of(unit) for name, unit in THRESHOLDS.items()
    }
    thresholds = msgspec.structs.replace(rig.thresholds, **limits)
    return msgspec.structs.replace(rig, **sections, sensors=sensors, thresholds=thresholds)


def _part_in(nature: Nature, section: str, part: msgspec.Struct) -> Any:
    """A part of a rig in other units."""
    stated = {name: getattr(part, name) for name in part.__struct_fields__}
    numbers = {name: x for name, x in stated.items() if isinstance(x, Quantity)}
    return msgspec.structs.replace(
        part,
        **{
            name: _times(x, nature.of(NUMBERS.get(f"{section}.{name}", "")))
            for name, x in numbers.items()
        },
    )


def _times(number: Quantity, factor: float) -> Quantity:
    u = None if number.u is None else number.u * factor
    return msgspec.structs.replace(number, value=number.value * factor, u=u)


def _sensor_in(factor: float, sensor: Sensor) -> Sensor:
    """A sensor of a channel with another unit."""
    names = ("low", "high", "resolution", "accuracy", "u_zero")
    stated = {name: getattr(sensor, name) for name in names if getattr(sensor, name) is not None}
    return msgspec.structs.replace(sensor, **{name: x * factor for name, x in stated.items()})


def factor_of(nature: Nature, parameter: Parameter, effect: str = "") -> float:
    """Factor of a nuisance, or of a field of an effect. [1]"""
    unit = NUMBERS.get(path_in_rig(parameter.path), OF_LAWS.get(f"{effect}.{parameter.name}", ""))
    per_amount = parameter.operation == "add" or not parameter.path
    return nature.of(unit) if per_amount else 1.0


def factors_of(nature: Nature, effect: Effect) -> np.ndarray:
    """Factors of the fields of an effect, (k,). [1]"""
    return np.array([factor_of(nature, field, effect.name) for field in effect.fields])


def motion_in(nature: Nature, scale: MotionScale) -> MotionScale:
    """Scales of a motion in other units."""
    return MotionScale(
        scale.speed * nature.length / nature.time,
        scale.ramp * nature.time,
        scale.stroke * nature.length,
    )
