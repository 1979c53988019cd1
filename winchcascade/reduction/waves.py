"""Waves of a reciprocating motion, from one upward zero crossing to the next."""

from __future__ import annotations

import numpy as np

from winchcascade.core.run import Index, Mask, Signal
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
    edges = np.concatenate(([0], np.flatnonzero(side[1:] != side[:-1]) + 1, [side.size]))
    start, stop = edges[:-1], edges[1:]
    fast = side[start] != 0
    start, stop = start[fast], stop[fast]
    if start.size == 0:
        return []
    turns = np.flatnonzero(np.diff(side[start])) + 1
    first, last = start[np.append(0, turns)], stop[np.append(turns - 1, start.size - 1)] - 1
    waves = []
    for k in range(first.size - 1):
        up, down, slow = int(first[k]), int(first[k + 1]), int(last[k + 1]) + 1
        if side[up] < 0:
            continue
        begin, end = int(last[k - 1]) if k > 0 else 0, int(first[k + 2]) + 1 if k + 2 < first.size else v_smooth.size
        before, after = _rows(v_smooth[begin:up] <= 0.0, begin), _rows(v_smooth[slow:end] >= 0.0, slow)
        if not (before.size and after.size):
            continue
        forward = _rows(v_smooth[last[k] : down] >= 0.0, int(last[k]))
        onset, rest = (crossing(t, v_smooth, int(at), 0.0) for at in (before[-1] + 1, after[0]))
        middle = crossing(t, v_smooth, int(forward[-1]) + 1, 0.0)
        waves.append(Cycle(onset, middle, (middle, middle), (middle, rest), begins_inside=False, ends_inside=False))
    return waves


def _rows(mask: Mask, start: int) -> Index:
    """Rows of a log at which a mask of a part of it is set, in order; the part begins at row `start`."""
    found: Index = start + np.flatnonzero(mask)
    return found
