"""ClutchDrag: one suspect of the stage gearbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class ClutchDrag:
    """Overrunning clutch drags while the line is hauled in.

    Shows as: torque below zero, and force lower, in haul-in alone.
    Easily taken for: a zero error of the torque sensor, which payout and hold show too; friction before the
    sensor (line_friction), which torque does not show.
    Source: Hsu et al. 2026, Sec. 4.1.3: an ideal clutch is assumed; plausible range.
    """

    stage: ClassVar[str] = "gearbox"
    reports: ClassVar[dict[str, str]] = {"torque": "N.m"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"torque": (0.0, 1000.0)}

    torque: float = unknown(
        0.0, "N.m", low=0.0, high=10.0, source="plausible range: less than the screw returns in haul-in"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(
            model, drivetrain=replace(model.drivetrain, clutch_drag=model.drivetrain.clutch_drag + self.torque)
        )

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"torque": self.torque}
