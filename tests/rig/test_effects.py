"""Laws that hold for every effect of the catalogue; one more effect adds its tests by being listed."""

import itertools
import math
from dataclasses import fields
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core.errors import OptionError
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.read import read_run
from winchcascade.rig.effects.catalogue import EFFECTS, Effect, describe, find_effect, make_effect, words
from winchcascade.rig.effects.ke_rolloff import KeRolloff
from winchcascade.rig.parts import ROLLOFF_KNOTS, Model, baseline
from winchcascade.rig.simulate import READ, STEP, Simulation, simulate

ROOT = Path(__file__).parent.parent.parent

CONTRACT = [
    ("ke_rolloff", "generator", "k_e_ratio_at_10_a", "1"),
    ("ke_shift", "generator", "k_e_change", "relative"),
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
    ("drum_inertia", "transmission", "j_extra", "kg m2"),
    ("drum_layering", "transmission", "radius_change_per_10_m", "relative"),
    ("gas_polytropic", "restoring", "n", "1"),
    ("gas_volume", "restoring", "volume_extra", "m3"),
    ("precharge", "restoring", "pressure_change", "relative"),
    ("piston_area", "restoring", "area_change", "relative"),
    ("seal_friction", "restoring", "force", "N"),
    ("screw_friction", "restoring", "mu_change", "absolute"),
    ("torque_gain", "sensor", "gain_error", "relative"),
    ("force_zero", "sensor", "offset", "N"),
    ("force_gain", "sensor", "gain_error", "relative"),
    ("voltage_gain", "sensor", "gain_error", "relative"),
    ("current_gain", "sensor", "gain_error", "relative"),
    ("electrical_lag", "sensor", "lag", "s"),
]
"""The table of the interface: name, stage, parameter reported, unit (the project writes N.m for N m)."""

UPSTREAM_OF_GENERATOR = ({"vdc", "idc", "torque", "force"}, {"pressure"})
ON_THE_FAST_SHAFT = ({"torque", "force"}, {"pressure"})
AT_THE_LINE = ({"force"}, {"pressure", "torque", "vdc", "idc"})
IN_THE_GAS = ({"pressure", "force"}, {"torque", "vdc", "idc"})

SHOWS: dict[str, tuple[set[str], set[str]]] = {
    "ke_rolloff": UPSTREAM_OF_GENERATOR,
    "ke_shift": UPSTREAM_OF_GENERATOR,
    "copper_heating": UPSTREAM_OF_GENERATOR,
    "sync_inductance": UPSTREAM_OF_GENERATOR,
    "diode_drop": UPSTREAM_OF_GENERATOR,
    "load_drift": UPSTREAM_OF_GENERATOR,
    "gear_mesh_loss": ON_THE_FAST_SHAFT,
    "rotor_viscous": ON_THE_FAST_SHAFT,
    "rotor_windage": ON_THE_FAST_SHAFT,
    "rotor_friction": ON_THE_FAST_SHAFT,
    "rotor_inertia": ON_THE_FAST_SHAFT,
    "clutch_drag": ({"torque", "force"}, {"pressure", "vdc", "idc"}),
    "line_friction": AT_THE_LINE,
    "line_drag": AT_THE_LINE,
    "drum_inertia": AT_THE_LINE,
    "drum_layering": AT_THE_LINE,
    "gas_polytropic": IN_THE_GAS,
    "gas_volume": IN_THE_GAS,
    "precharge": IN_THE_GAS,
    "piston_area": IN_THE_GAS,
    "seal_friction": AT_THE_LINE,
    "screw_friction": AT_THE_LINE,
    "torque_gain": ({"torque"}, set(READ) - {"torque"}),
    "force_zero": AT_THE_LINE,
    "force_gain": AT_THE_LINE,
    "voltage_gain": ({"vdc"}, set(READ) - {"vdc"}),
    "current_gain": ({"idc"}, set(READ) - {"idc"}),
    "electrical_lag": ({"vdc", "idc"}, {"pressure", "force", "torque"}),
}
"""Channels that an effect moves, and those that it cannot touch, as the line's motion is given. What is in neither follows
from the rotor running down after payout."""

NOISE = 1e-3
"""Twice the error of the simulation's step, as a share of a channel's peak."""

BALANCE = 1e-3
"""Share of the line's energy that the ledger may miss."""

ROUNDING = 1e-12
"""A few operations in double precision."""

LOADS = [("r45ohm.csv", 45.0), ("r18ohm.csv", 18.0), ("r4p5ohm.csv", 4.5), ("open_circuit.csv", math.inf)]

every_effect = pytest.mark.parametrize("name", EFFECTS)


