import pytest
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core.quantity import ATMOSPHERE, UNITS, find_unit


@pytest.mark.parametrize(
    ("text", "si"),
    [
        ("kgf", 9.80665), ("kN", 1e3), ("lbf", 4.4482216152605), ("kg/cm2", 98066.5), ("kgf/cm²", 98066.5), ("bar", 1e5),
        ("MPa", 1e6), ("psi", 6894.757293168), ("mA", 1e-3), ("N·m", 1.0), ("N*m", 1.0), ("N-m", 1.0), ("kgf·m", 9.80665),
        ("mm", 1e-3), ("ms", 1e-3), ("µs", 1e-6), ("rpm", 0.10471975511965977), ("km/h", 1 / 3.6), ("Ω", 1.0), ("K N", 1e3),
    ],
)  # fmt: skip
def test_a_unit_has_its_factor(text: str, si: float) -> None:
    unit = find_unit(text)
    assert unit is not None
    assert unit.factor == pytest.approx(si, rel=1e-12)


def test_absolute_pressure_is_turned_into_gauge() -> None:
    unit = find_unit("bar(a)")
    assert unit is not None
    assert unit.factor * 1.01325 + unit.offset == pytest.approx(0.0, abs=1e-6)
    assert unit.offset == -ATMOSPHERE


@pytest.mark.parametrize(
    ("text", "melting"), [("°C", 0.0), ("℃", 0.0), ("deg C", 0.0), ("K", 273.15), ("°F", 32.0), ("degF", 32.0)]
)
def test_a_temperature_has_the_zero_of_its_scale(text: str, melting: float) -> None:
    unit = find_unit(text)
    assert unit is not None
    assert unit.dimension == "temperature"
    assert unit.factor * melting + unit.offset == pytest.approx(273.15, rel=1e-12)


@pytest.mark.parametrize("text", ["", "furlong", "foo", "N/A", "mPa", "lux", "V/A"])
def test_text_that_is_no_unit_is_not_taken_for_one(text: str) -> None:
    assert find_unit(text) is None


@given(st.sampled_from(sorted(UNITS)))
def test_blanks_around_a_unit_do_not_matter(name: str) -> None:
    assert find_unit(f" {name} ") == UNITS[name]
