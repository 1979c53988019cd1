"""The windows of a run's cycles: each by the rule, and told apart from those that no cycle should have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.order import median
from winchcascade.phases.window import Plateau, Window, find_window

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
    whole = [travel for c, (travel, _) in zip(cycles, payouts, strict=True) if not c.begins_inside]
    usual = median(np.array(whole)) if whole else 0.0
    late = [w.cutoff > c.payout_end for c, w in zip(cycles, windows, strict=True) if not c.ends_inside]
    all_late = sum(late) > 0.5 * len(late)
    return [
        _unless_aborted(c, w, travel, usual, all_late, rig)
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


def _apart(windows: Sequence[Window]) -> list[Window]:
    """A window that reaches into the next payout is no window of one cycle."""
    following = [*(w.onset for w in windows[1:]), math.inf][: len(windows)]
    return [
        Window(w.onset, w.cutoff, w.fault or "its window reaches into the next payout") if w.cutoff > after else w
        for w, after in zip(windows, following, strict=True)
    ]


def _unless_aborted(cycle: Cycle, window: Window, travel: float, usual: float, all_late: bool, rig: Rig) -> Window:
    if window.fault is not None or cycle.ends_inside:
        return window
    fault = None
    if travel < rig.thresholds.aborted_below * usual:
        fault = f"the payout is aborted after {travel:.2f} m, where others travel {usual:.2f} m"
    elif window.cutoff > cycle.payout_end and not all_late:
        fault = f"the payout ends {window.cutoff - cycle.payout_end:.2f} s before its window does"
    return Window(window.onset, window.cutoff, fault)
