"""Nuisances integrated out and the search over sets, held against the exact numbers of a linear
problem.
"""

import math
from collections.abc import Sequence
from functools import cache

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.stats import multivariate_normal, truncnorm

from winchcascade.core.run import Signal
from winchcascade.diagnosis.fit.covariance import covariance_of
from winchcascade.diagnosis.fit.evidence import Fit, minimum_within
from winchcascade.diagnosis.fit.expansion import expand, marginal_about
from winchcascade.diagnosis.fit.fit_set import fit_set, located
from winchcascade.diagnosis.fit.marginal import Columns, Marginal, Together, huber
from winchcascade.diagnosis.fit.search import Found, search
from winchcascade.diagnosis.fit.suspects import Suspects, freedom
from winchcascade.diagnosis.judge.causes import Posterior, parameters_of, posterior_of
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import ActiveEffect

NAMES = ("line_drag", "line_friction", "torque_gain", "voltage_gain", "diode_drop")
ROWS, DENSE, LOCAL = 120, 4, 6


class Linear:
    """Effects that move 120 numbers of unit noise in proportion to their fields, beside ten
    nuisances.
    """

    def __init__(self, planted: dict[str, float], seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.suspects: Suspects = {name: EFFECTS[name] for name in NAMES}
        self.free = freedom(*self.suspects.values())
        self.ways = rng.normal(size=(ROWS, self.free.absent.size)) / self.free.sd
        local = np.where(rng.random((ROWS, LOCAL)) < 0.2, rng.normal(size=(ROWS, LOCAL)), 0.0)
        self.moves = Columns(0.5 * rng.normal(size=(ROWS, DENSE)), csr_array(local))
        self.truth = np.zeros(self.free.absent.size)
        for name, share in planted.items():
            k = self.first(name)
            self.truth[k] = share * self.free.sd[k]
        self.measured = self.ways @ self.truth + 0.7 * rng.normal(size=ROWS)
        self.groups: NDArray[np.intp] = np.zeros(ROWS, dtype=np.intp)

    def first(self, name: str) -> int:
        """Place of the first field of a suspect."""
        return sum(len(self.suspects[other].fields) for other in NAMES[: NAMES.index(name)])

    @property
    def exclusive(self) -> tuple[Together, ...]:
        return ()

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        return {}

    def price(self, name: str) -> float:
        return 2.0 + 0.1 * NAMES.index(name)

    @property
    def nuisances(self) -> int:
        return DENSE + LOCAL

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        nu: Signal,
        _near: object = None,
        _serves: float = 0.0,
    ) -> Signal:
        x = np.zeros((self.truth.size, len(several)))
        for column, effects in enumerate(several):
            for one in effects:
                k = self.first(one.effect.name)
                x[k : k + len(one.values), column] = one.values
        return (self.measured - self.moves @ nu)[:, None] - self.ways @ x

    def nuisance_columns(self, effects: Sequence[ActiveEffect], nu: Signal) -> Columns:
        assert len(effects) <= len(NAMES)
        assert nu.size == DENSE + LOCAL
        return self.moves

    @property
    def covariance(self) -> Signal:
        """Covariance of the measured numbers without any suspect."""
        j = np.hstack([self.moves.dense, self.moves.local.toarray()])
        return np.asarray(np.eye(ROWS) + j @ j.T)

    def evidence(self, *names: str) -> float:
        """Logarithm of the probability density of the measured numbers with some suspects,
        prices paid.
        """
        covariance = self.covariance
        for name in names:
            own = slice(self.first(name), self.first(name) + len(self.suspects[name].fields))
            way = self.ways[:, own] * self.free.sd[own]
            covariance = covariance + way @ way.T
        density = float(multivariate_normal(np.zeros(ROWS), covariance).logpdf(self.measured))
        return density - sum(map(self.price, names))


@cache
def found() -> tuple[Linear, Found]:
    problem = Linear({"line_drag": 0.8, "torque_gain": -0.7})
    return problem, search(problem)


