"""Plateau, braking and the integration window of one payout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.order import median, quantile
from winchcascade.phases.detect import crossing

if TYPE_CHECKING:
    from winchcascade.phases.detect import Cycle
    from winchcascade.rigfile import Thresholds, WindowRule
    from winchcascade.run import Signal

STEADY = 1.03
"""A payout cut by the log's end has reached its plateau if its top speed exceeds the plateau's by no more than this."""


class Plateau(msgspec.Struct, frozen=True):
    """The quasi-steady part of a payout: speed [m/s], its beginning and the start of braking [s]."""

    speed: float
    begin: float
    braking: float


class Window(msgspec.Struct, frozen=True):
    """Integration window of one payout [s], and why it does not lie whole in the payout, where it does not."""

    onset: float
    cutoff: float
    fault: str | None = None


def find_plateau(t: Signal, v_smooth: Signal, cycle: Cycle, thresholds: Thresholds) -> Plateau | None:
    """Find the plateau of a payout: None where the speed never stays near its top for `plateau_hold`.

    The plateau's speed is the median of the velocities above 90 % of their 99th percentile. It begins with the first
    0.2 s throughout which the velocity is at or above 98 % of that; braking begins after the last sample that is.
    """
    first = int(np.searchsorted(t, cycle.onset, side="left"))
    last = int(np.searchsorted(t, cycle.payout_end, side="right"))
    v = v_smooth[first:last]
    if v.size < 3:
        return None
    top = quantile(v, thresholds.plateau_quantile)
    if not top > 0.0:  # a payout that nothing but a gap tells of
        return None
    speed = median(v[v >= thresholds.plateau_band * top])
    level = thresholds.plateau_level * speed
    high = np.zeros(v.size + 2, dtype=bool)
    high[1:-1] = v >= level
    edges = np.flatnonzero(high[1:] != high[:-1]) + first
    stretches = [
        (
            crossing(t, v_smooth, int(a), level) if a > first else float(t[a]),
            _stretch_end(t, v_smooth, int(b), level, last),
        )
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    begin = next((a for a, b in stretches if b - a >= thresholds.plateau_hold), None)
    return None if begin is None else Plateau(speed, begin, stretches[-1][1])


def _stretch_end(t: Signal, v: Signal, k: int, level: float, last: int) -> float:
    """Instant at which v falls below the level before sample k; the payout's end where it does not fall. [s]"""
    return crossing(t, v, k, level) if k < last else float(t[min(k, t.size) - 1])


def find_window(
    cycle: Cycle, plateau: Plateau | None, top_speed: float, log_end: float, rule: WindowRule, thresholds: Thresholds
) -> Window:
    """Set the integration window of a payout by the rule (Sec. 3.2).

    Parameters
    ----------
    top_speed : largest smoothed velocity of the payout [m/s]
    log_end : last stamp [s]
    rule : "auto" ends `settle` after the plateau begins, never past braking; "payout" with the payout; a number that
        many seconds after the onset
    """
    if cycle.begins_inside:
        return Window(cycle.onset, cycle.payout_end, "the log begins inside the payout, so its onset is unknown")
    if rule == "payout":
        fault = "the log ends inside the payout" if cycle.ends_inside else None
        return Window(cycle.onset, cycle.payout_end, fault)
    if rule == "auto":
        return _auto(cycle, plateau, top_speed, thresholds)
    cutoff = cycle.onset + float(rule)
    if cutoff > log_end:
        return Window(cycle.onset, log_end, f"the log ends {cutoff - log_end:.2f} s before the window does")
    return Window(cycle.onset, cutoff)


def _auto(cycle: Cycle, plateau: Plateau | None, top_speed: float, thresholds: Thresholds) -> Window:
    if plateau is None:
        return Window(cycle.onset, cycle.payout_end, "the payout never holds a plateau speed")
    cutoff = min(plateau.begin + thresholds.settle, plateau.braking)
    if cycle.ends_inside and (
        plateau.begin + thresholds.settle > cycle.payout_end or top_speed > STEADY * plateau.speed
    ):
        return Window(cycle.onset, cutoff, "the log ends before the payout has settled on its plateau")
    return Window(cycle.onset, cutoff)
