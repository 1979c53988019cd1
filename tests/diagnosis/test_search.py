"""A search ends at its best set: it leaves a set beside it, prefers fewer causes that predict
better, and takes any bounds.
"""

import math
from collections.abc import Sequence
from functools import cache

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from planted import campaign
from rigs import calibrated_rig
from scipy.integrate import quad
from scipy.sparse import csr_array

from winchcascade.core.run import Signal
from winchcascade.diagnosis.fit.covariance import square_beyond
from winchcascade.diagnosis.fit.evidence import Evidence, log_mass, minimum_within
from winchcascade.diagnosis.fit.expansion import marginal_about
from winchcascade.diagnosis.fit.fit_set import fit_set
from winchcascade.diagnosis.fit.marginal import WILD, Columns, Marginal, Together
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.diagnosis.fit.search import BEHIND, Found, gone_on, search
from winchcascade.diagnosis.fit.suspects import Suspects, freedom
from winchcascade.diagnosis.judge.causes import Posterior, parameters_of, posterior_of
from winchcascade.diagnosis.judge.closure import HeldOut, close, judging
from winchcascade.diagnosis.judge.conclusion import predicting_best
from winchcascade.report.diagnosis_names import UNDETERMINED, number_words
from winchcascade.report.results.diagnosis_record import plain
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import ActiveEffect, Display

ROWS = 400

PAIR, TRUE, HIDDEN = ("current_gain", "voltage_gain"), ("line_drag", "torque_gain"), "torque_gain"
"""Two suspects that imitate two others, these, and the one that shows beyond a threshold alone:
no derivative finds it.
"""

NAMES = tuple(sorted((*PAIR, *TRUE)))


class Hidden:
    """Numbers of unit noise that two suspects move, one of them beyond a threshold, and two
    others nearly as much.
    """

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.suspects: Suspects = {name: EFFECTS[name] for name in NAMES}
        self.sd = freedom(*self.suspects.values()).sd
        way = dict(zip((*TRUE, "beside", "aside"), 3.0 * rng.normal(size=(4, ROWS)), strict=True))
        way[HIDDEN] *= 2.0
        way[PAIR[0]] = way[TRUE[0]] + 0.3 * way["beside"]
        way[PAIR[1]] = way[TRUE[1]] + 0.3 * way["aside"]
        self.ways = np.array([way[name] for name in NAMES]).T
        self.measured = self.ways @ self.shape(np.array([name in TRUE for name in NAMES]) * self.sd)
        self.measured += rng.normal(size=ROWS)
        self.groups: NDArray[np.intp] = np.zeros(ROWS, dtype=np.intp)

    def shape(self, x: Signal) -> Signal:
        """Size of each suspect of its field."""
        size = x / self.sd
        return np.where(np.array(NAMES) == HIDDEN, np.maximum(2.0 * size - 1.0, 0.0), size)

    @property
    def exclusive(self) -> tuple[Together, ...]:
        return ()

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        return {HIDDEN: (float(self.sd[NAMES.index(HIDDEN)]),)}

    def price(self, _name: str) -> float:
        return 3.0

    @property
    def nuisances(self) -> int:
        return 0

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        _nu: Signal,
        _near: object = None,
        _serves: float = 0.0,
    ) -> Signal:
        z = np.empty((ROWS, len(several)))
        for column, effects in enumerate(several):
            values = {one.effect.name: one.values[0] for one in effects}
            x = np.array([values.get(name, 0.0) for name in self.suspects])
            z[:, column] = self.measured - self.ways @ self.shape(x)
        return z

    def nuisance_columns(self, _effects: Sequence[ActiveEffect], _nu: Signal) -> Columns:
        return Columns(np.zeros((ROWS, 0)), csr_array((ROWS, 0)))


SEVERAL = ("force_gain", "line_drag", "rotor_friction", "torque_gain", "voltage_gain")
"""Suspects that act together, each in a way of its own."""


