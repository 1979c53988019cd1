"""The parts of a difference add up, follow Shapley's definition, and are those of the effects
that were planted.
"""

import math
from functools import cache
from itertools import permutations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from planted import LOGS, campaign, driven
from rigs import calibrated_rig

from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.diagnosis_result import Contribution, ContributionPart
from winchcascade.diagnosis.explain.contributions import (
    OF_DISCREPANCY,
    Accounts,
    by_cost,
    contributions_of,
    leading_metric,
    with_uncertain_laws,
)
from winchcascade.diagnosis.explain.shapley import (
    EXACT,
    PAIRS_OF_ORDERS,
    shapley,
    split,
    subsets_of,
)
from winchcascade.diagnosis.explain.windowed import QUANTITIES, windowed, windowed_logs
from winchcascade.diagnosis.verdict_limits import LAW
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.simulate import simulate

PLANTED = {
    "copper_heating": {"r_s_change": 0.35},
    "line_drag": {"b": 0.9},
    "torque_gain": {"gain_error": 0.03},
}

ROUNDING = 1e-9
"""Relative error of sums of floating-point numbers. [1]"""


@cache
def found() -> ModelDiagnosis:
    """Three causes of different stages, which are the only suspects."""
    return diagnose(campaign(PLANTED), calibrated_rig(), {name: EFFECTS[name] for name in PLANTED})


def entry(metric: str, load: float) -> Contribution:
    return next(one for one in found().contributions if one.metric == metric and one.load == load)


def part(metric: str, load: float, effect: str) -> ContributionPart:
    return next(one for one in entry(metric, load).parts if one.effect == effect)


def test_the_parts_of_every_metric_of_every_run_add_up_to_its_difference() -> None:
    assert len(found().contributions) == len(LOGS) * len(QUANTITIES)
    for one in found().contributions:
        if one.parts:
            difference = one.measured - one.as_given
            size = max(abs(one.measured), abs(one.as_given))
            assert sum(p.value for p in one.parts) == pytest.approx(difference, abs=ROUNDING * size)
            assert [p.kind for p in one.parts][-2:] == ["tolerances", "residual"]
            assert all(p.low <= p.value <= p.high for p in one.parts)


@given(arrays(np.float64, 8, elements=st.floats(-1e3, 1e3)))
def test_the_split_is_the_mean_of_what_a_player_adds_over_all_orders(values: np.ndarray) -> None:
    expected = np.zeros(3)
    for order in permutations(range(3)):
        subset = 0
        for player in order:
            expected[player] += (values[subset | 1 << player] - values[subset]) / 6.0
            subset |= 1 << player
    assert shapley(values) == pytest.approx(expected, abs=1e-9)
    assert shapley(values).sum() == pytest.approx(values[7] - values[0], abs=1e-9)


@pytest.mark.parametrize("count", [EXACT + 1, 14])
def test_a_split_among_many_is_drawn_with_a_stated_error_and_adds_up(count: int) -> None:
    """The value of a subset is that of its players and of pairs, of which each player has half."""
    rng, subsets = np.random.default_rng(count), subsets_of(count)
    alone, pairs = rng.normal(size=count), np.triu(rng.normal(size=(count, count)), 1)
    takes_part = np.array(
        [[subset >> player & 1 for player in range(count)] for subset in subsets], dtype=np.float64
    )
    values = takes_part @ alone + np.einsum("si,ij,sj->s", takes_part, pairs, takes_part)
    shares, error = split(values, count)
    assert len(subsets) <= 2 * PAIRS_OF_ORDERS * count
    assert shares.sum() == pytest.approx(values[-1] - values[0])
    assert shares == pytest.approx(
        alone + 0.5 * (pairs + pairs.T).sum(axis=1)
    )  # an order and its reverse: exact for pairs
    assert error == pytest.approx(0.0, abs=1e-9)


def test_the_error_of_a_drawn_split_is_that_of_its_scatter() -> None:
    count = EXACT + 2
    subsets = subsets_of(count)
    size = np.array([subset.bit_count() for subset in subsets], dtype=np.float64)
    first = np.array([subset & 1 for subset in subsets], dtype=np.float64)
    values = first * size**2
    exact = float(np.mean([joined**2 for joined in range(1, count + 1)]))
    shares, error = split(values, count)
    assert error[0] > 0.0
    assert abs(shares[0] - exact) < 4.0 * error[0]


def test_contributions_are_the_split_of_simulated_metrics() -> None:
    diagnosis = found()
    data, best = diagnosis.data, diagnosis.found.best
    one, acting = (
        windowed(data, 1),
        dict(zip(best.names, best.effects(diagnosis.suspects), strict=True)),
    )
    nothing = np.zeros(len(data.nuisances))

    def metrics(names: tuple[str, ...]) -> np.ndarray:
        model = data.models(nothing, [acting[name] for name in names])[1]
        return one.simulated(model, data.skew(nothing), np.zeros(5))

    orders = list(permutations(PLANTED))
    for name in PLANTED:
        added = [
            metrics(order[: order.index(name) + 1]) - metrics(order[: order.index(name)])
            for order in orders
        ]
        expected = dict(zip(QUANTITIES, np.mean(added, axis=0), strict=True))
        for metric in ("eta_pto", "energy_mech", "torque"):
            assert part(metric, 36.0, name).value == pytest.approx(
                expected[metric], rel=1e-9, abs=1e-12
            )


