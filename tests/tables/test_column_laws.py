"""Laws between the columns of operating points: wrong cells, exchanged heads, wrong units, and
laws without cells.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from calls import call

from winchcascade import audit
from winchcascade.tables.audit import Audit
from winchcascade.tables.table_file import parse_table

BENCH = Path(__file__).parents[3] / "shared" / "data" / "benches" / "dexpand-ctu"
here = pytest.mark.skipif(
    not BENCH.exists(), reason="the tables lie in ../shared/data, which is not here"
)

HEAD = 'title = "Generator test"\nsource = "made for this test"\n'
COLUMNS = """[columns]
test = { unit = "1" }
torque = { unit = "N.m", digits = 4 }
speed = { unit = "rpm", digits = 4 }
power_mech = { unit = "kW", digits = 4 }
power_gen = { unit = "W", digits = 4 }
loss = { unit = "W", is = "power_mech - power_gen", decimals = 0 }
current = { unit = "A", is = "power_gen / 60 V", digits = 4 }
eta_gen = { is = "1 - loss / power_mech", decimals = 3 }
"""
ROWS = 8

Point = dict[str, float]


def point(k: int) -> Point:
    """One operating point, its numbers as printed."""
    torque, speed, eta = 3.0 + 1.7 * k, 400.0 + 130.0 * k, 0.7 + 0.01 * k
    power = torque * speed * math.pi / 30.0
    values = {
        "torque": torque,
        "speed": speed,
        "power_mech": 1e-3 * power,
        "power_gen": eta * power,
    }
    values["current"] = eta * power / 60.0
    four = {name: float(f"{value:.4g}") for name, value in values.items()}
    return {"test": k + 1, **four, "loss": round((1.0 - eta) * power), "eta_gen": round(eta, 3)}


def audited(points: list[Point], columns: str = COLUMNS) -> Audit:
    rows = [
        "[[point]]\n" + "\n".join(f"{name} = {value}" for name, value in p.items()) for p in points
    ]
    return audit(parse_table(HEAD + 'key = "test"\n' + columns + "\n".join(rows), "points.toml"))


def uses(found: Audit) -> dict[str, tuple[str, int, tuple[str, ...]]]:
    return {use.law.partition(" = ")[0]: (use.status, use.rows, use.missing) for use in found.uses}


def test_differences_constants_and_quotients_of_a_consistent_table_are_compared_and_agree() -> None:
    found = audited([point(k) for k in range(ROWS)])
    assert (found.ok, found.compared) == (True, 4 * ROWS)
    assert {use.rows for use in found.uses} == {ROWS}


@pytest.mark.parametrize("column", ["power_mech", "loss", "current", "eta_gen"])
def test_one_wrong_cell_is_named_by_the_key_of_its_row(column: str) -> None:
    points = [point(k) for k in range(ROWS)]
    points[2][column] = float(f"{1.1 * points[2][column]:.3g}")
    found = audited(points)
    assert {item.row.number for item in found.contradictions} == {3}
    assert column in {item.metric for item in found.contradictions}
    first = found.contradictions[0]
    assert first.sentence.startswith(f"test 3, {first.metric}: ")
    assert not first.allowed.low <= first.printed.value <= first.allowed.high


def test_no_efficiency_exceeds_1() -> None:
    (item,) = audited([{"test": 1, "eta_gen": 1.002}]).contradictions
    assert (item.allowed.low, item.allowed.high, item.cells) == (-1.0, 1.0, ("eta_gen",))


@pytest.mark.parametrize(
    "pair", [("power_mech", "eta_gen"), ("torque", "power_gen"), ("power_gen", "eta_gen")]
)
def test_exchanged_heads_are_reported_as_swapped(pair: tuple[str, str]) -> None:
    names = {pair[0]: pair[1], pair[1]: pair[0]}
    points = [
        {names.get(name, name): value for name, value in point(k).items()} for k in range(ROWS)
    ]
    found = audited(points, COLUMNS.replace(", decimals = 3", ", digits = 3"))
    (fault,) = found.faults
    assert (fault.kind, set(fault.columns), found.contradictions) == ("swapped", set(pair), ())


@pytest.mark.parametrize(
    ("right", "wrong", "columns", "unit"),
    [
        ('power_mech = { unit = "kW"', 'power_mech = { unit = "MW"', ("power_mech",), "kW"),
        ('speed = { unit = "rpm"', 'speed = { unit = "rad/s"', ("speed",), "rpm"),
        ('torque = { unit = "N.m"', 'torque = { unit = "kgf.cm"', ("torque",), "N.m"),
        ('current = { unit = "A"', 'current = { unit = "mA"', ("current",), "A"),
    ],
)
def test_a_wrong_unit_of_a_column_counts_once(
    right: str, wrong: str, columns: tuple[str, ...], unit: str
) -> None:
    found = audited([point(k) for k in range(ROWS)], COLUMNS.replace(right, wrong))
    (fault,) = found.faults
    assert (fault.kind, fault.columns, fault.unit, found.contradictions) == (
        "unit",
        columns,
        unit,
        (),
    )
    assert f"is wrong; {unit} fits." in fault.sentence


def test_a_power_without_cells_is_the_product_of_torque_and_speed() -> None:
    points = [
        {name: x for name, x in point(k).items() if name not in ("power_mech", "loss")}
        for k in range(ROWS)
    ]
    found = audited(points)
    assert {name: status for name, (status, _, _) in uses(found).items()} == {
        "power_mech": "derived", "loss": "derived", "current": "evaluated", "eta_gen": "evaluated",
    }  # fmt: skip
    assert found.ok
    (fault,) = audited(points, COLUMNS.replace('"rpm"', '"rad/s"')).faults
    assert fault.columns == ("speed",)


def test_a_law_that_no_row_can_be_compared_with_is_not_evaluated() -> None:
    found = audited(
        [
            {name: x for name, x in point(k).items() if name in ("test", "power_mech", "speed")}
            for k in range(3)
        ]
    )
    assert uses(found)["power_mech"] == ("not_evaluated", 0, ("torque",))
    assert (found.ok, found.evaluated, found.compared) == (False, False, 0)
    circle = COLUMNS.replace('"kW", digits = 4', '"kW", digits = 4, is = "power_gen + loss"')
    assert uses(audited([{"test": 1, "loss": 3.0, "power_gen": 7.0}], circle))["loss"] == (
        "not_evaluated",
        0,
        ("power_mech",),
    )


def test_the_command_prints_the_fault_and_the_json_has_its_place(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(
        "torque,speed,power_mech\n10,955,1000\n20,955,2100\n30,955,none\n"
    )
    columns = '[columns]\ntorque = { unit = "N.m" }\nspeed = { unit = "rpm" }\npower_mech = { unit = "W" }\n'
    path = tmp_path / "t.toml"
    path.write_text(HEAD + 'csv = "t.csv"\nkey = "torque"\n' + columns)
    called = call("audit", path)
    assert (called.code, "but torque * speed allows" in " ".join(called.out.split())) == (1, True)
    record: dict[str, Any] = json.loads(call("audit", path, "--json", "-").out)
    (item,) = record["contradictions"]
    assert (record["schema"], record["cells_compared"]) == ("winchcascade/point-audit/1", 2)
    assert (item["row"], item["key"], item["column"], item["printed"]) == (
        2,
        {"torque": 20.0},
        "power_mech",
        2100.0,
    )


SPINDLE = """key = ["torque", "frequency"]
tolerance_percent = 0.2
[columns]
torque = { name = "Torque [Nm]", unit = "N.m", digits = 4 }
frequency = { name = "f [Hz]", unit = "Hz" }
speed = { name = "rpm", unit = "rpm" }
power_vfd = { name = "P_avgd_VFD [W]", unit = "W" }
power_meter = { name = "P_yoko [W]", unit = "W" }
power_mech = { name = "P_mech [W]", unit = "W" }
power_factor = { name = "PF [-]" }
eta_vfd = { name = "eta_el_VFD [-]", is = "power_mech / power_vfd" }
eta_meter = { name = "eta_el_yoko [-]", is = "power_mech / power_meter" }
"""
TURBINE = """key = ["pressure", "speed"]
[columns]
pressure = { unit = "kPa" }
speed = { name = "n_shaft", unit = "rpm" }
power_shaft = { name = "P_shaft", unit = "W" }
power_isentropic = { name = "dH_is", unit = "W" }
eta_turbine = { is = "power_shaft / power_isentropic" }
"""


@here
def test_the_exchanged_heads_of_the_spindle_test_are_found_and_the_turbine_is_clean() -> None:
    spindle, turbine = (
        audit(parse_table(HEAD + f'csv = "{BENCH / csv}"\n' + columns, "t.toml"))
        for csv, columns in (
            ("py_import_data_spindle.csv", SPINDLE),
            ("W50_evaluated_data_2202324.csv", TURBINE),
        )
    )
    assert (len(spindle.table.rows), spindle.contradictions) == (55, ())
    assert "columns 'P_mech [W]' and 'PF [-]' are swapped" in spindle.faults[0].sentence
    assert (turbine.ok, len(turbine.table.rows), turbine.compared) == (True, 18, 18)


def test_a_divisor_that_may_be_zero_allows_any_value() -> None:
    columns = '[columns]\ntest = { }\na = { }\nb = { }\nc = { is = "a / b" }\nd = { is = "c + 1 - c / a / a" }\n'
    found = audited(
        [{"test": 1, "a": 2.0, "b": 0.0, "d": 1e9}, {"test": 2, "a": 2.0, "b": 4.0, "d": 9.0}],
        columns,
    )
    assert [item.row.number for item in found.contradictions] == [2]
    assert uses(found)["d"] == ("evaluated", 2, ())


def test_capture_width_power_coefficient_and_tip_speed_ratio_have_laws_of_their_own() -> None:
    columns = """[columns]
