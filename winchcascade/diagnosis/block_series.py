"""Blocks of every channel of a diagnosed campaign: logged, and simulated before and after the causes, over time and speed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winchcascade.core.run import Signal
from winchcascade.diagnosis.block_means import PAYOUT
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.gap_map import without_zeros
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.stator_current import by_load, loaded

SPEED_BIN = 250.0
"""Width of the bins of generator speed in which block means are averaged. [rpm]"""

TOP_SHARE = 0.9
"""Braking begins after the last block with this share of a payout's top speed. [1]"""


class Sides(NamedTuple):
    """Blocks of every log, (M, 5) each, SI units, columns of `CHANNELS`: logged, and simulated before and after.

    `after` comes from fits without the log, where there are such.
    """

    logged: Signal
    before: Signal
    after: Signal | None


def sides(found: ModelDiagnosis) -> Sides:
    """Blocks as logged and as simulated, each log's zeros estimated alike on either side."""
    data, logged = found.data, found.data.measured
    before = logged - without_zeros(data, logged - found.predicted)
    if not found.causes:
        return Sides(logged, before, None)
    after = logged - without_zeros(data, logged - found.fitted_blocks)
    if found.closure is not None:
        after = np.where(np.isfinite(found.closure.residual[:, :1]), logged - found.closure.residual, after)
    return Sides(logged, before, after)


def sides_of_one(found: ModelDiagnosis) -> Sides | None:
    """Blocks before and after the only suspect, with every other number as before; None where several are suspected."""
    if found.alone is None:
        return None
    both = sides(found)
    return both._replace(after=both.logged - without_zeros(found.data, both.logged - found.alone))


class Series(NamedTuple):
    """One channel of one log over its blocks, (m,) each in SI units; NaN where the channel has no value.

    `t` are the middles of the blocks [s], `rpm` the generator speed that the line gives while the clutch is engaged, `noise`
    one standard deviation of a block's mean.
    """

    t: Signal
    rpm: Signal
    phase: NDArray[np.intp]
    noise: Signal
    logged: Signal
    before: Signal
    after: Signal | None = None

    @property
    def values(self) -> list[Signal]:
        """Logged, before and, where there is one, after."""
        return [self.logged, self.before, *([] if self.after is None else [self.after])]

    @property
    def errors(self) -> list[Signal]:
        """Logged minus simulated, before and, where there is one, after."""
        return [self.logged - simulated for simulated in self.values[1:]]

    @property
    def before_braking(self) -> NDArray[np.bool_]:
        """Payout blocks up to the last of each payout that is near its top speed, (m,): braking gives energy back."""
        out = self.phase == PAYOUT
        here: NDArray[np.bool_] = out.copy()
        for a, b in stretches(out):
            top = a + np.flatnonzero(self.rpm[a:b] >= TOP_SHARE * np.max(self.rpm[a:b]))[-1]
            here[top + 1 : b] = False
        return here


def series(found: ModelDiagnosis, both: Sides, log: int, channel: str) -> Series:
    """Take one channel of one log out of the blocks of all."""
    one, rows, k = found.data.logs[log], found.data.rows[log], CHANNELS.index(channel)
    blocks, run, seen = one.course.blocks, one.run, one.noise.seen[:, k]
    return Series(
        0.5 * (run.t[blocks.start] + run.t[blocks.stop - 1]),
        blocks.mean(run.channels["velocity"]) * (found.rig.rpm_per_velocity or math.nan),
        blocks.phase,
        np.where(seen, one.noise.total[:, k], np.nan),
        *(np.where(seen, x[rows, k], np.nan) for x in both if x is not None),
    )


def stretches(here: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches of neighbours that hold, first and one past the last.

    >>> stretches(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]
    """
    edges = np.flatnonzero(np.diff(here, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def means_over_speed(factors: Sequence[Series]) -> list[Signal]:
    """Average the payout blocks of a channel, or the product of several, in bins of generator speed, until braking.

    Returns
    -------
    Means of generator speed [rpm], logged, before and, where there is one, after; (n,) each.
    """
    rpm, values = factors[0].rpm, [np.prod(column, axis=0) for column in zip(*(x.values for x in factors), strict=True)]
    here = factors[0].before_braking & np.isfinite(values[0]) & np.isfinite(values[1]) & (rpm > 0.0)
    _, place = np.unique(np.floor(rpm[here] / SPEED_BIN), return_inverse=True)
    return [np.bincount(place, weights=x[here]) / np.bincount(place) for x in (rpm, *values)]


def seen_channels(found: ModelDiagnosis) -> list[str]:
    """Channels that have a value in any log."""
    return [c for k, c in enumerate(CHANNELS) if any(log.noise.seen[:, k].any() for log in found.data.logs)]


def representative(found: ModelDiagnosis) -> list[int]:
    """Three logs that stand for all loads: the lightest, the one in the middle, and the heaviest."""
    own = loaded(found)
    return list(dict.fromkeys([*own[:1], *own[len(own) // 2 :][:1], *own[-1:]]))


def most_telling(found: ModelDiagnosis) -> int:
    """The log with the most significant gap, a held-out one where there is one."""
    candidates = list(found.closure.withheld) if found.closure is not None else loaded(found) or by_load(found)
    return max(candidates, key=lambda k: max((abs(p.z) for p in found.places if p.log == k), default=0.0))
