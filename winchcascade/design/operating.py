"""What a corrected rig does at a load along a motion: powers and efficiencies, and its largest
torque, current and tension.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import means_of
from winchcascade.core.jobs import all_at_once
from winchcascade.core.rig_file import Rig, Thresholds
from winchcascade.core.run import Run
from winchcascade.core.scales import MotionScale, motion_of_log, motion_of_runs
from winchcascade.diagnosis.explain.planned_run import PLATEAU, RAMP, REST, cycle_of
from winchcascade.reduction.phased_run import find_phases
from winchcascade.rig import physics
from winchcascade.rig.kernel import LINE, SHAFT, LineMotion, run_line, solve_shaft
from winchcascade.rig.physics import RPM
from winchcascade.rig.simulate import even_motion
from winchcascade.rig.state import constants
from winchcascade.rig.steps import COARSE, RESOLVED, rate_of_the_rotor, resolving

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.rig.parts import Model

MOVES = 1e-3
"""Share of its top speed above which a log has a motion. [1]"""

SCALED_BY = 2000
"""Number of even samples that show the scales of a motion beside its own. [1]"""

QUANTITIES = {
    "rpm": "rpm", "p_line_w": "W", "p_mech_w": "W", "p_gen_w": "W", "eta_trans": "1", "eta_gen": "1", "eta_pto": "1",
    "torque_nm": "N.m", "i_s_a": "A", "i_dc_a": "A", "i_dc_rms_a": "A", "force_n": "N",
    "e_gen_j": "J", "e_line_j": "J", "payout_s": "s", "plateau_p_line_w": "W", "plateau_p_mech_w": "W",
    "plateau_p_gen_w": "W", "plateau_eta_pto": "1",
}  # fmt: skip
"""What an operating point gives, with units: powers and efficiencies over the payout, largest speed
of the generator, torque of the shaft, stator current (rms), DC current and line tension, and over
the whole motion the rms of the DC current and, for each cycle, the energies that it delivers and
takes from the line; duration of the payout, and powers and efficiency of its plateau, NaN without
one. Payout and plateau are those of a reduction."""

PLACE = {name: k for k, name in enumerate(QUANTITIES)}
"""Number of each quantity in a row."""


def require_positive(option: str, numbers: Sequence[float]) -> None:
    """Raise OptionError for numbers of an option that are not finite and above 0."""
    if not all(0.0 < number < math.inf for number in numbers):
        raise OptionError(
            f"{option} {','.join(f'{x:g}' for x in numbers)}: expected finite numbers above 0."
        )


class Motion(NamedTuple):
    """A motion of the line: stamps [s], velocities [m/s], (k,), payout positive, speed of its
    plateau [m/s], and its cycles.
    """

    t: Signal
    v: Signal
    speed: float
    cycles: int = 1

    def at_speed(self, speed: float) -> Motion:
        """The same path of the line at another speed of the plateau, faster or slower
        throughout.
        """
        share = speed / self.speed
        return Motion(self.t / share, self.v * share, speed, self.cycles)


def planned_cycle(speed: float, length: float, ramp: float) -> Motion:
    """One payout and one haul-in, as `cycle_of` has them; a motion is laid on a monotone cubic,
    which smooths their ramps.

    Parameters
    ----------
    speed, length : of the plateau [m/s] and of the payout [m]
    ramp : time in which the line reaches its speed [s]; rests and hold are as long beside it as in
        a planned run
    """
    return Motion(*cycle_of(speed, length, ramp / RAMP), speed)


def motion_of_run(run: Run) -> Motion:
    """The motion of a log, as a simulation takes it, without longer rests at its ends;
    OptionError where it has no payout.
    """
    from winchcascade.rig.line_velocity import line_velocity

    scale = motion_of_runs([run])
    v, fast, slow = line_velocity(run, scale.ramp).value, *PAYS_OUT
    top = float(np.max(v, initial=0.0))
    if top <= MOVES * scale.speed:
        raise OptionError(
            f"{run.name}: no payout; expected a motion with line speeds above 0, payout positive."
        )
    speed = float(np.quantile(v[v > fast * top], PLATEAU))
    known = v[(v > fast * speed) | (v < slow * speed)] > fast * speed
    moved = run.t[np.abs(v) > slow * speed]
    rest = REST * scale.time
    own = (run.t >= moved[0] - rest) & (run.t <= moved[-1] + rest)
    return Motion(run.t[own], v[own], speed, int(np.sum(known & ~np.roll(known, 1))) or 1)


PAYS_OUT = (0.5, 0.1)
"""Shares of the speed of the plateau above which a payout has begun, and below which it has
ended.
"""


class Path(NamedTuple):
    """A motion of some cycles at even steps, with the direction of friction (n,), begin and end of
    each payout and of each plateau that there is, (k, 2) and (l, 2) [s], and the speed of its
    plateau [m/s].
    """

    motion: LineMotion
    direction: Signal
    payouts: Signal
    plateaus: Signal
    cycles: int
    speed: float


def path_of(motion: Motion, model: Model, thresholds: Thresholds = Thresholds()) -> Path:  # noqa: B008
    """Lay a motion onto steps that resolve a model.

    Parameters
    ----------
    thresholds : by which a reduction finds payouts and plateaus; those that are not stated follow
        the scales of the motion

    Raises
    ------
    OptionError : the motion takes more than `MOST_STEPS`, or has no payout
    RigError : no step resolves the model
    """
    takes = float(motion.t[-1] - motion.t[0])
    t = np.union1d(motion.t, np.linspace(motion.t[0], motion.t[-1], SCALED_BY))
    scale = motion_of_log(t, np.interp(t, motion.t, motion.v)) or MotionScale(
        motion.speed, takes, 1.0
    )
    rest = physics.REST * scale.speed
    longest = MOST_STEPS * min(
        COARSE * scale.ramp, RESOLVED / rate_of_the_rotor(model, scale.speed)
    )
    if takes > longest:
        raise OptionError(
            f"a motion at {motion.speed:g} m/s takes {takes:.0f} s; expected {longest:.0f} s at "
            f"most."
        )
    even = even_motion(motion.t, motion.v, resolving(model, scale, COARSE), rest)
    run = Run("motion", even.t, {"velocity": even.v}, 1.0 / even.step, even.t.size)
    phased = find_phases(run, Rig("motion", thresholds=thresholds), "payout")
    if not phased.cycles:
        raise OptionError(
            f"a motion at {motion.speed:g} m/s has no payout by the thresholds of the rig; give a "
            f"faster one."
        )
    payouts = np.array([(cycle.onset, cycle.payout_end) for cycle in phased.cycles])
    plateaus = np.array(
        [(one.begin, one.braking) for one in phased.plateaus if one is not None]
    ).reshape(-1, 2)
    direction = physics.direction(even.v, rest)
    return Path(even, direction, payouts, plateaus, motion.cycles, motion.speed)


MOST_STEPS = 1_500_000
"""Maximum number of steps of the motion of a point, which fit into memory. [1]"""


def point(model: Model, path: Path, load: float) -> Signal:
    """What a model does at a load along a motion: `QUANTITIES` in a row.

    Parameters
    ----------
    load : at the DC link, inf for an open circuit [ohm]
    """
    numbers, motion = constants(model, load, path.motion.rest), path.motion
    shaft, line = solve_shaft(motion.v, motion.step, numbers), np.empty((motion.t.size, len(LINE)))
    clutch = shaft[:, SHAFT.index("clutch")].copy()
    run_line(motion, path.direction, numbers, clutch, line)
    force, torque = (
        physics.tension(line[:, LINE.index("force")], model.winch),
        line[:, LINE.index("torque")],
    )
    delivered = shaft[:, SHAFT.index("vdc")] ** 2 / numbers.shaft.load
    rates = np.array([force * motion.v, torque * motion.v / model.r_motion, delivered])
    streams = [rate.__getitem__ for rate in rates]
    line_w, mech_w, gen_w = means_of(motion.t, streams, path.payouts).mean(axis=1).tolist()
    efficiencies = [_ratio(mech_w, line_w), _ratio(gen_w, mech_w), _ratio(gen_w, line_w)]
    flat = [math.nan] * len(rates)
    if path.plateaus.size:
        flat = means_of(motion.t, streams, path.plateaus).mean(axis=1).tolist()
    seconds = float(np.ptp(path.payouts, axis=1).mean())
    speed, current, dc = (shaft[:, SHAFT.index(name)] for name in ("omega_gen", "i_s", "idc"))
    rpm, *largest = (float(np.max(x)) for x in (speed * RPM, torque, current, dc))
    e_line, _, e_gen = (rates.sum(axis=1) * motion.step / path.cycles).tolist()
    dc_rms = float(np.sqrt(np.mean(dc**2)))
    over_payout = [
        rpm,
        line_w,
        mech_w,
        gen_w,
        *efficiencies,
        *largest,
        dc_rms,
        np.max(force),
        e_gen,
        e_line,
    ]
    return np.array([*over_payout, seconds, *flat, _ratio(flat[-1], flat[0])])


def _ratio(out: float, into: float) -> float:
    """An efficiency; NaN where nothing goes in. [1]"""
    return out / into if into > 0.0 else math.nan


def points(models: Sequence[Model], paths: Sequence[Path], loads: Sequence[float]) -> Signal:
    """What several models do along each motion at each load, (models, motions, loads,
    quantities).
    """

    def along(path: Path, load: float) -> Signal:
        return np.array([point(model, path, load) for model in models])

    jobs = [partial(along, path, load) for path in paths for load in loads]
    found = np.array(all_at_once(jobs))
    return found.reshape(len(paths), len(loads), len(models), len(QUANTITIES)).transpose(2, 0, 1, 3)