def half(kind: type[Effect]) -> Effect:
    """Make an effect half way from absent to its upper bound, or to the lower one where absent is the upper."""
    values = {}
    for field in fields(kind):
        low, high = field.metadata["low"], field.metadata["high"]
        assert isinstance(field.default, float)
        values[field.name] = 0.5 * (field.default + (high if high > field.default else low))
    return make_effect(next(name for name, one in EFFECTS.items() if one is kind), values)


@cache
def model() -> Model:
    return baseline(built_in())


@cache
def simulated(log: str, load: float, name: str | None) -> Simulation:
    run = read_run(ROOT / "fixtures" / "campaign" / log, load=load)
    return simulate(run, half(EFFECTS[name]).bend(model()) if name else model())


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
    listed = [
        (name, kind.stage, parameter, unit)
        for name, kind in EFFECTS.items()
        for parameter, unit in kind.reports.items()
    ]
    assert listed == [(name, stage, parameter, unit.replace("N m", "N.m").replace("m s", "m.s").replace("kg m", "kg.m"))
                      for name, stage, parameter, unit in CONTRACT]  # fmt: skip


def test_every_file_of_the_room_is_listed() -> None:
    files = {path.stem for path in (ROOT / "winchcascade" / "rig" / "effects").glob("*.py")} - {"__init__", "catalogue"}
    assert files == set(EFFECTS)


def test_the_table_of_channels_covers_the_catalogue() -> None:
    assert set(SHOWS) == set(EFFECTS)


@every_effect
def test_an_effect_stands_in_the_file_of_its_name(name: str) -> None:
    kind = EFFECTS[name]
    assert kind.__module__ == f"winchcascade.rig.effects.{name}"
    assert kind.__name__ == "".join(word.capitalize() for word in name.split("_"))


@every_effect
def test_a_docstring_has_its_three_parts(name: str) -> None:
    said = words(EFFECTS[name])
    assert all(len(part) > 10 for part in (said.summary, said.shows_as, said.taken_for, said.source))
    assert all(channel in said.shows_as for channel in SHOWS[name][0])


@every_effect
def test_fields_have_unit_source_and_bounds_that_hold_the_absent_value(name: str) -> None:
    kind = EFFECTS[name]
    assert [field.name for field in fields(kind)] == list(kind.possible)
    for field in fields(kind):
        of, (least, most) = field.metadata, kind.possible[field.name]
        assert of["unit"]
        assert of["source"]
        assert least <= of["low"] <= field.default <= of["high"] <= most
        assert of["low"] < of["high"]


@every_effect
def test_an_effect_reports_what_it_says(name: str) -> None:
    kind = EFFECTS[name]
    assert list(kind().reported()) == list(half(kind).reported()) == list(kind.reports)
    assert all(math.isfinite(value) for value in half(kind).reported().values())
    assert set(kind().reported().values()) <= {0.0, 1.0}


@every_effect
def test_an_effect_is_absent_at_its_defaults(name: str) -> None:
    assert EFFECTS[name]().bend(model()) == model()


@every_effect
def test_a_bent_model_is_another_one_and_the_first_stays(name: str) -> None:
    before = numbers(model())
    assert half(EFFECTS[name]).bend(model()) != model()
    assert numbers(model()) == before


@every_effect
def test_any_two_effects_compose_in_either_order(name: str) -> None:
    one = half(EFFECTS[name])
    for other in (half(kind) for kind in EFFECTS.values()):
        there = numbers(other.bend(one.bend(model())))
        assert numbers(one.bend(other.bend(model()))) == pytest.approx(there, rel=ROUNDING, abs=ROUNDING)


@every_effect
def test_two_effects_of_one_kind_add_up_in_either_order(name: str) -> None:
    kind = EFFECTS[name]
    values = {field.name: getattr(half(kind), field.name) for field in fields(kind) if field.name != "cooling"}
    # the cooling time of a gas is its own, not a change of one
    absent = {field.name: field.default for field in fields(kind)}
    small = make_effect(name, {key: absent[key] + 0.3 * (value - absent[key]) for key, value in values.items()})
    large = make_effect(name, values)
    there = numbers(small.bend(large.bend(model())))
    assert numbers(large.bend(small.bend(model()))) == pytest.approx(there, rel=ROUNDING, abs=ROUNDING)
    assert there != pytest.approx(numbers(large.bend(model())), rel=1e-6, abs=1e-9)


@every_effect
def test_an_effect_shows_in_its_channels_and_in_none_that_it_cannot_touch(name: str) -> None:
    moved, untouched = SHOWS[name]
    before = simulated("r18ohm.csv", 18.0, None).run.channels
    after = simulated("r18ohm.csv", 18.0, name).run.channels
    for channel in moved:
        assert np.abs(after[channel] - before[channel]).max() > NOISE * np.abs(before[channel]).max(), channel
    for channel in untouched | {"displacement", "velocity"}:
        np.testing.assert_array_equal(after[channel], before[channel], err_msg=channel)


