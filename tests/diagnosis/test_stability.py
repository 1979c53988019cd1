"""The number of a cause run by run: as refits give it, steady where the cause is, and with a trend where it changes."""

import math
from collections.abc import Sequence
from functools import cache

import msgspec
import numpy as np
import pytest
from planted import driven, logged

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Signal
from winchcascade.diagnosis.causes import COVERED, parameters_of
from winchcascade.diagnosis.diagnosis_result import NamedCause, Stability
from winchcascade.diagnosis.evidence import WHOLE, Fit, RigProblem, fit_set, scale_of
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.solve import Bounds, Jacobian, gauss_newton
from winchcascade.diagnosis.stability import (
    Expansion,
    RunNormal,
    expand,
    run_normals,
    stabilities,
    strengths,
    strengths_alone,
    trends_of,
    with_stability,
)
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.effects.effect import ActiveEffect
from winchcascade.rig.simulate import simulate

COPPER = "copper_heating"

STEADY, RISING = (0.3, 0.3, 0.3, 0.3), (0.15, 0.25, 0.35, 0.45)
"""Change of the stator resistance in the runs of the campaigns: relative, in their order."""

LINEAR = 0.15
"""Share of the standard uncertainty by which the expansion may deviate from a refit, as fields are not quite linear."""

ROBUST = 0.2
"""Share of a change by which it may deviate, as the loss of large residuals is not quadratic."""


def campaign(changes: Sequence[float], seed: int = 0) -> Fitted:
    """Runs at 36, 9, 36 and 9 ohm with so much more stator resistance each, and one in open circuit."""
    by_load = {run.load: run for run in driven()}
    rng, made = np.random.default_rng(seed), []
    for load, change in zip((math.inf, 36.0, 9.0, 36.0, 9.0), (changes[0], *changes), strict=True):
        model = make_effect(COPPER, {"r_s_change": change}).apply(baseline(built_in()))
        made.append(logged(simulate(by_load[load], model).run, rng))
    return Fitted(made, built_in())


@cache
def fitted(changes: tuple[float, ...]) -> tuple[Fitted, Fit]:
    data = campaign(changes)
    return data, fit_set(RigProblem(data, EFFECTS, (COPPER,)))


@cache
def expanded(changes: tuple[float, ...]) -> tuple[list[RunNormal], Expansion]:
    data, fit = fitted(changes)
    normals = run_normals(data, fit)
    return normals, expand(fit, normals, fit.place[COPPER], fit.x)


def stability(changes: tuple[float, ...]) -> Stability:
    data, fit = fitted(changes)
    scale = scale_of(fit)
    parameters = parameters_of(data, EFFECTS, fit, COPPER, scale)
    cause = NamedCause(COPPER, "generator", 1.0, parameters, (), 0.0)
    (found,) = with_stability(data, EFFECTS, fit, scale, [cause])
    assert found.stability is not None
    return found.stability


class EveryRunItsOwn:
    """The fit of nuisances that the runs share and of a stator resistance in every run, as a `Problem`."""

    def __init__(self, data: Fitted, fit: Fit) -> None:
        self.data, self.fit, self.nuisances = data, fit, fit.nu.size
        edge = np.full(fit.nu.size + len(data.logs), math.inf)
        self.bounds = Bounds.of(-edge, edge)

    def residual(self, x: Signal) -> Signal:
        nu, own = x[: self.nuisances], x[self.nuisances :]
        each = [
            self.data.predict(nu, [ActiveEffect(EFFECTS[COPPER], (change,))], [k])
            for k, change in enumerate(own.tolist())
        ]
        return self.data.whiten(self.data.measured - np.concatenate(each))

    def jacobian(self, x: Signal) -> Jacobian:  # noqa: ARG002  # columns at the joint fit serve
        columns = np.zeros((self.fit.z.size, len(self.data.logs)))
        for k, rows in enumerate(self.data.rows):
            own = slice(5 * rows.start, 5 * rows.stop)
            columns[own, k] = self.fit.columns[COPPER][own, 0]
        assert self.fit.j_nu is not None
        return self.fit.j_nu.beside(columns)


