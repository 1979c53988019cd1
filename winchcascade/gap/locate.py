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
    """Where a gap lies; `rpm` and `i_dc` span the blocks that stand out end to end [rpm, A].

    `sentence` says in words where it shows end to end, `arises` where when each stage is given its own logged inputs.
    """

    stage: str
    channel: str
    phase: str
    load: float | None
    rpm: tuple[float, float]
    i_dc: tuple[float, float]
    sentence: str
    arises: str = ""


def locate(
    data: Fitted, residual: Signal, places: Sequence[Place], stage: str | None = None, arises: str = ""
) -> Where:
    """Find where a gap lies.

    Parameters
    ----------
    residual : (M, 5) measured minus simulated blocks, zeros taken off
    places : the map of the gap
    stage : of its main cause, or the one that is off by itself, where either is known; else the last one of the cascade whose
        output stands out
    arises : where it arises stage by stage, in words
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
        arises=arises,
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
    region = ""
    if worst.phase == "payout" and math.isfinite(rpm[0]):
        region = f" between {rpm[0]:.0f} and {rpm[1]:.0f} rpm"
        if current[1] > 0.5:
            region += f" and {max(current[0], 0.0):.1f} to {current[1]:.1f} A DC"
    where = "a sensor" if stage == "sensor" else f"the {stage} stage"
    return (
        f"The gap lies in {where}: {off_words(worst.channel, size)} during {worst.phase.replace('_', '-')}{region}, most "
        f"clearly{load_words(worst.load)}, by up to {size_words(worst.channel, size)}."
    )


def off_words(channel: str, bias: float) -> str:
    """In which direction a channel is off, by the sign of measured minus simulated.

    >>> off_words("force", -3.0)
    'line force is over-predicted'
    """
    return f"{NAMES[channel]} is {'over' if bias < 0.0 else 'under'}-predicted"


def size_words(channel: str, size: float) -> str:
    """The magnitude of a difference with its unit, from SI units.

    >>> size_words("pressure", -98066.5), size_words("vdc", 12.345)
    ('1 kg/cm2', '12.3 V')
    """
    factor, unit = (1.0 / 98066.5, "kg/cm2") if channel == "pressure" else (1.0, UNITS[channel])
    return f"{abs(size) * factor:.3g} {unit}"


def load_words(load: float | None) -> str:
    """At which load, with a blank before it; nothing for a load that is not known. [ohm]

    >>> load_words(4.5), load_words(math.inf), load_words(None)
    (' at 4.5 ohm', ' in open circuit', '')
    """
    return "" if load is None else " in open circuit" if math.isinf(load) else f" at {load:g} ohm"
