"""Rigs of all sizes: a rig is drawn as units of nature times dimensionless numbers about those of
the paper's rig.

In its own units a rig has the drum, the gear, the back-EMF and the speeds of the paper's rig. What
is drawn are ratios: of reactance and resistance to the load, inertias, losses, the gas, the
capacitor, the ramps. The twin simulates the rig in these units, on a grid that is thereby a share
of its time, and `Units` turn logs, rig file and truth into SI units.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np
from machine_units import PAPER_UNITS, Units

from winchcascade.blind.injected import Hidden
from winchcascade.blind.twin import Twin
from winchcascade.blind.twin_numbers import (  # fmt: skip
    AIR,
    CRANE,
    CRANE_LOGGER,
    LOADS,
    SENSORS,
    Crane,
    Fixed,
    Logger,
    Numbers,
    Restoring,
)

PAPER_NUMBERS, PAPER_FIXED = Numbers(), Fixed()


class Machine(msgspec.Struct, frozen=True):
    """A rig with its crane and its logger, as its rig file states it; all but `units` in the units
    of the rig.

    Parameters
    ----------
    loads : by log [ohm]
    strengths : size of an injected effect over that on the paper's rig, with which it acts as
        strongly, by effect, else 1 [1]
    """

    units: Units = PAPER_UNITS
    numbers: Numbers = PAPER_NUMBERS
    fixed: Fixed = PAPER_FIXED
    restoring: Restoring = Restoring()
    loads: dict[str, float] = msgspec.field(default_factory=lambda: dict(LOADS))
    crane: Crane = CRANE
    logger: Logger = CRANE_LOGGER
    strengths: dict[str, float] = {}

    @property
    def direct(self) -> bool:
        """Whether the machine is on the shaft of the drum, without a gear."""
        return math.isclose(self.fixed.gear * self.units.gear, 1.0)

    @property
    def text(self) -> str:
        """Size of the rig in words."""
        f = self.units.factor
        power = RATED_POWER * f("torque") / f("time") / 1e3
        return (
            f"{self.restoring.kind}, drum {self.fixed.r_drum * f('length'):.3g} m, {power:.3g} "
            f"kW, gear "
            f"{self.fixed.gear * self.units.gear:.3g}, stroke "
            f"{STROKE * self.crane.stroke * f('length'):.3g} m"
        )

    @property
    def relative(self) -> tuple[float, ...]:
        """Each number over that of the paper, by which its uncertainty is larger. [1]"""
        return tuple(own / paper for own, paper in zip(self.numbers, PAPER_NUMBERS, strict=True))

    @property
    def stated(self) -> Twin:
        """The rig as its file states it."""
        gains = dict.fromkeys(SENSORS, 1.0)
        return Twin(
            self.numbers, self.loads, gains, Hidden(), fixed=self.fixed, restoring=self.restoring
        )

    def has(self, effect: str) -> bool:
        """Whether the rig has the part that an effect acts on."""
        if effect in OF_GAS:
            return self.restoring.has_gas
        return not (effect in OF_GEAR and self.direct)


PAPER = Machine()
"""The rig of the paper."""

RATED_POWER = 1.1e3
"""Of the machine of the paper: sqrt(3) times 124 V at 2000 rpm and 5.16 A (Secs. 4.3 and 5.1).
[W]
"""

STROKE, RAMP = 9.59, 4.55
"""Of the crane of the paper: length of a payout [m], and the time in which it speeds up [s]."""

OF_GAS = frozenset(
    (
        "gas_polytropic",
        "gas_volume",
        "precharge",
        "piston_area",
        "seal_friction",
        "screw_friction",
        "pressure_gain",
    )
)
OF_GEAR = frozenset(("gear_mesh_loss",))
"""Effects that only a rig with gas or with a gear has."""

# ---------------------------------------------------------------------------------------- drawing
SPREAD, TWICE = 0.5 * math.log(2.0), 2.0
"""Scatter of the dimensionless numbers about those of the paper: deviation of the logarithm, and
the largest factor. [1]
"""

POWER, DRUM, GEAR, STROKES = (3.0, 200e3), (0.03, 1.0), (2.0, 100.0), (0.5, 100.0)
"""Rated power [W], radius of the drum [m], gear ratio [1] and length of a payout [m] of a drawn
rig.
"""

STROKE_SPREAD, STROKE_SHARES, RAMP_MIN = 0.5, (0.25, 2.0), 0.35
"""Turns of the drum in a stroke over those of the paper's: scatter of the logarithm, and ends;
shortest ramp over that of the paper, which the clutch and the DC link still follow. [1]"""

TIME, VOLT = (0.3, 4.0), (0.25, 6.0)
"""Time and voltage of a drawn rig over the paper's. [1]"""

