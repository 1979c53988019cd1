"""Largest change of an energy by the bridging of gaps, by the intact data beside each gap."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.integrate import integrals, values_at
from winchcascade.core.rig_file import Rig, Thresholds
from winchcascade.core.run import CLOCK, Run, Signal

INSTANT_REACH = 0.5
"""A gap of the velocity this close to an instant moves it, as a share of the width that smooths
the velocity. [1]
"""

SLOPE_LENGTH_MIN = 1 / 3
"""Slopes beside a gap are taken over at least this share of that width. [1]"""

TOUCH = 1e-7
"""Share of a sampling interval by which a window that ends where a gap begins touches it: the
gap is why it ends there. [1]
"""

SLOPE_MIN = 0.02
"""Smallest acceleration with which a velocity passes a level, as a share of the onset speed over
the width that smooths it; a gap moves an instant by no more than its own length. [1]"""

OF_PHASE = 0.05
"""Largest share of a phase that one bridge may replace: what is drawn there is no measurement.
[1]
"""

WHOLE_RECORD, WHOLE_ENERGY = 0.01, 0.05
"""Shares of a whole record that a gap in it may last, and of its energy that bridging may change:
it has no neighbours that could take its place, and its uncertainty contains what bridging may
change. [1]"""


def gap_limits(run: Run, rig: Rig) -> Thresholds:
    """Thresholds of a rig with the longest gap and the largest change of an energy that are
    bridged in a log.
    """
    limits = rig.thresholds
    if rig.phases.source != "whole":
        return limits
    longest = max(limits.gap_max, WHOLE_RECORD * float(run.t[-1] - run.t[0]))
    return msgspec.structs.replace(
        limits, gap_max=longest, gap_energy_max=max(limits.gap_energy_max, WHOLE_ENERGY)
    )


def all_gaps(run: Run, channels: Sequence[str]) -> Signal:
    """Gaps of the clock and of any of the channels, (k, 2) stamps in order of time [s]."""
    known = [run.gaps[name] for name in (CLOCK, *channels) if name in run.gaps]
    gaps = np.concatenate([np.empty((0, 2)), *known])
    return np.asarray(gaps[np.argsort(gaps[:, 0], kind="stable")])


def gaps_of(run: Run, channels: Sequence[str]) -> Signal:
    """Gaps that touch any of the channels, (k, 2) in order of time [s]."""
    return np.asarray(
        np.clip(all_gaps(run, channels) + np.array([-TOUCH, TOUCH]) / run.fs, run.t[0], run.t[-1])
    )


def bridging_error(t: Signal, x: Signal, gaps: Signal, smoothing: float) -> Signal:
    """What a straight line over each gap may miss of the integral of x, (k,) in the unit of x times
    seconds.

    The largest of what the same line would miss if the gap lay just before or just after, where the
    data are known, and of what a kink or a jump inside would hide: the area between the line and
    those that go on from either side, to where these meet.

    Parameters
    ----------
    t, x : (n,) stamps [s] and a signal
    gaps : (k, 2) [s]
    smoothing : width that smooths the velocity [s]
    """
    width = np.maximum(gaps[:, 1] - gaps[:, 0], TOUCH * smoothing)
    beside = np.maximum(0.5 * width, SLOPE_LENGTH_MIN * smoothing)
    first, last = values_at(t, x, gaps.T)
    chord = (last - first) / width
    bend_in = (first - values_at(t, x, gaps[:, 0] - beside)) / beside - chord
    bend_out = chord - (values_at(t, x, gaps[:, 1] + beside) - last) / beside
    kink = bend_in * bend_out > 0
    meeting = np.abs(bend_in * bend_out / np.where(kink, bend_in + bend_out, 1.0))
    error = 0.5 * width**2 * np.where(kink, meeting, np.maximum(np.abs(bend_in), np.abs(bend_out)))
    for shift in (-1.0, 1.0):
        tried = gaps + shift * np.diff(gaps, axis=1)
        inside = (tried[:, 0] >= t[0]) & (tried[:, 1] <= t[-1])
        tried = np.clip(tried, t[0], t[-1])
        line = 0.5 * (gaps[:, 1] - gaps[:, 0]) * values_at(t, x, tried).sum(axis=1)
        error = np.maximum(error, inside * np.abs(integrals(t, x.__getitem__, tried) - line))
    return np.asarray(error)


def energy_error(
    t: Signal, watts: Signal, gaps: Signal, spans: Signal, moved: Signal, smoothing: float
) -> Signal:
    """What gaps could change of the energy in each span, (k,) [J]: by bridging, and by the moved
    end of the span.

    Parameters
    ----------
    t, watts : (n,) stamps [s] and power [W]
    gaps, spans : (g, 2) and (k, 2) in order of time [s]
    moved : (k,) what gaps move the end of each span [s]
    smoothing : width that smooths the velocity [s]
    """
    square = np.append(
        0.0, np.cumsum(bridging_error(t, watts, gaps, smoothing) ** 2)
    )  # gaps err independently of each other
    first = np.searchsorted(np.maximum.accumulate(gaps[:, 1]), spans[:, 0], side="right")
    last = np.maximum(np.searchsorted(gaps[:, 0], spans[:, 1], side="left"), first)
    error: Signal = np.sqrt(
        (moved * values_at(t, watts, spans[:, 1])) ** 2 + square[last] - square[first]
    )
    return error


def instant_error(run: Run, v_smooth: Signal, instants: Signal, thresholds: Thresholds) -> Signal:
    """What gaps of the velocity may move the instants at which it passes a level, (k,) in rising
    order [s].
    """
    moved, reach = np.zeros(len(instants)), INSTANT_REACH * thresholds.smoothing
    least = SLOPE_MIN * thresholds.v_onset / thresholds.smoothing
    if "velocity" not in run.channels:
        return moved
    gaps = gaps_of(run, ("velocity",))
    first = np.searchsorted(instants, gaps[:, 0] - reach)
    near = np.append(instants, np.inf)[first] <= gaps[:, 1] + reach
    gaps, first = gaps[near], first[near]
    at, width = instants[first], gaps[:, 1] - gaps[:, 0]
    half = np.maximum(width, reach)
    before, after = values_at(run.t, v_smooth, np.array([at - half, at + half]))
    slope = np.maximum((after - before) / (2.0 * half), least)
    # Weight of the smoothing quadratic over its mean, by the distance in its half widths (Savitzky
    # and Golay 1964).
    distance = np.maximum(np.maximum(gaps[:, 0] - at, at - gaps[:, 1]), 0.0) / reach
    weight = np.abs(9.0 / 4.0 - 15.0 / 4.0 * distance**2)
    metres = bridging_error(run.t, run.channels["velocity"], gaps, thresholds.smoothing)
    speed = metres * np.minimum(1.5 / width, weight / (2.0 * reach))
    np.add.at(moved, first, np.minimum(speed / slope, width + reach))
    return moved
