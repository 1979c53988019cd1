"""Waves of a reciprocating motion, from one upward zero crossing to the next."""

from __future__ import annotations

import numpy as np

from winchcascade.core.run import Index, Signal
from winchcascade.reduction.phases import Cycle, crossing


def find_waves(t: Signal, v_smooth: Signal, v_onset: float) -> list[Cycle]:
    """Find the waves of a motion: the payout is the positive half, the haul-in the negative one.

    Both halves go beyond `v_onset`; what lies between is noise or rest and belongs to no half of its own. A half that the
    begin of the log cuts, and one without an upward zero crossing at its end, are part of no wave.

    Parameters
    ----------
    t, v_smooth : (n,) stamps that rise [s], and a smoothed velocity or speed
    v_onset : threshold in the unit of the motion

    Examples
    --------
    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> [(round(w.onset, 6), round(w.payout_end, 6)) for w in find_waves(t, np.sin(np.pi * (t - 0.5)), 0.1)]
    [(0.5, 1.5), (2.5, 3.5), (4.5, 5.5), (6.5, 7.5)]
    """
    side = (v_smooth > v_onset).astype(np.int8) - (v_smooth < -v_onset).astype(np.int8)
    fast = np.flatnonzero(side)
    if fast.size == 0:
        return []
    turns = np.flatnonzero(np.diff(side[fast])) + 1
    first, last = fast[np.append(0, turns)], fast[np.append(turns - 1, fast.size - 1)]
    low, high = np.flatnonzero(v_smooth <= 0.0), np.flatnonzero(v_smooth >= 0.0)
    waves = []
    for k in range(first.size - 1):
        up, down = int(first[k]), int(first[k + 1])
        after = _next(high, int(last[k + 1]))
        before = _last(low, up)
        if side[up] < 0 or before is None or after is None:
            continue
        onset, end = crossing(t, v_smooth, before + 1, 0.0), crossing(t, v_smooth, after, 0.0)
        middle = crossing(t, v_smooth, (_last(high, down) or 0) + 1, 0.0)
        waves.append(Cycle(onset, middle, (middle, middle), (middle, end), begins_inside=False, ends_inside=False))
    return waves


def _last(rows: Index, before: int) -> int | None:
    """Last of some rows that lies before another one, None without one."""
    k = int(np.searchsorted(rows, before))
    return None if k == 0 else int(rows[k - 1])


def _next(rows: Index, after: int) -> int | None:
    """First of some rows that lies after another one, None without one."""
    k = int(np.searchsorted(rows, after, side="right"))
    return None if k == rows.size else int(rows[k])
