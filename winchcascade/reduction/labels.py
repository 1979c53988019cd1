"""Cycles by a column of the log that names the phase of each sample."""

from __future__ import annotations

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.reduction.phases import Cycle


def labelled_cycles(t: Signal, labels: Signal) -> list[Cycle]:
    """Cycles of a log whose samples are labelled; each begins with a payout, other labels between are its hold.

    A phase lasts from its first sample to the first sample of the next one. The haul-in that follows a payout is that of its
    cycle; several stretches of one phase with other labels between them are one.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    labels : (n,) 1 in payout, -1 in haul-in, 0 elsewhere

    Examples
    --------
    >>> (cycle,) = labelled_cycles(np.arange(8.0), np.array([0, 1, 1, 0, 0, -1, -1, 0]))
    >>> cycle.onset, cycle.payout_end, cycle.haul_in
    (1.0, 3.0, (5.0, 7.0))
    """
    named = np.flatnonzero(labels)
    if named.size == 0:
        return []
    turns = np.flatnonzero(np.diff(labels[named])) + 1
    first, last = named[np.append(0, turns)], named[np.append(turns - 1, named.size - 1)]
    end = t[np.minimum(last + 1, t.size - 1)]
    cycles = []
    for k in np.flatnonzero(labels[first] > 0).tolist():
        follows = k + 1 < first.size
        haul_in = (float(t[first[k + 1]]), float(end[k + 1])) if follows else None
        cut = bool(last[k] == t.size - 1)
        hold_end = haul_in[0] if haul_in is not None else float(t[-1])
        cycles.append(
            Cycle(
                onset=float(t[first[k]]),
                payout_end=float(end[k]),
                hold=None if cut else (float(end[k]), hold_end),
                haul_in=haul_in,
                begins_inside=bool(first[k] == 0),
                ends_inside=cut,
            )
        )
    return cycles
