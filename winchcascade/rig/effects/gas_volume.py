"""GasVolume: one suspect of the stage restoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class GasVolume:
    """Effective gas volume differs from that of the accumulator.

    Shows as: pressure and force rise less or more with the displacement, in payout, hold and haul-in alike; at
    zero payout they agree.
    Easily taken for: another precharge (precharge), which zero payout shows; another piston area (piston_area),
    whose force differs at zero payout.
    Source: Hsu et al. 2026, Table 3 (4 L) against the printed rise of 21 to 25 kg/cm2 (Sec. 4.1.2), which would
    need about 6 L.
    """

    stage: ClassVar[str] = "restoring"
    reports: ClassVar[dict[str, str]] = {"volume_extra": "m3"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"volume_extra": (-0.002, 1.0)}

    volume_extra: float = unknown(0.0, "m3", low=-0.001, high=0.003, source="Table 3 against Secs. 3.1 and 4.1.2")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        return replace(model, restoring=replace(model.restoring, volume=model.restoring.volume + self.volume_extra))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"volume_extra": self.volume_extra}
