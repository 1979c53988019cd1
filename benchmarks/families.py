"""Families of trials as a table: seed, number of cases, what plans them, and bars, none to be
reached by a choice of seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
from campaigns import PRODUCT, Case, WrongEntry
from drawn_machine import Machine, draw_machine
from owner_simulators import SIMULATORS
from run_history import COPPER, History

from winchcascade.blind.injected import INJECTED, PHYSICS
from winchcascade.blind.truth import Truth, Verdict, truth_by_effects
from winchcascade.blind.twin_numbers import LOADS, Logger

BLOCK = 60
"""Number of cases over which settings and effects are balanced; a case is the same however many
are run.
"""

RATES = (5.0, 10.0, 25.0, 50.0, 100.0, 200.0)
"""Sampling rates of the loggers. [Hz]"""

NOISES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Factors on the noise of sensors and tether. [1]"""

REPEATS = (1,) * 44 + (2,) * 8 + (3,) * 4 + (5,) * 2 + (10, 20)
"""Repeats of the seven loads in the cases of a block: few campaigns with many, as these cost
most.
"""

Plans = list[Case]
replace = msgspec.structs.replace


def case(kind: str = "", **fields: Any) -> Case:
    """A case with the answers that are expected of its kind; `plan_case` sets its family, number
    and seed.
    """
    return Case("", 0, kind=kind, truth=EXPECTED.get(kind), **fields)


