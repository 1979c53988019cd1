"""Stage by stage: what each part of a rig gives for what was measured at its own door.

Driven from the line's motion alone, a model carries every error down to its end. Here each stage is given its own measured
inputs, so that an error upstream neither hides nor fakes one downstream, and a rig with only some of the stages is told what
they say.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median
from winchcascade.core.smooth import local_quadratic
from winchcascade.rig.backemf import RPM_LEAST
from winchcascade.rig.bridge import back_emfs, bridge_table, dc_voltages
from winchcascade.rig.kernel import LINE, REST, TURN, constants, run_line
from winchcascade.rig.parts import NO_ROLLOFF, ROLLOFF_KNOTS, Sensors
from winchcascade.rig.simulate import SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from numpy.typing import NDArray

    from winchcascade.core.run import Run, Signal
    from winchcascade.rig.parts import Model
    from winchcascade.rig.simulate import LineMotion

Stage = Literal["restoring", "transmission", "gearbox", "generator", "load"]

STAGES = ("restoring", "transmission", "gearbox", "generator", "load")
"""Stages in their order from the line to the load."""

EXACT = Sensors()
"""Sensors without an error."""

MOVING = 0.03
"""Slower than this, friction only bounds the force, and the torque that follows from it. [m/s]"""

CONDUCTING = 0.5
"""The bridge tells the DC voltage while it carries at least this share of what the load takes."""

ACCELERATION = 0.4
"""Width of the local quadratic whose slope is the line's acceleration, where no model of the rig is known. [s]"""


class StageOutput(msgspec.Struct, frozen=True):
    """What one stage gives: `predicted` (n,) of a `channel` at the log's stamps, SI units, as its sensor would read it.

    `inputs` are the measured channels it follows from. NaN where the stage cannot say: at rest, or with the clutch open.
    """

    stage: Stage
    channel: str
    inputs: tuple[str, ...]
    predicted: Signal


class Along(msgspec.Struct, frozen=True):
    """The motion of a log as its stages need it, SI units: `motion` on even steps, at the stamps `x`, `v`, `a`, (n,) each.

    `engaged` (n,) tells the stamps at which the clutch carries torque while the line pays out.
    """

    motion: LineMotion
    x: Signal
    v: Signal
    a: Signal
    engaged: NDArray[np.bool_]


class _Drive(msgspec.Struct, frozen=True):
    """What drives the stages: the motion, and the channels, (n,) each in SI units, freed of the sensors' errors.

    `rpm` is the speed of the generator while the clutch is engaged, `i_load` the current of the load, `i_bridge` with that of
    the capacitor.
    """

    along: Along
    seen: Mapping[str, Signal]
    rpm: Signal
    i_load: Signal
    i_bridge: Signal


def along(run: Run, motion: LineMotion, clutch: Signal) -> Along:
    """Lay a motion onto a log's stamps.

    Parameters
    ----------
    clutch : torque that the clutch carries on the steps of the motion [N m]
    """
    carries = np.interp(run.t, motion.t, (clutch > 0.0).astype(np.float64))
    x, v, a = (np.interp(run.t, motion.t, y) for y in (motion.x, motion.v, motion.a))
    return Along(motion, x, v, a, (carries == 1.0) & (v > MOVING))


def outputs_along(run: Run, model: Model, course: Along, only: Collection[str] = STAGES) -> tuple[StageOutput, ...]:
    """Give what each stage of a rig makes of its own measured inputs, in order from the line to the load.

    restoring : pressure of the gas, from the line's motion
    transmission : torque behind the clutch, from line force, motion and pressure: what screw, losses and inertia leave of it
    gearbox : the same torque, from the shaft's speed and the power across the air gap, which Vdc and Idc ask for; in haul-in
        what the open clutch drags
    generator : Vdc, from the shaft's speed and the current that Idc and the capacitor take
    load : Idc, from Vdc; only where the load is known and no open circuit

    A stage whose inputs the log lacks is left out. Which torque the clutch carries at all is taken from the model along the
    motion, so from no measured force, torque or voltage. In open circuit the bleed is the load, and Idc is not looked at.

    Parameters
    ----------
    course : the log's motion, as `along` lays it onto the stamps
    only : the stages that are asked for
    """
    electric = ("vdc",) if run.open_circuit else ("vdc", "idc")
    drive = _drive(run, model, course)
    laws: tuple[tuple[Stage, str, tuple[str, ...], Callable[[], Signal]], ...] = (
        ("restoring", "pressure", ("velocity",), lambda: _pressure(run, model, course.motion)),
        ("transmission", "torque", ("velocity", "force", "pressure"), lambda: _torque_of_line(model, drive)),
        ("gearbox", "torque", ("velocity", *electric), lambda: _torque_of_shaft(model, drive)),
        ("generator", "vdc", ("velocity", *electric), lambda: _voltage(model, drive)),
        ("load", "idc", ("vdc",), lambda: drive.seen["vdc"] / _resistance(run, model)),
    )
    return tuple(
        StageOutput(stage, channel, inputs, _read(run, model, channel, law()))
        for stage, channel, inputs, law in laws
        if stage in only
        and set(inputs) <= set(run.channels)
        and (stage != "load" or math.isfinite(_resistance(run, model)))
    )


