"""PistonArea: one suspect of the stage restoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class PistonArea:
    """Effective piston area differs.

    Shows as: force off at every displacement, and pressure rises less or more with it; at zero payout the
    pressure agrees.
    Easily taken for: another gas volume (gas_volume), whose force agrees at zero payout; screw friction
    (screw_friction), which pressure does not show.
    Source: Hsu et al. 2026, Table 3: 7850 mm2.
    """

    stage: ClassVar[str] = "restoring"
    reports: ClassVar[dict[str, str]] = {"area_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"area_change": (-0.9, 2.0)}

    area_change: float = unknown(
        0.0, "1", low=-0.3, high=0.2, source="plausible range; Sec. 4.1.2 would need about -0.3"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, restoring=replace(model.restoring, area=model.restoring.area * (1.0 + self.area_change)))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"area_change": self.area_change}
