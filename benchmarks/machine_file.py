"""The rig file of a rig of any size, with the entries that the file of the paper has, and its
logs in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from drawn_machine import Machine

from winchcascade.blind.twin_numbers import AIR, RESTORING_SHARES, SCATTER, Numbers, Restoring
from winchcascade.core.run import Signal

PAPER = Numbers()

LOG_FACTORS = {
    "time": "time", "displacement": "length", "velocity": "speed", "pressure": "one", "force": "force",
    "torque": "torque", "vdc": "volt", "idc": "ampere",
}  # fmt: skip
"""Factor of `Units` of each channel of a log."""

DIGITS = 9
"""Significant digits of a rescaled reading: more than any sensor resolves, so that steps stay
steps.
"""


def in_si_units(machine: Machine, columns: Mapping[str, Signal]) -> dict[str, Signal]:
    """Columns of a log of the twin in SI units, as its logger writes them; pressures stay."""
    found = {}
    for name, value in columns.items():
        factor = machine.units.factor(LOG_FACTORS[name])
        decimals = DIGITS - 4 if name == "time" else DIGITS - 4 - math.floor(math.log10(factor))
        found[name] = value if factor == 1.0 else np.round(value * factor, decimals)
    return found


class Stated(NamedTuple):
    """An entry of a rig file: value and standard uncertainty (0 for one that is exact) in the units
    of the rig, factor of `Units`, and the unit of the file.
    """

    value: float
    factor: str
    unit: str
    u: float = 0.0


def _numbers(machine: Machine) -> dict[str, dict[str, Stated]]:
    """Numbers of a rig file by section and key."""
    n, fixed = machine.numbers, machine.fixed
    u = Numbers(*(share * by for share, by in zip(SCATTER, machine.relative, strict=True)))
    drivetrain = {
        "gear_ratio": Stated(fixed.gear * machine.units.gear, "one", "1"),
        "eta_mesh": Stated(n.eta_mesh, "one", "1", u.eta_mesh),
        "b_rotor": Stated(n.b_rotor, "damping_rotor", "N.m.s/rad", u.b_rotor),
        "k_shaft": Stated(fixed.k_shaft, "torque", "N.m/rad"),
        "c_shaft": Stated(fixed.c_shaft, "damping", "N.m.s/rad"),
        "inertia_rotor": Stated(fixed.j_rotor, "inertia_rotor", "kg.m2"),
    }
    if machine.direct:
        drivetrain["gear_ratio"] = Stated(1.0, "one", "1")
        del drivetrain["eta_mesh"]
    return {
        "winch": {
            "r_drum": Stated(fixed.r_drum, "length", "m"),
            "inertia": Stated(fixed.j_drum, "inertia", "kg.m2"),
        },
        "restoring": _gas(machine, u) if machine.restoring.has_gas else _pull(machine.restoring),
        "drivetrain": drivetrain,
        "generator": {
            "pole_pairs": Stated(round(fixed.pole_pairs / machine.units.gear), "one", "1"),
            "k_e": Stated(n.k_e, "volt_per_rotor", "V/rpm", u.k_e),
            "r_s": Stated(n.r_s, "ohm", "ohm", u.r_s),
            "l_s": Stated(n.l_s, "henry", "H", u.l_s),
            "v_diode": Stated(fixed.v_diode, "volt", "V"),
            "speed_rated": Stated(2000.0, "omega_rotor", "rpm"),
            "i_rated": Stated(5.16, "ampere", "A"),
        },
        "dc_link": {
            "c_dc": Stated(n.c_dc, "farad", "F", u.c_dc),
            "r_bleed": Stated(machine.loads["open_circuit"], "ohm", "ohm"),
        },
    }


def _gas(machine: Machine, u: Numbers) -> dict[str, Stated]:
    """Numbers of screw, piston and gas."""
    n, fixed = machine.numbers, machine.fixed
    return {
        "lead": Stated(fixed.lead, "lead", "m/rev"),
        "lead_angle": Stated(fixed.lead_angle, "one", "deg"),
        "half_angle": Stated(fixed.thread_angle, "one", "deg"),
        "mu_screw": Stated(n.mu, "one", "1", u.mu),
        "area_piston": Stated(n.area, "thrust", "m2", u.area),
        "p_precharge": Stated(n.p_gas - AIR, "one", "Pa", u.p_gas),
        "volume_gas": Stated(n.v_gas, "volume", "m3", u.v_gas),
    }


def _pull(restoring: Restoring) -> dict[str, Stated]:
    """Numbers of a spring or a counterweight; a mass is stated by the weight that a
    kilogram-force is.
    """
    friction = Stated(
        restoring.friction, "force", "N", RESTORING_SHARES["friction"] * restoring.friction
    )
    if restoring.kind == "spring":
        stiffness = RESTORING_SHARES["stiffness"] * restoring.stiffness
        return {
            "force": Stated(
                restoring.force, "force", "N", RESTORING_SHARES["force"] * restoring.force
            ),
            "stiffness": Stated(restoring.stiffness, "line_stiffness", "N/m", stiffness),
            "friction": friction,
        }
    if restoring.kind == "counterweight":
        mass, share = restoring.weight / Restoring().gravity, RESTORING_SHARES["weight"]
        return {"mass": Stated(mass, "force", "kg", share * mass), "friction": friction}
    return {}


SENSORS = {
    "displacement": ("m", "length", {"resolution": 0.000798, "accuracy": 0.000794}),
    "velocity": ("m/s", "speed", {}),
    "pressure": ("MPa", "one", {"low": 0.0, "high": 20.0, "u_zero": 0.002942}),
    "force": ("N", "force", {"high": 39226.6, "resolution": 1.96133, "u_zero": 2.0}),
    "torque": ("N.m", "torque", {"low": -1000.0, "high": 1000.0, "u_zero": 0.3}),
    "vdc": ("V", "volt", {"u_zero": 0.05}),
    "idc": ("A", "ampere", {"u_zero": 0.005}),
}
"""Sensors as in the rig file of the paper: unit, factor of `Units`, and numbers; ranges of force
and torque are twice as wide, as the loads of a drawn rig scatter."""

U_GAIN = 0.001
"""Standard uncertainty of the gain of each sensor but those of the motion. [1]"""

THRESHOLDS = {
    "v_onset": (0.03, "speed", "m/s"), "stroke_min": (0.2, "length", "m"), "tau_engaged": (2.0, "torque", "N.m"),
    "smoothing": (0.6, "time", "s"), "plateau_hold": (0.2, "time", "s"), "settle": (0.5, "time", "s"),
    "gap_max": (1.0, "time", "s"),
}  # fmt: skip
"""Thresholds of the paper's rig file with a dimension: value, factor of `Units`, and unit."""

