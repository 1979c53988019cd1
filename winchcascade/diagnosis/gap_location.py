"""In which stage a gap arises, when each is given its own logged inputs, or which sensor the stages that are off share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Arises, Where
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.gap_map import Place
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.stagewise import StagePlace


SHARED = 0.9
"""One sensor is told for several stages if its gain takes away at least this share of their squares in all places."""


def arises(places: Sequence[StagePlace]) -> Arises:
    """Find the stages that are off by themselves.

    Parameters
    ----------
    places : of `stagewise`
    """
    size: dict[str, StagePlace] = {}
    for place in places:
        if abs(place.z) > max(STANDS_OUT, abs(size[place.stage].z) if place.stage in size else 0.0):
            size[place.stage] = place
    worst = sorted(size.values(), key=lambda p: -abs(p.z))
    if not worst:
        return Arises((), None)
    off = tuple(p.stage for p in worst)
    sensor, gain = _shared(places, off)
    return Arises(off, worst[0], sensor, gain)


def _shared(places: Sequence[StagePlace], off: Sequence[str]) -> tuple[str | None, float]:
    """The channel whose sensor's gain alone would have the stages off as they are, None where there is none, and its error."""
    if len(off) < 2:
        return None, 0.0
    u = np.array([math.hypot(p.u_noise, p.u_tolerance, 0.0 if math.isnan(p.u_repeat) else p.u_repeat) for p in places])
    seen = u > 0.0
    z = np.array([p.bias for p in places])[seen] / u[seen]
    best, least, size = None, 1.0 - SHARED, 0.0
    for channel in CHANNELS:
        way = np.array([p.by_gain.get(channel, 0.0) for p in places])[seen] / u[seen]
        touched = {p.stage for p in places if p.by_gain.get(channel, 0.0)}
        if not set(off) <= touched:
            continue
        gain = float(way @ z / (way @ way))
        left = float(np.sum((z - gain * way) ** 2) / np.sum(z**2))
        if left < least:
            best, least, size = channel, left, gain
    return best, size


STAGE_OF = {
    "pressure": "restoring",
    "force": "transmission",
    "torque": "gearbox",
    "vdc": "generator",
    "idc": "generator",
}
"""Stage whose output a channel is."""

DOWNSTREAM = ("idc", "vdc", "torque", "pressure", "force")
"""Channels in the order in which a gap is laid to a stage: what is wrong at the end of the cascade shows upstream too."""

STANDS_OUT = 4.0
"""A bias beyond this many standard uncertainties is none of noise, repeatability and tolerance."""

EDGE = 0.02
"""Share of the blocks that stand out which a region leaves out at either end."""


def locate(
    data: Fitted, residual: Signal, places: Sequence[Place], stage: str | None = None, own: Arises | None = None
) -> Where:
    """Find where a gap lies.

    Parameters
    ----------
    residual : (M, 5) measured minus simulated blocks, zeros taken off
    places : the map of the gap
    stage : of its main cause, or the one that is off by itself, where either is known; else the last one of the cascade whose
        output stands out
    own : where it arises stage by stage
    """
    if stage is None or stage == "sensor":
        channel = _last_that_stands_out(places)
        stage = stage or STAGE_OF[channel]
    else:
        outputs = [name for name in CHANNELS if STAGE_OF[name] == stage]
        channel = max(places, key=lambda p: (p.channel in outputs and abs(p.z) > STANDS_OUT, abs(p.z))).channel
    worst = max((p for p in places if p.channel == channel), key=lambda p: abs(p.z))
    rpm, current, size = _region(data, residual, CHANNELS.index(channel), PHASES.index(worst.phase))
    return Where(stage, worst, rpm, current, size, own)


def _last_that_stands_out(places: Sequence[Place]) -> str:
    for name in DOWNSTREAM:
        if any(p.channel == name and abs(p.z) > STANDS_OUT for p in places):
            return name
    return max(places, key=lambda p: abs(p.z)).channel


def _region(
    data: Fitted, residual: Signal, k: int, phase: int
) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Speeds [rpm] and DC currents [A] of the blocks that stand out, and the largest bias there (97.5 % of the blocks)."""
    speed, current, gap, out = [], [], [], []
    scale = data.rig.rpm_per_velocity or math.nan
    for rows, log in zip(data.rows, data.logs, strict=True):
        here = log.noise.seen[:, k] & (log.course.blocks.phase == phase)
        speed.append(log.course.blocks.mean(log.run.channels["velocity"])[here] * scale)
        current.append(log.measured[here, CHANNELS.index("idc")])
        gap.append(residual[rows, k][here])
        out.append(np.abs(gap[-1]) > STANDS_OUT * log.noise.total[here, k])
    far = np.concatenate(out)
    if not far.any():
        far = np.ones_like(far)
    speeds, currents, gaps = (np.concatenate(x)[far] for x in (speed, current, gap))
    side = np.sign(np.median(gaps)) or 1.0
    return (
        (float(np.quantile(speeds, EDGE)), float(np.quantile(speeds, 1.0 - EDGE))),
        (float(np.quantile(currents, EDGE)), float(np.quantile(currents, 1.0 - EDGE))),
        float(side * np.quantile(side * gaps, 0.975)),
    )
