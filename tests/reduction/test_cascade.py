"""Powers, efficiencies, repeatability and bins: closed forms and published values."""

import numpy as np
import pytest

from winchcascade.core.cascade import BUILT_IN
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


def energy(line: float | None = None, mech: float | None = None, gen: float | None = None) -> dict[str, float | None]:
    return {"energy_line": line, "energy_mech": mech, "energy_gen": gen}


@pytest.mark.parametrize(
    ("energies", "open_circuit", "etas", "odd"),
    [
        ((1000.0, 900.0, 720.0), False, (0.9, 0.8, 0.72), []),
        ((1000.0, 500.0, 30.0), True, (0.5, None, None), []),  # nothing is delivered
        ((400.0, 1000.0, None), False, (2.5, None, None), ["eta_trans"]),
        ((1000.0, -50.0, None), False, (None, None, None), ["eta_trans"]),
        ((1000.0, None, 700.0), False, (None, None, 0.7), []),
    ],
)
def test_efficiencies_are_ratios_of_the_energies(
    energies: tuple[float | None, ...], open_circuit: bool, etas: tuple[float | None, ...], odd: list[str]
) -> None:
    values, outside = metrics(energy(*energies), 5.0, open_circuit=open_circuit)
    assert (values.eta_trans, values.eta_gen, values.eta_pto) == pytest.approx(etas)
    assert [values[f"power_{stage}"] for stage in ("line", "mech", "gen")] == [e and e / 5.0 for e in energies]
    assert list(outside) == odd


def test_a_mean_needs_every_cycle_and_a_deviation_two() -> None:
    assert ensemble_mean([Metrics(eta_trans=0.9), Metrics()]).eta_trans is None
    assert all(getattr(ensemble_mean([]), name) is None for name in METRICS)
    assert all(getattr(largest_deviation([Metrics(energy_line=3.0)]), name) is None for name in METRICS)


def test_the_mean_efficiency_is_the_mean_of_ratios_and_the_total_the_ratio_of_sums() -> None:
    cycles = [
        metrics(energy(e, 0.5 * e + d, None), 1.0, open_circuit=False)[0] for e, d in ((1000.0, 0.0), (3000.0, 300.0))
    ]
    assert ensemble_mean(cycles).eta_trans == pytest.approx((0.5 + 0.6) / 2)
    assert total(cycles, 2.0, open_circuit=False).eta_trans == pytest.approx(2300 / 4000)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_largest_deviation_is_a_share_of_the_mean(sign: float) -> None:
    cycles = [Metrics(energy_line=sign * energy) for energy in (400.0, 500.0, 540.0)]
    assert largest_deviation(cycles).energy_line == pytest.approx(100.0 * 80.0 / 480.0)
