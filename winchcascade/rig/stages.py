"""Stage by stage: the output of each part of a rig for the inputs that were measured at that part.

Driven from the motion of the line alone, a model carries every error down to its end. Here each
stage gets its own measured inputs, so that an error upstream neither hides nor imitates one
downstream. A rig with only some of the stages is compared in these.
"""

import math
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Literal, get_args

import msgspec
import numpy as np

from winchcascade.core.run import Mask, Run, Signal
from winchcascade.rig import physics
from winchcascade.rig.backemf import dc_currents, rpm_min
from winchcascade.rig.bridge import back_emfs, bridge_table, dc_voltages
from winchcascade.rig.kernel import LINE, LineMotion, run_line
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import RPM
from winchcascade.rig.simulate import load_of
from winchcascade.rig.state import constants

Stage = Literal["restoring", "transmission", "gearbox", "generator", "load"]

STAGES: tuple[str, ...] = get_args(Stage)
"""Stages in their order from the line to the load."""

NUMBERS_OF: dict[Stage, tuple[str, ...]] = {
    "restoring": ("winch", "restoring"),
    "transmission": ("winch", "restoring"),
    "gearbox": ("winch.r_drum", "drivetrain", "generator", "dc_link"),
    "generator": ("winch.r_drum", "drivetrain.gear", "generator", "dc_link"),
    "load": ("dc_link",),
}
"""Numbers of the model on which each stage depends, by their paths or whole parts."""

MOVING = 3.0
"""Multiple of the speed in which friction turns below which it only bounds the force, and the
torque that follows. [1]
"""

CONDUCTING = 0.5
"""The bridge determines the DC voltage while it carries at least this share of the current of
the load.
"""


class StageOutput(msgspec.Struct, frozen=True):
    """Output of one stage: `predicted` (n,) of a `channel` at the stamps of the log, SI units, as
    its sensor would read it.

    `inputs` are the measured channels it follows from. NaN where the stage has no output: at rest,
    or with the clutch open.
    """

    stage: Stage
    channel: str
    inputs: tuple[str, ...]
    predicted: Signal


class Along(msgspec.Struct, frozen=True):
    """The motion of a log for its stages, SI units: `motion` on even steps, its `ramp` [s], and at
    the stamps `x`, `v`, `a`, (n,) each.

    `engaged` (n,) marks the stamps at which the clutch carries torque while the line pays out.
    """

    motion: LineMotion
    ramp: float
    x: Signal
    v: Signal
    a: Signal
    engaged: Mask

    @property
    def direction(self) -> Signal:
        """Direction of friction at the stamps, (n,). [1]"""
        return physics.direction(self.v, self.motion.rest)

    @property
    def moves(self) -> Mask:
        """Whether the line moves so fast that friction has its full size, (n,)."""
        return np.abs(self.v) > MOVING * self.motion.rest


class DriveCourse(msgspec.Struct, frozen=True):
    """Speed of the generator while the clutch is engaged [rpm], DC voltage [V], currents of the
    load and of the bridge, which charges the capacitor too [A], (n,) each; NaN where Vdc or Idc is
    not logged.
    """

    rpm: Signal
    vdc: Signal
    i_load: Signal
    i_bridge: Signal


def along(run: Run, motion: LineMotion, ramp: float, clutch: Signal) -> Along:
    """Lay a motion onto the stamps of a log.

    Parameters
    ----------
    ramp : time in which the line speeds up [s]
    clutch : torque of the clutch on the steps of the motion [N m]
    """
    carries = np.interp(run.t, motion.t, (clutch > 0.0).astype(np.float64))
    x, v, a = (np.interp(run.t, motion.t, y) for y in (motion.x, motion.v, motion.a))
    return Along(motion, ramp, x, v, a, (carries == 1.0) & (v > MOVING * motion.rest))