def test_the_order_of_the_causes_changes_no_part() -> None:
    diagnosis = found()
    logs = windowed_logs(diagnosis.data)
    again = contributions_of(diagnosis.data, diagnosis.found, diagnosis.causes[::-1], logs)[0]
    for one, other in zip(diagnosis.contributions, again, strict=True):
        values = {(p.effect, p.kind): p.value for p in other.parts}
        assert values == {
            (p.effect, p.kind): pytest.approx(p.value, rel=1e-9, abs=1e-12) for p in one.parts
        }


@pytest.mark.parametrize("load", [36.0, 9.0])
def test_the_interval_holds_what_the_planted_effect_changes(load: float) -> None:
    run = next(run for run in driven() if run.load == load)
    rest = [make_effect(name, PLANTED[name]) for name in PLANTED if name != "copper_heating"]
    without = baseline(calibrated_rig())
    for effect in rest:
        without = effect.apply(without)
    both = [make_effect("copper_heating", PLANTED["copper_heating"]).apply(without), without]
    after, before = (
        reduce(simulate(run, model).run, rig=calibrated_rig()).mean.eta_pto for model in both
    )
    assert after is not None
    assert before is not None
    got = part("eta_pto", load, "copper_heating")
    assert got.low < after - before < got.high
    assert got.value < 0.0


def test_a_sensor_changes_what_is_read_and_costs_no_energy() -> None:
    gain = part("torque", 9.0, "torque_gain")
    assert gain.kind == "sensor"
    assert gain.value == pytest.approx(0.03 * entry("torque", 9.0).as_given, rel=0.15)
    assert part("eta_pto", 9.0, "torque_gain").value == 0.0
    assert (
        part("eta_gen", 9.0, "torque_gain").value
        < 0.0
        < part("eta_trans", 9.0, "torque_gain").value
    )


def test_open_circuit_has_no_efficiency_of_the_machine() -> None:
    for metric in ("eta_gen", "eta_pto"):
        one = entry(metric, math.inf)
        assert math.isnan(one.as_given)
        assert math.isnan(one.measured)
        assert one.parts == ()
    assert entry("eta_trans", math.inf).parts


def test_measured_metrics_are_those_of_the_reduction() -> None:
    mean = reduce(found().runs[1], rig=calibrated_rig()).mean
    assert entry("eta_pto", 36.0).measured == pytest.approx(mean.eta_pto)
    assert entry("energy_line", 36.0).measured == pytest.approx(mean.energy_line)


def test_causes_are_ordered_by_what_they_change_in_eta_pto() -> None:
    causes = found().causes
    mean = [abs(sum(part("eta_pto", load, c.effect).value for load in (36.0, 9.0))) for c in causes]
    assert mean == sorted(mean, reverse=True)
    assert [p.effect for p in entry("eta_pto", 9.0).parts[: len(causes)]] == [
        c.effect for c in causes
    ]
    last = msgspec.structs.replace(causes[-1], stage="entry")
    assert by_cost([*causes[:-1], last], found().contributions)[0] == last


def test_what_a_log_lacks_has_no_parts() -> None:
    runs = [
        msgspec.structs.replace(
            run, channels={k: x for k, x in run.channels.items() if k not in ("torque", "idc")}
        )
        for run in campaign({"line_drag": PLANTED["line_drag"]})[1:]
    ]
    bare = diagnose(runs, calibrated_rig(), {"line_drag": EFFECTS["line_drag"]})
    metrics = {one.metric for one in bare.contributions if one.parts}
    assert metrics == {"energy_line", "power_line", "pressure", "force", "vdc"}
    assert leading_metric(bare.contributions) is None
    assert [cause.effect for cause in bare.causes] == ["line_drag"]


def test_without_a_cause_tolerances_and_residual_remain() -> None:
    nothing = diagnose(campaign({}), calibrated_rig(), {"line_drag": EFFECTS["line_drag"]})
    assert nothing.causes == ()
    kinds = {tuple(p.kind for p in one.parts) for one in nothing.contributions}
    assert kinds == {("tolerances", "residual"), ()}


def accounts(share: list[float], u: list[float]) -> Accounts:
    """Runs of which one cause has a share of every quantity, with the uncertainty of the fit
    alone; all else is 0.
    """
    parts = np.zeros((2, len(share), 3, len(QUANTITIES)))
    parts[0, :, 0], parts[1, :, 0] = np.array(share)[:, None], np.array(u)[:, None]
    level = np.full((len(share), len(QUANTITIES)), 0.5)
    return Accounts(
        0.0 * level,
        level,
        parts[0],
        parts[1],
        parts[0, :, :1],
        np.zeros((len(share), 2, len(QUANTITIES))),
    )


def test_a_law_errs_also_where_a_contribution_passes_zero() -> None:
    of_law, of_model, own = LAW * 0.03, OF_DISCREPANCY * 0.002 * 0.5, [0.0, 4e-4, 0.0]
    u = with_uncertain_laws(accounts([0.0, -0.03, 0.2], own), np.array([True, True, False]), 0.002)
    for found, alone in zip(u[:2, 0], own, strict=False):
        assert found == pytest.approx(
            np.full(len(QUANTITIES), math.sqrt(alone**2 + of_law**2 + of_model**2))
        )


def test_what_changes_nothing_has_no_uncertain_law() -> None:
    assert not np.any(with_uncertain_laws(accounts([0.0], [0.0]), np.array([True]), 0.002))
