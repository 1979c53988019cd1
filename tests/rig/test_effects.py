"""Laws that hold for every effect of the catalogue; one more effect adds its tests by being listed.

`python tests/rig/test_effects.py` writes the declarations into docs/effects.md.
"""

import itertools
import math
import textwrap
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core.errors import OptionError
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.effects import effects_report
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, find_effect, make_effect
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.rig.parts import ROLLOFF_KNOTS, Model
from winchcascade.rig.simulate import READ, STEP, Simulation, simulate

ROOT = Path(__file__).parent.parent.parent

CONTRACT = [
    ("ke_rolloff", "generator", "k_e_ratio_at_10_a", "1"),
    ("ke_shift", "generator", "k_e_change", "relative"),
    ("heating", "generator", "k_e_change", "relative"),
    ("copper_heating", "generator", "r_s_change", "relative"),
    ("sync_inductance", "generator", "l_s_change", "relative"),
    ("diode_drop", "generator", "v_d_extra", "V"),
    ("load_drift", "generator", "r_load_change", "relative"),
    ("gear_mesh_loss", "gearbox", "efficiency_change", "absolute"),
    ("rotor_viscous", "gearbox", "b_extra", "N m s/rad"),
    ("rotor_windage", "gearbox", "c_extra", "N m s2/rad2"),
    ("rotor_friction", "gearbox", "torque", "N m"),
    ("rotor_inertia", "gearbox", "j_change", "relative"),
    ("clutch_drag", "gearbox", "torque", "N m"),
    ("line_friction", "transmission", "torque", "N m, at the drum"),
    ("line_drag", "transmission", "b", "N m s/rad, at the drum"),
    ("load_proportional_loss", "transmission", "share", "relative"),
    ("stribeck", "transmission", "slow_torque", "N m, at the drum"),
    ("drum_inertia", "transmission", "j_extra", "kg m2"),
    ("drum_layering", "transmission", "radius_change_per_10_m", "relative"),
    ("gas_polytropic", "restoring", "n", "1"),
    ("gas_volume", "restoring", "volume_extra", "m3"),
    ("precharge", "restoring", "pressure_change", "relative"),
    ("gas_loss", "restoring", "pressure_change", "relative"),
    ("piston_area", "restoring", "area_change", "relative"),
    ("seal_friction", "restoring", "force", "N"),
    ("screw_friction", "restoring", "mu_change", "absolute"),
    ("torque_gain", "sensor", "gain_error", "relative"),
    ("force_zero", "sensor", "offset", "N"),
    ("force_gain", "sensor", "gain_error", "relative"),
    ("voltage_gain", "sensor", "gain_error", "relative"),
    ("current_gain", "sensor", "gain_error", "relative"),
    ("pressure_gain", "sensor", "gain_error", "relative"),
    ("electrical_lag", "sensor", "lag", "s"),
    ("drum_radius", "entry", "r_drum", "m"),
    ("gear_ratio", "entry", "gear_ratio", "1"),
    ("pole_pairs", "entry", "pole_pairs", "1"),
    ("screw_lead", "entry", "lead", "m/rev"),
    ("encoder_scale", "entry", "scale", "1"),
    ("load_entry", "entry", "load_ohm", "ohm"),
    ("k_e_convention", "entry", "k_e_ratio", "1"),
    ("r_s_convention", "entry", "r_s_ratio", "1"),
    ("l_s_convention", "entry", "l_s_ratio", "1"),
]
"""The table of the interface: name, stage, parameter reported, unit (the project writes N.m for N m)."""

UPSTREAM_OF_GENERATOR = ({"vdc", "idc", "torque", "force"}, {"pressure"})
ON_THE_FAST_SHAFT = ({"torque", "force"}, {"pressure"})
AT_THE_LINE = ({"force"}, {"pressure", "torque", "vdc", "idc"})
IN_THE_GAS = ({"pressure", "force"}, {"torque", "vdc", "idc"})

