"""Velocity and displacement show a clock in another unit, rows that are missing from it, and a counter that was set back."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import SENSORS

from winchcascade import Finding, Reduction, Run, read_run, reduce

Signal = NDArray[np.float64]

SOURCE = Path(__file__).parents[2] / "fixtures" / "campaign" / "r18ohm.csv"
WINDOW = 5.96
HEADERS = ["Time (s)", *(sensor.header for sensor in SENSORS.values())]
DISPLACEMENT, VELOCITY = 1, 2
LOST = 0.02
"""A lost time is found within this: half a sampling interval. [s]"""
ENERGY = 0.005


@cache
def table() -> Signal:
    return np.loadtxt(SOURCE, delimiter=",", skiprows=1)


@cache
def clean() -> Reduction:
    return reduce(read_run(SOURCE), window=WINDOW)


def written(folder: Path, rows: Signal, without: int | None = None, headers: list[str] = HEADERS) -> Run:
    path = folder / "log.csv"
    keep = [k for k in range(8) if k != without]
    np.savetxt(path, rows[:, keep], "%.9g", ",", header=",".join(headers[k] for k in keep), comments="")
    return read_run(path, load=18.0)


def only(run: Run) -> Finding:
    (finding,) = [f for f in run.findings if f.kind != "missing_channel"]
    assert finding.kind == "clock_mismatch"
    return finding


def second_payout(seconds: float) -> int:
    return int(np.searchsorted(table()[:, 0], clean().cycles[1].window.onset + seconds))


@pytest.mark.parametrize(
    ("factor", "words"), [(1000.0, "1000. times"), (60.0, "60.00 times"), (1e-3, "0.001000 times")]
)
def test_a_clock_in_another_unit_is_reported_with_every_reading(tmp_path: Path, factor: float, words: str) -> None:
    rows = table() * ([factor] + 7 * [1.0])
    finding = only(written(tmp_path, rows))
    assert words in finding.message
    assert (
        f"the true interval may be {rows[1, 0] / factor:.4g} s, or one of velocity and displacement" in finding.message
    )
    assert finding.action == "reported and kept"


def test_a_clock_that_counts_rows_is_reported(tmp_path: Path) -> None:
    rows = table().copy()
    rows[:, 0] = np.arange(len(rows))
    assert "stamps may count rows" in only(written(tmp_path, rows)).message


@pytest.mark.parametrize("factor", [25.0, 1000.0])
def test_long_intervals_without_a_displacement_are_reported(tmp_path: Path, factor: float) -> None:
    finding = only(written(tmp_path, table() * ([factor] + 7 * [1.0]), without=DISPLACEMENT))
    assert "no other channel confirms the clock" in finding.message


@pytest.mark.parametrize("without", [None, VELOCITY])
@pytest.mark.parametrize(("seconds", "rows"), [(1.5, 5), (2.5, 20), (4.5, 3), (4.5, 60)])
def test_rows_lost_from_a_renumbered_clock_are_put_back_as_a_gap(
    tmp_path: Path, seconds: float, rows: int, without: int | None
) -> None:
    k = second_payout(seconds)
    left = np.delete(table(), slice(k, k + rows), axis=0)
    left[:, 0] = table()[: len(left), 0]
    run = written(tmp_path, left, without)
    finding = only(run)
    assert finding.action == "treated as a gap of that length"
    assert finding.start == pytest.approx(table()[k - 1, 0])
    assert finding.end == pytest.approx(table()[k + rows, 0], abs=LOST if seconds > 4 else 4 * LOST)
    if without is None:
        cycle, true = (result.cycles[1] for result in (reduce(run, window=WINDOW), clean()))
        assert cycle.complete == (rows < 20)
        if cycle.complete:
            assert cycle.metrics.energy_gen == pytest.approx(true.metrics.energy_gen, rel=ENERGY)


@pytest.mark.parametrize("without", [None, VELOCITY])
@pytest.mark.parametrize("step", ["zero", "counts"])
def test_a_counter_that_is_set_back_within_a_payout_is_mended(tmp_path: Path, step: str, without: int | None) -> None:
    rows, k = table().copy(), second_payout(3.0)
    rows[k:, DISPLACEMENT] -= rows[k, DISPLACEMENT] if step == "zero" else 6.5536
    run = written(tmp_path, rows, without)
    finding = only(run)
    assert "the counter was set back" in finding.message
    assert finding.action == "step removed from the displacement"
    assert run.channels["displacement"] == pytest.approx(table()[:, DISPLACEMENT], abs=0.003)


def test_rows_that_were_written_twice_are_reported(tmp_path: Path) -> None:
    k = second_payout(3.0)
    rows = np.insert(table(), k, table()[k - 40 : k], axis=0)
    rows[:, 0] = 0.04 * np.arange(len(rows))
    assert "or 40 rows were written twice" in only(written(tmp_path, rows)).message


def test_a_counter_set_at_rest_by_less_than_a_stroke_gives_no_finding(tmp_path: Path) -> None:
    rows = table().copy()
    rows[second_payout(-2.0) :, DISPLACEMENT] += 0.1
    assert written(tmp_path, rows).findings == ()


@pytest.mark.parametrize("every", [2, 5, 10, 30])
def test_a_displacement_that_is_updated_rarely_has_no_jump(tmp_path: Path, every: int) -> None:
    rows = table().copy()
    rows[:, DISPLACEMENT] = rows[np.arange(len(rows)) // every * every, DISPLACEMENT]
    assert [f for f in written(tmp_path, rows).findings if f.kind == "clock_mismatch"] == []


@pytest.mark.parametrize("window", [0.01, 0.079])
def test_a_window_shorter_than_two_samples_makes_its_cycle_incomplete(window: float) -> None:
    result = reduce(read_run(SOURCE), window=window)
    assert not result.complete
    assert "is shorter than two samples, which are 0.04 s apart" in result.quality[0].message
