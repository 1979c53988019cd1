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
from own_rigs import own_rig
from rigs import scales_on

from winchcascade.core.errors import OptionError, RigError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.effects import effects_report
from winchcascade.rig.baseline import baseline, load_rig
from winchcascade.rig.effects.catalogue import EFFECTS, SIMPLIFICATIONS, make_effect
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.rig.parts import PARTS, ROLLOFF_KNOTS, Model, in_rig_file, numbers_of, with_part
from winchcascade.rig.simulate import READ, Simulation, simulate

ROOT = Path(__file__).parent.parent.parent

UPSTREAM_OF_GENERATOR = "vdc idc torque force", "pressure"
ON_THE_HIGH_SPEED_SHAFT = "torque force", "pressure"
AT_THE_LINE = "force", "pressure torque vdc idc"
IN_THE_GAS = "pressure force", "torque vdc idc"
WITHOUT_GAS = "force", "torque vdc idc"
EVERYWHERE = "pressure force torque vdc idc", ""

CONTRACT = {
    "ke_rolloff": ("generator", "k_e_ratio_at_10_a", "1", *UPSTREAM_OF_GENERATOR),
    "ke_shift": ("generator", "k_e_change", "relative", *UPSTREAM_OF_GENERATOR),
    "heating": ("generator", "k_e_change", "relative", *UPSTREAM_OF_GENERATOR),
    "copper_heating": ("generator", "r_s_change", "relative", *UPSTREAM_OF_GENERATOR),
    "sync_inductance": ("generator", "l_s_change", "relative", *UPSTREAM_OF_GENERATOR),
    "diode_drop": ("generator", "v_d_extra", "V", *UPSTREAM_OF_GENERATOR),
    "load_drift": ("generator", "r_load_change", "relative", *UPSTREAM_OF_GENERATOR),
    "gear_mesh_loss": ("gearbox", "efficiency_change", "absolute", *ON_THE_HIGH_SPEED_SHAFT),
    "rotor_viscous": ("gearbox", "b_extra", "N.m.s/rad", *ON_THE_HIGH_SPEED_SHAFT),
    "rotor_windage": ("gearbox", "c_extra", "N.m.s2/rad2", *ON_THE_HIGH_SPEED_SHAFT),
    "rotor_friction": ("gearbox", "torque", "N.m", *ON_THE_HIGH_SPEED_SHAFT),
    "rotor_inertia": ("gearbox", "j_change", "relative", *ON_THE_HIGH_SPEED_SHAFT),
    "clutch_drag": ("gearbox", "torque", "N.m", *ON_THE_HIGH_SPEED_SHAFT),
    "line_friction": ("transmission", "torque", "N.m, at the drum", *AT_THE_LINE),
    "line_drag": ("transmission", "b", "N.m.s/rad, at the drum", *AT_THE_LINE),
    "load_proportional_loss": ("transmission", "share", "relative", *AT_THE_LINE),
    "stribeck": ("transmission", "slow_torque", "N.m, at the drum", *AT_THE_LINE),
    "drum_inertia": ("transmission", "j_extra", "kg.m2", *AT_THE_LINE),
    "drum_layering": ("transmission", "radius_change_per_10_m", "relative", *AT_THE_LINE),
    "gas_polytropic": ("restoring", "n", "1", *IN_THE_GAS),
    "gas_volume": ("restoring", "volume_extra", "m3", *IN_THE_GAS),
    "precharge": ("restoring", "pressure_change", "relative", *IN_THE_GAS),
    "gas_loss": ("restoring", "pressure_change", "relative", *IN_THE_GAS),
    "piston_area": ("restoring", "area_change", "relative", *IN_THE_GAS),
    "seal_friction": ("restoring", "force", "N", *AT_THE_LINE),
    "screw_friction": ("restoring", "mu_change", "absolute", *AT_THE_LINE),
    "torque_gain": ("sensor", "gain_error", "relative", "torque", "pressure force vdc idc"),
    "force_zero": ("sensor", "offset", "N", *AT_THE_LINE),
    "force_gain": ("sensor", "gain_error", "relative", *AT_THE_LINE),
    "voltage_gain": ("sensor", "gain_error", "relative", "vdc", "pressure force torque idc"),
    "current_gain": ("sensor", "gain_error", "relative", "idc", "pressure force torque vdc"),
    "pressure_gain": ("sensor", "gain_error", "relative", "pressure", "force torque vdc idc"),
    "electrical_lag": ("sensor", "lag", "s", "vdc idc", "pressure force torque"),
    "drum_radius": ("entry", "r_drum", "m", *EVERYWHERE),
    "gear_ratio": ("entry", "gear_ratio", "1", *UPSTREAM_OF_GENERATOR),
    "pole_pairs": ("entry", "pole_pairs", "1", *UPSTREAM_OF_GENERATOR),
    "screw_lead": ("entry", "lead", "m/rev", *IN_THE_GAS),
    "spring_force": ("entry", "force", "N", *WITHOUT_GAS),
    "spring_stiffness": ("entry", "stiffness", "N/m", *WITHOUT_GAS),
    "counterweight": ("entry", "weight", "N", *WITHOUT_GAS),
    "encoder_scale": ("entry", "scale", "1", *EVERYWHERE),
    "load_entry": ("entry", "load_ohm", "ohm", *UPSTREAM_OF_GENERATOR),
    "k_e_convention": ("entry", "k_e_ratio", "1", *UPSTREAM_OF_GENERATOR),
    "r_s_convention": ("entry", "r_s_ratio", "1", *UPSTREAM_OF_GENERATOR),
    "l_s_convention": ("entry", "l_s_ratio", "1", *UPSTREAM_OF_GENERATOR),
}
"""The interface: stage, parameter reported and its unit, then the channels that an effect moves and
those that it cannot touch, as the motion of the line is given. What is in neither follows from the
rotor running down after payout."""

