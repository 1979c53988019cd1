"""Results against published tables: the tolerance of a cell, how rows are found, and the shipped
campaign.
"""

from __future__ import annotations

import json
import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import call
from made_tables import PLAIN, Units, made_table, table_text, unit_of_metric
from msgspec.structs import replace

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import Results, campaign_results, check_results
from winchcascade.core.errors import OptionError
from winchcascade.reduction.efficiency import FIELDS, METRICS, RATIOS
from winchcascade.tables.check import SAME_LOGS, Factors, check
from winchcascade.tables.measured import Measured
from winchcascade.tables.published_table import PublishedTable
from winchcascade.tables.rows_of_results import CheckError
from winchcascade.tables.table_file import load_table, parse_table

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
LOADS = (45.0, 18.0, math.inf)
UNITS: Units = {"energy": ("kJ", 3, 1e3), "power": ("W", 0, 1.0), "eta": ("%", 1, 0.01)}
JUST = 1e-3
"""Share of the tolerance by which a value is put inside or outside of it."""


def random_table(seed: int = 0) -> PublishedTable:
    """Three rows of nine cells."""
    rng = np.random.default_rng(seed)
    factors = {m: unit_of_metric(UNITS, m)[2] for m in METRICS}
    rows = [
        {"load_ohm": load, **{m: float(rng.uniform(20.0, 900.0)) * factors[m] for m in METRICS}}
        for load in LOADS
    ]
    return made_table(rows, UNITS)


def exact(table: PublishedTable, seed: int = 0) -> list[Measured]:
    """Results that are what the table prints, with a deviation and an uncertainty of each
    metric.
    """
    rng = np.random.default_rng(seed)
    results = []
    for row in table.rows:
        si = {m: row.cells[m].value * row.cells[m].factor for m in METRICS}
        doubt: dict[str, float | None] = {
            m: value * float(rng.uniform(0.0, 0.05)) for m, value in si.items()
        }
        deviation: dict[str, float | None] = {m: float(rng.uniform(0.0, 20.0)) for m in METRICS}
        results.append(
            Measured(
                f"log {row.load:g}", f"log {row.load:g}", {**si, "load": row.load}, deviation, doubt
            )
        )
    return results


def with_value(results: list[Measured], k: int, metric: str, value: float | None) -> list[Measured]:
    """Results with one value changed."""
    return [
        replace(r, values={**r.values, metric: value}) if n == k else r
        for n, r in enumerate(results)
    ]


def test_any_single_cell_beyond_its_tolerance_fails_and_within_it_passes() -> None:
    """A value moved by a share of its own tolerance: m - p = share (h + d m + 2 u), solved for m.

    The others of the row are as printed, so that an energy or a power deviates by no more than the
    efficiencies do.
    """
    table = random_table()
    results = exact(table)
    assert check(results, table).ok
    for k, (row, result) in enumerate(zip(table.rows, results, strict=True)):
        for metric in METRICS:
            cell = row.cells[metric]
            fixed = cell.rounding * cell.factor + 2.0 * (result.uncertainty[metric] or 0.0)
            alone = max(result.deviation[eta] or 0.0 for eta in RATIOS) / 100.0
            for share in (JUST - 1.0, 1.0 - JUST, -1.0 - JUST, 1.0 + JUST):
                printed = cell.value * cell.factor
                values = [
                    (printed + share * fixed)
                    / (1.0 - share * (result.deviation[metric] or 0.0) / 100.0)
                ]
                values += [] if metric in RATIOS else [printed + share * (fixed + alone * printed)]
                moved = with_value(
                    results, k, metric, min(values, key=lambda value: abs(value - printed))
                )
                misses = [(miss.row.number, miss.metric) for miss in check(moved, table).misses]
                assert misses == ([(k + 1, metric)] if abs(share) > 1.0 else [])


def test_a_factor_widens_and_narrows_its_part_alone() -> None:
    table = random_table()
    parts = ("rounding", "deviation", "uncertainty")
    plain = check(exact(table), table).cells
    for part in parts:
        wide = check(exact(table), table, Factors(**{part: 3.0})).cells
        for one, other in zip(plain, wide, strict=True):
            factors = [getattr(other, name) / getattr(one, name) for name in parts]
            assert factors == pytest.approx([3.0 if name == part else 1.0 for name in parts])
            assert other.tolerance == sum(getattr(other, name) for name in parts)
    with pytest.raises(OptionError, match="tolerance factor deviation is inf"):
        Factors(deviation=math.inf)


