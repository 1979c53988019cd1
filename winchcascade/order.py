"""Order statistics of plain arrays.

`numpy.median` and `numpy.quantile` import numpy's masked arrays, which takes longer than reducing a log.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from winchcascade.run import Signal


def quantile(x: Signal, q: float) -> float:
    """Quantile of finite values by linear interpolation, as `numpy.quantile` has it; x must not be empty.

    >>> quantile(np.array([4.0, 1.0, 3.0, 2.0]), 0.5)
    2.5
    """
    place = q * (x.size - 1)
    low = int(place)
    high = min(low + 1, x.size - 1)
    part = np.partition(x, (low, high))
    return float(part[low] + (place - low) * (part[high] - part[low]))


def median(x: Signal) -> float:
    """Median of finite values; x must not be empty."""
    return quantile(x, 0.5)
