"""A suspect with values: the numbers of an effect as a fit moves them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import msgspec
import numpy as np

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.rig.parts import Model


class Suspect(Protocol):
    """An effect as the catalogue lists it: a frozen dataclass of fields that a fit may find."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    stage: ClassVar[str]
    reports: ClassVar[dict[str, str]]

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""


Suspects = Mapping[str, type[Suspect]]


class Freedom(msgspec.Struct, frozen=True):
    """Fields of one suspect, (k,) each: names, values where the effect is absent, and bounds of what is plausible."""

    names: tuple[str, ...]
    absent: Signal
    low: Signal
    high: Signal


def freedom(kind: type[Suspect]) -> Freedom:
    """What a fit may move of a suspect."""
    own = fields(kind)
    low, high = (np.array([field.metadata[end] for field in own], dtype=np.float64) for end in ("low", "high"))
    absent = np.array([field.default for field in own], dtype=np.float64)
    return Freedom(tuple(field.name for field in own), absent, low, high)


def with_values(kind: type[Suspect], values: Signal) -> Suspect:
    """A suspect with values, (k,), in the order of its fields."""
    return kind(**dict(zip(freedom(kind).names, values.tolist(), strict=True)))