class Several(Hidden):
    """Numbers of unit noise that seven suspects move, five of which act."""

    def __init__(self) -> None:
        super().__init__()
        rng = np.random.default_rng(1)
        self.suspects = {name: EFFECTS[name] for name in (*SEVERAL, "current_gain", "gas_volume")}
        self.sd = freedom(*self.suspects.values()).sd
        self.ways = 3.0 * rng.normal(size=(ROWS, len(self.suspects)))
        acting = np.array([name in SEVERAL for name in self.suspects])
        self.measured = self.ways @ acting + rng.normal(size=ROWS)

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        return {}

    def shape(self, x: Signal) -> Signal:
        return x / self.sd


@cache
def hidden() -> Found:
    return search(Hidden())


# ----------------------------------------------------------------------------------- the best set
def test_a_search_ends_at_the_best_set_though_no_derivative_leads_there_from_none() -> None:
    assert hidden().best.names == TRUE


def test_causes_that_act_in_ways_of_their_own_are_found_in_one_step() -> None:
    found = search(Several())
    assert found.best.names == SEVERAL
    assert found.centres.keys() == {(), SEVERAL}


def test_every_fit_is_kept_and_each_set_has_the_newest() -> None:
    found = hidden()
    assert {(), PAIR, TRUE} <= found.fits.keys()
    assert all(found.fits[names] is centre.fit for names, centre in found.centres.items())
    assert found.centres.keys() >= {(), TRUE}


def test_a_search_goes_on_from_a_fit_with_more_evidence_wherever_it_was_made() -> None:
    problem = Hidden()
    beside = msgspec.structs.replace(hidden(), fits={(): hidden().fits[()]}, centres={})
    beside.about(hidden().fits[PAIR])
    beside = beside.led_by(PAIR)
    assert gone_on(beside).best.names == PAIR
    start = {HIDDEN: np.array(problem.begins[HIDDEN])}
    assert beside.fit((HIDDEN,), start).loss < beside.fits[()].loss
    beside.fit(TRUE, start)
    assert gone_on(beside).best.names == TRUE


def test_a_fit_that_ended_early_is_made_again_from_the_best() -> None:
    found = msgspec.structs.replace(hidden(), fits={**hidden().fits}, tried=set())
    alone = (TRUE[0],)
    fit = found.fit(alone)
    stuck = msgspec.structs.replace(fit, x=0.0 * fit.x, loss=fit.loss + 1e4)
    again = msgspec.structs.replace(found, fits={**found.fits, alone: stuck}, tried=set())
    behind = fit.loss - found.best.loss
    assert again.fit(alone).loss == pytest.approx(fit.loss, abs=BEHIND * behind)


def test_a_set_that_is_rejected_is_not_the_best_again() -> None:
    found = hidden()
    rejected = msgspec.structs.replace(found, fits={**found.fits}, rejected=frozenset({TRUE}))
    assert gone_on(rejected).best.names != TRUE


# ---------------------------------------------------------------------------------- held-out logs
GEAR, IMITATION = "gear_mesh_loss", ("line_drag", "rotor_friction")


@cache
def gear_loss() -> tuple[Fitted, Found]:
    """A search among a loss of the gear and what imitates it, led by the imitation."""
    data = Fitted(campaign({GEAR: {"efficiency_change": -0.1}}), calibrated_rig())
    found = search(RigProblem(data, {name: EFFECTS[name] for name in (GEAR, *IMITATION)}))
    assert found.best.names == (GEAR,)
    found.about(found.fit(IMITATION))
    return data, found.led_by(IMITATION)


def test_fewer_causes_win_that_close_more_on_held_out_logs() -> None:
    data, found = gear_loss()
    kept = predicting_best(found, HeldOut(data, 0))
    assert kept.best.names == (GEAR,)
    assert not kept.allowed(IMITATION) or kept.evidence.worth(
        kept.fits[IMITATION]
    ) < kept.evidence.worth(kept.best)


ONE_STEP = 0.2
"""Standard uncertainties by which one step may end beside a fit, as the model is not linear and
the loss not quadratic.
"""


class Weighed(RigProblem, frozen=True, kw_only=True):
    """Logs of a rig with weights of their residuals, (M * 5,)."""

    rows: Signal

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        nu: Signal,
        near: Sequence[ActiveEffect] | None = None,
        serves: float = 0.0,
    ) -> Signal:
        """Residuals times their weights, (M * 5, k)."""
        z = RigProblem(self.data, self.suspects).residuals(several, nu, near, serves)
        return z * self.rows[:, None]


