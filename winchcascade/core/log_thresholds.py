"""Thresholds that a rig file does not state: shares of the scales of the logs that are read with
it.

The published rules are those of one crane: a payout begins at 0.03 m/s, which is a thirtieth of its
top speed. On a rig of another size the same rules are the same shares of its own speed, ramp,
stroke and torque.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.accuracy import CERTAIN, part_uncertainty
from winchcascade.core.integrate import GAUSS, median, quantile
from winchcascade.core.run import Finding
from winchcascade.core.scales import MotionScale, motion_of_log
from winchcascade.core.smooth import local_quadratic

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal

SHARES: Mapping[str, tuple[str, float, str]] = {
    "v_onset": ("speed", 1 / 30, "m/s"),
    "smoothing": ("ramp", 1.4, "s"),
    "stroke_min": ("stroke", 1 / 50, "m"),
    "plateau_hold": ("ramp", 0.47, "s"),
    "settle": ("ramp", 1.2, "s"),
    "tau_engaged": ("torque", 1 / 130, "N.m"),
    "gap_max": ("ramp", 2.35, "s"),
}
"""Scale, share of it, and unit of each threshold with a dimension: the crane of the paper, with a
top speed of 0.9 m/s, a ramp of 0.42 s, a stroke of 9.65 m and a rated torque of 265 N m, gets the
published rules."""

RPM_ONSET = 1 / 50
"""Share of the top speed of a shaft from which it turns: a test plan has operating points at a
twentieth of it. [1]
"""

TOP = 0.99
"""Quantile of the magnitude of a torque that is its top: single peaks leave it alone. [1]"""

IDLE_MAX = 1 / 20
"""Share of the torque up to which zero and noise of its sensor raise the threshold: a shaft that
drives gives more. [1]
"""

OF_RECORD = 1 / 100
"""Longest ramp of a log without a line, as a share of its length: a test plan in steps speeds up
step by step. [1]
"""

OF_TURN = 1 / 10
"""First width over which a displacement is smoothed, as a share of the time between its turning
points. [1]
"""

OF_RAMP = 0.5
"""And the next ones, as a share of the ramp that the one before shows: that by which a velocity
is derived. [1]
"""

WIDTHS = 6
"""Number of these widths: each brings the ramp at least halfway to its value."""

MOVES = 4.0
"""A line or a shaft moves, and a shaft drives, if the signal exceeds so many standard deviations of
its noise: noise alone has a top of two. [1]"""

FLICKER = 5.0
"""Shortest stroke in samples at the top speed: a last digit that flickers is no motion. [1]"""

SAMPLES = 20_000
"""Number of samples of a displacement, evenly over the log, from which a velocity is derived for
its scales.
"""


class LogScales(msgspec.Struct, frozen=True):
    """Scales of one log or of several; NaN where they show none. Speed and stroke of a line that
    rests are infinite: none of it counts as motion.

    Parameters
    ----------
    speed : top speed of the line [m/s]
    ramp : time in which it speeds up, else a share of the record [s]
    stroke : distance between the ends of its motion [m]
    torque : rated torque of the machine on the PTO shaft, else the top of the torque [N m]
    idle : torque that zero and noise of its sensor account for [N m]
    omega : top speed of the shaft [rad/s]
    """

    speed: float
    ramp: float
    stroke: float
    torque: float
    idle: float
    omega: float


def not_stated(rig: Rig) -> tuple[str, ...]:
    """Thresholds with a dimension that a rig does not state.

    >>> from winchcascade.core.rig_toml import built_in
    >>> not_stated(built_in("hsu2026"))
    ()
    """
    return tuple(name for name in SHARES if math.isnan(getattr(rig.thresholds, name)))


def is_complete(rig: Rig, channels: Collection[str]) -> bool:
    """Whether a rig states all thresholds that a log with some channels needs: those of the
    shaft where that is its motion.
    """
    by_shaft = "velocity" not in channels or rig.phases.source in ("speed", "steps")
    lacks_onset = math.isnan(rig.phases.rpm_onset)
    return not not_stated(rig) and not (by_shaft and "speed" in channels and lacks_onset)


def with_thresholds(rig: Rig, runs: Sequence[Run]) -> Rig:
    """Complete the thresholds of a rig by the scales of some runs; the rig itself where it states
    all of them.

    >>> from winchcascade.core.rig_toml import built_in
    >>> with_thresholds(built_in("hsu2026"), []) is built_in("hsu2026")
    True
    """
    if all(is_complete(rig, run.channels) for run in runs):
        return rig
    return completed(rig, together([log_scales(run.t, run.channels, rig) for run in runs]))


def completed(rig: Rig, scales: LogScales) -> Rig:
    """Complete the thresholds of a rig and of its shaft by some scales; those of a quantity that
    no log has remain NaN.
    """
    values = {name: value for name, value in shares_of(scales).items() if name in not_stated(rig)}
    onset = rig.phases.rpm_onset
    onset = RPM_ONSET * scales.omega * 30.0 / math.pi if math.isnan(onset) else onset
    phases = replace(rig.phases, rpm_onset=onset)
    return replace(rig, thresholds=replace(rig.thresholds, **values), phases=phases)


def shares_of(scales: LogScales) -> dict[str, float]:
    """Thresholds by some scales, in SI units; NaN or infinite where a scale is."""
    values = {name: share * getattr(scales, scale) for name, (scale, share, _) in SHARES.items()}
    return values | {
        "tau_engaged": max(values["tau_engaged"], min(scales.idle, IDLE_MAX * scales.torque))
    }


def together(scales: Sequence[LogScales]) -> LogScales:
    """Scales of several logs: the largest speed, the median of the others."""
    known = {
        name: [value for one in scales if not math.isnan(value := getattr(one, name))]
        for name in LogScales.__struct_fields__
    }
    middle = {
        name: median(np.array(values)) if values else math.nan for name, values in known.items()
    }
    return LogScales(**middle | {"speed": max(known["speed"], default=math.nan)})


def log_scales(t: Signal, channels: Mapping[str, Signal], rig: Rig) -> LogScales:
    """Scales of one log.

    The motion is the velocity of the line, else the slope of its displacement, else the speed of
    the shaft. Without a drum radius that gives times alone; a log without motion has those of its
    record.

    Parameters
    ----------
    t, channels : (n,) stamps that rise [s] and channels in SI units, NaN where samples are lost
    """
    torque, idle = rated_torque(rig), CERTAIN * part_uncertainty(rig.sensors.get("torque"), "zero")
    read = channels.get("torque", np.empty(0))
    read = read[np.isfinite(read)]
    if read.any():
        torque = quantile(np.abs(read), TOP) if math.isnan(torque) else torque
        idle = max(idle, MOVES * _noise(read))
    longest = OF_RECORD * float(t[-1] - t[0]) if t.size > 1 else math.nan
    line, shaft = (
        _line_motion(t, channels),
        _moving(t, channels["speed"]) if "speed" in channels else None,
    )
    if shaft is not None and shaft.stroke < 2.0 * math.pi * rig.phases.turns_min:
        shaft = None
    omega = math.nan
    if "speed" in channels:
        omega = math.inf if shaft is None else shaft.speed
    if line is not None:
        return LogScales(line.speed, line.ramp, line.stroke, torque, idle, omega)
    radius = math.nan if rig.r_drum is None else rig.r_drum
    if shaft is not None:
        ramp = min(shaft.ramp, longest)
        return LogScales(shaft.speed * radius, ramp, shaft.stroke * radius, torque, idle, omega)
    rests = math.nan if channels.keys().isdisjoint({"velocity", "displacement"}) else math.inf
    return LogScales(rests, longest, rests, torque, idle, omega)


def rated_torque(rig: Rig) -> float:
    """Torque of the machine on the PTO shaft at its rated current; NaN where the rig file lacks a
    number of it. [N m]

    >>> from winchcascade.core.rig_toml import built_in
    >>> round(rated_torque(built_in("hsu2026")))
    265
    """
    machine, gear = rig.generator, rig.drivetrain.gear_ratio
    if machine.k_e is None or machine.i_rated is None or gear is None:
        return math.nan
    return math.sqrt(3.0) * machine.k_e.value * 30.0 / math.pi * machine.i_rated.value * gear.value


def _line_motion(t: Signal, channels: Mapping[str, Signal]) -> MotionScale | None:
    """Motion of the line by its velocity, else by its displacement; None where it rests or is
    unknown.
    """
    found = _moving(t, channels["velocity"]) if "velocity" in channels else None
    return found or (
        motion_of_displacement(t, channels["displacement"]) if "displacement" in channels else None
    )


def _moving(t: Signal, v: Signal) -> MotionScale | None:
    """Motion by a velocity or a speed that contains more than noise."""
    found = motion_of_log(t, v)
    if found is None or found.speed <= MOVES * _noise(v[np.isfinite(v)]):
        return None
    return found if found.stroke > FLICKER * found.speed * median(np.diff(t)) else None


def _noise(x: Signal) -> float:
    """Standard deviation of the white noise of a signal by its fourth differences, 0 where it
    repeats its values.
    """
    return float(GAUSS * median(np.abs(np.diff(x, 4))) / math.sqrt(70.0)) if x.size > 4 else 0.0


def motion_of_displacement(t: Signal, x: Signal) -> MotionScale | None:
    """Scales of a motion by a displacement, whose slope is smoothed over narrower and narrower
    widths; None where it rests.

    A narrow width at once would show the steps of the encoder and no motion.
    """
    known = np.isfinite(x)
    every = max(1, t.size // SAMPLES)
    t, x = t[known][::every], x[known][::every]
    turns = _turns(x)
    if x.size < 3 or not turns or np.ptp(x) < 4.0 * MOVES * _noise(x):
        return None
    width, found = OF_TURN * float(t[-1] - t[0]) / turns, None
    for _ in range(WIDTHS):
        found = motion_of_log(t, np.gradient(local_quadratic(t, x, width), t))
        if found is None:
            return None
        width = OF_RAMP * found.ramp
    return found


def _turns(x: Signal) -> int:
    """How often a displacement passes from one third of its range to the other."""
    low, high = (float(np.min(x)), float(np.max(x))) if x.size else (0.0, 0.0)
    third = (high - low) / 3.0
    side = (x > high - third).astype(np.int8) - (x < low + third).astype(np.int8)
    side = side[side != 0]
    return int(np.count_nonzero(np.diff(side))) if third > 0.0 else 0


def thresholds_finding(rig: Rig, complete: Rig) -> Finding | None:
    """The thresholds that a rig file does not state, with the values that the motion of a log gave
    them.

    None where the file states those of the motion, or where no line moves. A torque that zero and
    noise of its sensor may give is no motion.
    """
    named = [
        (name, getattr(complete.thresholds, name), SHARES[name][2]) for name in not_stated(rig)
    ]
    values = [f"{name} {value:.3g} {unit}" for name, value, unit in named if math.isfinite(value)]
    if not {*not_stated(rig)} - {"tau_engaged"} or not math.isfinite(complete.thresholds.v_onset):
        return None
    message = f"the rig file does not state all thresholds; by motion and torque of this log they are {', '.join(values)}"
    action = (
        "used; state them under [thresholds] of the rig file, as `winchcascade init` drafts them"
    )
    return Finding("thresholds_assumed", message, action)


def thresholds_text(scales: LogScales, source: str) -> str:
    """Table [thresholds] of a rig file by some scales; empty where no line moves.

    Parameters
    ----------
    source : what the scales are of
    """
    values = shares_of(scales)
    if not math.isfinite(scales.speed):
        return ""
    lines = ["[thresholds]"]
    for name, (scale, share, unit) in SHARES.items():
        if math.isfinite(values[name]):
            part = f"1/{1.0 / share:.0f}" if share < 0.1 else f"{share:g}"
            about = f'source = "{part} of the {scale} of {source}"'
            lines.append(
                f'{name} = {{ value = {float(f"{values[name]:.2g}")}, unit = "{unit}", {about} }}'
            )
    return "\n".join(lines) + "\n"
