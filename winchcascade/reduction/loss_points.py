"""Operating points of the machine between two stages without storage: means over steps, or over blocks of a motion.

A speed below zero is counted as above zero, and the torque with it: a machine that turns the other way loses as much.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import pairwise
from operator import mul

import msgspec
import numpy as np

from winchcascade.core.accuracy import Part
from winchcascade.core.cascade import Cascade, Power, Stream
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.integrate import means, stretches_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.bins import engaged
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import Reduction

STORING = ("line", "hyd")
"""Stages next to which gas, oil or inertia store energy: no loss follows from their power at an instant."""

BLOCK = 0.5
"""Length of the blocks of a motion: longer than the ringing of the shaft, shorter than the acceleration of a crane. [s]"""

SMOOTHING = 0.44
"""Width of the local quadratic that gives speed and voltage at the ends of a block, from which stored energy follows. [s]"""

TURNING = 0.5
"""Mean speed from which the shaft turns: below, bearings stick and resolution decides. [rad/s]"""

STEADY = 0.02
"""Largest rate at which the speed changes within a point, as a share of the speed, where the inertia is unknown. [1/s]"""


def columns_at(torque: Signal, speed: Signal) -> Signal:
    """Columns of the surface of the loss, (..., 5): w, w^2, T^2, |T|, w T.

    >>> columns_at(np.array(-2.0), np.array(3.0)).tolist()
    [3.0, 9.0, 4.0, 2.0, -6.0]
    """
    return np.stack((speed, speed**2, torque**2, np.abs(torque), speed * torque), axis=-1)


class LossPoints(msgspec.Struct, frozen=True):
    """Operating points, (k,) each; torque and speed are those of the shaft with the torque sensor, the torque with the sign
    that the rig file gives its power.

    Parameters
    ----------
    stages : the stage that power comes from, and the one that it goes to
    power_in, power_out : mean powers of these two [W]
    stored : rate at which rotor, shaft spring and capacitor take up energy [W]
    columns : (k, 5) means of the columns of the surface
    means : of each channel that the powers are made of, SI units
    made_of : of which channels the two powers are made
    duration : of each point [s]
    cycle, log : numbers of the cycle and the log of each point; of one log the cycles count on
    logs : names of the logs
    left_out : how many points were not used, by reason
    """

    stages: tuple[str, str]
    torque: Signal
    speed: Signal
    power_in: Signal
    power_out: Signal
    stored: Signal
    columns: Signal
    means: Mapping[str, Signal]
    made_of: tuple[Power, Power]
    duration: Signal
    cycle: Index
    log: Index
    logs: tuple[str, ...]
    left_out: Mapping[str, int]

    @property
    def loss(self) -> Signal:
        """Power that is lost at each point. [W]"""
        return self.power_in - self.power_out - self.stored

    def with_error(self, channel: str, part: Part, size: float) -> LossPoints:
        """The points as they would be if a channel read too much by a share of itself, or by a constant in its unit."""
        error = {channel: size * self.means[channel] if part == "gain" else np.full(self.torque.size, size)}
        powers = []
        for power, made_of in zip((self.power_in, self.power_out), self.made_of, strict=True):
            changed = power
            for term in made_of.terms:
                if channel in term.channels:
                    r_drum = np.abs(self.means["velocity"]) / self.speed if term.by_radius else 1.0
                    others = [self.means[name] for name in term.channels if name != channel]
                    changed = changed + term.constant * error[channel] * reduce(mul, others, 1.0) / r_drum
            powers.append(changed)
        counted = self._flip * _counted(self.made_of[0 if self.stages[0] == "mech" else 1])
        torque = self.torque + (error[channel] * counted if channel == "torque" else 0.0)
        speed = self.speed
        if channel == "speed":
            speed = speed + error[channel] * self._flip
        elif channel == "velocity" and "speed" not in self.means:
            speed = speed * (1.0 + error[channel] / self.means[channel])
        columns = self.columns + columns_at(torque, speed) - columns_at(self.torque, self.speed)
        return msgspec.structs.replace(
            self, torque=torque, speed=speed, power_in=powers[0], power_out=powers[1], columns=columns
        )

    @property
    def _flip(self) -> Signal:
        """Sign of the speed as it was logged."""
        turned = self.means.get("speed", self.means.get("velocity"))
        return np.ones(self.torque.size) if turned is None else np.sign(turned)


def stages_of_loss(cascade: Cascade) -> tuple[str, str]:
    """Neighbouring stages between which no energy is stored: the shaft and its electrical neighbour.

    Raises
    ------
    RigError : the cascade has none
    """
    for pair in pairwise(cascade.names):
        if "mech" in pair and not set(pair) & set(STORING):
            return pair
    raise RigError(
        f"a loss map needs the shaft (mech) beside an electrical stage; the cascade is {' to '.join(cascade.names)}, and "
        "between line or hydraulics and shaft energy is stored. Add mech and gen or ac under [cascade]."
    )


def loss_points(reduction: Reduction) -> LossPoints:
    """Operating points of one log: its steps, or blocks of its payouts in which the clutch drives the generator.

    Raises
    ------
    RigError : the cascade has no stages without storage between them
    LogError : the log lacks a power, or no point is left
    """
    run, rig = reduction.run, reduction.rig
    stages = stages_of_loss(rig.cascade)
    of = {stage.name: stage for stage in rig.cascade.stages}
    powers = [of[name].stream(run.channels, rig.r_drum) for name in stages]
    made_of = [of[name].power(run.channels, rig.r_drum) for name in stages]
    speed = shaft_speed(run, rig)
    if powers[0] is None or powers[1] is None or made_of[0] is None or made_of[1] is None or speed is None:
        lacking = [name for name, power in zip(stages, powers, strict=True) if power is None] or ["speed of the shaft"]
        raise LogError(f"{run.name}: no loss map, as the log lacks {' and '.join(lacking)}; log the channels of it.")
    spans, cycle = _spans(reduction)
    stream, shaft = (powers[0], made_of[0]) if stages[0] == "mech" else (powers[1], made_of[1])
    torque = _torque(run, speed, stream) * _counted(shaft)
    length = spans[:, 1] - spans[:, 0]
    rate = _stored(run, rig, speed, spans) / length
    t = run.t
    found = LossPoints(
        stages=stages,
        torque=means(t, torque.__getitem__, spans),
        speed=means(t, speed.__getitem__, spans),
        power_in=means(t, powers[0], spans),
        power_out=means(t, powers[1], spans),
        stored=rate,
        columns=_mean_columns(t, torque, speed, spans),
        means={
            name: means(t, run.channels[name].__getitem__, spans)
            for name in dict.fromkeys(
                (*made_of[0].channels, *made_of[1].channels, "speed" if "speed" in run.channels else "velocity")
            )
        },
        made_of=(made_of[0], made_of[1]),
        duration=length,
        cycle=cycle,
        log=np.zeros(len(spans), dtype=np.intp),
        logs=(run.name,),
        left_out={},
    )
    return _usable(found, run, rig, speed, spans)


def joined(parts: Sequence[LossPoints]) -> LossPoints:
    """Points of several logs of one rig together."""
    first = parts[0]
    arrays = ("torque", "speed", "power_in", "power_out", "stored", "columns", "duration")
    past = np.cumsum([0, *(int(part.cycle.max()) + 1 for part in parts)])
    left_out: dict[str, int] = {}
    for part in parts:
        for reason, count in part.left_out.items():
            left_out[reason] = left_out.get(reason, 0) + count
    return msgspec.structs.replace(
        first,
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in arrays},
        means={
            name: np.concatenate([part.means[name] for part in parts])
            for name in first.means
            if all(name in part.means for part in parts)
        },
        cycle=np.concatenate([part.cycle + offset for part, offset in zip(parts, past, strict=False)]),
        log=np.concatenate([np.full(part.log.size, k) for k, part in enumerate(parts)]),
        logs=tuple(name for part in parts for name in part.logs),
        left_out=left_out,
    )


def shaft_speed(run: Run, rig: Rig) -> Signal | None:
    """Speed of the shaft with the torque sensor, (n,) [rad/s]: as logged, else of the drum; None where neither is known."""
    if "speed" in run.channels:
        return run.channels["speed"]
    if "velocity" in run.channels and rig.r_drum is not None:
        return run.channels["velocity"] / rig.r_drum
    return None


def _torque(run: Run, speed: Signal, mech: Stream) -> Signal:
    """Torque of the shaft, (n,) [N m]: as logged, else power over speed while the shaft turns."""
    if "torque" in run.channels:
        return run.channels["torque"]
    turning = np.abs(speed) > TURNING
    return np.where(turning, mech(slice(None)) / np.where(turning, speed, 1.0), 0.0)


def _counted(power: Power) -> float:
    """Sign by which a rig file counts a logged torque: that of the power of the shaft made of it."""
    return next((math.copysign(1.0, term.constant) for term in power.terms if "torque" in term.channels), 1.0)


def _mean_columns(t: Signal, torque: Signal, speed: Signal, spans: Signal) -> Signal:
    """Means of the columns of the surface over spans, (k, 5)."""
    flip = np.where(speed < 0.0, -1.0, 1.0)

    def column(number: int) -> Stream:
        return lambda part: columns_at(torque[part] * flip[part], np.abs(speed[part]))[..., number]

    return np.stack([means(t, column(number), spans) for number in range(5)], axis=-1)


def _spans(reduction: Reduction) -> tuple[Signal, Index]:
    """Spans of the points, (k, 2) [s], and the number of the cycle of each."""
    complete = reduction.complete
    if in_spans(reduction.rig):
        spans = np.array([(c.window.onset, c.window.cutoff) for c in complete]).reshape(-1, 2)
        return spans, np.arange(len(complete))
    run, rig = reduction.run, reduction.rig
    plateaus = [c.summary.payout.plateau for c in complete]
    driven = engaged(run, [c.phases for c in complete], plateaus, rig)
    if not rig.drivetrain.one_way_clutch:
        driven |= _hauled(reduction)
    spans = _blocks(run.t, driven)
    begins = np.array([c.phases.onset for c in complete])
    return spans, np.searchsorted(begins, spans[:, 0], side="right") - 1


def in_spans(rig: Rig) -> bool:
    """Whether each cycle is a point of its own, not a motion that is cut into blocks."""
    return not rig.phases.by_motion and rig.phases.source != "waves"


def _hauled(reduction: Reduction) -> Mask:
    """Samples of the haul-ins, in which a machine without a one-way clutch is driven too; bridged ones are left out."""
    run = reduction.run
    driven = np.zeros(run.t.size, dtype=bool)
    for cycle in reduction.complete:
        if cycle.phases.haul_in is not None:
            first, last = np.searchsorted(run.t, cycle.phases.haul_in)
            driven[first:last] = True
    for before, after in all_gaps(run, reduction.rig.cascade.channels):
        driven[np.searchsorted(run.t, before, side="right") : np.searchsorted(run.t, after, side="left")] = False
    return driven


def _blocks(t: Signal, driven: Mask) -> Signal:
    """Cut each stretch of driven samples into blocks of equal length near `BLOCK`, (k, 2) [s]; shorter ones are left out."""
    edges = stretches_of(driven)
    spans = []
    for first, stop in edges.tolist():
        begin, end = float(t[first]), float(t[stop - 1])
        count = int((end - begin) / BLOCK)
        spans += list(pairwise(np.linspace(begin, end, count + 1).tolist())) if count else []
    return np.array(spans).reshape(-1, 2)


def _stored(run: Run, rig: Rig, speed: Signal, spans: Signal) -> Signal:
    """Change of the energy of rotor, shaft spring and DC-link capacitor over each span, (k,) [J]; 0 for what is not known."""
    inertia, spring, capacitor = shaft_inertia(rig), rig.drivetrain.k_shaft, rig.dc_link.c_dc
    apart = in_spans(rig)
    energy = np.zeros(len(spans))
    if inertia is not None:
        energy += 0.5 * inertia * _change(_at_ends(run.t, speed, spans, apart=apart) ** 2)
    if spring is not None and spring.value > 0.0 and "torque" in run.channels:
        energy += 0.5 / spring.value * _change(_at_ends(run.t, run.channels["torque"], spans, apart=apart) ** 2)
    if capacitor is not None and "vdc" in run.channels and "gen" in stages_of_loss(rig.cascade):
        energy += 0.5 * capacitor.value * _change(_at_ends(run.t, run.channels["vdc"], spans, apart=apart) ** 2)
    return energy


def _change(ends: Signal) -> Signal:
    """Last less first of each pair, (k,)."""
    return ends[:, 1] - ends[:, 0]


def _at_ends(t: Signal, x: Signal, spans: Signal, *, apart: bool) -> Signal:
    """A signal at the ends of each span, smoothed, (k, 2).

    Spans that are `apart` are smoothed each for itself: beside a step of a dynamometer lies another speed.
    """
    if not apart:
        return np.interp(spans, t, local_quadratic(t, x, SMOOTHING))
    ends = np.empty(spans.shape)
    rows = np.searchsorted(t, spans)
    for k, (first, last) in enumerate(rows.tolist()):
        of = slice(first, last + 1)
        ends[k] = np.interp(spans[k], t[of], local_quadratic(t[of], x[of], SMOOTHING))
    return ends


def shaft_inertia(rig: Rig) -> float | None:
    """Inertia between torque sensor and machine as the shaft feels it, None where it is unknown. [kg m2]"""
    rotor, gear = rig.drivetrain.inertia_rotor, rig.drivetrain.gear_ratio
    return None if rotor is None else rotor.value * (1.0 if gear is None else gear.value) ** 2


def _usable(points: LossPoints, run: Run, rig: Rig, speed: Signal, spans: Signal) -> LossPoints:
    """Points at which the shaft turns, and does so steadily where its inertia is unknown; LogError without any."""
    resting = np.abs(points.speed) < TURNING
    unsteady = np.zeros(resting.size, dtype=bool)
    if shaft_inertia(rig) is None and len(spans):
        change = _change(_at_ends(run.t, speed, spans, apart=in_spans(rig)))
        unsteady = ~resting & (np.abs(change) > STEADY * np.abs(points.speed) * points.duration)
    left_out = {
        "shaft at rest": int(resting.sum()),
        "speed changes and inertia_rotor is unknown": int(unsteady.sum()),
    }
    good = ~resting & ~unsteady
    if not good.any():
        why = (
            "; ".join(f"{count} with {reason}" for reason, count in left_out.items() if count) or "no cycle is complete"
        )
        raise LogError(
            f"{run.name}: no operating point for a loss map ({why}); expected steps or payouts in which the shaft turns."
        )
    flip = np.where(points.speed < 0.0, -1.0, 1.0)
    arrays = {
        name: getattr(points, name)[good]
        for name in ("power_in", "power_out", "stored", "columns", "duration", "cycle", "log")
    }
    return msgspec.structs.replace(
        points,
        **arrays,
        torque=(points.torque * flip)[good],
        speed=np.abs(points.speed)[good],
        means={name: x[good] for name, x in points.means.items()},
        left_out={reason: count for reason, count in left_out.items() if count},
    )