def test_a_log_is_held_out_as_a_fit_without_it_does() -> None:
    data, found = gear_loss()
    led = found.led_by((GEAR,))
    closure = close(data, led, led.best, judging(data), 0)
    for k, foreseen in closure.predictions.items():
        rows = np.ones_like(data.measured)
        rows[data.rows[k]] = 0.0
        problem = Weighed(data, found.problem.suspects, rows=rows.ravel())
        fit = fit_set(problem, led.marginal.masked(rows.ravel()), (GEAR,), {GEAR: led.best.x})
        assert foreseen.x[0] == pytest.approx(
            fit.x[0], abs=ONE_STEP / math.sqrt(float(fit.curve[0, 0]))
        )


# ------------------------------------------------------------------------------ priors and bounds
@pytest.mark.parametrize("pull", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("low", [0.0, -0.5, -math.inf])
def test_the_mass_of_a_normal_ends_at_its_bounds(pull: float, low: float) -> None:
    spread, high = 0.7, 2.0
    whole = quad(lambda t: math.exp(-pull * t - 0.5 * (t / spread) ** 2), max(low, -20.0), high)[0]
    mass = float(
        log_mass(np.array([low]), np.array([high]), np.array([pull]), np.array([spread]))[0]
    )
    assert mass == pytest.approx(math.log(whole / (spread * math.sqrt(2.0 * math.pi))), abs=1e-6)


@pytest.mark.parametrize("pull", [0.0, 0.5, 5.0])
def test_the_mean_square_beyond_a_bound_is_that_of_a_normal_that_is_cut_off(pull: float) -> None:
    top, whole = (
        quad(lambda t, n=n: t**n * math.exp(-pull * t - 0.5 * t**2), 0.0, 40.0)[0] for n in (2, 0)
    )
    assert square_beyond(pull) == pytest.approx(top / whole, rel=1e-6)


class OneSided(Hidden):
    """One suspect, its numbers moved in proportion to its field."""

    def __init__(self, strength: float) -> None:
        super().__init__()
        self.measured = np.random.default_rng(1).normal(size=ROWS) * 0.5
        self.measured += strength * self.ways @ (np.array(NAMES) == "line_drag")


@pytest.mark.parametrize("strength", [0.0, 0.03, -0.05, 0.2])
def test_the_evidence_of_a_field_that_is_never_negative_is_by_a_prior_of_one_side(
    strength: float,
) -> None:
    problem = OneSided(strength)
    marginal = marginal_about(problem, [], np.zeros(0))
    fits = [fit_set(problem, marginal, names) for names in (("line_drag",), ())]
    evidence, way = Evidence(problem, 1.0), problem.ways[:, NAMES.index("line_drag")]
    given, top = problem.measured, max(float(way @ problem.measured / (way @ way)), 0.0)

    def density(x: float) -> float:
        """Half-normal prior times the likelihood over that of nothing."""
        fit = 0.5 * float(given @ given) - 0.5 * float(np.sum((given - way * x) ** 2))
        return 2.0 / math.sqrt(2.0 * math.pi) * math.exp(fit - fits_best - 0.5 * x**2)

    fits_best = 0.5 * float(given @ given) - 0.5 * float(np.sum((given - way * top) ** 2))
    exact = math.log(quad(density, max(top - 0.3, 0.0), top + 0.3)[0]) + fits_best - 3.0
    assert evidence.of(fits[0]) - evidence.of(fits[1]) == pytest.approx(exact, abs=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_a_minimum_is_found_within_bounds_that_are_infinite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 5))
    curve, slope = root.T @ root + 0.1 * np.eye(5), 3.0 * rng.normal(size=5)
    low, high = (
        np.array([0.0, -0.1, 0.0, -math.inf, 0.0]),
        np.array([math.inf, math.inf, 0.2, 0.1, math.inf]),
    )
    best = minimum_within(curve, slope, low, high)
    assert np.all((best >= low) & (best <= high))
    wide = minimum_within(curve, slope, np.maximum(low, -1e3), np.minimum(high, 1e3))
    np.testing.assert_allclose(best, wide, atol=1e-9)
    downwards = slope - curve @ best
    assert np.all(
        np.where(best <= low, downwards <= 1e-9, np.where(best >= high, downwards >= -1e-9, True))
    )


