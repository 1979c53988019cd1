"""What an honest answer to a case may be, and the truth.json beside its campaign, by which `trial_judge` judges a diagnosis."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

import msgspec
from trial_cases import NOMINAL, draw, true_numbers
from trial_judge import Record
from trial_plans import Plan

from winchcascade.blind.cases import STATED_LOADS
from winchcascade.blind.history import run_changes
from winchcascade.blind.twin import Twin
from winchcascade.blind.twin_numbers import LOAD_SCATTER, SCATTER


class Expected(msgspec.Struct, frozen=True, omit_defaults=True):
    """Expected answers of a kind of cases; see `trial_judge.judge` for the keys."""

    honest: str
    may_be_certain: tuple[str, ...] = ()
    named: tuple[tuple[str, ...], ...] = ()
    alone: bool = False
    no_gap_is_false: bool = False
    excused_by: tuple[str, ...] = ()


def _drift(honest: str, *excused_by: str) -> Expected:
    return Expected(honest, no_gap_is_false=True, excused_by=excused_by)


_WARMED = ("heating", "copper_heating", "ke_shift")
_OPEN = ("unexplained", "partly_explained")
_OUTSIDE = Expected("any verdict, but no cause with certainty: none of the catalogue acts")

EXPECTED: dict[str, Expected] = {
    "warming in load order": Expected(
        "heating, or heating and ke_rolloff as declared alternatives; never ke_rolloff with certainty",
        _WARMED,
        (("heating",),),
    ),
    "warming shuffled": Expected(
        "heating alone: the order is not that of the loads", _WARMED, (("heating",),), alone=True
    ),
    "warming magnets in load order": Expected(
        "heating, or heating and ke_rolloff as declared alternatives; never ke_rolloff with certainty",
        ("heating", "ke_shift"),
        (("heating",),),
    ),
    "warming magnets shuffled": Expected(
        "heating alone: the order is not that of the loads", ("heating", "ke_shift"), (("heating",),), alone=True
    ),
    "rolloff in load order": Expected(
        "ke_rolloff, or with heating as its alternative; never heating with certainty",
        ("ke_rolloff",),
        (("ke_rolloff",),),
    ),
    "rolloff shuffled": Expected("ke_rolloff alone", ("ke_rolloff",), (("ke_rolloff",),), alone=True),
    "rope": Expected(
        "load_proportional_loss or force_gain, each with the other as declared alternative",
        ("load_proportional_loss",),
        (("load_proportional_loss", "force_gain"),),
    ),
    "leak": Expected("gas_loss; never precharge with certainty", ("gas_loss",), (("gas_loss",),)),
    "gear under load": _OUTSIDE,
    "dead diode": _OUTSIDE,
    "diode": Expected("diode_drop; copper_heating only as its alternative", ("diode_drop",), (("diode_drop",),)),
    "cable": Expected(
        "a series resistance: copper_heating or diode_drop, each with the other as declared alternative",
        (),
        (("copper_heating", "diode_drop"),),
    ),
    "drift of torque_zero": _drift("neither no_gap nor explained", *_OPEN),
    "drift of torque_gain": _drift("neither no_gap nor explained", *_OPEN),
    "drift of force_zero": _drift("not no_gap, and no cause with certainty"),
    "drift of vdc_gain": _drift("not no_gap, and no cause with certainty"),
    "overrunning clutch": Expected("clutch_drag", ("clutch_drag",), (("clutch_drag",),)),
}
"""Expected answers by the kind of a plan."""

EFFECT_OF = {
    "k_e": "ke_shift", "r_s": "copper_heating", "l_s": "sync_inductance", "b_rotor": "rotor_viscous", "p_gas": "precharge",
    "area": "piston_area", "v_gas": "gas_volume", "eta_mesh": "gear_mesh_loss", "mu": "screw_friction",
    "torque": "torque_gain", "force": "force_gain", "vdc": "voltage_gain", "idc": "current_gain", "pressure": "pressure_gain",
}  # fmt: skip
"""Effect by which a wrong number or gain of the rig is named."""

REAL = 2.5
"""Deviation of a number from the rig file, in stated uncertainties, from which it is a true cause. [1]"""


def deviations(plan: Plan, twin: Twin) -> dict[str, float]:
    """Deviation of each number and gain of a twin from the rig file, in stated uncertainties. [1]"""
    numbers = {
        name: (true - stated) / u - plan.bias.get(name, 0.0)
        for name, true, stated, u in zip(twin.numbers._fields, twin.numbers, NOMINAL, SCATTER, strict=True)
    }
    return numbers | {name: (gain - 1.0) / LOAD_SCATTER for name, gain in twin.gains.items()}


def expected(plan: Plan, twin: Twin) -> Expected:
    """Expected answers to a case: those of its kind, or its effects alone, beside numbers of the rig file that are wrong."""
    if plan.kind:
        return EXPECTED[plan.kind]
    true = [EFFECT_OF[name] for name, by in deviations(plan, twin).items() if name in EFFECT_OF and abs(by) >= REAL]
    wrong = true if plan.bias or plan.scatter != 1.0 else []
    words = " + ".join(plan.effects) or "nothing"
    if wrong:
        words += f"; true deviations of the rig file may be named beside it: {', '.join(wrong)}"
    named = tuple((name,) for name in plan.effects)
    return Expected(words, (*plan.effects, *wrong), named, alone=True)


def truth_of(plan: Plan) -> Record:
    """The truth of a case, as nested records."""
    _, twin, _ = draw(plan)
    order = plan.order or tuple(STATED_LOADS)
    found = msgspec.to_builtins(expected(plan, twin))
    return {
        "family": plan.family,
        "case": plan.number,
        "kind": plan.kind or plan.family,
        "what": f"{plan.hidden}, {', '.join(_number_words(plan))}".rstrip(", "),
        **{"may_be_certain": [], "named": [], **found},
        "certain_is_false": "every effect but those of may_be_certain",
        "order": ["open circuit" if math.isinf(load := STATED_LOADS[log]) else load for log in order],
        "effects": true_numbers(plan),
        "physics": plan.physics,
        "history": msgspec.to_builtins(plan.history),
        "runs": {log: msgspec.to_builtins(run) for log, run in zip(order, run_changes(plan.history, order), strict=True)},
        "rig": twin.numbers._asdict(),
        "loads": twin.loads,
        "gains": twin.gains,
        "deviations": deviations(plan, twin),
    }  # fmt: skip


def _number_words(plan: Plan) -> Iterator[str]:
    """Injected numbers of a case in words."""
    h = plan.history
    yield from (f"{name} {value:.3g}" for name, value in plan.physics.items())
    if h.k_e_fall:
        yield f"{h.heat} heat, k_e -{100 * h.k_e_fall:.1f} %, r_s +{100 * h.r_s_rise:.0f} %, tau {h.time_constant:.1f} runs"
    if h.gas_leak:
        yield f"gas -{100 * h.gas_leak:.2f} %"
    yield from (f"{name} {value:+.3g}" for name, value in (h.gain_drifts | h.zero_drifts).items())
    if plan.scatter != 1.0:
        yield f"scatter x {plan.scatter:g}"


def truth_text(plan: Plan, **further: str) -> str:
    """Content of a truth.json."""
    return json.dumps({**truth_of(plan), **further}, indent=1) + "\n"
