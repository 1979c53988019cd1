"""KeRolloff: one suspect of the stage generator."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar

from msgspec.structs import replace

from winchcascade.core.quantity import unknown
from winchcascade.rig.parts import ROLLOFF_KNOTS

if TYPE_CHECKING:
    from winchcascade.rig.parts import Model


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
        "lost_to_4_a": (0.0, 0.9),
        "lost_to_5_a": (0.0, 0.9),
        "lost_to_6_a": (0.0, 0.9),
        "lost_to_7_a": (0.0, 0.9),
        "lost_to_9_a": (0.0, 0.9),
        "lost_to_11_a": (0.0, 0.9),
        "lost_to_14_a": (0.0, 0.9),
        "lost_to_20_a": (0.0, 0.9),
    }

    lost_to_4_a: float = unknown(
        0.0,
        "1",
        low=0.0,
        high=0.1,
        source="share lost between 0 and 4 A rms; plausible range, little below the rated 5.16 A (Sec. 5.1)",
    )
    lost_to_5_a: float = unknown(
        0.0, "1", low=0.0, high=0.1, source="share lost between 4 and 5 A rms, of what is left; plausible range"
    )
    lost_to_6_a: float = unknown(
        0.0, "1", low=0.0, high=0.1, source="share lost between 5 and 6 A rms, of what is left; plausible range"
    )
    lost_to_7_a: float = unknown(
        0.0, "1", low=0.0, high=0.1, source="share lost between 6 and 7 A rms, of what is left; plausible range"
    )
    lost_to_9_a: float = unknown(
        0.0, "1", low=0.0, high=0.15, source="share lost between 7 and 9 A rms, of what is left; plausible range"
    )
    lost_to_11_a: float = unknown(
        0.0, "1", low=0.0, high=0.15, source="share lost between 9 and 11 A rms, of what is left; plausible range"
    )
    lost_to_14_a: float = unknown(
        0.0, "1", low=0.0, high=0.2, source="share lost between 11 and 14 A rms, of what is left; plausible range"
    )
    lost_to_20_a: float = unknown(
        0.0, "1", low=0.0, high=0.3, source="share lost between 14 and 20 A rms, of what is left; plausible range"
    )

    @property
    def left_at_knots(self) -> tuple[float, ...]:
        """What is left of k_e at the stator currents of `ROLLOFF_KNOTS` beyond the first: it never rises. [1]

        >>> KeRolloff(lost_to_5_a=0.1, lost_to_20_a=0.5).left_at_knots
        (1.0, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.45)
        """
        left, knots = 1.0, []
        for field in fields(self):
            left *= 1.0 - getattr(self, field.name)
            knots.append(left)
        return tuple(knots)

    @property
    def k_e_ratio_at_10_a(self) -> float:
        """What is left of k_e at 10 A stator rms. [1]"""
        from scipy.interpolate import PchipInterpolator

        return float(PchipInterpolator(ROLLOFF_KNOTS, (1.0, *self.left_at_knots))(10.0))

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        left = tuple(a * b for a, b in zip(model.generator.rolloff, self.left_at_knots, strict=True))
        return replace(model, generator=replace(model.generator, rolloff=left))

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""
        return {"k_e_ratio_at_10_a": self.k_e_ratio_at_10_a}
