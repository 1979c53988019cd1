import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from winchcascade.core.integrate import median, quantile

VALUES = arrays(np.float64, st.integers(1, 60), elements=st.floats(-1e6, 1e6))


@given(VALUES, st.floats(0, 1))
def test_a_quantile_is_that_of_numpy(x: np.ndarray, q: float) -> None:
    assert quantile(x, q) == pytest.approx(float(np.quantile(x, q)), rel=1e-9, abs=1e-9)


@given(VALUES)
def test_a_median_is_that_of_numpy(x: np.ndarray) -> None:
    assert median(x) == pytest.approx(float(np.median(x)), rel=1e-9, abs=1e-9)
