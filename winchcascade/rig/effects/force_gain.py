"""ForceGain: one suspect of the stage sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class ForceGain:
    """Gain error of the force cell.

    Shows as: force alone, by the same share in every phase.
    Easily taken for: layers of rope (drum_layering), whose share grows with displacement; drag (line_drag),
    which turns round with the motion.
    Source: Hsu et al. 2026, Table 1: 0.2 % of full scale; plausible range of a cell not calibrated in place.
    """

    stage: ClassVar[str] = "sensor"
    reports: ClassVar[dict[str, str]] = {"gain_error": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"gain_error": (-0.9, 9.0)}

    gain_error: float = unknown(0.0, "1", low=-0.1, high=0.1, source="plausible range")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, sensors=model.sensors.with_gain("force", self.gain_error))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"gain_error": self.gain_error}