DIRECT = 0.15
"""Share of the rigs without a gear. [1]"""

PAIRS = range(1, 21)
"""Numbers of pole pairs."""

TURNS = (20.0, 200.0)
"""Electrical turns for each turn of the drum, 100 on the paper's: between a direct drive and a
fast machine. [1]
"""

EVEN = 0.5
"""Smallest inertia of the rotor over the paper's and over the time of an electrical turn: a lighter
rotor of few poles does not turn evenly between two pulses of the bridge, which no averaged bridge
follows. The capacitor grows likewise. [1]"""

SILICON, SCHOTTKY, LOW_VOLTAGE = 0.7, 0.35, 0.5
"""Drop of a diode [V]: nature sets it. A machine below a share of the paper's voltage has
Schottky diodes. [1]
"""

RATES, SAMPLES = (5.0, 10.0, 25.0, 50.0, 100.0, 200.0), (60.0, 500.0)
"""Sampling rates [Hz], and samples of a log while a payout speeds up, 114 in the paper's. [1]"""


def spread(rng: np.random.Generator, low: float = 1.0 / TWICE, high: float = TWICE) -> float:
    """A factor on a dimensionless number of the paper. [1]"""
    return float(np.clip(math.exp(SPREAD * rng.standard_normal()), low, high))


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _draw_units(rng: np.random.Generator) -> Units:
    """Draw power, and drum, time and voltage that suit it; a larger drum is slower, as gravity
    has it (Froude).
    """
    power = _between(rng, *POWER) / RATED_POWER
    radius = PAPER_FIXED.r_drum * power**0.3 * math.exp(0.4 * rng.standard_normal())
    length = float(np.clip(radius, *DRUM)) / PAPER_FIXED.r_drum
    time = float(np.clip(math.sqrt(length) * math.exp(0.3 * rng.standard_normal()), *TIME))
    volt = float(np.clip(power**0.25 * math.exp(0.3 * rng.standard_normal()), *VOLT))
    gear = 1.0 if rng.random() < DIRECT else _between(rng, *GEAR)
    lead = length * spread(rng)
    return Units(length, time, power * time / length, volt, gear / PAPER_FIXED.gear, lead)


