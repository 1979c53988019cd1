"""Loads are compared at one motion: the plateau speed stands beside them, and a best load is
claimed only if it is the same.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from calls import call

from winchcascade.reduction.campaign_record import campaign_from, rank_loads

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
LOADS = {
    "r45ohm": 45.0,
    "r36ohm": 36.0,
    "r27ohm": 27.0,
    "r18ohm": 18.0,
    "r9ohm": 9.0,
    "r4p5ohm": 4.5,
}
ROUNDED = 1e-12


def batched(folder: Path, names: Mapping[str, float]) -> dict[str, Any]:
    """The record of a batch of some logs of the shipped campaign, of windows of one length."""
    runs = ""
    for name, load in names.items():
        shutil.copy(CAMPAIGN / f"{name}.csv", folder)
        runs += f'[[run]]\nfile = "{name}.csv"\nload_ohm = {load}\nwindow_s = 5.0\n'
    (folder / "campaign.toml").write_text(
        f'title = "Loads"\nrig = "hsu2026"\n{runs}', encoding="utf-8"
    )
    called = call("batch", folder, "--out", folder / "out", "--reports", "none", "--jobs", "1")
    assert called.code == 0, called.err
    record: dict[str, Any] = json.loads(
        (folder / "out" / "campaign.json").read_text(encoding="utf-8")
    )
    return record


def cycles_of(folder: Path, name: str) -> list[float]:
    """Plateau speeds of the cycles of a log by the record of its reduction. [m/s]"""
    record = json.loads((folder / "out" / "runs" / f"{name}.csv.json").read_text(encoding="utf-8"))
    return [cycle["phase_summary"]["payout"]["plateau"]["speed_mps"] for cycle in record["cycles"]]


def test_no_best_load_is_claimed_of_loads_at_different_speeds(tmp_path: Path) -> None:
    record = batched(tmp_path, LOADS | {"open_circuit": math.inf})
    assert record["best_load"] is None
    assert isinstance(record["best_load_reason"], str)
    slow, fast = record["plateau_speeds_mps"]
    assert slow == pytest.approx(0.317, abs=0.002)
    assert fast == pytest.approx(0.858, abs=0.002)
    speeds = {run["name"]: run["plateau_speed_mps"] for run in record["runs"]}
    for name in LOADS:
        of_cycles = cycles_of(tmp_path, name)
        assert speeds[f"{name}.csv"] == pytest.approx(sum(of_cycles) / len(of_cycles), rel=ROUNDED)


def test_the_best_of_loads_at_one_speed_is_claimed(tmp_path: Path) -> None:
    record = batched(tmp_path, {name: LOADS[name] for name in ("r45ohm", "r36ohm", "r18ohm")})
    low, high = record["plateau_speeds_mps"]
    assert high <= 1.05 * low
    best = record["best_load"]
    runs = [run for run in record["runs"] if run["load_ohm"] == best["load_ohm"]]
    assert best["value"] == max(run["mean"]["eta_pto"] for run in record["runs"])
    assert (best["run"], best["metric"]) == (runs[0]["name"], "eta_pto")
    assert 0.5 < best["probability"] <= 1.0
    assert record["best_load_reason"] is None


def test_the_speeds_may_differ_by_five_percent(tmp_path: Path) -> None:
    record = batched(tmp_path, {name: LOADS[name] for name in ("r36ohm", "r18ohm")})
    for speed, claimed in (
        (0.82, True),
        (0.819, False),
        (0.9, True),
        (0.905, False),
        (None, False),
    ):
        for run, its in zip(record["runs"], (0.861, speed), strict=True):
            run["plateau_speed_mps"] = its
        ranking = rank_loads(campaign_from(record).reduced)
        assert (ranking.best is not None) == claimed, speed
        assert bool(ranking.reason) != claimed, speed