def test_suspects_that_have_no_upper_bound_are_fitted() -> None:
    problem = OneSided(0.5)
    endless = {
        name: msgspec.structs.replace(
            effect,
            fields=tuple(
                msgspec.structs.replace(f, possible=(f.possible[0], math.inf))
                for f in effect.fields
            ),
        )
        for name, effect in problem.suspects.items()
    }
    given = search(problem)
    problem.suspects = endless
    found = search(problem)
    assert found.best.names == given.best.names == ("line_drag",)
    assert found.evidence.of(found.best) == pytest.approx(given.evidence.of(given.best), abs=1e-6)


# ----------------------------------------------------------------------- what cannot be simulated
class Breaking(Hidden):
    """The first suspect cannot be simulated at all, and neither can the first of two nuisances."""

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        _nu: Signal,
        _near: object = None,
        _serves: float = 0.0,
    ) -> Signal:
        z = super().residuals(several, _nu)
        breaks = [
            any(one.effect.name == NAMES[0] and one.values[0] for one in effects)
            for effects in several
        ]
        return np.where(breaks, WILD, z)

    @property
    def nuisances(self) -> int:
        return 2

    def nuisance_columns(self, _effects: Sequence[ActiveEffect], _nu: Signal) -> Columns:
        dense = np.random.default_rng(2).normal(size=(ROWS, 2))
        dense[:, 0] *= 1e200
        dense[7, 0] = np.nan
        return Columns(dense, csr_array((ROWS, 0)))


def test_a_number_with_which_nothing_can_be_simulated_moves_nothing() -> None:
    problem = Breaking()
    marginal = Marginal(np.zeros(2), problem.nuisance_columns([], np.zeros(2)))
    assert np.isfinite(marginal(problem.measured)).all()
    assert marginal.spread[0].tolist() == [1.0, 0.0]
    found = search(problem)
    assert found.best.names == TRUE
    assert np.isfinite(found.expansion.curve).all()


# ---------------------------------------------------------------- numbers that are not determined
def posterior(share: float) -> Posterior:
    """A posterior of the gear's loss with a share of the variance of its prior."""
    problem = OneSided(0.5)
    fit = fit_set(problem, marginal_about(problem, [], np.zeros(0)), ("line_drag",))
    one = fit.free.sd[:, None] ** 2
    return Posterior(fit, share * one, 1.0 / (share * one), np.zeros(1))


@pytest.mark.parametrize(("share", "determined"), [(0.95, False), (0.7, True)])
def test_a_number_of_which_the_data_tell_less_than_a_quarter_of_the_prior_is_not_determined(
    share: float, determined: bool
) -> None:
    effect = EFFECTS["line_drag"]
    number = parameters_of(posterior(share), effect, "line_drag")[effect.parameter]
    assert number.determined == determined
    record = plain(number)
    assert (record["low"] is None, record["high"] is None) == (not determined, not determined)
    assert (number_words(Display("drag"), number)[1] == UNDETERMINED) != determined


def test_a_field_at_a_bound_of_which_the_data_tell_nothing_is_not_known() -> None:
    problem = Hidden()
    at = NAMES.index("line_drag")
    problem.ways[:, at] = 0.0
    found = search(problem)
    fit = fit_set(problem, found.marginal, ("line_drag",))
    u = math.sqrt(float(posterior_of(found, fit).covariance[0, 0]))
    assert u == pytest.approx(float(problem.sd[at]))


def test_a_number_at_its_absence_beyond_which_nothing_is_possible_is_bounded_on_the_other_side_alone() -> (
    None
):
    problem = OneSided(-0.05)
    found = search(problem)
    fit = fit_set(problem, found.marginal, ("line_drag",))
    effect = EFFECTS["line_drag"]
    number = parameters_of(posterior_of(found, fit), effect, "line_drag")[effect.parameter]
    assert (number.value, number.low, number.at_limit) == (0.0, 0.0, None)
    assert 0.0 < number.high < float(fit.free.sd[0])
