"""Clutch, shaft, gear and fast shaft between the drum and the generator."""

from __future__ import annotations

import msgspec


class Drivetrain(msgspec.Struct, frozen=True):
    """One-way clutch, shaft spring, gear, and what turns on the fast shaft.

    `gear` [1], mesh efficiency `eta_mesh` [1], viscous damper `b_rotor` [N m s/rad] and inertia `inertia_rotor` [kg m2] of the
    fast shaft; `k_shaft` [N m/rad] and `c_shaft` [N m s/rad] of the slow one. Absent by default: `windage` in proportion to
    speed squared [N m s2/rad2] and constant `friction` [N m] on the fast shaft, and `clutch_drag` [N m], with which the
    overrunning clutch holds the drum back during haul-in and which the torque sensor sees.
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