RPM_BIN, RPM_BIN_MIN = 100.0, 1.0
"""Width of a bin of generator speed, and the narrowest that a rig file may state. [rpm]"""


def machine_toml(machine: Machine, name: str, entries: Mapping[str, float] | None = None) -> str:
    """Make the rig file of a rig.

    Parameters
    ----------
    entries : stated over right value of wrong entries, by key [1]
    """
    wrong, factor = entries or {}, machine.units.factor
    lines = [
        f'name = "{name}"',
        f'title = "Drawn rig: {machine.text}"',
        'source = "drawn, not built"',
    ]
    for section, numbers in _numbers(machine).items():
        lines += ["", f"[{section}]"]
        if section == "restoring":
            lines.append(f'kind = "{machine.restoring.kind}"')
        for key, one in numbers.items():
            by = factor(one.factor) * wrong.get(key, 1.0)
            u = f", u = {one.u * by:.4g}" if one.u else ""
            lines.append(f'{key} = {{ value = {one.value * by:.9g}, unit = "{one.unit}"{u} }}')
        lines += {"drivetrain": ["one_way_clutch = true"], "dc_link": ["load_u_percent = 0.1"]}.get(
            section, []
        )
    for channel, (unit, quantity, numbers_of_sensor) in SENSORS.items():
        if channel == "pressure" and not machine.restoring.has_gas:
            continue
        lines += ["", f"[sensors.{channel}]", f'unit = "{unit}"']
        lines += [
            f"{key} = {value * factor(quantity):.6g}" for key, value in numbers_of_sensor.items()
        ]
        lines += [f"u_gain = {U_GAIN}"] if "u_zero" in numbers_of_sensor else []
    ramps = min(machine.crane.ramp, 1.0)
    strokes = min(machine.crane.stroke, 1.0)
    lines += ["", "[thresholds]"]
    for key, (value, quantity, unit) in THRESHOLDS.items():
        share = {"time": ramps, "length": strokes}.get(quantity, 1.0)
        lines.append(
            f'{key} = {{ value = {value * share * factor(quantity):.6g}, unit = "{unit}" }}'
        )
    lines.append(f"rpm_bin = {max(RPM_BIN * factor('omega_rotor'), RPM_BIN_MIN):.6g}")
    return "\n".join(lines) + "\n"
