"""What bridging may hide is bounded from the data beside a gap, and never far above what smooth signals can hide."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Run
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.energies import gap_faults
from winchcascade.reduction.gap_error import (
    _weight,
    bridging_error,
    energy_error,
    gaps_of,
    instant_error,
    overlapped_windows,
)

Signal = NDArray[np.float64]

T: Signal = np.arange(1000, dtype=np.float64) / 25.0

ROUNDING = 1e-9
"""Sums of a thousand numbers of order one."""

AMPLE = 4.0
"""A smooth curve's bound may exceed what the line misses by so much: a kink at the worst place hides 1.5 times as much."""


def run(v: Signal, **gaps: list[tuple[float, float]]) -> Run:
    return Run("log", T, {"velocity": v}, 25.0, T.size, {name: np.array(g) for name, g in gaps.items()})


def missed(x: Signal, gap: tuple[float, float]) -> float:
    a, b = np.searchsorted(T, np.array(gap) - 0.01)
    return abs(float(np.trapezoid(x[a : b + 1], T[a : b + 1]) - 0.5 * (x[a] + x[b]) * (T[b] - T[a])))


@pytest.mark.parametrize("samples", [2, 5, 12, 25])
def test_a_straight_line_hides_nothing(samples: int) -> None:
    gap = np.array([[10.0, 10.0 + 0.04 * samples]])
    assert bridging_error(T, 3.0 * T - 2.0, gap) == pytest.approx([0.0], abs=ROUNDING)


@given(curve=st.floats(-50, 50), samples=st.integers(5, 25), start=st.integers(100, 800))
def test_a_parabola_hides_what_its_curvature_says(curve: float, samples: int, start: int) -> None:
    gap = (T[start], T[start + samples])
    found = bridging_error(T, curve * (T - 20) ** 2, np.array([gap]))[0]
    hidden = missed(curve * (T - 20) ** 2, gap)
    assert hidden - ROUNDING * 1e3 <= found <= AMPLE * hidden + ROUNDING * 1e3


@pytest.mark.parametrize("at", [10.1, 10.2, 10.3, 10.4])
def test_a_kink_inside_a_gap_is_bounded(at: float) -> None:
    x = np.maximum(T - at, 0.0)
    assert bridging_error(T, x, np.array([[10.0, 10.48]]))[0] >= missed(x, (10.0, 10.48)) * (1 - 0.01)


@pytest.mark.parametrize("at", [10.1, 10.2, 10.3, 10.4])
def test_a_jump_inside_a_gap_is_bounded(at: float) -> None:
    x = np.where(at < T, 1.0, 0.0)
    assert bridging_error(T, x, np.array([[10.0, 10.48]]))[0] >= missed(x, (10.0, 10.48))


@pytest.mark.parametrize("gap", [(0.0, 0.4), (39.5, 39.96)])
def test_a_gap_at_an_end_of_the_log_is_judged_by_its_one_side(gap: tuple[float, float]) -> None:
    assert np.isfinite(bridging_error(T, np.sin(T), np.array([gap]))).all()


def test_gaps_of_a_stage_are_those_of_its_channels_and_of_the_clock_in_order() -> None:
    found = gaps_of(
        run(T, velocity=[(9.0, 9.2)], force=[(2.0, 2.4)], vdc=[(1.0, 1.2)], **{CLOCK: [(5.0, 5.4)]}), ("force",)
    )
    assert found == pytest.approx(np.array([[2.0, 2.4], [5.0, 5.4]]))


def test_a_log_without_gaps_has_none() -> None:
    assert gaps_of(run(T), ("velocity",)).shape == (0, 2)
    assert instant_error(run(T), T, np.array([1.0])).tolist() == [0.0]


