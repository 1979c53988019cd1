"""Rows that were lost while the clock was renumbered, and counters that were set: the
displacement jumps without travel.

The law is that of the first relation, by which the displacement is the integral of the velocity,
taken from one row to the next. It cannot wait for the relations of the phases: the time that is put
back moves onsets and windows, and a lag over a payout does not show one row.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from winchcascade.core.integrate import BLOCK, GAUSS, median, quantile
from winchcascade.core.run import Finding, Repair, Signal
from winchcascade.ingest.checks.samples import OF_NOISE, Samples, whole

OF_USUAL = 3.0
"""Smallest jump, in the 95 % quantile of the travel beyond the velocity elsewhere: a slow line
travels steps of its encoder, of which white noise knows nothing. [1]"""

OF_STEP = 1.5
"""Smallest jump, in steps of the displacement, which an update puts before or behind a row. [1]"""

ROW = 0.5
"""Smallest jump, as a share of the travel in a row: at least one whole row is lost. [1]"""

MAX_JUMPS = 20
"""With more of them the displacement jumps by itself, as one that is sampled slowly does. [1]"""

SIDE = 5
"""Rows on either side of a jump that show whether it comes back, and the speed where no velocity
is logged. [1]
"""


def put_back(log: Samples) -> Signal:
    """Put back the time of lost rows, and take the steps of a counter that was set out of the
    displacement.

    Returns
    -------
    (k, 2) stamps around the rows that were lost [s]
    """
    gaps = []
    t, x, thresholds = log.t, log.channels["displacement"], log.rig.thresholds
    step = log.level("displacement").step
    for before, metres, speed in _jumps(log):
        start, repair, after = float(log.t[before]), None, before + 1
        end, travel = start, abs(speed) * float(log.t[after] - start)
        slow = abs(speed) < thresholds.v_onset
        if slow and abs(metres) < thresholds.stroke_min:
            continue
        if slow:
            cause = "while the line rests: rows were lost and the clock was renumbered, or the counter was set"
        elif metres * speed < 0.0 or (
            abs(x[after]) < OF_STEP * step + travel and abs(x[before]) > step
        ):
            x = np.append(x[:after], x[after:] - metres)
            cause = "and goes on from there: the counter was set back, or rows were written twice"
            repair = Repair(
                "step removed from the displacement", x.size - after, ((start, float(t[-1])),)
            )
        else:
            lost = metres / speed
            t = np.append(log.t[:after], log.t[after:] + lost)
            log.findings[:] = [finding.at_times(log.t, t) for finding in log.findings]
            log.t, end = t, float(t[after])
            gaps.append((start, end))
            cause = f"as in {lost:.2f} s: rows were lost and the clock was renumbered, or the displacement slipped"
            repair = Repair("treated as a gap of that length", 0, (gaps[-1],))
        what = f"at {start:.2f} s the displacement jumps by {metres:+.3f} m beyond what the velocity gives, {cause}"
        action = "reported and kept" if repair is None else repair.what
        log.findings.append(
            Finding("clock_mismatch", what, action, start=start, end=end, repair=repair)
        )
    log.channels["displacement"] = x
    return np.array(gaps).reshape(-1, 2)


def _steps(t: Signal, x: Signal, v: Signal, first: int, last: int) -> tuple[Signal, Signal, Signal]:
    """Interval [s], mean speed [m/s], and travel beyond any speed from a row before to a row
    after [m], of some steps.
    """
    v = v[np.clip(np.arange(first - 1, last + 2), 0, t.size - 1)]
    near = v[:-3], v[1:-2], v[2:-1], v[3:]
    interval, moved = np.diff(t[first : last + 1]), np.diff(x[first : last + 1])
    beyond = moved - np.clip(
        moved, np.minimum.reduce(near) * interval, np.maximum.reduce(near) * interval
    )
    return interval, 0.5 * (near[1] + near[2]), beyond


def _jumps(log: Samples) -> list[tuple[int, float, float]]:
    """Jumps of the displacement by what the line did not travel, in order; none if they are many.

    Each is the row before it, what it changes beyond the mean velocity [m], and that velocity
    [m/s]: without a velocity the middle one of the slopes beside a row. A few blocks of a long log
    show what is usual.
    """
    t, x, v, v_onset = (
        log.t,
        log.channels["displacement"],
        log.channels.get("velocity"),
        log.rig.thresholds.v_onset,
    )
    known = np.isfinite(x) if v is None else np.isfinite(x) & np.isfinite(v)
    if np.count_nonzero(known) < 4 * SIDE:
        return []
    x, longest = whole(t, x), 1.5 * log.interval
    if v is None:
        slopes = np.pad(np.diff(x) / np.diff(t), SIDE, mode="edge")
        v = np.partition(np.lib.stride_tricks.sliding_window_view(slopes, 2 * SIDE), SIDE, axis=1)[
            :, SIDE
        ]
    v, sizes, found = whole(t, v), [], []

    @lru_cache(maxsize=1)  # a log of one block needs it once
    def steps(first: int) -> tuple[Signal, Signal, Signal]:
        return _steps(t, x, v, first, min(first + BLOCK, t.size - 1))

    for first in range(0, t.size - 1, BLOCK * max(1, t.size // (8 * BLOCK))):
        interval, speed, beyond = steps(first)
        sizes.append(np.abs(beyond[(interval < longest) & (np.abs(speed) > v_onset)]))
    size = np.concatenate(sizes)
    if size.size < 4 * SIDE:
        return []
    least = max(OF_USUAL * quantile(size, 0.95), OF_NOISE * GAUSS * median(size))
    least = max(least, OF_STEP * log.level("displacement").step)
    for first in range(0, t.size - 1, BLOCK):
        interval, speed, beyond = steps(first)
        large = (np.abs(beyond) > np.maximum(least, ROW * np.abs(speed) * interval)) & (
            interval < longest
        )
        found += (first + np.flatnonzero(large)).tolist()
    jumps = []
    for k in found if len(found) <= MAX_JUMPS else []:
        first, place = max(k - SIDE, 0), min(k, SIDE)
        interval, speed, _ = _steps(t, x, v, first, min(k + SIDE + 1, t.size - 1))
        along = np.diff(x[first : first + speed.size + 1]) - speed * interval
        metres = float(along[place])
        comes_back = abs(float(along.sum()) - metres) >= ROW * abs(metres)  # as a spike does
        if not comes_back and known[k : k + 2].all():
            jumps.append((k, metres, float(speed[place])))
    return jumps
