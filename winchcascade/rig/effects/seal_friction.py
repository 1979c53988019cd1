"""SealFriction: one suspect of the stage restoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class SealFriction:
    """Constant friction of the piston seals.

    Shows as: force above the baseline in payout and below it in haul-in, by an amount that no pressure changes;
    torque and pressure agree.
    Easily taken for: friction before the screw (line_friction), which weighs alike in payout and haul-in; screw
    friction (screw_friction), which grows with pressure.
    Source: Hsu et al. 2026, Sec. 4.2: seals are lumped into the screw; plausible range.
    """

    stage: ClassVar[str] = "restoring"
    reports: ClassVar[dict[str, str]] = {"force": "N"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"force": (0.0, 100000.0)}

    force: float = unknown(0.0, "N", low=0.0, high=1500.0, source="plausible range: a tenth of the gas thrust")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(
            model, restoring=replace(model.restoring, seal_friction=model.restoring.seal_friction + self.force)
        )

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"force": self.force}
