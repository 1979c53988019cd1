"""The integration windows of the payouts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import median
from winchcascade.core.run import Finding

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Thresholds, WindowRule
    from winchcascade.reduction.phased_run import PhasedRun
    from winchcascade.reduction.phases import Cycle, Plateau


STEADY = 1.03
"""A payout cut by the log's end has reached its plateau if its top speed exceeds the plateau's by no more than this."""


class Window(msgspec.Struct, frozen=True):
    """Integration window of one payout [s], and why it does not lie whole in the payout, where it does not."""

    onset: float
    cutoff: float
    fault: str | None = None


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


SHORTEST = 2.0
"""Sampling intervals that a window must last: its ends are interpolated, and fewer samples would be nothing but ends."""


def find_windows(phased: PhasedRun) -> list[Window]:
    """Windows by the rule; where payouts should be alike, one that was aborted is distinguished from the others."""
    end = float(phased.run.t[-1])
    windows = [
        _unless_short(find_window(c, p, top, end, phased.rule, phased.rig.thresholds), phased.run.fs)
        for c, p, top in zip(phased.cycles, phased.plateaus, phased.speed_max, strict=True)
    ]
    if phased.rule == "payout":
        return windows
    usual = _usual_travel(phased)
    return [
        _unless_aborted(phased, c, w, travel, usual)
        for c, w, travel in zip(phased.cycles, _apart(windows), phased.travel, strict=True)
    ]


def _unless_short(window: Window, fs: float) -> Window:
    """A window shorter than `SHORTEST` sampling intervals holds no course of a power."""
    length = window.cutoff - window.onset
    if window.fault is not None or length * fs >= SHORTEST:
        return window
    return Window(
        window.onset,
        window.cutoff,
        f"its window of {length:.3g} s is shorter than two samples, which are {1.0 / fs:.3g} s apart",
    )


def check_lengths(phased: PhasedRun, windows: Sequence[Window]) -> list[Finding]:
    """Report payouts that end before a window of fixed length does.

    Raises
    ------
    OptionError : that is so for more than half of the payouts that are seen whole and not aborted
    """
    if not isinstance(phased.rule, float):
        return []
    least = phased.rig.thresholds.aborted_below * _usual_travel(phased)
    whole = [
        (c.payout_end - c.onset, w.cutoff - c.payout_end, w)
        for c, w, travel in zip(phased.cycles, windows, phased.travel, strict=True)
        if not c.begins_inside and not c.ends_inside and travel >= least
    ]
    late = [(beyond, w) for _, beyond, w in whole if beyond > _detection_slack(phased)]
    if not late:
        return []
    lengths, most = [length for length, _, _ in whole], max(beyond for beyond, _ in late)
    found = (
        f"{len(late)} of {len(whole)} payouts end before their window of {phased.rule:g} s does, by up to {most:.2f} s"
    )
    fits = math.floor(100.0 * min(lengths)) / 100.0
    if 2 * len(late) > len(whole):
        raise OptionError(
            f"{phased.run.name}: {found}, so that it holds hold or haul-in; the payouts last {min(lengths):.2f} to "
            f"{max(lengths):.2f} s. Give a window of at most {fits:.2f} s, or the rule auto or payout."
        )
    return [
        Finding(
            "window_beyond_payout",
            f"{found}; a window of {fits:.2f} s fits into all of them",
            "those cycles are left out of the mean",
            start=late[0][1].onset,
            end=late[-1][1].cutoff,
            count=len(late),
        )
    ]


def _usual_travel(phased: PhasedRun) -> float:
    """Median travel of the payouts whose onset the log holds; 0 without any. [m]"""
    whole = [travel for c, travel in zip(phased.cycles, phased.travel, strict=True) if not c.begins_inside]
    return median(np.array(whole)) if whole else 0.0


def _detection_slack(phased: PhasedRun) -> float:
    """By how much the end of a payout may be found too early: half the smoothing, or one sample of a slower log. [s]"""
    return max(0.5 * phased.rig.thresholds.smoothing, 1.0 / phased.run.fs)


def _apart(windows: Sequence[Window]) -> list[Window]:
    """A window that reaches into the next payout is no window of one cycle."""
    following = [*(w.onset for w in windows[1:]), math.inf][: len(windows)]
    return [
        Window(w.onset, w.cutoff, w.fault or "its window reaches into the next payout") if w.cutoff > after else w
        for w, after in zip(windows, following, strict=True)
    ]


def _unless_aborted(phased: PhasedRun, cycle: Cycle, window: Window, travel: float, usual: float) -> Window:
    if window.fault is not None or cycle.ends_inside:
        return window
    fault = None
    if travel < phased.rig.thresholds.aborted_below * usual:
        fault = f"the payout is aborted after {travel:.2f} m, where others travel {usual:.2f} m"
    elif window.cutoff > cycle.payout_end + _detection_slack(phased):
        fault = f"the payout ends {window.cutoff - cycle.payout_end:.2f} s before its window does"
    return Window(window.onset, window.cutoff, fault)
