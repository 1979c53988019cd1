"""Spikes are single samples, wherever they occur; steps, ramps, noise and ringing are none."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import all_pairs, failures
from numpy.typing import NDArray
from synthetic import SCENARIOS, SENSORS, make_log

from winchcascade.ingest.checks.spikes import find_bends, single_spikes

Signal = NDArray[np.float64]


def find_spikes(x: Signal) -> NDArray[np.intp]:
    bends = find_bends(x)
    return bends.logged(single_spikes(bends))


@cache
def logged(name: str, channel: str) -> Signal:
    log = make_log(SCENARIOS[name], np.random.default_rng(5))
    return log.columns[SENSORS[channel].header]


def with_spikes(x: Signal, places: list[int], size: float) -> list[int]:
    spoilt = x.copy()
    spoilt[places] += size * np.ptp(x)
    return [int(k) for k in find_spikes(spoilt)]


def test_a_spike_of_two_percent_or_more_is_found_in_a_noise_free_channel() -> None:
    def check(channel: str, size: float) -> None:
        x = logged("exact", channel)
        for k in range(60, x.size - 60, 167):
            smooth = np.abs(np.diff(x[k - 4 : k + 5], 2)).max() < 0.002 * np.ptp(x)
            assert not smooth or with_spikes(x, [k], size) == [k]

    assert failures(check, product(SENSORS, [0.02, -0.02, 0.05, 0.3, -1.0, 10.0, -1000.0])) == []


def test_a_spike_of_a_third_of_the_span_is_found_at_rest_on_ramps_and_on_the_plateau() -> None:
    def check(name: str, channel: str, size: float) -> None:
        x = logged(name, channel)
        places = range(30, x.size - 30, x.size // 40)
        found = [with_spikes(x, [k], size) == [k] for k in places]
        minimum = 0.95 if abs(size) < 1 else 1.0  # where the torque jumps, a third of the span is ordinary
        assert np.mean(found) >= minimum

    names = ["smooth", "heavy_load", "hundred_hertz", "everything"]
    assert failures(check, all_pairs(names, SENSORS, [0.3, -0.3, 1.0, -10.0, 1000.0])) == []


def test_a_spike_is_found_among_the_first_and_last_samples() -> None:
    def check(channel: str, size: float, place: int) -> None:
        x = logged("smooth", channel)
        k = place % x.size
        assert with_spikes(x, [k], size) == [k]

    assert failures(check, all_pairs(SENSORS, [0.2, -1.0, 1000.0], [0, 1, 2, 3, -4, -3, -2, -1])) == []


@pytest.mark.parametrize("apart", [3, 4, 7])
def test_two_spikes_close_to_each_other_are_both_found(apart: int) -> None:
    x = logged("smooth", "force")
    for k in range(50, x.size - 50, 97):
        assert with_spikes(x, [k, k + apart], 2.0) == [k, k + apart]


def test_a_spike_next_to_a_hole_is_found() -> None:
    x = logged("smooth", "force")
    for k in range(50, x.size - 50, 97):
        spoilt = x.copy()
        spoilt[k] += 5.0 * np.ptp(x)
        spoilt[k + 1 : k + 4] = np.nan
        assert find_spikes(spoilt).tolist() == [k]


def test_a_sample_alone_between_long_holes_is_no_spike() -> None:
    x = np.where(np.arange(400) % 40 == 20, 1.0, 0.0) + 0.01 * np.sin(np.arange(400.0))
    for k in range(20, 400, 40):
        x[k - 9 : k] = x[k + 1 : k + 10] = np.nan
    assert find_spikes(x).size == 0


@pytest.mark.parametrize("rise", [1, 2, 3, 10])
def test_steps_and_ramps_are_no_spikes(rise: int) -> None:
    x = np.interp(np.arange(300.0), [100, 100 + rise, 200, 200 + rise], [0.0, 1.0, 1.0, 0.0])
    assert find_spikes(x).size == 0


def test_ringing_is_no_spike() -> None:
    t = 0.04 * np.arange(500)
    for hertz in (3.0, 5.7, 8.0, 11.0):
        rings = np.where(t > 5, np.exp(-(t - 5)) * np.sin(2 * np.pi * hertz * (t - 5)), 0.0)
        assert find_spikes(rings).size == 0


@given(seed=st.integers(0, 10_000), scale=st.sampled_from([1e-3, 0.1, 1.0, 10.0]))
def test_white_noise_on_a_ramp_has_no_spikes(seed: int, scale: float) -> None:
    x = np.linspace(0, 10, 5000) + scale * np.random.default_rng(seed).standard_normal(5000)
    assert find_spikes(x).size == 0


@pytest.mark.parametrize("size", [0, 1, 5, 40])
def test_a_log_that_is_too_short_has_no_spikes(size: int) -> None:
    assert find_spikes(np.where(np.arange(size) == 2, 9.0, 0.0)).size == 0


def test_long_logs_are_searched_across_the_edges_of_blocks() -> None:
    x = np.sin(np.arange(200_000) / 500)
    places = [65535, 65536, 65537, 131071, 131072, 196608]
    for k in places:
        spoilt = x.copy()
        spoilt[k] += 3
        assert find_spikes(spoilt).tolist() == [k]