SHOWS: dict[str, tuple[set[str], set[str]]] = {
    "ke_rolloff": UPSTREAM_OF_GENERATOR,
    "ke_shift": UPSTREAM_OF_GENERATOR,
    "heating": UPSTREAM_OF_GENERATOR,
    "copper_heating": UPSTREAM_OF_GENERATOR,
    "sync_inductance": UPSTREAM_OF_GENERATOR,
    "diode_drop": UPSTREAM_OF_GENERATOR,
    "load_drift": UPSTREAM_OF_GENERATOR,
    "gear_mesh_loss": ON_THE_FAST_SHAFT,
    "rotor_viscous": ON_THE_FAST_SHAFT,
    "rotor_windage": ON_THE_FAST_SHAFT,
    "rotor_friction": ON_THE_FAST_SHAFT,
    "rotor_inertia": ON_THE_FAST_SHAFT,
    "clutch_drag": ON_THE_FAST_SHAFT,
    "line_friction": AT_THE_LINE,
    "line_drag": AT_THE_LINE,
    "load_proportional_loss": AT_THE_LINE,
    "stribeck": AT_THE_LINE,
    "drum_inertia": AT_THE_LINE,
    "drum_layering": AT_THE_LINE,
    "gas_polytropic": IN_THE_GAS,
    "gas_volume": IN_THE_GAS,
    "precharge": IN_THE_GAS,
    "gas_loss": IN_THE_GAS,
    "piston_area": IN_THE_GAS,
    "seal_friction": AT_THE_LINE,
    "screw_friction": AT_THE_LINE,
    "torque_gain": ({"torque"}, set(READ) - {"torque"}),
    "force_zero": AT_THE_LINE,
    "force_gain": AT_THE_LINE,
    "voltage_gain": ({"vdc"}, set(READ) - {"vdc"}),
    "current_gain": ({"idc"}, set(READ) - {"idc"}),
    "pressure_gain": ({"pressure"}, set(READ) - {"pressure"}),
    "electrical_lag": ({"vdc", "idc"}, {"pressure", "force", "torque"}),
    "drum_radius": (set(READ), set()),
    "gear_ratio": UPSTREAM_OF_GENERATOR,
    "pole_pairs": UPSTREAM_OF_GENERATOR,
    "screw_lead": IN_THE_GAS,
    "encoder_scale": (set(READ), set()),
    "load_entry": UPSTREAM_OF_GENERATOR,
    "k_e_convention": UPSTREAM_OF_GENERATOR,
    "r_s_convention": UPSTREAM_OF_GENERATOR,
    "l_s_convention": UPSTREAM_OF_GENERATOR,
}
"""Channels that an effect moves, and those that it cannot touch, as the line's motion is given. What is in neither follows
from the rotor running down after payout."""

NOISE = 1e-3
"""Twice the error of the simulation's step, as a share of a channel's peak."""

BALANCE = 1e-3
"""Share of the line's energy that the ledger may miss."""

ROUNDING = 1e-12
"""A few operations in double precision."""

MIDDLE = ("r18ohm.csv", 18.0)
HEAVIEST = ("r4p5ohm.csv", 4.5)
LOADS = [
    pytest.param(*log, marks=pytest.mark.slow)
    for log in (HEAVIEST, ("r45ohm.csv", 45.0), ("open_circuit.csv", math.inf))
]
LOADS.append(pytest.param(*MIDDLE))

every_effect = pytest.mark.parametrize("name", EFFECTS)


def half(effect: Effect) -> ActiveEffect:
    """Make an effect half way from absent to its upper bound, or to the lower one where absent is the upper."""
    ends = [field.high if field.high > field.absent else field.low for field in effect.fields]
    half_way = (0.5 * (field.absent + end) for field, end in zip(effect.fields, ends, strict=True))
    return ActiveEffect(effect, tuple(half_way))


@cache
def model() -> Model:
    return baseline(built_in())


@cache
def motion(log: str, load: float) -> Run:
    return read_run(ROOT / "fixtures" / "campaign" / log, load=load)


@cache
def simulated(log: str, load: float, name: str | None) -> Simulation:
    run = motion(log, load)
    return simulate(run, half(EFFECTS[name]).apply(model()) if name else model())


def numbers(of: Model) -> dict[str, float]:
    """Every number of a model by its path."""
    found: dict[str, float] = {}
    waiting: list[tuple[str, object]] = [("", msgspec.to_builtins(of))]
    while waiting:
        path, value = waiting.pop()
        if isinstance(value, dict):
            waiting += [(f"{path}.{key}", inner) for key, inner in value.items()]
        elif isinstance(value, list | tuple):
            waiting += [(f"{path}.{index}", inner) for index, inner in enumerate(value)]
        else:
            assert isinstance(value, float | int)
            found[path] = value
    return found


def test_the_catalogue_is_the_table_of_the_interface() -> None:
    listed = [(name, effect.stage, effect.parameter, effect.unit) for name, effect in EFFECTS.items()]
    assert listed == [(name, stage, parameter, unit.replace("N m", "N.m").replace("m s", "m.s").replace("kg m", "kg.m"))
                      for name, stage, parameter, unit in CONTRACT]  # fmt: skip


