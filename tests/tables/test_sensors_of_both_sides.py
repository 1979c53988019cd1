"""What a check counts of sensors that are calibrated in place: their budget for the logs, and their limits for the table."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from calls import call
from rigs import by_limits

from winchcascade import read_run, reduce
from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import Results, campaign_results, check_results
from winchcascade.core.published_table import load_table
from winchcascade.core.rig_toml import built_in
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.reduction.run_record import RunRecord, run_record
from winchcascade.reduction.uncertainty import budget
from winchcascade.tables.check import SAME_LOGS

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
TABLE = "hsu2026-table2"


@pytest.fixture(scope="module")
def results() -> Results:
    """The reductions of the shipped campaign, whose rig states sensors that are calibrated in place."""
    return campaign_results(make_plan([str(CAMPAIGN)]), 1)


def as_stored_earlier(record: RunRecord) -> RunRecord:
    """A result as it was stored before results held what the limits would leave."""
    fields = json.loads(msgspec.json.encode(record))
    del fields["uncertainty"]["sensors_by_limits"]
    for cycle in fields["cycles"]:
        del cycle["sensors_by_limits"]
    return run_record(json.dumps(fields).encode(), record.log.path)


def checked(*arguments: str | Path) -> tuple[int, list[dict[str, Any]]]:
    """Exit code and cells of a check."""
    called = call("check", *arguments, "--against", TABLE, "--json", "-")
    cells: list[dict[str, Any]] = json.loads(called.out)["cells"]
    return called.code, cells


def test_the_limits_are_the_budget_of_the_same_sensors_without_their_calibration(results: Results) -> None:
    record = dict(results.records)["r36ohm.csv"]
    bare = budget(reduce(read_run(CAMPAIGN / "r36ohm.csv", load=36.0), rig=by_limits(built_in()), window=5.48))
    compared = 0
    for metric, u in bare.sensors.items():
        assert record.uncertainty.sensors_by_limits[FIELDS[metric]] == pytest.approx(u, rel=0.01)
        compared += bool(u)
    for cycle, of in zip(record.cycles, bare.cycles, strict=True):
        for metric, u in of.items():
            assert cycle.sensors_by_limits[FIELDS[metric]] == pytest.approx(u, rel=0.01)
    assert compared >= 9
    assert (bare.by_limits, set(map(len, bare.cycles_by_limits))) == ({}, {0})


def test_budget_and_limits_count_in_squares(results: Results) -> None:
    found, records = check_results(results, load_table(TABLE)), {r.log.load_ohm: r for _, r in results.records}
    assert (len(found.cells), found.misses) == (54, ())
    for cell in found.cells:
        parts = records[cell.load].uncertainty
        own, limits = (of[FIELDS[cell.metric]] or 0.0 for of in (parts.sensors, parts.sensors_by_limits))
        assert 0.0 < own < limits
        assert cell.basis == "budget_and_limits"
        assert cell.uncertainty == pytest.approx(2.0 * math.hypot(own, limits))
    alike = check_results(results, load_table(TABLE), SAME_LOGS)
    assert {(cell.basis, cell.uncertainty) for cell in alike.cells} == {("none", 0.0)}


def test_sensors_of_which_limits_alone_are_known_count_once(tmp_path: Path) -> None:
    rig = CAMPAIGN.parents[1] / "winchcascade" / "rigfiles" / "hsu2026.toml"
    text = "".join(
        line for line in rig.read_text().splitlines(keepends=True) if not line.startswith(("u_zero", "u_gain"))
    )
    (tmp_path / "rig.toml").write_text(text)
    (tmp_path / "campaign.toml").write_text(
        f'rig = "rig.toml"\n[[run]]\nfile = "{CAMPAIGN / "r36ohm.csv"}"\nload_ohm = 36\nwindow_s = 5.48\n'
    )
    ((_, record),) = campaign_results(make_plan([str(tmp_path)]), 1).records
    code, cells = checked(tmp_path)
    given = [cell for cell in cells if cell["measured"] is not None]
    assert (code, len(given)) == (1, 9)
    for cell in given:
        assert (cell["outcome"], cell["tolerance"]["basis"], cell["tolerance"]["limits"]) == ("ok", "budget", 0.0)
        assert cell["tolerance"]["uncertainty"] == pytest.approx(
            2.0 * (record.uncertainty.sensors[FIELDS[cell["metric"]]] or 0.0)
        )


def test_results_of_a_batch_hold_what_a_check_counts(tmp_path: Path) -> None:
    assert call("batch", CAMPAIGN, "--out", tmp_path / "results", "--reports", "none").code == 0
    code, cells = checked(tmp_path / "results")
    assert (code, {cell["tolerance"]["basis"] for cell in cells}) == (0, {"budget_and_limits"})


def test_results_that_do_not_hold_the_limits_are_compared_by_their_budget(results: Results) -> None:
    earlier = tuple((name, as_stored_earlier(record)) for name, record in results.records)
    found = check_results(msgspec.structs.replace(results, records=earlier), load_table(TABLE))
    assert {cell.basis for cell in found.cells} == {"budget"}
    known = {record.log.load_ohm: record.uncertainty.sensors for _, record in results.records}
    for cell in found.cells:
        assert cell.uncertainty == pytest.approx(2.0 * (known[cell.load][FIELDS[cell.metric]] or 0.0))
