"""Clocks that were set forward while a log was written: the line shows that no time passed."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from winchcascade.core.integrate import smallest_step
from winchcascade.core.run import Finding, Repair, Repairs, Signal
from winchcascade.ingest.clock import Clock, read_clock

SIDE = 5
"""Intervals on either side of a gap that show how fast the line moves. [1]"""

CLEAR = 3.0
"""The travel beside a gap, and that which the line would have had in it, exceed the error of the
displacement so many times. [1]"""

OF_INTERVALS = ("dropped_samples", "clock_jitter")
"""Findings on the intervals between stamps, which change with the stamps."""


def without_steps(clock: Clock, channels: dict[str, Signal], where: str, repairs: Repairs) -> Clock:
    """Take steps of the clock out of its stamps.

    A gap is a step where the line moves on both sides, and where the displacement goes on as in one
    interval. A log whose line rests, or that has no displacement, does not show which it is.

    Parameters
    ----------
    channels : (n,) each, SI units, in the rows that the clock kept
    where : the log, for messages
    repairs : "off" reports the steps and keeps the stamps
    """
    x, v = channels.get("displacement"), channels.get("velocity")
    if x is None:
        return clock
    t, usual, findings = clock.t, 1.0 / clock.fs, clock.findings
    for k in np.searchsorted(clock.t, clock.gaps[:, 0]).tolist():
        if _goes_on(clock.t, x, v, k, usual):
            start, end = clock.t[k : k + 2].tolist()
            findings = (*findings, _step(start, end - start - usual, applied=repairs == "on"))
            t = np.append(t[: k + 1], t[k + 1 :] - (end - start - usual))
    if repairs == "off" or findings == clock.findings:
        return replace(clock, findings=findings)
    mended = read_clock(t, where)
    kept = [f.at_times(clock.t, t) for f in findings if f.kind not in OF_INTERVALS]
    return replace(mended, rows=clock.rows, findings=(*kept, *mended.findings))


def _step(start: float, step: float, *, applied: bool) -> Finding:
    """A finding on a step of the clock after a stamp. [s]"""
    what = f"at {start:.2f} s the clock steps by {step:+.2f} s, while the displacement goes on"
    done = "later stamps moved back to follow on"
    repair = Repair(done, 0, ((start, start + step),), applied)
    action = done if applied else "kept, as repairs are off"
    return Finding("clock_mismatch", what, action, start=start, end=start + step, repair=repair)


def _goes_on(t: Signal, x: Signal, v: Signal | None, k: int, usual: float) -> bool:
    """Whether a displacement goes on from row k to the next as in one usual interval.

    The line moves one way on both sides, and the travel that the whole gap would have had exceeds
    the error of the displacement. A sample that is lost proves nothing.
    """
    if k < SIDE or k + 1 + SIDE >= t.size:
        return False
    changes = np.diff((x[k - SIDE : k + 1], x[k + 1 : k + 2 + SIDE]))
    error = max(float(np.max(np.abs(changes))), 2.0 * smallest_step(x))
    travel = changes.sum(axis=1)
    if v is not None:
        both = np.array((v[k - SIDE : k], v[k + 2 : k + 2 + SIDE]))
        travel = np.append(travel, usual * both.sum(axis=1))
    least = float(np.min(np.abs(travel)))
    gap = float(t[k + 1] - t[k]) - usual
    clear = min(2.0, gap / (SIDE * usual)) * least > CLEAR * error
    one_way = bool(np.ptp(np.sign(travel)) == 0.0)
    return clear and one_way and abs(float(x[k + 1] - x[k]) - float(changes.mean())) <= error
