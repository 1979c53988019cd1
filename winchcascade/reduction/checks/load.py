"""Whether the electrical channels agree with the stated load, and with the power of the shaft.

On the plateau Vdc / Idc is the load. The ratio cannot show an Idc that was computed from the stated load; the power of
the shaft can: it has to cover the power at the DC link and the losses between the two that the rig file gives.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeVar

import numpy as np

from winchcascade.core.accuracy import CERTAIN, error_sources, open_circuit_current
from winchcascade.core.integrate import median, median_and_error, smallest_step
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Mask, Signal
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.reduction_result import MeasuredLoad

Number = TypeVar("Number", float, "Signal")

MISMATCH = 0.10
"""Smallest deviation of a power that is reported, and of a load where the accuracy of Vdc or Idc is unknown. [1]"""

UNEXPLAINED = 0.25
"""Smallest power of the shaft beyond DC link and known losses that is reported, as a share of these: dry friction, iron losses,
hot copper and a worn gear, which a rig file does not list, take up to half of it. [1]"""

DRAG = 0.2
"""Share of the power of the shaft above which speed-dependent drag, poorly known, hides what the DC link takes. [1]"""

STATOR = 0.8
"""Stator rms current over DC current of a three-phase diode bridge: 0.75 to 0.83 (0.816 for a block current). [1]"""


def losses(rig: Rig, i_dc: Number, omega: Number) -> Number:
    """Power lost in diodes, copper and by drag of the fast shaft, of those that a rig file gives. [W]

    Parameters
    ----------
    i_dc : DC current [A]
    omega : speed of the fast shaft [rad/s]
    """
    machine, drag = rig.generator, rig.drivetrain.b_rotor
    diodes = 2.0 * machine.v_diode.value if machine.v_diode else 0.0
    copper = 3.0 * machine.r_s.value * STATOR**2 if machine.r_s else 0.0
    return (diodes + copper * i_dc) * i_dc + (drag.value if drag else 0.0) * omega * omega


def measured_load(log: PhasedLog) -> MeasuredLoad | None:
    """Vdc / Idc with its standard uncertainty; None without a current that is more than the zero of its sensor."""
    v_dc, i_dc = log.points.mean
    flowing = (i_dc > log.zero_limit("idc")) & (v_dc > 0.0)
    if 2 * np.count_nonzero(flowing) <= flowing.size:
        return None
    (volt, u_v), (ampere, u_i) = (_level(log, k, flowing) for k in range(2))
    ohm, scatter = volt / ampere, median_and_error(v_dc[flowing] / i_dc[flowing])[1]
    return MeasuredLoad(ohm, math.hypot(ohm * u_v / volt, ohm * u_i / ampere, scatter))


def _level(log: PhasedLog, k: int, chosen: Mask | slice) -> tuple[float, float]:
    """Median over some operating points of Vdc (k = 0) or Idc (k = 1) with the standard uncertainty of gain, zero, resolution
    and noise; the scatter of the points is not part of it. [V or A]
    """
    name, errors = ("vdc", "idc")[k], log.points.error[k, chosen]
    level = median(log.points.mean[k, chosen])
    step = smallest_step(log.phased.run.channels[name]) / math.sqrt(12.0)
    noise = math.hypot(*errors) / errors.size
    return level, math.hypot(level * log.phased.u_gain(name), log.phased.u_zero(name), step, noise)


def other_load(log: PhasedLog) -> Iterator[Fault]:
    """A load that Vdc / Idc contradicts, also an open circuit that delivers power, and one that is not stated.

    Vdc deviates from Idc times the load by more than the uncertainties of the sensors and of the load allow. The bleed
    resistance may lie on either side of the sensor of Idc, which then reads more than the load takes; that counts where the
    log would show it. Where the accuracy of a sensor is unknown, the deviation must also exceed `MISMATCH`.
    """
    points, load, rig = log.points, log.phased.run.load, log.phased.rig
    if not points.spans:
        return
    v_dc, i_dc = points.mean
    (volt, u_v), (ampere, u_i) = (_level(log, k, slice(None)) for k in range(2))
    idle = ampere <= open_circuit_current(rig, volt)
    values = {
        "volt": volt, "ampere": ampere, "watt": volt * ampere, "load": load,
        "where": "on the plateau" if points.plateaus[0] is not None else "over the cycles",
        "ohm": f"{volt / ampere:.4g} ohm" if ampere > 0.0 else "no load",
    }  # fmt: skip
    if load is None:
        if idle and volt > log.zero_limit("vdc"):
            yield Fault("load_not_stated", None, values, spans=points.spans)
        return
    if math.isinf(load):
        if not idle:
            yield Fault("loaded_open_circuit", None, values, spans=points.spans)
        return
    link, level = rig.dc_link, max(abs(volt), abs(load * ampere))
    shares = (v_dc - load * i_dc) / np.maximum(np.maximum(np.abs(v_dc), np.abs(load * i_dc)), np.finfo(float).tiny)
    apart, scatter = median_and_error(shares)
    u = math.hypot(u_v / level, load * u_i / level, link.load_u, scatter) if level else math.inf
    bled = load / link.r_bleed.value if link.r_bleed is not None and link.r_bleed.value > 0.0 else 0.0
    if apart < 0.0 and bled >= CERTAIN * u:
        apart = min(apart + bled, 0.0)
    known = all((s := rig.sensors.get(name)) is not None and error_sources("", s) for name in ("vdc", "idc"))
    if abs(apart) >= max(CERTAIN * u, 0.0 if known else MISMATCH):
        yield Fault("other_load", None, values, spans=points.spans)


def shaft_power(log: PhasedLog) -> Iterator[Fault]:
    """Electrical power that the torque contradicts: the shaft has to cover it and the losses of the rig.

    Where the rig file lacks a loss, or where drag takes a large share, what the shaft needs is only a lower limit.
    """
    phased, rig, points = log.phased, log.phased.rig, log.points
    usable = [k for k, p in enumerate(points.plateaus) if p is not None and (p.power_mech or 0.0) > 0.0]
    if not usable or phased.run.open_circuit:
        return
    flat = [
        (p.power_gen or 0.0, p.power_mech or 0.0, p.speed or 0.0) for p in (points.plateaus[k] for k in usable) if p
    ]
    given, shaft, speed = np.array(flat).T
    omega = speed * ((rig.rpm_per_velocity or 0.0) * math.pi / 30.0)
    mesh, drag = rig.drivetrain.eta_mesh, rig.drivetrain.b_rotor
    efficiency = mesh.value if mesh else 1.0
    needed = (given + losses(rig, points.mean[1, usable], omega)) / efficiency
    known = drag is not None and None not in (rig.generator.v_diode, rig.generator.r_s, mesh, rig.rpm_per_velocity)
    dragged = drag.value * omega**2 / efficiency if drag else np.zeros(omega.size)
    complete = known and bool(np.all(dragged <= DRAG * shaft))
    ratio, u_ratio = median_and_error(needed / shaft)
    plateau = points.plateaus[usable[0]]
    torque = plateau.torque if plateau is not None else None
    levels = {"vdc": points.mean[0, usable[0]], "idc": points.mean[1, usable[0]], "torque": torque or math.inf}
    errors = [phased.u_gain(c) for c in levels] + [phased.u_zero(c) / max(abs(x), 1e-9) for c, x in levels.items()]
    u = math.hypot(ratio * math.hypot(*errors), u_ratio)
    too_much = ratio >= 1.0 + MISMATCH
    too_little = complete and ratio <= 1.0 / (1.0 + UNEXPLAINED)
    if (too_much or too_little) and abs(ratio - 1.0) >= CERTAIN * u:
        values = {"rig": rig.name, "given": median(given), "needed": ratio * median(shaft), "taken": median(shaft)}
        yield Fault("shaft_power", None, values, spans=[points.spans[k] for k in usable])
