"""Find payout, hold and haul-in of every cycle, and the plateau of its payout, from the smoothed
line velocity.

The velocity is cut into runs above +v_onset and below -v_onset. What the line travels in these
runs, noise and creep below v_onset left out, gives turning points; between them lie the payouts and
the haul-ins. A reversal that takes back little of a payout and is followed by more payout belongs
to it; a jog that a rest parts from it does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.integrate import distinct, integrals_to, median, quantile
from winchcascade.core.rig_file import Thresholds
from winchcascade.core.run import Index, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.gap_error import all_gaps

PEAK_OF_NOISE = 1.5
"""A run that peaks below this many times the onset speed is noise about the threshold, not a
motion.
"""

OVERTAKEN = 1.5
"""A reversal is one inside a motion only if the motion then goes on by more than this many times
the reversal.
"""

REST = 10 / 3
"""A jog, which travels less than `stroke_min`, is apart from a motion if a rest longer than this
many widths of the smoothing lies between them: shorter stops are a line that tightens or a crane
that takes up its load. [1]"""


class Cycle(msgspec.Struct, frozen=True):
    """Instants of one cycle on the log's clock [s].

    `haul_in` is None where the log ends before it. `begins_inside` and `ends_inside` mark a payout
    that the first or last sample of the log cuts.
    """

    onset: float
    payout_end: float
    hold: tuple[float, float] | None
    haul_in: tuple[float, float] | None
    begins_inside: bool
    ends_inside: bool

    @property
    def spans(self) -> dict[str, tuple[float, float] | None]:
        """Begin and end of each phase by its name, None for one that the cycle lacks. [s]"""
        return {"payout": (self.onset, self.payout_end), "hold": self.hold, "haul_in": self.haul_in}


class Plateau(msgspec.Struct, frozen=True):
    """The quasi-steady part of a payout: speed [m/s], its beginning and the start of braking
    [s].
    """

    speed: float
    begin: float
    braking: float


class _Runs(msgspec.Struct, frozen=True):
    """Stretches of samples on one side of the threshold, in order: [start, stop), travel [m], peak
    speed [m/s].

    A long gap is one too, with the travel of the displacement and a peak of 0.
    """

    start: list[int]
    stop: list[int]
    travel: list[float]
    peak: list[float]


def smoothed_velocity(run: Run, thresholds: Thresholds) -> Signal:
    """Smooth the line velocity as detection, windows and plateau use it; LogError for a log
    without one. [m/s]
    """
    if "velocity" not in run.channels:
        raise LogError(
            f"{run.name}: the velocity of the line is unknown; name its column, the one of the "
            f"displacement, or the speed of "
            "rotation and r_drum in the rig file."
        )
    return local_quadratic(run.t, run.channels["velocity"], thresholds.smoothing)


def detect(run: Run, v_smooth: Signal, thresholds: Thresholds) -> list[Cycle]:
    """Find the cycles of a log, in order; an empty list if the line never pays out.

    Parameters
    ----------
    v_smooth : (n,) line velocity, smoothed, payout positive [m/s]
    """
    runs = _find_runs(run, v_smooth, thresholds)
    position = list(accumulate(runs.travel, initial=0.0))
    turns = _without_reversals(
        _turning_points(position, thresholds.stroke_min), position, thresholds
    )
    legs = list(pairwise(turns))
    return [
        _cycle(run.t, v_smooth, runs, leg, after, thresholds)
        for leg, after in zip(legs, [*legs[1:], None], strict=False)
        if position[leg[1]] > position[leg[0]]
    ]


def check_cycles(chosen: tuple[int, int], cycles: Sequence[Cycle], log: str) -> None:
    """Require that a log has some of the cycles from a first to a last one; OptionError reports
    how many it has.
    """
    first, last = chosen
    if not 1 <= first <= min(last, len(cycles)):
        raise OptionError(
            f"{log}: cycles {first} to {last} were chosen, but it has {len(cycles)}; choose among "
            f"those."
        )


def sides(v: Signal, v_onset: float) -> NDArray[np.int8]:
    """On which side of the threshold a velocity is, (n,): 1 above it, -1 below its negative, 0
    between.
    """
    side: NDArray[np.int8] = (v > v_onset).view(np.int8) - (v < -v_onset).view(np.int8)
    return side


def _find_runs(run: Run, v: Signal, thresholds: Thresholds) -> _Runs:
    """Cut the velocity into runs, with each gap that is too long to know what moved inside as a
    run of its own.
    """
    gaps, n = all_gaps(run, ("velocity",)), v.size
    gaps = gaps[gaps[:, 1] - gaps[:, 0] > thresholds.gap_max]
    first, last = (
        np.searchsorted(run.t, gaps[:, 0], side="right"),
        np.searchsorted(run.t, gaps[:, 1], side="left"),
    )
    side = sides(v, thresholds.v_onset)
    for a, b in zip(first, last, strict=True):
        side[a:b] = 0
    changes: Index = np.concatenate(([0], np.flatnonzero(np.diff(side)) + 1, last[last < n]))
    start = distinct(changes)
    travel = np.diff(integrals_to(run.t, [v.__getitem__], run.t[np.append(start, n - 1)])[0])
    for b in last[
        (first == last) & (last > 0) & (last < n)
    ]:  # what a straight line over the gap travels is not known
        travel[np.searchsorted(start, b) - 1] -= 0.5 * (v[b - 1] + v[b]) * (run.t[b] - run.t[b - 1])
    peak = np.maximum(np.maximum.reduceat(v, start), -np.minimum.reduceat(v, start))
    moving = side[start] != 0
    runs = [x[moving] for x in (start, np.append(start[1:], n), travel, peak)]
    x = run.channels.get("displacement", np.zeros(n))
    unseen = x[np.minimum(last, n - 1)] - x[np.clip(first - 1, 0, n - 1)]
    order = np.argsort(np.concatenate((runs[0], last - 0.5)), kind="stable")
    columns = zip(runs, (first, last, unseen, np.zeros(first.size)), strict=True)
    return _Runs(*(np.concatenate(both)[order].tolist() for both in columns))


def _turning_points(position: list[float], minimum: float) -> list[int]:
    """Indices of alternating lows and highs of a position that differ by at least `minimum`,
    ends of motion included.
    """
    low = high = 0
    turns: list[int] = []
    rising: bool | None = None
    for k, x in enumerate(position):
        if rising is not True and x < position[low]:
            low = k
        if rising is not False and x > position[high]:
            high = k
        if rising is not True and x - position[low] >= minimum:
            turns.append(low)
            rising, high = True, k
        elif rising is not False and position[high] - x >= minimum:
            turns.append(high)
            rising, low = False, k
    if rising is not None:
        turns.append(high if rising else low)
    return turns


def _without_reversals(
    turns: list[int], position: list[float], thresholds: Thresholds
) -> list[int]:
    """Join the legs around a reversal that takes back little and is then overtaken."""
    kept: list[int] = []
    for turn in turns:
        kept.append(turn)
        while len(kept) >= 4:
            a, b, c, d = (position[k] for k in kept[-4:])
            before, back, onward = abs(b - a), abs(c - b), abs(d - c)
            if back >= thresholds.reversal_max * before or onward < OVERTAKEN * back:
                break
            del kept[-3:-1]
    return kept


def _cycle(
    t: Signal,
    v: Signal,
    runs: _Runs,
    leg: tuple[int, int],
    after: tuple[int, int] | None,
    thresholds: Thresholds,
) -> Cycle:
    """Instants of the payout between two turning points and of the haul-in between the next two."""
    begin, end = _motion(t, runs, leg, thresholds, sign=1.0)
    level, haul_in = thresholds.v_onset, None
    if after is not None:
        down, up = _motion(t, runs, after, thresholds, sign=-1.0)
        haul_in = (crossing(t, v, down, -level), crossing(t, v, up, -level, ends=True))
    payout_end = crossing(t, v, end, level, ends=True)
    hold_end = float(t[-1]) if haul_in is None else haul_in[0]
    return Cycle(
        onset=crossing(t, v, begin, level),
        payout_end=payout_end,
        hold=None if end == v.size else (payout_end, max(hold_end, payout_end)),
        haul_in=haul_in,
        begins_inside=begin == 0,
        ends_inside=end == v.size,
    )


def _motion(
    t: Signal, runs: _Runs, leg: tuple[int, int], thresholds: Thresholds, *, sign: float
) -> tuple[int, int]:
    """First sample of the motion of a leg in its direction, and the one after its last: without
    noise about the threshold, creep, and jogs that rests part from it.
    """
    along = [k for k in range(*leg) if sign * runs.travel[k] > 0]
    top = max(runs.peak[k] for k in along)
    minimum = min(max(PEAK_OF_NOISE * thresholds.v_onset, thresholds.creep_max * top), top)
    motions = [k for k in along if runs.peak[k] >= minimum]
    rest = REST * thresholds.smoothing
    parts: list[list[int]] = []
    for k in range(motions[0], motions[-1] + 1):
        if (
            runs.peak[k] >= minimum or runs.peak[k] == 0.0
        ):  # what moves in a gap is unknown and no rest
            if not parts or t[runs.start[k]] - t[runs.stop[parts[-1][-1]] - 1] > rest:
                parts.append([])
            parts[-1].append(k)
    strokes = []
    for part in parts:
        position = list(accumulate((runs.travel[k] for k in part), initial=0.0))
        if max(position) - min(position) >= thresholds.stroke_min and not set(part).isdisjoint(
            motions
        ):
            strokes.append(part)
    if strokes:
        motions = [k for k in motions if strokes[0][0] <= k <= strokes[-1][-1]]
    return runs.start[motions[0]], runs.stop[motions[-1]]


def crossing(t: Signal, v: Signal, k: int, level: float, *, ends: bool = False) -> float:
    """Instant between samples k - 1 and k at which v passes the level; the first or last stamp at
    an end of the log. [s]

    Where v does not pass it there, a gap hides how it goes on: a motion that `ends` has its last
    stamp before the gap, one that begins the first one after it.
    """
    if k <= 0 or k >= v.size:
        return float(t[0 if k <= 0 else -1])
    before, after = float(v[k - 1]), float(v[k])
    if ends and (before - level) * (after - level) > 0.0:
        return float(t[k - 1])
    share = (level - before) / (after - before) if after != before else 1.0
    return float(t[k - 1] + min(max(share, 0.0), 1.0) * (t[k] - t[k - 1]))


def find_plateau(
    t: Signal, v_smooth: Signal, cycle: Cycle, thresholds: Thresholds
) -> Plateau | None:
    """Find the plateau of a payout: None where the speed never stays near its top for
    `plateau_hold`.

    The plateau's speed is the median of the velocities above 90 % of their 99th percentile. It
    begins with the first stretch of that length throughout which the velocity is at or above 98 %
    of that; braking begins after the last sample that is.
    """
    first, last = (
        int(t.searchsorted(cycle.onset)),
        int(t.searchsorted(cycle.payout_end, side="right")),
    )
    v = v_smooth[first:last]
    if v.size < 3:
        return None
    top = quantile(v, thresholds.plateau_quantile)
    if not top > 0.0:  # a payout that moves in a gap alone
        return None
    speed = median(v[v >= thresholds.plateau_band * top])
    level = thresholds.plateau_level * speed
    high = np.zeros(v.size + 2, dtype=bool)
    high[1:-1] = v >= level
    edges = np.flatnonzero(high[1:] != high[:-1]) + first
    stretches = [
        (  # cut by the ends of the payout where v does not pass the level
            crossing(t, v_smooth, a, level) if a > first else float(t[a]),
            crossing(t, v_smooth, b, level) if b < last else float(t[b - 1]),
        )
        for a, b in edges.reshape(-1, 2).tolist()
    ]
    begin = next((a for a, b in stretches if b - a >= thresholds.plateau_hold), None)
    return None if begin is None else Plateau(speed, begin, stretches[-1][1])
