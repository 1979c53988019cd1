"""Block means of a diagnosed campaign as its figures show them: logged, by the rig as given, and with the causes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_map import without_zeros
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis

BIN = 250.0
"""Width of the bins of generator speed in which block means are averaged. [rpm]"""

OUT, HAUL_IN = PHASES.index("payout"), PHASES.index("haul_in")


class Sides(NamedTuple):
    """Blocks of every log, (M, 5) each, SI units, columns of `CHANNELS`: logged, and simulated before and after.

    `after` comes from fits that did not know the log, where there are such; `known` (M,) tells where there are not.
    """

    logged: Signal
    before: Signal
    after: Signal | None
    known: NDArray[np.bool_]


def sides(found: ModelDiagnosis) -> Sides:
    """Blocks as logged and as simulated, each log's zeros estimated alike on either side."""
    data = found.data
    logged = data.measured
    before = logged - without_zeros(data, logged - found.predicted)
    known = np.ones(logged.shape[0], dtype=bool)
    if not found.causes:
        return Sides(logged, before, None, known)
    after = logged - without_zeros(data, logged - found.fitted)
    if found.closure is not None:
        fresh = np.isfinite(found.closure.residual[:, 0])
        after = np.where(fresh[:, None], logged - np.nan_to_num(found.closure.residual), after)
        known = ~fresh
    return Sides(logged, before, after, known)


class Series(NamedTuple):
    """One channel of one log over its blocks, (m,) each in SI units; NaN where the channel says nothing.

    `t` are the middles of the blocks [s], `rpm` the generator speed that the line gives while the clutch is engaged, `noise`
    one standard deviation of a block's mean.
    """

    t: Signal
    rpm: Signal
    phase: NDArray[np.intp]
    logged: Signal
    before: Signal
    after: Signal | None
    noise: Signal


def series(found: ModelDiagnosis, both: Sides, log: int, channel: str) -> Series:
    """Take one channel of one log out of the blocks of all."""
    one, rows, k = found.data.logs[log], found.data.rows[log], CHANNELS.index(channel)
    blocks, run, seen = one.course.blocks, one.run, one.noise.seen[:, k]

    def column(x: Signal) -> Signal:
        return np.where(seen, x[rows, k], np.nan)

    return Series(
        t=0.5 * (run.t[blocks.start] + run.t[blocks.stop - 1]),
        rpm=blocks.mean(run.channels["velocity"]) * (found.rig.rpm_per_velocity or math.nan),
        phase=blocks.phase,
        logged=column(both.logged),
        before=column(both.before),
        after=None if both.after is None else column(both.after),
        noise=np.where(seen, one.noise.total[:, k], np.nan),
    )


def seen_channels(found: ModelDiagnosis) -> list[str]:
    """Channels that say something in any log."""
    return [c for k, c in enumerate(CHANNELS) if any(log.noise.seen[:, k].any() for log in found.data.logs)]


def by_load(found: ModelDiagnosis) -> list[int]:
    """Numbers of the logs from the open circuit to the smallest resistance."""
    return sorted(range(len(found.data.logs)), key=lambda k: -found.data.logs[k].load)


def loaded(found: ModelDiagnosis) -> list[int]:
    """Numbers of the logs with a load, from the largest resistance to the smallest."""
    return [k for k in by_load(found) if math.isfinite(found.data.logs[k].load)]


def representative(found: ModelDiagnosis) -> list[int]:
    """Three logs that stand for all loads: the lightest, the one in the middle, and the heaviest."""
    own = loaded(found)
    return list(dict.fromkeys([own[0], own[len(own) // 2], own[-1]])) if own else []


def most_telling(found: ModelDiagnosis) -> int:
    """The log in which the gap stands out most: one that took no part in a fit where there is one."""
    candidates = list(found.closure.withheld) if found.closure is not None else loaded(found) or by_load(found)
    size = {k: max((abs(p.z) for p in found.places if p.log == k), default=0.0) for k in candidates}
    return max(candidates, key=lambda k: size[k])


class SpeedCurve(NamedTuple):
    """Means of payout blocks over generator speed [rpm], (n,) each: logged, before, after."""

    rpm: Signal
    logged: Signal
    before: Signal
    after: Signal | None


def over_speed(one: Series, other: Series | None = None) -> SpeedCurve:
    """Average the payout blocks of a channel, or the product with another, in bins of generator speed, until braking."""

    def times(x: Signal, y: Signal | None) -> Signal:
        return x if y is None else x * y

    logged = times(one.logged, None if other is None else other.logged)
    before = times(one.before, None if other is None else other.before)
    after = None if one.after is None else times(one.after, None if other is None else other.after)
    here = before_braking(one) & np.isfinite(logged) & np.isfinite(before) & (one.rpm > 0.0)
    number = np.floor(one.rpm[here] / BIN).astype(np.intp)
    bins, place = np.unique(number, return_inverse=True)
    count = np.bincount(place)

    def mean(x: Signal) -> Signal:
        averaged: Signal = np.bincount(place, weights=x[here]) / count
        return averaged

    return SpeedCurve(
        mean(one.rpm) if bins.size else np.zeros(0),
        mean(logged) if bins.size else np.zeros(0),
        mean(before) if bins.size else np.zeros(0),
        None if after is None else mean(after) if bins.size else np.zeros(0),
    )


def stretches(here: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches of neighbours that hold, first and one past the last.

    >>> stretches(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]
    """
    begins = np.flatnonzero(here & ~np.concatenate(([False], here[:-1])))
    ends = np.flatnonzero(here & ~np.concatenate((here[1:], [False]))) + 1
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def before_braking(one: Series) -> NDArray[np.bool_]:
    """Payout blocks up to the last of each payout that is near its top speed, (m,): braking gives energy back."""
    out = one.phase == OUT
    here: NDArray[np.bool_] = out.copy()
    for a, b in stretches(out):
        top = a + np.flatnonzero(one.rpm[a:b] >= TOP * np.max(one.rpm[a:b]))[-1]
        here[top + 1 : b] = False
    return here


TOP = 0.9
"""Braking begins after the last block with this share of a payout's top speed."""


def stator_current(found: ModelDiagnosis) -> tuple[Signal, Signal]:
    """Stator current of the model with the causes and logged DC current, over the payout blocks of all loads, (n,) each. [A]"""
    data, best = found.data, found.found.best
    from winchcascade.rig.kernel import constants

    models = data.models(best.nu, best.effects(found.suspects))
    stator, direct = [], []
    for k in loaded(found):
        log = data.logs[k]
        here = log.noise.seen[:, CHANNELS.index("idc")] & (log.course.blocks.phase == OUT)
        kept = log.course.shaft(constants(models[k], log.course.load))
        stator.append(log.course.block_mean(kept.i_s)[here])
        direct.append(log.measured[here, CHANNELS.index("idc")])
    return (np.concatenate(stator), np.concatenate(direct)) if stator else (np.zeros(0), np.zeros(0))


def rated_dc_current(found: ModelDiagnosis) -> float | None:
    """DC current at which the stator carries its rated current, in the middle of all loads; None where none comes near. [A]"""
    rated = found.rig.generator.i_rated
    if rated is None:
        return None
    stator, direct = stator_current(found)
    near = np.abs(stator / rated.value - 1.0) < NEAR
    return float(np.median(direct[near] * rated.value / stator[near])) if np.any(near) else None


NEAR = 0.15
"""Blocks whose stator current is within this share of the rated one tell the DC current that belongs to it."""
