"""Effects that a rig file states: read, compared with the catalogue, and part of the model."""

from pathlib import Path

import pytest

from winchcascade import RigError, baseline, load_rig
from winchcascade.core.rig_toml import parse_rig
from winchcascade.rig.effects.catalogue import make_effect

BASED = 'based_on = "hsu2026"\nname = "mine"\n'
STATED = (
    BASED
    + """[effects.gear_mesh_loss]
logs = ["r18ohm.csv", "r36ohm.csv"]
efficiency_change = { value = -3, unit = "%", low = -3.2, high = -2.8, source = "diagnosis" }
[effects.line_friction]
torque = 5.0
"""
)


def test_a_stated_effect_is_read_in_si_units_with_interval_and_logs() -> None:
    stated = parse_rig(STATED, "mine.toml").effects["gear_mesh_loss"]
    number = stated.fields["efficiency_change"]
    assert (number.value, number.low, number.high) == pytest.approx((-0.03, -0.032, -0.028))
    assert number.source == "diagnosis"
    assert stated.logs == ("r18ohm.csv", "r36ohm.csv")


def test_the_model_of_a_rig_has_the_effects_that_its_file_states() -> None:
    model = baseline(parse_rig(BASED, "mine.toml"))
    for name, fields in (("gear_mesh_loss", {"efficiency_change": -0.03}), ("line_friction", {"torque": 5.0})):
        model = make_effect(name, fields).apply(model)
    assert baseline(parse_rig(STATED, "mine.toml")) == model


def test_a_further_heat_of_the_gas_changes_nothing_where_it_is_absent() -> None:
    rig = parse_rig(BASED + "[effects.gas_polytropic]\nn = 1.2\ncooling = 9.0\n", "mine.toml")
    model = baseline(rig)
    assert make_effect("gas_polytropic", {}).apply(model) == model


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[effects.ke_rollof]\na = 1\n", "[effects.ke_rollof]: effect 'ke_rollof' is not in the catalogue; names like it: ke"),
        ("[effects.line_drag]\nc = 1\n", "[effects.line_drag]: effect line_drag has no field 'c'; it has b"),
        ("[effects.line_drag]\nb = -1\n", "b is -1, but must lie between 0 and 1000"),
        ("[effects.line_drag]\n", "[effects.line_drag] has no field; expected b"),
        ('[effects.line_drag]\nb = { value = 1, unit = "kg" }\n', "b: the unit is 'kg'; expected 'N.m.s/rad'"),
        ('[effects.line_drag]\nb = { value = 1, unit = "elle" }\n', "[effects.line_drag] b: the unit 'elle' is none of"),
        ("[effects.line_drag]\nb = { value = 1, tolerance = 2 }\n", "[effects.line_drag] b tolerance is no entry"),
        ('[effects.line_drag]\nb = "one"\n', "[effects.line_drag] b value is 'one'; expected a number"),
        ("[effects.line_drag]\nb = nan\n", "[effects.line_drag] b value is nan"),
        ("[effects.line_drag]\nb = 1\nlogs = [1]\n", "[effects.line_drag] logs"),
        ("[effects]\nline_drag = 1\n", "effects line_drag is 1"),
        ("effects = 1\n", "effects is 1; expected a table"),
    ],
)  # fmt: skip
def test_a_wrong_stated_effect_is_one_sentence_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((text + BASED) if text.startswith("effects =") else BASED + text, encoding="utf-8")
    with pytest.raises(RigError) as fault:
        load_rig(path)
    assert str(fault.value).startswith(f"{path}: ")
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)
