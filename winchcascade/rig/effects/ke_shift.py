"""KeShift: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class KeShift:
    """Back-EMF constant differs at every current: magnets warm or out of tolerance.

    Shows as: vdc and idc off by nearly the same share at every load, in open circuit too, torque and force by
    about twice that.
    Easily taken for: a gain error of Vdc (voltage_gain), which leaves torque and idc alone; roll-off
    (ke_rolloff), which open circuit does not show.
    Source: Hsu et al. 2026, Sec. 4.2, Fig. 12: 0.0620 V/rpm fitted, 0.0617 by the maker, within 10 %.
    """

    stage: ClassVar[str] = "generator"
    reports: ClassVar[dict[str, str]] = {"k_e_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"k_e_change": (-0.9, 9.0)}

    k_e_change: float = unknown(0.0, "1", low=-0.1, high=0.1, source="Sec. 4.2, Fig. 12c: the maker's limits of 10 %")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, generator=replace(model.generator, k_e=model.generator.k_e * (1.0 + self.k_e_change)))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"k_e_change": self.k_e_change}
