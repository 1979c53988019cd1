"""Whether the electrical channels agree with the stated load, and with the power of the shaft.

On the plateau Vdc / Idc is the load. The ratio cannot show an Idc that was computed from the stated load; the power of
the shaft can: it has to cover the power at the DC link and the losses between the two that the rig file gives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from winchcascade.core.accuracy import open_circuit_current
from winchcascade.core.integrate import median_and_error
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Signal
from winchcascade.reduction.phase_summary import PhaseSummary, PlateauSummary
from winchcascade.reduction.phased_run import PhasedRun

Number = TypeVar("Number", float, "Signal")

MISMATCH = 0.10
"""Smallest deviation of a load or of a power that is reported: resistors drift by less when they heat. [1]"""

CERTAIN = 5.0
"""Number of standard uncertainties that it must exceed too."""

UNEXPLAINED = 0.25
"""Smallest power of the shaft beyond DC link and known losses that is reported, as a share of these: dry friction, iron losses,
hot copper and a worn gear, which a rig file does not list, take up to half of it. [1]"""

DRAG = 0.2
"""Share of the power of the shaft above which speed-dependent drag, poorly known, hides what the DC link takes. [1]"""

STATOR = 0.8
"""Stator rms current over DC current of a three-phase diode bridge: 0.75 to 0.83 (0.816 for a block current). [1]"""


class _Operating(NamedTuple):
    """Means over one plateau: Vdc [V], Idc [A] and the summary of the plateau."""

    v_dc: float
    i_dc: float
    plateau: PlateauSummary


def load_findings(phased: PhasedRun, summaries: Sequence[PhaseSummary]) -> list[Finding]:
    """Report a load that Vdc / Idc contradicts, and electrical power that the torque contradicts."""
    channels, points = phased.run.channels, []
    if "vdc" not in channels or "idc" not in channels:
        return []
    for k in phased.chosen():
        plateau = summaries[k].payout.plateau
        if plateau is not None:
            v_dc, i_dc = (channels[name][phased.rows(plateau.begin, plateau.braking)] for name in ("vdc", "idc"))
            points += [_Operating(float(v_dc.mean()), float(i_dc.mean()), plateau)] if v_dc.size else []
    if not points:
        return []
    voltage, current = _middle([p.v_dc for p in points])[0], _middle([p.i_dc for p in points])[0]
    if phased.run.open_circuit:
        if current <= open_circuit_current(phased.rig, voltage):
            return []
        message = (
            f"load inf is stated, but Vdc {voltage:.4g} V and Idc {current:.4g} A on the plateau are "
            f"{voltage * current:.3g} W, as of a load of {voltage / current:.4g} ohm"
        )
        action = (
            "the log is reduced as open circuit, without eta_gen and eta_pto; state its load, or check Vdc and Idc: this "
            "ratio cannot distinguish them"
        )
        return [_finding(points, message, action)]
    found = _other_power(phased, points)
    if _contradicts_load(phased, points, voltage):
        ohm = f"{voltage / current:.4g} ohm" if current > 0.0 else "no load"
        message = (
            f"load {phased.run.load:g} ohm is stated, but Vdc / Idc on the plateau is {voltage:.4g} V / {current:.4g} A = "
            f"{ohm}"
        )
        action = "reported and kept; check the load, Vdc and Idc: this ratio cannot distinguish them"
        return [_finding(points, message, action), *found]
    return found


def _contradicts_load(phased: PhasedRun, points: list[_Operating], voltage: float) -> bool:
    """Whether Idc times load over Vdc deviates from 1 by more than `MISMATCH` and by more than its uncertainty allows."""
    load, u_zero = phased.run.load, phased.u_zero("vdc")
    if load is None or load <= 0.0 or voltage <= max(CERTAIN * u_zero, 0.0):
        return False
    share, u_share = _middle([p.i_dc * load / p.v_dc if p.v_dc > 0.0 else 0.0 for p in points])
    gains = share * math.hypot(phased.u_gain("vdc"), phased.u_gain("idc"), phased.rig.dc_link.load_u)
    u = math.hypot(gains, phased.u_zero("idc") * load / voltage, share * u_zero / voltage, u_share)
    return not 1.0 / (1.0 + MISMATCH) < share < 1.0 + MISMATCH and abs(share - 1.0) >= CERTAIN * u


def _other_power(phased: PhasedRun, points: list[_Operating]) -> list[Finding]:
    """Electrical power that the torque contradicts: the shaft has to cover it and the losses of the rig."""
    usable = [p for p in points if (p.plateau.power_mech or 0.0) > 0.0]
    if not usable:
        return []
    needed = [_needed(p, phased.rig) for p in usable]
    shaft = [p.plateau.power_mech or 0.0 for p in usable]
    ratio, u_ratio = _middle([n[0] / s for n, s in zip(needed, shaft, strict=True)])
    first = usable[0]
    levels = {"vdc": first.v_dc, "idc": first.i_dc, "torque": first.plateau.torque or math.inf}
    gains = (ratio * phased.u_gain(name) for name in levels)
    u = math.hypot(*gains, *(ratio * phased.u_zero(c) / max(abs(x), 1e-9) for c, x in levels.items()), u_ratio)
    complete = all(n[1] is not None and n[1] <= DRAG * s for n, s in zip(needed, shaft, strict=True))
    too_much = ratio >= 1.0 + MISMATCH and ratio - 1.0 >= CERTAIN * u
    too_little = complete and ratio <= 1.0 / (1.0 + UNEXPLAINED) and 1.0 - ratio >= CERTAIN * u
    if not (too_much or too_little):
        return []
    given, taken = _middle([p.plateau.power_gen or 0.0 for p in usable])[0], _middle(shaft)[0]
    return [
        _finding(
            usable,
            f"on the plateau Vdc x Idc is {given:.4g} W, which with the losses of the rig {phased.rig.name} needs "
            f"{ratio * taken:.4g} W at the shaft; torque and velocity give {taken:.4g} W",
            "reported and kept; check Vdc, Idc and torque, and whether Idc was computed from a load that is not the true one",
        )
    ]


def _middle(values: list[float]) -> tuple[float, float]:
    return median_and_error(np.array(values))


def _needed(point: _Operating, rig: Rig) -> tuple[float, float | None]:
    """Power of the shaft that a DC power needs with the losses that a rig file gives, and its part of drag. [W]

    The drag is None where the rig file lacks a loss: what is then needed is only a lower limit.
    """
    omega = (point.plateau.speed or 0.0) * (rig.rpm_per_velocity or 0.0) * math.pi / 30.0
    needed = (point.plateau.power_gen or 0.0) + losses(rig, point.i_dc, omega)
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


def _finding(points: list[_Operating], message: str, action: str) -> Finding:
    return Finding(
        "load_mismatch",
        message,
        action,
        start=points[0].plateau.begin,
        end=points[-1].plateau.braking,
        count=len(points),
    )
