from pathlib import Path

import msgspec
import pytest

from winchcascade import read_run, reduce
from winchcascade.report.terminal import reduction_text

NARROW = 80
"""Columns of a terminal that nobody has widened."""


@pytest.mark.parametrize("name", ["r36ohm", "open_circuit", "r4p5ohm"])
def test_the_table_of_a_crane_trial_fits_a_narrow_terminal(fixtures: Path, name: str) -> None:
    text = reduction_text(reduce(read_run(fixtures / "campaign" / f"{name}.csv", campaign=False)))
    assert max(len(line) for line in text.splitlines()) <= NARROW


def test_an_incomplete_cycle_stands_in_brackets(fixtures: Path) -> None:
    text = reduction_text(reduce(read_run(fixtures / "damaged_logs" / "aborted.csv"), window=5.48))
    assert "\n(3)" in text
    assert "mean of 2" in text


def test_control_characters_of_a_log_do_not_reach_the_terminal(fixtures: Path) -> None:
    reduction = reduce(read_run(fixtures / "campaign" / "r36ohm.csv"))
    evil = msgspec.structs.replace(reduction, run=msgspec.structs.replace(reduction.run, name="a\x1b[31m\nb.csv"))
    assert "\x1b" not in reduction_text(evil)


def test_many_cycles_are_shown_by_their_first_and_last(fixtures: Path) -> None:
    reduction = reduce(read_run(fixtures / "campaign" / "r36ohm.csv"))
    many = tuple(msgspec.structs.replace(reduction.cycles[0], cycle=k) for k in range(1, 101))
    text = reduction_text(msgspec.structs.replace(reduction, cycles=many))
    assert "80 cycles more" in text
    assert "\n100 " in text
    assert "\n50 " not in text
