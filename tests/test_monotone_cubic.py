"""The monotone cubic against scipy's, which costs a quarter of a second to import."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from winchcascade.core.monotone_cubic import monotone_cubic

ROUNDING = 1e-12


VALUES = st.integers(-5000, 5000).map(lambda n: n / 1000.0) | st.sampled_from((0.0, 1.0))
"""No closer to each other than a sensor resolves: for differences of 1e-308 scipy's slopes overflow."""


@given(st.lists(st.tuples(st.floats(0.01, 10.0), VALUES), min_size=2, max_size=30))
def test_values_and_slopes_are_those_of_scipy(steps: list[tuple[float, float]]) -> None:
    widths, values = np.array(steps).T
    knots = np.cumsum(widths)
    x = np.concatenate((knots, np.linspace(knots[0] - 0.1, knots[-1] + 0.1, 101)))
    ours, theirs = monotone_cubic(knots, values), PchipInterpolator(knots, values)
    scale = 1.0 + np.max(np.abs(theirs(x))) + np.max(np.abs(theirs.derivative()(x)))
    np.testing.assert_allclose(ours(x), theirs(x), rtol=0, atol=ROUNDING * scale)
    np.testing.assert_allclose(ours.slope(x), theirs.derivative()(x), rtol=0, atol=ROUNDING * scale / widths.min())


@pytest.mark.parametrize("shape", [(9, 3), (9, 3, 2), (2, 4)])
def test_columns_are_curves_of_their_own(shape: tuple[int, ...]) -> None:
    knots, values = np.arange(float(shape[0])), np.random.default_rng(5).normal(size=shape)
    x = np.linspace(0.0, knots[-1], 40)
    np.testing.assert_allclose(
        monotone_cubic(knots, values)(x), PchipInterpolator(knots, values)(x), rtol=0, atol=ROUNDING
    )


def test_a_single_place_gives_a_number() -> None:
    assert float(monotone_cubic([0.0, 2.0], [1.0, 5.0])(0.5)) == 2.0
