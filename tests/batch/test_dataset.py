"""The dataset: what other programs read of it is what the JSON files say."""

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import duckdb
import openpyxl
import pytest
from pyarrow import dataset, parquet

from winchcascade.batch.dataset import SCHEMA, TABLES
from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.core.cascade import BUILT_IN, Cascade
from winchcascade.report.frames import RUNS_MAX, table_schema

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
FORMULA = "=SUM(A1)"
ARRAY = "{=SUM(A1:A2)}"

Rows = list[dict[str, Any]]


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trial")
    for name in ("open_circuit.csv", "r9ohm.csv"):
        shutil.copy(CAMPAIGN / name, folder)
    shutil.copy(CAMPAIGN.parent / "damaged_logs" / "dropouts.csv", folder / f"{FORMULA}.csv")
    (folder / "rig.toml").write_text(f'based_on = "hsu2026"\nname = "{ARRAY}"\n')
    (folder / "header_only.csv").write_text(
        CAMPAIGN.joinpath("r9ohm.csv").read_text().splitlines()[0] + "\n"
    )
    loads = {
        "open_circuit.csv": "inf",
        "r9ohm.csv": "9.0",
        f"{FORMULA}.csv": "36.0",
        "header_only.csv": "1.0",
    }
    runs = "".join(f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n' for name, load in loads.items())
    (folder / "campaign.toml").write_text('rig = "rig.toml"\n' + runs)
    found = run_batch(make_plan([str(folder)]), folder / "out", Products(workbook=True))
    assert list(found.faults) == ["header_only.csv"]
    return folder / "out"


@pytest.fixture(scope="module")
def records(out: Path) -> dict[str, dict[str, Any]]:
    """The JSON of each log by its name, in the order of the campaign."""
    runs = json.loads((out / "campaign.json").read_bytes())["runs"]
    return {
        run["name"]: json.loads((out / run["result"]).read_bytes())
        for run in runs
        if run["fault"] is None
    }


def by_pyarrow(path: Path) -> Rows:
    return list(dataset.dataset(path).to_table().to_pylist())


def by_duckdb(path: Path) -> Rows:
    found = duckdb.from_parquet(str(path))
    return [dict(zip(found.columns, row, strict=True)) for row in found.fetchall()]


def by_pandas(path: Path) -> Rows:
    pandas = pytest.importorskip("pandas")
    rows: Rows = (
        pandas.read_parquet(path, dtype_backend="pyarrow").astype(object).to_dict("records")
    )
    return [
        {name: None if value is pandas.NA else value for name, value in row.items()} for row in rows
    ]


READERS: list[Callable[[Path], Rows]] = [by_pyarrow, by_duckdb, by_pandas]


@pytest.mark.parametrize("read", READERS)
def test_every_reader_sees_the_means_of_every_log(
    out: Path, records: dict[str, dict[str, Any]], read: Callable[[Path], Rows]
) -> None:
    rows = {row["run"]: row for row in read(out / "dataset" / "runs_all.parquet")}
    assert list(rows) == list(records)
    for name, record in records.items():
        row = rows[name]
        assert row["log"] == record["log"]["path"]
        assert (row["samples"], row["cycles"]) == (record["log"]["samples"], len(record["cycles"]))
        assert row["complete"] == sum(cycle["complete"] for cycle in record["cycles"])
        assert row["findings"] == len(record["quality"])
        for metric, value in record["mean"].items():
            assert row[metric] == value
            assert row[f"{metric}_standard_uncertainty"] == record["standard_uncertainty"][metric]
            assert row[f"{metric}_max_deviation_percent"] == record["max_deviation_percent"][metric]
            interval = record["interval_95"][metric] or [None, None]
            assert [row[f"{metric}_low_95"], row[f"{metric}_high_95"]] == interval


def test_the_table_of_runs_is_a_part_of_all_columns(out: Path) -> None:
    brief, whole = (
        by_pyarrow(out / "dataset" / f"{table}.parquet") for table in ("runs", "runs_all")
    )
    assert len(brief[0]) == RUNS_MAX
    assert {
        "load_ohm",
        "eta_pto",
        "eta_pto_standard_uncertainty",
        "power_gen_w",
        "findings",
    } <= brief[0].keys()
    assert brief == [{name: row[name] for name in brief[0]} for row in whole]


@pytest.mark.parametrize("stages", range(1, len(BUILT_IN) + 1))
def test_the_table_of_runs_begins_with_the_efficiencies_of_any_cascade(stages: int) -> None:
    cascade = Cascade(tuple(BUILT_IN.values())[:stages], configured=True)
    names = table_schema("runs", cascades=[cascade]).names
    assert len(names) <= RUNS_MAX
    assert {*cascade.pairs, *(f"{eta}_standard_uncertainty" for eta in cascade.pairs)} <= {*names}


@pytest.mark.parametrize("read", READERS)
def test_every_reader_sees_every_cycle_bin_and_finding(
    out: Path, records: dict[str, dict[str, Any]], read: Callable[[Path], Rows]
) -> None:
    for table, key in (("cycles", "cycles"), ("bins", "bins"), ("findings", "quality")):
        expected = [(name, item) for name, record in records.items() for item in record[key]]
        rows = read(out / "dataset" / f"{table}.parquet")
        assert len(rows) == len(expected) > 0
        for row, (name, item) in zip(rows, expected, strict=True):
            assert row["run"] == name
            assert all(row[k] == v for k, v in item.items() if k in row)
            assert sum(k in row for k in item) >= 8


def test_phases_of_a_cycle_are_columns(out: Path, records: dict[str, dict[str, Any]]) -> None:
    cycles = [cycle for record in records.values() for cycle in record["cycles"]]
    for row, cycle in zip(by_pyarrow(out / "dataset" / "cycles.parquet"), cycles, strict=True):
        for phase, span in cycle["phases"].items():
            assert [row[f"{phase}_begin_s"], row[f"{phase}_end_s"]] == (span or [None, None])
        assert [row["onset_s"], row["cutoff_s"]] == [
            cycle["window"][f"{end}_s"] for end in ("onset", "cutoff")
        ]
        plateau = cycle["phase_summary"]["payout"]["plateau"] or {}
        assert all(row[f"plateau_{name}"] == value for name, value in plateau.items())


@pytest.mark.parametrize("table", TABLES)
def test_an_open_circuit_is_an_infinite_load(out: Path, table: str) -> None:
    loads = {
        row["run"]: row["load_ohm"] for row in by_pyarrow(out / "dataset" / f"{table}.parquet")
    }
    assert loads.get("open_circuit.csv", math.inf) == math.inf
    assert loads.get("r9ohm.csv", 9.0) == 9.0


def test_readers_can_ask_for_what_they_want(out: Path) -> None:
    path = out / "dataset" / "cycles.parquet"
    found = (
        duckdb.from_parquet(str(path))
        .filter("load_ohm = 9 AND complete")
        .aggregate("count(*)")
        .fetchall()
    )
    assert found == [(3,)]
    assert dataset.dataset(path).count_rows(filter=dataset.field("load_ohm") == math.inf) == 3


@pytest.mark.parametrize("table", TABLES)
def test_a_table_says_its_schema(out: Path, table: str) -> None:
    assert (
        parquet.read_schema(out / "dataset" / f"{table}.parquet").metadata[b"schema"].decode()
        == SCHEMA
    )


def test_the_workbook_has_the_same_rows(out: Path) -> None:
    book = openpyxl.load_workbook(out / "campaign.xlsx")
    assert tuple(book.sheetnames) == TABLES
    for table in TABLES:
        head, units, *rows = book[table].values
        assert len(units) == len(head)
        expected = by_pyarrow(out / "dataset" / f"{table}.parquet")
        if table == "runs":
            expected.sort(key=lambda row: float(row["load_ohm"]))
        assert list(head) == list(expected[0])
        assert len(rows) == len(expected)
        for row, known in zip(rows, expected, strict=True):
            for cell, value in zip(row, known.values(), strict=True):
                if value == math.inf:
                    assert cell == "inf"
                elif isinstance(value, float):
                    assert cell == pytest.approx(value, rel=SPREADSHEET)
                else:
                    assert cell == (f"'{value}" if value == f"{FORMULA}.csv" else value)


def test_the_workbook_begins_with_the_runs_by_load_and_a_chart(out: Path) -> None:
    sheet = openpyxl.load_workbook(out / "campaign.xlsx").worksheets[0]
    head, units, *rows = sheet.values
    assert sheet.title == "runs"
    assert sheet.freeze_panes == "B3"
    unit = dict(zip(head, units, strict=True))
    assert (unit["load_ohm"], unit["energy_line_j"], unit["power_gen_w"], unit["eta_pto"]) == (
        "ohm",
        "J",
        "W",
        "1",
    )
    loads = [row[head.index("load_ohm")] for row in rows if row[0] is not None]
    known = [load for load in loads if isinstance(load, int | float)]
    assert known == sorted(known)
    assert loads[: len(known)] == known  # an open circuit and an unknown load come last
    (chart,) = sheet._charts
    assert len(chart.series) == sum(
        str(name).startswith("eta_") and not str(name).endswith(("uncertainty", "percent"))
        for name in head
    )
    formats = {head[k]: cell.number_format for k, cell in enumerate(sheet[3])}
    assert formats["eta_pto"] == "0.0000"
    assert formats["energy_line_j"] == "0.0"


SPREADSHEET = 1e-14
"""Digits that a workbook keeps of a number."""


def test_a_text_that_looks_like_a_formula_is_a_text_also_where_its_cell_is_copied(
    out: Path,
) -> None:
    sheet = openpyxl.load_workbook(out / "campaign.xlsx")["runs"]
    head = [cell.value for cell in sheet[1]]
    (row,) = (row for row in sheet.iter_rows(min_row=3) if row[0].value == f"'{FORMULA}.csv")
    for cell in (row[0], row[head.index("rig")]):
        assert cell.data_type == "s"
    assert row[head.index("rig")].value == ARRAY
    texts = [cell.value for row in sheet.iter_rows() for cell in row if isinstance(cell.value, str)]
    assert not [text for text in texts if text[0] in "=+-@"]
