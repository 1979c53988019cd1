"""Errors of zero and gain that the stated accuracy of a sensor allows."""

from __future__ import annotations

import math
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec

from winchcascade.core.rig_file import Rig, Sensor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal

Part = Literal["zero", "gain", "gap", "lag"]
Shape = Literal["rectangular", "normal"]
Basis = Literal[
    "calibration_in_place",
    "limits",
    "expanded_uncertainty",
    "standard_uncertainty",
    "resampling",
    "relation",
]
"""What an error is known by: `u_zero` and `u_gain` of a sensor, limits of a maker, an accuracy with
a coverage factor, `u` of a number of the rig, samples of the log that are left out, or how its
channels follow the motion."""

LEAKAGE = 2.0
"""Ratio of a current to that of the bleed resistance in open circuit, above which a load is
connected. [1]
"""

BLEED = 1000.0
"""Bleed resistance where the rig file states none: no open circuit has less. [ohm]"""

CERTAIN = 5.0
"""Number of standard uncertainties of the zero of a sensor from which an offset is significant."""

ACQUISITION = "acquisition system"
"""Origin of the errors that the acquisition system adds to those of a sensor."""


class ErrorSource(msgspec.Struct, frozen=True):
    """One source of uncertainty, the same over a whole run: zero [SI unit of the channel] or gain
    [1] of what is read, or lag [s].

    `u` is its standard uncertainty; `limit` the half width of a rectangular distribution, None for
    a normal one; `basis` what the rig file states it by.
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

    Each of the two is that of a calibration in place where the rig file states one (`u_zero`,
    `u_gain`), which contains the acquisition system; else what the accuracies of the sensor and of
    its acquisition system allow, as limits or with a coverage factor as expanded uncertainties. A
    share of the full scale limits the error at any reading, so it is a zero error and does not
    shrink at small readings; a share of the reading is a gain error. Where the zero alone is
    calibrated, a share of the full scale limits the gain.

    >>> from winchcascade.core.rig_file import Sensor
    >>> [(s.part, s.limit) for s in error_sources("force", Sensor("N", high=20000.0, accuracy_full_scale=0.002))]
    [('zero', 40.0)]
    >>> [(s.part, s.u) for s in error_sources("vdc", Sensor("V", accuracy_reading=0.004, coverage=2.0, u_zero=0.1))]
    [('zero', 0.1), ('gain', 0.002)]
    """
    full_scale = sensor.full_scale
    absolute = (sensor.accuracy or 0.0) + (sensor.accuracy_full_scale or 0.0) * full_scale
    stated = [  # absolute, of the reading, coverage factor, origin
        (absolute, sensor.accuracy_reading or 0.0, sensor.coverage, sensor.source),
        (
            (sensor.daq_full_scale or 0.0) * full_scale,
            sensor.daq_reading or 0.0,
            sensor.daq_coverage,
            ACQUISITION,
        ),
    ]
    found = []
    parts: tuple[tuple[Part, float | None], ...] = (
        ("zero", sensor.u_zero),
        ("gain", sensor.u_gain),
    )
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


@lru_cache(maxsize=64)
def part_uncertainty(sensor: Sensor | None, part: Part) -> float:
    """Standard uncertainty of zero [SI unit of the channel] or gain [1] of a sensor with its
    acquisition system, in squares.

    >>> from winchcascade.core.rig_file import Sensor
    >>> part_uncertainty(Sensor("N", accuracy=30.0, u_zero=2.0), "zero"), part_uncertainty(None, "zero")
    (2.0, 0.0)
    """
    return (
        0.0
        if sensor is None
        else math.hypot(*(s.u for s in error_sources("", sensor) if s.part == part))
    )


def open_circuit_current(rig: Rig, voltage: float) -> float:
    """Maximum DC current that bleed resistance and zero of the sensor account for at a voltage [V].
    [A]

    >>> from winchcascade.core.rig_toml import built_in
    >>> round(open_circuit_current(built_in(), 300.0), 3)
    0.162
    """
    bleed = rig.dc_link.r_bleed
    resistance = bleed.value if bleed is not None and bleed.value > 0.0 else BLEED
    return LEAKAGE * voltage / resistance + CERTAIN * part_uncertainty(
        rig.sensors.get("idc"), "zero"
    )


class Interval(NamedTuple):
    """Ends of a 95 % interval, in the unit of the value."""

    low: float
    high: float


class Scatter(msgspec.Struct, frozen=True):
    """A part of type A: its standard uncertainty and degrees of freedom."""

    u: float
    freedom: float


def interval_95(value: float, u: float, freedom: float = math.inf) -> Interval:
    """The 95 % interval of a value with a standard uncertainty, of so many degrees of freedom (GUM
    G.4).

    >>> round(interval_95(10.0, 1.0, 2.0).high, 3)
    14.303
    """
    half = student(freedom) * u
    return Interval(value - half, value + half)


def effective_freedom(scatters: Sequence[Scatter], combined: float) -> float:
    """Effective degrees of freedom of a combined standard uncertainty (Welch and Satterthwaite, GUM
    G.2b); parts of type B have infinitely many, so inf where no scatter counts.

    >>> round(effective_freedom([Scatter(1.0, 2.0), Scatter(1.0, 2.0)], 2.0**0.5), 6)
    4.0
    """
    spread = sum(part.u**4 / part.freedom for part in scatters)
    return combined**4 / spread if spread > 1e-12 * combined**4 else math.inf


NORMAL = 1.959963984540054
"""Half width of the 95 % interval of the normal distribution. [standard deviations]"""

EXPANDED = 30.0
"""Degrees of freedom from which an expansion gives Student's quantile to 1e-8; below, its
integral is inverted.
"""

ANGLES = 4097
"""Number of angles at which that integral is tabulated: the quantile is then known to 1e-6."""


@lru_cache(maxsize=256)
def student(freedom: float) -> float:
    """Half width of the 95 % interval of Student's distribution. [standard deviations]

    With many degrees of freedom by Abramowitz and Stegun 26.7.5. Otherwise it is sqrt(freedom)
    times the tangent of an angle of the density cos(angle)^(freedom - 1). scipy would take longer
    to import than a log to reduce.

    >>> round(student(2.0), 4), round(student(math.inf), 4)
    (4.3027, 1.96)
    """
    if freedom >= EXPANDED:
        z, n = NORMAL, freedom
        terms = (
            (z**3 + z) / 4.0,
            (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0,
            (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0,
            (79.0 * z**9 + 776.0 * z**7 + 1482.0 * z**5 - 1920.0 * z**3 - 945.0 * z) / 92160.0,
        )
        return z + sum(term / n**k for k, term in enumerate(terms, 1))
    import numpy as np  # which a help does not wait for

    left, angle, log_cosine = _angles()
    density = np.exp((freedom - 1.0) * log_cosine) * left
    within = np.cumsum(density)
    within -= 0.5 * (density + density[0])  # trapezoids from the first angle on
    return math.sqrt(freedom) * math.tan(float(np.interp(0.95 * within[-1], within, angle)))


@cache
def _angles() -> tuple[Signal, Signal, Signal]:
    """Even steps from 1 to 0, the angles from 0 to pi / 2 that they are mapped to, closer together
    where the tangent is steep, and logarithms of their cosines."""
    import numpy as np

    left = np.linspace(1.0, 0.0, ANGLES)
    angle = math.pi / 2.0 * (1.0 - left**2)
    return left, angle, np.log(np.cos(angle))
