"""The line motion that drives a simulation: smoothed, so that inertia torques are not noise, at even steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.campaign_file import SIMULATED
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.run import Run
from winchcascade.core.smooth import local_quadratic
from winchcascade.rig.bridge import bridge_table
from winchcascade.rig.kernel import COLUMNS, REST, SHAFT, TURN, constants, run_line, run_shaft

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.rig.parts import Model


SAMPLES = 11
"""Samples that the local quadratic spans: noise of an encoder is taken out, and braking keeps its edges (9 to 13 serve)."""


class LineMotion(msgspec.Struct, frozen=True):
    """A line motion at even steps: times, displacement, velocity and acceleration, (n,) each, payout positive. SI units."""

    t: Signal
    x: Signal
    v: Signal
    a: Signal
    step: float


def motion_of(run: Run, step: float) -> LineMotion:
    """Take the motion of a log: its velocity, smoothed over `SAMPLES` samples, and the displacement that it integrates to.

    The displacement begins where the log's does (0 without that channel), and follows its drift, so that gas and force
    know the true payout.

    Parameters
    ----------
    step : of the simulation [s]
    """
    v = local_quadratic(run.t, run.channels["velocity"], SAMPLES / run.fs)
    motion = even_motion(run.t, v, step)
    measured = run.channels.get("displacement")
    if measured is None:
        return motion
    integral = np.interp(run.t, motion.t, motion.x)
    drift = local_quadratic(run.t, measured - integral, DRIFT)
    return msgspec.structs.replace(motion, x=motion.x + np.interp(motion.t, run.t, drift))


DRIFT = 2.0
"""Width over which the difference of displacement and integrated velocity is taken for drift, not for noise. [s]"""


def even_motion(t: Signal, v: Signal, step: float) -> LineMotion:
    """Lay a velocity onto even steps by a monotone cubic, with its slope and its integral.

    Parameters
    ----------
    t, v : (k,) stamps that rise [s], velocities [m/s]
    """
    from scipy.interpolate import PchipInterpolator

    n = int((t[-1] - t[0]) / step) + 1
    even = t[0] + step * np.arange(n)
    curve = PchipInterpolator(t, v)
    speed, slope = curve(even), curve.derivative()(even)
    x = np.concatenate(([0.0], np.cumsum(0.5 * step * (speed[1:] + speed[:-1]))))
    return LineMotion(even, x, speed, slope, step)


STORED = ("gas", "drum", "shaft", "rotor", "capacitor")
LOST = (
    "screw",
    "seal",
    "line_loss",
    "clutch",
    "shaft_loss",
    "mesh",
    "damper",
    "windage",
    "friction",
    "copper",
    "diodes",
)
LEDGER = ("line", *STORED, *LOST, "dc")
"""The line's energy; what is stored in gas, drum, shaft spring, rotor and capacitor; what is lost in screw, seals, between
line and torque sensor, clutch, shaft, gear mesh, on the fast shaft, in copper and diodes; what the DC link delivers."""


def energies(model: Model, motion: LineMotion, load: float, out: Signal) -> dict[str, Signal]:
    """Book the energy of a solution from its beginning to each step, (n,) each [J].

    The line's energy is that of the true line speed, which layers of rope change; the other entries add up to it.
    """
    winch, gas, shaft, machine, link = (
        model.winch, model.restoring, model.drivetrain, model.generator, model.dc_link,
    )  # fmt: skip
    got = dict(zip(COLUMNS, out.T, strict=True))
    omega_drum, omega = motion.v / winch.r_drum, got["omega_gen"]
    direction = np.tanh(motion.v / REST)
    drag = -shaft.clutch_drag * 0.5 * (1.0 - direction) * np.abs(direction)
    torque = got["torque"] - drag
    resistance = link.r_bleed if math.isinf(load) else load * (1.0 + link.load_change)
    push = gas.lead * omega_drum * got["pressure"] * gas.area
    seal = gas.lead * omega_drum * gas.seal_friction * direction
    lost = winch.friction * direction + winch.drag * omega_drum
    copper, diodes = 3.0 * machine.r_s * got["i_s"] ** 2, 2.0 * machine.v_diode * got["i_bridge"]
    watts = {
        "line": got["force"] * omega_drum * winch.r_drum * (1.0 + winch.layering * motion.x),
        "gas": push,
        "screw": got["screw"] * omega_drum - push - seal,
        "seal": seal,
        "line_loss": lost * omega_drum,
        "clutch": drag * omega_drum,
        "mesh": torque * omega / shaft.gear * (1.0 - shaft.eta_mesh),
        "damper": shaft.b_rotor * omega**2,
        "windage": shaft.windage * np.abs(omega) ** 3,
        "friction": shaft.friction * np.tanh(omega / TURN) * omega,
        "copper": copper,
        "diodes": diodes,
        "dc": got["vdc"] ** 2 / resistance,
    }
    booked = {name: _running(watt, motion.step) for name, watt in watts.items()}
    spring = 0.5 * shaft.k_shaft * got["twist"] ** 2
    through = _running(torque * (omega_drum - omega / shaft.gear), motion.step)
    booked["shaft"] = spring - spring[0]
    booked["shaft_loss"] = through - booked["shaft"]
    for name, half, state in (
        ("drum", 0.5 * winch.inertia, omega_drum), ("rotor", 0.5 * shaft.inertia_rotor, omega),
        ("capacitor", 0.5 * link.c_dc, got["vdc"]),
    ):  # fmt: skip
        booked[name] = half * (state**2 - state[0] ** 2)
    return {name: booked[name] for name in LEDGER}


def _running(watt: Signal, step: float) -> Signal:
    """Integrate a power from the beginning to each step. [J]"""
    joule: Signal = np.concatenate(([0.0], np.cumsum(0.5 * step * (watt[1:] + watt[:-1]))))
    return joule


STEP = 1e-3
"""Step of a simulation: half of it changes no channel by more than 0.05 % of its plateau. [s]"""

READ = ("pressure", "force", "torque", "vdc", "idc")
"""Channels that sensors of the rig read."""


class Simulation(msgspec.Struct, frozen=True):
    """What a model does along a motion.

    `run` holds what the sensors would have logged; `rpm_gen` [rpm], `i_s` [A] and `torque_em` [N m] what they do not see,
    at the same stamps. `solution` is what the kernel gave at every step of the motion.
    """

    run: Run
    rpm_gen: Signal
    i_s: Signal
    torque_em: Signal
    model: Model
    motion: LineMotion
    solution: Signal

    @property
    def energy(self) -> dict[str, Signal]:
        """Where the line's energy went until each stamp, by the words of `ledger.LEDGER`, (n,) each [J]."""
        booked = energies(self.model, self.motion, _load(self.run), self.solution)
        return {name: np.interp(self.run.t, self.motion.t, joule) for name, joule in booked.items()}


