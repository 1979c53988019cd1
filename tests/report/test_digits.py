"""Digits: a stated number never hides what is known, nor shows what is not."""

import math
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from winchcascade.report.content import Measured, number_text, places, shown

ROUNDING = 0.0503
"""Half of the last digit over u is largest where u is rounded up to a power of ten: 0.05 /
0.995.
"""

FLOAT = 1e-14
"""What a float of 16 digits and its decimal text may differ by, relatively."""

U = st.floats(1e-9, 1e7)
TIMES_U = st.floats(-1e6, 1e6)


@given(U, TIMES_U)
@example(0.0996, 3.0)
@example(9.96, -7.5)
@example(1e-3, 0.05)
def test_a_stated_value_differs_from_the_value_by_a_twentieth_of_its_uncertainty_at_most(
    u: float, times: float
) -> None:
    value = u * times
    assert abs(float(shown(Measured(value, u))) - value) <= ROUNDING * u + FLOAT * abs(value)


@given(U)
@example(0.0996)
@example(9.96)
@example(0.00295)
@example(1000.0)
def test_an_uncertainty_has_two_digits_and_ends_where_its_value_does(u: float) -> None:
    value, own = (
        Decimal(text).scaleb(places(u))
        for text in shown(Measured(3.0 * u, u, both=True)).split(" +- ")
    )
    assert [value, own] == [value.to_integral_value(), own.to_integral_value()]
    assert 10 <= own <= 99


@given(U, st.floats(1.0, 1e3))
def test_a_larger_uncertainty_never_gives_more_decimals(u: float, factor: float) -> None:
    assert places(u * factor) <= places(u)


@given(st.floats(-1.0, 1.0), st.integers(-3, 6))
def test_what_rounds_to_zero_has_no_minus(share: float, decimals: int) -> None:
    text = number_text(0.49 * share * 10.0**-decimals, decimals, signed=True)
    assert float(text) == 0
    assert text[0] == "0"


@pytest.mark.parametrize("value", [None, math.nan])
def test_what_does_not_exist_is_a_dash(value: float | None) -> None:
    assert {
        number_text(value, 2),
        number_text(value),
        shown(Measured(value, 0.1)),
        shown(value),
    } == {"-"}


@pytest.mark.parametrize("u", [None, 0.0, math.nan])
def test_without_an_uncertainty_a_value_has_the_decimals_of_its_column(u: float | None) -> None:
    assert shown(Measured(-0.90337, u), 3) == "-0.903"


@given(st.floats(1e-4, 1e7), st.booleans())
def test_four_significant_digits_keep_the_value_to_half_of_the_last(
    size: float, negative: bool
) -> None:
    value = -size if negative else size
    assert float(number_text(value)) == pytest.approx(value, rel=0.5e-3)