NOISE = 1e-3
"""Twice the error of the simulation's step, as a share of a channel's peak."""

BALANCE = 1e-3
"""Share of the line's energy that the ledger may miss."""

ROUNDING = 1e-12
"""A few operations in double precision."""

ONE_CYCLE = 46.0
"""Time after which the line rests again in the logs of the campaign. [s]"""

MIDDLE, HEAVIEST, OPEN = ("r18ohm.csv", 18.0), ("r4p5ohm.csv", 4.5), ("open_circuit.csv", math.inf)

every_effect = pytest.mark.parametrize("name", EFFECTS)


def half(effect: Effect) -> ActiveEffect:
    """Make an effect half way from absent to its upper bound, or to the lower one where absent
    is the upper.
    """
    ends = [field.high if field.high > field.absent else field.low for field in effect.fields]
    return ActiveEffect(
        effect, tuple(0.5 * (f.absent + end) for f, end in zip(effect.fields, ends, strict=True))
    )


KINDS = {"spring_force": "spring", "spring_stiffness": "spring", "counterweight": "counterweight"}
"""Restoring modules that the rig of the paper does not have, by the effects that act on them."""


def rig(name: str | None = None) -> Rig:
    """A rig that has the part that an effect acts on."""
    return own_rig(KINDS[name]) if name in KINDS else built_in()


@cache
def model(name: str | None = None) -> Model:
    """Model of that rig."""
    return baseline(rig(name))


@cache
def motion(log: str, load: float) -> Run:
    """The first payout and haul-in of a log."""
    run = read_run(ROOT / "fixtures" / "campaign" / log, load=load)
    own = run.t < ONE_CYCLE
    channels = {name: x[own] for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[own], channels=channels, samples=int(own.sum()))


@cache
def own(name: str) -> Effect:
    """An effect with its ranges in units, of that rig and a log."""
    return EFFECTS[name].at(scales_on(rig(name), [motion(*MIDDLE)]))


@cache
def simulated(log: str, load: float, name: str, *, absent: bool = False) -> Simulation:
    return simulate(
        motion(log, load), model(name) if absent else half(own(name)).apply(model(name))
    )


def numbers(of: Model) -> np.ndarray:
    """Every number of a model."""
    sensors = of.sensors
    errors = [
        sensors.electrical_lag,
        sensors.motion_scale,
        *(kind.get(c, 0.0) for kind in (sensors.gain, sensors.zero) for c in READ),
    ]
    return np.hstack([*errors, *(number for part in PARTS for number in getattr(of, part))])


