"""Stamps that are unreadable, repeat or run backward: found, and put right where that is safe."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median
from winchcascade.core.run import Finding

if TYPE_CHECKING:
    from winchcascade.core.run import Index, Mask, Signal


JITTER = 0.1
"""An interval that is off by more than this share of the usual one jitters."""

LATEST = 1e17
"""A stamp beyond this is no time: three thousand million years. [s]"""

CROWDED = 1.5
"""So many times the samples that fit between two stamps are too many."""

LOST = 1.5
"""An interval longer than this many usual ones has lost samples."""

GLITCH = 5
"""A backward step that at most this many samples explain is their fault; otherwise the clock was set back."""

MANY = 1000
"""More backward steps than this and the stamps are no clock."""


def with_all_stamps(stamps: Signal, findings: list[Finding], where: str) -> tuple[Signal, Index]:
    """Fill stamps that could not be read between their neighbours.

    Rows at the ends that have none are left out, and those between two stamps that are too close for so many samples: such
    rows are not of the log's rate, as the empty ones that a spreadsheet holds between two tables.
    """
    good = np.flatnonzero(np.abs(stamps) < LATEST)
    if good.size < 3:
        raise LogError(
            f"{where}: the time column holds {good.size} readable stamp{'' if good.size == 1 else 's'}; expected seconds, "
            f"milliseconds or dates with times, at least three."
        )
    if good.size == stamps.size:
        return stamps, np.arange(stamps.size)
    rows = np.arange(good[0], good[-1] + 1)
    t = np.interp(rows, good, stamps[good])
    kept = ~_crowded(stamps, good)[rows]
    lost, outside, crowded = stamps.size - good.size, stamps.size - rows.size, int(np.count_nonzero(~kept))
    at = t[np.isin(rows, good, invert=True)]
    done = ["filled between their neighbours"] if lost > outside + crowded else []
    done += [f"{outside} rows at the ends left out"] if outside else []
    done += [f"{crowded} rows between stamps that leave no room for them left out"] if crowded else []
    findings.append(
        Finding(
            "not_a_number",
            f"{lost} stamps could not be read",
            "; ".join(done),
            start=float(at[0]) if at.size else float(t[0]),
            end=float(at[-1]) if at.size else float(t[-1]),
            count=lost,
            removed=outside + crowded,
        )
    )
    return t[kept], rows[kept]


def _crowded(stamps: Signal, good: Index) -> Mask:
    """Rows without a stamp whose neighbours' stamps are too close for so many samples at the log's usual interval, (n,)."""
    between, apart = np.diff(good), np.diff(stamps[good])
    usual = median(apart[between == 1]) if np.any(between == 1) else 0.0
    crowded = np.zeros(stamps.size, dtype=np.bool_)
    if usual > 0:
        for k in np.flatnonzero((between * usual > CROWDED * apart) & (between > 1) & (apart >= 0)).tolist():
            crowded[good[k] + 1 : good[k + 1]] = True
    return crowded


def evened(t: Signal, interval: Signal, usual: float) -> Signal | None:
    """Even stamps that the log's own are a rounding of, as 75 Hz in steps of 0.01 s; None where rows are missing. [s]"""
    off = np.count_nonzero(np.abs(interval - usual) > JITTER * usual)
    if off < GLITCH or abs(float(np.mean(interval)) - usual) < 0.01 * usual:
        return None
    step = resolution(t, usual)
    if not 0 < step < 1.01 * usual:
        return None
    place = np.arange(t.size) - 0.5 * (t.size - 1)
    dt = float(place @ (t - t[0])) / float(place @ place)
    even: Signal = np.multiply(place, dt, dtype=np.float64) + float(np.mean(t))
    return even if float(np.ptp(t - even)) < 1.1 * step else None


def counted(t: Signal, even: Signal, step: float, findings: list[Finding]) -> Signal:
    """The stamps as they are if all differ, else the even ones that they are a rounding of."""
    repeated = int(np.count_nonzero(np.diff(t) == 0))
    if repeated == 0:
        return t
    findings.append(_coarse(t, repeated, f"steps of {step:g} s"))
    return even


def spread(t: Signal, findings: list[Finding]) -> Signal:
    """Spread samples that share a stamp of a coarse clock evenly up to the next stamp."""
    first = np.flatnonzero(np.diff(t, prepend=-np.inf) != 0)
    count = np.diff(first, append=t.size)
    step = np.diff(t[first])
    usual_step, usual_count = median(step), median((count[1:-1] if count.size > 2 else count).astype(np.float64))
    if step.size > 2 and np.all(np.abs(step - usual_step) < 1e-6 * max(usual_step, 1e-9)):
        whole = slice(1, None)  # the first stamp may stand for a part of its samples
        dt = (t[first[whole]][-1] - t[first[1]]) / (first[-1] - first[1])
        spread: Signal = t[first[1]] + dt * (np.arange(t.size) - first[1])
    else:
        width = np.append(step, usual_step)
        each = np.where(np.arange(count.size) == count.size - 1, np.maximum(count, usual_count), count)
        group = np.repeat(np.arange(first.size), count)
        spread = t[first][group] + (np.arange(t.size) - first[group]) * width[group] / each[group]
    findings.append(_coarse(t, t.size - first.size, f"steps of {usual_step:g} s with {usual_count:g} samples each"))
    return spread


