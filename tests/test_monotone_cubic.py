"""Monotone cubics against those of SciPy, and what defines them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from winchcascade.core.monotone_cubic import monotone_cubic

ROUNDED = 1e-9
"""Rounding of a cubic through values of order one, between knots a hundredth apart."""

steps = st.floats(0.01, 3.0)
values = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))


@given(st.lists(st.tuples(steps, values), min_size=2, max_size=9))
def test_values_and_slopes_are_those_of_scipy_also_beyond_the_ends(
    points: list[tuple[float, float]],
) -> None:
    widths, y = np.array(points).T
    x = np.cumsum(widths)
    at = np.sort(np.r_[x, np.linspace(x[0] - 0.1, x[-1] + 0.1, 31)])
    expected, found = PchipInterpolator(x, y), monotone_cubic(x, y)
    scale = 1.0 + np.abs(expected(at, 1)).max()
    assert found(at) == pytest.approx(expected(at), abs=ROUNDED * scale)
    assert found.slope(at) == pytest.approx(expected(at, 1), abs=ROUNDED * scale**2)


@given(st.lists(st.tuples(steps, st.floats(0.0, 1.0)), min_size=2, max_size=9))
def test_a_curve_through_rising_values_rises(points: list[tuple[float, float]]) -> None:
    widths, rises = np.array(points).T
    x, y = np.cumsum(widths), np.cumsum(rises)
    drawn = monotone_cubic(x, y)(np.linspace(x[0], x[-1], 200))
    assert np.diff(drawn).min() >= -ROUNDED


def test_several_curves_at_once_are_those_one_by_one() -> None:
    x, y = np.array([0.0, 1.0, 3.0, 4.0]), np.random.default_rng(1).normal(size=(4, 2, 3))
    found = monotone_cubic(x, y)([0.5, 3.5])
    assert found.shape == (2, 2, 3)
    assert found[:, 1, 2] == pytest.approx(monotone_cubic(x, y[:, 1, 2])([0.5, 3.5]))
