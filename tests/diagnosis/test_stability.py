"""The number of a cause run by run: as refits give it, steady where the cause is, and with a
trend where it changes.
"""

import math
from collections.abc import Sequence
from functools import cache

import msgspec
import numpy as np
import pytest
from planted import driven, logged
from rigs import calibrated_rig

from winchcascade.diagnosis.diagnosis_result import Stability
from winchcascade.diagnosis.fit.expansion import marginal_about
from winchcascade.diagnosis.fit.fit_set import fit_set
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.diagnosis.fit.search import Found, search
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.judge.stability import stabilities, strengths, trends_of
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.simulate import simulate

COPPER = "copper_heating"

STEADY, RISING = (0.3, 0.3, 0.3, 0.3), (0.15, 0.25, 0.35, 0.45)
"""Change of the stator resistance in the runs of the campaigns: relative, in their order."""

ROBUST = 0.2
"""Share of a change by which it may deviate, as the loss of large residuals is not quadratic."""


def campaign(changes: Sequence[float], seed: int = 0) -> Fitted:
    """Runs at 36, 9, 36 and 9 ohm with so much more stator resistance each, and one in open
    circuit.
    """
    by_load = {run.load: run for run in driven()}
    rng, made = np.random.default_rng(seed), []
    for load, change in zip((math.inf, 36.0, 9.0, 36.0, 9.0), (changes[0], *changes), strict=True):
        model = make_effect(COPPER, {"r_s_change": change}).apply(baseline(calibrated_rig()))
        made.append(logged(simulate(by_load[load], model).run, rng))
    return Fitted(made, calibrated_rig())


@cache
def searched(changes: tuple[float, ...], name: str = COPPER) -> tuple[Fitted, Found]:
    data = campaign(changes)
    return data, search(RigProblem(data, {name: EFFECTS[name]}))


def stability(changes: tuple[float, ...]) -> Stability:
    return stabilities(*searched(changes))[COPPER]


@pytest.mark.parametrize("changes", [STEADY, RISING])
def test_strengths_of_the_runs_are_the_changes_that_were_planted(
    changes: tuple[float, ...],
) -> None:
    data, found = searched(changes)
    runs, share, covariance = strengths(data, found, COPPER)
    resolved = np.diag(covariance) < 1.0
    assert runs[resolved].tolist() == [1, 2, 3, 4]
    own, u = (
        (share * found.best.x[0])[resolved],
        np.sqrt(np.diag(covariance))[resolved] * found.best.x[0],
    )
    np.testing.assert_array_less(
        np.abs(own - np.array(changes)), 3.0 * u + ROBUST * np.ptp(changes) + 0.01
    )
    alone = fit_set(
        RigProblem(data, {COPPER: EFFECTS[COPPER]}),
        marginal_about(
            RigProblem(data, {COPPER: EFFECTS[COPPER]}), [], np.zeros(len(data.nuisances))
        ),
        (COPPER,),
    )
    assert alone.x == pytest.approx(found.best.x, rel=0.02)


def test_a_steady_cause_has_no_trend_and_its_runs_hold_the_truth() -> None:
    found = stability(STEADY)
    assert found.trends == ()
    numbers = [one for one in found.runs if math.isfinite(one.value)]
    assert [one.run for one in numbers] == [1, 2, 3, 4]
    for one in numbers:
        assert one.low < 0.3 < one.high


def test_an_open_circuit_gives_no_number_of_a_resistance() -> None:
    first = stability(STEADY).runs[0]
    assert math.isnan(first.value)
    assert not first.withheld


def test_a_drift_over_the_runs_is_reported_with_its_size() -> None:
    (trend,) = stability(RISING).trends
    assert trend.along == "order"
    assert trend.change == pytest.approx(0.3, abs=COVERED * trend.u)
    assert trend.chance < 1e-3


def test_numbers_that_disagree_without_a_course_are_a_scatter() -> None:
    x, covariance = np.array([1.0, 1.3, 0.7, 0.7, 1.3, 1.0]), 0.03**2 * np.eye(6)
    (trend,), course = trends_of(x, covariance, {"order": np.linspace(0.0, 1.0, 6)})
    assert trend.along == "scatter"
    assert course == pytest.approx(np.ones(6))


def test_what_the_runs_share_is_no_scatter() -> None:
    x, ruler = np.array([1.0, 1.1, 1.2, 1.3]), np.linspace(0.0, 1.0, 4)
    shared = 0.2**2 * np.outer(ruler, ruler)
    (trend,), _ = trends_of(x, 0.02**2 * np.eye(4), {"load": ruler})
    assert trend.along == "load"
    assert trends_of(x, 0.02**2 * np.eye(4) + shared, {"load": ruler})[0] == []


def test_a_trend_that_order_and_load_explain_alike_names_both() -> None:
    ruler = np.linspace(0.0, 1.0, 6)
    x, covariance = 1.0 + 0.3 * ruler, 0.03**2 * np.eye(6)
    (trend,), _ = trends_of(x, covariance, {"order": ruler, "load": ruler**1.2})
    assert {trend.along, trend.instead} == {"order", "load"}


def test_two_runs_have_no_trend() -> None:
    trends, course = trends_of(
        np.array([1.0, 2.0]), 1e-4 * np.eye(2), {"order": np.array([0.0, 1.0])}
    )
    assert trends == []
    assert course == pytest.approx([1.0, 1.0])


def test_a_withheld_run_gives_no_number() -> None:
    runs = [log.run for log in searched(STEADY)[0].logs]
    data = Fitted(runs, calibrated_rig(), withheld=[2])
    found = stabilities(data, search(RigProblem(data, {COPPER: EFFECTS[COPPER]})))[COPPER]
    assert [one.withheld for one in found.runs] == [False, False, True, False, False]
    assert msgspec.structs.astuple(found.runs[2])[1:4] == pytest.approx(
        (math.nan,) * 3, nan_ok=True
    )
