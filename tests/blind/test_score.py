"""Scores of diagnoses that were made up: names, rivals, silence, alarms, outsiders, intervals, and the tables of all."""

from pathlib import Path

import pytest
from small_trials import answer, cause, say, sealed_trial

from winchcascade.blind.cases import Kind
from winchcascade.blind.score import Count, Score, score, score_record, taken_as
from winchcascade.core.errors import OptionError


def scored(tmp_path: Path, kind: Kind, effects: list[str], verdict: str, *causes: dict[str, object]) -> str:
    """Outcome of one case."""
    outsider = "brake_drag" if kind == "outsider" else None
    folder = sealed_trial(tmp_path / "t", answer("case-0001", kind, dict.fromkeys(effects, 1.0), outsider=outsider))
    say(folder, "case-0001", verdict, *causes)
    return score(folder).cases[0].outcome


NAMED: list[tuple[list[str], list[dict[str, object]]]] = [
    (["ke_shift"], [cause("ke_shift")]),
    (["ke_shift"], [cause("voltage_gain", "ke_shift")]),
    (["ke_shift"], [cause("voltage_gain", "force_zero", "ke_shift")]),
    (["ke_shift", "precharge"], [cause("precharge"), cause("ke_shift")]),
    (["ke_shift", "precharge"], [cause("precharge"), cause("voltage_gain", "ke_shift")]),
    (["ke_shift", "precharge"], [cause("ke_shift", "precharge"), cause("voltage_gain", "ke_shift")]),
]
MISNAMED: list[tuple[list[str], list[dict[str, object]]]] = [
    (["ke_shift"], [cause("voltage_gain")]),
    (["ke_shift"], [cause("ke_shift"), cause("voltage_gain")]),
    (["ke_shift"], [cause("voltage_gain", "force_zero", "force_gain", "ke_shift")]),  # a crowd
    (["ke_shift", "precharge"], [cause("precharge")]),
    (["ke_shift", "precharge"], [cause("precharge", "ke_shift"), cause("voltage_gain")]),  # one cause, two effects
]


@pytest.mark.parametrize(("effects", "causes"), NAMED)
@pytest.mark.parametrize("verdict", ["explained", "partly_explained"])
def test_effects_are_named_if_each_has_a_cause_or_a_rival_of_its_own_and_none_is_left_over(
    tmp_path: Path, effects: list[str], causes: list[dict[str, object]], verdict: str
) -> None:
    assert scored(tmp_path, "single" if len(effects) == 1 else "pair", effects, verdict, *causes) == "named"


@pytest.mark.parametrize(("effects", "causes"), MISNAMED)
def test_anything_else_is_a_wrong_name(tmp_path: Path, effects: list[str], causes: list[dict[str, object]]) -> None:
    assert scored(tmp_path, "single" if len(effects) == 1 else "pair", effects, "explained", *causes) == "misnamed"


def test_silence_and_abstention_are_distinguished(tmp_path: Path) -> None:
    assert scored(tmp_path / "a", "single", ["ke_shift"], "no_gap") == "silent"
    assert scored(tmp_path / "b", "single", ["ke_shift"], "unexplained") == "abstained"
    assert scored(tmp_path / "c", "single", ["ke_shift"], "unexplained", cause("ke_shift")) == "abstained"


@pytest.mark.parametrize("verdict", ["explained", "partly_explained", "unexplained"])
def test_any_gap_where_nothing_is_hidden_is_a_false_alarm(tmp_path: Path, verdict: str) -> None:
    assert scored(tmp_path, "none", [], verdict, cause("ke_shift")) == "false_alarm"


def test_no_gap_where_nothing_is_hidden_is_right(tmp_path: Path) -> None:
    assert scored(tmp_path, "none", [], "no_gap") == "quiet"


OUTSIDE: list[tuple[str, list[str], str]] = [
    ("unexplained", [], "recognised"),
    ("unexplained", ["ke_shift", "precharge", "force_zero"], "recognised"),
    ("partly_explained", ["ke_shift", "precharge"], "recognised"),
    ("partly_explained", ["ke_shift", "precharge", "force_zero"], "mistaken"),
    ("explained", ["ke_shift"], "mistaken"),
    ("no_gap", [], "silent"),
]


