"""Written files: the fields that other programs rely on."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from winchcascade import read_run, reduce
from winchcascade.core.rig_toml import parse_rig
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import reduction_json
from winchcascade.report.frames import write_parquet

NINE = {
    "energy_line_j", "energy_mech_j", "energy_gen_j", "power_line_w", "power_mech_w", "power_gen_w", "eta_trans", "eta_gen",
    "eta_pto",
}  # fmt: skip


@pytest.fixture
def reduction(fixtures: Path) -> Reduction:
    return reduce(read_run(fixtures / "campaign" / "r36ohm.csv", load=36.0), window=5.48)


@pytest.fixture
def record(reduction: Reduction) -> dict[str, Any]:
    return json.loads(reduction_json(reduction))  # type: ignore[no-any-return]


def test_phases_of_a_cycle_follow_each_other(record: dict[str, Any]) -> None:
    for cycle in record["cycles"]:
        payout, hold, haul_in = (cycle["phases"][p] for p in ("payout", "hold", "haul_in"))
        assert payout[0] < payout[1] == hold[0] < hold[1] == haul_in[0] < haul_in[1]


def test_the_json_states_the_uncertainty_of_every_mean(record: dict[str, Any]) -> None:
    for field in NINE:
        low, high = record["interval_95"][field]
        assert low < record["mean"][field] < high
        assert 0 < record["standard_uncertainty"][field] < high - low
    made = record["uncertainty"]
    assert {"seed", "draws", "stated", "monte_carlo"}.isdisjoint(made)
    for field in NINE:
        shares = [row["share"][field] or 0.0 for row in made["budget"]]
        scatter = (made["repeatability"][field] / record["standard_uncertainty"][field]) ** 2
        assert sum(shares) + scatter == pytest.approx(1.0)


def test_the_uncertainty_of_sensors_without_an_accuracy_is_null(fixtures: Path) -> None:
    rig = parse_rig('name = "bare"\n[winch]\nr_drum = { value = 0.13, unit = "m" }\n', "bare.toml")
    record = json.loads(
        reduction_json(reduce(read_run(fixtures / "campaign" / "r36ohm.csv"), rig=rig))
    )
    assert (
        set(record["standard_uncertainty"].values())
        == set(record["interval_95"].values())
        == {None}
    )
    assert record["uncertainty"]["without_accuracy"] == ["force", "idc", "torque", "vdc"]
    assert record["uncertainty"]["repeatability"]["eta_trans"] > 0


def test_parquet_holds_the_same_rows_as_the_json(reduction: Reduction, tmp_path: Path) -> None:
    files = write_parquet(reduction, tmp_path / "tables")
    cycles, bins, findings = (pq.read_table(path).to_pylist() for path in files)
    record = json.loads(reduction_json(reduction))
    assert [c["eta_trans"] for c in cycles] == [c["eta_trans"] for c in record["cycles"]]
    assert [c["haul_in_force_min_n"] for c in cycles] == [
        c["phase_summary"]["haul_in"]["force_min_n"] for c in record["cycles"]
    ]
    assert [
        {k: v for k, v in b.items() if k not in ("run", "log", "load_ohm")} for b in bins
    ] == record["bins"]
    assert findings == []
    assert {c["load_ohm"] for c in cycles} == {36.0}


def test_parquet_of_a_log_without_cycles_keeps_its_columns(tmp_path: Path) -> None:
    path = tmp_path / "rest.csv"
    rows = "\n".join(f"{0.04 * k:.2f},0.0,0.0,200.0" for k in range(500))
    path.write_text("Time (s),Displacement (m),Velocity (m/s),Force (N)\n" + rows + "\n")
    cycles, _, findings = write_parquet(reduce(read_run(path)), tmp_path / "tables")
    assert pq.read_table(cycles).num_rows == 0
    assert "eta_pto" in pq.read_table(cycles).column_names
    assert (
        pq.read_table(findings).num_rows == 6
    )  # the rig is assumed; no payout; pressure, torque, Vdc and Idc are missing
