"""What the noise of the sensors makes of the energies of a log's windows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.white_noise import white_noise
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.energies import STAGES, sources

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.windows import Window

MOST_WINDOWS = 12
"""Number of windows that are evaluated: an even selection of those of a longer log. Noise belongs to the sensors. [1]"""

INDEPENDENT = 0.04
"""Time over which samples are averaged first: noise of a sensor that is sampled faster than it responds is not white. [s]"""


def energy_noise(run: Run, windows: Sequence[Window]) -> dict[str, float]:
    """Relative standard deviation of an energy in a window by the white noise of its channels, by stage. [1]

    The noise of a channel is that of its samples in the window. In the sum of the power over n samples it averages out by the
    square root of n.

    Parameters
    ----------
    windows : those that are whole
    """
    chosen = windows[:: -(-len(windows) // MOST_WINDOWS)] if windows else ()
    count = max(1, int(INDEPENDENT * run.fs + 1e-6))
    found = {}
    for stage in STAGES:
        names = sources(run.channels, stage)
        if chosen and all(name in run.channels for name in names):
            square = [_square(run, names, window, count) for window in chosen]
            found[stage] = float(np.sqrt(np.mean(square)))
    return found


def _square(run: Run, names: Sequence[str], window: Window, count: int) -> float:
    """Relative variance of one energy. [1]"""
    first, last = np.searchsorted(run.t, (window.onset, window.cutoff)).tolist()
    parts = [_averaged(run.channels[name][first:last], count) for name in names]
    x, y = parts if len(parts) == 2 else (parts[0], np.ones(parts[0].size))
    square = white_noise(x) ** 2 * float(y @ y) + white_noise(y) ** 2 * float(x @ x)
    return square / max(float(x @ y) ** 2, NOTHING)


def _averaged(x: Signal, count: int) -> Signal:
    """Means of so many samples each."""
    whole = x.size // count * count
    means: Signal = x[:whole].reshape(-1, count).mean(axis=1)
    return means
