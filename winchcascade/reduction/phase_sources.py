"""Cycles of a log by each source that a rig file may name under [phases].

A cycle of a motion has payout, hold and haul-in. Each cycle of another source is one span, over
which energies are integrated: its window. A wave is cut into its positive half, the payout, and its
negative half, the haul-in. A step is a steady operating point of a dynamometer, in which speed and
torque stay within a band.
"""

from __future__ import annotations

import math
from itertools import pairwise

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.integrate import GAUSS, median, quantile
from winchcascade.core.phase_rule import PhaseRule
from winchcascade.core.rig_file import Rig, Thresholds
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.gap_error import all_gaps, gap_limits
from winchcascade.reduction.phases import Cycle, detect, sides, smoothed_velocity

BESIDE_GAP = 1e-5
"""Time between a gap and a span that does not touch it, as a share of a sampling interval. [1]"""

MIN_STRETCH = 2.0
"""Minimum length of a stretch between two gaps, in sampling intervals; shorter ones are left
out.
"""

BLOCKS_OF_STEP = 8
"""Number of blocks in the shortest step: noise of torque averages out in each, and a step begins
in time to an eighth.
"""

STEP_NOISE = 5.0
"""Widening of a band: range of a few dozen block means that scatter by noise alone, in their
standard deviations.
"""

MIN_NOISY_CHANGES = 20
"""Fewer changes show no noise."""

WIDTH_QUANTILE = 0.99
"""Quantile of |speed| and |torque| whose share is the width of a band: a single peak does not
widen it. [1]
"""


class Motion(msgspec.Struct, frozen=True):
    """A smoothed motion, (n,), and the thresholds of its detection, in the same unit: m/s and m,
    or rad/s and rad.
    """

    v_smooth: Signal
    thresholds: Thresholds


def find_cycles(run: Run, rig: Rig) -> tuple[list[Cycle], Signal]:
    """Find the cycles of a log by the source that its rig names, in order of time, and the smoothed
    motion, (n,).

    The motion is a line velocity [m/s]; where that is unknown, the speed of the shaft [rad/s], or
    zero without a motion.

    Raises
    ------
    LogError : the log lacks the channel that the source needs
    OptionError : ranges that the log does not hold, or that overlap
    """
    rule, limits, t = rig.phases, rig.thresholds, run.t
    source, needed = rule.source, _NEEDED.get(rule.source, ())
    if needed and run.channels.keys().isdisjoint(needed):
        raise LogError(
            f"{run.name}: [phases] of the rig finds cycles in {' or '.join(needed)}, which the "
            f"log has not; name its column "
            "under [columns], or another source under [phases]."
        )
    if source == "displacement":
        slope = np.gradient(local_quadratic(t, run.channels["displacement"], limits.smoothing), t)
        return detect(run, slope, limits), slope
    if source == "speed":
        motion = _of_shaft(run, rig)
        alone = replace(
            run, channels={name: x for name, x in run.channels.items() if name != "displacement"}
        )
        return detect(alone, motion.v_smooth, motion.thresholds), motion.v_smooth
    if source == "velocity":  # without one, the message about no cycles names another source
        v = smoothed_velocity(run, limits) if "velocity" in run.channels else np.zeros(t.size)
        return detect(run, v, limits) if "velocity" in run.channels else [], v
    motion = smoothed_motion(run, rig) or Motion(np.zeros(t.size), limits)
    if source == "waves":
        return find_waves(t, motion.v_smooth, motion.thresholds.v_onset), motion.v_smooth
    if source == "steps":
        return find_steps(run, rule, limits.gap_max), motion.v_smooth
    if source == "column":
        return labelled_cycles(run, rule.column), motion.v_smooth
    spans = _spans(run, rig)
    return [
        Cycle(a, b, None, None, begins_inside=False, ends_inside=False) for a, b in spans
    ], motion.v_smooth


_NEEDED = {
    "displacement": ("displacement",),
    "speed": ("speed",),
    "steps": ("speed",),
    "waves": ("velocity", "speed"),
}
"""Channels of which a source needs one."""


def smoothed_motion(run: Run, rig: Rig) -> Motion | None:
    """Smoothed line velocity of a run, else the speed of its shaft; None where neither is known."""
    if "velocity" in run.channels:
        return Motion(smoothed_velocity(run, rig.thresholds), rig.thresholds)
    return _of_shaft(run, rig) if "speed" in run.channels else None


