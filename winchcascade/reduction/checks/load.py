"""Whether Vdc and Idc agree with the stated load: on the plateau their ratio is the load, unless
Idc was computed from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from winchcascade.core.accuracy import CERTAIN, error_sources, open_circuit_current
from winchcascade.core.integrate import median, median_and_error, smallest_step
from winchcascade.core.run import Mask
from winchcascade.reduction.checks.at_rest import waits_of
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, Fault, PhasedLog
from winchcascade.reduction.reduction_result import MeasuredLoad

MISMATCH = 0.10
"""Smallest deviation of a load that is reported where the accuracy of Vdc or Idc is unknown. [1]"""

BELOW = 0.2
"""Share of the samples of Vdc at rest that must be negative: a rectifier gives none, so that
these are noise. [1]
"""

SAME_NOISE = 0.9
"""Correlation at rest from which the noise of Idc is that of Vdc: two sensors share some of it,
a computed column all. [1]
"""


def measured_load(log: PhasedLog) -> MeasuredLoad | None:
    """Vdc / Idc with its standard uncertainty; None without a current that is more than the zero
    of its sensor.
    """
    points = log.points
    v_dc, i_dc = points.mean
    flowing = (i_dc > log.zero_limit("idc")) & (v_dc > 0.0)
    if 2 * np.count_nonzero(flowing) <= flowing.size:
        return None
    (volt, u_v), (ampere, u_i) = (_level(log, name, flowing) for name in ("vdc", "idc"))
    ohm, scatter = volt / ampere, median_and_error(v_dc[flowing] / i_dc[flowing])[1]
    return MeasuredLoad(ohm, math.hypot(ohm * u_v / volt, ohm * u_i / ampere, scatter))


def _level(log: PhasedLog, name: str, chosen: Mask | slice) -> tuple[float, float]:
    """Median of Vdc or Idc over some points, with the standard uncertainty of gain, zero,
    resolution and noise; the scatter of the points is not part of it. [V or A]
    """
    row = ("vdc", "idc").index(name)
    level, errors = median(log.points.mean[row, chosen]), log.points.error[row, chosen]
    step, noise = (
        smallest_step(log.run.channels[name]) / math.sqrt(12.0),
        math.hypot(*errors) / errors.size,
    )
    return level, math.hypot(level * log.phased.u_gain(name), log.phased.u_zero(name), step, noise)


def other_load(log: PhasedLog) -> Iterator[Fault]:
    """A load that Vdc / Idc contradicts, also an open circuit that delivers power, and one that is
    not stated.

    Vdc deviates from Idc times the load by more than the uncertainties of the sensors and of the
    load allow. The bleed resistance may lie on either side of the sensor of Idc, which then reads
    more than the load takes; that counts where the log would show it. Where the accuracy of a
    sensor is unknown, the deviation must also exceed `MISMATCH`.
    """
    points, load, rig = log.points, log.run.load, log.rig
    if not points.spans:
        return
    v_dc, i_dc = points.mean
    (volt, u_v), (ampere, u_i) = (_level(log, name, slice(None)) for name in ("vdc", "idc"))
    idle, name = ampere <= open_circuit_current(rig, volt), ""
    if load is None:
        name = "load_not_stated" if idle and volt > log.zero_limit("vdc") else ""
    elif math.isinf(load):
        name = "" if idle else "loaded_open_circuit"
    else:
        link, level = rig.dc_link, max(abs(volt), abs(load * ampere), np.finfo(float).tiny)
        shares = (v_dc - load * i_dc) / np.maximum(
            np.maximum(np.abs(v_dc), np.abs(load * i_dc)), np.finfo(float).tiny
        )
        apart, scatter = median_and_error(shares)
        u = math.hypot(u_v / level, load * u_i / level, link.load_u, scatter)
        bleeds = link.r_bleed is not None and link.r_bleed.value > 0.0
        bled = (
            load / link.r_bleed.value * abs(volt) / level
            if link.r_bleed is not None and bleeds
            else 0.0
        )
        if apart < 0.0 and bled >= CERTAIN * u:
            apart = min(apart + bled, 0.0)
        known = all(
            (s := rig.sensors.get(c)) is not None and error_sources("", s) for c in ("vdc", "idc")
        )
        name = "other_load" if abs(apart) >= max(CERTAIN * u, 0.0 if known else MISMATCH) else ""
    if name:
        ohm = volt / ampere if ampere > 0.0 else math.inf
        yield Fault(
            name, None, points.spans, {"volt": volt, "ampere": ampere, "load": load, "ohm": ohm}
        )


def computed_current(log: PhasedLog) -> Iterator[Fault]:
    """An Idc that follows even the noise of Vdc at rest: it was computed from Vdc and an assumed
    load.
    """
    wait = waits_of(log).get("vdc", math.inf)
    spans = [(max(rest.begin, rest.last + wait), rest.end) for rest in log.rests]
    volt, ampere = log.samples("vdc", spans), log.samples("idc", spans)
    if not volt.size == ampere.size >= MIN_COMPARED or np.mean(volt < 0.0) < BELOW:
        return
    volt, ampere = np.diff(volt, 2), np.diff(ampere, 2)  # without what a slow motion gives both
    size = float(np.linalg.norm(volt) * np.linalg.norm(ampere))
    if size > 0.0 and float(volt @ ampere) >= SAME_NOISE * size:
        yield Fault(
            "computed_current",
            "idc",
            spans,
            {"ohm": float(volt @ volt) / float(volt @ ampere)},
            ampere.size,
        )
