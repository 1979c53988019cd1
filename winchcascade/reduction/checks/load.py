"""Whether the electrical channels agree with the stated load, and with the power of the shaft.

On the plateau Vdc / Idc is the load. The ratio cannot show an Idc that was computed from the stated load; the power of
the shaft can: it has to cover the power at the DC link and the losses between the two that the rig file gives.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

from winchcascade.core.accuracy import open_circuit_current
from winchcascade.core.run import Finding
from winchcascade.reduction.phased_run import middle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.reduction.phase_summary import PhaseSummary, PlateauSummary
    from winchcascade.reduction.phased_run import PhasedRun

Number = TypeVar("Number", float, "Signal")

MISMATCH = 0.10
"""Deviation of a load or of a power from which it is reported: resistors drift by less when they heat. [1]"""

CERTAIN = 5.0
"""It must exceed so many standard uncertainties too."""

UNEXPLAINED = 0.25
"""Power of the shaft beyond DC link and known losses from which it is reported, as a share of these: dry friction, iron losses,
hot copper and a worn gear take up to half of it unnoticed by the rig file. [1]"""

DRAG = 0.2
"""Share of the power of the shaft above which speed-dependent drag, poorly known, hides what the DC link takes. [1]"""

STATOR = 0.8
"""Stator rms current over DC current of a three-phase diode bridge: 0.75 to 0.83 (0.816 for a block current). [1]"""


class _Operating:
    """Means over one plateau: Vdc [V], Idc [A] and the summary of the plateau."""

    __slots__ = ("i_dc", "plateau", "v_dc")

    def __init__(self, v_dc: float, i_dc: float, plateau: PlateauSummary) -> None:
        self.v_dc, self.i_dc, self.plateau = v_dc, i_dc, plateau


def load_findings(phased: PhasedRun, summaries: Sequence[PhaseSummary]) -> list[Finding]:
    """Report a load that Vdc / Idc contradicts, and electrical power that the torque contradicts."""
    if "vdc" not in phased.run.channels or "idc" not in phased.run.channels:
        return []
    points = _operating_points(phased, summaries)
    if not points:
        return []
    if phased.run.open_circuit:
        return _delivering(phased, points)
    return [*_other_load(phased, points), *_other_power(phased, points)]


def _operating_points(phased: PhasedRun, summaries: Sequence[PhaseSummary]) -> list[_Operating]:
    found = []
    v_dc, i_dc = (phased.run.channels[name] for name in ("vdc", "idc"))
    for k in phased.chosen():
        plateau = summaries[k].payout.plateau
        if plateau is not None:
            rows = phased.rows(plateau.begin, plateau.braking)
            if rows.stop > rows.start:
                found.append(_Operating(float(v_dc[rows].mean()), float(i_dc[rows].mean()), plateau))
    return found


def _delivering(phased: PhasedRun, points: list[_Operating]) -> list[Finding]:
    """An open circuit in which more current flows than bleed resistance and zero of the sensor account for."""
    current, _ = middle([p.i_dc for p in points])
    voltage, _ = middle([p.v_dc for p in points])
    if current <= open_circuit_current(phased.rig, voltage):
        return []
    return [
        _finding(
            points,
            f"load inf is stated, but Vdc {voltage:.4g} V and Idc {current:.4g} A on the plateau are "
            f"{voltage * current:.3g} W, as of a load of {voltage / current:.4g} ohm",
            "the log is reduced as open circuit, without eta_gen and eta_pto; state its load, or check Vdc and Idc: this "
            "ratio cannot distinguish them",
        )
    ]


def _other_load(phased: PhasedRun, points: list[_Operating]) -> list[Finding]:
    """A stated load that Vdc / Idc contradicts."""
    load = phased.run.load
    if load is None or load <= 0.0:
        return []
    voltage, _ = middle([p.v_dc for p in points])
    current, _ = middle([p.i_dc for p in points])
    if voltage <= CERTAIN * phased.u_zero("vdc") or voltage <= 0.0:
        return []
    share, u_share = middle([p.i_dc * load / p.v_dc if p.v_dc > 0.0 else 0.0 for p in points])
    u = math.hypot(
        share
        * math.hypot(phased.u_gain("vdc"), phased.u_gain("idc"), phased.rig.dc_link.load_tolerance_percent / 100.0),
        phased.u_zero("idc") * load / voltage,
        share * phased.u_zero("vdc") / voltage,
        u_share,
    )
    if not _off(share, u):
        return []
    ohm = f"{voltage / current:.4g} ohm" if current > 0.0 else "no load"
    return [
        _finding(
            points,
            f"load {load:g} ohm is stated, but Vdc / Idc on the plateau is {voltage:.4g} V / {current:.4g} A = {ohm}",
            "reported and kept; check the load, Vdc and Idc: this ratio cannot distinguish them",
        )
    ]


def _off(ratio: float, u: float) -> bool:
    """Whether a ratio deviates from 1, upward or downward, by more than `MISMATCH` and by more than its uncertainty allows."""
    return (ratio >= 1.0 + MISMATCH or ratio <= 1.0 / (1.0 + MISMATCH)) and abs(ratio - 1.0) >= CERTAIN * u


def _other_power(phased: PhasedRun, points: list[_Operating]) -> list[Finding]:
    """Electrical power that the torque contradicts: the shaft has to cover it and the losses of the rig."""
    usable = [p for p in points if p.plateau.power_mech is not None and p.plateau.power_mech > 0.0]
    if not usable:
        return []
    needed = [_needed(p, phased.rig) for p in usable]
    shaft = [p.plateau.power_mech or 0.0 for p in usable]
    ratio, u_ratio = middle([n[0] / s for n, s in zip(needed, shaft, strict=True)])
    gains = math.hypot(*(phased.u_gain(name) for name in ("vdc", "idc", "torque")))
    zeros = math.hypot(*(phased.u_zero(c) / max(abs(x), 1e-9) for c, x in _levels(usable[0])))
    u = math.hypot(ratio * gains, ratio * zeros, u_ratio)
    complete = all(n[1] is not None and n[1] <= DRAG * s for n, s in zip(needed, shaft, strict=True))
    too_much = ratio >= 1.0 + MISMATCH and ratio - 1.0 >= CERTAIN * u
    too_little = complete and ratio <= 1.0 / (1.0 + UNEXPLAINED) and 1.0 - ratio >= CERTAIN * u
    if not (too_much or too_little):
        return []
    given, _ = middle([p.plateau.power_gen or 0.0 for p in usable])
    taken, _ = middle(shaft)
    return [
        _finding(
            usable,
            f"on the plateau Vdc x Idc is {given:.4g} W, which with the losses of the rig {phased.rig.name} needs "
            f"{ratio * taken:.4g} W at the shaft; torque and velocity give {taken:.4g} W",
            "reported and kept; check Vdc, Idc and torque, and whether Idc was computed from a load that is not the true one",
        )
    ]


def _levels(point: _Operating) -> list[tuple[str, float]]:
    return [("vdc", point.v_dc), ("idc", point.i_dc), ("torque", point.plateau.torque or math.inf)]


def _needed(point: _Operating, rig: Rig) -> tuple[float, float | None]:
    """Power of the shaft that a DC power needs with the losses that a rig file gives, and its part of drag. [W]

    The drag is None where the rig file lacks a loss: what is then needed is only a lower limit.
    """
    omega = point.plateau.speed * (rig.rpm_per_velocity or 0.0) * math.pi / 30.0
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
