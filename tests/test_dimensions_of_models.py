"""No size of one rig decides about another: constants of models, diagnosis and design are
shares, but for a few.
"""

from dimensioned import dimensioned

from winchcascade.rig.parts import PARTS, numbers_of

CONSTANTS = {
    "rig.state.FADED": "the smallest number that a processor computes fast with, far below any "
    "that is read",
    "rig.parts.IN_RIG": "radians of a revolution, and gravity, which nature fixes",
    "rig.physics.RPM": "revolutions a minute of a radian a second",
    "design.corrected_rig.JOULES_PER_KWH": "joules of a kilowatt hour",
}
"""Constants that may have a dimension, with their reasons."""

DEFAULTS = {
    "winch.stribeck_speed": "of a friction that is absent; `baseline` sets it to a multiple of "
    "the onset speed",
    "restoring.lead_angle": "an angle, of a screw that is absent",
    "restoring.pressure": "the atmosphere, which nature fixes",
    "restoring.volume": "of a gas that is absent",
    "restoring.cooling": "of a gas that is isothermal; the effect that heats it sets it",
    "generator.i_rated": "`baseline` sets it to the rated current",
}
"""Numbers of a model that may have another default than zero, with their reasons."""


def test_constants_with_a_dimension_are_those_that_have_a_reason() -> None:
    assert (
        dimensioned("rig", "diagnosis", "design", but=("diagnosis/stages",)).keys()
        == CONSTANTS.keys()
    )


def test_a_constant_with_a_dimension_is_found_by_its_note() -> None:
    assert dimensioned("core")["core.quantity.ATMOSPHERE"] == "Pa"


def test_numbers_of_a_model_with_a_dimension_are_zero_unless_they_are_stated() -> None:
    found = {
        f"{part}.{name}"
        for part, kind in PARTS.items()
        for name, number in numbers_of(part).items()
        if number.unit != "1" and kind._field_defaults.get(name, 0.0) != 0.0
    }
    assert found == DEFAULTS.keys()