def test_a_window_that_ends_where_a_gap_begins_touches_it() -> None:
    gaps = gaps_of(run(T, velocity=[(5.0, 9.0)]), ("velocity",))
    windows = np.array([[1.0, 4.9], [4.95, 5.0], [12.0, 15.0]])
    assert [which.tolist() for which in overlapped_windows(gaps, windows)] == [[1], [-1]]
    assert [which.tolist() for which in overlapped_windows(gaps, windows[[0, 2]])] == [[-1], [-1]]


def test_a_gap_across_the_border_of_two_cycles_touches_both() -> None:
    gaps = np.array([[4.8, 5.2], [6.0, 6.4], [13.0, 14.0]])
    cycles = np.array([[1.0, 5.0], [5.0, 12.0]])
    assert [which.tolist() for which in overlapped_windows(gaps, cycles)] == [[0, 1, -1], [1, -1, -1]]


@pytest.mark.parametrize("samples", [2, 6, 12])
def test_a_gap_of_the_velocity_moves_an_onset_by_no_more_than_it_says_and_not_by_far_less(samples: int) -> None:
    u = np.clip((T - 10.0) / 4.0, 0.0, 1.0)
    v = 0.86 * u**2 * (3 - 2 * u)
    onset = np.interp(0.03, v[250:350], T[250:350])
    most_moved = most_said = 0.0
    for first in range(252, 275):
        bridged = v.copy()
        inside = slice(first + 1, first + samples)
        bridged[inside] = np.interp(T[inside], T[[first, first + samples]], v[[first, first + samples]])
        smooth = local_quadratic(T, bridged, 0.6)
        k = int(np.flatnonzero(smooth > 0.03)[0])
        moved = abs(np.interp(0.03, smooth[k - 1 : k + 1], T[k - 1 : k + 1]) - _onset(v))
        said = instant_error(run(bridged, velocity=[(T[first], T[first + samples])]), smooth, np.array([onset]))[0]
        assert moved <= said + 0.004  # a tenth of a sample: half a thousandth of an energy
        most_moved, most_said = max(most_moved, moved), max(most_said, said)
    assert most_said < 10.0 * most_moved


def _onset(v: Signal) -> float:
    smooth = local_quadratic(T, v, 0.6)
    k = int(np.flatnonzero(smooth > 0.03)[0])
    return float(np.interp(0.03, smooth[k - 1 : k + 1], T[k - 1 : k + 1]))


def test_a_gap_far_from_an_instant_does_not_move_it() -> None:
    v = np.sin(T)
    assert instant_error(run(v, velocity=[(20.0, 20.4)]), v, np.array([10.0])).tolist() == [0.0]


@pytest.mark.parametrize(("by", "message"), [(0.2, "bridging its gaps could change E_line by 6.7%"), (0.01, None)])
def test_a_cutoff_that_a_gap_moves_is_worth_the_power_there(by: float, message: str | None) -> None:
    spans, gaps = np.array([[1.0, 4.0], [5.0, 8.0]]), np.array([[20.0, 20.2]])
    changed = energy_error(T, np.full(T.size, 500.0), gaps, spans, np.array([by, 0.0]))
    faults = gap_faults("line", "its window", gaps, spans, changed / 1500.0, built_in().thresholds)
    assert changed == pytest.approx([by * 500.0, 0.0])
    assert faults == ({} if message is None else {0: message})


def test_gaps_and_a_moved_cutoff_err_independently() -> None:
    watts = 500.0 + 200.0 * np.sin(T)
    spans, gaps = np.array([[1.0, 9.0]]), np.array([[2.0, 2.6], [5.0, 5.8]])
    both = energy_error(T, watts, gaps, spans, np.array([0.1]))
    alone = np.append(bridging_error(T, watts, gaps), 0.1 * np.interp(9.0, T, watts))
    assert both == pytest.approx([np.sqrt(np.sum(alone**2))])


def test_a_jump_in_the_middle_of_the_smoothing_weighs_most() -> None:
    assert [_weight(u) for u in (0.0, 1.0)] == pytest.approx([2.25, 1.5])
    assert _weight(np.sqrt(0.6)) == pytest.approx(0.0, abs=1e-12)
