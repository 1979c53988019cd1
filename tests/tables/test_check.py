import json
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from winchcascade import read_run, reduce, uncertainty
from winchcascade.core.errors import OptionError
from winchcascade.core.published_table import PrintedColumn, PublishedTable, TableRow, load_table
from winchcascade.reduction.efficiency import FIELDS, METRICS
from winchcascade.reduction.run_record import reduction_json, run_record
from winchcascade.tables.check import Check, CheckError, Factors, Measured, check, measured_from_record

LOADS = (45.0, 18.0, math.inf)
DECIMALS = {"energy": ("kJ", 3, 1e3), "power": ("W", 0, 1.0), "eta": ("%", 1, 0.01)}
COLUMNS = {metric: PrintedColumn(*DECIMALS[metric.partition("_")[0]]) for metric in METRICS}
JUST = 1e-3
"""Share of the tolerance by which a value is put inside or outside of it."""


def random_table(seed: int) -> PublishedTable:
    rng = np.random.default_rng(seed)
    rows = tuple(
        TableRow(load, {m: round(float(rng.uniform(20.0, 900.0)), column.decimals) for m, column in COLUMNS.items()})
        for load in LOADS
    )
    return PublishedTable("random", "random", "none", COLUMNS, rows)


def exact_results(table: PublishedTable, seed: int = 0) -> list[Measured]:
    """Results that are what the table prints, with a deviation and an uncertainty of each metric."""
    rng = np.random.default_rng(seed)
    results = []
    for row in table.rows:
        si = {m: printed * table.columns[m].factor for m, printed in row.cells.items()}
        deviation: dict[str, float | None] = {m: float(rng.uniform(0.0, 20.0)) for m in METRICS}
        doubt: dict[str, float | None] = {m: value * float(rng.uniform(0.0, 0.05)) for m, value in si.items()}
        results.append(Measured(f"log {row.load:g}", row.load, dict(si), deviation, doubt))
    return results


def moved(results: list[Measured], table: PublishedTable, k: int, metric: str, share: float) -> list[Measured]:
    """One value moved by a share of its own tolerance: m - p = share (h + d m + 2 u), solved for m."""
    result, column = results[k], table.columns[metric]
    deviation, doubt = result.deviation[metric] or 0.0, result.uncertainty[metric] or 0.0
    fixed = column.rounding * column.factor + 2.0 * doubt
    printed = table.rows[k].cells[metric] * column.factor
    value = (printed + share * fixed) / (1.0 - share * deviation / 100.0)
    changed = msgspec.structs.replace(result, mean={**result.mean, metric: value})
    return [*results[:k], changed, *results[k + 1 :]]


@pytest.mark.parametrize("seed", range(3))
def test_any_single_cell_beyond_its_tolerance_fails_and_within_it_passes(seed: int) -> None:
    table = random_table(seed)
    results = exact_results(table, seed)
    assert check(results, table).ok
    for k in range(len(table.rows)):
        for metric in METRICS:
            for sign in (-1.0, 1.0):
                assert check(moved(results, table, k, metric, sign * (1.0 - JUST)), table).ok
                beyond = check(moved(results, table, k, metric, sign * (1.0 + JUST)), table)
                assert [(cell.load, cell.metric) for cell in beyond.misses] == [(LOADS[k], metric)]


@pytest.mark.parametrize("part", ["rounding", "deviation", "uncertainty"])
def test_a_factor_widens_and_narrows_its_part_alone(part: str) -> None:
    table = random_table(0)
    plain, wide = check(exact_results(table), table), check(exact_results(table), table, Factors(**{part: 3.0}))
    for one, other in zip(plain.cells, wide.cells, strict=True):
        for name in ("rounding", "deviation", "uncertainty"):
            assert getattr(other, name) == pytest.approx((3.0 if name == part else 1.0) * getattr(one, name))
        assert other.tolerance == other.rounding + other.deviation + other.uncertainty


