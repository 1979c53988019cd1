"""Tables of operating points: rows of any key, laws between columns, exchanged heads, wrong units and single wrong cells."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from calls import call

from winchcascade.core.published_table import TableError
from winchcascade.core.quantity import find_unit
from winchcascade.tables.point_audit import PointAudit, audit_points
from winchcascade.tables.point_table import is_point_table, load_points

BENCH = Path(__file__).parents[3] / "shared" / "data" / "benches" / "dexpand-ctu"
here = pytest.mark.skipif(not BENCH.exists(), reason="the tables lie in ../shared/data, which is not here")

HEAD = 'title = "Generator test"\nsource = "made for this test"\n'
COLUMNS = """[columns]
test = { unit = "1" }
torque = { unit = "N.m", digits = 4 }
speed = { unit = "rpm", digits = 4 }
power_mech = { unit = "kW", digits = 4 }
power_gen = { unit = "W", digits = 4 }
eta_gen = { is = "power_gen / power_mech", decimals = 3 }
"""


def four(x: float) -> float:
    return float(f"{x:.4g}")


def point(k: int) -> dict[str, float]:
    torque, speed, eta = four(3.0 + 1.7 * k), four(400.0 + 130.0 * k), 0.7 + 0.01 * k
    power = torque * speed * math.pi / 30.0
    return {
        "test": k + 1,
        "torque": torque,
        "speed": speed,
        "power_mech": four(1e-3 * power),
        "power_gen": four(eta * power),
        "eta_gen": round(eta, 3),
    }


def table(
    folder: Path, points: list[dict[str, float]], columns: str = COLUMNS, entries: str = 'key = "test"\n'
) -> Path:
    rows = ["[[point]]\n" + "\n".join(f"{name} = {value}" for name, value in p.items()) for p in points]
    path = folder / "points.toml"
    path.write_text(HEAD + entries + columns + "\n".join(rows) + "\n")
    return path


def audited(path: Path) -> PointAudit:
    assert is_point_table(path)
    return audit_points(load_points(path))


def test_a_consistent_table_of_tests_is_clean(tmp_path: Path) -> None:
    found = audited(table(tmp_path, [point(k) for k in range(8)]))
    assert (found.ok, found.laws) == (True, 16)


def test_one_wrong_cell_is_named_by_the_key_of_its_row(tmp_path: Path) -> None:
    points = [point(k) for k in range(8)]
    points[2]["power_mech"] *= 1.1
    found = audited(table(tmp_path, points))
    assert {item.row for item in found.broken} == {2}
    assert found.broken[0].sentence.startswith("test 3, power_mech: ")
    assert "but torque * speed allows" in found.broken[0].sentence


@pytest.mark.parametrize("pair", [("power_mech", "eta_gen"), ("torque", "power_gen"), ("power_gen", "eta_gen")])
def test_exchanged_heads_are_reported_as_swapped(pair: tuple[str, str], tmp_path: Path) -> None:
    names = {pair[0]: pair[1], pair[1]: pair[0]}
    points = [{names.get(name, name): value for name, value in point(k).items()} for k in range(8)]
    found = audited(table(tmp_path, points, COLUMNS.replace(", decimals = 3", ", digits = 3")))
    (fault,) = found.faults
    assert (fault.kind, set(fault.columns), found.broken) == ("swapped", set(pair), ())


def test_a_wrong_unit_of_a_column_counts_once(tmp_path: Path) -> None:
    found = audited(table(tmp_path, [point(k) for k in range(8)], COLUMNS.replace('unit = "kW"', 'unit = "MW"')))
    (fault,) = found.faults
    assert (fault.kind, fault.columns) == ("unit", ("power_mech",))
    assert "taken times 0.001; its unit, printed as MW, is wrong" in fault.sentence


@pytest.mark.parametrize(
    ("right", "wrong", "columns", "words"),
    [
        ('speed = { unit = "rpm"', 'speed = { unit = "rad/s"', ("speed",), "printed as rad/s, is wrong; rpm fits."),
        (
            'torque = { unit = "N.m"',
            'torque = { unit = "kgf.cm"',
            ("torque",),
            "printed as kgf.cm, is wrong; N.m fits.",
        ),
        (
            '= { unit = "W"',
            '= { unit = "MW"',
            ("power_gen", "power_mech"),
            "their unit, printed as MW, is wrong; W fits.",
        ),
    ],
)
def test_a_unit_of_another_system_or_of_all_powers_is_named(
    right: str, wrong: str, columns: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    points = [point(k) | {"power_mech": 1e3 * point(k)["power_mech"]} for k in range(8)]
    watts = COLUMNS.replace('"kW"', '"W"')
    assert audited(table(tmp_path, points, watts)).ok
    (fault,) = audited(table(tmp_path, points, watts.replace(right, wrong))).faults
    assert fault.columns == columns
    assert fault.sentence.endswith(words)


def test_a_text_where_a_number_was_expected_is_reported(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("torque,speed,power_mech\n10,955,1000\n20,955,2000 W\n30,955,-\n")
    columns = '[columns]\ntorque = { unit = "N.m" }\nspeed = { unit = "rpm" }\npower_mech = { unit = "W" }\n'
    (tmp_path / "points.toml").write_text(HEAD + 'csv = "points.csv"\nkey = "torque"\n' + columns)
    out = call("audit", tmp_path / "points.toml").out
    assert "row 2 power_mech '2000 W'" in out


@pytest.mark.parametrize(
    ("content", "words"), [("", "is empty"), ("torque,speed,power_mech\n", "no row below its heads")]
)
def test_a_table_without_rows_is_not_audited(content: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(content)
    (tmp_path / "points.toml").write_text(HEAD + 'csv = "points.csv"\n[columns]\ntorque = { unit = "N.m" }\n')
    called = call("audit", tmp_path / "points.toml")
    assert (called.code, words in called.err) == (2, True)


def test_a_speed_in_volts_is_one_sentence(tmp_path: Path) -> None:
    path = table(tmp_path, [point(0)], COLUMNS.replace('speed = { unit = "rpm"', 'speed = { unit = "V"'))
    with pytest.raises(TableError, match="unit 'V' measures voltage; expected a unit of rotation, such as rpm"):
        load_points(path)


def test_a_milliwatt_is_no_megawatt() -> None:
    factors = [unit.factor for name in ("mW", "W", "kW", "MW") if (unit := find_unit(name))]
    assert factors == [1e-3, 1.0, 1e3, 1e6]


def test_the_digits_of_each_cell_of_a_csv_give_its_rounding(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("M / Nm;n / rpm;P / W\n10,0;955;1000,1\n20,0;955;1900\n", encoding="cp1252")
    columns = '[columns]\ntorque = { name = "M / Nm", unit = "N.m" }\nspeed = { name = "n / rpm", unit = "rpm" }\n'
    columns += 'power_shaft = { name = "P / W", unit = "W" }\n'
    found = audited(table(tmp_path, [], columns, 'csv = "points.csv"\n'))
    (item,) = found.broken
    assert item.sentence.startswith("row 2, power_shaft: 1900 W is printed, but torque * speed allows 1994.")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('key = "test"', 'key = "run"', "key names 'run', which is no column"),
        (
            'is = "power_gen / power_mech"',
            'is = "power_gen - power_mech"',
            "expected products and quotients of columns",
        ),
        ('is = "power_gen / power_mech"', 'is = "power_gen / power_line"', "is names 'power_line', which is no column"),
        ('unit = "kW"', 'unit = "horse"', "the unit 'horse' is unknown"),
        ('key = "test"', 'csv = "no.csv"', "either csv"),
    ],
)
def test_a_wrong_entry_is_one_sentence(old: str, new: str, words: str, tmp_path: Path) -> None:
    path = table(tmp_path, [point(0)])
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(TableError) as caught:
        load_points(path)
    assert words in str(caught.value)


def test_the_command_prints_the_fault_and_ends_with_1(tmp_path: Path) -> None:
    points = [{**point(k), "power_mech": point(k)["eta_gen"], "eta_gen": point(k)["power_mech"]} for k in range(8)]
    path = table(tmp_path, points)
    done = call("audit", path)
    assert done.code == 1
    assert "columns 'power_mech' and 'eta_gen' are swapped" in " ".join(done.out.split())
    record = json.loads(call("audit", path, "--json", "-").out)
    assert (record["schema"], record["column_faults"][0]["kind"]) == ("winchcascade/point-audit/1", "swapped")


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
def test_the_exchanged_heads_of_the_spindle_test_are_found(tmp_path: Path) -> None:
    path = tmp_path / "spindle.toml"
    path.write_text(HEAD + f'csv = "{BENCH / "py_import_data_spindle.csv"}"\n' + SPINDLE)
    found = audited(path)
    assert (len(found.table.rows), found.broken) == (55, ())
    assert "columns 'P_mech [W]' and 'PF [-]' are swapped" in found.faults[0].sentence


@here
def test_the_table_of_the_turbine_is_clean(tmp_path: Path) -> None:
    path = tmp_path / "turbine.toml"
    path.write_text(HEAD + f'csv = "{BENCH / "W50_evaluated_data_2202324.csv"}"\n' + TURBINE)
    found = audited(path)
    assert (found.ok, len(found.table.rows), found.laws) == (True, 18, 18)