def test_nuisances_integrated_out_leave_the_inverse_of_the_covariance() -> None:
    problem = Linear({})
    marginal, z = (
        Marginal(np.zeros(DENSE + LOCAL), problem.moves),
        np.random.default_rng(1).normal(size=(ROWS, 3)),
    )
    r = marginal(z)
    np.testing.assert_allclose(r.T @ r, z.T @ np.linalg.solve(problem.covariance, z), rtol=1e-9)
    np.testing.assert_allclose(marginal.undone(r), z, rtol=1e-9, atol=1e-12)
    rows = (np.arange(ROWS) % 3 > 0).astype(np.float64)
    of_some = marginal.masked(rows)(rows * z[:, 0])
    own = problem.covariance[np.ix_(rows > 0, rows > 0)]
    assert of_some @ of_some == pytest.approx(z[rows > 0, 0] @ np.linalg.solve(own, z[rows > 0, 0]))


def test_the_place_about_which_nuisances_are_linear_changes_no_fit_of_a_linear_problem() -> None:
    problem, names = Linear({"line_drag": 0.8}), ("line_drag",)
    fits = [
        fit_set(problem, marginal_about(problem, [], place * np.ones(DENSE + LOCAL)), names)
        for place in (0.0, 1.5)
    ]
    np.testing.assert_allclose(fits[0].r, fits[1].r, atol=1e-9)
    np.testing.assert_allclose(fits[0].nu, fits[1].nu, atol=1e-9)


def test_the_best_nuisances_are_those_of_least_squares_with_their_prior() -> None:
    problem = Linear({})
    marginal, z = (
        Marginal(np.zeros(DENSE + LOCAL), problem.moves),
        np.random.default_rng(2).normal(size=ROWS),
    )
    j = np.hstack([problem.moves.dense, problem.moves.local.toarray()])
    exact = np.linalg.solve(np.eye(j.shape[1]) + j.T @ j, j.T @ z)
    nu, left = marginal.best(z)
    np.testing.assert_allclose(nu, exact, atol=0.02)
    np.testing.assert_allclose(left, z - j @ nu, atol=1e-12)
    assert huber(left) + 0.5 * nu @ nu <= huber(z)
    np.testing.assert_allclose(marginal.best(z, nu + 1.0)[0], exact, atol=0.02)
    np.testing.assert_allclose(
        marginal.spread, np.linalg.inv(np.eye(j.shape[1]) + j.T @ j), atol=1e-12
    )


@pytest.mark.parametrize(
    "names", [("line_drag",), ("line_drag", "torque_gain"), ("diode_drop", "line_drag")]
)
def test_evidence_is_the_density_of_the_measured_numbers(names: tuple[str, ...]) -> None:
    problem, outcome = found()
    evidence, marginal = outcome.evidence, outcome.marginal
    unit = msgspec.structs.replace(evidence, scale=1.0)
    fits = [fit_set(problem, marginal, one) for one in (names, ())]
    inside = all(np.abs(fit.r).max() < 3.0 for fit in fits)
    gained = unit.of(fits[0]) - unit.of(fits[1])
    exact = problem.evidence(*names) - problem.evidence()
    assert gained == pytest.approx(exact, abs=0.01 if inside else 0.1 * abs(exact) + 3.0)


def test_the_closed_form_is_the_evidence_of_a_refit_where_the_problem_is_linear() -> None:
    problem, outcome = found()
    for names in [
        (),
        ("line_drag",),
        ("torque_gain", "voltage_gain"),
        ("line_drag", "line_friction", "torque_gain"),
    ]:
        refit, ordered = fit_set(problem, outcome.marginal, names), tuple(sorted(names))
        if np.abs(refit.r).max() < 3.0:
            rated = outcome.expansion.rated([ordered, outcome.best.names])
            lost = rated[ordered] - rated[outcome.best.names]
            assert lost == pytest.approx(
                outcome.evidence.of(refit) - outcome.evidence.of(outcome.best), abs=0.05
            )


def test_what_was_planted_is_found_and_nothing_where_nothing_was() -> None:
    problem, outcome = found()
    assert outcome.best.names == ("line_drag", "torque_gain")
    u = np.sqrt(np.diag(posterior_of(outcome, outcome.best).covariance))
    assert np.all(
        np.abs(outcome.best.x - problem.truth[[0, problem.first("torque_gain")]]) < 3.0 * u
    )
    assert search(Linear({}, seed=3)).best.names == ()