def same(one: Model, other: Model) -> bool:
    return np.allclose(numbers(one), numbers(other), rtol=ROUNDING, atol=ROUNDING)


def test_the_catalogue_is_the_table_of_the_interface() -> None:
    listed = {
        name: (effect.stage, effect.parameter, effect.unit) for name, effect in EFFECTS.items()
    }
    assert list(listed.items()) == [(name, row[:3]) for name, row in CONTRACT.items()]


@every_effect
def test_a_declaration_has_its_texts_and_fields_with_bounds_about_the_absent_value(
    name: str,
) -> None:
    effect = EFFECTS[name]
    assert all(
        len(part) > 10
        for part in (effect.summary, effect.shows_as, effect.taken_for, effect.source)
    )
    assert all(channel in effect.shows_as for channel in CONTRACT[name][3].split())
    assert len(effect.label) <= 20
    for field in effect.fields:
        assert field.unit
        assert field.source
        assert field.possible[0] <= field.low <= field.absent <= field.high <= field.possible[1]
        assert field.low < field.high


@every_effect
def test_an_effect_is_absent_at_its_defaults_and_another_model_with_values(name: str) -> None:
    absent, given = make_effect(name, {}), model(name)
    assert absent.reported in (0.0, 1.0)
    assert absent.apply(given) == given
    assert math.isfinite(half(own(name)).reported)
    assert half(own(name)).apply(given) != given


@every_effect
def test_effects_compose_in_either_order_and_two_of_one_kind_are_one_with_both_values(
    name: str,
) -> None:
    one = half(own(name))
    for other in (half(own(kind)) for kind in EFFECTS if kind != name):
        assert same(one.apply(other.apply(model(name))), other.apply(one.apply(model(name))))
    values = zip(one.effect.fields, one.values, strict=True)
    small = ActiveEffect(
        one.effect, tuple(field.absent + 0.3 * (value - field.absent) for field, value in values)
    )
    assert same(small.apply(one.apply(model(name))), small.after(one.values).apply(model(name)))
    assert not same(small.apply(one.apply(model(name))), one.apply(model(name)))


@every_effect
def test_an_effect_shows_in_its_channels_and_in_none_that_it_cannot_touch(name: str) -> None:
    before, after = (
        simulated(*MIDDLE, name, absent=absent).run.channels for absent in (True, False)
    )
    *_, moved, untouched = CONTRACT[name]
    for channel in moved.split():
        assert (
            np.abs(after[channel] - before[channel]).max() > NOISE * np.abs(before[channel]).max()
        ), channel
    for channel in (*untouched.split(), "displacement", "velocity"):
        np.testing.assert_array_equal(after[channel], before[channel], err_msg=channel)


@every_effect
@pytest.mark.parametrize(
    "log",
    [MIDDLE, *(pytest.param(log, marks=pytest.mark.slow) for log in (HEAVIEST, OPEN))],
    ids=str,
)
def test_the_energy_of_the_line_is_accounted_for(log: tuple[str, float], name: str) -> None:
    energy = simulated(*log, name).energy
    at = int(np.argmax(energy["line"]))
    booked = sum(float(joule[at]) for entry, joule in energy.items() if entry != "line")
    assert booked == pytest.approx(float(energy["line"][at]), rel=BALANCE)


