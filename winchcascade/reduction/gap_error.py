"""Largest change of an energy by the bridging of gaps, by the intact data beside each gap."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.integrate import integrals
from winchcascade.core.rig_file import Rig, Thresholds
from winchcascade.core.run import CLOCK, Index, Run, Signal

NEAR = 0.3
"""A gap of the velocity this close to an instant moves it: half the width that smooths the velocity. [s]"""

BESIDE = 0.2
"""Slopes beside a gap are taken over at least this long. [s]"""

TOUCH = 1e-9
"""A window that ends where a gap begins touches it: the gap is why it ends there. [s]"""


WHOLE_RECORD = 0.01
"""Share of a whole record that a gap in it may last: longer ones part the record. [1]"""

WHOLE_ENERGY = 0.05
"""Share of an energy of a whole record that bridging may change; its uncertainty contains it. [1]"""


def gap_limits(run: Run, rig: Rig) -> Thresholds:
    """Thresholds of a rig with the longest gap and the largest change of an energy that are bridged in a log.

    A whole record has no neighbours that could take its place, so it bears more.
    """
    limits = rig.thresholds
    if rig.phases.source != "whole":
        return limits
    longest = max(limits.gap_max, WHOLE_RECORD * float(run.t[-1] - run.t[0]))
    return msgspec.structs.replace(limits, gap_max=longest, gap_energy_max=max(limits.gap_energy_max, WHOLE_ENERGY))


def all_gaps(run: Run, channels: Sequence[str]) -> Signal:
    """Gaps of the clock and of any of the channels, (k, 2) stamps in order of time [s]."""
    gaps: Signal = np.concatenate(
        [np.empty((0, 2)), *(run.gaps[name] for name in (CLOCK, *channels) if name in run.gaps)]
    )
    return gaps[np.argsort(gaps[:, 0], kind="stable")]


def gaps_of(run: Run, channels: Sequence[str]) -> Signal:
    """Gaps that touch any of the channels, (k, 2) in order of time [s]."""
    gaps: Signal = all_gaps(run, channels) + np.array([-TOUCH, TOUCH])
    return np.clip(gaps, run.t[0], run.t[-1])


def overlapped_windows(gaps: Signal, windows: Signal) -> tuple[Index, Index]:
    """Index of the first window that each gap overlaps, and of the last if that is another; -1 for none.

    The windows are in order and do not overlap.
    """
    first = np.searchsorted(windows[:, 1], gaps[:, 0], side="right")
    last = np.searchsorted(windows[:, 0], gaps[:, 1], side="left") - 1
    return np.where(first <= last, first, -1), np.where(first < last, last, -1)


def bridging_error(t: Signal, x: Signal, gaps: Signal) -> Signal:
    """What a straight line over each gap may miss of the integral of x, (k,) in the unit of x times seconds.

    The largest of what the same line would miss if the gap lay just before or just after, where the data are known, and
    of what a kink or a jump inside would hide, by the slopes on either side.
    """
    error = _hidden(t, x, gaps)
    width = gaps[:, 1] - gaps[:, 0]
    for shift in (-1.0, 1.0):
        tried = gaps + shift * width[:, None]
        inside = (tried[:, 0] >= t[0]) & (tried[:, 1] <= t[-1])
        tried = np.clip(tried, t[0], t[-1])
        ends = np.interp(tried, t, x)
        missed = np.abs(integrals(t, x.__getitem__, tried) - 0.5 * width * (ends[:, 0] + ends[:, 1]))
        error = np.maximum(error, np.where(inside, missed, 0.0))
    return error


def energy_error(t: Signal, watts: Signal, gaps: Signal, spans: Signal, moved: Signal) -> Signal:
    """What gaps could change of the energy in each span, (k,) [J]: by bridging, and by the moved end of the span.

    Parameters
    ----------
    t, watts : (n,) stamps [s] and power [W]
    gaps, spans : (g, 2) and (k, 2) in order of time [s]
    moved : (k,) what gaps move the end of each span [s]
    """
    square = (moved * np.interp(spans[:, 1], t, watts)) ** 2  # gaps err independently of each other
    error = bridging_error(t, watts, gaps)
    for which in overlapped_windows(gaps, spans):
        np.add.at(square, which[which >= 0], error[which >= 0] ** 2)
    return np.sqrt(square)


def _hidden(t: Signal, x: Signal, gaps: Signal) -> Signal:
    """Area between the line over each gap and the lines that go on from either side: to where they meet, else a jump."""
    width = np.maximum(gaps[:, 1] - gaps[:, 0], TOUCH)
    half_width = np.maximum(0.5 * width, BESIDE)
    first, last = np.interp(gaps.T, t, x)
    chord = (last - first) / width
    bend_in = (first - np.interp(gaps[:, 0] - half_width, t, x)) / half_width - chord
    bend_out = chord - (np.interp(gaps[:, 1] + half_width, t, x) - last) / half_width
    kink = bend_in * bend_out > 0
    height = width * np.where(kink, bend_in * bend_out / np.where(kink, bend_in + bend_out, 1.0), bend_in)
    jump = width * np.maximum(np.abs(bend_in), np.abs(bend_out))
    area: Signal = 0.5 * width * np.where(kink, np.abs(height), jump)
    return area


def instant_error(run: Run, v_smooth: Signal, instants: Signal) -> Signal:
    """What gaps of the velocity may move the instants at which it passes a level, (k,) in rising order [s]."""
    moved = np.zeros(len(instants))
    gaps = gaps_of(run, ("velocity",))
    if len(gaps) == 0 or "velocity" not in run.channels:
        return moved
    first = np.searchsorted(instants, gaps[:, 0] - NEAR)
    error = bridging_error(run.t, run.channels["velocity"], gaps)
    for gap, metres, k in zip(gaps, error, first.tolist(), strict=True):
        if k < len(instants) and instants[k] <= gap[1] + NEAR:
            width = gap[1] - gap[0]
            half_width = max(width, NEAR)
            before, after = np.interp([instants[k] - half_width, instants[k] + half_width], run.t, v_smooth)
            slope = max((after - before) / (2 * half_width), 1e-3)
            weight = _weight(max(gap[0] - instants[k], instants[k] - gap[1], 0.0) / NEAR)
            moved[k] += min(metres * min(1.5 / width, weight / (2 * NEAR)) / slope, width + NEAR)
    return moved


def _weight(u: float) -> float:
    """Weight of the smoothing quadratic over its mean, at a share u of its half width (Savitzky and Golay 1964)."""
    return abs(9 / 4 - 15 / 4 * u * u)
