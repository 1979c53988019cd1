"""Simulate a rig along the motion of a log: a Run in, a Run out, which `write_log` writes as a log.

The line motion is smoothed, so that inertia torques are not noise, and taken at even steps.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from winchcascade.core.arguments import STEP_LENGTH, check_arguments
from winchcascade.core.campaign_file import SIMULATED
from winchcascade.core.channels import CHANNELS
from winchcascade.core.errors import LogError, OptionError, RigError, check_type
from winchcascade.core.files import write_whole
from winchcascade.core.quantity import UNITS
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import LOAD_HEADER, SIMULATED_HEADERS, Run, Signal
from winchcascade.core.scales import MotionScale, motion_of_runs
from winchcascade.core.smooth import local_quadratic
from winchcascade.core.viewed import Viewed
from winchcascade.rig import physics
from winchcascade.rig.baseline import baseline
from winchcascade.rig.kernel import COLUMNS, LINE, SHAFT, LineMotion, run_line, solve_shaft
from winchcascade.rig.ledger import energies, integral
from winchcascade.rig.line_velocity import line_velocity
from winchcascade.rig.parts import ELECTRICAL, PARTS, Model, limited, number_of
from winchcascade.rig.physics import RPM
from winchcascade.rig.state import constants
from winchcascade.rig.steps import resolving


def motion_of(run: Run, step: float, scale: MotionScale) -> LineMotion:
    """Take the motion of a log: its smoothed velocity, as `line_velocity` gives it, and the
    displacement that it integrates to.

    The displacement begins where that of the log does (0 without that channel), and follows its
    drift, so that gas and force follow the true payout.

    Parameters
    ----------
    step : of the simulation [s]
    scale : scales of the motion of its campaign
    """
    motion = even_motion(
        run.t, line_velocity(run, scale.ramp).value, step, physics.REST * scale.speed
    )
    measured = run.channels.get("displacement")
    if measured is None:
        return motion
    drift = local_quadratic(
        run.t, measured - np.interp(run.t, motion.t, motion.x), DRIFT * scale.ramp
    )
    return motion._replace(x=motion.x + np.interp(motion.t, run.t, drift))


DRIFT = 4.6
"""Width over which the difference of displacement and integrated velocity is drift, not noise,
over the ramp. [1]
"""


ROUNDED = 1e-6
"""Part of a step that rounding makes of a whole number of them. [1]"""


def even_motion(t: Signal, v: Signal, step: float, rest: float) -> LineMotion:
    """Lay a velocity onto even steps up to the last stamp by a monotone cubic, with its slope and
    its integral.

    Parameters
    ----------
    t, v : (k,) stamps that rise [s], velocities [m/s]
    rest : speed within which friction changes its sign [m/s]
    """
    from scipy.interpolate import PchipInterpolator

    even = t[0] + step * np.arange(math.ceil((t[-1] - t[0]) / step - ROUNDED) + 1)
    curve, known = PchipInterpolator(t, v), np.minimum(even, t[-1])
    speed = curve(known)
    return LineMotion(even, integral(speed, step), speed, curve(known, 1), step, rest)


READ = ("pressure", "force", "torque", "vdc", "idc")
"""Channels that sensors of the rig read."""


def read_by(model: Model) -> tuple[str, ...]:
    """Channels that sensors of a rig read: a rig without gas has no pressure."""
    return tuple(name for name in READ if name != "pressure" or model.restoring.has_gas)


class Simulation(Viewed, frozen=True):
    """What a model does along a motion.

    Parameters
    ----------
    run : what the sensors would have logged
    rpm_gen : (n,) generator speed at the stamps of the run [rpm]
    i_s : (n,) stator current, rms [A]
    torque_em : (n,) air-gap torque [N m]
    model, motion : what was simulated, along which motion of the line
    solution : state of the kernel at every step of the motion
    """

    run: Run
    rpm_gen: Signal
    i_s: Signal
    torque_em: Signal
    model: Model
    motion: LineMotion
    solution: Signal

    def __repr__(self) -> str:
        """One line instead of every number."""
        return f"Simulation({self.run!r})"

    @property
    def energy(self) -> dict[str, Signal]:
        """Energy of the line and where it went until each stamp, by the words of `LEDGER`, (n,)
        each [J].
        """
        return {
            name: np.interp(self.run.t, self.motion.t, joule)
            for name, joule in energies(
                self.model, self.motion, load_of(self.run), self.solution
            ).items()
        }


def simulate(run: Run, model: Model | None = None, *, step: float | None = None) -> Simulation:
    """Simulate the rig along the line motion of a log, at its load and stamps.

    Parameters
    ----------
    run : gives motion, load (unknown counts as an open circuit) and stamps; its other channels are
        not used
    model : the baseline of the rig that the run was read with if not given, without errors of its
        sensors; that of the rig of the paper for a run that was not read
    step : of the simulation [s]; by default one that resolves the motion and the rotor

    Raises
    ------
    LogError : the line pays out further than gas or drum allow
    RigError : the model has numbers that no rig can have, or too light a rotor
    OptionError : something else than a run or a model
    """
    check_type("simulate", run, Run, "read_run(log)")
    model = baseline(given_rig("simulate", run.rig)).physics if model is None else model
    check_type("simulate, model", model, Model, "baseline(rig)")
    check_arguments("simulate", ("step", step, STEP_LENGTH))
    _check_model(model)
    scale = motion_of_runs([run])
    _check_speed(run, scale)
    usual = resolving(model, scale)
    if step is not None and not usual / FINEST_SHARE <= step <= scale.ramp:
        raise OptionError(
            f"simulate: step is {step:g} s; expected one from {usual / FINEST_SHARE:.2g} s to the "
            f"ramp of the motion, {scale.ramp:.2g} s. By default it is {usual:.2g} s."
        )
    step = usual if step is None else step
    if "velocity" not in run.channels or run.t[-1] - run.t[0] < 2.0 * step:
        raise LogError(
            f"{run.name}: {run.samples} samples of {', '.join(run.channels)} hold no motion of the "
            "line; expected a log with velocity or displacement."
        )
    found = simulate_along(run, model, motion_of(run, step, scale))
    for name, signal in found.run.channels.items():
        if not np.max(np.abs(signal)) < LARGEST:
            raise RigError(
                f"{run.name}: the model gives a {name} of {np.max(np.abs(signal)):.3g} in SI "
                "units, which no rig has; check the rig file and the effects together."
            )
    return found


def simulate_along(run: Run, model: Model, motion: LineMotion) -> Simulation:
    """Simulate the rig along a given motion, at the load and stamps of a log. Raises as
    `simulate`.
    """
    _check_model(model)
    check_travel(run.name, model, float(np.min(motion.x)), float(np.max(motion.x)))
    out, sensors = solve(model, motion, load_of(run)), model.sensors
    now, late = (_between(motion, t, out) for t in (run.t, sensors.late("vdc", run.t)))
    travelled = np.interp(run.t, motion.t, motion.x)
    channels = {
        "displacement": run.channels.get("displacement", travelled),
        "velocity": run.channels["velocity"],
    }
    true = {name: (late if name in ELECTRICAL else now)[name] for name in read_by(model)}
    true["force"] = physics.tension(true["force"], model.winch)
    channels |= {name: sensors.read(name, x) for name, x in true.items()}
    return Simulation(
        run=Run(
            name=run.name,
            t=run.t,
            channels=channels,
            fs=run.fs,
            samples=run.t.size,
            load=run.load,
            load_source=run.load_source,
            simulated=True,
            about=run.about,
            origin=SIMULATED,
            rig=run.rig,
            window=run.window,
            cycles=run.cycles,
        ),
        rpm_gen=now["omega_gen"] * RPM,
        i_s=now["i_s"],
        torque_em=now["torque_em"],
        model=model,
        motion=motion,
        solution=out,
    )


def _check_model(model: Model) -> None:
    """Reject numbers that no rig can have: RigError."""
    for part in PARTS:
        for name, value in getattr(model, part)._asdict().items():
            if isinstance(value, float) and math.isnan(value):
                raise RigError(
                    f"the model's {name} is NaN; expected a number, so check the rig and the "
                    f"effects."
                )
    for path, number in limited().items():
        value, most = number_of(model, path), number.most
        if not number.least <= value <= most:
            expected = ("above 0" if number.least else "0 or more") + (
                f" and at most {most:g}" if most < math.inf else ""
            )
            unit = "" if number.unit == "1" else f" {number.unit}"
            raise RigError(
                f"the model's {number.what} is {value:.4g}{unit}; expected {expected}, so check "
                "the rig file and the effects together."
            )


def check_travel(name: str, model: Model, low: float, high: float) -> None:
    """Reject a travel between two places [m] that leaves the gas no volume, or the rope no
    radius on the drum: LogError.
    """
    gas = model.restoring
    push = gas.area * gas.lead / model.r_motion
    if gas.volume <= push * high:
        raise LogError(
            f"{name}: the line pays out {high:.4g} m, but after {gas.volume / push:.4g} m the "
            f"piston would have pressed the gas of {1e3 * gas.volume:.4g} L to nothing; expected "
            "less payout, so check the unit of velocity and displacement, volume_gas and "
            "area_piston of the rig file, and the effects."
        )
    if min(physics.rope_radius(low, model.winch), physics.rope_radius(high, model.winch)) <= 0.0:
        raise LogError(
            f"{name}: the line moves from {low:.4g} to {high:.4g} m, but at "
            f"{-1.0 / model.winch.layering:.4g} m the rope would run on a radius of nothing; "
            "expected less motion, so check the unit of velocity and displacement, and the "
            "effects."
        )


LARGEST = 1e15
"""Largest number that a rig file may state, too, in SI units."""

FINEST_SHARE = 1000.0
"""Ratio of the usual step to the finest one that may be given: a log of minutes then fills
gigabytes. [1]
"""

OVER_SPEED = 20.0
"""Ratio of the speed of a generator to its rated speed at which none holds together: those of
machines with magnets burst at two to three times it, and a velocity in mm/s that is read as m/s is
a thousand times too fast. [1]"""


def _check_speed(run: Run, scale: MotionScale) -> None:
    """Reject a motion that turns the generator so fast that the unit of the velocity is wrong:
    LogError.
    """
    rig = run.rig
    if rig is None or rig.generator.speed_rated is None or rig.rpm_per_velocity is None:
        return
    rpm, rated = rig.rpm_per_velocity * scale.speed, rig.generator.speed_rated.value * RPM
    if rpm > OVER_SPEED * rated:
        raise LogError(
            f"{run.name}: the line moves at {scale.speed:.4g} m/s, which turns the generator at "
            f"{rpm:.3g} rpm, {rpm / rated:.0f} times its rated speed; expected {OVER_SPEED:g} "
            "times at most, so check the unit of velocity and displacement, r_drum and gear_ratio."
        )


def load_of(run: Run) -> float:
    """Load of a run; inf, an open circuit, where it is unknown. [ohm]"""
    return math.inf if run.load is None else run.load


def solve(model: Model, motion: LineMotion, load: float) -> Signal:
    """Step a model along a motion, (n, 12): the columns of `kernel.COLUMNS` at every step."""
    numbers, direction = (
        constants(model, load, motion.rest),
        physics.direction(motion.v, motion.rest),
    )
    shaft, line = solve_shaft(motion.v, motion.step, numbers), np.empty((motion.t.size, len(LINE)))
    run_line(motion, direction, numbers, shaft[:, SHAFT.index("clutch")].copy(), line)
    return np.hstack([shaft, line])


def _between(motion: LineMotion, t: Signal, out: Signal) -> dict[str, Signal]:
    """Columns of a solution at some instants, between two steps by a straight line, (k,) each."""
    place = np.clip((t - motion.t[0]) / motion.step, 0.0, motion.t.size - 1.0)
    before = np.minimum(place.astype(np.intp), motion.t.size - 2)
    share = (place - before)[:, None]
    return dict(
        zip(COLUMNS, (out[before] * (1.0 - share) + out[before + 1] * share).T, strict=True)
    )


LOGGED = ("displacement", "velocity", *READ)
"""Channels of a log, in the order of its columns."""


def write_log(simulation: Simulation, path: Path, *, force: bool = False) -> None:
    """Write a simulation as CSV, whole or not at all: the headers of a measured log, those that
    mark it as simulated, the load.

    Raises
    ------
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
        to replace it
    """
    unlogged = np.column_stack([simulation.rpm_gen, simulation.i_s, simulation.torque_em])
    write_simulated(simulation.run, path, unlogged, force=force)


def write_simulated(
    run: Run, path: Path, unlogged: Signal | None = None, *, force: bool = False
) -> None:
    """Write what any simulation gives for the sensors as CSV, in the format of `write_log`,
    channels that it lacks left out.

    Parameters
    ----------
    unlogged : (n, 3) values without a sensor, not a number where they are not known

    Raises
    ------
    OutputError : as `write_log`
    """
    shown = [CHANNELS[name] for name in LOGGED if name in run.channels]
    columns = [
        run.t,
        *(run.channels[channel.name] / UNITS[channel.unit].factor for channel in shown),
    ]
    unknown = np.full((run.t.size, len(SIMULATED_HEADERS)), math.nan)
    load = [] if run.load is None else [np.full(run.t.size, run.load)]
    table = np.column_stack([*columns, unknown if unlogged is None else unlogged, *load])
    headers = ["Time (s)", *(channel.header for channel in shown), *SIMULATED_HEADERS]
    header = ",".join([*headers, LOAD_HEADER] if load else headers)
    formats = ["%.6f" if run.t[-1] < 1e6 else "%.3f"] + ["%.9g"] * (table.shape[1] - 1)
    write_whole(
        path,
        lambda part: np.savetxt(
            part, table, fmt=formats, delimiter=",", header=header, comments=""
        ),
        force=force,
    )
