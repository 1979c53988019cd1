"""Errors of zero and gain that the stated accuracy of a sensor allows."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import msgspec

from winchcascade.core.rig_file import Rig, Sensor

Part = Literal["zero", "gain", "gap", "lag"]
Shape = Literal["rectangular", "normal"]
Basis = Literal[
    "calibration_in_place", "limits", "expanded_uncertainty", "standard_uncertainty", "resampling", "relation"
]
"""What an error is known by: `u_zero` and `u_gain` of a sensor, limits of a maker, an accuracy with a coverage factor, `u` of a
number of the rig, samples of the log that are left out, or how its channels follow the motion."""

LEAKAGE = 2.0
"""Ratio of a current to that of the bleed resistance in open circuit, above which a load is connected. [1]"""

BLEED = 1000.0
"""Bleed resistance where the rig file states none: no open circuit has less. [ohm]"""

CERTAIN = 5.0
"""Number of standard uncertainties of the zero of a sensor from which an offset is significant."""

ACQUISITION = "acquisition system"
"""Origin of the errors that the acquisition system adds to those of a sensor."""


class ErrorSource(msgspec.Struct, frozen=True):
    """One source of uncertainty, the same over a whole run: zero [SI unit of the channel] or gain [1] of what is read,
    or lag [s].

    `u` is its standard uncertainty; `limit` the half width of a rectangular distribution, None for a normal one; `basis` what
    the rig file states it by.
    """

    channel: str
    part: Part
    u: float
    limit: float | None = None
    origin: str = ""
    basis: Basis = "limits"

    @property
    def shape(self) -> Shape:
        """Distribution that the error is taken to have."""
        return "normal" if self.limit is None else "rectangular"


@lru_cache(maxsize=64)
def error_sources(channel: str, sensor: Sensor) -> tuple[ErrorSource, ...]:
    """Zero and gain errors that the rig file allows a sensor, in SI units; empty without any.

    Each of the two is that of a calibration in place where the rig file states one (`u_zero`, `u_gain`), which contains the
    acquisition system; else what the accuracies of the sensor and of its acquisition system allow, as limits or with a
    coverage factor as expanded uncertainties. A share of the full scale limits the error at any reading, so it is a zero error
    and does not shrink at small readings; a share of the reading is a gain error. Where the zero alone is calibrated, a share
    of the full scale limits the gain.

    >>> from winchcascade.core.rig_file import Sensor
    >>> [(s.part, s.limit) for s in error_sources("force", Sensor("N", high=20000.0, accuracy_full_scale=0.002))]
    [('zero', 40.0)]
    >>> [(s.part, s.u) for s in error_sources("vdc", Sensor("V", accuracy_reading=0.004, coverage=2.0, u_zero=0.1))]
    [('zero', 0.1), ('gain', 0.002)]
    """
    full_scale = max(abs(sensor.low or 0.0), abs(sensor.high or 0.0))
    absolute = (sensor.accuracy or 0.0) + (sensor.accuracy_full_scale or 0.0) * full_scale
    stated = [  # absolute, of the reading, coverage factor, origin
        (absolute, sensor.accuracy_reading or 0.0, sensor.coverage, sensor.source),
        ((sensor.daq_full_scale or 0.0) * full_scale, sensor.daq_reading or 0.0, sensor.daq_coverage, ACQUISITION),
    ]
    found = []
    parts: tuple[tuple[Part, float | None], ...] = (("zero", sensor.u_zero), ("gain", sensor.u_gain))
    for part, u in parts:
        if u is not None:
            found.append(ErrorSource(channel, part, u, None, sensor.source, "calibration_in_place"))
            continue
        for fixed, reading, coverage, origin in stated:
            to_gain = fixed / full_scale if sensor.u_zero is not None and full_scale else 0.0
            size = fixed if part == "zero" else reading + to_gain
            limits = (size / math.sqrt(3.0), size, origin)
            expanded = (size / (coverage or 1.0), None, origin, "expanded_uncertainty")
            found.append(ErrorSource(channel, part, *(limits if coverage is None else expanded)))
    return tuple(source for source in found if source.u)


def part_uncertainty(sensor: Sensor | None, part: Part) -> float:
    """Standard uncertainty of zero [SI unit of the channel] or gain [1] of a sensor with its acquisition system, in squares.

    >>> from winchcascade.core.rig_file import Sensor
    >>> part_uncertainty(Sensor("N", accuracy=30.0, u_zero=2.0), "zero"), part_uncertainty(None, "zero")
    (2.0, 0.0)
    """
    return 0.0 if sensor is None else math.hypot(*(s.u for s in error_sources("", sensor) if s.part == part))


def open_circuit_current(rig: Rig, voltage: float) -> float:
    """Maximum DC current that bleed resistance and zero of the sensor account for at a voltage [V]. [A]

    >>> from winchcascade.core.rig_toml import built_in
    >>> round(open_circuit_current(built_in(), 300.0), 3)
    0.158
    """
    bleed = rig.dc_link.r_bleed
    resistance = bleed.value if bleed is not None and bleed.value > 0.0 else BLEED
    return LEAKAGE * voltage / resistance + CERTAIN * part_uncertainty(rig.sensors.get("idc"), "zero")


def student(freedom: float) -> float:
    """Half width of the 95 % interval of Student's distribution. [standard deviations]

    >>> round(student(2.0), 4), round(student(math.inf), 4)
    (4.3027, 1.96)
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975))
