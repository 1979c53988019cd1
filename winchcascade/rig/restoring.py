"""Restoring module: a screw that turns with the drum pushes a piston against a gas-charged accumulator (Sec. 2.1.2)."""

from __future__ import annotations

import math

import msgspec


class Restoring(msgspec.Struct, frozen=True):
    """Screw, piston and gas.

    Screw: `lead` [m/rad], `lead_angle` and `half_angle` of the thread [rad], friction `mu` [1]. Piston: `area` [m2]. Gas at
    zero payout: `pressure`, absolute [Pa], `volume` [m3]. Absent by default: `exponent` of a gas that heats when it is
    compressed (1: isothermal) and cools back over `cooling` [s], and `seal_friction` of the piston [N].
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

    @property
    def eta_forward(self) -> float:
        """Efficiency of the screw while the line pays out: torque into thrust (Table 3). [1]"""
        return _thread(self.half_angle, self.mu, math.tan(self.lead_angle))

    @property
    def eta_reverse(self) -> float:
        """Efficiency of the screw while the line is hauled in: thrust into torque (Table 3). [1]"""
        tangent, flank = math.tan(self.lead_angle), math.cos(self.half_angle)
        return (flank - self.mu / tangent) / (flank + self.mu * tangent)


def _thread(half_angle: float, mu: float, tangent: float) -> float:
    """Efficiency of a screw that drives.

    >>> round(_thread(math.radians(4.5), 0.04, math.tan(math.radians(5.0))), 3)
    0.683
    """
    flank = math.cos(half_angle)
    return (flank - mu * tangent) / (flank + mu / tangent)
