"""Errors of zero and gain that the stated accuracy of a sensor allows."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from winchcascade.core.rig_file import Rig, Sensor

Part = Literal["zero", "gain"]
Shape = Literal["rectangular", "normal"]


LEAKAGE = 2.0
"""In open circuit the bleed resistance carries a current: more than so many times that current is a load."""

BLEED = 1000.0
"""Bleed resistance where the rig file states none: no open circuit has less. [ohm]"""

CERTAIN = 5.0
"""An offset is significant from so many standard uncertainties of the sensor's zero."""


class ErrorSource(msgspec.Struct, frozen=True):
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


def error_sources(channel: str, sensor: Sensor) -> tuple[ErrorSource, ...]:
    """Errors that a sensor's stated accuracy allows, in SI units; empty where none is stated.

    Accuracies are limits of rectangular distributions. One in shares of the full scale (or absolute, with a known range)
    is half zero and half gain; a share of the reading is gain alone; an absolute one without a range is zero alone.
    Without any, standard uncertainties of a calibration in place count.

    >>> from winchcascade.core.rig_file import Sensor
    >>> [(s.part, s.limit) for s in error_sources("force", Sensor("N", high=20000.0, accuracy_full_scale=0.002))]
    [('zero', 20.0), ('gain', 0.001)]
    """
    full_scale = max(abs(sensor.low or 0.0), abs(sensor.high or 0.0))
    absolute = (sensor.accuracy or 0.0) + (sensor.accuracy_full_scale or 0.0) * full_scale
    zero = 0.5 * absolute if full_scale > 0 else absolute
    gain = (0.5 * absolute / full_scale if full_scale > 0 else 0.0) + (sensor.accuracy_reading or 0.0)
    parts: tuple[tuple[Part, float, float | None], ...] = (("zero", zero, sensor.u_zero), ("gain", gain, sensor.u_gain))
    if zero or gain:
        return tuple(
            ErrorSource(channel, p, limit / math.sqrt(3.0), limit, sensor.source) for p, limit, _ in parts if limit
        )
    return tuple(ErrorSource(channel, p, u, None, sensor.source) for p, _, u in parts if u)


def zero_uncertainty(sensor: Sensor | None) -> float:
    """Standard uncertainty of a sensor's zero: as calibrated in place, else by its accuracy; 0 where none is stated.

    >>> from winchcascade.core.rig_file import Sensor
    >>> zero_uncertainty(Sensor("N", accuracy=30.0, u_zero=2.0)), zero_uncertainty(None)
    (2.0, 0.0)
    """
    if sensor is None:
        return 0.0
    return sensor.u_zero or sum(s.u for s in error_sources("", sensor) if s.part == "zero")


def open_circuit_current(rig: Rig, voltage: float) -> float:
    """Maximum DC current that bleed resistance and zero of the sensor account for at a voltage [V]. [A]

    >>> from winchcascade.core.rig_toml import built_in
    >>> round(open_circuit_current(built_in(), 300.0), 3)
    0.158
    """
    bleed = rig.dc_link.r_bleed
    resistance = bleed.value if bleed is not None and bleed.value > 0.0 else BLEED
    return LEAKAGE * voltage / resistance + CERTAIN * zero_uncertainty(rig.sensors.get("idc"))
