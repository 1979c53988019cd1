"""RotorViscous: one suspect of the stage gearbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class RotorViscous:
    """Drag on the fast shaft in proportion to its speed, beyond the calibrated damper.

    Shows as: torque and force above the baseline in payout, in proportion to speed, the same at every load; the
    rotor runs down faster after payout.
    Easily taken for: drag with speed squared (rotor_windage); drag between line and torque sensor (line_drag),
    which the torque does not show.
    Source: Hsu et al. 2026, Sec. 4.2, Fig. 11 (viscous damper) and Sec. 4.3.2 (oil churning).
    """

    stage: ClassVar[str] = "gearbox"
    reports: ClassVar[dict[str, str]] = {"b_extra": "N.m.s/rad"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"b_extra": (0.0, 1.0)}

    b_extra: float = unknown(
        0.0, "N.m.s/rad", low=0.0, high=0.002, source="plausible range: Sec. 4.2 identified 7.5e-4"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, drivetrain=replace(model.drivetrain, b_rotor=model.drivetrain.b_rotor + self.b_extra))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"b_extra": self.b_extra}
