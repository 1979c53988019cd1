"""A simulation of the owner at the stamps of its log, with the lag of its clock."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import rms
from winchcascade.core.quantity import UNITS, unit_names
from winchcascade.core.scales import motion_of_runs
from winchcascade.core.smooth import local_quadratic
from winchcascade.diagnosis.fit.block_means import Blocks, blocks_of
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.rig.line_velocity import SMOOTHING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal


VELOCITY_DIFFERENCE_MAX = 0.01
"""Maximum rms difference of the velocities of log and simulation, as a share of the rms
velocity. [1]
"""


SHIFT_MIN = 0.1
"""Smaller shifts between log and simulation, in intervals of the log, are noise of the velocity
and count as none. [1]
"""


AT_REST_BEYOND = 1.5
"""Number of intervals before the beginning and after the end of a simulation beyond which its
line is at rest. [1]
"""


SHIFT_SEARCHED, SHIFT_TOLERANCE = 0.64, 1e-5
"""The shift is refined within the first of these, as the correlation of logs that begin or end
within a motion deviates, and to the second, both over the ramp of the motion. [1]"""


SAMPLES_PER_STAMP_MIN = 1.5
"""Minimum number of samples of a simulation for each of the log from which it is averaged over
the intervals of the log. [1]
"""


LEVEL_RATIO_MAX = 5.0
"""Ratio of the levels of a simulated channel and its log, or its inverse, that shows another unit
than the assumed one: bar and kg/cm2 are too close, newton and kilogram-force are not. [1]"""


# ---------------------------------------------------------------------- at the stamps of the logs
def on_the_logs(
    simulations: Sequence[Run],
    logs: Sequence[Run],
    rig: Rig,
    cycles: Sequence[tuple[int, int] | None],
) -> list[Run]:
    """Bring the simulation of each run to the stamps of its log.

    Parameters
    ----------
    cycles : of each run, the first and last cycle that count, None for all

    Raises
    ------
    LogError : as `onto_log`, or a unit that was assumed is another one
    """
    found = []
    for simulation, log, span in zip(simulations, logs, cycles, strict=True):
        blocks = blocks_of(log, rig, motion_of_runs([log]).ramp, span)
        counted = slice(int(blocks.start[0]), int(blocks.stop[-1])) if blocks.size else slice(None)
        there = onto_log(simulation, log, counted)
        _check_levels(there, log, rig, blocks)
        found.append(there)
    return found


def onto_log(simulation: Run, log: Run, counted: slice) -> Run:
    """Bring a simulation to the stamps of its log.

    Parameters
    ----------
    counted : samples of the log whose cycles count

    Raises
    ------
    LogError : the simulation lacks a channel that the log has, or has another line motion
    """
    missing = [
        name for name in CHANNELS if name in log.channels and name not in simulation.channels
    ]
    if missing:
        raise LogError(
            f"{simulation.path}: the simulation has no column for {', '.join(missing)}, which the "
            f"log {log.name} has; found {', '.join(simulation.channels)}. Export "
            f"{'them' if len(missing) > 1 else 'it'} too, or name the column in the rig file under "
            "[columns]."
        )
    shift, difference = _aligned(simulation, log, counted)
    if difference > VELOCITY_DIFFERENCE_MAX:
        raise LogError(
            f"{simulation.path}: the simulation has another line motion than the log {log.name}: "
            f"the velocities differ by {100.0 * difference:.2g} % rms after a shift of {shift:.3g} "
            f"s; expected {100.0 * VELOCITY_DIFFERENCE_MAX:g} % at most. Drive the simulation with "
            "the velocity of the log, over all cycles that count."
        )
    channels = {
        name: _sampled(simulation, x, log, shift) for name, x in simulation.channels.items()
    }
    at_log = {"t": log.t, "fs": log.fs, "samples": log.t.size, "load": log.load}
    return msgspec.structs.replace(simulation, channels=channels, gaps={}, simulated=True, **at_log)


def _aligned(simulation: Run, log: Run, counted: slice) -> tuple[float, float]:
    """By how much the clock of a simulation is ahead of that of its log [s], and the difference of
    the velocities then [1].

    The clocks may be the same, begin with the first sample, or be related by the correlation of the
    velocities, which are taken without the noise of an encoder.
    """
    from scipy.optimize import minimize_scalar
    from scipy.signal import correlate

    ramp = motion_of_runs([log]).ramp
    width, within = SMOOTHING * ramp, SHIFT_SEARCHED * ramp
    velocity, other = (
        local_quadratic(run.t, run.channels["velocity"], width) for run in (log, simulation)
    )
    step, scale = 1.0 / log.fs, max(rms(velocity[counted]), 1e-6)

    def difference(shift: float) -> float:
        at = log.t[counted] + shift
        beyond = (
            np.maximum(simulation.t[0] - at, at - simulation.t[-1]) > AT_REST_BEYOND / simulation.fs
        )
        moved = np.where(beyond, 0.0, np.interp(at, simulation.t, other))
        return rms(moved - velocity[counted]) / scale

    at_log, at_other = (np.arange(run.t[0], run.t[-1], step) for run in (log, simulation))
    together = correlate(
        np.interp(at_other, simulation.t, other), np.interp(at_log, log.t, velocity), method="fft"
    )
    begins = float(simulation.t[0] - log.t[0])
    near = min(
        (0.0, begins, begins + (int(np.argmax(together)) - at_log.size + 1) * step), key=difference
    )
    found = minimize_scalar(
        difference,
        bounds=(near - within, near + within),
        method="bounded",
        options={"xatol": SHIFT_TOLERANCE * ramp},
    )
    shift = 0.0 if abs(found.x) < SHIFT_MIN * step else float(found.x)
    return shift, difference(shift)


def _sampled(simulation: Run, x: Signal, log: Run, shift: float) -> Signal:
    """A channel of a simulation at the stamps of its log, (n,): between two samples by a
    straight line, of many the mean.
    """
    at, half = log.t + shift, 0.5 / log.fs
    if simulation.fs < SAMPLES_PER_STAMP_MIN * log.fs:
        return np.interp(at, simulation.t, x)
    total = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(simulation.t) * (x[1:] + x[:-1]))))
    ends = np.clip(at + np.array([[-half], [half]]), simulation.t[0], simulation.t[-1])
    (gained,), (width,) = (np.diff(y, axis=0) for y in (np.interp(ends, simulation.t, total), ends))
    return np.where(width > half, gained / np.maximum(width, half), np.interp(at, simulation.t, x))


def _check_levels(simulation: Run, log: Run, rig: Rig, blocks: Blocks) -> None:
    """Reject a simulation with a channel of an assumed unit whose level is far from that of the
    log: LogError.
    """
    assumed = {finding.channel for finding in simulation.findings if finding.kind == "unit_assumed"}
    for name in (
        name for name in CHANNELS if name in assumed and name in log.channels and blocks.size
    ):
        if name == "idc" and log.open_circuit:
            continue
        here, logged = (rms(blocks.mean(run.channels[name])) for run in (simulation, log))
        ratio, channel = (here / logged if logged else 1.0), rig.known_channels[name]
        if 1.0 / LEVEL_RATIO_MAX < ratio < LEVEL_RATIO_MAX:
            continue
        units = {
            unit: factor / UNITS[channel.unit].factor
            for factor, unit in unit_names(channel.dimension).items()
        }
        likely = min(units, key=lambda unit: abs(math.log10(max(ratio * units[unit], 1e-12))))
        raise LogError(
            f"{simulation.path}: its {name} has no known unit, was taken as {channel.unit}, and is "
            f"{ratio:.3g} times that of the log {log.name}; the unit may be {likely}. State it in "
            f"the header of the column, such as {name} ({likely})."
        )
