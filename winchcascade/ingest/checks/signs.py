"""Signs: payout is positive, whatever a log was written with; physics decides, not the first sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from winchcascade.core.integrate import ENOUGH, ends_of, median
from winchcascade.core.run import Finding, Mask, Repair, Signal
from winchcascade.ingest.checks.agreement import MIN_BLOCKS, MOVING, mean_speeds
from winchcascade.ingest.checks.samples import Samples, slope

FAST = 0.3
"""Samples faster than this share of the top speed distinguish payout from haul-in. [1]"""

LARGER = 1.2
"""A channel votes if it is this many times as large in one direction as in the other. [1]"""

IDLE = {"force": 20.0, "torque": 2.0, "power_mech": 20.0, "vdc": 5.0, "idc": 0.03, "speed": 0.5}
"""What a channel of the other sign must exceed to be called flipped: well above zeros and noise. [N, N m, W, V, A, rad/s]"""

VACUUM = -1.05e5
"""No gauge pressure lies below it. [Pa]"""

ONE_SIDED = 0.1
"""A velocity is without a sign if it goes no farther than this share of its top to the other side of zero. [1]"""

FOLLOWS = 0.2
"""A speed without a sign agrees with that of the displacement within this share, in four of five blocks. [1]"""


def opposite_signs(channels: Mapping[str, Signal]) -> dict[str, str]:
    """Channels that are logged with the opposite sign, each with the reason.

    Line tension, torque and voltage are larger in payout, and the pressure rises with it: the majority of them decides the
    sign of the velocity. The displacement follows the velocity; forces, torques and powers are positive in payout.
    """
    if "velocity" not in channels:
        return {}
    flipped: dict[str, str] = {}
    some = {name: np.nan_to_num(x[:: max(1, x.size // ENOUGH)]) for name, x in channels.items()}
    v = some["velocity"]
    if "pressure" in some and median(some["pressure"]) < VACUUM:
        some["pressure"] = -some["pressure"]
        flipped["pressure"] = "it lies below the vacuum"
    if _payout_is_negative(some, v):
        v = -v
        flipped["velocity"] = "payout is logged as negative"
    if "displacement" in some and _follows(some["displacement"], v) < 0:
        flipped["displacement"] = "it falls while the line pays out"
    out = _fast(v)
    for name, minimum in IDLE.items():
        if name in some and out.any() and median(some[name][out]) < -minimum:
            flipped[name] = "it is negative while the line pays out"
    return flipped


def _fast(v: Signal) -> Mask:
    """Samples that move outward at more than a share of the top speed in that direction."""
    return v > max(FAST * float(np.max(v, initial=0.0)), 1e-6)


def _payout_is_negative(some: Mapping[str, Signal], v: Signal) -> bool:
    """Whether most channels show that the line pays out where its velocity is negative.

    The line tension votes only if both directions were logged; torque and voltage also by their absence.
    """
    up, down = _fast(v), _fast(-v)
    votes = 0
    for name in ("force", "torque", "vdc"):
        if name not in some or (name == "force" and not (up.any() and down.any())):
            continue
        large, small = (median(np.abs(some[name][part])) if part.any() else 0.0 for part in (up, down))
        if max(large, small) > IDLE[name]:
            votes += int(large > LARGER * small) - int(small > LARGER * large)
    if "pressure" in some:
        votes += _follows(some["pressure"], v)
    return votes < 0


def _follows(x: Signal, v: Signal) -> int:
    """Sign of how a channel changes with the velocity, 0 if that could be noise: less than four standard deviations."""
    change = np.diff(x)
    together = float(np.dot(change, v[1:]))
    by_chance = float(np.linalg.norm(change) * np.linalg.norm(v)) / np.sqrt(v.size)
    return int(np.sign(together)) if abs(together) > 4.0 * by_chance else 0


def give_direction(log: Samples) -> bool:
    """Give a speed that has no sign the direction of the displacement; whether it had none."""
    thresholds, v = log.rig.thresholds, log.channels["velocity"]
    turned = is_without_sign(log, thresholds.v_onset, thresholds.stroke_min)
    if turned:
        log.channels["velocity"] = directed(log)
        message = "velocity has one sign whichever way the displacement goes: it is a speed without direction"
        repair = Repair("given the direction of the displacement", v.size)
        log.findings.append(Finding("sign_flipped", message, repair.what, "velocity", repair=repair))
    return turned


def directed(log: Samples) -> Signal:
    """The speed with the direction of the displacement. [m/s]"""
    v = log.channels["velocity"]
    return np.where(slope(log.t, log.channels["displacement"]) < 0, -np.abs(v), np.abs(v))


def is_without_sign(log: Samples, v_onset: float, stroke_min: float) -> bool:
    """Whether the velocity is a speed: of one sign, however the displacement goes, and as fast both ways."""
    low, high = ends_of(log.channels["velocity"])
    if low < 0.0 < high and min(-low, high) > ONE_SIDED * max(-low, high):
        return False
    blocks = mean_speeds(log, v_onset)
    speed = np.abs(blocks.by_displacement)
    fast = speed > MOVING * v_onset
    slow = np.abs(blocks.v[speed < v_onset])
    if np.count_nonzero(fast) < 2 * MIN_BLOCKS or (slow.size and median(slow) > MOVING * v_onset):
        return False
    ratio = np.abs(blocks.v[fast]) / speed[fast]
    alike = np.abs(ratio - median(ratio)) < FOLLOWS * ratio
    if np.count_nonzero(alike) < (1.0 - FOLLOWS) * alike.size:
        return False
    travel = (blocks.seconds * blocks.by_displacement * np.sign(blocks.v))[fast][alike]
    with_it, against = float(travel[travel > 0].sum()), -float(travel[travel < 0].sum())
    return min(with_it, against) > max(stroke_min, ONE_SIDED * max(with_it, against))
