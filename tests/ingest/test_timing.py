"""Velocity and displacement show a clock in another unit, rows that are missing from it, and a
counter that was set back.
"""

from pathlib import Path

import numpy as np
import pytest
from shipped_log import ENERGY, WINDOW, clean, column, row_after_onset, table, written

from winchcascade import Finding, Run, reduce

LOG = "r18ohm"
LOST = 0.02
"""A lost time is found within this: half a sampling interval. [s]"""


def only(run: Run) -> Finding:
    (finding,) = [f for f in run.findings if f.kind not in ("missing_channel", "derived_channel")]
    assert finding.kind == "clock_mismatch"
    return finding


@pytest.mark.parametrize("factor", [1000.0, 60.0, 1e-3])
def test_a_clock_in_another_unit_is_reported_with_the_factor(tmp_path: Path, factor: float) -> None:
    rows = table(LOG) * ([factor] + 7 * [1.0])
    finding = only(written(tmp_path, rows, load=18.0))
    assert float(finding.message.split()[3]) == pytest.approx(factor, rel=0.01)
    assert finding.removed == 0


def test_a_clock_that_counts_rows_is_reported(tmp_path: Path) -> None:
    rows = table(LOG).copy()
    rows[:, 0] = np.arange(len(rows))
    assert only(written(tmp_path, rows, load=18.0)).start is None


@pytest.mark.parametrize("factor", [25.0, 1000.0])
def test_long_intervals_without_a_displacement_are_reported(tmp_path: Path, factor: float) -> None:
    finding = only(
        written(tmp_path, table(LOG) * ([factor] + 7 * [1.0]), without="displacement", load=18.0)
    )
    assert finding.start is None


@pytest.mark.parametrize("without", [None, "velocity"])
@pytest.mark.parametrize(("seconds", "rows"), [(1.5, 5), (2.5, 20), (4.5, 3), (4.5, 60)])
def test_rows_lost_from_a_renumbered_clock_are_put_back_as_a_gap(
    tmp_path: Path, seconds: float, rows: int, without: str | None
) -> None:
    k = row_after_onset(seconds, LOG)
    left = np.delete(table(LOG), slice(k, k + rows), axis=0)
    left[:, 0] = table(LOG)[: len(left), 0]
    run = written(tmp_path, left, without=without, load=18.0)
    finding = only(run)
    assert finding.start == pytest.approx(table(LOG)[k - 1, 0])
    assert finding.end == pytest.approx(
        table(LOG)[k + rows, 0], abs=LOST if seconds > 4 else 4 * LOST
    )
    if without is None:
        cycle, true = (result.cycles[1] for result in (reduce(run, window=WINDOW[LOG]), clean(LOG)))
        assert cycle.complete == (rows < 20)
        if cycle.complete:
            assert cycle.metrics.energy_gen == pytest.approx(true.metrics.energy_gen, rel=ENERGY)


@pytest.mark.parametrize("without", [None, "velocity"])
@pytest.mark.parametrize("step", ["zero", "counts"])
def test_a_counter_that_is_set_back_within_a_payout_is_mended(
    tmp_path: Path, step: str, without: str | None
) -> None:
    rows, k = table(LOG).copy(), row_after_onset(3.0, LOG)
    rows[k:, column("displacement")] -= (
        rows[k, column("displacement")] if step == "zero" else 6.5536
    )
    run = written(tmp_path, rows, without=without, load=18.0)
    finding = only(run)
    assert finding.repair is not None
    assert run.channels["displacement"] == pytest.approx(
        table(LOG)[:, column("displacement")], abs=0.003
    )


def test_a_counter_set_at_rest_by_less_than_a_stroke_gives_no_finding(tmp_path: Path) -> None:
    rows = table(LOG).copy()
    rows[row_after_onset(-2.0, LOG) :, column("displacement")] += 0.1
    assert written(tmp_path, rows, load=18.0).findings == ()


@pytest.mark.parametrize("every", [2, 5, 10, 30])
def test_a_displacement_that_is_updated_rarely_has_no_jump(tmp_path: Path, every: int) -> None:
    rows = table(LOG).copy()
    rows[:, column("displacement")] = rows[
        np.arange(len(rows)) // every * every, column("displacement")
    ]
    assert [
        f for f in written(tmp_path, rows, load=18.0).findings if f.kind == "clock_mismatch"
    ] == []
