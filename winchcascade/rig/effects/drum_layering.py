"""DrumLayering: one suspect of the stage transmission."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model

SPAN = 10.0
"""Payout over which the change of radius is given. [m]"""


@dataclass(frozen=True, slots=True)
class DrumLayering:
    """Effective radius of the rope changes linearly with the payout, from none at zero payout.

    Shows as: force alone, by a share that grows with the displacement, in payout, hold and haul-in alike.
    Easily taken for: a gain error of the force cell (force_gain), whose share is the same at every
    displacement; gas (gas_volume), which pressure shows.
    Source: Hsu et al. 2026, Secs. 2.1.1 and 2.2: a rope of 24 mm on a drum of radius 0.13 m, 12 turns in 10 m.
    """

    stage: ClassVar[str] = "transmission"
    reports: ClassVar[dict[str, str]] = {"radius_change_per_10_m": "relative"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"radius_change_per_10_m": (-0.8, 0.8)}

    radius_change_per_10_m: float = unknown(
        0.0, "1", low=-0.2, high=0.2, source="plausible range: one layer of 24 mm within 10 m"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        layering = model.winch.layering + self.radius_change_per_10_m / SPAN
        return replace(model, winch=replace(model.winch, layering=layering))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"radius_change_per_10_m": self.radius_change_per_10_m}
