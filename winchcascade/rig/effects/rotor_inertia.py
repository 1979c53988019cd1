"""RotorInertia: one suspect of the stage gearbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class RotorInertia:
    """Inertia of the fast shaft differs: coupling, gear or brake disc not in the rotor's data.

    Shows as: torque and force off while the line speeds up and at the edge of braking; vdc runs down slower or
    faster after payout; the plateau agrees.
    Easily taken for: inertia at the drum (drum_inertia), which torque does not show; drag (rotor_viscous),
    which the plateau shows.
    Source: Hsu et al. 2026, Table 4: the rotor of the generator alone.
    """

    stage: ClassVar[str] = "gearbox"
    reports: ClassVar[dict[str, str]] = {"j_change": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"j_change": (-0.9, 9.0)}

    j_change: float = unknown(
        0.0, "1", low=-0.5, high=6.0, source="plausible range: the gear and the couplings are not in Table 4"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(
            model,
            drivetrain=replace(model.drivetrain, inertia_rotor=model.drivetrain.inertia_rotor * (1.0 + self.j_change)),
        )

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"j_change": self.j_change}
