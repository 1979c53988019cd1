"""How much the bridging of gaps could change an energy: the same gap is tried on intact data next to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.integrate import integrals
from winchcascade.run import CLOCK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.run import Run, Signal

NEAR_ONSET = 0.3
"""A gap of the velocity this close to the onset moves the onset itself. [s]"""


def gaps_of(run: Run, channels: tuple[str, ...]) -> Signal:
    """Gaps that touch any of the channels, (k, 2) in order of time [s]."""
    known = [run.gaps[name] for name in (CLOCK, *channels) if name in run.gaps]
    gaps = np.concatenate(known) if known else np.empty((0, 2))
    return gaps[np.argsort(gaps[:, 0], kind="stable")]


def window_of(gaps: Signal, windows: Signal) -> NDArray[np.intp]:
    """Index of the first window that each gap overlaps, -1 for none; windows in order and apart."""
    index = np.searchsorted(windows[:, 1], gaps[:, 0], side="right")
    inside = index < len(windows)
    inside[inside] &= windows[index[inside], 0] < gaps[inside, 1]
    return np.where(inside, index, -1)


def bridging_error(t: Signal, x: Signal, gaps: Signal) -> Signal:
    """What a straight line over each gap may miss of the integral of x: the larger of what the same line would miss if the
    gap lay just before or just after, where the data are known. (k,) in the unit of x times seconds
    """
    error = np.zeros(len(gaps))
    width = gaps[:, 1] - gaps[:, 0]
    for shift in (-1.0, 1.0):
        tried = gaps + shift * width[:, None]
        inside = (tried[:, 0] >= t[0]) & (tried[:, 1] <= t[-1])
        ends = np.interp(tried, t, x)
        missed = np.abs(
            integrals(t, x.__getitem__, np.clip(tried, t[0], t[-1])) - 0.5 * width * (ends[:, 0] + ends[:, 1])
        )
        error = np.maximum(error, np.where(inside, missed, 0.0))
    return error


def onset_error(run: Run, v_smooth: Signal, onsets: Signal) -> Signal:
    """What a gap of the velocity at an onset may move it, (k,) [s]: the velocity's bridging error over its slope there."""
    moved = np.zeros(len(onsets))
    gaps = gaps_of(run, ("velocity",))
    if len(gaps) == 0:
        return moved
    at = np.searchsorted(onsets, gaps[:, 0] - NEAR_ONSET)
    for gap, error, k in zip(gaps, bridging_error(run.t, v_smooth, gaps), at.tolist(), strict=True):
        if k < len(onsets) and gap[0] - NEAR_ONSET <= onsets[k] <= gap[1] + NEAR_ONSET:
            width = gap[1] - gap[0]
            before, after = np.interp([onsets[k] - width, onsets[k] + width], run.t, v_smooth)
            slope = max((after - before) / (2 * width), 1e-3)
            moved[k] = max(moved[k], min(1.5 * error / width / slope, width))
    return moved