def simulate(run: Run, model: Model, *, step: float = STEP) -> Simulation:
    """Simulate the rig along the line motion of a log, at the log's load and stamps.

    Parameters
    ----------
    run : gives motion, load (unknown counts as an open circuit) and stamps; its other channels are not looked at
    step : of the simulation [s]

    Raises
    ------
    LogError : the line pays out further than gas or drum allow
    RigError : the model has numbers that no rig has
    """
    return simulate_along(run, model, motion_of(run, step))


def simulate_along(run: Run, model: Model, motion: LineMotion) -> Simulation:
    """Simulate the rig along a motion that is ready made, at the load and stamps of a log; refuses as `simulate` does."""
    _check_model(model)
    _check_travel(run.name, model, motion)
    return at_stamps(run, model, motion, solve(model, motion, _load(run)))


def _check_model(model: Model) -> None:
    """Refuse numbers that no rig has, as a rig file and several effects together may give them: RigError."""
    gas = model.restoring
    for what, value, fits, expected in (
        ("mesh efficiency", model.drivetrain.eta_mesh, 0.0 < model.drivetrain.eta_mesh <= 1.0, "above 0 and at most 1"),
        ("friction coefficient of the screw", gas.mu, gas.mu >= 0.0, "0 or more"),
        ("gas volume [m3]", gas.volume, gas.volume > 0.0, "above 0"),
        ("precharge pressure, absolute [Pa]", gas.pressure, gas.pressure > 0.0, "above 0"),
        ("inertia at the drum [kg m2]", model.winch.inertia, model.winch.inertia >= 0.0, "0 or more"),
    ):
        if not fits:
            raise RigError(
                f"the model's {what} is {value:.4g}; expected {expected}, so check the rig file and the effects together."
            )