@pytest.mark.parametrize("metric", ["energy_gen", "eta_gen"])
def test_the_deviation_counts_up_to_what_the_table_prints(metric: str) -> None:
    """One cycle of three is damaged: its deviation may not widen the tolerance beyond the table's claim."""
    table = load_table("hsu2026-table2")
    printed = table.rows[1].cells[metric]
    claim = {"energy_gen": 18.5, "eta_gen": 2.55}[metric]
    cells = {}
    for deviation in (claim, 4 * claim):
        log = Measured("log", 36.0, {metric: printed}, {metric: deviation}, {metric: 0.004 * printed})
        found = check([log], table, whole_campaign=False)
        cells[deviation] = next(cell for cell in found.cells if cell.metric == metric)
        capped = [note for note in found.notes if "its cycles deviate by more than" in note]
        assert len(capped) == (deviation > claim)
        assert all(f"{metric} {deviation:.3g} %" in note for note in capped)
    within, beyond = cells.values()
    assert beyond.deviation == pytest.approx(within.deviation)
    assert beyond.uncertainty == pytest.approx(within.uncertainty)


def test_a_table_that_prints_no_deviation_caps_none() -> None:
    table = random_table(0)
    results = exact_results(table)
    wide = msgspec.structs.replace(results[0], deviation=dict.fromkeys(METRICS, 80.0))
    found = check([wide, *results[1:]], table)
    assert found.notes == ()
    assert all(cell.deviation == pytest.approx(0.8 * cell.printed) for cell in found.cells if cell.load == 45.0)


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_factor_that_is_no_number_from_zero_up_is_reported(value: float) -> None:
    with pytest.raises(OptionError, match=r"tolerance factor deviation is .*; expected a finite number"):
        Factors(deviation=value)


def test_the_parts_of_a_tolerance_are_in_the_printed_unit() -> None:
    table = PublishedTable(
        "t", "t", "s", {"energy_line": PrintedColumn("kJ", 1, 1e3)}, (TableRow(18.0, {"energy_line": 11.7}),)
    )
    result = Measured("log", 18.0, {"energy_line": 12000.0}, {"energy_line": 5.0}, {"energy_line": 60.0})
    (cell,) = check([result], table).cells
    assert (cell.measured, cell.rounding, cell.deviation, cell.uncertainty) == pytest.approx((12.0, 0.05, 0.6, 0.12))
    assert cell.difference == pytest.approx(0.3)
    assert cell.missed_by == 0.0


def test_a_metric_that_was_not_measured_fails_by_name() -> None:
    table = random_table(1)
    results = exact_results(table)
    results[1] = msgspec.structs.replace(results[1], mean={**results[1].mean, "energy_gen": None})
    (miss,) = check(results, table).misses
    assert (miss.load, miss.metric, miss.outcome, miss.log) == (18.0, "energy_gen", "not_measured", "log 18")


def test_a_single_cycle_has_no_deviation_which_counts_as_zero_and_is_said() -> None:
    table = random_table(1)
    results = exact_results(table)
    results[0] = msgspec.structs.replace(results[0], deviation=dict.fromkeys(METRICS))
    found = check(results, table)
    assert all(cell.deviation == 0.0 for cell in found.cells if cell.load == 45.0)
    assert found.notes == ("log 45: the largest deviation is not known, as of a single cycle; it counts as 0.",)


def test_a_row_without_a_run_is_a_miss_of_a_campaign_and_left_out_of_a_single_log() -> None:
    table = random_table(2)
    results = exact_results(table)[:1]
    assert {cell.outcome for cell in check(results, table).misses} == {"no_run"}
    single = check(results, table, whole_campaign=False)
    assert single.ok
    assert {cell.load for cell in single.cells} == {45.0}
    assert [note.partition(":")[0] for note in single.notes] == ["18 ohm", "open circuit"]


def test_an_open_circuit_without_a_row_is_left_out_and_said() -> None:
    table = msgspec.structs.replace(random_table(0), rows=random_table(0).rows[:2])
    found = check(exact_results(random_table(0)), table)
    assert found.ok
    assert found.notes == ("log inf: open circuit; the table has no row for it, so it is left out.",)


def with_load(load: float | None) -> Measured:
    return Measured("odd.csv", load, {}, {}, {})