def _coarse(t: Signal, repeated: int, counts: str) -> Finding:
    """What is said of a clock that counts in steps longer than the samples are apart."""
    return Finding(
        "repeated_stamp",
        f"{repeated} stamp{'s repeat' if repeated > 1 else ' repeats'} the one before: the clock counts in {counts}",
        "samples spread evenly",
        start=float(t[0]),
        end=float(t[-1]),
        count=repeated,
    )


def forward(t: Signal, rows: Index, usual: float, findings: list[Finding], where: str) -> tuple[Signal, Index]:
    """Put right each backward step: rows in the wrong order, single wrong stamps, or a clock that was set back."""
    t = t.copy()
    steps, removed, done = 0, 0, set()
    start = end = float(t[int(np.argmax(np.diff(t) < 0))])
    while True:
        back = np.flatnonzero(np.diff(t) < 0)
        if back.size == 0:
            break
        steps += 1
        if steps > MANY:
            raise LogError(
                f"{where}: the time column runs backward at more than {MANY} places; expected stamps that rise from row "
                f"to row. Name the right column in a rig file under [columns]."
            )
        k = int(back[0]) + 1
        end = float(t[k - 1])
        t, rows, action, lost = _put_right(t, rows, k, usual)
        removed += lost
        done.add(action)
    findings.append(
        Finding(
            "backward_stamp",
            f"the clock steps back at {steps} place{'s' if steps > 1 else ''}",
            " and ".join(sorted(done)),
            start=start,
            end=end,
            count=steps,
            removed=removed,
        )
    )
    return t, rows


def _put_right(t: Signal, rows: Index, k: int, usual: float) -> tuple[Signal, Index, str, int]:
    """Repair the backward step from sample k - 1 to k; also what was done and how many samples that cost."""
    ahead = int(np.searchsorted(t[:k], t[k], side="left"))
    later = np.flatnonzero(t[k:] > t[k - 1])
    behind = k + int(later[0]) if later.size else t.size
    early, late = k - ahead, behind - k
    if min(early, late) > GLITCH:
        shift = t[k - 1] + usual - t[k]
        t[k:] += shift
        return t, rows, "later stamps moved forward to follow on", 0
    order = ahead + np.argsort(t[ahead:behind], kind="stable")
    around = np.concatenate((t[ahead - 1 : ahead], t[order], t[behind : behind + 1]))
    steps = np.diff(around)
    if early <= GLITCH and late <= GLITCH and np.all((steps > 0.5 * usual) & (steps < LOST * usual)):
        t[ahead:behind] = t[order]
        rows = rows.copy()
        rows[ahead:behind] = rows[order]
        return t, rows, "rows put in the order of their stamps", 0
    wrong = np.arange(ahead, k) if early <= late else np.arange(k, behind)
    return np.delete(t, wrong), np.delete(rows, wrong), "samples with a wrong stamp left out", wrong.size


def without_repeats(t: Signal, rows: Index, usual: float, findings: list[Finding]) -> tuple[Signal, Index]:
    """Leave out samples that repeat a stamp; one followed by a double interval gets the stamp that is missing there."""
    again = np.flatnonzero(np.diff(t) == 0) + 1
    start, end = float(t[again[0]]), float(t[again[-1]])
    inner = again[again < t.size - 1]
    missing = inner[np.abs(t[inner + 1] - t[inner] - 2 * usual) < 0.5 * usual]
    t = t.copy()
    t[missing] = 0.5 * (t[missing] + t[missing + 1])
    left_out = np.setdiff1d(again, missing)
    done = [f"{left_out.size} left out"] if left_out.size else []
    done += [f"{missing.size} given the stamp that was missing"] if missing.size else []
    findings.append(
        Finding(
            "repeated_stamp",
            f"{again.size} sample{'s repeat' if again.size > 1 else ' repeats'} the stamp before",
            ", ".join(done),
            start=start,
            end=end,
            count=int(again.size),
            removed=int(left_out.size),
        )
    )
    return np.delete(t, left_out), np.delete(rows, left_out)


def resolution(t: Signal, usual: float) -> float:
    """Step in which the stamps count, found on a sample of them; 0 if they are finer than a millionth of a second. [s]"""
    some = t[:2000] - t[0]
    for digits in range(7):
        scaled = some * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) < 1e-3 * max(1.0, usual * 10.0**digits)):
            return float(10.0**-digits)
    return 0.0
