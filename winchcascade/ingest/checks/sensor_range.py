"""What a sensor's range says of its readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.ingest.checks.channel_findings import at, usual_unit
from winchcascade.ingest.checks.stuck import repeats_of

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Sensor
    from winchcascade.core.run import Finding, Index, Signal


SATURATES = ("force", "torque", "power_mech", "vdc", "idc")
"""Channels whose largest value must scatter; a line may move at one speed, and rest at one place."""

FEWEST = 20
"""Samples that hold the largest value of a channel as the sample before does; fewer are no saturation."""

MOSTLY = 0.5
"""Share of the samples at the largest value that hold it as the sample before does: saturation comes in stretches. [1]"""

RARELY = 0.3
"""Chance that a sample repeats the one before, from which a channel is too coarse or too smooth to show saturation. [1]"""


def limits_of(sensor: Sensor) -> tuple[float, float]:
    """Limits of a sensor; its zero error may carry a reading below an end at zero."""
    high = float("inf") if sensor.high is None else sensor.high
    if sensor.low is None:
        return float("-inf"), high
    zero = (sensor.accuracy_full_scale or 0.0) * high if sensor.low == 0 and np.isfinite(high) else 0.0
    return sensor.low - zero, high


def farthest(sensor: Sensor | None) -> float:
    """Magnitude beyond which a sensor measures nothing, whichever sign is the payout's; inf where none is stated."""
    if sensor is None:
        return float("inf")
    low, high = limits_of(sensor)
    return max(abs(low) if np.isfinite(low) else high, abs(high))


def out_of_range(
    t: Signal, name: str, x: Signal, wild: tuple[Index, Signal] | None, sign: float, sensor: Sensor
) -> list[Finding]:
    """Values outside the sensor's range are reported and kept: clipping or dropping them would hide what happened."""
    low, high = limits_of(sensor)
    if wild is not None:
        x = x.copy()
        x[wild[0]] = sign * wild[1]
    top, bottom = float(np.nanmax(x)), float(np.nanmin(x))
    if bottom >= low and top <= high:
        return []
    limit, worst = (high, top) if top > high else (low, bottom)
    unit, factor = usual_unit(name)
    what = f"samples lie outside the sensor's range, up to {worst / factor:.5g} {unit} where it ends at {limit / factor:.5g}"
    found = at(t, (x < low) | (x > high), "out_of_range", name, what)
    spikes = 0 if wild is None else int(np.count_nonzero((x[wild[0]] < low) | (x[wild[0]] > high)))
    if spikes:
        found = msgspec.structs.replace(found, action=f"reported and kept, but for {spikes} bridged as spikes")
    return [found]


def saturated(t: Signal, name: str, x: Signal) -> list[Finding]:
    """Report a channel that holds its largest value in stretches while it scatters elsewhere: its sensor or input is saturated.

    Parameters
    ----------
    x : (n,) values, NaN where it has holes, SI
    """
    low, high = float(np.nanmin(x)), float(np.nanmax(x))
    top = high if high >= -low else low
    held = x == top
    again = int(np.count_nonzero(held[1:] & held[:-1]))
    if top == 0.0 or again < FEWEST or again < MOSTLY * np.count_nonzero(held):
        return []
    change = np.diff(x)[~(held[1:] | held[:-1])]
    if repeats_of(change[np.isfinite(change)]) > RARELY:
        return []
    unit, factor = usual_unit(name)
    what = f"samples hold its largest value, {top / factor:.5g} {unit}, without noise: the sensor or its input is saturated"
    return [at(t, held, "out_of_range", name, what)]
