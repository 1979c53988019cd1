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

from winchcascade.core.accuracy import error_sources
from winchcascade.core.cascade import Cascade, Power
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.integrate import means_of, stretches_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Index, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.bins import engaged
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import Reduction

STORING = ("line", "hyd")
"""Stages next to which gas, oil or inertia store energy: no loss follows from their power at an instant."""

BLOCK_LENGTH = 5 / 6
"""Length of the blocks of a motion as a share of the width that smooths the velocity: longer than the ringing of the shaft,
shorter than the acceleration of a crane. [1]"""

SMOOTHING = 11 / 15
"""Width of the local quadratic that gives speed and voltage at the ends of a block, from which stored energy follows, as a
share of the same. [1]"""

TURNING = 2.0
"""Mean speed from which the shaft turns, in onset speeds: below, bearings stick and resolution decides. [1]"""

SPEED_CHANGE_MAX = 0.012
"""Largest change of the speed within a point, as a share of the speed, in the time of that width, where the inertia is unknown.
[1]"""


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
    errors : (k, s, 6) what each of s errors of the sensors, of one standard uncertainty, changes of loss [W] and columns
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
    errors: Signal
    duration: Signal
    cycle: Index
    log: Index
    logs: tuple[str, ...]
    left_out: Mapping[str, int]

    @property
    def loss(self) -> Signal:
        """Power that is lost at each point. [W]"""
        return self.power_in - self.power_out - self.stored


ROWS = ("torque", "speed", "power_in", "power_out", "stored", "columns", "errors", "duration", "cycle", "log")
"""Fields of some points that have a row for each."""