@pytest.mark.parametrize(("metric", "printed"), [("energy_gen", 18.5), ("eta_gen", 2.55)])
def test_the_deviation_counts_up_to_what_the_table_prints(metric: str, printed: float) -> None:
    table = load_table("hsu2026-table2")
    value = table.rows[1].cells[metric].value
    cells = []
    for deviation in (printed, 4.0 * printed):
        log = Measured(
            "log",
            "log",
            {metric: value, "load": 36.0},
            {metric: deviation},
            {metric: 0.004 * value},
        )
        found = check([log], table, whole_campaign=False)
        cells += [cell for cell in found.cells if cell.metric == metric]
        assert len([note for note in found.notes if f"{metric} {deviation:.3g} %" in note]) == (
            deviation > printed
        )
    assert cells[0].deviation == pytest.approx(cells[1].deviation)


def test_a_metric_that_was_not_measured_fails_by_name_and_a_single_cycle_is_reported() -> None:
    table = random_table()
    (miss,) = check(with_value(exact(table), 1, "energy_gen", None), table).misses
    assert (miss.row.load, miss.metric, miss.outcome, miss.log) == (
        18.0,
        "energy_gen",
        "not_measured",
        "log 18",
    )
    first, *others = exact(table)
    found = check([replace(first, deviation={}), *others], table)
    assert all(cell.deviation == 0.0 for cell in found.cells if cell.row.load == 45.0)
    assert [note for note in found.notes if "log 45" in note and "counts as 0" in note] == list(
        found.notes
    )


def test_a_log_without_a_row_is_left_out_with_a_note_and_two_of_a_row_are_both_compared() -> None:
    table = random_table()
    odd = [Measured(f"odd {load}", "odd", {"load": load}) for load in (17.9, None)]
    found = check([*exact(table), *odd], table)
    assert found.ok
    assert "odd 17.9 (load_ohm 17.9 ohm), odd None (load_ohm unknown)" in found.notes[0]
    twice = check([*exact(table), *with_value(exact(table)[:1], 0, "eta_pto", 9.0)], table)
    assert [(miss.row.load, miss.metric) for miss in twice.misses] == [(45.0, "eta_pto")]
    with pytest.raises(CheckError, match="no result belongs to a row of made: odd 17"):
        check(odd, table)


# --------------------------------------------------------------------------- the shipped campaign
@pytest.fixture(scope="module")
def results() -> Results:
    """The reductions of the shipped campaign, whose rig states sensors that are calibrated in
    place.
    """
    return campaign_results(make_plan([str(CAMPAIGN)]), 1)


@pytest.fixture(scope="module")
def ours(results: Results) -> list[dict[str, float]]:
    """What these logs give, by load."""
    means = [(record.log.load_ohm, record.mean) for _, record in results.records]
    return [
        {"load_ohm": load, **{m: mean[FIELDS[m]] or 0.0 for m in METRICS}}
        for load, mean in means
        if load
    ]


def test_budget_and_limits_of_the_sensors_count_in_squares(results: Results) -> None:
    found, records = (
        check_results(results, "hsu2026-table2"),
        {r.log.load_ohm: r for _, r in results.records},
    )
    assert (len(found.cells), found.misses) == (54, ())
    for cell in found.cells:
        parts = records[cell.row.load].uncertainty
        own, limits = (
            of[FIELDS[cell.metric]] or 0.0 for of in (parts.sensors, parts.sensors_by_limits)
        )
        assert own > 0.0
        assert limits > 0.0
        assert cell.basis == "budget_and_limits"
        assert cell.uncertainty == pytest.approx(2.0 * math.hypot(own, limits))


def test_a_table_of_these_logs_allows_rounding_alone(
    results: Results, ours: list[dict[str, float]], tmp_path: Path
) -> None:
    found = check_results(results, made_table(ours), SAME_LOGS)
    assert (len(found.cells), found.misses) == (54, ())
    assert {(cell.tolerance, cell.basis) for cell in found.cells} == {
        (0.5, "none"),
        (0.0005, "none"),
    }
    path = tmp_path / "ours.toml"
    for metric in ("energy_gen", "power_line"):
        rows = [dict(row) for row in ours]
        rows[2][metric] *= 1.05
        path.write_text(table_text(rows, PLAIN))
        called = call("check", CAMPAIGN, "--against", path, "--same-logs", "--json", "-")
        record = json.loads(called.out)
        (miss,) = [cell for cell in record["cells"] if cell["outcome"] == "miss"]
        assert (called.code, miss["load_ohm"], miss["metric"]) == (1, rows[2]["load_ohm"], metric)
        assert path.read_text().splitlines()[miss["line"] - 1].startswith(f"{metric} = ")
        assert record["factors"] == {
            "rounding": 1.0,
            "deviation": 0.0,
            "uncertainty": 0.0,
            "means": 0.0,
        }
    for more in (
        ("--same-logs", "--tolerance", "uncertainty=2"),
        ("--json", CAMPAIGN / "r36ohm.csv", "--force"),
    ):
        called = call("check", CAMPAIGN, "--against", path, *more)
        assert (called.code, called.out) == (2, "")


