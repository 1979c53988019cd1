"""The windows of a run's cycles: each by the rule, and told apart from those that no cycle should have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.errors import OptionError
from winchcascade.order import median
from winchcascade.phases.window import Plateau, Window, find_window
from winchcascade.run import Finding

if TYPE_CHECKING:
    from winchcascade.phases.detect import Cycle
    from winchcascade.rigfile import Rig, WindowRule
    from winchcascade.run import Run

SHORTEST = 2.0
"""Sampling intervals that a window must last: its ends are interpolated, and fewer samples would be nothing but ends."""


def find_windows(
    run: Run,
    cycles: Sequence[Cycle],
    plateaus: Sequence[Plateau | None],
    payouts: Sequence[tuple[float, float]],
    rule: WindowRule,
    rig: Rig,
) -> list[Window]:
    """Windows by the rule; where payouts should be alike, one that was aborted is told from the others.

    `payouts` holds the travel [m] and the top speed [m/s] of each cycle's payout.
    """
    end = float(run.t[-1])
    windows = [
        find_window(c, p, top, end, rule, rig.thresholds)
        for c, p, (_, top) in zip(cycles, plateaus, payouts, strict=True)
    ]
    windows = [_unless_short(w, run.fs) for w in windows]
    if rule == "payout":
        return windows
    windows = _apart(windows)
    usual = _usual_travel(cycles, payouts)
    slack = _detection_slack(run, rig)
    return [
        _unless_aborted(c, w, travel, usual, slack, rig)
        for c, w, (travel, _) in zip(cycles, windows, payouts, strict=True)
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


def check_lengths(
    run: Run,
    cycles: Sequence[Cycle],
    windows: Sequence[Window],
    payouts: Sequence[tuple[float, float]],
    rule: WindowRule,
    rig: Rig,
) -> list[Finding]:
    """Report payouts that end before a window of fixed length does.

    Raises
    ------
    OptionError : that is so for more than half of the payouts that are seen whole and not aborted
    """
    if not isinstance(rule, float):
        return []
    least = rig.thresholds.aborted_below * _usual_travel(cycles, payouts)
    whole = [
        (c.payout_end - c.onset, w.cutoff - c.payout_end, w)
        for c, w, (travel, _) in zip(cycles, windows, payouts, strict=True)
        if not c.begins_inside and not c.ends_inside and travel >= least
    ]
    late = [(beyond, w) for _, beyond, w in whole if beyond > _detection_slack(run, rig)]
    if not late:
        return []
    lengths, most = [length for length, _, _ in whole], max(beyond for beyond, _ in late)
    found = f"{len(late)} of {len(whole)} payouts end before their window of {rule:g} s does, by up to {most:.2f} s"
    fits = math.floor(100.0 * min(lengths)) / 100.0
    if 2 * len(late) > len(whole):
        raise OptionError(
            f"{run.name}: {found}, so that it holds hold or haul-in; the payouts last {min(lengths):.2f} to "
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


def _usual_travel(cycles: Sequence[Cycle], payouts: Sequence[tuple[float, float]]) -> float:
    """Median travel of the payouts whose onset the log holds; 0 without any. [m]"""
    whole = [travel for c, (travel, _) in zip(cycles, payouts, strict=True) if not c.begins_inside]
    return median(np.array(whole)) if whole else 0.0


def _detection_slack(run: Run, rig: Rig) -> float:
    """By how much the end of a payout may be found too early: half the smoothing, or one sample of a slower log. [s]"""
    return max(0.5 * rig.thresholds.smoothing, 1.0 / run.fs)


def _apart(windows: Sequence[Window]) -> list[Window]:
    """A window that reaches into the next payout is no window of one cycle."""
    following = [*(w.onset for w in windows[1:]), math.inf][: len(windows)]
    return [
        Window(w.onset, w.cutoff, w.fault or "its window reaches into the next payout") if w.cutoff > after else w
        for w, after in zip(windows, following, strict=True)
    ]


def _unless_aborted(cycle: Cycle, window: Window, travel: float, usual: float, slack: float, rig: Rig) -> Window:
    if window.fault is not None or cycle.ends_inside:
        return window
    fault = None
    if travel < rig.thresholds.aborted_below * usual:
        fault = f"the payout is aborted after {travel:.2f} m, where others travel {usual:.2f} m"
    elif window.cutoff > cycle.payout_end + slack:
        fault = f"the payout ends {window.cutoff - cycle.payout_end:.2f} s before its window does"
    return Window(window.onset, window.cutoff, fault)
