"""What an audit could not evaluate is reported, and a table of which nothing was evaluated is not consistent."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from calls import call

from winchcascade.tables.feasible import lacking

HEAD = 'title = "T"\nsource = "S"\n'
POINTS = """[columns]
torque = { unit = "N.m" }
speed = { unit = "rpm" }
power_mech = { unit = "W" }
power_gen = { unit = "W" }
eta_gen = { is = "power_gen / power_mech" }
"""
ROWS = (
    {"torque": 10, "speed": 955, "power_gen": 800, "eta_gen": "0.80"},
    {"torque": 20, "speed": 955, "power_gen": 1600, "eta_gen": "0.80"},
    {"torque": 30, "speed": 955, "power_gen": 2400, "eta_gen": "0.80"},
)
LOADS = """[columns]
energy_line = {{ unit = "J", decimals = 0 }}
energy_gen = {{ unit = "J", decimals = 0 }}
power_line = {{ unit = "W", decimals = 0 }}
power_gen = {{ unit = "W", decimals = 0 }}
eta_pto = {{ unit = "1", decimals = 3 }}
[[row]]
load_ohm = 36
{cells}
"""


def audited(path: Path) -> tuple[int, dict[str, Any]]:
    called = call("audit", path, "--json", "-")
    assert called.err == ""
    return called.code, json.loads(called.out)


def points(folder: Path, rows: tuple[dict[str, object], ...], columns: str = POINTS) -> Path:
    path = folder / "points.toml"
    text = [f"[[point]]\n{chr(10).join(f'{k} = {v}' for k, v in row.items())}\n" for row in rows]
    path.write_text(HEAD + 'key = "torque"\n' + columns + "".join(text))
    return path


def loads(folder: Path, cells: str) -> Path:
    path = folder / "loads.toml"
    path.write_text(HEAD + LOADS.format(cells=cells))
    return path


def law(record: dict[str, Any], column: str) -> tuple[str, int, list[str]]:
    (found,) = [use for use in record["laws"] if use["law"].startswith(f"{column} = ")]
    return found["status"], found["rows_evaluated"], found["missing"]


def test_a_power_without_cells_is_the_product_of_torque_and_speed(tmp_path: Path) -> None:
    code, record = audited(points(tmp_path, ROWS))
    assert (code, record["ok"], record["contradictions"]) == (0, True, [])
    assert law(record, "eta_gen") == ("evaluated", 3, [])
    assert law(record, "power_mech") == ("derived", 0, ["power_mech"])
    code, record = audited(points(tmp_path, (*ROWS[:2], ROWS[2] | {"eta_gen": "0.70"})))
    (wrong,) = record["contradictions"]
    assert (code, wrong["row"], wrong["column"]) == (1, 3, "eta_gen")
    assert wrong["allowed"][0] < 2400.0 / (30.0 * 955.0 * 3.14159265 / 30.0) < wrong["allowed"][1]


def test_a_wrong_unit_behind_a_derived_power_is_found(tmp_path: Path) -> None:
    _, record = audited(points(tmp_path, ROWS, POINTS.replace('"rpm"', '"rad/s"')))
    (fault,) = record["column_faults"]
    assert (fault["kind"], fault["columns"], fault["broken_after"]) == ("unit", ["speed"], 0)


def test_a_derived_column_may_be_absent_from_the_csv(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("torque,speed,power_gen,eta_gen\n10,955,800,0.80\n20,955,1600,0.70\n")
    (tmp_path / "t.toml").write_text(HEAD + 'key = "torque"\ncsv = "t.csv"\n' + POINTS)
    code, record = audited(tmp_path / "t.toml")
    assert (code, [item["row"] for item in record["contradictions"]]) == (1, [2])
    named = POINTS.replace("power_mech = { unit", 'power_mech = { name = "P mech", unit')
    (tmp_path / "t.toml").write_text(HEAD + 'key = "torque"\ncsv = "t.csv"\n' + named)
    called = call("audit", tmp_path / "t.toml")
    assert (called.code, "'P mech'" in called.err) == (2, True)


@pytest.mark.parametrize("lost", ["torque", "speed"])
def test_a_law_that_no_row_can_be_compared_with_is_not_evaluated(tmp_path: Path, lost: str) -> None:
    rows = tuple({name: value for name, value in row.items() if name != lost} for row in ROWS)
    code, record = audited(points(tmp_path, rows))
    assert (code, record["evaluated"], record["ok"]) == (0, True, True)  # an efficiency is at most 1
    assert law(record, "eta_gen") == ("not_evaluated", 0, ["power_mech"])
    assert law(record, "power_mech") == ("not_evaluated", 0, ["power_mech", lost])
    assert "evaluated" in call("audit", points(tmp_path, rows)).out


def test_laws_that_lead_back_to_each_other_compare_nothing_with_itself(tmp_path: Path) -> None:
    columns = POINTS.replace('power_mech = { unit = "W" }', 'power_mech = { unit = "W", is = "power_gen / eta_gen" }')
    _, record = audited(points(tmp_path, ROWS, columns))
    assert law(record, "eta_gen") == ("not_evaluated", 0, ["power_mech"])


def test_a_table_of_points_of_which_nothing_was_evaluated_is_not_consistent(tmp_path: Path) -> None:
    rows = tuple({name: value for name, value in row.items() if name != "eta_gen"} for row in ROWS)
    code, record = audited(points(tmp_path, rows))
    assert (code, record["ok"], record["evaluated"], record["cells_compared"]) == (1, False, False, 0)


@pytest.mark.parametrize("cells", ["energy_gen = 4956", "energy_line = 7115\npower_gen = 904"])
def test_a_table_by_load_of_which_nothing_was_evaluated_is_not_consistent(tmp_path: Path, cells: str) -> None:
    code, record = audited(loads(tmp_path, cells))
    assert (code, record["ok"], record["evaluated"]) == (1, False, False)
    assert {use["status"] for use in record["laws"]} == {"not_evaluated"}
    assert "consistent" not in (text := call("audit", loads(tmp_path, cells), "--quiet")).out
    assert text.out != ""


def test_a_table_by_load_states_which_laws_its_rows_can_contradict(tmp_path: Path) -> None:
    code, record = audited(loads(tmp_path, "energy_line = 7115\nenergy_gen = 4956\neta_pto = 0.697"))
    assert (code, record["ok"]) == (0, True)
    held = {use["law"]: use["rows_evaluated"] for use in record["laws"]}
    assert held["eta_pto = energy_gen / energy_line"] == 1
    assert held["eta_pto = eta_trans * eta_gen"] == held["energy = power * window"] == 0


def test_the_built_in_table_holds_every_law_in_every_row() -> None:
    _, record = audited(Path("hsu2026-table2"))
    assert {use["rows_evaluated"] for use in record["laws"]} == {6}


def test_a_window_gives_the_energy_of_a_stage_that_has_a_power_alone() -> None:
    cells = ("energy_line", "power_line", "power_mech", "eta_trans")
    assert lacking(cells)["eta_trans = energy_mech / energy_line"] == ()
    assert lacking(cells[1:])["eta_trans = energy_mech / energy_line"] == ()  # the ratio of powers
    assert lacking(("energy_line", "power_mech", "eta_trans"))["eta_trans = energy_mech / energy_line"] != ()