def test_the_table_of_channels_covers_the_catalogue() -> None:
    assert set(SHOWS) == set(EFFECTS)


@every_effect
def test_a_declaration_has_its_texts(name: str) -> None:
    effect = EFFECTS[name]
    assert all(len(part) > 10 for part in (effect.summary, effect.shows_as, effect.taken_for, effect.source))
    assert all(channel in effect.shows_as for channel in SHOWS[name][0])


@every_effect
def test_fields_have_unit_source_and_bounds_that_hold_the_absent_value(name: str) -> None:
    for field in EFFECTS[name].fields:
        minimum, maximum = field.possible
        assert field.unit
        assert field.source
        assert minimum <= field.low <= field.absent <= field.high <= maximum
        assert field.low < field.high


@every_effect
def test_an_effect_reports_a_number(name: str) -> None:
    assert math.isfinite(half(EFFECTS[name]).reported)
    assert make_effect(name, {}).reported in (0.0, 1.0)


@every_effect
def test_an_effect_is_absent_at_its_defaults(name: str) -> None:
    assert make_effect(name, {}).apply(model()) == model()


@every_effect
def test_a_changed_model_is_another_one_and_the_first_stays(name: str) -> None:
    before = numbers(model())
    assert half(EFFECTS[name]).apply(model()) != model()
    assert numbers(model()) == before


@every_effect
def test_any_two_effects_compose_in_either_order(name: str) -> None:
    one = half(EFFECTS[name])
    for other in (half(kind) for kind in EFFECTS.values()):
        there = numbers(other.apply(one.apply(model())))
        assert numbers(one.apply(other.apply(model()))) == pytest.approx(there, rel=ROUNDING, abs=ROUNDING)


@every_effect
def test_two_effects_of_one_kind_add_up_in_either_order(name: str) -> None:
    effect = EFFECTS[name]
    named = zip(effect.fields, half(effect).values, strict=True)
    values = {field.name: value for field, value in named if field.name != "cooling"}
    # the cooling time of a gas is its own, not a change of one
    absent = {field.name: field.absent for field in effect.fields}
    small = make_effect(name, {key: absent[key] + 0.3 * (value - absent[key]) for key, value in values.items()})
    large = make_effect(name, values)
    there = numbers(small.apply(large.apply(model())))
    assert numbers(large.apply(small.apply(model()))) == pytest.approx(there, rel=ROUNDING, abs=ROUNDING)
    assert there != pytest.approx(numbers(large.apply(model())), rel=1e-6, abs=1e-9)


@every_effect
def test_an_effect_shows_in_its_channels_and_in_none_that_it_cannot_touch(name: str) -> None:
    moved, untouched = SHOWS[name]
    before = simulated(*MIDDLE, None).run.channels
    after = simulated(*MIDDLE, name).run.channels
    for channel in moved:
        assert np.abs(after[channel] - before[channel]).max() > NOISE * np.abs(before[channel]).max(), channel
    for channel in untouched | {"displacement", "velocity"}:
        np.testing.assert_array_equal(after[channel], before[channel], err_msg=channel)


@every_effect
@pytest.mark.parametrize(("log", "load"), LOADS)
def test_the_energy_of_the_line_is_accounted_for(log: str, load: float, name: str) -> None:
    energy = simulated(log, load, name).energy
    at = int(np.argmax(energy["line"]))
    booked = sum(float(joule[at]) for entry, joule in energy.items() if entry != "line")
    assert booked == pytest.approx(float(energy["line"][at]), rel=BALANCE)


ONSET = 0.03
"""Speed beyond which the line moves. [m/s]"""


@pytest.mark.slow
@every_effect
def test_half_the_step_gives_the_same(name: str) -> None:
    """At the heaviest load, where currents and their feedback are largest; at rest friction only bounds torque and force."""
    coarse = simulated(*HEAVIEST, name).run.channels
    run = motion(*HEAVIEST)
    moving = np.abs(run.channels["velocity"]) > ONSET
    fine = simulate(run, half(EFFECTS[name]).apply(model()), step=0.5 * STEP).run.channels
    for channel in READ:
        assert np.abs(fine[channel] - coarse[channel])[moving].max() < NOISE * np.abs(coarse[channel]).max(), channel


