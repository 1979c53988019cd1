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
from winchcascade.core.rig_toml import built_in
from winchcascade.core.table_toml import load_table
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.reduction.uncertainty import budget
from winchcascade.tables.check import SAME_LOGS

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
TABLE = "hsu2026-table2"


@pytest.fixture(scope="module")
def results() -> Results:
    """The reductions of the shipped campaign, whose rig states sensors that are calibrated in place."""
    return campaign_results(make_plan([str(CAMPAIGN)]), 1)


def without_limits(record: dict[str, Any]) -> dict[str, Any]:
    """A result as it was stored before results held what the limits would leave."""
    del record["uncertainty"]["sensors_by_limits"]
    for cycle in record["cycles"]:
        del cycle["sensors_by_limits"]
    return record


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


def test_results_of_a_batch_count_what_they_hold(tmp_path: Path) -> None:
    out = tmp_path / "results"
    assert call("batch", CAMPAIGN, "--out", out, "--reports", "none").code == 0
    code, cells = checked(out)
    assert (code, {cell["tolerance"]["basis"] for cell in cells}) == (0, {"budget_and_limits"})
    stored = sorted((out / "runs").glob("*.json"))
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    for path in stored:
        (earlier / path.name).write_bytes(msgspec.json.encode(without_limits(json.loads(path.read_bytes()))))
    found = [checked(path) for path in sorted(earlier.glob("r*.json"))]
    assert {cell["tolerance"]["basis"] for _, cells in found for cell in cells} == {"budget"}
    assert sum(cell["outcome"] == "miss" for _, cells in found for cell in cells) == 5
