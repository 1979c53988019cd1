"""In which stage a gap arises, when each is given its own logged inputs, or which sensor the stages that are off share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_map import Place
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.stagewise import StagePlace


SHARED = 0.9
"""One sensor is told for several stages if its gain takes away at least this share of their squares in all places."""

CALLED = {"load": "generator"}
"""Stage of the catalogue that a stage belongs to, where it is not called the same: load and bridge make one module."""


class Arises(msgspec.Struct, frozen=True):
    """Where a gap arises: the stages that are `off` by themselves, most first, and the `worst` place of the first.

    `sensor` is the channel whose gain error alone, of size `gain` [1], would have several of them off as they are.
    """

    off: tuple[str, ...]
    worst: StagePlace | None
    sensor: str | None = None
    gain: float = 0.0

    @property
    def stage(self) -> str | None:
        """Stage of the catalogue, or `sensor`; None where no stage is off by itself."""
        if not self.off:
            return None
        return "sensor" if self.sensor else CALLED.get(self.off[0], self.off[0])

    @property
    def sentence(self) -> str:
        """Say it in words."""
        if self.worst is None:
            return f"Given its own logged inputs, no stage alone is off by more than {STANDS_OUT:g} standard uncertainties."
        if self.sensor is not None:
            return (
                f"Given their own logged inputs, the {_list(self.off)} stages are off as a gain error of "
                f"about {100.0 * self.gain:+.1g} % in the {SENSORS[self.sensor]} alone would have them."
            )
        one = len(self.off) == 1
        which = f"the {self.off[0]} stage alone is off" if one else f"the {_list(self.off)} stages are off, "
        which += "" if one else f"the {self.off[0]} most"
        return (
            f"Given {'its' if one else 'their'} own logged inputs, {which}: {off_words(self.worst.channel, self.worst.bias)} "
            f"during {self.worst.phase.replace('_', '-')}, most clearly{load_words(self.worst.load)}, by "
            f"{size_words(self.worst.channel, self.worst.bias)} in the mean."
        )


SENSORS = {
    "pressure": "pressure sensor", "force": "force cell", "torque": "torque sensor", "vdc": "sensor of Vdc",
    "idc": "sensor of Idc",
}  # fmt: skip


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
    for channel in SENSORS:
        way = np.array([p.by_gain.get(channel, 0.0) for p in places])[seen] / u[seen]
        touched = {p.stage for p in places if p.by_gain.get(channel, 0.0)}
        if not set(off) <= touched:
            continue
        gain = float(way @ z / (way @ way))
        left = float(np.sum((z - gain * way) ** 2) / np.sum(z**2))
        if left < least:
            best, least, size = channel, left, gain
    return best, size


def _list(names: Sequence[str]) -> str:
    """Names as a list in a sentence.

    >>> _list(("gearbox", "generator", "load"))
    'gearbox, generator and load'
    """
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else list(names))


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
