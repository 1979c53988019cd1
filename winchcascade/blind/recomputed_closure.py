"""The share of a gap that a diagnosis closed, recomputed from the logs and their predictions alone."""

import math
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.blind.twin_numbers import SENSORS
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.integrate import GAUSS, median
from winchcascade.core.run import Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.ingest.read import read_run

BLOCK = 0.4
"""Length of a block, in which the ringing of the tether cancels. [s]"""

MOVING = 0.05
"""A block counts while the line moves faster than this throughout: at rest friction only bounds the force. [m/s]"""

SMOOTHING = 0.6
"""Width of the local quadratic that smooths the velocity. [s]"""

ZERO_REACH = 3.0
"""Limit of the fitted zero of a sensor in its standard uncertainties; a bias beyond it is a gap."""

MIN_EXCESS = 0.5
"""Excess over noise, in mean squares of noise for each channel and log, below which there is no gap to close."""


class RecomputedClosure(msgspec.Struct, frozen=True):
    """Share of the gap that a diagnosis closed, over channels and predicted logs.

    `before` and `after` are sums of the mean squares of block means beyond noise, in mean squares of noise; `share` is
    1 - after / before, None where there was no gap to close. `fault` is the reason if nothing could be computed.
    """

    before: float = 0.0
    after: float = 0.0
    parts: int = 0
    share: float | None = None
    fault: str | None = None


def closure_of(case: Path, predictions: Path) -> RecomputedClosure:
    """Compute the share that was closed from a case's logs and their predictions.

    Parameters
    ----------
    case : folder of the logs
    predictions : folder with `before` and `after`, each with one simulated log for every log that was withheld once
    """
    names = sorted({p.name for p in (predictions / "before").glob("*.csv")} & {p.name for p in (case).glob("*.csv")})
    if not names:
        return RecomputedClosure(fault="no predicted logs")
    excess: list[tuple[float, float]] = []
    for name in names:
        try:
            log, old, new = (
                read_run(f, campaign=False)
                for f in (case / name, predictions / "before" / name, predictions / "after" / name)
            )
        except WinchcascadeError as fault:
            return RecomputedClosure(fault=str(fault))
        if not (_same_stamps(log, old) and _same_stamps(log, new)):
            return RecomputedClosure(fault=f"{name}: the predicted log has other stamps than the log")
        excess += [e for channel in SENSORS if (e := _excess(channel, log, old, new)) is not None]
    before, after = (sum((e[k] for e in excess), 0.0) for k in (0, 1))
    share = 1.0 - after / before if before > MIN_EXCESS * len(excess) else None
    return RecomputedClosure(before, after, len(excess), share)


def _same_stamps(log: Run, other: Run) -> bool:
    return log.t.size == other.t.size and bool(np.allclose(log.t, other.t, rtol=0.0, atol=1e-4))


def _excess(channel: str, log: Run, old: Run, new: Run) -> tuple[float, float] | None:
    """Mean squares of a channel's block means beyond noise, before and after, over the square of noise; None without blocks."""
    if not all(channel in run.channels for run in (log, old, new)):
        return None
    rows, starts = _blocks(log)
    gap_old, gap_new = ((run.channels[channel] - log.channels[channel])[rows].mean(axis=1) for run in (old, new))
    noise = _noise(gap_old, starts)
    if noise == 0.0:
        return None
    half_width = ZERO_REACH * SENSORS[channel].zero * SENSORS[channel].unit
    squares = [
        float(np.mean((gap - np.clip(np.mean(gap), -half_width, half_width)) ** 2)) for gap in (gap_old, gap_new)
    ]
    return squares[0] / noise**2 - 1.0, squares[1] / noise**2 - 1.0


def _blocks(log: Run) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of every block in motion, (blocks, rows of one), and each block's number among all."""
    length = max(1, round(BLOCK * log.fs))
    speed = local_quadratic(log.t, log.channels["velocity"], SMOOTHING)
    rows = np.arange(log.t.size // length * length).reshape(-1, length)
    signs = np.sign(speed[rows])
    moving = (np.abs(speed[rows]) > MOVING).all(axis=1) & (signs == signs[:, :1]).all(axis=1)
    return rows[moving], np.flatnonzero(moving)


_APART = 3
"""Distance in blocks of those whose difference gives the noise: nearer ones share its slow part."""

_MIN_DIFFERENCES = 8
"""Minimum number of differences for an estimate of the noise."""


def _noise(gap: Signal, numbers: NDArray[np.intp]) -> float:
    """Standard deviation of block means from noise, by second differences, as a gap is nearly straight over a few blocks.

    It contains the noise of the sensor and the tether, and that of the encoder in a prediction.
    """
    k = np.flatnonzero(numbers[2 * _APART :] - numbers[: -2 * _APART] == 2 * _APART)
    if k.size < _MIN_DIFFERENCES:
        return 0.0
    curvature = gap[k] - 2.0 * gap[k + _APART] + gap[k + 2 * _APART]
    return GAUSS * median(np.abs(curvature)) / math.sqrt(6.0)
