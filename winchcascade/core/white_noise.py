"""White noise of a signal as its own samples show it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import median

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

GAUSS = 1.4826
"""Standard deviation of a normal variable over the median of its magnitude."""

FEWEST = 12
"""Fewer samples show no noise."""


def white_noise(x: Signal) -> float:
    """Standard deviation of a signal's white noise, in its unit, whatever smooth signal it sits on.

    From its fourth differences, which take out a cubic and most of a ringing that is slow beside the samples, by their median
    magnitude. A signal that rarely changes has at least the noise of its resolution.
    """
    if x.size < FEWEST:
        return 0.0
    steps = np.abs(np.diff(x))
    finest = float(steps[steps > 1e-12 * np.max(np.abs(x), initial=1e-300)].min(initial=np.inf))
    floor = finest / np.sqrt(12.0) if np.isfinite(finest) else 0.0
    return max(float(GAUSS * median(np.abs(np.diff(x, 4))) / np.sqrt(70.0)), float(floor))
