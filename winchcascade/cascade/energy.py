"""Integrals, means and extremes over windows and phases.

Only the samples of the windows are looked at: a log of many hours is mostly idle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.run import Run, Signal

    Index = NDArray[np.intp]


class Cut(msgspec.Struct, frozen=True):
    """The samples of k windows, one after the other, with one sample beyond either end to interpolate with.

    Parameters
    ----------
    windows : (k, 2) begin and end [s]
    rows : (m,) index of each sample in the log
    t : (m,) stamps [s]
    first, last : (k,) where each window's samples begin and end (exclusive) among the m
    """

    windows: Signal
    rows: Index
    t: Signal
    first: Index
    last: Index

    def channels(self, run: Run, names: Sequence[str]) -> dict[str, Signal]:
        """The named channels of a run in these samples; those that the run has."""
        return {name: run.channels[name][self.rows] for name in names if name in run.channels}


def cut(t: Signal, windows: Signal) -> Cut:
    """Find the samples of windows (k, 2) [s] that lie within a log of stamps t (n,) [s]."""
    low = np.clip(np.searchsorted(t, windows[:, 0], side="right") - 1, 0, t.size - 2)
    high = np.clip(np.searchsorted(t, windows[:, 1], side="left"), low + 1, t.size - 1)
    count = high - low + 1
    last = np.cumsum(count)
    first = last - count
    rows = np.arange(int(last[-1]) if count.size else 0) + np.repeat(low - first, count)
    return Cut(windows, rows, t[rows], first, last)


def integrals(part: Cut, x: Signal) -> Signal:
    """Integrate a signal over each window: trapezoids whose two ends are interpolated (Eq. 5).

    Parameters
    ----------
    x : (m,) the signal in the samples of the cut

    Returns
    -------
    (k,) in the unit of x times seconds
    """
    if len(part.windows) == 0:
        return np.empty(0)
    total = np.zeros(part.t.size)
    np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(part.t), out=total[1:])  # steps between windows cancel in the difference
    begin = _until(part, x, total, part.first, part.windows[:, 0])
    end = _until(part, x, total, part.last - 2, part.windows[:, 1])
    return end - begin


def _until(part: Cut, x: Signal, total: Signal, at: Index, instant: Signal) -> Signal:
    """Integral up to an instant between samples `at` and `at` + 1."""
    into = instant - part.t[at]
    slope = (x[at + 1] - x[at]) / (part.t[at + 1] - part.t[at])
    until: Signal = total[at] + into * (x[at] + 0.5 * slope * into)
    return until


def means(part: Cut, x: Signal) -> Signal:
    """Time mean of a signal over each window, (k,) in the unit of x; NaN for a window without length."""
    length = part.windows[:, 1] - part.windows[:, 0]
    return integrals(part, x) / np.where(length > 0, length, np.nan)


def largest(part: Cut, x: Signal) -> Signal:
    """Largest sample in each window, (k,); the nearest one for a window between two samples."""
    if len(part.windows) == 0:
        return np.empty(0)
    first = part.first + (part.t[part.first] < part.windows[:, 0])
    last = part.last - (part.t[part.last - 1] > part.windows[:, 1])
    last = np.maximum(last, first + 1)
    edges = np.column_stack((first, last)).ravel()
    found: Signal = np.maximum.reduceat(np.append(x, -np.inf), edges)[::2]
    return found


def energies(t: Signal, power: Signal, windows: Signal) -> Signal:
    """Integrate a power over windows. [J]

    Parameters
    ----------
    t, power : (n,) stamps that rise [s] and the power [W]
    windows : (k, 2) begin and end of each window [s], within the log

    Examples
    --------
    >>> energies(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0]), np.array([[0.5, 1.5]])).tolist()
    [2.0]
    """
    part = cut(t, windows)
    return integrals(part, power[part.rows])
