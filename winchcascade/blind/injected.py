"""Causes that may be injected into a twin: effects of the catalogue by laws of the twin, and
outsiders beyond the catalogue.
"""

import math
from collections.abc import Mapping

import msgspec
import numpy as np

from winchcascade.blind.twin_numbers import BELL, KNEE, LINE


class InjectedEffect(msgspec.Struct, frozen=True):
    """An effect that may be injected: where in the cascade it acts, the parameter that a diagnosis
    reports of it, its unit, its size at full strength on the rig of the paper, and whether a size
    of either sign is drawn.
    """

    stage: str
    parameter: str
    unit: str
    size: float
    either: bool = False


PARTS: dict[str, InjectedEffect] = {
    "ke_rolloff": InjectedEffect("generator", "k_e_ratio_at_10_a", "1", 0.13),
    "ke_shift": InjectedEffect("generator", "k_e_change", "1", 0.03, either=True),
    "copper_heating": InjectedEffect("generator", "r_s_change", "1", 0.35),
    "sync_inductance": InjectedEffect("generator", "l_s_change", "1", 0.15, either=True),
    "diode_drop": InjectedEffect("generator", "v_d_extra", "V", 0.7),
    "load_drift": InjectedEffect("generator", "r_load_change", "1", 0.035, either=True),
    "gear_mesh_loss": InjectedEffect("gearbox", "efficiency_change", "1", -0.05),
    "rotor_viscous": InjectedEffect("gearbox", "b_extra", "N.m.s/rad", 6e-4),
    "rotor_windage": InjectedEffect("gearbox", "c_extra", "N.m.s2/rad2", 2.2e-6),
    "rotor_friction": InjectedEffect("gearbox", "torque", "N.m", 0.2),
    "rotor_inertia": InjectedEffect("gearbox", "j_change", "1", 2.5),
    "clutch_drag": InjectedEffect("gearbox", "torque", "N.m", 3.0),
    "line_friction": InjectedEffect("transmission", "torque", "N.m", 7.0),
    "line_drag": InjectedEffect("transmission", "b", "N.m.s/rad", 0.9),
    "drum_inertia": InjectedEffect("transmission", "j_extra", "kg.m2", 0.6),
    "drum_layering": InjectedEffect(
        "transmission", "radius_change_per_10_m", "1", 0.05, either=True
    ),
    "gas_polytropic": InjectedEffect("restoring", "n", "1", 0.22),
    "gas_volume": InjectedEffect("restoring", "volume_extra", "m3", 7e-4),
    "precharge": InjectedEffect("restoring", "pressure_change", "1", -0.06, either=True),
    "piston_area": InjectedEffect("restoring", "area_change", "1", -0.07, either=True),
    "seal_friction": InjectedEffect("restoring", "force", "N", 920.0),
    "screw_friction": InjectedEffect("restoring", "mu_change", "1", 0.012, either=True),
    "torque_gain": InjectedEffect("sensor", "gain_error", "1", 0.04, either=True),
    "force_zero": InjectedEffect("sensor", "offset", "N", 35.0, either=True),
    "force_gain": InjectedEffect("sensor", "gain_error", "1", 0.03, either=True),
    "voltage_gain": InjectedEffect("sensor", "gain_error", "1", 0.025, either=True),
    "current_gain": InjectedEffect("sensor", "gain_error", "1", 0.025, either=True),
    "electrical_lag": InjectedEffect("sensor", "lag", "s", 0.12),
}
"""Every effect that a seed deals by its name, with its size at full strength. The order belongs
to what a seed deals.
"""

LATER: dict[str, InjectedEffect] = {
    "stribeck": InjectedEffect("transmission", "slow_torque", "N.m", 5.0),
    "pressure_gain": InjectedEffect("sensor", "gain_error", "1", 0.05, either=True),
}
"""Effects that joined the catalogue later: they are injected where a plan names them, and a seed
deals what it always has.
"""

INJECTED = PARTS | LATER
"""Every effect that may be injected."""

OUTSIDERS: dict[str, float] = {
    "elastic_encoder": 0.15, "brake_drag": 9.0, "warming_load": 0.05, "eccentric_drum": 0.025, "pressure_play": 0.08,
    "late_force": 0.12, "curved_torque": 0.06, "leaking_link": 0.2, "leaking_gas": 0.015, "worn_gear": 0.03,
    "saturated_current": 0.05,
}  # fmt: skip
"""Causes outside the catalogue, each with its size: time constant of the drive of the encoder [s],
torque of a brake that drags now and then [N m], rise of a load that warms through a log [1], of the
drum radius once a turn [1], play of the pressure sensor [kg/cm2], delay of the force cell [s],
deficit of the torque sensor at 500 N m [1], leakage across the DC link at 300 V [A], gas lost in
100 s [1], ripple of the gear three times a turn [1], deficit of the current sensor at 15 A [1]."""

