"""A scored trial as text, page and PDF."""

from pathlib import Path

import pytest
from small_trials import answer, cause, say, sealed_trial

from winchcascade.blind.cases import Kind
from winchcascade.blind.score import Score, score
from winchcascade.report.publish import publish
from winchcascade.report.sheet import Table
from winchcascade.report.trial_report import make_trial_report
from winchcascade.report.trial_text import trial_text


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


def test_the_terminal_shows_counts_strengths_and_every_case_that_went_wrong(found: Score) -> None:
    text = trial_text(found, Path("trial"))
    assert "2 of 3" in text
    assert "true parameters within their 95 % intervals" in text
    (line,) = [line for line in text.splitlines() if "case-0002" in line]
    assert "precharge x 0.4" in line
    assert "explained: gas_volume (or piston_area)" in line
    assert "case-0001" not in text
    assert all(len(line) <= 128 for line in text.splitlines())


def test_the_report_shows_what_each_effect_is_taken_for(found: Score) -> None:
    report = make_trial_report(found)
    tables = {b.id: b for s in report.sections for b in s.blocks if isinstance(b, Table)}
    taken = {row[0]: row for row in tables["taken"].rows}
    assert taken["precharge"] == ("precharge", "1", "0", "gas_volume (1)")
    assert taken["brake_drag"][3] == "unexplained (1)"
    assert [row[6] for row in tables["parameters"].rows] == ["yes", "yes", "no"]
    assert [row[2] for row in tables["closure"].rows] == ["95.0 %"]
    assert len(tables["cases"].rows) == 5


def test_page_and_pdf_are_written(found: Score, tmp_path: Path) -> None:
    report = make_trial_report(found, command="winchcascade blind score trial")
    publish(report, html=tmp_path / "t.html", pdf=tmp_path / "t.pdf")
    page = (tmp_path / "t.html").read_text(encoding="utf-8")
    assert "What each effect is taken for" in page
    assert page.count("<svg") == 2
    assert (tmp_path / "t.pdf").read_bytes().startswith(b"%PDF")
