"""A clock that is set forward while the line moves is mended by the displacement; rows that were
lost are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shipped_log import WINDOW, clean, row_after_onset, table, written

from winchcascade import read_run, reduce

HOUR = 3600.0


def stepped(seconds: float, k: int) -> np.ndarray:
    """The shipped log with a clock that is set forward before row k. [s]"""
    rows = table().copy()
    rows[k:, 0] += seconds
    return rows


@pytest.mark.parametrize("seconds", [1.0, 60.0, HOUR, 24.0 * HOUR])
@pytest.mark.parametrize("without", [None, "velocity"])
def test_a_step_of_the_clock_changes_no_energy(
    tmp_path: Path,
    seconds: float,
    without: str | None,
) -> None:
    run = written(tmp_path, stepped(seconds, row_after_onset(3.0)), without=without, load=36.0)
    clock = [f for f in run.findings if f.kind in ("clock_mismatch", "dropped_samples")]
    assert [f.kind for f in clock] == ["clock_mismatch"]
    assert clock[0].start == pytest.approx(table()[row_after_onset(3.0) - 1, 0])
    assert run.t == pytest.approx(table()[:, 0], abs=1e-6)
    assert run.gaps == {}
    undamaged = written(tmp_path, table(), without=without, load=36.0)
    found, true = (reduce(log, window=WINDOW["r36ohm"]).mean for log in (run, undamaged))
    assert found.energy_gen == pytest.approx(true.energy_gen, rel=1e-9)


def test_a_step_of_the_clock_is_left_in_place_without_repairs(tmp_path: Path) -> None:
    written(tmp_path, stepped(HOUR, row_after_onset(3.0)))
    run = read_run(tmp_path / "log.csv", load=36.0, repairs="off")
    assert float(run.t[-1] - run.t[0]) > HOUR
    found = [f for f in run.findings if f.kind == "clock_mismatch"]
    assert [f.repair is not None and f.repair.applied for f in found] == [False]


@pytest.mark.parametrize("lost", [8, 25, 100])
def test_rows_that_were_lost_in_motion_are_no_step(tmp_path: Path, lost: int) -> None:
    k = row_after_onset(3.0)
    run = written(tmp_path, np.delete(table(), slice(k, k + lost), axis=0), load=36.0)
    assert [(f.kind, f.count) for f in run.findings] == [("dropped_samples", lost)]


def test_a_pause_at_rest_does_not_show_whether_the_clock_was_set(tmp_path: Path) -> None:
    run = written(tmp_path, stepped(HOUR, row_after_onset(-2.0)), load=36.0)
    assert [f.kind for f in run.findings] == ["dropped_samples"]
    assert len(clean().cycles) == len(reduce(run, window=WINDOW["r36ohm"]).cycles)
