"""Plans of the trials: effects, further physics, logger, repeats, order and rig file of each case, fixed by the seed of its
family.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import msgspec
import numpy as np

from winchcascade.blind.history import COPPER, History
from winchcascade.blind.injected import INJECTED, PHYSICS
from winchcascade.blind.twin_numbers import CRANE_LOGGER, LOADS, Logger

BLOCK = 60
"""Number of cases over which settings and effects are balanced; a case is the same however many are run."""

RATES = (5.0, 10.0, 25.0, 50.0, 100.0, 200.0)
"""Sampling rates of the loggers. [Hz]"""

NOISES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Factors on the noise of sensors and tether. [1]"""

REPEATS = (1,) * 44 + (2,) * 8 + (3,) * 4 + (5,) * 2 + (10, 20)
"""Repeats of the seven loads in the cases of a block: few campaigns with many, as these cost most."""


class WrongEntry(msgspec.Struct, frozen=True):
    """A wrong entry of the rig file or, for `load_entry`, of one run.

    Parameters
    ----------
    effect : suspect that describes it
    factor : stated value over the true one [1]
    log : run whose load is wrong
    shared : the logger computes the motion of the line with the wrong radius, too
    """

    effect: str
    factor: float
    log: str | None = None
    shared: bool = False

    @property
    def pairs(self) -> tuple[str, ...]:
        """Effects that are the same in the logs and count if the entry is their alternative."""
        if self.effect == "drum_radius":
            return ("force_gain",) if self.shared else ()
        if self.effect == "gear_ratio":
            return ("ke_shift",) if abs(self.factor - 1.0) < SMALL_GEAR else ()
        return {"l_s_convention": ("pole_pairs", "sync_inductance")}.get(self.effect, ())


SMALL_GEAR = 0.04
"""Below this error a gear ratio may be taken for a shift of the back-EMF constant. [1]"""


class Plan(msgspec.Struct, frozen=True):
    """Plan of one case: its family and number, strength of each injected effect, and the settings of the campaign.

    `simulator` names the simulator of the owner's own simulation: `same` physics, or an `averaged` bridge with or without the
    drop of commutation.

    Parameters
    ----------
    kind : of the answer that is expected, where a family has several
    physics : further physics of the twin, by the names of `PHYSICS`
    history : what changes from run to run
    order : of the runs, that of the loads if empty
    scatter : true scatter of the rig over the stated one [1]
    bias : error of the rig file, by number in stated uncertainties [1]
    calibrated : the rig file is calibrated from the open circuit of the campaign
    """

    family: str
    number: int
    effects: dict[str, float] = {}
    kind: str = ""
    physics: dict[str, float] = {}
    history: History = History()
    order: tuple[str, ...] = ()
    scatter: float = 1.0
    bias: dict[str, float] = {}
    calibrated: bool = False
    logger: Logger = CRANE_LOGGER
    repeats: int = 1
    entry: WrongEntry | None = None
    simulator: str | None = None

    @property
    def hidden(self) -> str:
        """What is injected, in words."""
        if self.entry is None:
            return " + ".join(self.effects) or self.kind or "nothing"
        shared = ", shared by the logger" if self.entry.shared else ""
        place = f" of {self.entry.log}" if self.entry.log else ""
        return f"{self.entry.effect}{place} x {self.entry.factor:.3f}{shared}"

    @property
    def settings(self) -> str:
        """Settings of the campaign, in words."""
        simulator = f", {self.simulator} simulator" if self.simulator else ""
        rig = ", rig file calibrated" if self.calibrated else ", rig file biased" if self.bias else ""
        rig += f", scatter x {self.scatter:g}" if self.scatter != 1.0 else ""
        rig += ", shuffled" if self.order else ""
        return f"{1 / self.logger.interval:g} Hz, noise x {self.logger.noise:g}, {self.repeats} of each load{simulator}{rig}"


