"""What the report of a scored trial states."""

from pathlib import Path

import pytest
from small_trials import answer, cause, say, sealed_trial

from winchcascade.blind.cases import Kind
from winchcascade.blind.score import Score, score
from winchcascade.report.content import Cell, Report, Table
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.trials import trial_report


@pytest.fixture
def found(tmp_path: Path) -> Score:
    hidden: list[tuple[Kind, dict[str, float], str | None]] = [
        ("single", {"ke_shift": 1.0}, None),
        ("single", {"precharge": 0.4}, None),
        ("pair", {"line_drag": 1.0, "torque_gain": 1.0}, None),
        ("none", {}, None),
        ("outsider", {}, "brake_drag"),
    ]
    answers = [answer(f"case-{k:04d}", kind, e, outsider=o) for k, (kind, e, o) in enumerate(hidden, 1)]
    folder = sealed_trial(tmp_path / "trial", *answers)
    say(folder, "case-0001", "explained", cause("ke_shift", "voltage_gain"), share=0.95)
    say(folder, "case-0002", "explained", cause("gas_volume", "piston_area"))
    say(folder, "case-0003", "explained", cause("line_drag"), cause("torque_gain", value=0.9))
    say(folder, "case-0004", "no_gap")
    say(folder, "case-0005", "unexplained")
    return score(folder)


def rows(report: Report, name: str) -> list[list[Cell]]:
    (found,) = [block for block in report.blocks if isinstance(block, Table) and block.id == name]
    return found.cells


def test_a_trial_states_its_counts_and_what_each_effect_is_taken_for(found: Score) -> None:
    report = trial_report(found)
    counted = {row[0]: row[1] for row in rows(report, "totals")}
    assert counted["misnamed"] == "1 of 3"
    assert counted["true parameters within their 95 % intervals"] == "2 of 3"
    assert [row[:2] for row in rows(report, "strengths")] == [["0.4", "0 of 1"], ["1", "1 of 1"]]
    taken = {row[0]: row[1:] for row in rows(report, "taken")}
    assert taken["precharge"] == [1, 0, "gas_volume (1)"]
    assert taken["brake_drag"] == [1, 0, "unexplained (1)"]
    assert list(taken)[:3] == ["nothing injected", "ke_shift", "precharge"]


def test_a_trial_lists_the_cases_that_went_wrong_alone(found: Score) -> None:
    assert rows(trial_report(found), "cases") == [
        ["case-0002", "precharge x 0.4", "misnamed", "explained: gas_volume (or piston_area)"]
    ]
    assert terminal_text(trial_report(found)).endswith("\n4 of 5 diagnoses are correct.\n")


def test_a_case_without_a_diagnosis_is_counted_as_missing(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "trial", answer("case-0001", "none"), answer("case-0002", "none"))
    say(folder, "case-0001", "explained", cause("ke_shift"))
    report = trial_report(score(folder))
    counted = {row[0]: row[1] for row in rows(report, "totals")}
    assert counted == {"false alarms with nothing injected": "1 of 1", "without a diagnosis": "1 of 2"}
    assert [row[0] for row in rows(report, "cases")] == ["case-0001"]
