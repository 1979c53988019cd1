"""GasPolytropic: one suspect of the stage restoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


@dataclass(frozen=True, slots=True)
class GasPolytropic:
    """Gas heats when it is compressed, cools when it expands, and takes seconds to come back to the ambient temperature.

    Shows as: pressure and force above the baseline late in payout, falling back in hold, and below it late in
    haul-in.
    Easily taken for: a smaller gas volume (gas_volume), whose pressure stays in hold; seals (seal_friction),
    which pressure does not show.
    Source: Hsu et al. 2026, Sec. 4.1.2: isothermal is assumed, 15 K at worst; adiabatic exponent of nitrogen
    1.4.
    """

    stage: ClassVar[str] = "restoring"
    reports: ClassVar[dict[str, str]] = {"n": "1"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {"n": (1.0, 1.67), "cooling": (0.01, 10000.0)}

    n: float = unknown(1.0, "1", low=1.0, high=1.4, source="isothermal to adiabatic")
    cooling: float = unknown(
        6.0, "s", low=1.0, high=60.0, source="plausible range: time in which the heat is given back"
    )

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        exponent = model.restoring.exponent + (self.n - 1.0)
        return replace(model, restoring=replace(model.restoring, exponent=exponent, cooling=self.cooling))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"n": self.n}
