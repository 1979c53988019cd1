"""RotorFriction: one suspect of the stage gearbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class RotorFriction:
    """Constant drag torque on the fast shaft: seals and bearings.

    Shows as: torque and force above the baseline in payout by the same amount at every speed and load, open
    circuit included.
    Easily taken for: a zero error of the torque sensor, which also shows at rest; friction before the sensor
    (line_friction), which torque does not show.
    Source: Hsu et al. 2026, Sec. 4.3.2 (sliding friction left out of models); plausible range.
    """

    stage: ClassVar[str] = "gearbox"
    reports: ClassVar[dict[str, str]] = {"torque": "N.m"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"torque": (0.0, 100.0)}

    torque: float = unknown(0.0, "N.m", low=0.0, high=0.6, source="plausible range: an eighth of the rated torque")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, drivetrain=replace(model.drivetrain, friction=model.drivetrain.friction + self.torque))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"torque": self.torque}