@given(st.tuples(*(st.floats(field.low, field.high) for field in EFFECTS["ke_rolloff"].fields)))
def test_a_rolloff_never_rises_and_has_a_field_for_each_knot(lost: tuple[float, ...]) -> None:
    effect = ActiveEffect(EFFECTS["ke_rolloff"], lost)
    left = (1.0, *effect.apply(model()).generator.rolloff)
    assert all(before >= after > 0.0 for before, after in itertools.pairwise(left))
    assert left[ROLLOFF_KNOTS.index(2.2)] <= effect.reported <= left[ROLLOFF_KNOTS.index(1.8)]
    names = [f"lost_to_{knot:.1f}".replace(".", "p") for knot in ROLLOFF_KNOTS[1:]]
    assert [field.name for field in effect.effect.fields] == names


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("ke_rollof", {}, "names like it: ke_rolloff; `winchcascade effects` lists all"),
        (
            "gas_polytropic",
            {"m": 1.2},
            "effect gas_polytropic has no field 'm'; it has n, cooling.",
        ),
        ("seal_friction", {"force": -1.0}, "force is -1, but must lie between 0 and inf [N]"),
        (
            "ke_shift",
            {"k_e_change": math.nan},
            "k_e_change is nan, but must lie between -0.9 and 9 [1]",
        ),
    ],
)
def test_what_cannot_be_made_is_rejected(name: str, values: dict[str, float], says: str) -> None:
    with pytest.raises(OptionError) as fault:
        make_effect(name, values)
    assert says in str(fault.value)


# ---------------------------------------------------------------------- effects that a rig states
BASED = 'based_on = "hsu2026"\nname = "mine"\n'


def test_the_model_of_a_rig_has_the_effects_that_its_file_states() -> None:
    stated = parse_rig(
        BASED
        + '[effects.gear_mesh_loss]\nefficiency_change = { value = -3, unit = "%", source = "diagnosis" }\n'
        "[effects.line_friction]\ntorque = 5.0\n",
        "mine.toml",
    )
    changed = with_part(model(), "winch", friction=5.0)
    changed = with_part(changed, "drivetrain", eta_mesh=changed.drivetrain.eta_mesh - 0.03)
    assert same(baseline(stated), changed)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[effects.ke_rollof]\na = 1\n", "[effects.ke_rollof]: effect 'ke_rollof' is not in the "
                                         "catalogue; names like it: ke"),
        ("[effects.line_drag]\nc = 1\n", "[effects.line_drag]: effect line_drag has no field 'c'; "
                                         "it has b"),
        ("[effects.line_drag]\nb = -1\n", "b is -1, but must lie between 0 and inf"),
        ("[effects.line_drag]\n", "[effects.line_drag] has no field; expected b"),
        ('[effects.line_drag]\nb = { value = 1, unit = "kg" }\n', "b: the unit is 'kg'; expected "
                                                                  "'N.m.s/rad'"),
        ("[effects.line_drag]\nb = { value = 1, tolerance = 2 }\n", "[effects.line_drag] b "
                                                                    "tolerance is no entry"),
        ('[effects.line_drag]\nb = "one"\n', "[effects.line_drag] b value is 'one'; expected a "
                                             "number"),
        ("[effects]\nline_drag = 1\n", "effects line_drag is 1"),
        ("[sensors.errors.line_drag]\nb = 1\n", "is no error of a sensor; state it as "
                                                "[effects.line_drag]"),
    ],
)  # fmt: skip
def test_a_wrong_stated_effect_is_one_sentence_with_its_place(
    tmp_path: Path, text: str, says: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(BASED + text, encoding="utf-8")
    with pytest.raises(RigError) as fault:
        load_rig(path)
    assert str(fault.value).startswith(f"{path}: ")
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)


# -------------------------------------------------------------------------------- simplifications
@cache
def first_cycle(load: float) -> Run:
    run = motion(*(OPEN if math.isinf(load) else ("r36ohm.csv", load)))
    last = int(np.argmax(run.t > 40.0))
    channels = {name: x[:last] for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[:last], samples=last, channels=channels)


def simplified(load: float, **shares: float) -> Simulation:
    made = model()
    for name, share in shares.items():
        made = ActiveEffect(SIMPLIFICATIONS[name], (share,)).apply(made)
    return simulate(first_cycle(load), made)


@pytest.mark.parametrize("name", SIMPLIFICATIONS)
def test_a_simplification_with_a_share_of_zero_changes_nothing(name: str) -> None:
    assert ActiveEffect(SIMPLIFICATIONS[name], (0.0,)).apply(model()) == model()