@every_effect
@pytest.mark.parametrize(("log", "load"), LOADS)
def test_the_energy_of_the_line_is_accounted_for(name: str, log: str, load: float) -> None:
    energy = simulated(log, load, name).energy
    at = int(np.argmax(energy["line"]))
    booked = sum(float(joule[at]) for entry, joule in energy.items() if entry != "line")
    assert booked == pytest.approx(float(energy["line"][at]), rel=BALANCE)


@every_effect
def test_half_the_step_gives_the_same(name: str) -> None:
    """At the heaviest load, where currents and their feedback are largest."""
    coarse = simulated("r4p5ohm.csv", 4.5, name).run.channels
    run = read_run(ROOT / "fixtures" / "campaign" / "r4p5ohm.csv", load=4.5)
    fine = simulate(run, half(EFFECTS[name]).bend(model()), step=0.5 * STEP).run.channels
    for channel in READ:
        assert np.abs(fine[channel] - coarse[channel]).max() < NOISE * np.abs(coarse[channel]).max(), channel


def within(field: str) -> st.SearchStrategy[float]:
    of = next(one.metadata for one in fields(KeRolloff) if one.name == field)
    return st.floats(of["low"], of["high"])


@given(st.tuples(*(within(field.name) for field in fields(KeRolloff))))
def test_a_rolloff_never_rises(lost: tuple[float, ...]) -> None:
    effect = KeRolloff(*lost)
    left = (1.0, *effect.bend(model()).generator.rolloff)
    assert all(before >= after > 0.0 for before, after in itertools.pairwise(left))
    at_9, at_11 = (left[ROLLOFF_KNOTS.index(knot)] for knot in (9.0, 11.0))
    assert at_11 <= effect.reported()["k_e_ratio_at_10_a"] <= at_9


def test_relative_changes_multiply_and_absolute_ones_add() -> None:
    twice = make_effect("ke_shift", {"k_e_change": 0.1}).bend(
        make_effect("ke_shift", {"k_e_change": 0.1}).bend(model())
    )
    assert twice.generator.k_e == pytest.approx(1.21 * model().generator.k_e)
    gains = make_effect("torque_gain", {"gain_error": 0.1})
    assert gains.bend(gains.bend(model())).sensors.gain["torque"] == pytest.approx(0.21)
    drag = make_effect("rotor_viscous", {"b_extra": 1e-3})
    assert drag.bend(drag.bend(model())).drivetrain.b_rotor == pytest.approx(model().drivetrain.b_rotor + 2e-3)


def test_rope_layers_are_given_for_ten_metres() -> None:
    bent = make_effect("drum_layering", {"radius_change_per_10_m": -0.1}).bend(model())
    assert bent.winch.layering == pytest.approx(-0.01)


def test_the_cooling_time_of_an_absent_effect_is_that_of_the_part() -> None:
    cooling = next(field for field in fields(EFFECTS["gas_polytropic"]) if field.name == "cooling")
    assert cooling.default == model().restoring.cooling


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
def test_what_cannot_be_made_is_refused_in_one_sentence(name: str, values: dict[str, float], sentence: str) -> None:
    with pytest.raises(OptionError) as fault:
        make_effect(name, values)
    assert str(fault.value) == sentence


def test_an_effect_is_found_by_its_name() -> None:
    assert find_effect("ke_rolloff") is KeRolloff


def test_the_table_names_every_effect_in_a_hundred_columns() -> None:
    lines = describe().splitlines()
    assert max(map(len, lines)) <= 100
    named = [line.split()[0] for line in lines[1:] if not line.startswith(" ")]
    assert named == list(EFFECTS)


@every_effect
def test_the_sheet_of_an_effect_tells_all_of_it(name: str) -> None:
    text = " ".join(describe(name).split())
    said = words(EFFECTS[name])
    assert all(part in text for part in (said.summary, said.shows_as, said.taken_for, said.source))
    for field in fields(EFFECTS[name]):
        of = field.metadata
        assert f"{field.name} [{of['unit']}]: {of['low']:g} to {of['high']:g}, absent {field.default:g}; " in text
        assert of["source"] in text


@every_effect
def test_the_manual_says_how_every_effect_shows(name: str) -> None:
    manual = " ".join((ROOT / "docs" / "effects.md").read_text(encoding="utf-8").split())
    said = words(EFFECTS[name])
    assert f"**`{name}`**" in manual
    assert all(part in manual for part in (said.summary, said.shows_as, said.taken_for))
