"""The load at which a metric is largest, among loads that are tried."""

from __future__ import annotations

import math

import numpy as np

from winchcascade.core.run import Signal


def largest_at(loads: Signal, values: Signal) -> float:
    """Where a metric is largest over the logarithm of the load, by a parabola through the three
    highest neighbours; NaN where no load is allowed. [ohm]

    Parameters
    ----------
    loads : (k,) evenly spaced in their logarithm [ohm]
    values : (k,) of the metric, -inf at a load that is not allowed

    Examples
    --------
    >>> largest_at(np.array([1.0, 2.0, 4.0]), np.array([3.0, 5.0, 3.0]))
    2.0
    >>> largest_at(np.array([1.0, 2.0, 4.0]), np.array([-math.inf, 5.0, 3.0]))
    2.0
    """
    k = int(np.argmax(values))
    if values[k] == -math.inf:
        return math.nan
    if not 0 < k < loads.size - 1 or not np.all(np.isfinite(values[k - 1 : k + 2])):
        return float(loads[k])
    before, here, after = values[k - 1 : k + 2].tolist()
    curve = before - 2.0 * here + after
    shift = 0.5 * (before - after) / curve if curve < 0.0 else 0.0
    return float(loads[k] * (loads[k + 1] / loads[k]) ** shift)
