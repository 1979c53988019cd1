"""Rigs of other parts than those of the paper: a spring, a counterweight or nothing in place of
the gas, and a direct drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec
import numpy as np
from openlog import motion_run
from paper_rules import PAPER_RULES

from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import Run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.simulate import simulate

RESTORING = {
    "gas_screw": """
lead = { value = 10, unit = "mm/rev" }
lead_angle = { value = 5, unit = "deg" }
half_angle = { value = 4.5, unit = "deg" }
mu_screw = { value = 0.04, unit = "1", u = 0.0005 }
area_piston = { value = 7850, unit = "mm2", u_percent = 0.2 }
p_precharge = { value = 20.5, unit = "kg/cm2", u_percent = 0.1 }
volume_gas = { value = 4, unit = "L", u_percent = 0.3 }""",
    "spring": """
kind = "spring"
force = { value = 300, unit = "N", u = 3 }
stiffness = { value = 40, unit = "N/m", u_percent = 1 }
friction = { value = 10, unit = "N", u = 2 }""",
    "counterweight": """
kind = "counterweight"
mass = { value = 40, unit = "kg", u = 0.2 }
friction = { value = 8, unit = "N", u = 2 }""",
    "none": """
kind = "none\"""",
}
"""A table [restoring] for each kind."""

SHAFT = {
    "geared": """
gear_ratio = { value = 30, unit = "1" }
eta_mesh = { value = 0.96, unit = "1", u = 0.003 }
b_rotor = { value = 1e-3, unit = "N.m.s/rad", u_percent = 3 }
k_shaft = { value = 3000, unit = "N.m/rad" }
c_shaft = { value = 8, unit = "N.m.s/rad" }
inertia_rotor = { value = 2e-3, unit = "kg.m2" }
[generator]
pole_pairs = { value = 3, unit = "1" }
k_e = { value = 0.075, unit = "V/rpm", u_percent = 0.2 }
r_s = { value = 0.8, unit = "ohm", u_percent = 0.5 }
l_s = { value = 4, unit = "mH", u_percent = 1 }""",
    "direct": """
gear_ratio = { value = 1, unit = "1" }
b_rotor = { value = 0.8, unit = "N.m.s/rad", u_percent = 3 }
k_shaft = { value = 5000, unit = "N.m/rad" }
c_shaft = { value = 20, unit = "N.m.s/rad" }
inertia_rotor = { value = 1.5, unit = "kg.m2" }
[generator]
pole_pairs = { value = 16, unit = "1" }
k_e = { value = 2, unit = "V/rpm", u_percent = 0.2 }
r_s = { value = 1, unit = "ohm", u_percent = 0.5 }
l_s = { value = 20, unit = "mH", u_percent = 1 }""",
}
"""Tables [drivetrain] and [generator] of a gear of 1:30, and of a machine on the shaft of the
drum.
"""

SENSORS = {
    "pressure": ("MPa", 0.003),
    "force": ("N", 2.0),
    "torque": ("N.m", 0.3),
    "vdc": ("V", 0.05),
    "idc": ("A", 0.005),
}
"""Sensors that were calibrated in place: unit and standard uncertainty of the zero; that of the
gain is 0.1 %.
"""

LOADS = (math.inf, 36.0, 12.0)
"""Loads of a campaign. [ohm]"""

NOISE = {"velocity": 2e-3, "pressure": 980.0, "force": 3.0, "torque": 0.3, "vdc": 0.2, "idc": 0.012}
"""Standard deviation of the noise of a sample, SI units."""

Effects = Mapping[str, Mapping[str, float]]


def own_text(kind: str, shaft: str = "geared") -> str:
    """Text of a whole rig file: a drum of 0.2 m, restoring module and shaft of the tables above,
    the rules of the paper.
    """
    sensors = "\n".join(
        f'[sensors.{name}]\nunit = "{unit}"\nu_zero = {zero}\nu_gain = 0.001'
        for name, (unit, zero) in SENSORS.items()
        if name != "pressure" or kind == "gas_screw"
    )
    return f"""name = "{kind} {shaft}"
[winch]
r_drum = {{ value = 0.2, unit = "m" }}
inertia = {{ value = 0.5, unit = "kg.m2" }}
[restoring]{RESTORING[kind]}
[drivetrain]{SHAFT[shaft]}
v_diode = {{ value = 0.7, unit = "V" }}
[dc_link]
c_dc = {{ value = 2.2, unit = "mF", u_percent = 10 }}
r_bleed = {{ value = 4500, unit = "ohm" }}
load_u_percent = 0.1
{sensors}
{PAPER_RULES.replace("rpm_bin", "# rpm_bin")}"""


def own_rig(kind: str, shaft: str = "geared") -> Rig:
    """The rig of that file."""
    return parse_rig(own_text(kind, shaft), f"{kind}.toml")


def own_campaign(
    kind: str, shaft: str, effects: Effects, *, cycles: int = 1, seed: int = 0
) -> list[Run]:
    """A campaign of a rig with some effects of the catalogue, at `LOADS`, with the noise of a
    logger.
    """
    model = baseline(own_rig(kind, shaft))
    for name, fields in effects.items():
        model = make_effect(name, fields).apply(model)
    rng = np.random.default_rng(seed)
    return [noisy(simulate(motion_run(load=load, cycles=cycles), model).run, rng) for load in LOADS]


def noisy(run: Run, rng: np.random.Generator) -> Run:
    """A simulated log with the noise of its sensors."""
    channels = {
        name: x + rng.normal(0.0, NOISE.get(name, 0.0), x.size) for name, x in run.channels.items()
    }
    name = "open.csv" if run.load is None or math.isinf(run.load) else f"r{run.load:g}ohm.csv"
    return msgspec.structs.replace(run, name=name, channels=channels, simulated=False)
