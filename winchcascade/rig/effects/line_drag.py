"""LineDrag: one suspect of the stage transmission."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class LineDrag:
    """Drag between line and torque sensor in proportion to speed.

    Shows as: force above the baseline in payout and below it in haul-in, in proportion to the line's speed;
    torque and pressure agree.
    Easily taken for: drag on the fast shaft (rotor_viscous), which torque shows and haul-in does not; constant
    friction (line_friction).
    Source: Hsu et al. 2026, Sec. 4.3.2 (drag of the drivetrain that grows with speed); plausible range.
    """

    stage: ClassVar[str] = "transmission"
    reports: ClassVar[dict[str, str]] = {"b": "N.m.s/rad, at the drum"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"b": (0.0, 1000.0)}

    b: float = unknown(0.0, "N.m.s/rad", low=0.0, high=3.0, source="plausible range: 20 N m at 0.9 m/s")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, winch=replace(model.winch, drag=model.winch.drag + self.b))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"b": self.b}