def joined(parts: Sequence[LossPoints]) -> LossPoints:
    """Points of several logs of one rig together."""
    past = np.cumsum([0, *(int(part.cycle.max()) + 1 for part in parts)]).tolist()
    parts = [
        msgspec.structs.replace(part, cycle=part.cycle + past[k], log=np.full(part.log.size, k))
        for k, part in enumerate(parts)
    ]
    left_out: Counter[str] = sum((Counter(part.left_out) for part in parts), Counter())
    return msgspec.structs.replace(
        parts[0],
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in ROWS},
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

    Points at which the shaft rests, or at which it changes its speed with an inertia that is unknown, are left out.

    Raises
    ------
    RigError : the cascade has no stages without storage between them
    LogError : the log lacks a power, or no point is left
    """
    run, rig = reduction.run, reduction.rig
    stages = stages_of_loss(rig.cascade)
    powers = {s.name: power for s in rig.cascade.stages if (power := s.power(run.channels, rig.r_drum)) is not None}
    lacking = [name for name in stages if name not in powers]
    if "speed" not in run.channels and ("velocity" not in run.channels or rig.r_drum is None):
        lacking = lacking or ["speed of the shaft"]
    if lacking:
        raise LogError(f"{run.name}: no loss map, as the log lacks {' and '.join(lacking)}; log the channels of it.")
    spans, cycle = _spans(reduction)
    between = powers[stages[0]], powers[stages[1]]
    found, length = _points(reduction, between, run.channels, spans), np.ptp(spans, axis=1)
    change = np.ptp(_at_ends(reduction, _shaft_speed(run.channels, rig), spans), axis=1)
    allowed = SPEED_CHANGE_MAX * found[:, 1] * length / rig.thresholds.smoothing
    unsteady = (change > allowed) & (rig.drivetrain.inertia_rotor is None)
    resting = found[:, 1] < TURNING * onset_of_shaft(rig)
    reasons = {"shaft at rest": resting, "speed changes and inertia_rotor is unknown": unsteady & ~resting}
    left_out = {reason: int(of.sum()) for reason, of in reasons.items() if of.any()}
    good = ~resting & ~unsteady
    if not good.any():
        why = "; ".join(f"{count} with {reason}" for reason, count in left_out.items()) or "no cycle is complete"
        raise LogError(
            f"{run.name}: no operating point for a loss map ({why}); expected steps or payouts in which the shaft turns."
        )
    found, spans, errors = found[good], spans[good], []
    for source in (source for name, sensor in rig.sensors.items() for source in error_sources(name, sensor)):
        wrong = dict(run.channels)
        if (x := wrong.get(source.channel)) is not None:
            wrong[source.channel] = x * (1.0 + source.u) if source.part == "gain" else x + source.u
        changed = _points(reduction, between, wrong, spans) - found
        errors.append(np.column_stack((changed[:, 2] - changed[:, 3] - changed[:, 4], changed[:, 5:])))
    torque, speed, power_in, power_out, stored = found.T[:5]
    return LossPoints(
        stages=stages,
        torque=torque,
        speed=speed,
        power_in=power_in,
        power_out=power_out,
        stored=stored,
        columns=found[:, 5:],
        errors=np.reshape(errors, (-1, len(found), 6)).swapaxes(0, 1),
        duration=length[good],
        cycle=cycle[good],
        log=np.zeros(len(found), dtype=np.intp),
        logs=(run.name,),
        left_out=left_out,
    )


def _points(reduction: Reduction, powers: tuple[Power, Power], channels: Mapping[str, Signal], spans: Signal) -> Signal:
    """Torque, speed, power in, power out, stored power and the columns of the surface over spans, (k, 10), by some channels."""
    t, rig = reduction.run.t, reduction.rig
    speed = _shaft_speed(channels, rig)
    watts = [power.stream(channels, rig.r_drum)(slice(None)) for power in powers]
    mech = stages_of_loss(rig.cascade).index("mech")
    turning = np.abs(speed) > TURNING * onset_of_shaft(rig)
    torque = np.where(turning, watts[mech] / np.where(turning, speed, 1.0), 0.0)
    torque = channels.get("torque", torque)
    # A rig file may count a logged torque with the other sign, by that of the power of the shaft made of it.
    counted = next((term.constant for term in powers[mech].terms if "torque" in term.channels), 1.0)
    torque = torque * math.copysign(1.0, counted)
    columns = columns_at(torque * np.where(speed < 0.0, -1.0, 1.0), np.abs(speed)).T
    means = means_of(t, [x.__getitem__ for x in (torque, speed, *watts, *columns)], spans)
    turned = np.where(means[1] < 0.0, -1.0, 1.0)
    parts = rig.drivetrain.inertia_rotor, rig.drivetrain.gear_ratio, rig.drivetrain.k_shaft, rig.dc_link.c_dc
    rotor, gear, spring, capacitor = (None if number is None else number.value for number in parts)
    stores = [((rotor or 0.0) * (1.0 if gear is None else gear) ** 2, speed)]  # as the shaft feels the inertia
    if spring and "torque" in channels:
        stores.append((1.0 / spring, channels["torque"]))
    if capacitor is not None and "vdc" in channels and "gen" in stages_of_loss(rig.cascade):
        stores.append((capacitor, channels["vdc"]))
    energy = [0.5 * size * np.diff(_at_ends(reduction, x, spans) ** 2, axis=1)[:, 0] for size, x in stores]
    stored = np.sum(energy, axis=0) / np.ptp(spans, axis=1)
    return np.column_stack((means[0] * turned, np.abs(means[1]), means[2], means[3], stored, means[4:].T))


def onset_of_shaft(rig: Rig) -> float:
    """Onset speed of the line at the drum, else that of a shaft without a line. [rad/s]"""
    line = math.inf if rig.r_drum is None else rig.thresholds.v_onset / rig.r_drum
    return line if math.isfinite(line) else rig.phases.omega_onset


def _shaft_speed(channels: Mapping[str, Signal], rig: Rig) -> Signal:
    """Speed of the shaft with the torque sensor, (n,): as logged, else of the drum. [rad/s]"""
    return channels["speed"] if "speed" in channels else channels["velocity"] / (rig.r_drum or math.nan)


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
        count = int((end - begin) / (BLOCK_LENGTH * rig.thresholds.smoothing) + 1e-6)
        spans += pairwise(np.linspace(begin, end, count + 1).tolist() if count else [])
    blocks = np.array(spans).reshape(-1, 2)
    return blocks, np.searchsorted([c.phases.onset for c in complete], blocks[:, 0], side="right") - 1


def _apart(rig: Rig) -> bool:
    """Whether each cycle is a point of its own, not a motion that is cut into blocks."""
    return not rig.phases.by_motion and rig.phases.source != "waves"


def _at_ends(reduction: Reduction, x: Signal, spans: Signal) -> Signal:
    """A signal at the ends of each span, smoothed, (k, 2).

    Cycles that are points of their own are smoothed each for itself: beside a step of a dynamometer lies another speed.
    """
    t, width = reduction.run.t, SMOOTHING * reduction.rig.thresholds.smoothing
    if not _apart(reduction.rig):
        return np.interp(spans, t, local_quadratic(t, x, width))
    ends = np.empty(spans.shape)
    for k, (first, last) in enumerate(np.searchsorted(t, spans).tolist()):
        of = slice(first, last + 1)
        ends[k] = np.interp(spans[k], t[of], local_quadratic(t[of], x[of], width))
    return ends
