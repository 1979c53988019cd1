"""Precharge: one suspect of the stage restoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class Precharge:
    """Precharge pressure of the gas differs.

    Shows as: pressure and force off by the same share of the absolute pressure at every displacement, in every
    phase.
    Easily taken for: a zero error of the pressure sensor, which does not grow with displacement and leaves
    force alone; another gas volume (gas_volume).
    Source: Hsu et al. 2026: 20.5 kg/cm2 in Sec. 3.1, 21 kg/cm2 in Sec. 4.1.2, 21 bar in Table 3.
    """

    stage: ClassVar[str] = "restoring"
    reports: ClassVar[dict[str, str]] = {"pressure_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"pressure_change": (-0.9, 9.0)}

    pressure_change: float = unknown(0.0, "1", low=-0.1, high=0.1, source="Sec. 3.1 against Table 3, twice over")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(
            model, restoring=replace(model.restoring, pressure=model.restoring.pressure * (1.0 + self.pressure_change))
        )

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"pressure_change": self.pressure_change}