def _of_shaft(run: Run, rig: Rig) -> Motion:
    """Speed of the shaft as a motion: of the line where the radius of the drum is known, else in
    radians.
    """
    omega = local_quadratic(run.t, run.channels["speed"], rig.thresholds.smoothing)
    if rig.r_drum is not None:
        return Motion(omega * rig.r_drum, rig.thresholds)
    onset, stroke = rig.phases.omega_onset, rig.phases.turns_min * 2.0 * np.pi
    return Motion(omega, replace(rig.thresholds, v_onset=onset, stroke_min=stroke))


def _spans(run: Run, rig: Rig) -> list[tuple[float, float]]:
    """Begin and end of each span of the sources `ranges`, `rows` and `whole`. [s]

    A row of a table of step means was written as two samples of one value by the reader. A whole
    record is cut by gaps that are too long to bridge.
    """
    begin, end, ranges = float(run.t[0]), float(run.t[-1]), sorted(rig.phases.ranges)
    if rig.phases.source == "rows":
        return [(a, b) for a, b in run.t.reshape(-1, 2).tolist()]
    if rig.phases.source == "whole":
        gaps = all_gaps(run, tuple(run.channels))
        gaps = gaps[gaps[:, 1] - gaps[:, 0] > gap_limits(run, rig).gap_max]
        beside = BESIDE_GAP / run.fs
        begins = [begin, *(np.maximum.accumulate(gaps[:, 1]) + beside).tolist()]
        ends = [*(gaps[:, 0] - beside).tolist(), end]
        return [(a, b) for a, b in zip(begins, ends, strict=True) if b - a > MIN_STRETCH / run.fs]
    apart = all(b <= c for (_, b), (c, _) in pairwise(ranges))
    if not ranges or ranges[0][0] < begin or ranges[-1][1] > end or not apart:
        given = ", ".join(f"{a:g} to {b:g} s" for a, b in ranges) or "none is given"
        raise OptionError(
            f"{run.name}: cycles by ranges of time: {given}; expected ranges apart from each "
            f"other, within the log from "
            f"{begin:.2f} to {end:.2f} s. Give them as ranges_s = [[begin, end], ...] in its "
            f"entry of campaign.toml, or under "
            "[phases] of the rig file."
        )
    return ranges


def labelled_cycles(run: Run, column: str) -> list[Cycle]:
    """Cycles of a log whose samples are labelled; each begins with a payout, other labels between
    are its hold.

    A phase lasts from its first sample to the first sample of the next one. The haul-in that
    follows a payout is that of its cycle; several stretches of one phase with other labels between
    them are one.

    Parameters
    ----------
    column : name of the column of the labels

    Raises
    ------
    LogError : the log was read without its labels, (n,) 1 in payout, -1 in haul-in, 0 elsewhere
    """
    t, labels = run.t, run.labels
    if labels is None:
        raise LogError(
            f"{run.name}: was read without the column {column!r} of its phases; read it with the "
            f"same rig file."
        )
    named = np.flatnonzero(labels)
    if named.size == 0:
        return []
    turns = np.flatnonzero(np.diff(labels[named])) + 1
    first, last = named[np.append(0, turns)], named[np.append(turns - 1, named.size - 1)]
    begin, end = t[first].tolist(), t[np.minimum(last + 1, t.size - 1)].tolist()
    cycles = []
    for k in np.flatnonzero(labels[first] > 0).tolist():
        haul_in = (begin[k + 1], end[k + 1]) if k + 1 < first.size else None
        cut = bool(last[k] == t.size - 1)
        hold = None if cut else (end[k], float(t[-1]) if haul_in is None else haul_in[0])
        cycles.append(
            Cycle(
                begin[k], end[k], hold, haul_in, begins_inside=bool(first[k] == 0), ends_inside=cut
            )
        )
    return cycles