@pytest.mark.parametrize("changes", [STEADY, RISING])
def test_strengths_of_the_runs_beside_common_nuisances_are_those_of_a_refit(changes: tuple[float, ...]) -> None:
    data, fit = fitted(changes)
    _, expansion = expanded(changes)
    share, covariance = strengths(expansion)
    problem = EveryRunItsOwn(data, fit)
    start = np.concatenate((fit.nu, np.repeat(fit.x, len(data.logs))))
    refit = gauss_newton(problem, start, problem.jacobian(start), WHOLE)
    own, u = refit.x[fit.nu.size :][expansion.known] / fit.x[0], np.sqrt(np.diag(covariance))
    loaded = u < 1.0
    assert loaded.sum() == 4
    np.testing.assert_array_less(np.abs(share - own)[loaded], (LINEAR * u + ROBUST * np.abs(own - 1.0) + 0.01)[loaded])


@pytest.mark.parametrize("run", [1, 4])
def test_strength_of_one_run_alone_is_that_of_a_refit_to_it(run: int) -> None:
    data, fit = fitted(RISING)
    normals, expansion = expanded(RISING)
    share, variance = strengths_alone(expansion, normals, np.ones(len(data.logs)))
    rows = np.zeros_like(data.measured)
    rows[data.rows[run]] = 1.0
    problem = RigProblem(data, EFFECTS, (COPPER,), rows.ravel())
    others = np.flatnonzero([not (n.kind == "zero" and n.log == run) for n in data.nuisances])
    low, high = problem.bounds.low.copy(), problem.bounds.high.copy()
    low[others], high[others] = fit.nu[others] - 1e-9, fit.nu[others] + 1e-9
    problem.bounds = Bounds.of(low, high)
    refit = fit_set(problem, fit)
    at = int(np.flatnonzero(np.flatnonzero(expansion.known) == run)[0])
    own = refit.x[0] / fit.x[0]
    assert share[at] == pytest.approx(own, abs=LINEAR * math.sqrt(variance[at]) + ROBUST * abs(own - 1.0))


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
    trends, course = trends_of(np.array([1.0, 2.0]), 1e-4 * np.eye(2), {"order": np.array([0.0, 1.0])})
    assert trends == []
    assert course == pytest.approx([1.0, 1.0])


def test_a_withheld_run_gives_no_number() -> None:
    runs = [log.run for log in fitted(STEADY)[0].logs]
    data = Fitted(runs, built_in(), withheld=[2])
    fit = fit_set(RigProblem(data, EFFECTS, (COPPER,)), quick=True)
    cause = NamedCause(COPPER, "generator", 1.0, {}, (), 0.0)
    (found,) = with_stability(data, EFFECTS, fit, 1.0, [cause])
    assert found.stability is not None
    assert [one.withheld for one in found.stability.runs] == [False, False, True, False, False]
    assert msgspec.structs.astuple(found.stability.runs[2])[1:4] == pytest.approx((math.nan,) * 3, nan_ok=True)


def test_a_cause_whose_reported_number_is_absent_has_no_number_in_any_run() -> None:
    """The diodes of this fit have a slope alone, while their threshold, which is reported, is the stated one."""
    data = campaign((0.3, 0.3, 0.3, 0.3))
    fit = fit_set(RigProblem(data, EFFECTS, ("diode_drop",)))
    place = fit.place["diode_drop"]
    x = fit.x.copy()
    x[place.start] = 0.0
    found = stabilities(data, EFFECTS, msgspec.structs.replace(fit, x=x), 1.0)["diode_drop"]
    assert [math.isnan(run.value) for run in found.runs] == [True] * len(data.logs)
    assert found.trends == ()
