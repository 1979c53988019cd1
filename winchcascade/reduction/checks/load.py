"""Whether the electrical channels agree with the stated load, and with the power of the shaft.

On the plateau Vdc / Idc is the load. The ratio cannot show an Idc that was computed from the stated load; the power of
the shaft can: it has to cover the power at the DC link and the losses between the two that the rig file gives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from winchcascade.core.accuracy import CERTAIN, error_sources, open_circuit_current
from winchcascade.core.integrate import median_and_error, smallest_step
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Signal
from winchcascade.reduction.phase_summary import PhaseSummary, PlateauSummary
from winchcascade.reduction.phased_run import PhasedRun, span_end
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

TINY = 1e-12
"""No voltage is smaller. [V]"""

VDC, IDC = "vdc", "idc"


class Operating(NamedTuple):
    """Means of Vdc [V] and Idc [A] over one plateau or span, its begin and end [s], and the summary of the plateau.

    `errors` are the standard errors of both means by the scatter of the samples.
    """

    v_dc: float
    i_dc: float
    errors: tuple[float, float]
    begin: float
    end: float
    plateau: PlateauSummary | None


def operating_points(phased: PhasedRun, summaries: Sequence[PhaseSummary]) -> list[Operating]:
    """Vdc and Idc on the plateau of each checked cycle; with a stated load also over a cycle that is found in no motion."""
    channels, by_motion = phased.run.channels, phased.rig.phases.by_motion
    if not {VDC, IDC} <= channels.keys() or (phased.run.load is None and not by_motion):
        return []
    points = []
    for k in phased.chosen():
        plateau, cycle = summaries[k].payout.plateau, phased.cycles[k]
        if by_motion and plateau is None:
            continue
        begin, end = (plateau.begin, plateau.braking) if plateau else (cycle.onset, span_end(cycle, phased.rig))
        v_dc, i_dc = (channels[name][phased.rows(begin, end)] for name in (VDC, IDC))
        if v_dc.size:
            errors = (_error(v_dc), _error(i_dc))
            points.append(Operating(float(v_dc.mean()), float(i_dc.mean()), errors, begin, end, plateau))
    return points


def _error(x: Signal) -> float:
    """Standard error of a mean by the noise of the samples, without their slow course."""
    return float(np.std(np.diff(x))) / math.sqrt(2.0 * x.size) if x.size > 1 else 0.0


def measured_load(phased: PhasedRun, points: Sequence[Operating]) -> MeasuredLoad | None:
    """Vdc / Idc with its standard uncertainty; None without a current that is more than the zero of its sensor."""
    flowing = [p for p in points if p.i_dc > CERTAIN * phased.u_zero(IDC) and p.v_dc > 0.0]
    if 2 * len(flowing) <= len(points):
        return None
    (v_dc, u_v), (i_dc, u_i) = (_mean(phased, flowing, k) for k in range(2))
    ohm, scatter = v_dc / i_dc, _middle([p.v_dc / p.i_dc for p in flowing])[1]
    return MeasuredLoad(ohm, math.hypot(ohm * u_v / v_dc, ohm * u_i / i_dc, scatter))


def _mean(phased: PhasedRun, points: Sequence[Operating], k: int) -> tuple[float, float]:
    """Median over the points of the mean Vdc (k = 0) or Idc (k = 1) with its standard uncertainty [V or A].

    The uncertainty is that of gain, zero, resolution and noise; the scatter of the points is not part of it.
    """
    name, mean = (VDC, IDC)[k], _middle([(p.v_dc, p.i_dc)[k] for p in points])[0]
    step = smallest_step(phased.run.channels[name]) / math.sqrt(12.0)
    noise = math.hypot(*(p.errors[k] for p in points)) / len(points)
    return mean, math.hypot(mean * phased.u_gain(name), phased.u_zero(name), step, noise)


def load_findings(phased: PhasedRun, points: Sequence[Operating]) -> list[Finding]:
    """Report a load that Vdc / Idc contradicts, and electrical power that the torque contradicts."""
    if not points:
        return []
    voltage, current = _middle([p.v_dc for p in points])[0], _middle([p.i_dc for p in points])[0]
    ohm = f"{voltage / current:.4g} ohm" if current > 0.0 else "no load"
    where = "on the plateau" if points[0].plateau is not None else "over the cycles"
    idle = current <= open_circuit_current(phased.rig, voltage)
    if phased.run.open_circuit:
        if idle:
            return []
        message = (
            f"load inf is stated, but Vdc {voltage:.4g} V and Idc {current:.4g} A {where} are "
            f"{voltage * current:.3g} W, as of a load of {ohm}"
        )
        action = (
            "the log is reduced as open circuit, without eta_gen and eta_pto; state its load, or check Vdc and Idc: this "
            "ratio cannot distinguish them"
        )
        return [_finding(points, message, action)]
    found = _other_power(phased, points)
    if phased.run.load is None:
        if not idle or voltage <= CERTAIN * phased.u_zero(VDC):
            return found
        message = (
            f"no load is stated, and Vdc {voltage:.4g} V with Idc {current:.4g} A {where} ({ohm}) is what an open "
            "circuit has"
        )
        action = "eta_gen and eta_pto are reported as of a load; state the load: inf for an open circuit"
        return [_finding(points, message, action), *found]
    if _contradicts_load(phased, points, phased.run.load):
        message = (
            f"load {phased.run.load:g} ohm is stated, but Vdc / Idc {where} is {voltage:.4g} V / {current:.4g} A = "
            f"{ohm}"
        )
        action = "reported and kept; check the load, Vdc and Idc: this ratio cannot distinguish them"
        return [_finding(points, message, action), *found]
    return found


def _contradicts_load(phased: PhasedRun, points: Sequence[Operating], load: float) -> bool:
    """Whether Vdc deviates from Idc times the load by more than the uncertainties of the sensors and of the load allow.

    The bleed resistance may lie on either side of the sensor of Idc, which then reads more than the load takes; that counts
    where the log would show it. Where the accuracy of a sensor is unknown, the deviation must also exceed `MISMATCH`.
    """
    link = phased.rig.dc_link
    (v_dc, u_v), (i_dc, u_i) = (_mean(phased, points, k) for k in range(2))
    level = max(abs(v_dc), abs(load * i_dc))
    shares = [(p.v_dc - load * p.i_dc) / max(abs(p.v_dc), abs(load * p.i_dc), TINY) for p in points]
    apart, scatter = _middle(shares)
    u = math.hypot(u_v / level, load * u_i / level, link.load_u, scatter) if level else math.inf
    bled = load / link.r_bleed.value if link.r_bleed is not None and link.r_bleed.value > 0.0 else 0.0
    if apart < 0.0 and bled >= CERTAIN * u:
        apart = min(apart + bled, 0.0)
    sensors = (phased.rig.sensors.get(name) for name in (VDC, IDC))
    known = all(sensor is not None and error_sources("", sensor) for sensor in sensors)
    return abs(apart) >= max(CERTAIN * u, 0.0 if known else MISMATCH)


def _other_power(phased: PhasedRun, points: Sequence[Operating]) -> list[Finding]:
    """Electrical power that the torque contradicts: the shaft has to cover it and the losses of the rig."""
    usable = [(p, p.plateau) for p in points if p.plateau is not None and (p.plateau.power_mech or 0.0) > 0.0]
    if not usable:
        return []
    needed = [_needed(p, plateau, phased.rig) for p, plateau in usable]
    shaft = [plateau.power_mech or 0.0 for _, plateau in usable]
    ratio, u_ratio = _middle([n[0] / s for n, s in zip(needed, shaft, strict=True)])
    first, plateau = usable[0]
    levels = {VDC: first.v_dc, IDC: first.i_dc, "torque": plateau.torque or math.inf}
    gains = (ratio * phased.u_gain(name) for name in levels)
    u = math.hypot(*gains, *(ratio * phased.u_zero(c) / max(abs(x), 1e-9) for c, x in levels.items()), u_ratio)
    complete = all(n[1] is not None and n[1] <= DRAG * s for n, s in zip(needed, shaft, strict=True))
    too_much = ratio >= 1.0 + MISMATCH and ratio - 1.0 >= CERTAIN * u
    too_little = complete and ratio <= 1.0 / (1.0 + UNEXPLAINED) and 1.0 - ratio >= CERTAIN * u
    if not (too_much or too_little):
        return []
    given, taken = _middle([plateau.power_gen or 0.0 for _, plateau in usable])[0], _middle(shaft)[0]
    return [
        _finding(
            [p for p, _ in usable],
            f"on the plateau Vdc x Idc is {given:.4g} W, which with the losses of the rig {phased.rig.name} needs "
            f"{ratio * taken:.4g} W at the shaft; torque and velocity give {taken:.4g} W",
            "reported and kept; check Vdc, Idc and torque, and whether Idc was computed from a load that is not the true one",
        )
    ]


def _middle(values: list[float]) -> tuple[float, float]:
    return median_and_error(np.array(values))


def _needed(point: Operating, plateau: PlateauSummary, rig: Rig) -> tuple[float, float | None]:
    """Power of the shaft that a DC power needs with the losses that a rig file gives, and its part of drag. [W]

    The drag is None where the rig file lacks a loss: what is then needed is only a lower limit.
    """
    omega = (plateau.speed or 0.0) * (rig.rpm_per_velocity or 0.0) * math.pi / 30.0
    needed = (plateau.power_gen or 0.0) + losses(rig, point.i_dc, omega)
    drag, mesh = rig.drivetrain.b_rotor, rig.drivetrain.eta_mesh
    efficiency = mesh.value if mesh else 1.0
    known = (rig.generator.v_diode, rig.generator.r_s, drag, mesh, rig.rpm_per_velocity)
    lost = None if drag is None or None in known else drag.value * omega**2 / efficiency
    return needed / efficiency, lost


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


def _finding(points: Sequence[Operating], message: str, action: str) -> Finding:
    return Finding(
        "load_mismatch",
        message,
        action,
        start=points[0].begin,
        end=points[-1].end,
        count=len(points),
    )