@pytest.mark.parametrize(
    ("extra", "sentence"),
    [
        (with_load(17.0), "odd.csv: 17 ohm has no row in random; expected one of 45 ohm, 18 ohm, open circuit"),
        (with_load(18.0), "odd.csv: 18 ohm is the load of log 18 too; expected one log for each row"),
        (with_load(math.inf), "odd.csv: open circuit is the load of log inf too"),
        (with_load(None), "odd.csv: its load is not known; expected load_ohm in a campaign.toml"),
    ],
)
def test_a_log_that_has_no_place_in_the_table_is_one_sentence(extra: Measured, sentence: str) -> None:
    table = random_table(0)
    with pytest.raises(CheckError) as fault:
        check([*exact_results(table), extra], table)
    assert sentence in str(fault.value)


def test_no_log_with_a_row_is_one_sentence() -> None:
    with pytest.raises(CheckError, match="no log has a row in random; expected at least one log at one of 45 ohm"):
        check([], random_table(0))


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    """Reduction of the shipped 36 ohm log, as it is written."""
    log = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
    reduction = reduce(read_run(log, load=36.0), window=5.48)
    record: dict[str, Any] = json.loads(reduction_json(reduction, uncertainty(reduction)))
    return record


def read(record: object) -> Measured:
    """What a table is compared with, of the JSON of a reduction."""
    return measured_from_record(run_record(json.dumps(record).encode(), "x.json"), "x.json")


def test_the_fields_of_a_written_reduction_are_those_that_are_read(record: dict[str, Any]) -> None:
    assert dict(read(record).mean) == {
        metric: record["mean"][field] for metric, field in FIELDS.items() if metric in METRICS
    }


def test_the_shipped_36_ohm_log_agrees_with_the_paper(record: dict[str, Any]) -> None:
    found: Check = check([read(record)], load_table("hsu2026-table2"), whole_campaign=False)
    assert found.ok
    assert len(found.cells) == 9


def test_a_reduction_without_uncertainty_says_so(record: dict[str, Any]) -> None:
    parts = record["uncertainty"]
    unknown = record | {"uncertainty": parts | {"sensors": dict.fromkeys(parts["sensors"])}}
    found = check([read(unknown)], load_table("hsu2026-table2"), whole_campaign=False)
    assert f"{record['log']['path']}: the standard uncertainty is not known; it counts as 0." in found.notes


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"schema": "winchcascade/check/1"}, "Invalid enum value 'winchcascade/check/1'"),
        ({"log": None}, "Expected `object`, got `null` - at `$.log`"),
        ({"log": {"load_ohm": "36"}}, "Expected `float | null`, got `str` - at `$.log.load_ohm`"),
        ({"log": {"load_ohm": True}}, "Expected `float | null`, got `bool` - at `$.log.load_ohm`"),
        ({"log": {"load_ohm": -36}}, "Expected `float` > 0.0 - at `$.log.load_ohm`"),
        ({"mean": []}, "Expected `object`, got `array` - at `$.mean`"),
        ({"quality": [1]}, "Expected `object`, got `int` - at `$.quality[0]`"),
        ({"uncertainty": {}}, "Object missing required field"),
        ({"mean": {"energy_line_j": "7"}}, "Expected `float | null`, got `str` - at `$.mean[...]`"),
        ({"mean": {"energy_line_j": math.nan}}, "is no JSON of a reduction (JSON is malformed"),
        ({"standard_uncertainty": {"eta_pto": -0.1}}, "Expected `float` >= 0.0 - at `$.standard_uncertainty[...]`"),
    ],
)
def test_a_record_that_is_no_reduction_is_one_sentence(
    record: dict[str, Any], change: dict[str, Any], sentence: str
) -> None:
    if isinstance(log := change.get("log"), dict):
        change = {"log": record["log"] | log}
    with pytest.raises(OptionError) as fault:
        read({**record, **change})
    assert str(fault.value).startswith("x.json: ")
    assert sentence in str(fault.value)


def test_a_record_that_is_no_object_is_reported() -> None:
    with pytest.raises(OptionError, match=r"x.json: is no JSON of a reduction"):
        read([1])


def test_an_open_circuit_is_read_from_its_mark(record: dict[str, Any]) -> None:
    log = {**record["log"], "load_ohm": None}
    assert read({**record, "log": {**log, "open_circuit": True}}).load == math.inf
    assert read({**record, "log": {**log, "open_circuit": False}}).load is None