def find_waves(t: Signal, v_smooth: Signal, v_onset: float) -> list[Cycle]:
    """Find the waves of a motion: the payout is the positive half, the haul-in the negative one.

    Both halves go beyond `v_onset`; what lies between is noise or rest and belongs to no half of
    its own. A half that the begin of the log cuts, and one without an upward zero crossing at its
    end, are part of no wave.

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
    side = sides(v_smooth, v_onset)
    fast = np.flatnonzero(side)
    if fast.size == 0:
        return []
    turns = np.flatnonzero(np.diff(side[fast])) + 1
    first, last = fast[np.append(0, turns)], fast[np.append(turns - 1, -1)]
    half = np.flatnonzero(side[first[:-1]] > 0)
    above, below = v_smooth > 0.0, v_smooth < 0.0
    rises = np.flatnonzero(above[1:] & ~above[:-1]) + 1
    falls = np.flatnonzero(below[1:] & ~below[:-1]) + 1
    ends = np.flatnonzero(below[:-1] & ~below[1:]) + 1
    begin = rises.searchsorted(first[half], side="right") - 1
    turn = falls.searchsorted(first[half + 1], side="right") - 1
    end = ends.searchsorted(last[half + 1] + 1)
    whole = (begin >= 0) & (end < ends.size)
    rows = np.array((rises[begin[whole]], falls[turn[whole]], ends[end[whole]]))
    before, after = v_smooth[rows - 1], v_smooth[rows]
    instants = t[rows - 1] - before / (after - before) * (t[rows] - t[rows - 1])
    return [
        Cycle(
            onset, middle, (middle, middle), (middle, rest), begins_inside=False, ends_inside=False
        )
        for onset, middle, rest in instants.T.tolist()
    ]


def find_steps(run: Run, rule: PhaseRule, gap_max: float) -> list[Cycle]:
    """Find the steady operating points of a run in order of time; its settling is left out of each.

    Speed, and torque where it is logged, are averaged over blocks of an eighth of the shortest
    step. A step is the longest stretch of blocks from its first one on that stay within both bands;
    blocks of the settling before it, which still lie within the bands, do not make it shorter. It
    is none where the shaft rests.

    Parameters
    ----------
    gap_max : a longer gap ends a step [s]
    """
    t, names = run.t, [name for name in ("speed", "torque") if name in run.channels]
    rows = max(1, round(rule.step_min / BLOCKS_OF_STEP * run.fs))  # of a block
    at = np.append(np.arange(0, t.size - rows + 1, rows), t.size)
    if at.size < 2:
        return []
    means = np.array([np.add.reduceat(run.channels[name], at[:-1]) / np.diff(at) for name in names])
    widths = []
    for name, share in zip(names, (rule.speed_band, rule.torque_band), strict=False):
        x = run.channels[name]
        change = np.diff(x)
        change = change[change != 0.0]
        noise = (
            GAUSS * median(np.abs(change - median(change)))
            if change.size >= MIN_NOISY_CHANGES
            else 0.0
        )
        widths.append(
            share * quantile(np.abs(x), WIDTH_QUANTILE) + STEP_NOISE * noise / math.sqrt(2.0 * rows)
        )
    gaps = all_gaps(run, names)
    after = np.searchsorted(t, gaps[gaps[:, 1] - gaps[:, 0] > gap_max, 1])
    unusable = np.abs(means[0]) <= rule.omega_onset
    unusable[np.clip(np.searchsorted(at, after, side="right") - 1, 0, at.size - 2)] = True
    settling = math.ceil(rule.settle * run.fs / rows)
    found, k, n = [], 0, at.size - 1
    while k < n:
        stop = _steady_until(means, widths, unusable, k)
        for other in range(k + 1, min(k + settling + 1, n)):
            if other >= stop:
                break
            if (end := _steady_until(means, widths, unusable, other)) - other > stop - k:
                k, stop = other, end
        first, last = int(np.searchsorted(t, t[at[k]] + rule.settle)), int(at[stop]) - 1
        if not unusable[k] and first < last and t[last] - t[first] >= rule.step_min:
            found.append(
                Cycle(
                    float(t[first]),
                    float(t[last]),
                    None,
                    None,
                    begins_inside=False,
                    ends_inside=False,
                )
            )
            k = stop
        else:
            k += 1
    return found


def _steady_until(means: Signal, widths: list[float], unusable: Mask, first: int) -> int:
    """Number of the first block that does not belong to the steady stretch from a block on."""
    low = high = means[:, first]
    for k in range(first + 1, means.shape[1]):
        low, high = np.minimum(low, means[:, k]), np.maximum(high, means[:, k])
        if unusable[k] or np.any(high - low > widths):
            return k
    return int(means.shape[1])