def _resistance(run: Run, model: Model) -> float:
    """Resistance of the load, inf where it is not known or there is none. [ohm]"""
    return math.inf if run.load is None else run.load * (1.0 + model.dc_link.load_change)


def _drive(run: Run, model: Model, course: Along) -> _Drive:
    seen = _as_they_were(run, model.sensors)
    i_load, i_bridge = _currents(run, model, seen)
    rpm = course.v / model.winch.r_drum * model.drivetrain.gear * 30.0 / math.pi
    return _Drive(along=course, seen=seen, rpm=rpm, i_load=i_load, i_bridge=i_bridge)


def _as_they_were(run: Run, sensors: Sensors) -> Mapping[str, Signal]:
    """Channels without the gains, zeros and lag that the model knows of its sensors."""
    if sensors == EXACT:
        return run.channels
    found = {}
    for name, x in run.channels.items():
        then = np.interp(run.t + sensors.electrical_lag, run.t, x) if name in ("vdc", "idc") else x
        found[name] = (then - sensors.zero.get(name, 0.0)) / (1.0 + sensors.gain.get(name, 0.0))
    return found


def _read(run: Run, model: Model, channel: str, x: Signal) -> Signal:
    """A channel as the model's sensors would have logged it."""
    sensors = model.sensors
    late = channel in ("vdc", "idc") and sensors.electrical_lag
    return sensors.read(channel, np.interp(sensors.late(run.t), run.t, x) if late else x)


def _currents(run: Run, model: Model, seen: Mapping[str, Signal]) -> tuple[Signal, Signal]:
    """Currents of the load and of the bridge, which charges the capacitor too, (n,) each [A]; NaN where Vdc is not logged."""
    unknown = np.full(run.t.size, np.nan)
    if "vdc" not in seen:
        return unknown, unknown
    smooth = local_quadratic(run.t, seen["vdc"], SAMPLES / run.fs)
    load = smooth / model.dc_link.r_bleed if run.open_circuit else seen.get("idc", unknown)
    return load, load + model.dc_link.c_dc * np.gradient(smooth, run.t)


def _pressure(run: Run, model: Model, motion: LineMotion) -> Signal:
    """Gauge pressure of the gas along the motion, (n,) at the stamps [Pa]."""
    numbers = constants(model, math.inf if run.load is None else run.load)
    line = np.empty((motion.t.size, len(LINE)))
    run_line(motion.x, motion.v, motion.a, motion.step, numbers, np.zeros(motion.t.size), line)
    gauge: Signal = np.interp(run.t, motion.t, line[:, LINE.index("pressure")])
    return gauge


def _torque_of_line(model: Model, drive: _Drive) -> Signal:
    """Torque that the line force leaves for the clutch, (n,) [N m]: `kernel.run_line` the other way round."""
    winch, gas, course = model.winch, model.restoring, drive.along
    direction = np.tanh(course.v / REST)
    thrust = drive.seen["pressure"] * gas.area + gas.seal_friction * direction
    thread = 0.5 * (1.0 + direction) / gas.eta_forward + 0.5 * (1.0 - direction) * gas.eta_reverse
    lost = winch.friction * direction + winch.drag * course.v / winch.r_drum
    pull = drive.seen["force"] * winch.r_drum * (1.0 + winch.layering * course.x)
    torque = pull - gas.lead * thrust * thread - lost - winch.inertia * course.a / winch.r_drum
    return np.where(np.abs(course.v) > MOVING, torque, np.nan)


def _torque_of_shaft(model: Model, drive: _Drive) -> Signal:
    """Torque that the fast shaft asks of the clutch, (n,) [N m]; in haul-in that of the open clutch.

    The machine's is that of the power across the air gap (Vdc + 2 V_d) I + 3 r_s i_s^2: neither k_e nor its roll-off enters.
    """
    shaft, machine, course = model.drivetrain, model.generator, drive.along
    direction = np.tanh(course.v / REST)
    open_clutch = -shaft.clutch_drag * 0.5 * (1.0 - direction) * np.abs(direction)
    torque = np.where(course.v < -MOVING, open_clutch, np.nan)
    known = course.engaged & (drive.rpm > RPM_LEAST) & np.isfinite(drive.i_bridge)
    omega = drive.rpm[known] * math.pi / 30.0
    v_total, current = drive.seen["vdc"][known] + 2.0 * machine.v_diode, np.maximum(drive.i_bridge[known], 0.0)
    reactance = machine.pole_pairs * np.maximum(omega, 1.0) * machine.l_s
    _, i_s = back_emfs(np.maximum(v_total, 0.0), current, machine.r_s, reactance, bridge_table())
    torque_em = (v_total * current + 3.0 * machine.r_s * i_s**2) / np.maximum(omega, 1.0)
    drag = shaft.b_rotor * omega + shaft.windage * omega * np.abs(omega) + shaft.friction * np.tanh(omega / TURN)
    speeding = shaft.inertia_rotor * course.a[known] / model.winch.r_drum * shaft.gear
    torque[known] = shaft.gear / shaft.eta_mesh * (torque_em + drag + speeding)
    return torque


