"""Where a gap lies: stage, channel, phase, load, and the region of speed and current in which it shows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.fit.blocks import PHASES
from winchcascade.fit.predict import CHANNELS
from winchcascade.gap.compare import Place

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.fit.campaign import Fitted
    from winchcascade.run import Signal

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

UNITS = {"pressure": "Pa", "force": "N", "torque": "N m", "vdc": "V", "idc": "A"}
NAMES = {"pressure": "pressure", "force": "line force", "torque": "torque", "vdc": "Vdc", "idc": "Idc"}


class Where(msgspec.Struct, frozen=True):
    """Where a gap lies; `rpm` and `i_dc` span the blocks that stand out [rpm, A], `sentence` says it in words."""

    stage: str
    channel: str
    phase: str
    load: float | None
    rpm: tuple[float, float]
    i_dc: tuple[float, float]
    sentence: str


def locate(data: Fitted, residual: Signal, places: Sequence[Place], stage: str | None = None) -> Where:
    """Find where a gap lies.

    Parameters
    ----------
    residual : (M, 5) measured minus simulated blocks, zeros taken off
    places : the map of the gap
    stage : of its main cause, where that is known; else the last one of the cascade whose output stands out
    """
    if stage is None or stage == "sensor":
        channel = _last_that_stands_out(places)
        stage = stage or STAGE_OF[channel]
    else:
        own = [name for name in CHANNELS if STAGE_OF[name] == stage]
        channel = max(places, key=lambda p: (p.channel in own and abs(p.z) > STANDS_OUT, abs(p.z))).channel
    worst = max((p for p in places if p.channel == channel), key=lambda p: abs(p.z))
    rpm, current, size = _region(data, residual, CHANNELS.index(channel), PHASES.index(worst.phase))
    return Where(
        stage=stage,
        channel=channel,
        phase=worst.phase,
        load=worst.load,
        rpm=rpm,
        i_dc=current,
        sentence=_sentence(stage, worst, rpm, current, size),
    )


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


def _sentence(stage: str, worst: Place, rpm: tuple[float, float], current: tuple[float, float], size: float) -> str:
    """Say it: where, in which direction, at what currents and speeds, by how much."""
    load = "" if worst.load is None else " in open circuit" if math.isinf(worst.load) else f" at {worst.load:g} ohm"
    side = "over-predicted" if size < 0.0 else "under-predicted"
    factor, unit = (1.0 / 98066.5, "kg/cm2") if worst.channel == "pressure" else (1.0, UNITS[worst.channel])
    region = ""
    if worst.phase == "payout" and math.isfinite(rpm[0]):
        region = f" between {rpm[0]:.0f} and {rpm[1]:.0f} rpm"
        if current[1] > 0.5:
            region += f" and {max(current[0], 0.0):.1f} to {current[1]:.1f} A DC"
    where = "a sensor" if stage == "sensor" else f"the {stage} stage"
    return (
        f"The gap lies in {where}: {NAMES[worst.channel]} is {side} during {worst.phase.replace('_', '-')}{region}, most "
        f"clearly{load}, by up to {abs(size) * factor:.3g} {unit}."
    )
