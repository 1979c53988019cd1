"""CopperHeating: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class CopperHeating:
    """Stator resistance lies above its cold value, as the copper is warm.

    Shows as: vdc and idc below the baseline at small load resistance, torque and force by less; the loss grows
    with current squared.
    Easily taken for: a diode drop beyond 0.7 V (diode_drop), whose loss grows with current; roll-off
    (ke_rolloff), which lowers torque more.
    Source: Hsu et al. 2026, Sec. 4.3.1: copper losses raised by temperature; copper gains 0.39 % per kelvin.
    """

    stage: ClassVar[str] = "generator"
    reports: ClassVar[dict[str, str]] = {"r_s_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"r_s_change": (0.0, 9.0)}

    r_s_change: float = unknown(0.0, "1", low=0.0, high=0.6, source="plausible range: copper 150 K above cold")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, generator=replace(model.generator, r_s=model.generator.r_s * (1.0 + self.r_s_change)))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"r_s_change": self.r_s_change}
