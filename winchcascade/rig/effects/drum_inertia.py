"""DrumInertia: one suspect of the stage transmission."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class DrumInertia:
    """Inertia at the drum differs: rope on the drum, chain and sprockets.

    Shows as: force off while the line speeds up or brakes, in payout and haul-in; torque and pressure agree.
    Easily taken for: inertia of the fast shaft (rotor_inertia), which torque shows and haul-in does not.
    Source: Hsu et al. 2026, Table 4: 0.3 kg m2.
    """

    stage: ClassVar[str] = "transmission"
    reports: ClassVar[dict[str, str]] = {"j_extra": "kg.m2"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"j_extra": (-0.29, 100.0)}

    j_extra: float = unknown(0.0, "kg.m2", low=-0.2, high=1.0, source="plausible range around Table 4")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, winch=replace(model.winch, inertia=model.winch.inertia + self.j_extra))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"j_extra": self.j_extra}
