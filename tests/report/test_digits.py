"""Digits: a stated number never hides what is known, nor shows what is not."""

import math
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from winchcascade.report.digits import MINUS, number, percent, places, significant, stated, uncertain

ROUNDING = 0.0503
"""Half of the last digit over u is largest where u is rounded up to a power of ten: 0.05 / 0.995."""

FLOAT = 1e-14
"""What a float of 16 digits and its decimal text may differ by, relatively."""

U = st.floats(1e-9, 1e9)
TIMES_U = st.floats(-1e6, 1e6)
NOTHING = [None, math.nan, math.inf, -math.inf]


def plain(text: str) -> str:
    """A shown number as Python writes it, powers of ten as exponents."""
    lowered = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    return text.replace(MINUS, "-").replace("×10", "e").translate(lowered)


def read(text: str) -> float:
    assert "-" not in text  # a hyphen is no minus
    return float(plain(text))


@given(U, TIMES_U)
@example(0.0996, 3.0)
@example(9.96, -7.5)
@example(2.95, 1e6)
@example(1e-3, 0.05)
def test_a_stated_value_differs_from_the_value_by_a_twentieth_of_its_uncertainty_at_most(
    u: float, times: float
) -> None:
    value = u * times
    assert abs(read(stated(value, u, 0)) - value) <= ROUNDING * u + FLOAT * abs(value)


@given(U)
@example(0.0996)
@example(9.96)
@example(99.6)
@example(2.95)
@example(0.00295)
@example(1e-6)
@example(1000.0)
def test_an_uncertainty_has_two_digits(u: float) -> None:
    digits = Decimal(plain(uncertain(u))).scaleb(places(u))
    assert digits == digits.to_integral_value()
    assert 10 <= digits <= 99
    assert read(uncertain(u)) == pytest.approx(u, rel=ROUNDING)


@pytest.mark.parametrize(
    ("u", "text"),
    [
        (0.0996, "0.10"), (0.996, "1.0"), (9.96, "10"), (99.6, "100"), (0.096, "0.096"), (0.94, "0.94"), (2.94, "2.9"),
        (2.96, "3.0"), (0.0296, "0.030"), (1.0, "1.0"), (0.1, "0.10"), (116.0, "120"), (0.0, "0"), (None, "–"),
    ],
)  # fmt: skip
def test_an_uncertainty_is_rounded_across_a_power_of_ten(u: float | None, text: str) -> None:
    assert uncertain(u) == text


@given(U, st.floats(1.0, 1e3))
def test_a_larger_uncertainty_never_gives_more_decimals(u: float, factor: float) -> None:
    assert places(u * factor) <= places(u)


@given(U, TIMES_U)
def test_a_value_and_its_uncertainty_end_at_the_same_digit(u: float, times: float) -> None:
    ends = [Decimal(plain(text)).scaleb(places(u)) for text in (stated(u * times, u, 0), uncertain(u))]
    assert [end == end.to_integral_value() for end in ends] == [True, True]


@given(st.floats(-1e12, 1e12), st.integers(-6, 9))
def test_a_number_and_its_opposite_differ_in_the_minus_alone(value: float, decimals: int) -> None:
    text, opposite = number(value, decimals), number(-value, decimals)
    assert text.lstrip(MINUS) == opposite.lstrip(MINUS)
    assert text.startswith(MINUS) != opposite.startswith(MINUS) or read(text) == 0


@given(st.floats(-1.0, 1.0), st.integers(-3, 6))
def test_what_rounds_to_zero_has_no_minus(share: float, decimals: int) -> None:
    text = number(0.49 * share * 10.0**-decimals, decimals)
    assert read(text) == 0
    assert MINUS not in text


@pytest.mark.parametrize("value", NOTHING)
def test_what_does_not_exist_is_a_dash(value: float | None) -> None:
    assert {number(value, 2), number(value, -2), stated(value, 0.1, 3), stated(value, None, 3), significant(value)} == {
        "–"
    }


@pytest.mark.parametrize("u", [None, 0.0])
def test_without_an_uncertainty_a_value_has_the_usual_decimals(u: float | None) -> None:
    assert stated(-0.90337, u, 3) == f"{MINUS}0.903"
    assert stated(0.0, u, 2) == "0.00"


@given(st.floats(1e-9, 1e9), st.integers(1, 6), st.booleans())
def test_significant_digits_keep_the_value_to_half_of_the_last(size: float, digits: int, negative: bool) -> None:
    value = -size if negative else size
    assert read(significant(value, digits)) == pytest.approx(value, rel=0.5 * 10.0 ** (1 - digits) + FLOAT)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.9996, "1.00"), (9.996, "10.0"), (99.96, "100"), (999.6, "1000"), (-0.09996, f"{MINUS}0.100"), (0.0, "0")],
)
def test_a_number_that_rounds_up_to_a_power_of_ten_has_no_further_digit(value: float, text: str) -> None:
    assert significant(value, 3) == text


@given(st.floats(0.0, 1.0), st.integers(0, 3))
def test_a_share_is_stated_to_half_of_its_last_digit_and_never_as_nothing(share: float, decimals: int) -> None:
    text = percent(share, decimals)
    last = 10.0**-decimals
    if text.startswith("<"):
        assert read(text[1:]) == pytest.approx(last)
        assert 0 < 100.0 * share <= 0.5 * last
    else:
        assert read(text) == pytest.approx(100.0 * share, abs=0.5 * last + 100.0 * FLOAT)
        assert (read(text) == 0) == (share == 0)


@pytest.mark.parametrize("share", [None, math.nan])
def test_a_share_that_does_not_exist_is_a_dash(share: float | None) -> None:
    assert percent(share) == "–"
