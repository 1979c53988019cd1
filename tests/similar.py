"""Rigs and logs in other units of nature: by similarity their reductions differ by factors
alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from winchcascade.core.channels import CHANNELS
from winchcascade.core.machine_parts import measures
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import PARTS, Rig, Thresholds
from winchcascade.core.run import Signal


class Nature(NamedTuple):
    """Factors of length, time, force and voltage; pressures stay, as the atmosphere does."""

    length: float
    time: float
    force: float
    voltage: float

    @property
    def power(self) -> float:
        return self.force * self.length / self.time

    def of(self, dimension: str) -> float:
        """Factor of a dimension of a rig file or of a channel."""
        torque, ohm = self.force * self.length, self.voltage**2 / self.power
        return {
            "length": self.length, "time": self.time, "velocity": self.length / self.time, "force": self.force,
            "torque": torque, "power": self.power, "energy": torque, "pressure": 1.0, "angle": 1.0, "number": 1.0,
            "lead": self.length, "area": self.force, "volume": torque, "inertia": torque * self.time**2,
            "line_stiffness": self.force / self.length, "stiffness": torque, "damping": torque * self.time,
            "back_emf": self.voltage * self.time, "resistance": ohm, "inductance": ohm * self.time,
            "capacitance": self.time / ohm, "voltage": self.voltage, "current": self.power / self.voltage,
            "rotation": 1.0 / self.time,
        }[dimension]  # fmt: skip


def scaled_rig(rig: Rig, nature: Nature, *, stated: bool) -> Rig:
    """A rig in other units, with its thresholds or with none that has a dimension."""
    parts = {
        name: _scaled(getattr(rig, name), kind, nature)
        for name, kind in PARTS.items()
        if name != "thresholds"
    }
    sizes = {
        name: getattr(rig.thresholds, name) * nature.of(one.dimension)
        for name, one in measures(Thresholds).items()
    }
    sizes["rpm_bin"] = rig.thresholds.rpm_bin / nature.time
    thresholds = replace(rig.thresholds, **sizes if stated else dict.fromkeys(sizes, math.nan))
    sensors = {}
    for name, sensor in rig.sensors.items():
        factor = nature.of(CHANNELS[name].dimension)
        ends = {
            key: getattr(sensor, key) for key in ("low", "high", "resolution", "accuracy", "u_zero")
        }
        sensors[name] = replace(
            sensor, **{key: factor * value for key, value in ends.items() if value is not None}
        )
    return replace(rig, **parts, thresholds=thresholds, sensors=sensors)


def _scaled(part: Any, kind: type[msgspec.Struct], nature: Nature) -> Any:
    """A table of a rig in other units."""
    numbers: dict[str, Quantity] = {name: getattr(part, name) for name in measures(kind)}
    scaled = {
        name: replace(
            number,
            value=number.value * (factor := nature.of(measures(kind)[name].dimension)),
            u=None if number.u is None else number.u * factor,
        )
        for name, number in numbers.items()
        if number is not None
    }
    return replace(part, **scaled) if scaled else part


def scaled_log(
    t: Signal, channels: Mapping[str, Signal], nature: Nature
) -> tuple[Signal, dict[str, Signal]]:
    """Stamps and channels in other units."""
    return t * nature.time, {
        name: x * nature.of(CHANNELS[name].dimension) for name, x in channels.items()
    }