@pytest.mark.parametrize(("verdict", "names", "outcome"), OUTSIDE)
def test_an_outsider_is_recognised_if_it_is_not_explained_away(
    tmp_path: Path, verdict: str, names: list[str], outcome: str
) -> None:
    assert scored(tmp_path, "outsider", [], verdict, *(cause(name) for name in names)) == outcome


@pytest.fixture
def several(tmp_path: Path) -> Score:
    """Named, named by a rival, misnamed, silent, quiet, recognised, and one without a diagnosis."""
    effects: list[tuple[Kind, dict[str, float]]] = [
        ("single", {"ke_shift": 1.0}),
        ("single", {"ke_shift": 0.4}),
        ("single", {"precharge": 1.0}),
        ("single", {"precharge": 0.4}),
        ("none", {}),
    ]
    answers = [answer(f"case-{k:04d}", kind, e) for k, (kind, e) in enumerate(effects, 1)]
    answers += [
        answer("case-0006", "outsider", outsider="brake_drag"),
        answer("case-0007", "single", {"force_zero": 1.0}),
    ]
    folder = sealed_trial(tmp_path / "trial", *answers)
    say(folder, "case-0001", "explained", cause("ke_shift", value=0.52), share=0.97)
    say(folder, "case-0002", "explained", cause("voltage_gain", "ke_shift"))
    say(folder, "case-0003", "explained", cause("gas_volume"))
    say(folder, "case-0004", "no_gap")
    say(folder, "case-0005", "no_gap")
    say(folder, "case-0006", "unexplained")
    return score(folder)


def test_counts_leave_out_what_was_not_diagnosed(several: Score) -> None:
    assert several.count("named", "single") == Count(2, 4)
    assert several.strict == Count(1, 4)
    assert several.count("misnamed", "single") == Count(1, 4)
    assert several.count("silent", "single") == Count(1, 4)
    assert several.count("false_alarm", "none") == Count(0, 1)
    assert several.count("recognised", "outsider") == Count(1, 1)
    assert several.missing == Count(1, 7)
    assert several.strengths == {0.4: Count(1, 2), 1.0: Count(1, 2)}


def test_the_table_of_names_shows_what_each_effect_was_taken_for(several: Score) -> None:
    assert several.taken_for == {
        "ke_shift": {"ke_shift": 2},
        "precharge": {"gas_volume": 1, "no gap": 1},
        "nothing injected": {"no gap": 1},
        "brake_drag": {"unexplained": 1},
    }
    assert taken_as(several.cases[0]) == "ke_shift"


def test_only_parameters_of_true_causes_count_for_coverage(several: Score) -> None:
    assert several.coverage == Count(1, 1)


@pytest.mark.parametrize(("value", "covered"), [(0.41, True), (0.39, False), (0.59, True), (0.61, False)])
def test_an_interval_covers_the_truth_or_not(tmp_path: Path, value: float, covered: bool) -> None:
    folder = sealed_trial(tmp_path / "t", answer("case-0001", "single", {"ke_shift": 1.0}, truth={"ke_shift": 0.5}))
    say(folder, "case-0001", "explained", cause("ke_shift", value=value, half=0.1))
    assert score(folder).coverage == Count(int(covered), 1)


def test_a_parameter_that_is_not_reported_is_not_covered(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "t", answer("case-0001", "single", {"ke_shift": 1.0}))
    say(folder, "case-0001", "explained", cause("ke_shift") | {"parameters": {}})
    assert score(folder).coverage == Count(0, 1)


def test_the_record_of_a_score_holds_counts_and_cases(several: Score) -> None:
    record = score_record(several)
    totals = record["totals"]
    assert isinstance(totals, dict)
    assert totals["named"]["part"] == 2
    assert record["schema"] == "winchcascade/score/1"
    assert isinstance(record["cases"], list)
    assert record["cases"][0]["share_claimed"] == 0.97


def test_a_trial_without_any_diagnosis_cannot_be_scored(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="no case is diagnosed"):
        score(sealed_trial(tmp_path / "t", answer("case-0001", "none")))


def test_a_file_that_is_no_diagnosis_is_named(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "t", answer("case-0001", "none"))
    say(folder, "case-0001", "perhaps")
    with pytest.raises(OptionError, match=r"case-0001\.json: is no diagnosis"):
        score(folder)
