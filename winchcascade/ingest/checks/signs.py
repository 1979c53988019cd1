"""Which way is payout: channels logged with the opposite sign are found by physics, not by their first sample."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import ENOUGH, median
from winchcascade.core.run import Finding

if TYPE_CHECKING:
    from winchcascade.core.run import Mask, Signal


FAST = 0.3
"""Samples faster than this share of the top speed distinguish payout from haul-in."""

CLEAR = 1.2
"""A channel votes if it is this many times as large in one direction as in the other."""

CERTAIN = 4.0
"""A channel follows the velocity if noise would do so once in ten thousand logs: so many standard deviations."""

IDLE = {"force": 20.0, "torque": 2.0, "power_mech": 20.0, "vdc": 5.0, "idc": 0.03}
"""What a channel of the other sign must exceed to be called flipped: well above zeros and noise. [N, N m, W, V, A]"""

VACUUM = -1.05e5
"""No gauge pressure lies below it. [Pa]"""


def upright(channels: dict[str, Signal]) -> list[Finding]:
    """Turn channels that are logged with the opposite sign, in place of the old ones; the findings name them.

    Line force, torque and voltage are larger in payout, and the pressure rises with it: what most of them say decides the
    sign of the velocity. The displacement follows the velocity; forces, torques and powers are positive in payout.
    """
    findings: list[Finding] = []
    every = max(1, channels["velocity"].size // ENOUGH)
    some = {name: x[::every] for name, x in channels.items()}
    v = np.nan_to_num(some["velocity"])
    if "pressure" in some and _median(some["pressure"]) < VACUUM:
        some["pressure"] = -some["pressure"]
        findings.append(_flipped("pressure", "it lies below the vacuum"))
    if _paid_out_negative(some, v):
        v = -v
        findings.append(_flipped("velocity", "payout is logged as negative"))
    if "displacement" in some and _follows(some["displacement"], v) < 0:
        findings.append(_flipped("displacement", "it falls while the line pays out"))
    out = _fast(v)
    for name, least in IDLE.items():
        if name in some and _median(some[name][out]) < -least:
            findings.append(_flipped(name, "it is negative while the line pays out"))
    for finding in findings:
        assert finding.channel is not None
        channels[finding.channel] = -channels[finding.channel]
    return findings


def _flipped(channel: str, why: str) -> Finding:
    return Finding("sign_flipped", f"{channel} has the opposite sign: {why}", "sign turned", channel)


def _fast(v: Signal) -> Mask:
    """Samples that move outward at more than a share of the top speed in that direction."""
    return v > max(FAST * float(np.max(v, initial=0.0)), 1e-6)


def _paid_out_negative(some: Mapping[str, Signal], v: Signal) -> bool:
    """Whether the channels say that the line pays out where its velocity is negative.

    The line force votes only if both directions were logged; torque and voltage also by their absence.
    """
    up, down = _fast(v), _fast(-v)
    votes = 0
    for name in ("force", "torque", "vdc"):
        if name not in some or (name == "force" and not (up.any() and down.any())):
            continue
        large, small = (_median(np.abs(some[name][part])) for part in (up, down))
        if max(large, small) > IDLE[name]:
            votes += int(large > CLEAR * small) - int(small > CLEAR * large)
    if "pressure" in some:
        votes += _follows(some["pressure"], v)
    return votes < 0


def _follows(x: Signal, v: Signal) -> int:
    """Sign of how a channel changes with the velocity, 0 if that could be noise."""
    change = np.nan_to_num(np.diff(x))
    together = float(np.dot(change, v[1:]))
    by_chance = float(np.linalg.norm(change) * np.linalg.norm(v)) / np.sqrt(v.size)
    return int(np.sign(together)) if abs(together) > CERTAIN * by_chance else 0


def _median(x: Signal) -> float:
    """Median of what is finite; 0 where nothing is, as when the line never moves that way."""
    x = x[np.isfinite(x)]
    return median(x) if x.size else 0.0