def draw_machine(rng: np.random.Generator, kind: str = "gas_screw") -> Machine:
    """Draw a rig of any size.

    Parameters
    ----------
    kind : of restoring module: gas_screw, spring, counterweight or none
    """
    units = _draw_units(rng)
    shortest, longest = (end / (STROKE * units.length) for end in STROKES)
    stroke = math.exp(STROKE_SPREAD * rng.standard_normal())
    stroke = float(np.clip(stroke, max(STROKE_SHARES[0], shortest), min(STROKE_SHARES[1], longest)))
    ramp = max(stroke * spread(rng, high=1.5), RAMP_MIN)
    crane = Crane(stroke, ramp, back=spread(rng, 0.7, 1.4), wait=max(stroke, 0.6))
    fixed, direct = _draw_fixed(units, rng), math.isclose(units.gear * PAPER_FIXED.gear, 1.0)
    load = spread(rng, 1.0 / 1.5, 1.5)
    gas = {"thrust": spread(rng, 0.75), "pressure": spread(rng), "volume": spread(rng)}
    reactance, resistance = spread(rng), spread(rng)
    slower = PAPER_FIXED.pole_pairs / fixed.pole_pairs  # electrical turn over that of the paper
    rotor = max(spread(rng), EVEN * slower)
    paper, area = PAPER_NUMBERS, gas["thrust"] / gas["pressure"]
    numbers = Numbers(
        k_e=paper.k_e,
        r_s=paper.r_s * resistance,
        l_s=paper.l_s * reactance * PAPER_FIXED.pole_pairs / fixed.pole_pairs,
        b_rotor=paper.b_rotor * spread(rng),
        p_gas=(paper.p_gas - AIR) * gas["pressure"] + AIR,
        area=paper.area * area,
        v_gas=paper.v_gas * area * stroke * gas["volume"],
        c_dc=paper.c_dc * spread(rng) / load * max(slower, 1.0),
        eta_mesh=1.0 if direct else 1.0 - (1.0 - paper.eta_mesh) * spread(rng),
        mu=paper.mu * spread(rng, high=1.25),
    )
    fixed = fixed._replace(j_rotor=fixed.j_rotor * rotor)
    ohm = units.factor("ohm")
    loads = {
        log: _rounded(load * spread(rng, 0.9, 1.1) * usual * ohm) / ohm
        for log, usual in LOADS.items()
    }
    strengths = {
        "copper_heating": min(load / resistance, 1.1),
        "sync_inductance": min(max(load / reactance, 0.5), 1.3),
        "rotor_inertia": min(crane.ramp / rotor, 1.6),
        "drum_inertia": max(crane.ramp, crane.stroke),
        "electrical_lag": crane.ramp,
        "drum_layering": 1.0 / stroke,
        "gas_polytropic": min(max(gas["volume"], 0.7), 1.15),
        "gas_volume": area * stroke * gas["volume"] ** 2,
        "seal_friction": gas["thrust"],
        "screw_friction": max(numbers.mu / paper.mu, 1.0),
    }
    return Machine(
        units, numbers, fixed, _draw_restoring(kind, units, stroke, rng), loads, crane, _draw_logger(units, crane, rng),
        strengths,
    )  # fmt: skip


def _draw_fixed(units: Units, rng: np.random.Generator) -> Fixed:
    """Draw the numbers that a rig file states as exact; pole pairs are a number that a machine
    of this gear may have.
    """
    gear = units.gear * PAPER_FIXED.gear
    low, high = TURNS
    pairs = [count for count in PAIRS if low * 0.99 <= count * gear <= high * 1.01]
    count = pairs[min(int(len(pairs) ** rng.random()), len(pairs)) - 1] if pairs else 1
    diode = SILICON if units.volt >= LOW_VOLTAGE else SCHOTTKY
    return PAPER_FIXED._replace(
        j_drum=PAPER_FIXED.j_drum * spread(rng),
        k_shaft=PAPER_FIXED.k_shaft * spread(rng),
        c_shaft=PAPER_FIXED.c_shaft * spread(rng),
        pole_pairs=count * units.gear,
        v_diode=diode / units.volt,
    )


def _draw_restoring(kind: str, units: Units, stroke: float, rng: np.random.Generator) -> Restoring:
    """Draw a spring or a counterweight that pulls about as the gas of the paper does: 250 N, and
    a third more at the end.
    """
    held, rise, rubs = 250.0 * spread(rng), spread(rng) / 3.0, 0.1 * spread(rng)
    gravity = Restoring().gravity * units.time**2 / units.length
    if kind == "spring":
        return Restoring(
            kind, held, held * rise / (STROKE * stroke), friction=rubs * held, gravity=gravity
        )
    if kind == "counterweight":
        return Restoring(kind, weight=held, friction=rubs * held, gravity=gravity)
    return Restoring(kind, gravity=gravity)


def _draw_logger(units: Units, crane: Crane, rng: np.random.Generator) -> Logger:
    """Draw a sampling rate that resolves the ramps and the smoothing of the velocity, which no
    longer ramp makes longer.
    """
    ramp = RAMP * min(crane.ramp, 1.0) * units.time
    least, most = SAMPLES
    rates = [rate for rate in RATES if least <= rate * ramp <= most] or [RATES[-1]]
    return Logger(1.0 / (rates[rng.integers(len(rates))] * units.time))


def _rounded(value: float) -> float:
    """A number with the three digits that a load is stated with."""
    return float(f"{value:.3g}")
