"""SyncInductance: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class SyncInductance:
    """Phase inductance differs from the maker's value.

    Shows as: vdc, idc, torque and force off where speed and current are both high: commutation takes longer.
    Easily taken for: roll-off (ke_rolloff), which needs current alone; hot copper (copper_heating), which needs
    no speed.
    Source: Hsu et al. 2026, Table 4 (constant Ld and Lq, Sec. 4.1.3).
    """

    stage: ClassVar[str] = "generator"
    reports: ClassVar[dict[str, str]] = {"l_s_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"l_s_change": (-0.9, 9.0)}

    l_s_change: float = unknown(0.0, "1", low=-0.3, high=0.3, source="plausible range")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, generator=replace(model.generator, l_s=model.generator.l_s * (1.0 + self.l_s_change)))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"l_s_change": self.l_s_change}
