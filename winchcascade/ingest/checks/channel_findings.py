"""Findings about the samples of one channel: their wording, and readings that the range of the sensor contradicts."""

from __future__ import annotations

import msgspec
import numpy as np

from winchcascade.core.channels import Channel
from winchcascade.core.integrate import ends_of, stretches_of
from winchcascade.core.quantity import find_unit
from winchcascade.core.rig_file import Sensor
from winchcascade.core.run import Finding, FindingKind, Index, Mask, Repair, Signal
from winchcascade.ingest.checks.stuck import repeats_of

MAY_HOLD = ("velocity", "speed")
"""Factors of a power whose largest value need not scatter: a line or a shaft may move at one speed."""

MIN_SATURATED = 20
"""Smallest number of samples that hold the largest value of a channel, as the sample before does, and show saturation."""

MOSTLY = 0.5
"""Share of the samples at the largest value that hold it as the sample before does: saturation comes in stretches. [1]"""

REPAIRED_IN_PART = "but for"
"""Words in the action on samples of which another finding repairs some."""

RARELY = 0.3
"""Chance that a sample repeats the one before, from which a channel is too coarse or too smooth to show saturation. [1]"""


def at(t: Signal, bad: Mask, kind: FindingKind, channel: str, what: str, *, removed: bool = False) -> Finding:
    """A finding about the samples of one channel where `bad` is set."""
    index = np.flatnonzero(bad)
    start, end = t[index[[0, -1]]].tolist()
    found = Finding(kind, f"{index.size} {channel} {what}", "reported and kept", channel, start, end, index.size)
    if not removed:
        return found
    spans = tuple((begin, last) for begin, last in t[stretches_of(bad) - (0, 1)].tolist())
    repair = Repair("bridged by straight lines", index.size, spans)
    return msgspec.structs.replace(found, action=repair.what, removed=index.size, repair=repair)


def text_of(channel: Channel, value: float, digits: int = 5) -> str:
    """Format a value of a channel, given in its SI unit, in the unit in which a log has it."""
    unit = find_unit(channel.unit)
    assert unit is not None
    return f"{(value - unit.offset) / unit.factor:.{digits}g}"


def limits_of(sensor: Sensor | None) -> tuple[float, float]:
    """Limits of a sensor, infinite where none is stated; its zero error may carry a reading below an end at zero."""
    low, high = (None, None) if sensor is None else (sensor.low, sensor.high)
    top = float("inf") if high is None else high
    if sensor is None or low is None:
        return float("-inf"), top
    return low - ((sensor.accuracy_full_scale or 0.0) * top if low == 0 and np.isfinite(top) else 0.0), top


def farthest(sensor: Sensor | None) -> float:
    """Magnitude beyond which a sensor measures nothing, whichever sign is the payout's; inf where none is stated."""
    low, high = limits_of(sensor)
    return max(abs(low) if np.isfinite(low) else high, abs(high))


def out_of_range(
    t: Signal, channel: Channel, x: Signal, wild: tuple[Index, Signal] | None, sign: float, sensor: Sensor
) -> list[Finding]:
    """Report values outside the range of the sensor; they are kept, as clipping or dropping them would hide what happened.

    Parameters
    ----------
    wild : samples that were taken out as spikes, and what was logged there
    sign : factor by which the sign of the channel was corrected
    """
    low, high = limits_of(sensor)
    spikes = 0
    if wild is not None:
        x = x.copy()
        logged = sign * wild[1]
        x[wild[0]] = logged
        spikes = int(np.count_nonzero((logged < low) | (logged > high)))
    bottom, top = ends_of(x)
    if bottom >= low and top <= high:
        return []
    limit, worst = (high, top) if top > high else (low, bottom)
    what = (
        f"samples lie outside the sensor's range, up to {text_of(channel, worst)} {channel.unit} where it ends at "
        f"{text_of(channel, limit)}"
    )
    found = at(t, (x < low) | (x > high), "out_of_range", channel.name, what)
    action = f"reported and kept, {REPAIRED_IN_PART} {spikes} bridged as spikes" if spikes else found.action
    return [msgspec.structs.replace(found, action=action)]


def saturated(t: Signal, channel: Channel, x: Signal) -> list[Finding]:
    """Report a channel that holds its largest value in stretches while it scatters elsewhere: its sensor or input is saturated.

    Parameters
    ----------
    x : (n,) values, NaN where it has holes, SI
    """
    low, high = ends_of(x)
    top = high if high >= -low else low
    held = x == top
    again = int(np.count_nonzero(held[1:] & held[:-1]))
    if top == 0.0 or again < MIN_SATURATED or again < MOSTLY * np.count_nonzero(held):
        return []
    change = np.diff(x)[~(held[1:] | held[:-1])]
    if repeats_of(change[np.isfinite(change)]) > RARELY:
        return []
    what = (
        f"samples hold its largest value, {text_of(channel, top)} {channel.unit}, without noise: the sensor or its "
        f"input is saturated"
    )
    return [at(t, held, "out_of_range", channel.name, what)]
