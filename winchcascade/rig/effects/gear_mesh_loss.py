"""GearMeshLoss: one suspect of the stage gearbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class GearMeshLoss:
    """Mesh efficiency of the gear below its given value.

    Shows as: torque and force above the baseline in payout by the same share at every speed and load; vdc and
    idc agree.
    Easily taken for: a gain error of the torque sensor (torque_gain), which leaves the force alone; constant
    drag (rotor_friction), whose share shrinks with load.
    Source: Hsu et al. 2026: 0.9 in Sec. 4.1.3, 0.95 in Table 4.
    """

    stage: ClassVar[str] = "gearbox"
    reports: ClassVar[dict[str, str]] = {"efficiency_change": "absolute"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"efficiency_change": (-0.9, 0.0)}

    efficiency_change: float = unknown(
        0.0, "1", low=-0.15, high=0.0, source="Sec. 4.1.3 against Table 4, three times over"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(
            model, drivetrain=replace(model.drivetrain, eta_mesh=model.drivetrain.eta_mesh + self.efficiency_change)
        )

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"efficiency_change": self.efficiency_change}