def test_the_covariance_of_the_fields_is_that_of_their_posterior() -> None:
    problem, outcome = found()
    own = [problem.first(name) for name in outcome.best.names]
    way, sd = problem.ways[:, own], problem.free.sd[own]
    exact = np.linalg.inv(way.T @ np.linalg.solve(problem.covariance, way) + np.diag(sd**-2.0))
    columns = outcome.expansion.columns[:, outcome.expansion.index(outcome.best.names)]
    unit = msgspec.structs.replace(outcome, best=outcome.best)
    np.testing.assert_allclose(
        covariance_of(unit, outcome.best, columns), exact * outcome.scale, rtol=0.15
    )


def test_residuals_of_one_group_count_together() -> None:
    problem, outcome = found()
    columns = outcome.expansion.columns[:, outcome.expansion.index(outcome.best.names)]
    alone = np.diag(covariance_of(outcome, outcome.best, columns))
    grouped = Linear({"line_drag": 0.8, "torque_gain": -0.7})
    grouped.groups = np.arange(ROWS) // 6
    repeated = msgspec.structs.replace(outcome.best, r=np.repeat(outcome.best.r[::6], 6))
    evidence = msgspec.structs.replace(outcome.evidence, problem=grouped)
    together = msgspec.structs.replace(
        outcome, expansion=msgspec.structs.replace(outcome.expansion, evidence=evidence)
    )
    same = np.repeat(columns[::6], 6, axis=0)
    assert np.all(
        np.diag(covariance_of(together, repeated, same))
        > 1.5 * np.diag(covariance_of(outcome, repeated, same))
    )
    assert np.all(alone > 0.0)
    assert problem.groups.max() == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_minimum_within_bounds_is_no_higher_than_any_place_near_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(5, 4))
    curve, slope, low, high = (
        root.T @ root + 0.1 * np.eye(4),
        rng.normal(size=4),
        -0.2 * np.ones(4),
        0.3 * np.ones(4),
    )

    def objective(x: Signal) -> float:
        return float(0.5 * x @ curve @ x - slope @ x)

    best = minimum_within(curve, slope, low, high)
    assert np.all((best >= low) & (best <= high))
    tried = np.clip(best + 0.05 * rng.normal(size=(400, 4)), low, high)
    assert objective(best) <= min(map(objective, tried)) + 1e-12


@pytest.mark.parametrize("push", [0.0, 0.5, 4.0, 300.0])
def test_the_interval_at_a_limit_holds_95_percent_of_a_normal_that_is_cut_off(push: float) -> None:
    effect, one = EFFECTS["gear_mesh_loss"], np.array([[4e4]])
    free = freedom(effect)
    fit = Fit(
        ("a",),
        {"a": slice(0, 1)},
        free.minimum,
        0.0,
        one[0],
        one,
        one[0],
        free,
        one[0],
        one[0],
        one[0],
    )
    slope = np.array([-push * math.sqrt(one[0, 0])])
    number = parameters_of(Posterior(fit, np.zeros((1, 1)), one, slope), effect, "a")[
        effect.parameter
    ]
    expected = (
        -math.log(0.05) / 300.0
        if push == 300.0
        else float(truncnorm(push, math.inf).isf(0.05)) - push
    )
    law = 1.645 / 1.96 * 0.01 * abs(number.value)
    assert number.at_limit == "low"
    assert number.high - number.value == pytest.approx(math.hypot(0.005 * expected, law), rel=1e-3)


def test_an_expansion_knows_exactly_what_is_left_without_a_cause() -> None:
    problem, outcome = found()
    fit, expansion = expand(problem, outcome.marginal, ("line_drag",), {}, 1.0)
    without = located(problem, outcome.marginal, (), np.zeros(0))
    step = np.zeros(expansion.slope.size)
    step[-1] = 1.0
    foreseen = 0.5 * step @ expansion.curve @ step - expansion.slope @ step
    assert foreseen == pytest.approx(0.5 * without.r @ without.r - 0.5 * fit.r @ fit.r, rel=0.05)