def nothing(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan campaigns with nothing injected, at all rates, noises and repeats."""
    rates, noises = (np.resize(values, BLOCK)[rng.permutation(BLOCK)].tolist() for values in (RATES, NOISES))
    repeats = [REPEATS[k] for k in rng.permutation(BLOCK)]
    return [
        Plan(family, number, logger=Logger(1.0 / rate, noise), repeats=count)
        for number, (rate, noise, count) in enumerate(zip(rates, noises, repeats, strict=True), 1)
    ]


def single(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan campaigns with one effect at full strength, in the same settings."""
    names = _in_turn(tuple(INJECTED), rng)
    plans = nothing(family, rng)
    return [msgspec.structs.replace(plan, effects={name: 1.0}) for plan, name in zip(plans, names, strict=True)]


def usual_single(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan campaigns of the usual logger with one effect at full strength."""
    return [Plan(family, number, effects={name: 1.0}) for number, name in enumerate(_in_turn(tuple(INJECTED), rng), 1)]


TOGETHER = 3
"""Number of effects in a case of `coverage`, each of another stage."""


def several(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan campaigns of the usual logger with several effects of different stages at strengths about 1."""
    stages = sorted({part.stage for part in INJECTED.values()})
    plans = []
    for number in range(1, BLOCK + 1):
        effects = {}
        for stage in rng.permutation(stages)[:TOGETHER]:
            name = str(rng.choice([name for name, part in INJECTED.items() if part.stage == stage]))
            effects[name] = round(rng.uniform(0.7, 1.4), 3)
        plans.append(Plan(family, number, effects=effects))
    return plans


LOADED = ("r45ohm", "r36ohm", "r27ohm", "r18ohm", "r9ohm", "r4p5ohm")

CONVENTIONS = (
    ("k_e_convention", 1.0 / np.sqrt(3.0)),
    ("k_e_convention", np.sqrt(2.0)),
    ("r_s_convention", 2.0),
    ("l_s_convention", 2.0),
)
"""Stated over true value where k_e is stated per phase or as a peak, r_s or l_s line to line."""


def wrong(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan campaigns with one wrong entry: drum radius, gear ratio, load of one run, and conventions, as many of each."""
    entries = []
    for k in range(BLOCK // 4):
        entries.append(WrongEntry("drum_radius", _either(rng, 0.03, 0.10), shared=k % 3 == 0))
        entries.append(WrongEntry("gear_ratio", _either(rng, 0.02, 0.10)))
        entries.append(WrongEntry("load_entry", _either(rng, 0.10, 0.60), log=str(rng.choice(LOADED))))
        effect, factor = CONVENTIONS[k % len(CONVENTIONS)]
        entries.append(WrongEntry(effect, float(factor)))
    return [Plan(family, number, entry=entries[k]) for number, k in enumerate(rng.permutation(BLOCK).tolist(), 1)]


def _either(rng: np.random.Generator, low: float, high: float) -> float:
    """A factor that is too large or too small by a share between two limits. [1]"""
    share = rng.uniform(low, high)
    return round(1.0 + (share if rng.random() < 0.5 else -share), 4)


SIMULATORS = ("same", "averaged", "same", "averaged without commutation")
"""Simulators of the owner, in turn."""


def simulated(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan campaigns with the owner's own simulation and one effect; in one of ten nothing is injected."""
    plans = usual_single(family, rng)
    return [
        msgspec.structs.replace(
            plan, simulator=SIMULATORS[k % len(SIMULATORS)], effects={} if k % 20 in (4, 11) else plan.effects
        )
        for k, plan in enumerate(plans)
    ]


def wide(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan single effects on rigs that scatter more than their file states."""
    return [
        msgspec.structs.replace(plan, scatter=(2.0, 5.0)[k % 2]) for k, plan in enumerate(usual_single(family, rng))
    ]


BIASED = ("k_e", "b_rotor", "mu", "eta_mesh")
"""Numbers that a calibration gives, and that are wrong in `biased`."""


def biased(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan single effects on rigs whose file was calibrated with a bias of two to four of its uncertainties."""
    return [
        msgspec.structs.replace(plan, bias={name: _signed(rng, 2.0, 4.0) for name in BIASED})
        for plan in usual_single(family, rng)
    ]


def calibrated(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan single effects whose rig file is calibrated from the open circuit of the campaign."""
    return [msgspec.structs.replace(plan, calibrated=True) for plan in usual_single(family, rng)]


HEATED = ("constant", "load", "constant", "load", "magnets")
"""What a machine is heated by, in turn; of the last only the magnets warm."""


def warming(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan machines that warm, half of them in the order of the loads."""
    plans = []
    for k in range(BLOCK):
        order = shuffled(rng) if k % 2 else ()
        what, where = HEATED[k // 2 % len(HEATED)], "shuffled" if order else "in load order"
        kind = f"warming {'magnets ' if what == 'magnets' else ''}{where}"
        plans.append(Plan(family, k + 1, kind=kind, history=_warm(what, rng), order=order))
    return plans


def _warm(what: str, rng: np.random.Generator) -> History:
    """Draw a machine that warms: copper by 8 to 115 K, magnets by a quarter to all of it, of -0.02 to -0.2 %/K."""
    magnets = what == "magnets"
    heat: Literal["constant", "load"] = "load" if what == "load" or (magnets and rng.random() < 0.5) else "constant"
    time_constant, instant = rng.uniform(0.5, 8.0), 0.5 if heat == "load" else 0.0
    while True:
        fall, rise, share = rng.uniform(0.008, 0.04), rng.uniform(0.03, 0.45), rng.uniform(0.25, 1.0)
        if 2e-4 <= fall / (share * rise / COPPER) <= 2e-3:
            return History(heat, time_constant, instant, fall, 0.0 if magnets else rise)


def shuffled(rng: np.random.Generator) -> tuple[str, ...]:
    """An order of the loads in which their rank correlation with the order of the runs is below a half."""
    logs, places = tuple(LOADS), np.arange(len(LOADS))
    while True:
        drawn = rng.permutation(len(logs))
        if abs(np.corrcoef(places, drawn)[0, 1]) < 0.5:
            return tuple(logs[k] for k in drawn)


def rolloff_order(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan a roll-off alone in the same kinds of orders."""
    orders = [shuffled(rng) if k % 2 else () for k in range(BLOCK)]
    return [
        Plan(
            family, k + 1, {"ke_rolloff": 1.0}, kind=f"rolloff {'shuffled' if order else 'in load order'}", order=order
        )
        for k, order in enumerate(orders)
    ]


def rope(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan ropes that lose a share of the tension."""
    return [Plan(family, k + 1, kind="rope", physics=_drawn(rng, "rope_loss")) for k in range(BLOCK)]


def leak(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan gas that escapes from run to run, every second campaign in a shuffled order."""
    return [
        Plan(
            family, k + 1, kind="leak", history=History(gas_leak=rng.uniform(0.003, 0.02)), order=_every_second(k, rng)
        )
        for k in range(BLOCK)
    ]


PHYSICS_OF: dict[str, tuple[tuple[str, ...], ...]] = {
    "gear under load": (("gear_slope",), ("gear_curve",)),
    "dead diode": (("dead_diode",),),
    "diode": (("diode_slope", "diode_extra"), ("diode_slope", "diode_extra", "diode_scale")),
    "cable": (("cable",),),
    "drift": (("torque_zero",), ("torque_gain",), ("force_zero",), ("vdc_gain",)),
    "overrunning clutch": (("overrunning_drag",),),
}
"""Kinds of `other_physics` in turn, each with what is drawn for it, in turn; a drift by channel and kind of error."""

DRIFTS = {
    "torque_zero": (1.0, 5.0), "torque_gain": (0.005, 0.02), "force_zero": (10.0, 40.0), "vdc_gain": (0.005, 0.02),
}  # fmt: skip
"""Drift of a sensor over a campaign, of either sign. [unit of the log, or 1]"""


def other_physics(family: str, rng: np.random.Generator) -> list[Plan]:
    """Plan physics that the model lacks or has by another law, each kind as often."""
    plans = []
    for k in range(BLOCK):
        kind = tuple(PHYSICS_OF)[k % len(PHYSICS_OF)]
        turn = k // len(PHYSICS_OF)
        names = PHYSICS_OF[kind][turn % len(PHYSICS_OF[kind])]
        if kind == "drift":
            channel, error = names[0].split("_")
            drift = {channel: _signed(rng, *DRIFTS[names[0]])}
            history = History(gain_drifts=drift) if error == "gain" else History(zero_drifts=drift)
            order = _every_second(turn // 2, rng)
            plans.append(Plan(family, k + 1, kind=f"drift of {names[0]}", history=history, order=order))
        else:
            plans.append(Plan(family, k + 1, kind=kind, physics=_drawn(rng, *names)))
    return plans


def _every_second(turn: int, rng: np.random.Generator) -> tuple[str, ...]:
    return shuffled(rng) if turn % 2 else ()


def _drawn(rng: np.random.Generator, *names: str) -> dict[str, float]:
    """Draw further physics; a diode that is dead is one of three."""
    values = {name: rng.uniform(*PHYSICS[name]) for name in names}
    return {name: float(round(value)) if name == "dead_diode" else value for name, value in values.items()}


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of a size between two limits and of either sign."""
    size = rng.uniform(low, high)
    return size if rng.random() < 0.5 else -size


def _in_turn(names: Sequence[str], rng: np.random.Generator) -> list[str]:
    """Names for a block of cases, every name as often, in a random order."""
    found: list[str] = []
    while len(found) < BLOCK:
        found += [names[k] for k in rng.permutation(len(names))]
    return found[:BLOCK]


class Family(msgspec.Struct, frozen=True):
    """A family of trials: its seed, its number of cases, and what plans a block of them."""

    seed: int
    cases: int
    block: Callable[[str, np.random.Generator], list[Plan]]


FAMILIES = {
    "nothing": Family(18_001, 60, nothing),
    "single": Family(18_002, 60, single),
    "coverage": Family(18_003, 180, several),
    "entries": Family(18_004, 60, wrong),
    "contributions": Family(18_005, 60, usual_single),
    "own_simulation": Family(18_006, 40, simulated),
    "wide": Family(18_011, 40, wide),
    "biased": Family(18_012, 20, biased),
    "calibrated": Family(18_013, 15, calibrated),
    "warming": Family(18_014, 40, warming),
    "rolloff_order": Family(18_015, 20, rolloff_order),
    "rope": Family(18_016, 20, rope),
    "leak": Family(18_017, 20, leak),
    "other_physics": Family(18_018, 60, other_physics),
}
"""Families whose cases are diagnosed; `speed` is measured apart."""


def plan_case(name: str, number: int) -> Plan:
    """Plan the case of a number, from 1 on."""
    family = FAMILIES[name]
    block, place = divmod(number - 1, BLOCK)
    plan = family.block(name, np.random.default_rng([family.seed, 0, block]))[place]
    return msgspec.structs.replace(plan, number=number)
