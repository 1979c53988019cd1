"""ForceZero: one suspect of the stage sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class ForceZero:
    """Zero error of the force cell.

    Shows as: force alone, by the same amount in every phase.
    Easily taken for: another precharge (precharge), which pressure shows; friction (line_friction), which turns
    round with the motion.
    Source: Hsu et al. 2026, Table 1: 0.2 % of 2000 kg are 39 N.
    """

    stage: ClassVar[str] = "sensor"
    reports: ClassVar[dict[str, str]] = {"offset": "N"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"offset": (-100000.0, 100000.0)}

    offset: float = unknown(0.0, "N", low=-150.0, high=150.0, source="Table 1, four times over")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        if not self.offset:
            return model
        offset = model.sensors.zero.get("force", 0.0) + self.offset
        return replace(model, sensors=replace(model.sensors, zero={**model.sensors.zero, "force": offset}))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"offset": self.offset}
