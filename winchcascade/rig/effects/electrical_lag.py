"""ElectricalLag: one suspect of the stage sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class ElectricalLag:
    """Vdc and Idc are recorded late, by a pure delay.

    Shows as: vdc and idc alone, while speed changes: low as it rises, high as it falls; the plateau agrees.
    Easily taken for: another capacitor of the DC link, which delays less the smaller the load; inertia
    (rotor_inertia), which torque shows.
    Source: Hsu et al. 2026, Sec. 2.2: all channels at 25 Hz; plausible range of several samples.
    """

    stage: ClassVar[str] = "sensor"
    reports: ClassVar[dict[str, str]] = {"lag": "s"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"lag": (0.0, 60.0)}

    lag: float = unknown(0.0, "s", low=0.0, high=0.4, source="plausible range: ten samples of 25 Hz")

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        lag = model.sensors.electrical_lag + self.lag
        return replace(model, sensors=replace(model.sensors, electrical_lag=lag))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"lag": self.lag}
