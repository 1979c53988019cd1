"""Plans of the trials: effects, logger, repeats and wrong entries of each case, fixed by the seed of its family."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from winchcascade.blind.injected import INJECTED
from winchcascade.blind.twin_numbers import CRANE_LOGGER, Logger

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
    """

    family: str
    number: int
    effects: dict[str, float] = {}
    logger: Logger = CRANE_LOGGER
    repeats: int = 1
    entry: WrongEntry | None = None
    simulator: str | None = None

    @property
    def hidden(self) -> str:
        """What is injected, in words."""
        if self.entry is None:
            return " + ".join(self.effects) or "nothing"
        shared = ", shared by the logger" if self.entry.shared else ""
        place = f" of {self.entry.log}" if self.entry.log else ""
        return f"{self.entry.effect}{place} x {self.entry.factor:.3f}{shared}"

    @property
    def settings(self) -> str:
        """Settings of the campaign, in words."""
        simulator = f", {self.simulator} simulator" if self.simulator else ""
        return f"{1 / self.logger.interval:g} Hz, noise x {self.logger.noise:g}, {self.repeats} of each load{simulator}"


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
}
"""Families whose cases are diagnosed; `speed` is measured apart."""


def plan_case(name: str, number: int) -> Plan:
    """Plan the case of a number, from 1 on."""
    family = FAMILIES[name]
    block, place = divmod(number - 1, BLOCK)
    plan = family.block(name, np.random.default_rng([family.seed, 0, block]))[place]
    return msgspec.structs.replace(plan, number=number)
