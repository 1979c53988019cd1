"""What bridging may hide is bounded from the data beside a gap, and never far above what smooth
signals can hide.
"""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Run
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.energies import gap_faults
from winchcascade.reduction.gap_error import bridging_error, energy_error, gaps_of, instant_error

Signal = NDArray[np.float64]

T: Signal = np.arange(1000, dtype=np.float64) / 25.0

RULES = built_in().thresholds
WIDTH = RULES.smoothing

ROUNDING = 1e-9
"""Sums of a thousand numbers of order one."""

AMPLE = 4.0
"""A smooth curve's bound may exceed what the line misses by so much: a kink at the worst place
hides 1.5 times as much.
"""


def run(v: Signal, **gaps: list[tuple[float, float]]) -> Run:
    return Run(
        "log", T, {"velocity": v}, 25.0, T.size, {name: np.array(g) for name, g in gaps.items()}
    )


def missed(x: Signal, gap: tuple[float, float]) -> float:
    a, b = np.searchsorted(T, np.array(gap) - 0.01)
    return abs(
        float(np.trapezoid(x[a : b + 1], T[a : b + 1]) - 0.5 * (x[a] + x[b]) * (T[b] - T[a]))
    )


@given(curve=st.floats(-50, 50), samples=st.integers(5, 25), start=st.integers(100, 800))
def test_a_line_hides_nothing_and_a_parabola_what_its_curvature_says(
    curve: float, samples: int, start: int
) -> None:
    gap = (T[start], T[start + samples])
    assert bridging_error(T, curve * T - 2.0, np.array([gap]), WIDTH) == pytest.approx(
        [0.0], abs=ROUNDING * 1e2
    )
    found = bridging_error(T, curve * (T - 20) ** 2, np.array([gap]), WIDTH)[0]
    hidden = missed(curve * (T - 20) ** 2, gap)
    assert hidden - ROUNDING * 1e3 <= found <= AMPLE * hidden + ROUNDING * 1e3


@pytest.mark.parametrize("at", [10.1, 10.2, 10.3, 10.4])
@pytest.mark.parametrize(
    "shape", [lambda at: np.maximum(T - at, 0.0), lambda at: np.where(at < T, 1.0, 0.0)]
)
def test_a_kink_or_a_jump_inside_a_gap_is_bounded(
    shape: Callable[[float], Signal], at: float
) -> None:
    assert bridging_error(T, shape(at), np.array([[10.0, 10.48]]), WIDTH)[0] >= missed(
        shape(at), (10.0, 10.48)
    ) * (1 - 0.01)


def test_gaps_of_a_stage_are_those_of_its_channels_and_of_the_clock_in_order() -> None:
    gaps = {"velocity": [(9.0, 9.2)], "force": [(2.0, 2.4)], CLOCK: [(5.0, 5.4)]}
    assert gaps_of(run(T, **gaps), ("force",)) == pytest.approx(np.array([[2.0, 2.4], [5.0, 5.4]]))
    assert gaps_of(run(T), ("velocity",)).shape == (0, 2)


def test_a_gap_counts_in_the_window_that_ends_where_it_begins_and_in_both_cycles_that_it_crosses() -> (
    None
):
    watts, moved = np.sin(T), np.zeros(3)
    gaps = gaps_of(run(T, velocity=[(5.0, 9.0)]), ("velocity",))
    spans = np.array([[1.0, 4.9], [4.95, 5.0], [12.0, 15.0]])
    assert (energy_error(T, watts, gaps, spans, moved, WIDTH) > 0.0).tolist() == [
        False,
        True,
        False,
    ]
    gaps, cycles = (
        np.array([[4.8, 5.2], [6.0, 6.4], [13.0, 14.0]]),
        np.array([[1.0, 5.0], [5.0, 12.0], [14.0, 15.0]]),
    )
    one = bridging_error(T, watts, gaps, WIDTH)
    found = energy_error(T, watts, gaps, cycles, moved, WIDTH)
    assert found == pytest.approx([one[0], np.hypot(one[0], one[1]), 0.0], abs=ROUNDING)


def onset_of(v: Signal) -> tuple[Signal, float]:
    smooth = local_quadratic(T, v, 0.6)
    k = int(np.flatnonzero(smooth > 0.03)[0])
    return smooth, float(np.interp(0.03, smooth[k - 1 : k + 1], T[k - 1 : k + 1]))


@pytest.mark.parametrize("samples", [2, 6, 12])
def test_a_gap_of_the_velocity_moves_an_onset_by_no_more_than_it_says_and_not_by_far_less(
    samples: int,
) -> None:
    u = np.clip((T - 10.0) / 4.0, 0.0, 1.0)
    v = 0.86 * u**2 * (3 - 2 * u)
    onset, most_moved, most_said = np.interp(0.03, v[250:350], T[250:350]), 0.0, 0.0
    for first in range(252, 275):
        bridged, inside = v.copy(), slice(first + 1, first + samples)
        bridged[inside] = np.interp(
            T[inside], T[[first, first + samples]], v[[first, first + samples]]
        )
        smooth, found = onset_of(bridged)
        moved, gaps = abs(found - onset_of(v)[1]), [(T[first], T[first + samples])]
        said = instant_error(run(bridged, velocity=gaps), smooth, np.array([onset, 30.0]), RULES)
        assert moved <= said[0] + 0.004  # a tenth of a sample: half a thousandth of an energy
        assert said[1] == 0.0  # far from the gap
        most_moved, most_said = max(most_moved, moved), max(most_said, said[0])
    assert most_said < 10.0 * most_moved


def test_gaps_and_a_moved_cutoff_err_independently_and_make_a_fault_where_they_matter() -> None:
    watts = 500.0 + 200.0 * np.sin(T)
    spans, gaps = np.array([[1.0, 9.0], [10.0, 12.0]]), np.array([[2.0, 2.6], [5.0, 5.8]])
    changed = energy_error(T, watts, gaps, spans, np.array([0.1, 0.0]), WIDTH)
    alone = np.append(bridging_error(T, watts, gaps, WIDTH), 0.1 * np.interp(9.0, T, watts))
    assert changed == pytest.approx([np.sqrt(np.sum(alone**2)), 0.0])
    longest, share = np.full(2, RULES.gap_max), np.array([0.067, 0.001])
    faults = gap_faults("line", "its window", gaps, spans, longest, share, RULES.gap_energy_max)
    assert list(faults) == [0]
