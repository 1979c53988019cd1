"""The program that scores the diagnosis on campaigns of the twin."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parent.parent.parent / "benchmarks" / "trials.py"


def trials(*arguments: str | Path) -> str:
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def result(number: int, verdict: str, *causes: str) -> str:
    """A line of the results of a case with nothing injected."""
    found = {"verdict": verdict, "causes": [{"effect": name} for name in causes]}
    plan = {"family": "nothing", "number": number}
    times = {"making": 2.0, "diagnosing": 10.0, "commit": "0000000"}
    return json.dumps({"plan": plan, "parameters": {}, "found": found, **times}) + "\n"


def test_a_score_counts_the_results_and_lists_the_cases_that_missed(tmp_path: Path) -> None:
    lines = [result(1, "no_gap"), result(2, "explained", "rotor_windage"), '{"plan": {"fam']
    (tmp_path / "nothing.jsonl").write_text("".join(lines))
    table = trials("--family", "nothing", "--score", "--out", tmp_path)
    assert "1 of 2" in table
    assert "too few: 2 of 60" in table
    assert "explained: rotor_windage" in table


@pytest.mark.slow
def test_a_wrong_load_counts_only_in_its_own_run(tmp_path: Path) -> None:
    entry = {"effect": "load_entry", "factor": 1.5, "log": "r27ohm"}
    part = {"effect": "load_entry", "kind": "entry", "value": 0.01, "low": 0.0, "high": 0.02}
    lines = []
    for number, run in enumerate(("r27ohm.csv", "r9ohm.csv"), 1):
        cause = {"effect": "load_entry", "run": run}
        accounts = [{"metric": "eta_trans", "load_ohm": "inf", "parts": [part]}]
        found = {"verdict": "explained", "causes": [cause], "contributions": accounts}
        plan = {"family": "entries", "number": number, "entry": entry}
        times = {"making": 2.0, "diagnosing": 10.0, "commit": "0000000"}
        lines.append(json.dumps({"plan": plan, "parameters": {}, "found": found, **times}) + "\n")
    (tmp_path / "entries.jsonl").write_text("".join(lines))
    table = trials("--family", "entries", "--score", "--out", tmp_path)
    assert table.count("1 of 2") == 2  # all entries, and those of this kind
    assert "   2  load_entry of r27ohm x 1.500" in table


@pytest.mark.slow
def test_a_case_is_done_once_and_kept(tmp_path: Path) -> None:
    part = ("--family", "nothing", "--cases", "1", "--first", "3", "--jobs", "1", "--out", tmp_path)
    assert "1 cases" in trials(*part)
    line = (tmp_path / "nothing.jsonl").read_bytes()
    assert json.loads(line)["found"]["verdict"] in ("no_gap", "explained", "partly_explained", "unexplained")
    trials(*part)
    assert (tmp_path / "nothing.jsonl").read_bytes() == line


@pytest.mark.slow
def test_a_quick_fit_that_stops_short_does_not_end_the_search(tmp_path: Path) -> None:
    # Here the quick fit of the true effect ends with less evidence than the fit without any cause.
    table = trials("--family", "contributions", "--cases", "1", "--first", "23", "--jobs", "1", "--out", tmp_path)
    assert "of those whose cause is named alone" in table
    found = json.loads((tmp_path / "contributions.jsonl").read_bytes())["found"]
    assert [cause["effect"] for cause in found["causes"]] == ["gear_mesh_loss"]
