"""The steps of a fit: robust loss, nuisances done away with, a box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from winchcascade.diagnosis.evidence import WHOLE
from winchcascade.diagnosis.solve import (
    HUBER,
    Bounds,
    Jacobian,
    Local,
    best_step,
    box_minimum,
    gauss_newton,
    huber,
    minimum_within,
    weights,
)

AS_LOW = 1e-6
"""The objective in a box is as low as scipy's, to this share of what the box allows to gain."""


def objective(a: np.ndarray, b: np.ndarray, x: np.ndarray) -> float:
    return 0.5 * float(np.sum((a @ x - b) ** 2))


def problem(seed: int, spread: float) -> tuple[np.ndarray, ...]:
    """Random least squares in a box, singular values down to 10^-spread of the largest."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 9))
    left, _ = np.linalg.qr(rng.normal(size=(k + 5, k)))
    right, _ = np.linalg.qr(rng.normal(size=(k, k)))
    a = left * np.logspace(0.0, -spread, k) @ right
    low = -rng.uniform(0.0, 2.0, k) * (rng.random(k) > 0.2)
    return a, rng.normal(size=k + 5), low, low + rng.uniform(0.1, 3.0, k)


@pytest.mark.parametrize("spread", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(40))
def test_the_least_in_a_box_is_that_of_scipy(seed: int, spread: float) -> None:
    a, b, low, high = problem(seed, spread)
    x = box_minimum(a.T @ a, a.T @ b, low, high)
    best = lsq_linear(a, b, bounds=(low, high), tol=1e-12).x
    assert np.all((x >= low - 1e-9) & (x <= high + 1e-9))
    gain = objective(a, b, np.zeros_like(x)) - objective(a, b, best)
    assert objective(a, b, x) - objective(a, b, best) <= AS_LOW * max(gain, 1e-3)
    if spread < 3.0:
        assert x == pytest.approx(best, abs=1e-4)


def test_two_columns_that_say_the_same_share_the_box() -> None:
    a = np.array([[1.0, 1.0], [1.0, 1.0], [0.0, 1e-9]])
    x = box_minimum(a.T @ a, a.T @ np.array([3.0, 3.0, 0.0]), np.zeros(2), np.full(2, 2.0))
    assert a[0] @ x == pytest.approx(3.0, rel=1e-3)


def test_a_minimum_beyond_the_box_lies_in_its_corner() -> None:
    low, high = np.array([-1.0, -1.0]), np.array([1.0, 2.0])
    assert box_minimum(np.eye(2), np.array([5.0, -7.0]), low, high) == pytest.approx([1.0, -1.0])
    assert box_minimum(np.eye(2), np.array([0.5, 1.5]), low, high) == pytest.approx([0.5, 1.5])


@given(st.floats(-50.0, 50.0))
def test_weights_are_the_slope_of_the_robust_loss(z: float) -> None:
    step = 1e-5
    slope = (huber(np.array([z + step])) - huber(np.array([z - step]))) / (2.0 * step)
    assert slope == pytest.approx(float(weights(np.array([z]))[0]) * z, abs=1e-4)


def test_a_large_residual_counts_by_its_magnitude() -> None:
    assert huber(np.array([2.0, -2.0])) == pytest.approx(4.0)
    assert huber(np.array([HUBER + 10.0])) == pytest.approx(0.5 * HUBER**2 + 10.0 * HUBER)
    assert weights(np.array([1.0, -2.0 * HUBER])) == pytest.approx([1.0, 0.5])


def test_nuisances_done_away_with_give_the_same_step_as_all_together() -> None:
    rng = np.random.default_rng(2)
    j_nu, j_phi, z, nu = rng.normal(size=(60, 4)), rng.normal(size=(60, 3)), rng.normal(size=60), rng.normal(size=4)
    w, both, wide = weights(3.0 * z), np.hstack([j_nu, j_phi]), np.full(7, 1e9)
    step = best_step(3.0 * z, Jacobian.of(both), np.r_[nu, np.zeros(3)], Bounds.of(-wide, wide), 4)
    prior = np.diag([1.0] * 4 + [0.0] * 3)
    pull = (both * w[:, None]).T @ (3.0 * z) - prior @ np.r_[nu, np.zeros(3)]
    assert step == pytest.approx(np.linalg.solve((both * w[:, None]).T @ both + prior, pull), rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_step_is_the_minimum_within_the_bounds_of_fields_and_nuisances(seed: int) -> None:
    a, b, low, high = problem(seed, 1.0)
    rng = np.random.default_rng(seed)
    j_nu, nu, w, reach = rng.normal(size=(b.size, 3)), np.clip(rng.normal(size=3), -1.5, 1.5), weights(b), 1.5
    edge, x = np.full(3, reach), np.r_[nu, np.zeros(low.size)]
    step = best_step(b, Jacobian.of(np.hstack((j_nu, a))), x, Bounds.of(np.r_[-edge, low], np.r_[edge, high]), 3)
    root = np.sqrt(w)[:, None]
    whole = np.vstack((np.hstack((root * a, root * j_nu)), np.hstack((np.zeros((3, low.size)), np.eye(3)))))
    rhs = np.concatenate((root[:, 0] * b, -nu))
    bounds = (np.concatenate((low, -reach - nu)), np.concatenate((high, reach - nu)))
    best = lsq_linear(whole, rhs, bounds=bounds, tol=1e-12).x
    assert np.concatenate((step[3:], step[:3])) == pytest.approx(best, abs=1e-4)


@pytest.mark.parametrize("seed", range(30))
def test_beyond_the_inner_bounds_the_objective_rises(seed: int) -> None:
    a, b, low, high = problem(seed, 1.0)
    rng = np.random.default_rng(seed)
    rate = rng.uniform(0.0, 2.0, low.size)
    bounds = Bounds(low - 2.0, high + 2.0, low, high, rate)
    x = minimum_within(a.T @ a, a.T @ b, bounds)

    def rises(x: np.ndarray) -> float:
        return objective(a, b, x) + bounds.penalty(x)

    k = low.size  # the same problem with the parts beyond the bounds as numbers of their own
    whole, costs = np.hstack([a, a, -a]), np.r_[np.zeros(k), rate, rate]
    ends = (np.r_[low, np.zeros(2 * k)], np.r_[high, np.full(2 * k, 2.0)])
    split = box_minimum(whole.T @ whole, whole.T @ b - costs, *ends)
    assert np.all((x >= bounds.low - 1e-9) & (x <= bounds.high + 1e-9))
    assert rises(x) <= rises(split[:k] + split[k : 2 * k] - split[2 * k :]) + 1e-5
    for _ in range(50):
        near = np.clip(x + 0.05 * rng.normal(size=k), bounds.low, bounds.high)
        assert rises(x) <= rises(near) + 1e-9


def test_columns_of_few_rows_are_those_of_all_with_zeros() -> None:
    rng = np.random.default_rng(4)
    dense, first, second = rng.normal(size=(12, 2)), rng.normal(size=(5, 2)), rng.normal(size=(7, 3))
    rows = np.split(rng.permutation(12), [5])
    parts = [
        Local(rows[0], first, np.array([2, 3, 4]), np.array([0, 1, 1])),
        Local(rows[1], second, np.array([2, 5, 6]), np.array([0, 1, 2])),
    ]
    j = Jacobian(8, dense, np.array([0, 7]), parts)
    whole = np.zeros((12, 8))
    whole[:, [0, 7]] = dense
    whole[rows[0], 2:5] = first[:, [0, 1, 1]]
    whole[np.ix_(rows[1], np.array([2, 5, 6]))] = second
    w, z, step = rng.random(12), rng.normal(size=12), rng.normal(size=(8, 2))
    assert j.normal(w) == pytest.approx((whole * w[:, None]).T @ whole)
    assert j.summed(z) == pytest.approx(z @ whole)
    assert j @ step == pytest.approx(whole @ step)
    assert j @ step[:, 0] == pytest.approx(whole @ step[:, 0])
    assert j.weighted(w).normal(np.ones(12)) == pytest.approx((whole * (w * w)[:, None]).T @ whole)
    both = j.beside(dense).split(8)
    assert both[0].normal(w) == pytest.approx(j.normal(w))
    assert both[1] == pytest.approx(dense)


class Straight:
    """Numbers without noise that are 3 at every row, with the right or the wrong sign of their column."""

    nuisances = 0

    def __init__(self, sign: float) -> None:
        self.sign, edge = sign, np.full(1, 10.0)
        self.bounds = Bounds.of(-edge, edge)

    def residual(self, x: np.ndarray) -> np.ndarray:
        z: np.ndarray = 3.0 - np.repeat(x, 6)
        return z

    def jacobian(self, x: np.ndarray) -> Jacobian:  # noqa: ARG002  # the same everywhere
        return Jacobian.of(np.full((6, 1), self.sign))


@pytest.mark.parametrize(("sign", "settled"), [(1.0, True), (-1.0, False)])
def test_a_fit_that_cannot_gain_what_it_is_promised_has_not_settled(sign: float, settled: bool) -> None:
    problem, start = Straight(sign), np.zeros(1)
    found = gauss_newton(problem, start, problem.jacobian(start), WHOLE)
    assert found.settled == settled
    assert (found.x[0] == pytest.approx(3.0)) == settled