def outputs_along(run: Run, model: Model, course: Along, by: str = "") -> tuple[StageOutput, ...]:
    """Compute the output of each stage of a rig from its own measured inputs, in order from the
    line to the load.

    restoring : pressure of the gas, from the motion of the line
    transmission : torque of the PTO shaft, from line tension, motion and pressure, less screw or
        pull, losses and inertia
    gearbox : the same torque, from the shaft speed and the power across the air gap, which follows
        from Vdc and Idc; in haul-in the drag of the open clutch
    generator : Vdc, from the shaft speed and the current that Idc and the capacitor take
    load : Idc, from Vdc; only where the load is known and no open circuit

    A stage whose inputs the log lacks is left out, and `restoring` of a rig without gas. Whether
    the clutch carries torque is taken from the model along the motion, so from no measured force,
    torque or voltage. In open circuit the bleed is the load, and Idc is not used.

    Parameters
    ----------
    course : motion of the log, as `along` lays it onto the stamps
    by : name of a channel or path of a number of the model on which a stage that is computed
        depends; all stages by default
    """
    gas = ("pressure",) if model.restoring.has_gas else ()
    of_line = ("velocity", "force", *gas)
    of_shaft = ("velocity", "vdc") if run.open_circuit else ("velocity", "vdc", "idc")
    seen, resistance = _seen(run, model), load_of(run) * (1.0 + model.dc_link.load_change)
    drive = cache(partial(drive_along, run, model, course))
    laws: tuple[tuple[Stage, str, tuple[str, ...], Callable[[], Signal]], ...] = (
        ("restoring", "pressure", ("velocity",), lambda: _pressure(run, model, course.motion)),
        ("transmission", "torque", of_line, lambda: _torque_of_line(model, course, seen)),
        ("gearbox", "torque", of_shaft, lambda: _torque_of_shaft(model, course, drive())),
        ("generator", "vdc", of_shaft, lambda: _voltage(model, course, drive())),
        ("load", "idc", ("vdc",), lambda: seen["vdc"] / resistance),
    )
    return tuple(
        StageOutput(stage, channel, inputs, model.sensors.recorded(channel, run.t, law()))
        for stage, channel, inputs, law in laws
        if set(inputs) <= set(run.channels)
        and (not by or by.startswith((channel, *inputs, *NUMBERS_OF[stage])))
        and (stage != "load" or math.isfinite(resistance))
        and (stage != "restoring" or gas)
    )


def _seen(run: Run, model: Model) -> dict[str, Signal]:
    """Channels of a log without the errors of the sensors of a model, (n,) each."""
    return {name: model.sensors.corrected(name, run.t, x) for name, x in run.channels.items()}


def drive_along(run: Run, model: Model, course: Along) -> DriveCourse:
    """Speed, voltage and currents of the machine along a log."""
    seen, unknown = _seen(run, model), np.full(run.t.size, np.nan)
    rpm = course.v / model.r_motion * model.drivetrain.gear * RPM
    if "vdc" not in seen:
        return DriveCourse(rpm, unknown, unknown, unknown)
    bleed, with_capacitor = dc_currents(run, model, seen["vdc"], course.ramp)
    i_load = bleed if run.open_circuit else seen.get("idc", unknown)
    return DriveCourse(rpm, seen["vdc"], i_load, i_load + (with_capacitor - bleed))


def power_per_output(model: Model, course: Along, drive: DriveCourse) -> dict[Stage, Signal]:
    """Power that flows out of a stage, over its output in `outputs_along`, (n,) each [W over the
    unit of the channel].

    Of the gearbox it is what reaches the generator, of which a larger torque leaves less.
    """
    omega = course.v / model.r_motion
    return {
        "restoring": physics.piston_torque(omega, model.restoring),
        "transmission": omega,
        "gearbox": -omega * np.where(omega > 0.0, model.drivetrain.eta_mesh, 1.0),
        "generator": drive.i_bridge,
    }


