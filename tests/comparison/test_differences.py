"""Differences of means: closed forms of the parts of their uncertainty, of degrees of freedom
and of pooled repeats.
"""

import math
from collections.abc import Mapping, Sequence

import pytest
from scipy import stats

from winchcascade.comparison.compared_run import ComparedRun, Gain
from winchcascade.comparison.differences import Difference, difference, shared_gains
from winchcascade.core.campaign_file import Origin
from winchcascade.core.cascade import PAPER

ETA = "eta_pto"


def run(
    values: Sequence[float],
    *,
    gains: Mapping[str, float] | None = None,
    rest: float | None = 0.0,
    u: float = 0.01,
) -> ComparedRun:
    """Make a log whose only metric has these values in its cycles.

    Parameters
    ----------
    gains : contribution of each gain
    rest : what zeros contribute; None for an unknown accuracy
    u : relative standard uncertainty of every gain
    """
    contributions = {name: Gain(u, {ETA: c}) for name, c in (gains or {}).items()}
    squares = sum(c**2 for c in (gains or {}).values())
    return ComparedRun(
        name="log.csv", file="log", load=9.0, digest="", rig="rig", origin=Origin(), simulated=False, cascade=PAPER,
        window="auto", cycles_from="velocity", window_length=3.0, speed=0.8, complete=len(values), findings=0,
        mean={ETA: sum(values) / len(values)}, cycles={ETA: tuple(values)}, repeats=len(values) > 1,
        sensors={ETA: None if rest is None else math.sqrt(rest**2 + squares)}, gains=contributions,
        split=frozenset({ETA}), measures={}, unknown=frozenset(), formulas={},
    )  # fmt: skip


def made(
    a: Sequence[ComparedRun], b: Sequence[ComparedRun], shared: Sequence[str] = ()
) -> Difference:
    found = difference(ETA, a, b, shared=frozenset(shared))
    assert found is not None
    return found


def test_scatters_alone_give_the_interval_of_welch() -> None:
    a, b = [0.70, 0.71, 0.705, 0.698], [0.69, 0.66, 0.68]
    found = made([run(a)], [run(b)])
    expected = stats.ttest_ind(b, a, equal_var=False)
    interval = expected.confidence_interval(0.95)
    assert found.freedom == pytest.approx(expected.df)
    assert found.interval == pytest.approx((interval.low, interval.high))
    assert found.interval_repeatability == pytest.approx(found.interval)
    assert found.value == pytest.approx(sum(b) / 3 - sum(a) / 4)


def test_sensors_alone_give_a_normal_interval() -> None:
    found = made(
        [run([0.7], gains={"force": 0.003}, rest=0.004)],
        [run([0.7], gains={"force": 0.003}, rest=0.004)],
    )
    assert found.uncertainty == pytest.approx(math.sqrt(2.0) * 0.005)
    assert found.freedom == math.inf
    assert found.interval == pytest.approx((-1.96 * 0.0070711, 1.96 * 0.0070711), rel=1e-4)
    assert found.repeatability is None
    assert found.interval_repeatability is None


def test_shared_gains_cancel_as_far_as_they_are_the_same_and_zeros_remain() -> None:
    a, b = (
        run([0.7], gains={"force": 0.0030}, rest=0.004),
        run([0.6], gains={"force": 0.0026}, rest=0.003),
    )
    found = made([a], [b], shared=["force"])
    assert found.sensors == pytest.approx(math.hypot(0.0004, 0.005))
    assert made([a], [b]).sensors == pytest.approx(math.sqrt(0.003**2 + 0.0026**2 + 0.005**2))


def test_errors_of_sensors_add_degrees_of_freedom() -> None:
    values = [0.70, 0.71, 0.69]
    plain, with_sensors = (
        made([run(values)], [run(values)]),
        made([run(values, rest=0.005)], [run(values)]),
    )
    assert plain.freedom == pytest.approx(4.0)
    u = plain.uncertainty or 0.0
    assert with_sensors.freedom == pytest.approx(4.0 * (math.hypot(u, 0.005) / u) ** 4)


def test_an_unknown_accuracy_leaves_the_repeatability_alone() -> None:
    found = made([run([0.7, 0.71], rest=None)], [run([0.7, 0.72])])
    assert (
        found.sensors,
        found.uncertainty,
        found.interval,
        found.freedom,
        found.excludes_zero,
    ) == (None,) * 5
    assert found.interval_repeatability is not None


def test_repeats_without_a_scatter_of_their_own_count_as_one_log() -> None:
    alike = [run([0.70, 0.71, 0.72]), run([0.72, 0.71, 0.70])]
    found = made(alike, [run([0.7])])
    assert found.cycles[0] == 6
    assert found.repeatability == pytest.approx(0.01 / math.sqrt(6.0))
    assert found.freedom == pytest.approx(4.0)


def test_repeats_whose_means_differ_have_few_degrees_of_freedom() -> None:
    found = made([run([0.700, 0.701]), run([0.750, 0.751])], [run([0.7])])
    assert found.repeatability == pytest.approx(
        0.025, rel=0.01
    )  # half of the difference of the two means
    assert found.freedom == pytest.approx(1.0, rel=0.01)


def test_zeros_of_the_logs_explain_a_scatter_of_repeats() -> None:
    found = made([run([0.700, 0.701], rest=0.04), run([0.750, 0.751], rest=0.04)], [run([0.7])])
    assert found.repeatability == pytest.approx(0.0005 / math.sqrt(2.0), rel=0.01)
    assert found.sensors == pytest.approx(0.04 / math.sqrt(2.0))


def test_gains_of_repeats_do_not_average_out() -> None:
    found = made(
        [run([0.7], gains={"force": 0.003}), run([0.7], gains={"force": 0.003})], [run([0.7])]
    )
    assert found.sensors == pytest.approx(0.003)


def test_repeats_are_weighted_with_their_cycles() -> None:
    assert made([run([0.7, 0.7, 0.7]), run([0.6])], [run([0.7])]).a == pytest.approx(0.675)


def test_a_gain_that_two_rig_files_state_differently_is_not_shared() -> None:
    a, b = (
        run([0.7], gains={"force": 0.003, "vdc": 0.001}, u=0.01),
        run([0.7], gains={"force": 0.003}, u=0.02),
    )
    assert shared_gains([a], [b]) == (frozenset({"vdc"}), ("force",))


@pytest.mark.parametrize(("values", "expected"), [([0.7, 0.71], False), ([0.5, 0.51], True)])
def test_the_interval_decides_whether_zero_is_excluded(values: list[float], expected: bool) -> None:
    assert made([run([0.7, 0.71])], [run(values)]).excludes_zero is expected
