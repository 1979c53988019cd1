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
    x = channels.get("displacement")
    if x is None or not len(clock.gaps):
        return clock
    usual, t, findings = 1.0 / clock.fs, clock.t.copy(), []
    for k in np.searchsorted(clock.t, clock.gaps[:, 0]).tolist():
        step = float(clock.t[k + 1] - clock.t[k]) - usual
        if not _goes_on(clock.t, x, channels.get("velocity"), k, usual):
            continue
        start = float(t[k])
        message = (
            f"at {start:.2f} s the clock steps by {step:+.2f} s, while the displacement goes on as in "
            f"one interval of {usual:.4g} s"
        )
        repair = Repair("later stamps moved back to follow on", 0, ((start, start + usual),))
        finding = Finding("clock_mismatch", message, repair.what, repair=repair)
        findings.append(replace(finding, start=start, end=start + usual))
        t[k + 1 :] -= step
    if not findings:
        return clock
    if repairs == "off":
        kept = [
            replace(f, action="kept, as repairs are off", repair=replace(f.repair, applied=False))
            for f in findings
            if f.repair is not None
        ]
        return replace(clock, findings=(*clock.findings, *kept))
    others = [f.at_times(clock.t, t) for f in clock.findings if f.kind not in OF_INTERVALS]
    mended = read_clock(t, where)
    return replace(mended, rows=clock.rows, findings=(*others, *findings, *mended.findings))


def _goes_on(t: Signal, x: Signal, v: Signal | None, k: int, usual: float) -> bool:
    """Whether a displacement goes on from row k to the next as in one usual interval."""
    if k < SIDE or k + 1 + SIDE >= t.size:
        return False
    sides = x[k - SIDE : k + 1], x[k + 1 : k + 2 + SIDE]
    changes = np.diff(sides)
    bend = float(np.max(np.abs(np.diff(changes)), initial=0.0))
    error = max(bend, float(np.max(np.abs(changes))), 2.0 * smallest_step(x))
    travels = np.sum(changes, axis=1)
    if v is not None:
        travels = np.append(travels, [np.sum(v[k - SIDE : k]) * usual, np.sum(v[k + 1 : k + 1 + SIDE]) * usual])
    least = float(np.min(np.abs(travels)))  # NaN where a sample is lost, which is no proof
    if not (least > 0.5 * CLEAR * error and abs(float(np.sum(np.sign(travels)))) == travels.size):
        return False
    gap = float(t[k + 1] - t[k]) - usual
    if least / (SIDE * usual) * gap < CLEAR * error:
        return False
    expected = float(np.mean(changes))
    return abs(float(x[k + 1] - x[k]) - expected) <= error