def _check_travel(name: str, model: Model, motion: LineMotion) -> None:
    """Refuse a motion that leaves the gas no volume, or the rope no radius on the drum: LogError."""
    gas, winch = model.restoring, model.winch
    push = gas.area * gas.lead / winch.r_drum
    low, high = float(np.min(motion.x)), float(np.max(motion.x))
    if gas.volume <= push * high:
        raise LogError(
            f"{name}: the line pays out {high:.4g} m, but after {gas.volume / push:.4g} m the piston would have pressed the "
            f"gas of {1e3 * gas.volume:.4g} L to nothing; expected less payout, so check the unit of velocity and "
            "displacement, volume_gas and area_piston of the rig file, and the effects."
        )
    if 1.0 + min(winch.layering * low, winch.layering * high) <= 0.0:
        raise LogError(
            f"{name}: the line moves from {low:.4g} to {high:.4g} m, but at {-1.0 / winch.layering:.4g} m the rope would run "
            "on a radius of nothing; expected less motion, so check the unit of velocity and displacement, and the effects."
        )


def _load(run: Run) -> float:
    """Load of a run; an open circuit where it is not known. [ohm]"""
    return math.inf if run.load is None else run.load


def solve(model: Model, motion: LineMotion, load: float) -> Signal:
    """Step a model along a motion, (n, 12): the columns of `kernel.COLUMNS` at every step."""
    out = np.empty((motion.t.size, len(COLUMNS)))
    numbers = constants(model, load)
    run_shaft(motion.v, motion.step, numbers, bridge_table(), out[:, : len(SHAFT)])
    run_line(motion.x, motion.v, motion.a, motion.step, numbers, out[:, 0], out[:, len(SHAFT) :])
    return out


def at_stamps(run: Run, model: Model, motion: LineMotion, out: Signal) -> Simulation:
    """Read a solution at the stamps of a log, as its sensors would."""

    rows, late = _between(motion, run.t, out), None
    sensors = model.sensors
    if sensors.electrical_lag:
        late = _between(motion, sensors.late(run.t), out)

    def column(name: str) -> Signal:
        seen = late if late is not None and name in ("vdc", "idc") else rows
        return seen[:, COLUMNS.index(name)]

    channels = {"displacement": np.interp(run.t, motion.t, motion.x), "velocity": run.channels["velocity"]}
    channels |= {name: run.channels[name] for name in ("displacement",) if name in run.channels}
    channels |= {name: sensors.read(name, column(name)) for name in READ}
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
        ),
        rpm_gen=column("omega_gen") * 30.0 / math.pi,
        i_s=column("i_s"),
        torque_em=column("torque_em"),
        model=model,
        motion=motion,
        solution=out,
    )


def _between(motion: LineMotion, t: Signal, out: Signal) -> Signal:
    """Rows of a solution at some instants, between two steps by a straight line, (k, columns)."""
    place = np.clip((t - motion.t[0]) / motion.step, 0.0, motion.t.size - 1.0)
    before = np.minimum(place.astype(np.intp), motion.t.size - 2)
    share = (place - before)[:, None]
    rows: Signal = out[before] * (1.0 - share) + out[before + 1] * share
    return rows
