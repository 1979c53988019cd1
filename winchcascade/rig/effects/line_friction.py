"""LineFriction: one suspect of the stage transmission."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class LineFriction:
    """Constant friction between line and torque sensor, against the motion.

    Shows as: force above the baseline in payout and below it in haul-in by the same amount; torque and pressure
    agree.
    Easily taken for: seals or screw (seal_friction, screw_friction), which also show in force alone, but whose
    share in haul-in differs and grows with pressure.
    Source: Hsu et al. 2026, Sec. 4.2: chain and sprockets are lumped into other blocks; plausible range.
    """

    stage: ClassVar[str] = "transmission"
    reports: ClassVar[dict[str, str]] = {"torque": "N.m, at the drum"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"torque": (0.0, 1000.0)}

    torque: float = unknown(
        0.0, "N.m", low=0.0, high=20.0, source="plausible range: haul-in leaves about 14 N m at the drum"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, winch=replace(model.winch, friction=model.winch.friction + self.torque))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"torque": self.torque}
