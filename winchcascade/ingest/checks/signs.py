"""Signs: payout is positive, whatever a log was written with; physics decides, not the first
sample.

Relations between channels need payouts, and what a payout is depends on the sign of the velocity.
Signs are therefore found before, from the whole log: by what is larger in one direction, and by
what follows it.
"""

from __future__ import annotations

import numpy as np

from winchcascade.core.accuracy import CERTAIN, part_uncertainty
from winchcascade.core.integrate import ENOUGH, median
from winchcascade.core.run import Finding, Mask, Repair, Signal
from winchcascade.ingest.checks.samples import Samples

DRIVEN = 0.3
"""The line moves fast above this share of its top speed in one direction. [1]"""

LARGER = 1.2
"""A channel votes if it is this many times as large in one direction as in the other. [1]"""

POSITIVE = ("force", "torque", "power_mech", "vdc", "idc", "speed")
"""Channels that are positive in payout."""

ABOVE_NOISE = 2.0
"""Standard deviations of its noise that the median of a channel must exceed to show its sign:
hundreds of samples count. [1]
"""

VACUUM = -1.05e5
"""No gauge pressure lies below it. [Pa]"""


def correct_signs(log: Samples) -> dict[str, float]:
    """Correct the sign of channels that are logged with the opposite one, and report them; -1
    for each.
    """
    flipped = opposite_signs(log)
    for name, why in flipped.items():
        log.channels[name] = -log.channels[name]
        repair = Repair("sign corrected", log.t.size)
        what = f"{name} has the opposite sign: {why}"
        log.findings.append(Finding("sign_flipped", what, "sign corrected", name, repair=repair))
    return dict.fromkeys(flipped, -1.0)


def opposite_signs(log: Samples) -> dict[str, str]:
    """Channels that are logged with the opposite sign, each with the reason.

    Line tension, torque and voltage are larger in payout, and the pressure rises with it: the
    majority of them decides the sign of the velocity. The displacement follows the velocity;
    forces, torques and powers are positive in payout.
    """
    channels = log.channels
    if "velocity" not in channels:
        return {}
    flipped: dict[str, str] = {}
    some = {name: x[:: max(1, x.size // ENOUGH)] for name, x in channels.items()}
    some = {name: x if np.isfinite(x.sum()) else np.nan_to_num(x) for name, x in some.items()}
    v = some["velocity"]
    if "pressure" in some and median(some["pressure"]) < VACUUM:
        some["pressure"] = -some["pressure"]
        flipped["pressure"] = "it lies below the vacuum"
    votes = _follows(some["pressure"], v) if "pressure" in some else 0
    ways = _fast(v), _fast(-v)
    for name in ("force", "torque", "vdc"):
        if name in some and (
            name != "force" or all(way.any() for way in ways)
        ):  # idle, it is not without tension
            out, back = (median(np.abs(some[name][way])) if way.any() else 0.0 for way in ways)
            if max(out, back) > _idle(log, name):
                votes += int(out > LARGER * back) - int(back > LARGER * out)
    if votes < 0:
        v = -v
        flipped["velocity"] = "payout is logged as negative"
    if "displacement" in some and _follows(some["displacement"], v) < 0:
        flipped["displacement"] = "it falls while the line pays out"
    paid_out = _fast(v)
    for name in POSITIVE:
        if name in some and paid_out.any() and median(some[name][paid_out]) < -_idle(log, name):
            flipped[name] = "it is negative while the line pays out"
    return flipped


def _idle(log: Samples, name: str) -> float:
    """What a channel must exceed to show its sign: zero and noise of its sensor; infinite for one
    of noise alone about a zero that is not stated. [SI unit of the channel]
    """
    level, zero = log.level(name), CERTAIN * part_uncertainty(log.rig.sensors.get(name), "zero")
    drives = log.rig.thresholds.tau_engaged if name == "torque" else 0.0
    return max(drives, zero, ABOVE_NOISE * level.noise) if zero or level.moves else np.inf


def _fast(v: Signal) -> Mask:
    """Samples that move outward at more than a share of the top speed in that direction."""
    return v > DRIVEN * float(np.max(v, initial=0.0))


def _follows(x: Signal, v: Signal) -> int:
    """Sign of how a channel changes with the velocity, 0 if that could be noise: less than four
    standard deviations.
    """
    change = np.diff(x)
    together = float(np.dot(change, v[1:]))
    by_chance = float(np.linalg.norm(change) * np.linalg.norm(v)) / np.sqrt(v.size)
    return int(np.sign(together)) if abs(together) > 4.0 * by_chance else 0
