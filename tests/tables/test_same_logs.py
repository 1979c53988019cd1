"""A table against the logs that it was made from: rounding alone is allowed, and the scatter of cycles never counts twice."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import pytest
from calls import call
from msgspec.structs import replace

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import Results, campaign_results, check_results
from winchcascade.core.published_table import PrintedColumn, PublishedTable, TableRow
from winchcascade.reduction.efficiency import FIELDS, METRICS
from winchcascade.tables.check import SAME_LOGS

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
COLUMNS = {
    m: PrintedColumn("1", 3) if m.startswith("eta") else PrintedColumn("J" if m.startswith("energy") else "W", 0)
    for m in METRICS
}
LOADED = (45.0, 36.0, 27.0, 18.0, 9.0, 4.5)


@pytest.fixture(scope="module")
def results() -> Results:
    """The reductions of the shipped campaign."""
    return campaign_results(make_plan([str(CAMPAIGN)]), 1)


@pytest.fixture(scope="module")
def table(results: Results) -> PublishedTable:
    """What these logs give, as a paper prints it."""
    rows = {record.log.load_ohm: record.mean for _, record in results.records}
    printed = (
        TableRow(load, {m: round(rows[load][FIELDS[m]] or 0.0, column.decimals) for m, column in COLUMNS.items()})
        for load in LOADED
    )
    return PublishedTable("ours", "ours", "ours", COLUMNS, tuple(printed))


def changed(table: PublishedTable, load: float, metric: str, value: float) -> PublishedTable:
    rows = (replace(r, cells={**r.cells, metric: value}) if r.load == load else r for r in table.rows)
    return replace(table, rows=tuple(rows))


def test_the_table_of_these_logs_agrees_with_them(results: Results, table: PublishedTable) -> None:
    found = check_results(results, table, SAME_LOGS)
    assert (len(found.cells), found.misses) == (54, ())
    assert {cell.tolerance for cell in found.cells} == {0.5, 0.0005}


@pytest.mark.parametrize("share", [0.95, 1.05])
def test_every_energy_and_power_that_deviates_by_5_percent_is_found(
    results: Results, table: PublishedTable, share: float
) -> None:
    cells = [(row.load, m) for row in table.rows for m in METRICS if not m.startswith("eta")]
    found = []
    for load, metric in cells:
        printed = next(row.cells[metric] for row in table.rows if row.load == load)
        misses = check_results(results, changed(table, load, metric, round(share * printed)), SAME_LOGS).misses
        found += [(cell.load, cell.metric) for cell in misses]
    assert len(cells) == 36
    assert found == cells


def file_of(table: PublishedTable, folder: Path) -> Path:
    """Write a table by load."""
    head = [f'{m} = {{ unit = "{column.unit}", decimals = {column.decimals} }}' for m, column in COLUMNS.items()]
    rows = [
        "\n".join(["[[row]]", f"load_ohm = {row.load}", *(f"{m} = {value:g}" for m, value in row.cells.items())])
        for row in table.rows
    ]
    path = folder / "ours.toml"
    path.write_text("\n".join(['title = "ours"', 'source = "ours"', "[columns]", *head, *rows, ""]))
    return path


def test_two_digits_that_were_exchanged_are_found_by_the_option_alone(table: PublishedTable, tmp_path: Path) -> None:
    wrong = file_of(changed(table, 36.0, "energy_gen", 4659.0), tmp_path)
    called = call("check", CAMPAIGN, "--against", wrong, "--same-logs", "--json", "-")
    record = json.loads(called.out)
    (miss,) = [cell for cell in record["cells"] if cell["outcome"] == "miss"]
    assert (called.code, miss["load_ohm"], miss["metric"], miss["printed"]) == (1, 36.0, "energy_gen", 4659.0)
    assert miss["tolerance"]["total"] == miss["tolerance"]["rounding"] == 0.5
    assert record["factors"] == {"rounding": 1.0, "deviation": 0.0, "uncertainty": 0.0, "means": 0.0}


def test_the_option_takes_no_other_tolerance_beside_it(table: PublishedTable, tmp_path: Path) -> None:
    path = file_of(table, tmp_path)
    called = call("check", CAMPAIGN, "--against", path, "--same-logs", "--tolerance", "uncertainty=2")
    assert (called.code, called.out) == (2, "")
    assert "--same-logs" in called.err


def test_the_scatter_of_the_cycles_counts_once(results: Results, table: PublishedTable) -> None:
    """The cycles at 18 ohm deviate by 8 %, and that explains no mean that deviates by 15 %."""
    record = dict(results.records)["r18ohm.csv"]
    known = record.uncertainty
    percent, u, limits = (
        x["energy_line_j"] or 0.0 for x in (record.max_deviation_percent, known.sensors, known.sensors_by_limits)
    )
    found = check_results(results, changed(table, 18.0, "energy_line", 13500.0))
    (miss,) = found.misses
    assert (miss.load, miss.metric) == (18.0, "energy_line")
    assert miss.deviation == pytest.approx(0.01 * percent * (miss.measured or 0.0))
    assert miss.uncertainty == pytest.approx(2.0 * math.hypot(u, limits))


def test_a_point_table_of_the_same_logs_is_allowed_no_tolerance_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "points.toml").write_text(
        'title = "T"\nsource = "S"\nkey = "load_ohm"\ntolerance_percent = 5\n[columns]\nload_ohm = { unit = "ohm" }\n'
        'energy_gen = { unit = "J" }\n[[point]]\nload_ohm = 36\nenergy_gen = 4956\n[[point]]\nload_ohm = 9\n'
        "energy_gen = 5409\n"
    )
    called = call("check", CAMPAIGN, "--against", tmp_path / "points.toml", "--same-logs", "--json", "-")
    cells = json.loads(called.out)["cells"]
    assert called.code == 1
    assert [(cell["outcome"], cell["tolerance"]["total"]) for cell in cells] == [("ok", 0.5), ("miss", 0.5)]


@pytest.mark.parametrize("option", ["--junit", "--json"])
def test_a_check_beside_its_logs_can_be_repeated(table: PublishedTable, tmp_path: Path, option: str) -> None:
    shutil.copytree(CAMPAIGN, tmp_path, dirs_exist_ok=True)
    arguments = (
        "check",
        tmp_path,
        "--against",
        file_of(table, tmp_path),
        "--same-logs",
        option,
        tmp_path / "check.out",
    )
    assert [call(*arguments).code for _ in range(2)] == [0, 0]


def test_a_comparison_beside_its_logs_can_be_repeated_and_replaces_no_log(tmp_path: Path) -> None:
    log = Path(shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path))
    before = log.read_bytes()
    assert [call("compare", log, log, "--json", tmp_path / "it.json").code for _ in range(2)] == [0, 0]
    assert call("compare", log, log, "--json", log, "--force").code == 2
    assert log.read_bytes() == before


def test_no_result_replaces_a_log_that_a_campaign_lists_in_another_folder(
    table: PublishedTable, tmp_path: Path
) -> None:
    (tmp_path / "logs").mkdir()
    log = Path(shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path / "logs"))
    (tmp_path / "campaign.toml").write_text('[[run]]\nfile = "logs/r36ohm.csv"\nload_ohm = 36\nwindow_s = 5.48\n')
    before = log.read_bytes()
    path = file_of(table, tmp_path)
    assert call("check", tmp_path, "--against", path, "--json", log, "--force").code == 2
    assert log.read_bytes() == before
