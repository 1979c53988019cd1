"""Properties of a reduction over all cycles: best and worst cycle, share of the time that was lost."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from winchcascade.core.run import CLOCK
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction


@pytest.fixture(scope="module")
def clean() -> Reduction:
    log = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
    return reduce(read_run(log, load=36.0), window=5.48)


def with_metrics(reduction: Reduction, *cycles: Metrics) -> Reduction:
    numbered = zip(reduction.cycles, cycles, strict=True)
    return msgspec.structs.replace(reduction, cycles=tuple(msgspec.structs.replace(c, metrics=m) for c, m in numbered))


@pytest.mark.parametrize(
    ("cycles", "expected"),
    [
        ([Metrics(eta_trans=1 - eta, eta_pto=eta) for eta in (0.70, 0.61, 0.65)], (1, 2, "eta_pto")),
        (
            [Metrics(eta_trans=eta, energy_line=e) for eta, e in ((0.7, 1.0), (0.8, 2.0), (0.9, 0.5))],
            (3, 1, "eta_trans"),
        ),
        ([Metrics(eta_pto=0.7), Metrics(), Metrics(eta_pto=0.6)], (1, 3, "eta_pto")),
    ],
)
def test_best_and_worst_are_the_cycles_of_the_highest_and_lowest_efficiency(
    clean: Reduction, cycles: list[Metrics], expected: tuple[int, int, str]
) -> None:
    best, worst, metric = with_metrics(clean, *cycles).extremes or pytest.fail("two cycles can be compared")
    assert (best.cycle, worst.cycle, metric) == expected
    made = with_metrics(clean, *cycles)
    lacking = [msgspec.structs.replace(c, complete=c.cycle == best.cycle) for c in made.cycles]
    assert msgspec.structs.replace(made, cycles=tuple(lacking)).extremes is None


HAND = [
    ({}, 0.0),
    ({"force": [(1.0, 2.0)]}, 0.96),  # from the last good sample to the first: 24 of 25 samples are missing
    ({"force": [(1.0, 2.0)], "torque": [(1.0, 2.0)]}, 0.96),
    ({"force": [(1.0, 2.0)], "torque": [(1.48, 3.0)]}, 1.96),
    ({"force": [(1.0, 3.0)], "torque": [(1.48, 2.0)]}, 1.96),
    ({CLOCK: [(1.0, 2.0), (5.0, 5.08)]}, 1.0),
    ({"vdc": [(5.0, 6.0)], "force": [(1.0, 2.0)]}, 1.92),
]
"""Gaps [s] of a log of 10 s at 25 Hz, and what is bridged by hand [s]."""


@pytest.mark.parametrize(("gaps", "seconds"), HAND)
def test_the_lost_share_counts_time_that_any_channel_lost_once(
    clean: Reduction, gaps: dict[str, list[tuple[float, float]]], seconds: float
) -> None:
    run = msgspec.structs.replace(
        clean.run, t=0.04 * np.arange(251), fs=25.0, gaps={name: np.array(spans) for name, spans in gaps.items()}
    )
    assert msgspec.structs.replace(clean, run=run).lost_share == pytest.approx(seconds / 10.0)