test = { unit = "1" }
speed = { unit = "rpm", digits = 4 }
power = { unit = "kW", digits = 4 }
wave_power = { unit = "kW/m", digits = 4 }
width = { unit = "m" }
density = { unit = "kg/m3" }
area = { unit = "m2", digits = 4 }
radius = { unit = "m" }
flow_speed = { unit = "m/s", digits = 4 }
capture_width = { unit = "m", digits = 3 }
capture_width_ratio = { digits = 3 }
cp = { digits = 3 }
tsr = { digits = 3 }
drag = { unit = "kg/m", is = "0.5 density area / width", digits = 4 }
"""
    right = {
        "test": 1, "speed": 20.0, "power": 15.0, "wave_power": 5.0, "width": 6.0, "density": 1025, "area": 12.57, "radius": 2.0,
        "flow_speed": 2.0, "capture_width": 3.0, "capture_width_ratio": 0.5, "cp": 0.291, "tsr": 2.09, "drag": 1074.0,
    }  # fmt: skip
    assert audited([right], columns).contradictions == ()
    for name in ("capture_width", "capture_width_ratio", "cp", "tsr", "drag"):
        found = audited([right | {name: 1.05 * right[name]}], columns).contradictions
        assert name in {cell for item in found for cell in item.cells}, name
