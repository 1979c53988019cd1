"""What a sensor's stated accuracy allows: errors of its zero and of its gain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec

if TYPE_CHECKING:
    from winchcascade.rigfile import Sensor

Part = Literal["zero", "gain"]
Shape = Literal["rectangular", "normal"]


class Source(msgspec.Struct, frozen=True):
    """One source of uncertainty, the same over a whole run: zero [SI unit of the channel] or gain [1] of what is read.

    `u` is its standard uncertainty; `limit` the half width of a rectangular distribution, None for a normal one.
    """

    channel: str
    part: Part
    u: float
    limit: float | None = None
    origin: str = ""

    @property
    def shape(self) -> Shape:
        """Distribution that the error is taken to have."""
        return "normal" if self.limit is None else "rectangular"


def error_sources(channel: str, sensor: Sensor) -> tuple[Source, ...]:
    """Errors that a sensor's stated accuracy allows, in SI units; empty where none is stated.

    Accuracies are limits of rectangular distributions. One in shares of the full scale (or absolute, with a known range)
    is half zero and half gain; a share of the reading is gain alone; an absolute one without a range is zero alone.
    Without any, standard uncertainties of a calibration in place count.

    >>> from winchcascade.rigfile import Sensor
    >>> [(s.part, s.limit) for s in error_sources("force", Sensor("N", high=20000.0, accuracy_full_scale=0.002))]
    [('zero', 20.0), ('gain', 0.001)]
    """
    full_scale = max(abs(sensor.low or 0.0), abs(sensor.high or 0.0))
    absolute = sensor.accuracy or 0.0
    absolute += (sensor.accuracy_full_scale or 0.0) * full_scale
    zero = 0.5 * absolute if full_scale > 0 else absolute
    gain = (0.5 * absolute / full_scale if full_scale > 0 else 0.0) + (sensor.accuracy_reading or 0.0)
    parts: tuple[tuple[Part, float, float | None], ...] = (("zero", zero, sensor.u_zero), ("gain", gain, sensor.u_gain))
    if zero or gain:
        return tuple(Source(channel, p, limit / math.sqrt(3.0), limit, sensor.source) for p, limit, _ in parts if limit)
    return tuple(Source(channel, p, u, None, sensor.source) for p, _, u in parts if u)
