"""Results against published tables whose rows have any key: operating points, names and numbers of logs, loads."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from calls import call

BENCH = """name = "dyno"
[cascade]
stages = ["mech", "gen"]
[phases]
from = "steps"
[sensors.torque]
unit = "N.m"
high = 200
accuracy_full_scale = 0.001
[sensors.speed]
unit = "rpm"
accuracy = 0.1
[sensors.vdc]
unit = "V"
accuracy_reading = 0.001
[sensors.idc]
unit = "A"
accuracy_reading = 0.001
"""
COLUMNS = """[columns]
n = { unit = "rpm", measured = "speed" }
torque = { unit = "N.m" }
power_mech = { unit = "kW" }
delivered = { unit = "W", measured = "power_gen" }
eta_gen = { unit = "%" }
bearing = { unit = "degC" }
"""
POINTS = {"test_1": (200, 400), "test_2": (600, 800)}
TORQUES = (10, 40, 80)


def powers(rpm: float, torque: float) -> tuple[float, float]:
    """Power of the shaft and at the DC link of the invented generator. [W]"""
    omega = rpm * math.pi / 30.0
    return torque * omega, torque * omega - 2.0 * omega - 0.012 * torque**2


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of two logs with six steps each."""
    folder = tmp_path_factory.mktemp("bench")
    rng = np.random.default_rng(3)
    (folder / "bench.toml").write_text(BENCH)
    for name, speeds in POINTS.items():
        lines = ["Time (s),Speed (rpm),Torque (N.m),Vdc (V),Idc (A)"]
        points = [(n, torque) for n in speeds for torque in TORQUES]
        for k in range(100 * len(points)):
            n, torque = points[k // 100]
            row = (0.1 * k, n, torque + rng.normal(0.0, 0.2), 0.5 * n, powers(n, torque)[1] / (0.5 * n))
            lines.append(",".join(f"{x:.5f}" for x in row))
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    runs = "".join(f'[[run]]\nfile = "{name}.csv"\n' for name in POINTS)
    (folder / "campaign.toml").write_text(f'title = "dyno"\nrig = "bench.toml"\n{runs}')
    return folder


def printed(n: float, torque: float, *, wrong: float = 1.0) -> str:
    mech, gen = powers(n, torque)
    return f"{n};{torque};{wrong * mech / 1e3:.2f};{gen:.0f};{100.0 * gen / mech:.1f};31".replace(".", ",")


def table(
    folder: Path, rows: list[str], *, key: str = '["n", "torque"]', columns: str = COLUMNS, more: str = ""
) -> Path:
    path = folder / "table.toml"
    heads = [line.split(" ")[0] for line in columns.splitlines()[1:]]
    (folder / "table.csv").write_text("\n".join([";".join(heads), *rows]) + "\n")
    path.write_text(f'title = "T"\nsource = "S"\ncsv = "table.csv"\nkey = {key}\n{more}{columns}')
    return path


ALL = [(n, torque) for speeds in POINTS.values() for n in speeds for torque in TORQUES]


def test_every_operating_point_is_compared_with_the_row_of_its_speed_and_torque(bench: Path, tmp_path: Path) -> None:
    path = table(tmp_path, [printed(*point) for point in reversed(ALL)])
    code, out, err = call("check", bench, "--against", path)
    assert (code, err) == (0, "")
    assert "All 36 cells agree" in out
    assert "columns bearing: the results have no quantity" in " ".join(out.split())
    logs = [cell["log"] for cell in json.loads(call("check", bench, "--against", path, "--json", "-").out)["cells"]]
    assert any(log.endswith("test_2.csv cycle 2") for log in logs)


def test_a_wrong_cell_is_a_miss_with_its_row_in_text_json_junit_and_annotation(bench: Path, tmp_path: Path) -> None:
    path = table(tmp_path, [printed(*point, wrong=1.05 if point == (600, 40) else 1.0) for point in ALL])
    code, out, err = call(
        "check", bench, "--against", path, "--json", "-", "--junit", tmp_path / "check.xml", "--github"
    )
    record = json.loads(out)
    assert (code, record["ok"], record["misses"]) == (1, False, 1)
    miss = next(cell for cell in record["cells"] if cell["outcome"] == "miss")
    assert (miss["row"], miss["key"], miss["metric"]) == (8, {"n": "600", "torque": "40"}, "power_mech")
    assert miss["missed_by"] > 0.09
    assert "title=n 600 rpm%2C torque 40 N.m power_mech" in err
    assert 'failure message="n 600 rpm, torque 40 N.m, power_mech: 2.64 kW' in (tmp_path / "check.xml").read_text()


def test_a_row_without_a_result_is_a_miss_of_a_campaign_and_a_note_of_a_single_log(bench: Path, tmp_path: Path) -> None:
    path = table(tmp_path, [printed(*point) for point in [*ALL, (1000, 40)]])
    code, out, _ = call("check", bench, "--against", path)
    assert code == 1
    assert "36 of 39 cells agree; 3 without a run" in out
    one = tmp_path / "one.json"
    assert call("reduce", bench / "test_1.csv", "--json", one).code == 0
    code, out, _ = call("check", one, "--against", path)
    assert code == 0
    assert "All 18 cells agree" in out
    assert "n 1000 rpm, torque 40 N.m: no result belongs to this row" in " ".join(out.split())


def test_a_result_without_a_row_is_named(bench: Path, tmp_path: Path) -> None:
    path = table(tmp_path, [printed(*point) for point in ALL if point != (800, 80)])
    _, out, _ = call("check", bench, "--against", path)
    assert "test_2.csv cycle 6 (n 800 rpm, torque 80" in " ".join(out.split())


LOGS = """[columns]
test = { measured = "file" }
energy_mech = { unit = "kJ" }
eta_gen = { unit = "%" }
"""


@pytest.mark.parametrize("names", [("1", "2"), ("test_1.csv", "TEST_2")])
def test_rows_of_numbers_and_names_of_logs_are_compared_with_sums_of_their_steps(
    bench: Path, tmp_path: Path, names: tuple[str, str]
) -> None:
    rows = []
    for name, speeds in zip(names, POINTS.values(), strict=True):
        steps = [powers(n, torque) for n in speeds for torque in TORQUES]
        mech, gen = (sum(column) for column in zip(*steps, strict=True))
        rows.append(
            f"{name};{9.4 * mech / 1e3:.0f};{100.0 * gen / mech:.0f}"
        )  # 9.4 s of each step remain without settling
    path = table(tmp_path, rows, key='"test"', columns=LOGS)
    _, out, err = call("check", bench, "--against", path, "--json", "-")
    assert err == ""
    record = json.loads(out)
    found = {(cell["key"]["test"], cell["metric"]): cell for cell in record["cells"]}
    assert [found[name, "eta_gen"]["outcome"] for name in names] == ["ok", "ok"]
    for name in names:
        cell = found[name, "energy_mech"]
        assert cell["measured"] == pytest.approx(cell["printed"], rel=0.02)


def test_logs_that_repeat_a_motion_are_compared_by_their_means(tmp_path: Path) -> None:
    log = "fixtures/campaign/r36ohm.csv"
    reduced = json.loads(call("reduce", log, "--load-ohm", "36", "--window", "5.48", "--json", "-").out)
    columns = '[columns]\nload_ohm = { unit = "ohm" }\nenergy_line = { unit = "kJ" }\neta_pto = { unit = "1" }\n'
    path = table(tmp_path, ["36,0;7,11;0,697", "inf;1,2;"], key='"load_ohm"', columns=columns)
    code, out, err = call("check", "fixtures/campaign", "--against", path, "--json", "-")
    assert (code, err) == (0, "")
    record = json.loads(out)
    cells = {(cell["key"]["load_ohm"], cell["metric"]): cell for cell in record["cells"]}
    assert set(cells) == {("36,0", "energy_line"), ("36,0", "eta_pto"), ("inf", "energy_line")}
    assert cells["36,0", "eta_pto"]["measured"] == reduced["mean"]["eta_pto"]
    assert cells["36,0", "energy_line"]["tolerance"]["deviation"] == pytest.approx(
        1e-5 * reduced["max_deviation_percent"]["energy_line_j"] * reduced["mean"]["energy_line_j"]
    )
    assert "r9ohm.csv (load_ohm 9 ohm)" in record["notes"][0]


@pytest.mark.parametrize(
    ("columns", "key", "sentence"),
    [
        (
            COLUMNS.replace('"rpm"', '"kW"'),
            '["n", "torque"]',
            "the unit 'kW' is none of speed; expected one such as rad/s",
        ),
        (COLUMNS, '"bearing"', "the key bearing is none of the results: they have no bearing"),
        (COLUMNS, "[]", "has no key, so that no result can be assigned to a row"),
        (
            '[columns]\nn = { unit = "rpm", measured = "speed" }\nbearing = { unit = "degC" }\n',
            '"n"',
            'add measured = "',
        ),
        (COLUMNS.replace('"rpm"', '"Hz"'), '["n", "torque"]', "no result belongs to a row of table"),
    ],
)
def test_a_table_that_cannot_be_assigned_is_rejected_with_a_sentence(
    bench: Path, tmp_path: Path, columns: str, key: str, sentence: str
) -> None:
    code, out, err = call(
        "check", bench, "--against", table(tmp_path, ["200;10;0,21;166;79,4;31"], key=key, columns=columns)
    )
    assert (code, out) == (2, "")
    assert sentence in err


def test_a_row_that_numbers_two_logs_is_rejected(bench: Path, tmp_path: Path) -> None:
    for folder, log in (("a", "test_1"), ("b", "test_2")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "run_1.csv").write_bytes((bench / f"{log}.csv").read_bytes())
    runs = "".join(f'[[run]]\nfile = "{folder}/run_1.csv"\n' for folder in "ab")
    (tmp_path / "campaign.toml").write_text(f'title = "dyno"\nrig = "{(bench / "bench.toml").as_posix()}"\n{runs}')
    code, _, err = call(
        "check", tmp_path / "campaign.toml", "--against", table(tmp_path, ["1;9;90"], key='"test"', columns=LOGS)
    )
    assert code == 2
    assert "expected one log, so write its file name there" in err


def test_a_sensor_that_is_calibrated_in_place_counts_by_its_limits_for_the_table(bench: Path, tmp_path: Path) -> None:
    """The zero of the torque, +-0.2 N m by its maker, moves the power of a step by as much times the speed of the shaft."""
    for path in bench.glob("*.csv"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "campaign.toml").write_bytes((bench / "campaign.toml").read_bytes())
    calibrated = "accuracy_full_scale = 0.001\nu_zero = 0.01\nu_gain = 0.0\n"
    (tmp_path / "bench.toml").write_text(BENCH.replace("accuracy_full_scale = 0.001\n", calibrated))
    path = table(tmp_path, [printed(*point) for point in ALL])
    called = call("check", tmp_path, "--against", path, "--json", "-")
    cells = [cell for cell in json.loads(called.out)["cells"] if cell["metric"] == "power_mech"]
    assert (called.code, len(cells)) == (0, len(ALL))
    for cell, (rpm, _) in zip(cells, ALL, strict=True):
        by_makers = 2.0 * 0.2 / math.sqrt(3.0) * rpm * math.pi / 30.0 / 1e3
        assert cell["tolerance"]["basis"] == "budget_and_limits"
        assert cell["tolerance"]["limits"] == pytest.approx(by_makers, rel=1e-6)
        assert cell["tolerance"]["uncertainty"] > cell["tolerance"]["limits"]