# ------------------------------------------------------------------------------- operating points
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
LOGS = """[columns]
test = { measured = "file" }
energy_mech = { unit = "kJ" }
eta_gen = { unit = "%" }
"""
STEPS = {"test_1": (200, 400), "test_2": (600, 800)}
TORQUES = (10, 40, 80)
ALL = [(n, torque) for speeds in STEPS.values() for n in speeds for torque in TORQUES]


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
    for name, speeds in STEPS.items():
        lines = ["Time (s),Speed (rpm),Torque (N.m),Vdc (V),Idc (A)"]
        points = [(n, torque) for n in speeds for torque in TORQUES]
        for k in range(100 * len(points)):
            n, torque = points[k // 100]
            row = (
                0.1 * k,
                n,
                torque + rng.normal(0.0, 0.2),
                0.5 * n,
                powers(n, torque)[1] / (0.5 * n),
            )
            lines.append(",".join(f"{x:.5f}" for x in row))
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    runs = "".join(f'[[run]]\nfile = "{name}.csv"\n' for name in STEPS)
    (folder / "campaign.toml").write_text(f'title = "dyno"\nrig = "bench.toml"\n{runs}')
    return folder


def printed(n: float, torque: float, *, wrong: float = 1.0) -> str:
    """A row of the table of a step."""
    mech, gen = powers(n, torque)
    return f"{n};{torque};{wrong * mech / 1e3:.2f};{gen:.0f};{100.0 * gen / mech:.1f};31".replace(
        ".", ","
    )


def written(
    folder: Path, rows: list[str], key: str = '["n", "torque"]', columns: str = COLUMNS
) -> Path:
    """A table of operating points with a CSV."""
    heads = [line.split(" ")[0] for line in columns.splitlines()[1:]]
    (folder / "table.csv").write_text("\n".join([";".join(heads), *rows]) + "\n")
    path = folder / "table.toml"
    path.write_text(f'title = "T"\nsource = "S"\ncsv = "table.csv"\nkey = {key}\n{columns}')
    return path


def checked(*arguments: str | Path) -> tuple[int, dict[str, Any]]:
    """Exit code and record of a check."""
    called = call("check", *arguments, "--json", "-")
    return called.code, json.loads(called.out)


def test_every_operating_point_is_compared_with_the_row_of_its_speed_and_torque(
    bench: Path, tmp_path: Path
) -> None:
    rows = [printed(*point, wrong=1.05 if point == (600, 40) else 1.0) for point in reversed(ALL)]
    called = call(
        "check",
        bench,
        "--against",
        written(tmp_path, rows),
        "--json",
        "-",
        "--junit",
        tmp_path / "c.xml",
        "--github",
    )
    record = json.loads(called.out)
    assert (called.code, len(record["cells"]), record["misses"]) == (1, 36, 1)
    assert any(cell["log"].endswith("test_2.csv cycle 2") for cell in record["cells"])
    assert "columns bearing: the results have no quantity" in record["notes"][0]
    (miss,) = [cell for cell in record["cells"] if cell["outcome"] == "miss"]
    assert (miss["row"], miss["key"], miss["metric"]) == (
        5,
        {"n": "600", "torque": "40"},
        "power_mech",
    )
    assert miss["missed_by"] > 0.09
    assert "title=n 600 rpm%2C torque 40 N.m power_mech" in called.err
    assert (
        'failure message="n 600 rpm, torque 40 N.m, power_mech: 2,64 kW'
        in (tmp_path / "c.xml").read_text()
    )


def test_a_row_without_a_result_and_a_result_without_a_row_are_named(
    bench: Path, tmp_path: Path
) -> None:
    path = written(tmp_path, [printed(*point) for point in [*ALL[:-1], (1000, 40)]])
    code, record = checked(bench, "--against", path)
    assert (code, {cell["outcome"] for cell in record["cells"] if cell["row"] == 12}) == (
        1,
        {"no_run"},
    )
    assert "test_2.csv cycle 6 (n 800 rpm, torque 80" in record["notes"][1]
    assert call("reduce", bench / "test_1.csv", "--json", tmp_path / "one.json").code == 0
    code, record = checked(tmp_path / "one.json", "--against", path)
    assert (code, len(record["cells"])) == (0, 18)
    assert any("n 1000 rpm, torque 40 N.m; left out" in note for note in record["notes"])


@pytest.mark.parametrize("names", [("1", "2"), ("test_1.csv", "TEST_2")])
def test_names_and_numbers_of_logs_are_compared_with_sums_of_their_steps(
    bench: Path, tmp_path: Path, names: tuple[str, ...]
) -> None:
    rows = []
    for name, speeds in zip(names, STEPS.values(), strict=True):
        mech, gen = np.sum([powers(n, torque) for n in speeds for torque in TORQUES], axis=0)
        rows.append(
            f"{name};{9.4 * mech / 1e3:.0f};{100.0 * gen / mech:.0f}"
        )  # 9.4 s of each step without settling
    _, record = checked(bench, "--against", written(tmp_path, rows, '"test"', LOGS))
    found = {(cell["key"]["test"], cell["metric"]): cell for cell in record["cells"]}
    for name in names:
        assert found[name, "eta_gen"]["outcome"] == "ok"
        assert found[name, "energy_mech"]["measured"] == pytest.approx(
            found[name, "energy_mech"]["printed"], rel=0.02
        )


def test_logs_that_repeat_a_motion_are_compared_by_their_means(
    tmp_path: Path, results: Results
) -> None:
    columns = '[columns]\nload_ohm = { unit = "ohm" }\nenergy_line = { unit = "kJ" }\neta_pto = { unit = "1" }\n'
    path = written(tmp_path, ["36,0;7,11;0,697", "inf;1,2;"], '"load_ohm"', columns)
    code, record = checked(CAMPAIGN, "--against", path)
    cells = {(cell["key"]["load_ohm"], cell["metric"]): cell for cell in record["cells"]}
    assert (code, set(cells)) == (
        0,
        {("36,0", "energy_line"), ("36,0", "eta_pto"), ("inf", "energy_line")},
    )
    reduced = dict(results.records)["r36ohm.csv"]
    assert cells["36,0", "eta_pto"]["measured"] == pytest.approx(reduced.mean["eta_pto"])
    assert cells["36,0", "energy_line"]["tolerance"]["deviation"] == pytest.approx(
        1e-5
        * (reduced.max_deviation_percent["energy_line_j"] or 0.0)
        * (reduced.mean["energy_line_j"] or 0.0)
    )
    assert "r9ohm.csv (load_ohm 9 ohm)" in record["notes"][0]


@pytest.mark.parametrize(
    ("columns", "key", "words"),
    [
        (COLUMNS.replace('"rpm"', '"kW"'), '["n", "torque"]', "'kW' is none of speed; expected "
                                                              "one of rotation, such as rad/s"),
        (COLUMNS, '"bearing"', "(bearing unknown)"),
        (COLUMNS, "[]", "has no key"),
        ('[columns]\nn = { unit = "rpm", measured = "speed" }\nbearing = { unit = "degC" }\n', '"n"', "add measured"),
        (COLUMNS.replace('"rpm"', '"Hz"'), '["n", "torque"]', "no result belongs to a row of table"),
    ],
)  # fmt: skip
def test_a_table_that_cannot_be_assigned_is_rejected(
    bench: Path, tmp_path: Path, columns: str, key: str, words: str
) -> None:
    path = written(tmp_path, ["200;10;0,21;166;79,4;31"], key, columns)
    called = call("check", bench, "--against", path)
    assert (called.code, called.out, words in called.err) == (2, "", True)


def test_a_thousand_points_are_assigned_to_their_rows_whatever_their_order() -> None:
    points = [
        (n, torque, 0.5 + k * 1e-4)
        for k, (n, torque) in enumerate(product(range(100, 4100, 100), range(5, 130, 5)))
    ]
    text = 'title = "T"\nsource = "S"\nkey = ["speed", "torque"]\nkey_percent = 0\n[columns]\nspeed = { unit = "rad/s" }\n'
    text += 'torque = { unit = "N.m" }\neta_gen = { }\n'
    text += "".join(
        f"[[point]]\nspeed = {n}\ntorque = {torque}\neta_gen = {eta:.4f}\n"
        for n, torque, eta in points
    )
    logs = [
        Measured(f"{k}", "log", {"speed": n, "torque": torque + 0.04, "eta_gen": eta})
        for k, (n, torque, eta) in enumerate(points)
    ]
    shuffled = [logs[k] for k in np.random.default_rng(0).permutation(len(logs)).tolist()]
    found = check(shuffled, parse_table(text, "t.toml"))
    assert (found.ok, [cell.log for cell in found.cells]) == (True, [f"{k}" for k in range(1000)])
