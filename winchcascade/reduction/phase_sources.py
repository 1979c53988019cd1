"""Cycles of a log by each source that a rig file may name under [phases], in one table of detectors.

A cycle of a motion has payout, hold and haul-in. Each cycle of another source is one span, over which energies are integrated:
its window. A wave is cut into its positive half, the payout, and its negative half, the haul-in.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.rig_file import PhaseSource, Rig, Thresholds
from winchcascade.core.run import Index, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.gap_error import all_gaps, gap_limits
from winchcascade.reduction.phases import Cycle, detect, sides, smoothed_velocity

TURN = 2.0 * np.pi
"""Radians in one revolution."""

BESIDE_GAP = 1e-6
"""Time between a gap and a span that does not touch it. [s]"""

MIN_STRETCH = 2.0
"""Minimum length of a stretch between two gaps, in sampling intervals; shorter ones are left out."""


class Detected(msgspec.Struct, frozen=True):
    """Cycles of a run in order of time, and the smoothed motion in which they were found, (n,).

    The motion is a line velocity [m/s]; where that is unknown, the speed of the shaft [rad/s], or zero without a motion.
    """

    cycles: list[Cycle]
    motion: Signal


class Motion(msgspec.Struct, frozen=True):
    """A smoothed motion, (n,), and the thresholds of its detection, in the same unit: m/s and m, or rad/s and rad."""

    v_smooth: Signal
    thresholds: Thresholds


def find_cycles(run: Run, rig: Rig) -> Detected:
    """Find the cycles of a log by the source that its rig names.

    Raises
    ------
    LogError : the log lacks the channel that the source needs
    OptionError : ranges that the log does not hold, or that overlap
    """
    return DETECTORS[rig.phases.source](run, rig)


def smoothed_motion(run: Run, rig: Rig) -> Motion | None:
    """Smoothed line velocity of a run, else the speed of its shaft; None where neither is known."""
    if "velocity" in run.channels:
        return Motion(smoothed_velocity(run, rig.thresholds), rig.thresholds)
    return _of_shaft(run, rig) if "speed" in run.channels else None


def _of_shaft(run: Run, rig: Rig) -> Motion:
    """Speed of the shaft as a motion: of the line where the radius of the drum is known, else in radians."""
    omega = local_quadratic(run.t, run.channels["speed"], rig.thresholds.smoothing)
    if rig.r_drum is not None:
        return Motion(omega * rig.r_drum, rig.thresholds)
    rule = rig.phases
    return Motion(omega, replace(rig.thresholds, v_onset=rule.omega_onset, stroke_min=rule.turns_min * TURN))


def _by_velocity(run: Run, rig: Rig) -> Detected:
    """Payouts of the line; none where its velocity is unknown, as the message about it names another source."""
    if "velocity" not in run.channels:
        return Detected([], _no_motion(run))
    v_smooth = smoothed_velocity(run, rig.thresholds)
    return Detected(detect(run, v_smooth, rig.thresholds), v_smooth)


def _by_displacement(run: Run, rig: Rig) -> Detected:
    """Payouts by the slope of the displacement."""
    if "displacement" not in run.channels:
        raise _lacks(run, "displacement")
    slope = np.gradient(local_quadratic(run.t, run.channels["displacement"], rig.thresholds.smoothing), run.t)
    return Detected(detect(run, slope, rig.thresholds), slope)


def _by_speed(run: Run, rig: Rig) -> Detected:
    """Payouts by the speed of the shaft."""
    if "speed" not in run.channels:
        raise _lacks(run, "speed")
    motion = _of_shaft(run, rig)
    turned = replace(run, channels={name: x for name, x in run.channels.items() if name != "displacement"})
    return Detected(detect(turned, motion.v_smooth, motion.thresholds), motion.v_smooth)


def _by_waves(run: Run, rig: Rig) -> Detected:
    motion = smoothed_motion(run, rig)
    if motion is None:
        raise _lacks(run, "velocity, displacement or speed")
    return Detected(find_waves(run.t, motion.v_smooth, motion.thresholds.v_onset), motion.v_smooth)


def _by_steps(run: Run, rig: Rig) -> Detected:
    from winchcascade.reduction.steps import find_steps

    if "speed" not in run.channels:
        raise _lacks(run, "speed")
    return Detected(find_steps(run, rig.phases, rig.thresholds.gap_max), _motion(run, rig))


def _by_column(run: Run, rig: Rig) -> Detected:
    if run.labels is None:
        raise LogError(
            f"{run.name}: was read without the column {rig.phases.column!r} of its phases; read it with the same rig file."
        )
    return Detected(labelled_cycles(run.t, run.labels), _motion(run, rig))


def _by_ranges(run: Run, rig: Rig) -> Detected:
    begin, end = float(run.t[0]), float(run.t[-1])
    if not rig.phases.ranges:
        raise OptionError(
            f"{run.name}: cycles by ranges of time, but none is given; add ranges_s = [[begin, end], ...] to its entry of "
            "campaign.toml, or under [phases] of the rig file."
        )
    for a, b in rig.phases.ranges:
        if a < begin or b > end:
            raise OptionError(
                f"{run.name}: the range {a:g} to {b:g} s does not lie in the log, which goes from {begin:.2f} to {end:.2f} s; "
                "correct ranges_s."
            )
    ranges = sorted(rig.phases.ranges)
    for (a, b), (c, d) in pairwise(ranges):
        if c < b:
            raise OptionError(
                f"{run.name}: the ranges {a:g} to {b:g} s and {c:g} to {d:g} s overlap, so that their energies would count "
                "twice; correct ranges_s."
            )
    return Detected([span(a, b) for a, b in ranges], _motion(run, rig))


def _whole(run: Run, rig: Rig) -> Detected:
    """The record in one span, or the stretches between gaps that are too long to bridge."""
    gaps = all_gaps(run, tuple(run.channels))
    gaps = gaps[gaps[:, 1] - gaps[:, 0] > gap_limits(run, rig).gap_max]
    begins = [float(run.t[0]), *(np.maximum.accumulate(gaps[:, 1]) + BESIDE_GAP).tolist()]
    ends = [*(gaps[:, 0] - BESIDE_GAP).tolist(), float(run.t[-1])]
    minimum = MIN_STRETCH / run.fs
    spans = [span(a, b) for a, b in zip(begins, ends, strict=True) if b - a > minimum]
    return Detected(spans, _motion(run, rig))


def _by_rows(run: Run, rig: Rig) -> Detected:
    """Each row of a table of step means, which the reader wrote as two samples of one value."""
    return Detected([span(a, b) for a, b in run.t.reshape(-1, 2).tolist()], _motion(run, rig))


def span(begin: float, end: float) -> Cycle:
    """A cycle that is one span [s], without hold and haul-in."""
    return Cycle(begin, end, None, None, begins_inside=False, ends_inside=False)


def _motion(run: Run, rig: Rig) -> Signal:
    motion = smoothed_motion(run, rig)
    return _no_motion(run) if motion is None else motion.v_smooth


def _no_motion(run: Run) -> Signal:
    return np.zeros(run.t.size)


def _lacks(run: Run, channel: str) -> LogError:
    return LogError(
        f"{run.name}: [phases] of the rig finds cycles in {channel}, which the log has not; name its column under [columns], "
        "or another source under [phases]."
    )


Detector = Callable[[Run, Rig], Detected]

DETECTORS: Mapping[PhaseSource, Detector] = {
    "velocity": _by_velocity,
    "displacement": _by_displacement,
    "speed": _by_speed,
    "column": _by_column,
    "ranges": _by_ranges,
    "waves": _by_waves,
    "steps": _by_steps,
    "rows": _by_rows,
    "whole": _whole,
}
"""How cycles are found, by source."""


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
    side = sides(v_smooth, v_onset)
    edges = np.concatenate(([0], np.flatnonzero(side[1:] != side[:-1]) + 1, [side.size]))
    start, stop = edges[:-1], edges[1:]
    fast = side[start] != 0
    start, stop = start[fast], stop[fast]
    if start.size == 0:
        return []
    turns = np.flatnonzero(np.diff(side[start])) + 1
    first, last = start[np.append(0, turns)], stop[np.append(turns - 1, start.size - 1)] - 1
    half = np.flatnonzero(side[first[:-1]] > 0)
    above, below = v_smooth > 0.0, v_smooth < 0.0
    rises = np.flatnonzero(above[1:] & ~above[:-1]) + 1
    falls = np.flatnonzero(below[1:] & ~below[:-1]) + 1
    ends = np.flatnonzero(below[:-1] & ~below[1:]) + 1
    begin = rises.searchsorted(first[half], side="right") - 1
    turn = falls.searchsorted(first[half + 1], side="right") - 1
    end = ends.searchsorted(last[half + 1] + 1)
    whole = (begin >= 0) & (end < ends.size)
    rows = rises[begin[whole]], falls[turn[whole]], ends[end[whole]]
    return [
        Cycle(onset, middle, (middle, middle), (middle, rest), begins_inside=False, ends_inside=False)
        for onset, middle, rest in zip(*(_zero_crossings(t, v_smooth, at) for at in rows), strict=True)
    ]


def _zero_crossings(t: Signal, v: Signal, rows: Index) -> list[float]:
    """Instants between some rows and the one before each at which v passes zero. [s]"""
    before, after = v[rows - 1], v[rows]
    instants: list[float] = (t[rows - 1] - before / (after - before) * (t[rows] - t[rows - 1])).tolist()
    return instants
