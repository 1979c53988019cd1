"""Powers, efficiencies, repeatability and bins: closed forms and published values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core.cascade import BUILT_IN
from winchcascade.reduction.bins import bin_powers
from winchcascade.reduction.efficiency import METRICS, Metrics, ensemble_mean, largest_deviation, metrics, total

ONE = np.ones(3)


@pytest.mark.parametrize(
    ("stage", "channels", "r_drum", "watts"),
    [
        ("line", {"force": 2 * ONE, "velocity": 3 * ONE}, None, 6.0),
        ("line", {"velocity": ONE}, 0.13, None),
        ("mech", {"torque": 0.13 * ONE, "velocity": 3 * ONE}, 0.13, 3.0),
        ("mech", {"torque": ONE, "velocity": ONE}, None, None),
        ("mech", {"power_mech": 5 * ONE, "torque": ONE, "velocity": ONE}, 0.13, 5.0),
        ("gen", {"vdc": 4 * ONE, "idc": 2 * ONE, "velocity": ONE}, None, 8.0),
        ("gen", {"vdc": ONE, "velocity": ONE}, None, None),
    ],
)
def test_a_stage_has_a_power_where_its_channels_are(
    stage: str, channels: dict[str, np.ndarray], r_drum: float | None, watts: float | None
) -> None:
    found = BUILT_IN[stage].watts(channels, r_drum)
    assert found is None if watts is None else found == pytest.approx(watts * ONE)


def energy(line: float | None, mech: float | None, gen: float | None) -> dict[str, float | None]:
    return {"energy_line": line, "energy_mech": mech, "energy_gen": gen}


def test_efficiencies_are_ratios_of_the_energies() -> None:
    values, odd = metrics(energy(1000.0, 900.0, 720.0), 5.0, open_circuit=False)
    assert (values.eta_trans, values.eta_gen, values.eta_pto) == pytest.approx((0.9, 0.8, 0.72))
    assert (values.power_line, values.power_mech, values.power_gen) == pytest.approx((200.0, 180.0, 144.0))
    assert odd == {}


def test_in_open_circuit_nothing_is_delivered_so_only_the_transmission_has_an_efficiency() -> None:
    values, _ = metrics(energy(1000.0, 500.0, 30.0), 5.0, open_circuit=True)
    assert values.eta_trans == 0.5
    assert values.eta_gen is None
    assert values.eta_pto is None


@pytest.mark.parametrize(("line", "mech", "eta"), [(400.0, 1000.0, 2.5), (1000.0, -50.0, None)])
def test_a_ratio_above_1_is_given_and_one_below_0_is_not(line: float, mech: float, eta: float | None) -> None:
    values, odd = metrics(energy(line, mech, None), 5.0, open_circuit=False)
    assert values.eta_trans == eta
    assert odd["eta_trans"] == pytest.approx(mech / line)


def test_without_torque_the_whole_still_has_an_efficiency() -> None:
    values, _ = metrics(energy(1000.0, None, 700.0), 5.0, open_circuit=False)
    assert (values.eta_trans, values.eta_gen, values.eta_pto) == (None, None, 0.7)


def test_the_mean_efficiency_is_the_mean_of_ratios_and_the_total_the_ratio_of_sums() -> None:
    cycles = [
        metrics(energy(e, 0.5 * e + d, None), 1.0, open_circuit=False)[0] for e, d in ((1000.0, 0.0), (3000.0, 300.0))
    ]
    assert ensemble_mean(cycles).eta_trans == pytest.approx((0.5 + 0.6) / 2)
    assert total(cycles, 2.0, open_circuit=False).eta_trans == pytest.approx(2300 / 4000)


@given(st.lists(st.floats(1.0, 1e4), min_size=2, max_size=20))
def test_no_cycle_deviates_by_more_than_the_largest_deviation(values: list[float]) -> None:
    cycles = [Metrics(energy_line=v) for v in values]
    mean, maximum = ensemble_mean(cycles).energy_line, largest_deviation(cycles).energy_line
    assert mean is not None
    assert maximum is not None
    assert all(abs(v - mean) <= maximum / 100 * mean * (1 + 1e-9) for v in values)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_largest_deviation_is_a_share_of_the_mean(sign: float) -> None:
    cycles = [Metrics(energy_line=sign * energy) for energy in (400.0, 500.0, 540.0)]
    assert largest_deviation(cycles).energy_line == pytest.approx(100.0 * 80.0 / 480.0)


def test_one_cycle_has_no_deviation() -> None:
    assert all(getattr(largest_deviation([Metrics(energy_line=3.0)]), name) is None for name in METRICS)


def test_no_cycle_has_no_mean() -> None:
    assert all(getattr(ensemble_mean([]), name) is None for name in METRICS)


def test_a_metric_that_one_cycle_cannot_give_has_no_mean() -> None:
    assert ensemble_mean([Metrics(eta_trans=0.9), Metrics()]).eta_trans is None


def test_a_bin_holds_the_mean_and_its_standard_error() -> None:
    rng = np.random.default_rng(5)
    v = rng.uniform(0.0, 1.0, 5000)
    watts = 1000.0 * v + rng.normal(0, 50, v.size)
    bins = bin_powers(v, 3000.0, v > 0.2, {"line": watts.__getitem__, "gen": None}, 100.0)
    assert [b.rpm_low for b in bins] == [100.0 * k for k in range(6, 30)]
    for b in bins:
        inside = (v > 0.2) & (v * 3000.0 >= b.rpm_low) & (v * 3000.0 < b.rpm_high)
        assert b.count == inside.sum()
        assert b.power["line"] == pytest.approx(watts[inside].mean())
        assert b.standard_error["line"] == pytest.approx(watts[inside].std(ddof=1) / np.sqrt(b.count), rel=1e-6)
        assert b.power["gen"] is None


def test_a_bin_of_one_sample_has_no_standard_error() -> None:
    (only,) = bin_powers(np.array([0.5, 0.0]), 3000.0, np.array([True, False]), {"line": np.ones(2).__getitem__}, 100.0)
    assert only.count == 1
    assert only.standard_error["line"] is None
