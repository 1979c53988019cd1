"""CurrentGain: one suspect of the stage sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class CurrentGain:
    """Gain error of the current Idc.

    Shows as: idc alone, by the same share at every speed and load, and with it the apparent load resistance.
    Easily taken for: another load (load_drift), which vdc and torque show.
    Source: Not published; Hsu et al. 2026 name no accuracy for Idc. Plausible range.
    """

    stage: ClassVar[str] = "sensor"
    reports: ClassVar[dict[str, str]] = {"gain_error": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"gain_error": (-0.9, 9.0)}

    gain_error: float = unknown(0.0, "1", low=-0.1, high=0.1, source="plausible range")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, sensors=model.sensors.with_gain("idc", self.gain_error))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"gain_error": self.gain_error}
