import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core import integrate
from winchcascade.core.integrate import (
    distinct,
    extremes,
    integrals,
    means_of,
    medians_of_others,
    positive_median,
    quantile,
    slope_of,
    values_at,
)

EXACT = 1e-9


def by_hand(t: np.ndarray, x: np.ndarray, begin: float, end: float) -> float:
    inside = (t > begin) & (t < end)
    nodes = np.concatenate(([begin], t[inside], [end]))
    return float(np.trapezoid(np.interp(nodes, t, x), nodes))


@given(st.integers(2, 80), st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_integrals_are_trapezoids_with_interpolated_ends(n: int, seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.01, 0.2, n))
    x = rng.normal(size=n)
    windows = np.sort(rng.uniform(t[0], t[-1], (k, 2)), axis=1)
    expected = [by_hand(t, x, *w) for w in windows]
    assert integrals(t, x.__getitem__, windows) == pytest.approx(expected, abs=EXACT)


def test_windows_that_end_on_samples_or_at_the_ends_of_the_log_are_whole() -> None:
    t, x = np.arange(10.0), np.arange(10.0) ** 2
    windows = np.array([[0.0, 9.0], [3.0, 4.0], [8.5, 9.0], [2.0, 2.0]])
    assert integrals(t, x.__getitem__, windows) == pytest.approx(
        [by_hand(t, x, *w) for w in windows]
    )


def test_blocks_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    t, x = np.arange(1000.0), rng.normal(size=1000)
    windows = np.sort(rng.uniform(0, 999, (40, 2)), axis=1)
    whole = integrals(t, x.__getitem__, windows)
    monkeypatch.setattr(integrate, "BLOCK", 64)
    assert integrals(t, x.__getitem__, windows) == pytest.approx(whole, abs=EXACT)


def test_a_mean_over_no_time_is_not_a_number() -> None:
    t = np.arange(5.0)
    assert np.isnan(means_of(t, [t.__getitem__], np.array([[2.0, 2.0]])))[0, 0]


def test_slopes_and_values_between_samples_are_those_of_numpy() -> None:
    rng = np.random.default_rng(3)
    t, x = np.cumsum(rng.uniform(0.5, 1.5, 50)), rng.normal(size=50)
    expected, slope = np.gradient(x, t), slope_of(t, x)
    for rows in (slice(0, 9), slice(20, 50)):
        assert slope(rows) == pytest.approx(expected[rows])
    instants = rng.uniform(t[0] - 1.0, t[-1] + 1.0, 200)
    assert values_at(t, x, instants) == pytest.approx(np.interp(instants, t, x))


def test_extremes_are_those_of_the_samples_inside() -> None:
    t, x = np.arange(6.0), np.array([9.0, 1.0, 5.0, 2.0, -4.0, 8.0])
    minimum, largest = extremes(t, x, np.array([[0.5, 2.1], [2.2, 2.4], [4.0, 5.0]]))
    assert minimum.tolist() == [1.0, 2.0, -4.0]
    assert largest.tolist() == [5.0, 2.0, 8.0]


@given(
    st.lists(
        st.one_of(st.integers(-5, 5).map(float), st.floats(-1e3, 1e3)), min_size=1, max_size=60
    ),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=4),
)
def test_order_statistics_are_those_of_numpy(values: list[float], shares: list[float]) -> None:
    x, shares = np.array(values), sorted(shares)
    expected = np.quantile(x, shares)
    assert [quantile(x, share) for share in shares] == pytest.approx(
        expected.tolist(), rel=1e-9, abs=1e-9
    )
    assert distinct(x).tolist() == np.unique(x).tolist()
    if x.size > 1:
        others = [float(np.median(np.delete(x, k))) for k in range(x.size)]
        assert medians_of_others(x).tolist() == pytest.approx(others)
    with_holes = np.concatenate((x, np.full(3, np.nan)))
    middle = float(np.median(x[x > 0])) if np.any(x > 0) else 0.0
    assert positive_median(x) == pytest.approx(middle)
    assert positive_median(with_holes) == pytest.approx(middle)
