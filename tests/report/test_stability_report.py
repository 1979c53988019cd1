"""The numbers of causes run by run in sentences, in the JSON and as a figure."""

import msgspec
from diagnosed import diagnosed

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import RunValue, Stability, Trend
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.diagnosis import diagnosis_report
from winchcascade.report.results.diagnosis_record import as_json

NUMBERS = (RunValue(0, 0.3, 0.28, 0.32), RunValue(1, 0.5, 0.48, 0.52))


def with_trends(*trends: Trend) -> ModelDiagnosis:
    found = diagnosed("copper")
    cause = msgspec.structs.replace(found.causes[0], stability=Stability(NUMBERS, trends))
    return msgspec.structs.replace(found, causes=(cause,))


def test_every_run_has_a_number_in_the_json() -> None:
    (cause,) = as_json(diagnosed("copper"))["causes"]
    assert [one["run"] for one in cause["stability"]] == ["r18ohm.csv", "r4p5ohm.csv"]
    for one in cause["stability"]:
        assert one["low"] < 0.4 < one["high"]
    assert cause["trends"] == []


def test_a_run_without_a_number_is_null_with_the_reason() -> None:
    found = with_trends()
    runs = (RunValue(0), RunValue(1, withheld=True))
    cause = msgspec.structs.replace(found.causes[0], stability=Stability(runs, ()))
    (record,) = as_json(msgspec.structs.replace(found, causes=(cause,)))["causes"]
    assert [one["value"] for one in record["stability"]] == [None, None]
    assert [one["reason"] for one in record["stability"]] == ["the run hardly depends on this cause", "withheld"]


def test_what_differs_between_runs_is_stated_of_its_cause_and_in_the_terminal() -> None:
    found = with_trends(Trend("order", 0.2, 0.02, 1e-9))
    made = diagnosis_report(found)
    (trend,) = as_json(found)["causes"][0]["trends"]
    assert [(note.text, note.tone) for note in made.notes if note.about == "Trend"] == [(trend["sentence"], "warn")]
    assert "r4p5ohm.csv" in terminal_text(made)
    assert "r4p5ohm.csv" not in terminal_text(diagnosis_report(with_trends()))
