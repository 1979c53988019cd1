"""KeRolloff: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.quantity import unknown

if TYPE_CHECKING:
    from winchcascade.rig.model import Model


@dataclass(frozen=True, slots=True)
class KeRolloff:
    """Back-EMF constant falls with the stator current, by a law of unknown shape.

    Shows as: vdc, idc, torque and force below the baseline where the stator current is high, the more the
    smaller the load resistance; in open circuit nothing.
    Easily taken for: a larger phase inductance (sync_inductance), which also needs speed; hot copper
    (copper_heating), which costs more power than torque.
    Source: Hsu et al. 2026, Sec. 5.1, Fig. 18e.
    """

    stage: ClassVar[str] = "generator"
    reports: ClassVar[dict[str, str]] = {"k_e_ratio_at_10_a": "1"}
    possible: ClassVar[dict[str, tuple[float, float]]] = {
        "lost_to_5_a": (0.0, 0.9),
        "lost_to_10_a": (0.0, 0.9),
        "lost_to_20_a": (0.0, 0.9),
        "lost_to_30_a": (0.0, 0.9),
    }

    lost_to_5_a: float = unknown(
        0.0,
        "1",
        low=0.0,
        high=0.1,
        source="share lost between 0 and 5 A rms; plausible range, little below the rated 5.16 A (Sec. 5.1)",
    )
    lost_to_10_a: float = unknown(
        0.0, "1", low=0.0, high=0.25, source="share lost between 5 and 10 A rms, of what is left; plausible range"
    )
    lost_to_20_a: float = unknown(
        0.0, "1", low=0.0, high=0.4, source="share lost between 10 and 20 A rms, of what is left; plausible range"
    )
    lost_to_30_a: float = unknown(
        0.0, "1", low=0.0, high=0.4, source="share lost between 20 and 30 A rms, of what is left; plausible range"
    )

    @property
    def left_at_knots(self) -> tuple[float, float, float, float]:
        """What is left of k_e at the stator currents of `ROLLOFF_KNOTS` beyond the first: it never rises. [1]

        >>> KeRolloff(lost_to_10_a=0.1, lost_to_20_a=0.5).left_at_knots
        (1.0, 0.9, 0.45, 0.45)
        """
        at_5 = 1.0 - self.lost_to_5_a
        at_10 = at_5 * (1.0 - self.lost_to_10_a)
        at_20 = at_10 * (1.0 - self.lost_to_20_a)
        return at_5, at_10, at_20, at_20 * (1.0 - self.lost_to_30_a)

    @property
    def k_e_ratio_at_10_a(self) -> float:
        """What is left of k_e at 10 A stator rms. [1]"""
        return self.left_at_knots[1]

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        left = tuple(a * b for a, b in zip(model.generator.rolloff, self.left_at_knots, strict=True))
        return replace(model, generator=replace(model.generator, rolloff=left))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"k_e_ratio_at_10_a": self.k_e_ratio_at_10_a}
