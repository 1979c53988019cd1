"""Units of nature: by similarity a rig of another size is a rig of the paper's size whose
numbers are in other units.
"""

from __future__ import annotations

from functools import cached_property

import msgspec


class Units(msgspec.Struct, frozen=True, dict=True):
    """Factors by which six free units of a rig exceed those of the paper's rig; pressures stay,
    as the atmosphere does. [1]
    """

    length: float = 1.0
    time: float = 1.0
    force: float = 1.0
    volt: float = 1.0
    gear: float = 1.0
    lead: float = 1.0

    @cached_property
    def _factors(self) -> dict[str, float]:
        """Factor of each quantity; those of the high-speed shaft are named `rotor`, where a
        speed is `gear` times larger.
        """
        torque = self.force * self.length
        ampere = torque / self.time / self.volt
        ohm = self.volt / ampere
        return {
            "one": 1.0,
            "length": self.length,
            "per_length": 1.0 / self.length,
            "time": self.time,
            "speed": self.length / self.time,
            "force": self.force,
            "line_stiffness": self.force / self.length,
            "thrust": torque / self.lead,
            "volume": torque,
            "lead": self.lead,
            "gear": self.gear,
            "torque": torque,
            "damping": torque * self.time,
            "inertia": torque * self.time**2,
            "omega_rotor": self.gear / self.time,
            "torque_rotor": torque / self.gear,
            "damping_rotor": torque * self.time / self.gear**2,
            "windage_rotor": torque * self.time**2 / self.gear**3,
            "inertia_rotor": torque * self.time**2 / self.gear**2,
            "volt": self.volt,
            "ampere": ampere,
            "ohm": ohm,
            "henry": ohm * self.time,
            "farad": self.time / ohm,
            "volt_per_rotor": self.volt * self.time / self.gear,
        }

    def factor(self, quantity: str) -> float:
        """Factor of a quantity. [1]

        >>> Units(length=2.0, force=3.0).factor("torque"), PAPER_UNITS.factor("henry")
        (6.0, 1.0)
        """
        return self._factors[quantity]


PAPER_UNITS = Units()
"""SI units, in which the rig of the paper has its numbers."""


OF_EFFECTS = {
    "diode_drop": "volt",
    "rotor_viscous": "damping_rotor",
    "rotor_windage": "windage_rotor",
    "rotor_friction": "torque_rotor",
    "clutch_drag": "torque",
    "line_friction": "torque",
    "line_drag": "damping",
    "drum_inertia": "inertia",
    "drum_layering": "per_length",
    "gas_volume": "volume",
    "seal_friction": "thrust",
    "force_zero": "force",
    "electrical_lag": "time",
    "stribeck": "torque",
}
"""Quantity of the parameter that a diagnosis reports of an injected effect, where it has a
dimension.
"""
