"""The program that scores the diagnosis on families of campaigns of the twin."""

import json
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from winchcascade.blind.injected import INJECTED
from winchcascade.blind.truth import read_truth

PROGRAM = Path(__file__).parent.parent.parent / "benchmarks" / "trials.py"


FAMILIES = runpy.run_path(str(PROGRAM.parent / "families.py"))


def plans(family: str) -> list[Any]:
    return [
        FAMILIES["plan_case"](family, number)
        for number in range(1, FAMILIES["FAMILIES"][family].cases + 1)
    ]


def test_drawn_rigs_have_the_parts_that_their_effects_act_on_and_every_effect_is_tried() -> None:
    single, pairs = plans("machines"), plans("machines_pairs")
    assert all(plan.machine.has(name) for plan in (*single, *pairs) for name in plan.effects)
    assert {name for plan in single for name in plan.effects} == set(INJECTED)
    assert all(len({INJECTED[name].stage for name in plan.effects}) == 2 for plan in pairs)
    kinds = [plan.machine.restoring.kind for plan in single]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "gas_screw": 50,
        "spring": 17,
        "counterweight": 17,
        "none": 16,
    }


def test_a_wrong_product_is_one_of_gear_ratio_and_back_emf_as_often_on_rigs_with_a_gear() -> None:
    wrong = plans("undetermined")
    assert [plan.entry.effect for plan in wrong].count("gear_ratio") == len(wrong) / 2
    assert all(
        0.03 <= abs(plan.entry.factor - 1.0) <= 0.1 and not plan.machine.direct for plan in wrong
    )


def trials(*arguments: str | Path) -> str:
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def result(family: str, number: int, verdict: str, *causes: dict[str, Any]) -> str:
    """A line of the results."""
    found = {"verdict": verdict, "causes": [{"probability": 0.9, **cause} for cause in causes]}
    times = {"making": 2.0, "diagnosing": 10.0, "processor": 11.0, "commit": "0000000"}
    return (
        json.dumps({"plan": {"family": family, "number": number}, "found": found, **times}) + "\n"
    )


@pytest.mark.slow
def test_a_score_counts_the_results_and_lists_the_cases_that_missed(tmp_path: Path) -> None:
    lines = [
        result("nothing", 1, "no_gap"),
        result("nothing", 2, "explained", {"effect": "rotor_windage"}),
    ]
    (tmp_path / "nothing.jsonl").write_text("".join((*lines, '{"plan": {"fam')))
    wrong = [{"effect": "load_entry", "run": run} for run in ("r27ohm.csv", "r9ohm.csv")]
    lines = [result("entries", 2, "explained", cause) for cause in wrong]
    (tmp_path / "entries.jsonl").write_text(lines[1])
    assert "0 of 1" in trials("--family", "entries", "--score", "--out", tmp_path)
    (tmp_path / "entries.jsonl").write_text(lines[0])
    table = " ".join(trials("--score", "--out", tmp_path).split())
    assert "honest 1 of 2 50.0 % 98 % of 60 too few" in table
    assert "missed 2 logger" in table
    assert "explained: rotor_windage" in table
    assert "1 of 1 100.0 % 90 % of 60" in table
    assert "processor time of the diagnoses 22 s, median 11.0 s" in table


@pytest.mark.slow
def test_a_case_is_made_once_and_diagnosed_once(tmp_path: Path) -> None:
    part = (
        "--family",
        "calibrated",
        "--cases",
        "1",
        "--first",
        "3",
        "--jobs",
        "1",
        "--out",
        tmp_path,
    )
    trials(*part, "--make", tmp_path / "made")
    folder = tmp_path / "made" / "calibrated" / "0003"
    assert len(list(folder.glob("*.csv"))) == 7
    assert read_truth(folder / "truth.json").kind == "single"
    assert not (tmp_path / "calibrated.jsonl").exists()
    assert "calibrated: 1 cases; median 0.0 s to make" in trials(*part, "--from", tmp_path / "made")
    line = (tmp_path / "calibrated.jsonl").read_bytes()
    found = json.loads(line)
    assert found["found"]["verdict"] == found["plain"]["verdict"]
    assert found["processor"] > 1.0
    trials(*part)
    assert (tmp_path / "calibrated.jsonl").read_bytes() == line
