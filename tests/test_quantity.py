"""Units: the table holds what loggers and rig files write, each with its factor and zero."""

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
        ("yards", 0.9144), ("ozf", 0.27801385095378), ("kip", 4448.2216152605), ("knot", 1852 / 3600), ("torr", 101325 / 760),
        ("kilonewtons", 1e3), ("meters per second", 1.0), ("m s⁻¹", 1.0), ("rad_s", 1.0), ("mN", 1e-3), ("N/(mm^2)", 1e6),
        ("Newton Meters", 1.0), ("in/s", 0.0254),
    ],
)  # fmt: skip
def test_a_unit_has_its_factor(text: str, si: float) -> None:
    unit = find_unit(text)
    assert unit is not None
    assert unit.factor == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "value", "zero"),
    [
        ("bar(a)", ATMOSPHERE / 1e5, 0.0), ("°C", 0.0, 273.15), ("℃", 0.0, 273.15), ("deg C", 0.0, 273.15),
        ("K", 273.15, 273.15), ("°F", 32.0, 273.15), ("degF", 32.0, 273.15),
    ],
)  # fmt: skip
def test_a_scale_has_its_own_zero(text: str, value: float, zero: float) -> None:
    unit = find_unit(text)
    assert unit is not None
    assert unit.factor * value + unit.offset == pytest.approx(zero, rel=1e-12, abs=1e-6)


@pytest.mark.parametrize(
    "text", ["", "furlong", "foo", "N/A", "mPa", "lux", "V/A", "gas", "9**9**9", "m" * 61]
)
def test_text_that_is_no_unit_is_not_taken_for_one(text: str) -> None:
    assert find_unit(text) is None


@given(st.sampled_from(sorted(UNITS)))
def test_blanks_around_a_unit_do_not_matter(name: str) -> None:
    assert find_unit(f" {name} ") == UNITS[name]
