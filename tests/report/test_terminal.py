from pathlib import Path

import msgspec
import pytest

from winchcascade import read_run, reduce
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.reduction import reduction_report
from winchcascade.report.results.reduction_tables import LISTED_CYCLES
from winchcascade.report.screen import PIPE, Screen, use_screen

NARROW = 80
"""Columns of a terminal that nobody has widened."""


def printed(reduction: Reduction, width: int | None = None) -> str:
    use_screen(Screen(width))
    try:
        return terminal_text(reduction_report(reduction, uncertainty(reduction)))
    finally:
        use_screen(PIPE)


@pytest.mark.parametrize(
    "name", ["campaign/r36ohm", "campaign/open_circuit", "campaign/r4p5ohm", "damaged_logs/dropouts"]
)
def test_the_table_of_a_crane_trial_fits_a_narrow_terminal(fixtures: Path, name: str) -> None:
    reduction = reduce(read_run(fixtures / f"{name}.csv", campaign=False))
    lines = printed(reduction, NARROW).splitlines()
    assert max(map(len, lines)) <= NARROW
    value = reduction.mean.value("eta_trans")
    assert any(line.startswith("mean of 3 ") and f"{value:.3f}" in line for line in lines)


def test_an_incomplete_cycle_stands_in_brackets(fixtures: Path) -> None:
    text = printed(reduce(read_run(fixtures / "damaged_logs" / "aborted.csv"), window=5.48))
    assert "\n(3)" in text
    assert "mean of 2" in text


def test_control_characters_of_a_log_do_not_reach_the_terminal(fixtures: Path) -> None:
    reduction = reduce(read_run(fixtures / "campaign" / "r36ohm.csv"))
    evil = msgspec.structs.replace(reduction, run=msgspec.structs.replace(reduction.run, name="a\x1b[31m\nb.csv"))
    assert "\x1b" not in printed(evil)


def test_many_cycles_are_shown_by_their_first_and_last(fixtures: Path) -> None:
    reduction = reduce(read_run(fixtures / "campaign" / "r36ohm.csv"))
    many = tuple(msgspec.structs.replace(reduction.cycles[0], cycle=k) for k in range(1, 101))
    text = printed(msgspec.structs.replace(reduction, cycles=many))
    assert f"... {100 - LISTED_CYCLES} more" in text
    assert "\n100 " in text
    assert "\n50 " not in text