def _voltage(model: Model, drive: _Drive) -> Signal:
    """DC voltage at which the machine gives the bridge's current, (n,) [V].

    Roll-off needs the stator current, which the bridge's current sets nearly alone, so a few rounds settle it.
    """
    machine = model.generator
    known = drive.along.engaged & (drive.rpm > RPM_LEAST) & (drive.i_bridge > 0.0)
    known &= drive.i_bridge > CONDUCTING * np.maximum(drive.i_load, 0.0)
    rpm, current = drive.rpm[known], drive.i_bridge[known]
    reactance = machine.pole_pairs * rpm * math.pi / 30.0 * machine.l_s
    left_at = _roll_off(machine.rolloff)
    i_s, v_total = np.zeros_like(rpm), np.zeros_like(rpm)
    for _ in range(1 if machine.rolloff == NO_ROLLOFF else ROUNDS):
        v_ll = machine.k_e * rpm * left_at(i_s)
        v_total, i_s = dc_voltages(v_ll, current, machine.r_s, reactance, bridge_table())
    found = np.full(known.size, np.nan)
    found[known] = np.where(v_total > 0.0, v_total - 2.0 * machine.v_diode, np.nan)
    return found


ROUNDS = 8
"""Rounds in which stator current and roll-off settle."""


def _roll_off(left: tuple[float, ...]) -> Callable[[Signal], Signal]:
    """What is left of the back-EMF constant at a stator current, by the kernel's monotone cubic. [1]"""
    if left == NO_ROLLOFF:
        return np.ones_like
    from scipy.interpolate import PchipInterpolator

    curve = PchipInterpolator(ROLLOFF_KNOTS, (1.0, *left))
    return lambda i_s: np.asarray(curve(np.minimum(i_s, ROLLOFF_KNOTS[-1])), dtype=np.float64)


def line_power(
    run: Run, mass_extra: float = 0.0, force: float = 0.0, b_line: float = 0.0, width: float = ACCELERATION
) -> Signal:
    """Give the mechanical power at the winch from line force and speed, in line units: no drum radius is needed, (n,) [W].

    P = v (F - m dv/dt - F_0 sgn v - b v): what the tether brings, less what speeds the winch up and what is lost on the way. As
    `power_mech`, it is positive while the line drives the winch; in haul-in the winch gives more than the tether takes.

    Parameters
    ----------
    mass_extra : what turns with the line, as a mass on it [kg]
    force : constant friction, against the motion [N]
    b_line : drag in proportion to the speed [N s/m]
    width : of the local quadratic whose slope is the acceleration [s]

    Raises
    ------
    LogError : the log has no line force
    """
    if "force" not in run.channels:
        raise LogError(f"{run.name}: no line force, which the power of the line follows from; log it.")
    v = run.channels["velocity"]
    taken = force * np.tanh(v / REST) + b_line * v
    if mass_extra:
        taken = taken + mass_extra * acceleration(run.t, v, width)
    power: Signal = v * (run.channels["force"] - taken)
    return power


def acceleration(t: Signal, v: Signal, width: float = ACCELERATION) -> Signal:
    """Slope of the quadratic fitted around each sample of a velocity, (n,) [m/s2]; NaN where fewer than three stamps carry it.

    Examples
    --------
    >>> t = np.arange(0.0, 2.0, 0.1)
    >>> bool(np.allclose(acceleration(t, t**2), 2.0 * t))
    True
    """
    reach = 0.5 * width * (1.0 + 1e-6)
    half = max(int(reach / median(np.diff(t))), 1)
    sums = np.zeros((5, t.size))
    moments = np.zeros((3, t.size))
    for k in range(-half, half + 1):
        at = np.clip(np.arange(t.size) + k, 0, t.size - 1)
        u = (t[at] - t) / reach
        inside = (np.abs(u) <= 1.0) & (at == np.arange(t.size) + k)
        powers = np.where(inside, u ** np.arange(5)[:, None], 0.0)
        sums += powers
        moments += powers[:3] * v[at]
    normal = sums[np.add.outer(np.arange(3), np.arange(3))].transpose(2, 0, 1)
    sound = np.linalg.det(normal) > 1e-9 * np.maximum(sums[0], 1.0) ** 3
    slope = np.full(t.size, np.nan)
    slope[sound] = np.linalg.solve(normal[sound], moments.T[sound, :, None])[:, 1, 0] / reach
    return slope
