"""LoadDrift: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class LoadDrift:
    """Load resistance differs from its nominal value.

    Shows as: vdc and idc off in opposite directions, their ratio by the same share at every speed, and torque
    and force with them; in open circuit nothing.
    Easily taken for: gain errors of Vdc or Idc (voltage_gain, current_gain), which change that ratio but not
    the torque.
    Source: Hsu et al. 2026, Fig. 14d: the apparent resistance over speed; plausible range.
    """

    stage: ClassVar[str] = "generator"
    reports: ClassVar[dict[str, str]] = {"r_load_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"r_load_change": (-0.9, 9.0)}

    r_load_change: float = unknown(0.0, "1", low=-0.1, high=0.1, source="plausible range: a warm resistor")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        change = (1.0 + model.dc_link.load_change) * (1.0 + self.r_load_change) - 1.0
        return replace(model, dc_link=replace(model.dc_link, load_change=change))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"r_load_change": self.r_load_change}
