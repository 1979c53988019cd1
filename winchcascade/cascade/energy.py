"""Integrals over windows and phases."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from winchcascade.run import Signal


def energies(t: Signal, power: Signal, windows: Signal) -> Signal:
    """Integrate a power over many windows at once (Eq. 5): trapezoids whose two ends are interpolated. [J]

    Parameters
    ----------
    t, power : (n,) stamps that rise [s] and the power [W]
    windows : (k, 2) begin and end of each window [s], within the log

    Returns
    -------
    (k,) the integrals; of any signal, in its unit times seconds

    Examples
    --------
    >>> energies(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0]), np.array([[0.5, 1.5]])).tolist()
    [2.0]
    """
    if len(windows) == 0:
        return np.empty(0)
    total = np.zeros(t.size)
    np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t), out=total[1:])
    at = np.clip(np.searchsorted(t, windows, side="right") - 1, 0, t.size - 2)
    into = windows - t[at]
    slope = (power[at + 1] - power[at]) / (t[at + 1] - t[at])
    until = total[at] + into * (power[at] + 0.5 * slope * into)
    integral: Signal = until[:, 1] - until[:, 0]
    return integral


def means(t: Signal, x: Signal, windows: Signal) -> Signal:
    """Time mean of a signal over each window, (k,) in the unit of x; NaN for a window without length."""
    length = windows[:, 1] - windows[:, 0]
    return energies(t, x, windows) / np.where(length > 0, length, np.nan)