PHYSICS: dict[str, tuple[float, float]] = {
    "rope_loss": (0.01, 0.06), "gear_slope": (0.02, 0.06), "gear_curve": (0.02, 0.06), "dead_diode": (1.0, 3.0),
    "diode_extra": (0.0, 0.3), "diode_slope": (0.02, 0.12), "diode_scale": (0.04, 0.06), "cable": (0.05, 0.4),
    "overrunning_drag": (0.8, 5.0),
}  # fmt: skip
"""Further physics that a seed does not deal, each with its range: share of the tension that the
rope loses [1], fall of the mesh efficiency at full torque, linear or quadratic [1], number of the
phase without an upper diode, further threshold of a diode [V], its slope [ohm], rise of its voltage
per factor e of the current [V], cable before the sensor of Vdc [ohm], drag of the overrunning
clutch [N m]."""


class Hidden(msgspec.Struct, frozen=True):
    """Causes injected in one case: value of each effect, numbers of their laws, size of an
    outsider, and further physics.
    """

    effects: dict[str, float] = {}
    laws: dict[str, float] = {}
    outsiders: dict[str, float] = {}
    physics: dict[str, float] = {}

    def get(self, name: str) -> float:
        """Value of an effect, size of an outsider or of further physics, 0 where it is absent."""
        return self.effects.get(name, self.outsiders.get(name, self.physics.get(name, 0.0)))

    def reported(self) -> dict[str, dict[str, float]]:
        """True value of the parameter that a diagnosis reports, by effect."""
        return {
            name: {INJECTED[name].parameter: 1.0 + _SIGNS[name] * x if name in _SIGNS else x}
            for name, x in self.effects.items()
        }


_SIGNS = {"ke_rolloff": -1.0, "gas_polytropic": 1.0}
"""Effects whose reported parameter is 1 where they are absent, with the sign of what is added.
[1]
"""


def draw_hidden(
    effects: Mapping[str, float],
    outsider: str | None,
    rng: np.random.Generator,
    reported: Mapping[str, float] | None = None,
    *,
    duration: float = 1.0,
) -> Hidden:
    """Draw the values of the causes of a case.

    Parameters
    ----------
    effects : strength of each effect, 1 for full
    outsider : cause outside the catalogue, None for none
    reported : value of the reported parameter of effects whose value is not drawn
    duration : of a stroke over that of the crane of the paper, which the gas cools as slowly as [1]
    """
    values = {name: strength * _size(INJECTED[name], rng) for name, strength in effects.items()}
    values |= {
        name: (value - 1.0) * _SIGNS[name] if name in _SIGNS else value
        for name, value in (reported or {}).items()
    }
    laws: dict[str, float] = {}
    if "ke_rolloff" in values:
        laws |= _rolloff(values["ke_rolloff"], rng)
    if "gas_polytropic" in values:
        laws["gas_cooling"] = rng.uniform(4.0, 12.0) * duration
    if "stribeck" in values:
        ranges = {"slow_speed": (0.08, 0.18), "slow_power": (1.6, 2.4), "slow_seals": (0.0, 1.0)}
        laws |= {name: rng.uniform(*ends) for name, ends in ranges.items()}
    if outsider is None:
        return Hidden(values, laws)
    outside = {outsider: OUTSIDERS[outsider] * rng.uniform(0.85, 1.25)}
    return Hidden(values, laws | {"phase": rng.uniform(0.0, 2.0 * math.pi)}, outside)


def _size(part: InjectedEffect, rng: np.random.Generator) -> float:
    size = part.size * rng.uniform(0.93, 1.07)
    return -size if part.either and rng.random() < 0.5 else size


def _rolloff(lost: float, rng: np.random.Generator) -> dict[str, float]:
    """Draw a law by which a share of the back-EMF is lost at 10 A rms."""
    law = (KNEE, LINE, BELL)[rng.integers(3)]
    knee = 0.0 if law == BELL else rng.uniform(3.0, 6.0)
    power = 1.0 if law == LINE else rng.uniform(*((1.2, 2.0) if law == BELL else (1.0, 1.8)))
    width = {
        KNEE: (10.0 - knee) * ((1.0 - lost) / lost) ** (1.0 / power),
        LINE: lost / (10.0 - knee),
        BELL: 10.0 / (-math.log1p(-lost)) ** (1.0 / power),
    }
    return {"law": law, "knee": knee, "width": width[law], "power": power}