@given(st.tuples(*(st.floats(field.low, field.high) for field in EFFECTS["ke_rolloff"].fields)))
def test_a_rolloff_never_rises(lost: tuple[float, ...]) -> None:
    effect = ActiveEffect(EFFECTS["ke_rolloff"], lost)
    left = (1.0, *effect.apply(model()).generator.rolloff)
    assert all(before >= after > 0.0 for before, after in itertools.pairwise(left))
    at_9, at_11 = (left[ROLLOFF_KNOTS.index(knot)] for knot in (9.0, 11.0))
    assert at_11 <= effect.reported <= at_9


def test_relative_changes_multiply_and_absolute_ones_add() -> None:
    twice = make_effect("ke_shift", {"k_e_change": 0.1}).apply(
        make_effect("ke_shift", {"k_e_change": 0.1}).apply(model())
    )
    assert twice.generator.k_e == pytest.approx(1.21 * model().generator.k_e)
    gains = make_effect("torque_gain", {"gain_error": 0.1})
    assert gains.apply(gains.apply(model())).sensors.gain["torque"] == pytest.approx(0.21)
    drag = make_effect("rotor_viscous", {"b_extra": 1e-3})
    assert drag.apply(drag.apply(model())).drivetrain.b_rotor == pytest.approx(model().drivetrain.b_rotor + 2e-3)


def test_rope_layers_are_given_for_ten_metres() -> None:
    layered = make_effect("drum_layering", {"radius_change_per_10_m": -0.1}).apply(model())
    assert layered.winch.layering == pytest.approx(-0.01)


def test_the_cooling_time_of_an_absent_effect_is_that_of_the_part() -> None:
    assert make_effect("gas_polytropic", {}).values[1] == model().restoring.cooling


@pytest.mark.parametrize(
    ("name", "values", "sentence"),
    [
        (
            "ke_rollof", {},
            "effect 'ke_rollof' is not in the catalogue; names like it: ke_rolloff; `winchcascade effects` lists all.",
        ),
        ("zzz", {}, "effect 'zzz' is not in the catalogue; `winchcascade effects` lists all."),
        ("gas_polytropic", {"m": 1.2}, "effect gas_polytropic has no field 'm'; it has n, cooling."),
        ("seal_friction", {"force": -1.0}, "effect seal_friction: force is -1, but must lie between 0 and 100000 [N]."),
        ("ke_shift", {"k_e_change": math.nan}, "effect ke_shift: k_e_change is nan, but must lie between -0.9 and 9 [1]."),
        ("ke_shift", {"k_e_change": math.inf}, "effect ke_shift: k_e_change is inf, but must lie between -0.9 and 9 [1]."),
    ],
)  # fmt: skip
def test_what_cannot_be_made_is_rejected_in_one_sentence(name: str, values: dict[str, float], sentence: str) -> None:
    with pytest.raises(OptionError) as fault:
        make_effect(name, values)
    assert str(fault.value) == sentence


def test_an_effect_is_found_by_its_name() -> None:
    assert find_effect("ke_rolloff") is EFFECTS["ke_rolloff"]


@every_effect
def test_the_report_of_an_effect_has_all_of_its_declaration(name: str) -> None:
    text, effect = " ".join(terminal_text(effects_report(name)).split()), EFFECTS[name]
    for part in (effect.summary, effect.shows_as, effect.taken_for, effect.source):
        assert " ".join(part.split()) in text
    for field in effect.fields:
        assert f"{field.name} {field.unit} {field.low:g} to {field.high:g} {field.absent:g} {field.source}" in text


PAGE = ROOT / "docs" / "effects.md"
STAGES = {"generator": "Generator", "gearbox": "Gearbox", "transmission": "Transmission", "restoring": "Restoring module",
          "sensor": "Sensors", "entry": "Wrong entries"}  # fmt: skip


def paragraph(effect: Effect) -> str:
    """An effect as the page describes it."""
    text = (
        f"**`{effect.name}`** {effect.summary} Shows as: {effect.shows_as} Easily taken for: {effect.taken_for} "
        f"Reported as `{effect.parameter}` ({effect.unit})."
    )
    if len(effect.fields) > 1:
        text += f" Fields: {', '.join(f'`{field.name}`' for field in effect.fields)}."
    return textwrap.fill(text, 128, break_on_hyphens=False, break_long_words=False)


def page() -> str:
    """The page of the effects: its introduction as it is, the rest from the declarations."""
    parts = [PAGE.read_text(encoding="utf-8").split("\n\n## ")[0]]
    for stage, heading in STAGES.items():
        parts += [f"## {heading}", *(paragraph(effect) for effect in EFFECTS.values() if effect.stage == stage)]
    return "\n\n".join(parts) + "\n"


def test_the_page_of_the_effects_is_made_of_their_declarations() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
