"""The numbers of causes run by run in sentences, in the JSON and as a figure."""

import msgspec
from diagnosed import diagnosed

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import RunValue, Stability, Trend
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
    assert [one["reason"] for one in record["stability"]] == [
        "the run hardly depends on this cause",
        "withheld",
    ]