def _pressure(run: Run, model: Model, motion: LineMotion) -> Signal:
    """Gauge pressure of the gas along the motion, (n,) at the stamps [Pa]."""
    line = np.empty((motion.t.size, len(LINE)))
    without_torque = np.zeros(motion.t.size)
    numbers = constants(model, load_of(run), motion.rest)
    run_line(motion, physics.direction(motion.v, motion.rest), numbers, without_torque, line)
    return np.interp(run.t, motion.t, line[:, LINE.index("pressure")])


def _torque_of_line(model: Model, course: Along, seen: Mapping[str, Signal]) -> Signal:
    """Torque of the PTO shaft that follows from the line tension, (n,) [N m]: the inverse of
    `kernel.run_line`.

    A rope that is slack by the model has no tension that a torque follows from.
    """
    winch, gas, sign = model.winch, model.restoring, course.direction
    slow, omega = physics.near_rest(course.v, sign, winch), course.v / model.r_motion
    pressure = seen["pressure"] if gas.has_gas else np.zeros_like(course.v)
    screw = physics.piston_torque(pressure, gas) + physics.seal_torque(sign, slow, gas)
    screw *= physics.both_ways(sign, 1.0 / gas.eta_forward, gas.eta_reverse)
    lost = physics.line_losses(omega, sign, slow, winch) + winch.inertia * course.a / model.r_motion
    if physics.pulls(gas):
        lost += physics.pull_torque(
            course.x / model.r_motion, course.a / model.r_motion, winch.r_drum, gas
        )
        lost += physics.pull_friction(sign, winch.r_drum, gas)
    torque = (
        seen["force"] / physics.line_over_drum(sign, winch) * physics.rope_radius(course.x, winch)
        - screw
        - lost
    )
    known = course.moves
    return np.where(
        known & (course.engaged | (screw + lost > 0.0)) if winch.goes_slack else known,
        torque,
        np.nan,
    )


def _torque_of_shaft(model: Model, course: Along, drive: DriveCourse) -> Signal:
    """Torque of the PTO shaft that the high-speed shaft needs, (n,) [N m]; in haul-in that of the
    open clutch.

    The torque of the machine follows from the power across the air gap: neither k_e nor its
    roll-off enters.
    """
    shaft, machine = model.drivetrain, model.generator
    dragging = physics.open_clutch(course.direction, shaft)
    torque = np.where(course.moves & (course.v < 0.0), dragging, np.nan)
    known = course.engaged & (drive.rpm > rpm_min(drive.rpm)) & np.isfinite(drive.i_bridge)
    omega, vdc, current = (
        drive.rpm[known] / RPM,
        drive.vdc[known],
        np.maximum(drive.i_bridge[known], 0.0),
    )
    _, i_s = back_emfs(machine, omega, vdc, current)
    torque_em = physics.air_gap_power(vdc, current, i_s, machine) / omega
    turn = physics.TURN * course.motion.rest / model.r_motion * shaft.gear
    drag, _ = physics.total(
        physics.shaft_losses(omega, physics.direction(omega, turn), turn, shaft)
    )
    speeding = shaft.inertia_rotor * course.a[known] / model.r_motion * shaft.gear
    torque[known] = shaft.gear / shaft.eta_mesh * (torque_em + drag + speeding)
    return torque


def _voltage(model: Model, course: Along, drive: DriveCourse) -> Signal:
    """DC voltage at which the machine gives the current of the bridge, (n,) [V]."""
    known = course.engaged & (drive.rpm > rpm_min(drive.rpm)) & (drive.i_bridge > 0.0)
    known &= drive.i_bridge > CONDUCTING * np.maximum(drive.i_load, 0.0)
    v_total, _ = dc_voltages(
        model.generator, drive.rpm[known] / RPM, drive.i_bridge[known], bridge_table()
    )
    found = np.full(known.size, np.nan)
    found[known] = np.where(v_total > 0.0, v_total - 2.0 * model.generator.v_diode, np.nan)
    return found
