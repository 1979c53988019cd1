"""The drum that the tether turns, and what takes force between the line and the torque sensor."""

from __future__ import annotations

import msgspec


class Winch(msgspec.Struct, frozen=True):
    """Drum: radius [m], inertia [kg m2]; absent by default: friction, drag and layers of rope.

    `friction` is a constant torque against the motion [N m], `drag` one in proportion to the drum's speed [N m s/rad].
    `layering` is the relative change of the rope's effective radius for each metre that is paid out [1/m]: the encoder
    turns with the drum, so the logged motion knows nothing of it, but the force does.
    """

    r_drum: float
    inertia: float
    friction: float = 0.0
    drag: float = 0.0
    layering: float = 0.0
