"""ScrewFriction: one suspect of the stage restoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class ScrewFriction:
    """Friction coefficient of the screw differs.

    Shows as: force off in payout and in haul-in, in opposite directions and in proportion to pressure; torque
    and pressure agree.
    Easily taken for: seals (seal_friction) or friction at the drum (line_friction), whose amount no pressure
    changes.
    Source: Hsu et al. 2026, Table 3 and Sec. 4.2: 0.04, calibrated; ball screws reach 0.01.
    """

    stage: ClassVar[str] = "restoring"
    reports: ClassVar[dict[str, str]] = {"mu_change": "absolute"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"mu_change": (-0.04, 0.045)}

    mu_change: float = unknown(
        0.0, "1", low=-0.04, high=0.04, source="plausible range: no friction to nearly self-locking"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, restoring=replace(model.restoring, mu=model.restoring.mu + self.mu_change))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"mu_change": self.mu_change}