@pytest.mark.parametrize("bridge", ["averaged_bridge", "uncommutated_bridge"])
def test_a_quasi_static_simulation_with_an_averaged_bridge_is_that_of_the_textbook(
    bridge: str,
) -> None:
    made = simplified(36.0, quasi_static=1.0, **{bridge: 1.0})
    x, machine = made.run.channels, model().generator
    moves = x["velocity"] > 0.5
    reactance = machine.pole_pairs * made.rpm_gen * math.pi / 30.0 * machine.l_s
    drop = 3.0 / math.pi * reactance * (bridge == "averaged_bridge") + 2.0 * machine.r_s
    expected = (
        3.0 * math.sqrt(2.0) / math.pi * machine.k_e * made.rpm_gen
        - drop * x["idc"]
        - 2.0 * machine.v_diode
    )
    assert np.allclose(
        x["vdc"][moves], expected[moves], rtol=2e-3
    )  # the table has a kink where the current begins
    assert np.all(x["vdc"][x["velocity"] < -0.2] == 0.0)


def test_what_a_simulation_leaves_out_is_gone() -> None:
    still, weightless = (
        simplified(36.0, **{name: 1.0}).run for name in ("quasi_static", "no_rotor_inertia")
    )
    v = still.channels["velocity"]
    speeds_up = (np.gradient(v, still.t) > 0.1) & (v > 0.2)
    assert np.all(weightless.channels["torque"][speeds_up] < still.channels["torque"][speeds_up])
    assert np.allclose(weightless.channels["vdc"], still.channels["vdc"])
    with_bleed, without = (
        simplified(math.inf, no_bleed=share).run.channels["vdc"] for share in (0.0, 1.0)
    )
    assert with_bleed[-1] < 0.5 * with_bleed.max()
    assert without[-1] > 0.95 * without.max()
    hot = with_part(model(), "restoring", exponent=1.3)
    assert ActiveEffect(SIMPLIFICATIONS["isothermal_gas"], (1.0,)).apply(
        hot
    ).restoring.exponent == pytest.approx(1.0)
    assert (
        ActiveEffect(SIMPLIFICATIONS["no_drum_inertia"], (1.0,)).apply(model()).winch.inertia == 0.0
    )


# ----------------------------------------------------------------------------------- descriptions
@every_effect
def test_the_report_of_an_effect_has_all_of_its_declaration(name: str) -> None:
    text, effect = " ".join(terminal_text(effects_report(name)).split()), EFFECTS[name]
    assert all(
        part in text for part in (effect.summary, effect.shows_as, effect.taken_for, effect.source)
    )
    for field in effect.fields:
        scale = field.scale.replace("_", " ")
        row = f"{field.name} {field.unit} {field.low:g} to {field.high:g} {scale} {field.absent:g} {field.source}"
        assert " ".join(row.split()) in text


PAGE = ROOT / "docs" / "effects.md"
STAGES = {"generator": "Generator", "gearbox": "Gearbox", "transmission": "Transmission", "restoring": "Restoring module",
          "sensor": "Sensors", "entry": "Wrong entries"}  # fmt: skip


def paragraph(effect: Effect) -> str:
    """An effect as the page describes it: what is reported of it, what the baseline lacks, in
    italics where it shows.
    """
    text = f"**`{effect.name}`** (`{effect.parameter}`, {effect.unit}): {effect.summary} *{effect.shows_as}*"
    return textwrap.fill(text, 128, break_on_hyphens=False, break_long_words=False)


def page() -> str:
    """The page of the effects: its introduction as it is, the rest from the declarations and the
    parts.
    """
    parts = [PAGE.read_text(encoding="utf-8").split("\n\n## ")[0]]
    for stage, heading in STAGES.items():
        parts += [
            f"## {heading}",
            *(paragraph(effect) for effect in EFFECTS.values() if effect.stage == stage),
        ]
    rows = ["|number|unit|by default|what it is|", "|---|---|---|---|"]
    for part, kind in PARTS.items():
        for name, number in numbers_of(part).items():
            stated = "stated" if name in in_rig_file(part) else f"{kind._field_defaults[name]:g}"
            rows.append(f"|`{part}.{name}`|{number.unit}|{stated}|{number.what}|")
    parts += ["## Numbers of the model", "\n".join(rows)]
    return "\n\n".join(parts) + "\n"


def test_the_page_of_the_effects_is_made_of_their_declarations() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
