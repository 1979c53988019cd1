"""In which stage a gap arises, when each is given its own logged inputs, or which sensor the stages that are off share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.gap.locate import STANDS_OUT, load_words, off_words, size_words

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.gap.stagewise import StagePlace

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
