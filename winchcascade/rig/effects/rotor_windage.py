"""RotorWindage: one suspect of the stage gearbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class RotorWindage:
    """Drag on the fast shaft in proportion to its speed squared.

    Shows as: torque and force above the baseline in payout at high speed, the same at every load.
    Easily taken for: drag in proportion to speed (rotor_viscous), which also shows at low speed.
    Source: Hsu et al. 2026, Sec. 4.3.2 (bearing windage); plausible range.
    """

    stage: ClassVar[str] = "gearbox"
    reports: ClassVar[dict[str, str]] = {"c_extra": "N.m.s2/rad2"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"c_extra": (0.0, 0.01)}

    c_extra: float = unknown(
        0.0, "N.m.s2/rad2", low=0.0, high=1.5e-05, source="plausible range: 0.66 N m at the rated 2000 rpm"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, drivetrain=replace(model.drivetrain, windage=model.drivetrain.windage + self.c_extra))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"c_extra": self.c_extra}
