"""DiodeDrop: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class DiodeDrop:
    """Each of the two conducting diodes drops more than 0.7 V.

    Shows as: vdc and idc low by a nearly constant voltage, which weighs most at low speed and small load
    resistance, with a little less torque and force.
    Easily taken for: hot copper (copper_heating), whose drop grows with current; a smaller back-EMF constant
    (ke_shift), whose drop grows with speed.
    Source: Hsu et al. 2026, Eq. 8 (0.7 V) and Sec. 4.3.1 (conduction losses of the bridge).
    """

    stage: ClassVar[str] = "generator"
    reports: ClassVar[dict[str, str]] = {"v_d_extra": "V"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"v_d_extra": (0.0, 100.0)}

    v_d_extra: float = unknown(0.0, "V", low=0.0, high=1.5, source="plausible range of silicon diodes with their leads")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, generator=replace(model.generator, v_diode=model.generator.v_diode + self.v_d_extra))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"v_d_extra": self.v_d_extra}