def _in_turn(rng: np.random.Generator) -> list[str]:
    """Effects for a block of cases, every one as often, in a random order."""
    names, found = tuple(INJECTED), list[str]()
    while len(found) < BLOCK:
        found += [names[k] for k in rng.permutation(len(names))]
    return found[:BLOCK]


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of a size between two limits and of either sign."""
    size = rng.uniform(low, high)
    return size if rng.random() < 0.5 else -size


def _shuffled(rng: np.random.Generator) -> tuple[str, ...]:
    """An order of the loads in which their rank correlation with the order of the runs is below
    a half.
    """
    logs, places = tuple(LOADS), np.arange(len(LOADS))
    while True:
        drawn = rng.permutation(len(logs))
        if abs(np.corrcoef(places, drawn)[0, 1]) < 0.5:
            return tuple(logs[k] for k in drawn)


def _drawn(rng: np.random.Generator, *names: str) -> dict[str, float]:
    """Draw further physics; a diode that is dead is one of three."""
    values = {name: rng.uniform(*PHYSICS[name]) for name in names}
    return {
        name: float(round(value)) if name == "dead_diode" else value
        for name, value in values.items()
    }


def nothing(rng: np.random.Generator) -> Plans:
    """Plan campaigns with nothing injected, at all rates, noises and repeats."""
    rates, noises = (
        np.resize(values, BLOCK)[rng.permutation(BLOCK)].tolist() for values in (RATES, NOISES)
    )
    repeats = [REPEATS[k] for k in rng.permutation(BLOCK)]
    settings = zip(rates, noises, repeats, strict=True)
    return [
        case(logger=Logger(1.0 / rate, noise), repeats=count) for rate, noise, count in settings
    ]


def single(rng: np.random.Generator) -> Plans:
    """Plan campaigns with one effect at full strength, in the same settings."""
    names = _in_turn(rng)
    return [
        replace(plan, effects={name: 1.0}) for plan, name in zip(nothing(rng), names, strict=True)
    ]


def usual_single(rng: np.random.Generator) -> Plans:
    """Plan campaigns of the usual logger with one effect at full strength."""
    return [case(effects={name: 1.0}) for name in _in_turn(rng)]


TOGETHER = 3
"""Number of effects in a case of `coverage`, each of another stage."""


def several(rng: np.random.Generator) -> Plans:
    """Plan campaigns of the usual logger with several effects of different stages at strengths
    about 1.
    """
    stages = sorted({part.stage for part in INJECTED.values()})
    plans = []
    for _ in range(BLOCK):
        effects = {}
        for stage in rng.permutation(stages)[:TOGETHER]:
            name = str(rng.choice([name for name, part in INJECTED.items() if part.stage == stage]))
            effects[name] = round(rng.uniform(0.7, 1.4), 3)
        plans.append(case(effects=effects))
    return plans


LOADED = ("r45ohm", "r36ohm", "r27ohm", "r18ohm", "r9ohm", "r4p5ohm")

CONVENTIONS = (
    ("k_e_convention", 1.0 / np.sqrt(3.0)),
    ("k_e_convention", np.sqrt(2.0)),
    ("r_s_convention", 2.0),
    ("l_s_convention", 2.0),
)
"""Stated over true value where k_e is stated per phase or as a peak, r_s or l_s line to line."""


def wrong(rng: np.random.Generator) -> Plans:
    """Plan campaigns with one wrong entry: drum radius, gear ratio, load of one run, and
    conventions, as many of each.
    """
    entries = []
    for k in range(BLOCK // 4):
        entries.append(
            WrongEntry("drum_radius", round(1.0 + _signed(rng, 0.03, 0.10), 4), shared=k % 3 == 0)
        )
        entries.append(WrongEntry("gear_ratio", round(1.0 + _signed(rng, 0.02, 0.10), 4)))
        factor = round(1.0 + _signed(rng, 0.10, 0.60), 4)
        entries.append(WrongEntry("load_entry", factor, log=str(rng.choice(LOADED))))
        effect, convention = CONVENTIONS[k % len(CONVENTIONS)]
        entries.append(WrongEntry(effect, float(convention)))
    return [case(entry=entries[k], kind=entries[k].effect) for k in rng.permutation(BLOCK).tolist()]


def simulated(rng: np.random.Generator) -> Plans:
    """Plan campaigns with the owner's own simulation and one effect; in one of ten nothing is
    injected.
    """
    same, averaged, without = SIMULATORS
    turn = (same, averaged, same, without)
    return [
        replace(
            plan,
            kind="same physics" if k % 2 == 0 else "averaged bridge",
            simulator=turn[k % 4],
            effects={} if k % 20 in (4, 11) else plan.effects,
        )
        for k, plan in enumerate(usual_single(rng))
    ]


BIASED = ("k_e", "b_rotor", "mu", "eta_mesh")
"""Numbers that a calibration gives, and that are wrong in `biased`, by two to four of their
uncertainties.
"""


def wide(rng: np.random.Generator) -> Plans:
    """Plan single effects on rigs that scatter more than their file states."""
    return [replace(plan, scatter=(2.0, 5.0)[k % 2]) for k, plan in enumerate(usual_single(rng))]


def biased(rng: np.random.Generator) -> Plans:
    """Plan single effects on rigs whose file was calibrated with a bias."""
    return [
        replace(plan, bias={name: _signed(rng, 2.0, 4.0) for name in BIASED})
        for plan in usual_single(rng)
    ]


def calibrated(rng: np.random.Generator) -> Plans:
    """Plan single effects whose rig file is calibrated from the open circuit of the campaign."""
    return [replace(plan, calibrated=True) for plan in usual_single(rng)]


HEATED = ("constant", "load", "constant", "load", "magnets")
"""What a machine is heated by, in turn; of the last only the magnets warm."""


def warming(rng: np.random.Generator) -> Plans:
    """Plan machines that warm, half of them in the order of the loads."""
    plans = []
    for k in range(BLOCK):
        order = _shuffled(rng) if k % 2 else ()
        what, where = HEATED[k // 2 % len(HEATED)], "shuffled" if order else "in load order"
        kind = f"warming {'magnets ' if what == 'magnets' else ''}{where}"
        plans.append(case(kind, history=_warm(what, rng), order=order))
    return plans


def _warm(what: str, rng: np.random.Generator) -> History:
    """Draw a machine that warms: copper by 8 to 115 K, magnets by a quarter to all of it, of
    -0.02 to -0.2 %/K.
    """
    magnets = what == "magnets"
    heat: Literal["constant", "load"] = (
        "load" if what == "load" or (magnets and rng.random() < 0.5) else "constant"
    )
    time_constant, instant = rng.uniform(0.5, 8.0), 0.5 if heat == "load" else 0.0
    while True:
        fall, rise, share = (
            rng.uniform(0.008, 0.04),
            rng.uniform(0.03, 0.45),
            rng.uniform(0.25, 1.0),
        )
        if 2e-4 <= fall / (share * rise / COPPER) <= 2e-3:
            return History(heat, time_constant, instant, fall, 0.0 if magnets else rise)


def rolloff_order(rng: np.random.Generator) -> Plans:
    """Plan a roll-off alone in the same kinds of orders."""
    plans = []
    for order in [_shuffled(rng) if k % 2 else () for k in range(BLOCK)]:
        kind = f"rolloff {'shuffled' if order else 'in load order'}"
        plans.append(case(kind, effects={"ke_rolloff": 1.0}, order=order))
    return plans


def rope(rng: np.random.Generator) -> Plans:
    """Plan ropes that lose a share of the tension."""
    return [case("rope", physics=_drawn(rng, "rope_loss")) for _ in range(BLOCK)]


def leak(rng: np.random.Generator) -> Plans:
    """Plan gas that escapes from run to run, every second campaign in a shuffled order."""
    plans = []
    for k in range(BLOCK):
        history = History(gas_leak=rng.uniform(0.003, 0.02))
        order = _shuffled(rng) if k % 2 else ()
        plans.append(case("leak", history=history, order=order))
    return plans


PHYSICS_OF: dict[str, tuple[tuple[str, ...], ...]] = {
    "gear under load": (("gear_slope",), ("gear_curve",)),
    "dead diode": (("dead_diode",),),
    "diode": (("diode_slope", "diode_extra"), ("diode_slope", "diode_extra", "diode_scale")),
    "cable": (("cable",),),
    "drift": (("torque_zero",), ("torque_gain",), ("force_zero",), ("vdc_gain",)),
    "overrunning clutch": (("overrunning_drag",),),
}
"""Kinds of `other_physics` in turn, each with what is drawn for it, in turn; a drift by channel
and kind of error.
"""

DRIFTS = {
    "torque_zero": (1.0, 5.0), "torque_gain": (0.005, 0.02), "force_zero": (10.0, 40.0), "vdc_gain": (0.005, 0.02),
}  # fmt: skip
"""Drift of a sensor over a campaign, of either sign. [unit of the log, or 1]"""


def other_physics(rng: np.random.Generator) -> Plans:
    """Plan physics that the model lacks or has by another law, each kind as often."""
    plans = []
    for k in range(BLOCK):
        kind = tuple(PHYSICS_OF)[k % len(PHYSICS_OF)]
        turn = k // len(PHYSICS_OF)
        names = PHYSICS_OF[kind][turn % len(PHYSICS_OF[kind])]
        if kind != "drift":
            plans.append(case(kind, physics=_drawn(rng, *names)))
            continue
        channel, error = names[0].split("_")
        drift = {channel: _signed(rng, *DRIFTS[names[0]])}
        history = History(gain_drifts=drift) if error == "gain" else History(zero_drifts=drift)
        order = _shuffled(rng) if turn // 2 % 2 else ()
        kind = f"drift of {names[0]}"
        plans.append(case(kind, history=history, order=order))
    return plans


MODULES = ("gas_screw", "spring", "gas_screw", "counterweight", "gas_screw", "none")
"""Restoring modules of drawn rigs, in turn."""

ACTING = (0.97, 1.4)
"""Strengths of effects on drawn rigs: with the scatter of a size 0.9 to 1.5 times a share that
matters. [1]
"""


def _machines(rng: np.random.Generator) -> list[Machine]:
    """Draw the rigs of a block."""
    return [draw_machine(rng, MODULES[k % len(MODULES)]) for k in range(BLOCK)]


def _strength(rng: np.random.Generator) -> float:
    return round(rng.uniform(*ACTING), 3)


def machines(rng: np.random.Generator) -> Plans:
    """Plan one effect on rigs of all sizes; each rig takes the first effect left that acts on a
    part that it has.
    """
    drawn, plans = _machines(rng), []
    names = [*_in_turn(rng), *_in_turn(rng)]
    for machine in drawn:
        name = next(name for name in names if machine.has(name))
        names.remove(name)
        plans.append(case(machine.restoring.kind, effects={name: _strength(rng)}, **_on(machine)))
    return plans


def machines_nothing(rng: np.random.Generator) -> Plans:
    """Plan rigs of all sizes with nothing injected."""
    return [case(machine.restoring.kind, **_on(machine)) for machine in _machines(rng)]


def machines_pairs(rng: np.random.Generator) -> Plans:
    """Plan two effects of different stages on rigs of all sizes."""
    plans = []
    for machine in _machines(rng):
        names = [name for name in INJECTED if machine.has(name)]
        first = str(rng.choice(names))
        others = [name for name in names if INJECTED[name].stage != INJECTED[first].stage]
        pair = {name: _strength(rng) for name in (first, str(rng.choice(others)))}
        plans.append(case(machine.restoring.kind, effects=pair, **_on(machine)))
    return plans


def _on(machine: Machine) -> dict[str, Any]:
    """Rig and logger of a case."""
    return {"machine": machine, "logger": machine.logger}


def undetermined(rng: np.random.Generator) -> Plans:
    """Plan rigs of all sizes with a gear, whose file states a gear ratio or a back-EMF constant
    that is wrong.
    """
    plans = []
    for k, machine in enumerate(_machines(rng)):
        while machine.direct:
            machine = draw_machine(rng, machine.restoring.kind)
        effect = ("gear_ratio", "k_e_convention")[(k + k // len(MODULES)) % 2]
        entry = WrongEntry(effect, round(1.0 + _signed(rng, 0.03, 0.10), 4))
        plans.append(case(PRODUCT, entry=entry, **_on(machine)))
    return plans


def _expected(
    honest: str, group: Sequence[str], *, sure: Sequence[str] | None = None, alone: bool = False
) -> Truth:
    """Expected answers of a kind: a group that one cause must declare, and what may be certain,
    by default its first.
    """
    certain = tuple(group[:1] if sure is None else sure)
    return Truth(honest=honest, named=(tuple(group),), may_be_certain=certain, alone=alone)


def _drift(honest: str, *excused_by: Literal["unexplained", "partly_explained"]) -> Truth:
    open_gap: tuple[Verdict, ...] = ("explained", "partly_explained", "unexplained")
    return Truth(honest=honest, verdicts=open_gap, excused_by=excused_by)


_ORDERED = (
    "heating, or heating and ke_rolloff as declared alternatives; never ke_rolloff with certainty"
)
_SHUFFLED = "heating alone: the order is not that of the loads"
_RESISTANCE = (
    "a series resistance: copper_heating or diode_drop, each with the other as alternative"
)
_ROPE = "load_proportional_loss or force_gain, each with the other as alternative"
_EITHER = "gear_ratio or ke_shift, each with the other as alternative: only their product is known"
_HEAT, _MAGNETS = ("heating", "copper_heating", "ke_shift"), ("heating", "ke_shift")
_OUTSIDE = Truth(honest="any verdict, but no cause with certainty: none of the catalogue acts")
_OPEN = _drift("neither no_gap nor explained", "unexplained", "partly_explained")
_NOT_QUIET = _drift("not no_gap, and no cause with certainty")
EXPECTED: dict[str, Truth] = {
    "warming in load order": _expected(_ORDERED, ["heating"], sure=_HEAT),
    "warming shuffled": _expected(_SHUFFLED, ["heating"], sure=_HEAT, alone=True),
    "warming magnets in load order": _expected(_ORDERED, ["heating"], sure=_MAGNETS),
    "warming magnets shuffled": _expected(_SHUFFLED, ["heating"], sure=_MAGNETS, alone=True),
    "rolloff in load order": _expected(
        "ke_rolloff, or heating as its alternative; heating never certain", ["ke_rolloff"]
    ),
    "rolloff shuffled": _expected("ke_rolloff alone", ["ke_rolloff"], alone=True),
    "rope": _expected(_ROPE, ["load_proportional_loss", "force_gain"]),
    "leak": _expected("gas_loss; never precharge with certainty", ["gas_loss"]),
    "gear under load": _OUTSIDE,
    "dead diode": _OUTSIDE,
    "diode": _expected("diode_drop; copper_heating only as its alternative", ["diode_drop"]),
    "cable": _expected(_RESISTANCE, ["copper_heating", "diode_drop"], sure=()),
    "drift of torque_zero": _OPEN,
    "drift of torque_gain": _OPEN,
    "drift of force_zero": _NOT_QUIET,
    "drift of vdc_gain": _NOT_QUIET,
    "overrunning clutch": _expected("clutch_drag", ["clutch_drag"]),
    PRODUCT: _expected(_EITHER, ["gear_ratio", "ke_shift"], sure=(), alone=True),
}
"""Expected answers by the kind of a case."""


class Figure(StrEnum):
    """Figures of the families, each a share of cases or of intervals."""

    NAMED = "truth named"
    HONEST = "honest"
    CERTAIN = "no cause certain and false"
    COVERED = "two-sided intervals that hold the true number"
    ONE_SIDED = "one-sided intervals that hold it"
    SHARES = "interval of eta_pto holds at every load"
    FORM = "model form of the generator as it is"


class Bar(NamedTuple):
    """A bar: the shares between which it is reached, the minimum number of cases that decide,
    and the kinds that count.
    """

    low: float
    minimum: int
    high: float = 1.0
    kinds: tuple[str, ...] = ()

    def result(self, part: int, of: int) -> str:
        """The bar in words, and whether it is reached; too few cases decide nothing."""
        words = f"{100 * self.low:.0f}{f' to {100 * self.high:.0f}' if self.high < 1.0 else ''} % of {self.minimum}"
        if of < self.minimum:
            return f"{words:<20} too few"
        return f"{words:<20} {'reached' if self.low <= part / of <= self.high else 'NOT reached'}"


class Family(NamedTuple):
    """A family of trials: its seed, its number of cases, what plans a block of them, and its
    figures with their bars.
    """

    seed: int
    cases: int
    block: Callable[[np.random.Generator], Plans]
    bars: tuple[tuple[Figure, Bar], ...] = ()


ABOVE, BELOW = "1.2 times the threshold", "0.6 times the threshold"
"""Kinds of `thresholds`."""

_SHUFFLED_HEAT = ("warming shuffled", "warming magnets shuffled")
FAMILIES = {
    "nothing": Family(18_001, 60, nothing, ((Figure.HONEST, Bar(59 / 60, 60)),)),
    "single": Family(18_002, 60, single, ((Figure.NAMED, Bar(57 / 60, 60)),)),
    "coverage": Family(18_003, 180, several),
    "entries": Family(18_004, 60, wrong, ((Figure.NAMED, Bar(0.9, 60)),)),
    "contributions": Family(18_005, 60, usual_single, ((Figure.SHARES, Bar(0.9, 60)),)),
    "own_simulation": Family(18_006, 40, simulated, (
        (Figure.NAMED, Bar(0.9, 36)), (Figure.CERTAIN, Bar(1.0, 40)), (Figure.FORM, Bar(1.0, 40)))),
    "wide": Family(18_011, 40, wide, ((Figure.HONEST, Bar(38 / 40, 40)), (Figure.NAMED, Bar(0.9, 40)))),
    "biased": Family(18_012, 20, biased, ((Figure.HONEST, Bar(19 / 20, 20)), (Figure.NAMED, Bar(0.9, 20)))),
    "calibrated": Family(18_013, 15, calibrated, ((Figure.HONEST, Bar(14 / 15, 15)), (Figure.NAMED, Bar(0.9, 15)))),
    "warming": Family(18_014, 40, warming, (
        (Figure.HONEST, Bar(39 / 40, 40)), (Figure.NAMED, Bar(0.9, 20, kinds=_SHUFFLED_HEAT)))),
    "rolloff_order": Family(18_015, 20, rolloff_order, (
        (Figure.HONEST, Bar(1.0, 20)), (Figure.NAMED, Bar(0.9, 10, kinds=("rolloff shuffled",))))),
    "rope": Family(18_016, 20, rope, ((Figure.HONEST, Bar(1.0, 20)), (Figure.NAMED, Bar(0.9, 20)))),
    "leak": Family(18_017, 20, leak, ((Figure.HONEST, Bar(1.0, 20)), (Figure.NAMED, Bar(0.9, 20)))),
    "other_physics": Family(18_018, 60, other_physics, (
        (Figure.HONEST, Bar(57 / 60, 60)), (Figure.NAMED, Bar(0.8, 30)))),
    "machines": Family(18_021, 100, machines, (
        (Figure.NAMED, Bar(0.92, 100)), (Figure.CERTAIN, Bar(1.0, 100)), (Figure.COVERED, Bar(0.93, 60, 0.97)))),
    "machines_nothing": Family(18_022, 20, machines_nothing, ((Figure.HONEST, Bar(1.0, 20)),)),
    "machines_pairs": Family(18_023, 20, machines_pairs, (
        (Figure.NAMED, Bar(0.92, 20)), (Figure.CERTAIN, Bar(1.0, 20)), (Figure.COVERED, Bar(0.93, 20, 0.97)))),
    "undetermined": Family(18_024, 20, undetermined, (
        (Figure.NAMED, Bar(0.92, 20)), (Figure.CERTAIN, Bar(1.0, 20)), (Figure.COVERED, Bar(0.93, 15)))),
    "thresholds": Family(18_020, 80, nothing, (
        (Figure.NAMED, Bar(0.9, 40, kinds=(ABOVE,))), (Figure.NAMED, Bar(0.0, 40, 0.5, (BELOW,))))),
}  # fmt: skip
"""Families by name; the cases of `thresholds` follow from what diagnoses of its first campaigns,
without an effect, state.
"""

ALL_COVERED = Bar(0.93, 600, 0.97)
"""Bar of the two-sided intervals of all families together."""


def plan_case(name: str, number: int) -> Case:
    """Plan the case of a number, from 1 on."""
    family = FAMILIES[name]
    block, place = divmod(number - 1, BLOCK)
    plan = family.block(np.random.default_rng([family.seed, 0, block]))[place]
    return replace(plan, family=name, number=number, seed=family.seed)


BASED = 20
"""Number of cases of `thresholds` that share the thresholds of one campaign without an effect."""


def threshold_case(number: int, stated: dict[str, float]) -> Case:
    """Plan a case of `thresholds`: one effect of 1.2 (odd numbers) or 0.6 times the size from which
    it would be named.

    Parameters
    ----------
    stated : by effect, the value of its reported parameter from which the diagnosis of a campaign
        without it would name it
    """
    seed, above = FAMILIES["thresholds"].seed, number % 2 == 1
    names = np.random.default_rng([seed, 1]).permutation(
        [name for name in INJECTED if name in stated]
    )
    name = str(names[(number - 1) // 2 % len(names)])
    absent = 1.0 if name in ("ke_rolloff", "gas_polytropic") else 0.0
    value = absent + (1.2 if above else 0.6) * (stated[name] - absent)
    kind = ABOVE if above else BELOW
    plan = Case("thresholds", number, seed, {name: 1.0}, kind, reported={name: value})
    return replace(plan, truth=truth_by_effects(plan.effects, {}))
