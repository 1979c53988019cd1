"""A log whose windows end soon after the run-up states its efficiencies over whole payouts too."""

from __future__ import annotations

from pathlib import Path

import pytest

from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.results.reduction import (
    WINDOW_EFFECT_MIN,
    payout_means,
    reduction_report,
)


def reduced(fixtures: Path, window: str | float) -> Reduction:
    run = read_run(fixtures / "campaign" / "r36ohm.csv", load=36.0)
    return reduce(run, window=window)


def test_efficiencies_beside_those_of_the_run_up_are_those_of_payout_windows(
    fixtures: Path,
) -> None:
    short, whole = reduced(fixtures, "auto"), reduced(fixtures, "payout")
    found = payout_means(short)
    for name in short.rig.cascade.ratios:
        differs = abs(whole.mean.value(name) - short.mean.value(name)) >= WINDOW_EFFECT_MIN
        assert (name in found) is differs, name
        assert not differs or found[name] == pytest.approx(whole.mean[name], abs=1e-6)
    assert "eta_gen" in found


def test_the_headline_states_both_windows_where_they_differ(fixtures: Path) -> None:
    short = reduced(fixtures, "auto")
    tiles = {tile.name: tile for tile in reduction_report(short).tiles}
    for name, eta in payout_means(short).items():
        assert f"{eta:.3f}" in tiles[name].beside


@pytest.mark.parametrize("window", ["payout", 5.48])
def test_a_window_that_was_chosen_stands_alone(fixtures: Path, window: str | float) -> None:
    assert payout_means(reduced(fixtures, window)) == {}
