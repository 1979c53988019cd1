"""What a machine with the numbers of the rig file cannot exceed: the power of its line, that of its
shaft, and the peak of its back-EMF.

All hold whatever losses the rig file leaves out, as a loss lowers what comes out alone. A gain of
torque, velocity or DC channels by which more comes out than goes in is therefore visible in one
log. An offset of the torque that is present while the line moves alone is not, up to the friction
of the restoring module: every channel reads as with friction behind the sensor instead of
before it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import median, median_and_error
from winchcascade.core.quantity import TURN, Quantity
from winchcascade.core.run import Signal
from winchcascade.core.scales import SILICON
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog

POWER = 0.04
"""Smallest share by which the power of the shaft or behind it exceeds the one before it in a
finding: the shaft rings on a short plateau, and a coarse log does not average that out. [1]"""

VOLTAGE = 0.05
"""The same of Vdc over the peak of the back-EMF, as entries of gear and radius err by some percent.
[1]"""

STATOR = 0.75
"""Smallest rms current of the stator over the current of a diode bridge: sqrt(2/3) for a stiff
current, less with a capacitor and reactance. [1]"""


class Bound(NamedTuple):
    """Share by which one quantity exceeds what bounds it, of each plateau (k,), with its standard
    uncertainty, and the least that is reported [1]."""

    name: str
    channel: str
    excess: Signal
    u: float
    least: float


def exceeded(log: PhasedLog) -> Iterator[Fault]:
    """Bounds that the usual plateau of a log exceeds."""
    for bound in (power_of_line(log), power_of_shaft(log), peak_of_voltage(log)):
        if bound is None:
            continue
        excess, scatter = median_and_error(bound.excess)
        u = math.hypot(bound.u, scatter)
        if excess > max(bound.least, CERTAIN * u):
            values = {
                "ratio": 1.0 + excess,
                "low": 1.0 + excess - 2.0 * u,
                "high": 1.0 + excess + 2.0 * u,
            }
            yield Fault(bound.name, bound.channel, log.level, values)


def _means(log: PhasedLog, *names: str) -> list[Signal] | None:
    """Means of channels over each plateau, (k,) each; None where the log lacks one, or plateaus."""
    if not log.level_rows or not log.level_means.keys() >= {*names}:
        return None
    return [log.level_means[name] for name in names]


def _ratio_of_speeds(log: PhasedLog) -> float | None:
    """Speed of the rotor over that of the line. [rad/m]"""
    radius, gear = log.rig.r_drum, log.rig.drivetrain.gear_ratio
    return None if radius is None or gear is None else gear.value / radius


def power_of_line(log: PhasedLog) -> Bound | None:
    """P_mech over P_line without what the restoring module takes: at least what holds the gas, or
    the line at rest, as friction and the gas add to it in a payout."""
    means, radius = _means(log, "force", "torque"), log.rig.r_drum
    if means is None or radius is None:
        return None
    force, torque = means
    held = [min(tension, balanced) for _, tension, balanced in log.forces_at_rest]
    drives = force - (max(median(np.array(held)), 0.0) if held else 0.0)
    if not (drives > 0.0).all():
        return None
    u = _u(log, (("torque", torque), ("force", drives)))
    return Bound("more_than_line", "torque", torque / (drives * radius) - 1.0, u, POWER)


def power_of_shaft(log: PhasedLog) -> Bound | None:
    """P_gen with the losses in mesh, copper, diodes and viscous loss of the rig file states, over
    P_mech. What DC capacitor and rotor take up or give back between the ends of a plateau counts."""
    train, machine, radius = log.rig.drivetrain, log.rig.generator, log.rig.r_drum
    means, per_line = _means(log, "velocity", "torque", "vdc", "idc"), _ratio_of_speeds(log)
    if means is None or per_line is None or radius is None or log.idle:
        return None
    v, torque, v_dc, i_dc = means
    mesh = _stated(log, "drivetrain.eta_mesh", train.eta_mesh, 1.0)
    copper = 3.0 * STATOR**2 * _stated(log, "generator.r_s", machine.r_s, 0.0)
    damper = _stated(log, "drivetrain.b_rotor", train.b_rotor, 0.0)
    diode = _stated(log, "generator.v_diode", machine.v_diode, SILICON)
    put, got = (
        torque * v / radius * mesh,
        (v_dc + 2.0 * diode + copper * i_dc) * i_dc + damper * (per_line * v) ** 2,
    )
    if not (put > 0.0).all():
        return None
    stores = (("vdc", log.rig.dc_link.c_dc, 1.0), ("velocity", train.inertia_rotor, per_line**2))
    for name, store, scale in stores:
        if store is not None:
            got = got + 0.5 * store.value * scale * _rises_of_square(log, name)
    channels = (("torque", torque), ("vdc", v_dc), ("idc", i_dc))
    return Bound("more_than_shaft", "torque", got / put - 1.0, _u(log, channels), POWER)


def _rises_of_square(log: PhasedLog, name: str) -> Signal:
    """Mean rate at which the square of a channel rises over each plateau, (k,). [unit squared per
    second]"""
    x = log.run.channels[name]
    rates = [
        (x[rows][-1] ** 2 - x[rows][0] ** 2) * log.run.fs / (rows.stop - rows.start)
        for rows in log.level_rows
    ]
    return np.array(rates)


def _stated(log: PhasedLog, path: str, number: Quantity | None, other: float) -> float:
    """A number that the file of the rig itself states, SI unit; another value in place of one that
    it lacks or takes from the rig it is based on."""
    return number.value if number is not None and log.rig.states(path) else other


def peak_of_voltage(log: PhasedLog) -> Bound | None:
    """Vdc over the peak of the back-EMF between two lines at the speed of the rotor (Eq. 8)."""
    k_e, means, per_line = (
        log.rig.generator.k_e,
        _means(log, "velocity", "vdc"),
        _ratio_of_speeds(log),
    )
    if k_e is None or means is None or per_line is None:
        return None
    if not log.rig.states("generator.k_e", "drivetrain.gear_ratio", "winch.r_drum"):
        return None
    v, v_dc = means
    # A capacitor without load holds the highest speed that the rotor had.
    least = VOLTAGE + (log.overshoot if log.idles else 0.0)
    peak = math.sqrt(2.0) * k_e.value * 60.0 / TURN * per_line * v
    u = math.hypot(_u(log, (("vdc", v_dc),)), (k_e.u or 0.0) / k_e.value)
    return Bound("more_than_emf", "vdc", v_dc / peak - 1.0, u, least)


def _u(log: PhasedLog, channels: tuple[tuple[str, Signal], ...]) -> float:
    """Standard uncertainty of a product of channels by zeros and gains of their sensors. [1]"""
    parts = [
        (log.phased.u_gain(name), log.phased.u_zero(name) / max(median(np.abs(x)), 1e-300))
        for name, x in channels
    ]
    return math.hypot(*(u for part in parts for u in part))
