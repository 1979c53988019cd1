"""Errors of zero and gain that the stated accuracy of a sensor allows."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import msgspec

from winchcascade.core.rig_file import Rig, Sensor

Part = Literal["zero", "gain"]
Shape = Literal["rectangular", "normal"]


LEAKAGE = 2.0
"""Ratio of a current to that of the bleed resistance in open circuit, above which a load is connected. [1]"""

BLEED = 1000.0
"""Bleed resistance where the rig file states none: no open circuit has less. [ohm]"""

CERTAIN = 5.0
"""Number of standard uncertainties of the zero of a sensor from which an offset is significant."""


NORMAL = 1.959963984540054
"""Half width of the 95 % interval of a normal distribution. [standard deviations]"""

COVERED = 0.975
"""Quantile of Student's distribution at the upper end of a 95 % interval."""

ACQUISITION = "acquisition system"
"""Origin of the errors that the acquisition system adds to those of a sensor."""


_SENSORS = 200
"""Number of sensors whose errors are kept: a campaign has one rig or a few."""


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


@lru_cache(_SENSORS)
def error_sources(channel: str, sensor: Sensor) -> tuple[ErrorSource, ...]:
    """Errors that the stated accuracies of a sensor and of its acquisition system allow, in SI units; empty without any.

    Accuracies are limits of rectangular distributions. One in shares of the full scale (or absolute, with a known range)
    is half zero and half gain; a share of the reading is gain alone; an absolute one without a range is zero alone.
    With a coverage factor they are expanded uncertainties of normal distributions, and zero and gain each have the share
    1 / sqrt(2), so that both in squares are the stated one at full scale (GUM 6.2). Without any accuracy of the sensor,
    standard uncertainties of a calibration in place count. The acquisition system adds errors of its own to a known sensor.

    >>> from winchcascade.core.rig_file import Sensor
    >>> [(s.part, s.limit) for s in error_sources("force", Sensor("N", high=20000.0, accuracy_full_scale=0.002))]
    [('zero', 20.0), ('gain', 0.001)]
    >>> [(s.part, s.u) for s in error_sources("vdc", Sensor("V", accuracy_reading=0.004, coverage=2.0))]
    [('gain', 0.002)]
    """
    full_scale = max(abs(sensor.low or 0.0), abs(sensor.high or 0.0))
    absolute = (sensor.accuracy or 0.0) + (sensor.accuracy_full_scale or 0.0) * full_scale
    own = _Stated(absolute, sensor.accuracy_reading or 0.0, full_scale, sensor.coverage)
    acquired = _Stated(
        (sensor.daq_full_scale or 0.0) * full_scale, sensor.daq_reading or 0.0, full_scale, sensor.daq_coverage
    )
    found = _sources(channel, own, sensor.source)
    if not found:
        in_place: tuple[tuple[Part, float | None], ...] = (("zero", sensor.u_zero), ("gain", sensor.u_gain))
        found = [ErrorSource(channel, part, u, None, sensor.source) for part, u in in_place if u]
    return (*found, *_sources(channel, acquired, ACQUISITION)) if found else ()


class _Stated(msgspec.Struct, frozen=True):
    """An accuracy: absolute and full scale [SI unit of the channel], share of the reading [1], coverage factor or None."""

    absolute: float
    reading: float
    full_scale: float
    coverage: float | None


def _sources(channel: str, stated: _Stated, origin: str) -> list[ErrorSource]:
    """Zero and gain errors of one stated accuracy; none for one that is not stated."""
    ranged = stated.full_scale > 0.0
    share = 1.0 if not ranged else 0.5 if stated.coverage is None else math.sqrt(0.5)
    zero = share * stated.absolute
    gain = (zero / stated.full_scale if ranged else 0.0) + stated.reading
    sizes: tuple[tuple[Part, float], ...] = (("zero", zero), ("gain", gain))
    if stated.coverage is not None:
        return [ErrorSource(channel, part, size / stated.coverage, None, origin) for part, size in sizes if size]
    return [ErrorSource(channel, part, limit / math.sqrt(3.0), limit, origin) for part, limit in sizes if limit]


def part_uncertainty(sensor: Sensor | None, part: Part) -> float:
    """Standard uncertainty of zero [SI unit of the channel] or gain [1] of a sensor with its acquisition system, in squares."""
    return 0.0 if sensor is None else math.hypot(*(s.u for s in error_sources("", sensor) if s.part == part))


def zero_uncertainty(sensor: Sensor | None) -> float:
    """Standard uncertainty of a sensor's zero: as calibrated in place, else by its accuracy; 0 where none is stated.

    >>> from winchcascade.core.rig_file import Sensor
    >>> zero_uncertainty(Sensor("N", accuracy=30.0, u_zero=2.0)), zero_uncertainty(None)
    (2.0, 0.0)
    """
    if sensor is None:
        return 0.0
    return sensor.u_zero or part_uncertainty(sensor, "zero")


def open_circuit_current(rig: Rig, voltage: float) -> float:
    """Maximum DC current that bleed resistance and zero of the sensor account for at a voltage [V]. [A]

    >>> from winchcascade.core.rig_toml import built_in
    >>> round(open_circuit_current(built_in(), 300.0), 3)
    0.158
    """
    bleed = rig.dc_link.r_bleed
    resistance = bleed.value if bleed is not None and bleed.value > 0.0 else BLEED
    return LEAKAGE * voltage / resistance + CERTAIN * zero_uncertainty(rig.sensors.get("idc"))


def student(freedom: float) -> float:
    """Half width of the 95 % interval of Student's distribution. [standard deviations]

    >>> round(student(2.0), 4), round(student(math.inf), 4)
    (4.3027, 1.96)
    """
    if math.isinf(freedom):
        return NORMAL
    from scipy.special import stdtrit

    return float(stdtrit(freedom, COVERED))
