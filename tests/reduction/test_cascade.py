"""Powers, efficiencies and repeatability: closed forms; the best and the worst cycle."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from winchcascade.core.cascade import BUILT_IN
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import METRICS, Metrics, metrics, together
from winchcascade.reduction.reduce import reduce

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
    ],
)
def test_a_stage_has_a_power_where_its_channels_are(
    stage: str, channels: dict[str, np.ndarray], r_drum: float | None, watts: float | None
) -> None:
    found = BUILT_IN[stage].watts(channels, r_drum)
    assert found is None if watts is None else found == pytest.approx(watts * ONE)


def cycle(
    line: float | None, mech: float | None, gen: float | None, *, open_circuit: bool = False
) -> Metrics:
    return metrics(
        {"energy_line": line, "energy_mech": mech, "energy_gen": gen},
        5.0,
        open_circuit=open_circuit,
    )


@pytest.mark.parametrize(
    ("energies", "open_circuit", "etas"),
    [
        ((1000.0, 900.0, 720.0), False, (0.9, 0.8, 0.72)),
        ((1000.0, 500.0, 30.0), True, (0.5, None, None)),  # nothing is delivered
        ((400.0, 1000.0, None), False, (2.5, None, None)),
        ((1000.0, -50.0, None), False, (None, None, None)),
        ((1000.0, None, 700.0), False, (None, None, 0.7)),
    ],
)
def test_efficiencies_are_ratios_of_the_energies(
    energies: tuple[float | None, ...], open_circuit: bool, etas: tuple[float | None, ...]
) -> None:
    values = cycle(*energies, open_circuit=open_circuit)
    assert (values.eta_trans, values.eta_gen, values.eta_pto) == pytest.approx(etas)
    assert [values[f"power_{stage}"] for stage in ("line", "mech", "gen")] == [
        e and e / 5.0 for e in energies
    ]


def test_means_are_of_ratios_totals_of_sums_and_a_deviation_needs_two_cycles() -> None:
    found = together([cycle(1000.0, 500.0, None), cycle(3000.0, 1800.0, None)], 2.0)
    assert found.mean.eta_trans == pytest.approx((0.5 + 0.6) / 2)
    assert found.total.eta_trans == pytest.approx(2300 / 4000)
    assert together([cycle(2.0, 1.0, None), cycle(2.0, None, None)], 1.0).mean.eta_trans is None
    for nothing in (
        together([], 0.0).mean,
        together([cycle(3.0, 2.0, 1.0)], 1.0).max_deviation_percent,
    ):
        assert {nothing[name] for name in METRICS} == {None}
    for sign in (1.0, -1.0):
        apart = together(
            [cycle(sign * energy, None, None) for energy in (400.0, 500.0, 540.0)], 3.0
        )
        assert apart.max_deviation_percent.energy_line == pytest.approx(100.0 * 80.0 / 480.0)


@pytest.mark.parametrize(
    ("cycles", "expected"),
    [
        (
            [Metrics(eta_trans=1 - eta, eta_pto=eta) for eta in (0.70, 0.61, 0.65)],
            (1, 2, "eta_pto"),
        ),
        (
            [Metrics(eta_trans=a, energy_line=b) for a, b in ((0.7, 1.0), (0.8, 2.0), (0.9, 0.5))],
            (3, 1, "eta_trans"),
        ),
        ([Metrics(eta_pto=0.7), Metrics(), Metrics(eta_pto=0.6)], (1, 3, "eta_pto")),
    ],
)
def test_best_and_worst_are_the_cycles_of_the_highest_and_lowest_efficiency(
    cycles: list[Metrics], expected: tuple[int, int, str]
) -> None:
    clean = reduce(read_run(Path("fixtures/campaign/r36ohm.csv")))
    made = [replace(c, metrics=m) for c, m in zip(clean.cycles, cycles, strict=True)]
    best, worst, metric = replace(clean, cycles=tuple(made)).extremes or pytest.fail(
        "two cycles can be compared"
    )
    assert (best.cycle, worst.cycle, metric) == expected
    one = [replace(c, complete=c.cycle == best.cycle) for c in made]
    assert replace(clean, cycles=tuple(one)).extremes is None
