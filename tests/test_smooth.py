import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from winchcascade.core.smooth import EVEN, local_quadratic
from winchcascade.rig.line_velocity import rate_weights

EXACT = 1e-9
"""A quadratic is fitted by a quadratic to rounding."""


def test_the_inside_of_an_even_log_is_smoothed_as_savitzky_and_golay_do() -> None:
    t = np.arange(200, dtype=np.float64) * 0.04
    x = np.random.default_rng(1).normal(size=t.size)
    ours = local_quadratic(t, x, 0.6)
    assert ours[7:-7] == pytest.approx(savgol_filter(x, 15, 2)[7:-7], abs=EXACT)


@given(st.lists(st.floats(0.01, 0.3), min_size=5, max_size=60), st.tuples(*[st.floats(-5, 5)] * 3))
def test_a_quadratic_survives_smoothing_on_any_stamps(
    steps: list[float], c: tuple[float, float, float]
) -> None:
    t = np.cumsum(steps)
    x = c[0] + c[1] * t + c[2] * t * t
    steepest = abs(c[1]) + 2 * abs(c[2]) * t[-1]
    taken_as_even = EVEN * 0.3 * steepest  # intervals that differ by less than EVEN are convolved
    assert local_quadratic(t, x, 0.6) == pytest.approx(
        x, abs=taken_as_even + 1e-5 * (1 + np.abs(x).max())
    )


def test_near_a_gap_only_samples_in_reach_count() -> None:
    t = np.concatenate(
        (np.arange(50, dtype=np.float64) * 0.04, 30.0 + np.arange(50, dtype=np.float64) * 0.04)
    )
    x = np.where(t < 10, 1.0, 5.0)
    assert local_quadratic(t, x, 0.6) == pytest.approx(x, abs=EXACT)


def test_jitter_hardly_moves_the_smoothed_value() -> None:
    rng = np.random.default_rng(2)
    t = np.arange(300, dtype=np.float64) * 0.04 + rng.uniform(-0.008, 0.008, 300)
    assert local_quadratic(t, np.sin(t), 0.6) == pytest.approx(
        np.sin(t), abs=2e-3
    )  # the bias of the fit itself


@pytest.mark.parametrize("n", [0, 1, 2, 3, 10])
def test_a_short_signal_comes_back_in_its_length(n: int) -> None:
    t = np.arange(n, dtype=np.float64) * 0.04
    assert local_quadratic(t, t, 0.6).size == n


def test_the_smoothed_signal_does_not_depend_on_the_blocks_of_a_long_log() -> None:
    t = np.arange(600_000, dtype=np.float64) * 0.04
    x = np.sin(0.3 * t)
    at = slice(262_100, 262_200)  # across the border of two blocks
    assert local_quadratic(t, x, 0.6)[at] == pytest.approx(
        local_quadratic(t[at], x[at], 0.6), abs=1e-3
    )


def test_stamps_that_crowd_carry_the_quadratic_all_the_same() -> None:
    t = np.concatenate(
        [np.arange(0.0, 4.0, 0.04), 4.0 + 1e-6 * np.arange(6_000), np.arange(4.06, 8.0, 0.04)]
    )
    x = 1.0 - 2.0 * t + 0.5 * t**2
    assert local_quadratic(t, x, 0.6) == pytest.approx(x, abs=1e-9)


def test_a_width_of_many_more_intervals_than_samples_takes_no_memory() -> None:
    t = 1e-12 * np.arange(20.0)
    assert local_quadratic(t, t, 1.0) == pytest.approx(t, abs=1e-15)


@given(st.integers(1, 12), st.floats(1e-3, 1e3), st.tuples(*[st.floats(-5, 5)] * 4))
def test_the_rate_of_a_cubic_survives_whatever_the_noise(
    half: int, share: float, c: tuple[float, float, float, float]
) -> None:
    step, k = 0.1, np.arange(-half, half + 1.0)
    t = step * k
    of_rate, of_position = rate_weights(half, step, 1.0, share * step)
    rate, position = (
        c[1] + c[2] * t + c[3] * t**2,
        c[0] + c[1] * t + c[2] * t**2 / 2 + c[3] * t**3 / 3,
    )
    assert of_rate @ rate + of_position @ position == pytest.approx(c[1], abs=1e-8)
    assert np.sum(of_position) == pytest.approx(
        0.0, abs=1e-8
    )  # where the position begins does not matter
