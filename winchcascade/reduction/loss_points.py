"""Operating points of the machine between two stages without storage: means over steps, or over blocks of a motion.

A speed below zero is counted as above zero, and the torque with it: a machine that turns the other way loses as much.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise

import msgspec
import numpy as np

from winchcascade.core.accuracy import Part
from winchcascade.core.cascade import Cascade, Power
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.integrate import means, means_of, stretches_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Index, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.bins import engaged
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import Reduction

STORING = ("line", "hyd")
"""Stages next to which gas, oil or inertia store energy: no loss follows from their power at an instant."""

BLOCK_LENGTH = 0.5
"""Length of the blocks of a motion: longer than the ringing of the shaft, shorter than the acceleration of a crane. [s]"""

SMOOTHING = 0.44
"""Width of the local quadratic that gives speed and voltage at the ends of a block, from which stored energy follows. [s]"""

TURNING = 0.5
"""Mean speed from which the shaft turns: below, bearings stick and resolution decides. [rad/s]"""

SPEED_CHANGE_MAX = 0.02
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
        error = size * self.means[channel] if part == "gain" else np.full(self.torque.size, size)
        powers = [self.power_in, self.power_out]
        for k, made_of in enumerate(self.made_of):
            for term in made_of.terms:
                if channel in term.channels:
                    r_drum = np.abs(self.means["velocity"]) / self.speed if term.by_radius else 1.0
                    others = [self.means[name] for name in term.channels if name != channel]
                    powers[k] = powers[k] + term.constant * error * math.prod(others) / r_drum
        logged = self.means.get("speed", self.means.get("velocity"))
        turns = 1.0 if logged is None else np.sign(logged)  # a speed below zero is counted as above zero
        torque, speed = self.torque, self.speed
        if channel == "torque":
            torque = torque + error * turns * _counted(self.made_of[self.stages.index("mech")])
        elif channel == "speed":
            speed = speed + error * turns
        elif channel == "velocity" and "speed" not in self.means:
            speed = speed * (1.0 + error / self.means[channel])
        columns = self.columns + columns_at(torque, speed) - columns_at(self.torque, self.speed)
        return msgspec.structs.replace(
            self, torque=torque, speed=speed, power_in=powers[0], power_out=powers[1], columns=columns
        )


ROWS = ("torque", "speed", "power_in", "power_out", "stored", "columns", "duration", "cycle", "log")
"""Fields of some points that have a row for each."""


def joined(parts: Sequence[LossPoints]) -> LossPoints:
    """Points of several logs of one rig together."""
    past = np.cumsum([0, *(int(part.cycle.max()) + 1 for part in parts)])
    parts = [
        msgspec.structs.replace(part, cycle=part.cycle + int(past[k]), log=np.full(part.log.size, k))
        for k, part in enumerate(parts)
    ]
    shared = set.intersection(*(set(part.means) for part in parts))
    left_out: Counter[str] = sum((Counter(part.left_out) for part in parts), Counter())
    return msgspec.structs.replace(
        parts[0],
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in ROWS},
        means={name: np.concatenate([p.means[name] for p in parts]) for name in parts[0].means if name in shared},
        logs=tuple(name for part in parts for name in part.logs),
        left_out=dict(left_out),
    )


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
    run, rig, t = reduction.run, reduction.rig, reduction.run.t
    stages = stages_of_loss(rig.cascade)
    made_of = {s.name: s.power(run.channels, rig.r_drum) for s in rig.cascade.stages if s.name in stages}
    into, out, speed = made_of[stages[0]], made_of[stages[1]], _shaft_speed(run, rig)
    if into is None or out is None or speed is None:
        lacking = [name for name in stages if made_of[name] is None] or ["speed of the shaft"]
        raise LogError(f"{run.name}: no loss map, as the log lacks {' and '.join(lacking)}; log the channels of it.")
    powers = [power.stream(run.channels, rig.r_drum) for power in (into, out)]
    torque = run.channels.get("torque")
    if torque is None:
        turning = np.abs(speed) > TURNING
        torque = np.where(turning, powers[stages.index("mech")](slice(None)) / np.where(turning, speed, 1.0), 0.0)
    torque = torque * _counted((into, out)[stages.index("mech")])
    spans, cycle = _spans(reduction)
    length, sign = np.ptp(spans, axis=1), np.where(speed < 0.0, -1.0, 1.0)
    columns = [column.__getitem__ for column in columns_at(torque * sign, np.abs(speed)).T]
    mean_torque, mean_speed = means_of(t, [torque.__getitem__, speed.__getitem__], spans)
    power_in, power_out = means_of(t, powers, spans)
    names = dict.fromkeys((*into.channels, *out.channels, "speed" if "speed" in run.channels else "velocity"))
    found = LossPoints(
        stages=stages,
        torque=mean_torque * np.where(mean_speed < 0.0, -1.0, 1.0),
        speed=np.abs(mean_speed),
        power_in=power_in,
        power_out=power_out,
        stored=_stored(run, rig, speed, spans) / length,
        columns=means_of(t, columns, spans).T,
        means={name: means(t, run.channels[name].__getitem__, spans) for name in names},
        made_of=(into, out),
        duration=length,
        cycle=cycle,
        log=np.zeros(len(spans), dtype=np.intp),
        logs=(run.name,),
        left_out={},
    )
    return _usable(found, np.ptp(_at_ends(run, rig, speed, spans), axis=1), rig)


def _shaft_speed(run: Run, rig: Rig) -> Signal | None:
    """Speed of the shaft with the torque sensor, (n,) [rad/s]: as logged, else of the drum; None where neither is known."""
    if "speed" in run.channels:
        return run.channels["speed"]
    if "velocity" in run.channels and rig.r_drum is not None:
        return run.channels["velocity"] / rig.r_drum
    return None


def _counted(power: Power) -> float:
    """Sign by which a rig file counts a logged torque: that of the power of the shaft made of it."""
    return next((math.copysign(1.0, term.constant) for term in power.terms if "torque" in term.channels), 1.0)


def _spans(reduction: Reduction) -> tuple[Signal, Index]:
    """Spans of the points, (k, 2) [s], and the number of the cycle of each."""
    run, rig, complete = reduction.run, reduction.rig, reduction.complete
    if _apart(rig):
        windows = np.array([(c.window.onset, c.window.cutoff) for c in complete])
        return windows.reshape(-1, 2), np.arange(len(complete))
    driven = engaged(run, [c.phases for c in complete], [c.summary.payout.plateau for c in complete], rig)
    hauls = [c.phases.haul_in for c in complete if c.phases.haul_in is not None]
    if not rig.drivetrain.one_way_clutch:
        for first, last in np.searchsorted(run.t, np.array(hauls).reshape(-1, 2)).tolist():
            driven[first:last] = True
        for before, after in all_gaps(run, rig.cascade.channels):
            driven[np.searchsorted(run.t, before, side="right") : np.searchsorted(run.t, after, side="left")] = False
    spans: list[tuple[float, float]] = []
    for first, stop in stretches_of(driven).tolist():  # cut into blocks of equal length
        begin, end = float(run.t[first]), float(run.t[stop - 1])
        count = int((end - begin) / BLOCK_LENGTH)
        spans += pairwise(np.linspace(begin, end, count + 1).tolist() if count else [])
    blocks = np.array(spans).reshape(-1, 2)
    return blocks, np.searchsorted([c.phases.onset for c in complete], blocks[:, 0], side="right") - 1


def _apart(rig: Rig) -> bool:
    """Whether each cycle is a point of its own, not a motion that is cut into blocks."""
    return not rig.phases.by_motion and rig.phases.source != "waves"


def _stored(run: Run, rig: Rig, speed: Signal, spans: Signal) -> Signal:
    """Change of the energy of rotor, shaft spring and DC-link capacitor over each span, (k,) [J]; 0 for what is not known."""
    spring, capacitor = rig.drivetrain.k_shaft, rig.dc_link.c_dc
    stores = [(_shaft_inertia(rig) or 0.0, speed)]
    if spring is not None and spring.value > 0.0 and "torque" in run.channels:
        stores.append((1.0 / spring.value, run.channels["torque"]))
    if capacitor is not None and "vdc" in run.channels and "gen" in stages_of_loss(rig.cascade):
        stores.append((capacitor.value, run.channels["vdc"]))
    squares = [(size, _at_ends(run, rig, x, spans) ** 2) for size, x in stores]
    return np.asarray(sum(0.5 * size * (ends[:, 1] - ends[:, 0]) for size, ends in squares))


def _at_ends(run: Run, rig: Rig, x: Signal, spans: Signal) -> Signal:
    """A signal at the ends of each span, smoothed, (k, 2).

    Cycles that are points of their own are smoothed each for itself: beside a step of a dynamometer lies another speed.
    """
    if not _apart(rig):
        return np.interp(spans, run.t, local_quadratic(run.t, x, SMOOTHING))
    ends = np.empty(spans.shape)
    for k, (first, last) in enumerate(np.searchsorted(run.t, spans).tolist()):
        of = slice(first, last + 1)
        ends[k] = np.interp(spans[k], run.t[of], local_quadratic(run.t[of], x[of], SMOOTHING))
    return ends


def _shaft_inertia(rig: Rig) -> float | None:
    """Inertia between torque sensor and machine as the shaft feels it, None where it is unknown. [kg m2]"""
    rotor, gear = rig.drivetrain.inertia_rotor, rig.drivetrain.gear_ratio
    return None if rotor is None else rotor.value * (1.0 if gear is None else gear.value) ** 2


def _usable(points: LossPoints, change: Signal, rig: Rig) -> LossPoints:
    """Points at which the shaft turns, and does so steadily where its inertia is unknown; LogError without any.

    Parameters
    ----------
    change : of the speed within each point, (k,) [rad/s]
    """
    resting = points.speed < TURNING
    unsteady = ~resting & (change > SPEED_CHANGE_MAX * points.speed * points.duration) & (_shaft_inertia(rig) is None)
    reasons = {"shaft at rest": resting, "speed changes and inertia_rotor is unknown": unsteady}
    left_out = {reason: int(of.sum()) for reason, of in reasons.items() if of.any()}
    good = ~resting & ~unsteady
    if not good.any():
        why = "; ".join(f"{count} with {reason}" for reason, count in left_out.items()) or "no cycle is complete"
        raise LogError(
            f"{points.logs[0]}: no operating point for a loss map ({why}); expected steps or payouts in which the shaft turns."
        )
    return msgspec.structs.replace(
        points,
        **{name: getattr(points, name)[good] for name in ROWS},
        means={name: x[good] for name, x in points.means.items()},
        left_out=left_out,
    )
