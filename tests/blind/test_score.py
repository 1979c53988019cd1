"""Scores of diagnoses that were made up: names, alternatives, silence, alarms, certainty,
intervals, and truths of others.
"""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from diagnosed import PLANTED, write_campaign
from small_trials import answer, cases_by, cause, say, sealed_trial, shipped
from test_cli import one_sentence, winchcascade

from winchcascade.blind.cases import plan_cases
from winchcascade.blind.judge import CaseScore, Diagnosis, judge
from winchcascade.blind.score import Score, score
from winchcascade.blind.trial import SEALED, answer_of, deal
from winchcascade.blind.truth import Truth, read_truth
from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes
from winchcascade.report.content import Table
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.trials import trial_report


def judged(truth: Truth, verdict: str, *causes: dict[str, Any]) -> CaseScore:
    return judge(
        "a", truth, msgspec.convert({"verdict": verdict, "causes": list(causes)}, Diagnosis)
    )


ONE, TWO = ["ke_shift"], ["ke_shift", "precharge"]


@pytest.mark.parametrize(
    ("effects", "verdict", "causes", "outcome"),
    [
        (ONE, "explained", [cause("ke_shift")], "named"),
        (ONE, "partly_explained", [cause("voltage_gain", "force_zero", "ke_shift")], "named"),
        (TWO, "explained", [cause("precharge"), cause("voltage_gain", "ke_shift")], "named"),
        (
            TWO,
            "explained",
            [cause("ke_shift", "precharge"), cause("voltage_gain", "ke_shift")],
            "named",
        ),
        (ONE, "explained", [cause("voltage_gain")], "misnamed"),
        (ONE, "explained", [cause("ke_shift"), cause("voltage_gain")], "misnamed"),
        (
            ONE,
            "explained",
            [cause("voltage_gain", "force_zero", "force_gain", "ke_shift")],
            "misnamed",
        ),  # a crowd
        (TWO, "explained", [cause("precharge")], "misnamed"),
        (
            TWO,
            "explained",
            [cause("precharge", "ke_shift"), cause("voltage_gain")],
            "misnamed",
        ),  # one cause for two
        (ONE, "no_gap", [], "silent"),
        (ONE, "unexplained", [cause("ke_shift")], "abstained"),
        ([], "no_gap", [], "quiet"),
        ([], "unexplained", [], "false_alarm"),
        ([], "explained", [cause("ke_shift")], "false_alarm"),
    ],
)
def test_effects_are_named_if_each_has_a_cause_or_an_alternative_of_its_own_and_none_is_left_over(
    effects: list[str], verdict: str, causes: list[dict[str, Any]], outcome: str
) -> None:
    assert judged(answer("a", *effects).truth, verdict, *causes).outcome == outcome


@pytest.mark.parametrize(
    ("verdict", "names", "outcome"),
    [
        ("unexplained", ["ke_shift", "precharge", "force_zero"], "recognised"),
        ("partly_explained", ["ke_shift", "precharge"], "recognised"),
        ("partly_explained", ["ke_shift", "precharge", "force_zero"], "mistaken"),
        ("explained", ["ke_shift"], "mistaken"),
        ("no_gap", [], "silent"),
    ],
)
def test_an_outsider_is_recognised_if_it_is_not_explained_away(
    verdict: str, names: list[str], outcome: str
) -> None:
    truth = answer("a", outsider="brake_drag").truth
    assert judged(truth, verdict, *map(cause, names)).outcome == outcome


def sure(effect: str, *alike: str, **further: Any) -> dict[str, Any]:
    return cause(effect, **{"look_alikes": [{"effect": name} for name in alike], **further})


WARM = Truth(named=(("heating",),), may_be_certain=("heating",), alone=False)
EITHER = Truth(named=(("a", "b"),))
LOAD = Truth(named=(("load_entry",),), may_be_certain=("load_entry",), run="r9ohm.csv")


@pytest.mark.parametrize(
    ("truth", "verdict", "causes", "honest", "false", "named"),
    [
        (WARM, "explained", [sure("heating")], True, 0, True),
        (WARM, "explained", [sure("ke_rolloff")], False, 1, False),
        (WARM, "explained", [sure("ke_rolloff", "heating")], True, 0, True),
        (WARM, "explained", [sure("ke_rolloff", probability=0.8)], True, 0, False),
        (WARM, "unexplained", [sure("ke_rolloff")], True, 0, False),
        (WARM, "explained", [sure("heating"), sure("precharge", "x")], True, 0, True),
        (
            msgspec.structs.replace(WARM, alone=True),
            "explained",
            [sure("heating"), sure("a", "x")],
            True,
            0,
            False,
        ),
        (Truth(verdicts=("explained",)), "no_gap", [], False, 0, None),
        (Truth(excused_by=("partly_explained",)), "partly_explained", [sure("x")], True, 0, None),
        (Truth(), "explained", [sure("x")], False, 1, None),
        (EITHER, "explained", [sure("a", "b")], True, 0, True),
        (EITHER, "explained", [sure("a", "c")], True, 0, False),
        (LOAD, "explained", [sure("load_entry", run="r9ohm.csv")], True, 0, True),
        (LOAD, "explained", [sure("load_entry", run="r27ohm.csv")], True, 0, False),
    ],
)
def test_an_answer_is_judged_by_its_certainty_and_its_declared_alternatives(
    truth: Truth,
    verdict: str,
    causes: list[dict[str, Any]],
    honest: bool,
    false: int,
    named: bool | None,
) -> None:
    found = judged(truth, verdict, *causes)
    assert (found.honest, len(found.false), found.named) == (honest, false, named)


@pytest.fixture
def several(tmp_path: Path) -> Score:
    """Named, named by an alternative, misnamed, silent, quiet, recognised, and one without a
    diagnosis.
    """
    answers = [answer("case-0001", "ke_shift"), answer("case-0002", "ke_shift", strength=0.4)]
    answers += [
        answer("case-0003", "precharge"),
        answer("case-0004", "precharge", strength=0.4),
        answer("case-0005"),
    ]
    answers += [answer("case-0006", outsider="brake_drag"), answer("case-0007", "force_zero")]
    folder = sealed_trial(tmp_path / "trial", *answers)
    say(folder, "case-0001", "explained", cause("ke_shift", value=0.52), share=0.97)
    say(folder, "case-0002", "explained", cause("voltage_gain", "ke_shift"))
    say(folder, "case-0003", "explained", cause("gas_volume", "piston_area"))
    say(folder, "case-0004", "no_gap")
    say(folder, "case-0005", "no_gap")
    say(folder, "case-0006", "unexplained")
    return score(folder)


def test_counts_leave_out_what_was_not_diagnosed(several: Score) -> None:
    totals = several.totals
    for name, part, of in (
        ("named", 2, 4), ("named_singles", 2, 4), ("strict", 1, 4), ("misnamed", 1, 4), ("silent", 1, 4), ("covered", 1, 1),
        ("false_alarms", 0, 1), ("outsiders_recognised", 1, 1), ("missing", 1, 7), ("honest", 6, 6),
    ):  # fmt: skip
        assert (totals[name].part, totals[name].of) == (part, of), name
    assert [(s.strength, s.part, s.of) for s in several.strengths] == [(0.4, 1, 2), (1.0, 1, 2)]
    assert several.taken_for == {
        "ke_shift": {"ke_shift": 2},
        "precharge": {"gas_volume": 1, "no gap": 1},
        "nothing injected": {"no gap": 1},
        "brake_drag": {"unexplained": 1},
    }


def test_the_record_and_the_report_of_a_score_hold_counts_and_cases(several: Score) -> None:
    record: Any = msgspec.to_builtins(several)
    assert (record["schema"], record["totals"]["named"]["part"]) == ("winchcascade/score/1", 2)
    assert (record["cases"][0]["share_claimed"], record["cases"][2]["outcome"]) == (
        0.97,
        "misnamed",
    )
    report = trial_report(several)
    tables = {block.id: block.cells for block in report.blocks if isinstance(block, Table)}
    assert [row[:3] for row in tables["taken"]][1:3] == [["ke_shift", 2, 2], ["precharge", 2, 0]]
    assert [row[:4] for row in tables["cases"]] == [
        ["case-0003", "precharge x 1", "misnamed", "explained: gas_volume (or piston_area)"],
        ["case-0004", "precharge x 0.4", "silent", "no gap"],
    ]
    assert terminal_text(report).endswith("\n4 of 6 diagnoses are correct.\n")


@pytest.mark.parametrize(
    ("value", "covered"), [(0.41, 1), (0.39, 0), (0.59, 1), (0.61, 0), (None, 0)]
)
def test_an_interval_covers_the_truth_or_not(value: float | None, covered: int) -> None:
    found = (
        cause("ke_shift") | {"parameters": {}} if value is None else cause("ke_shift", value=value)
    )
    (parameter,) = judged(answer("a", "ke_shift").truth, "explained", found).parameters
    assert parameter.covered == bool(covered)


def test_a_trial_without_a_diagnosis_and_a_file_that_is_none_are_rejected(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "t", answer("case-0001"))
    with pytest.raises(OptionError, match="no case is diagnosed"):
        score(folder)
    say(folder, "case-0001", "perhaps")
    with pytest.raises(
        OptionError, match=r"case-0001\.json: cannot be read .* expected a diagnosis"
    ):
        score(folder)


# ------------------------------------------------------------------------------- truths of others
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ({"effects": {"ke_shift": 0.4}}, ("single", (("ke_shift",),), ())),
        ({"effects": {"ke_shift": {"k_e_change": -0.02}}}, ("single", (("ke_shift",),), ())),
        ({"truth": ["ke_shift", "precharge"]}, ("pair", (("ke_shift",), ("precharge",)), ())),
        ({"effects": {}}, ("none", (), ("no_gap",))),
        ({"truth": [], "honest": "no_gap", "kind": "null"}, ("none", (), ("no_gap",))),
        (
            {"honest": "unexplained or partly_explained"},
            ("outsider", (), ("partly_explained", "unexplained")),
        ),
        ({"effects": {"sprocket_ripple": 1.0}}, ("outsider", (), ())),
        ({"named": [["heating", "ke_rolloff"]]}, ("single", (("heating", "ke_rolloff"),), ())),
        ({"effects": {}, "kind": "wrong gear"}, ("words", (), ())),
        ({"honest": "heating, or the order is reported"}, ("words", (), ())),
    ],
)
def test_a_truth_follows_from_its_effects_its_verdicts_or_its_names(
    tmp_path: Path, text: dict[str, Any], expected: tuple[object, ...]
) -> None:
    (tmp_path / "truth.json").write_text(json.dumps(text))
    found = read_truth(tmp_path / "truth.json")
    assert (found.kind, found.named, found.verdicts) == expected


def test_the_truth_of_a_case_is_read_as_it_was_written(tmp_path: Path) -> None:
    for case in plan_cases(30, 1):
        truth = answer_of(case).truth
        (tmp_path / "truth.json").write_bytes(json_bytes(truth))
        assert read_truth(tmp_path / "truth.json") == truth


def test_a_truth_that_cannot_be_read_is_named_with_what_was_expected(tmp_path: Path) -> None:
    (tmp_path / "truth.json").write_text('{"effects": 3}')
    with pytest.raises(
        OptionError, match=r"truth\.json: cannot be read .* expected the truth of a campaign"
    ):
        read_truth(tmp_path / "truth.json")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A folder of campaigns by another simulator: named, a false certainty, and one that a
    reader judges.
    """
    for name, text in {
        "a": {"effects": ["ke_shift"]},
        "b": {"effects": {}},
        "c": {"honest": "ask the owner"},
    }.items():
        (tmp_path / "own" / name).mkdir(parents=True)
        (tmp_path / "own" / name / "campaign.toml").write_text("")
        (tmp_path / "own" / name / "truth.json").write_text(json.dumps(text))
        say(tmp_path / "own", name, "explained", sure("ke_shift"))
    return tmp_path / "own"


def test_campaigns_that_somebody_else_made_are_judged_by_their_truths(own: Path) -> None:
    done = winchcascade("blind", "score", own, "--json", own / "score.json")
    assert done.returncode == 0, done.stderr
    record = json.loads((own / "score.json").read_text())
    assert [(case["outcome"], case["honest"], case["false"]) for case in record["cases"]] == [
        ("named", True, []), ("false_alarm", False, ["ke_shift"]), ("unjudged", None, []),
    ]  # fmt: skip
    assert "1 of 2 diagnoses are correct" in done.stdout
    assert "ask the owner" in done.stdout


@pytest.mark.slow
def test_campaigns_of_others_are_diagnosed_where_no_diagnosis_is_there(tmp_path: Path) -> None:
    for name in ("copper", "nothing"):
        (tmp_path / "own" / name).mkdir(parents=True)
        write_campaign(tmp_path / "own" / name, PLANTED[name])
        (tmp_path / "own" / name / "truth.json").write_text(
            json.dumps({"effects": list(PLANTED[name])})
        )
    done = winchcascade("blind", "score", tmp_path / "own", "--diagnoses", tmp_path / "kept")
    assert "2 of 2 diagnoses are correct" in done.stdout
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == [
        "copper.json",
        "nothing.json",
    ]


# ----------------------------------------------------------------------------------- the commands
def test_deal_says_what_was_dealt_and_with_which_seal(tmp_path: Path) -> None:
    out = tmp_path / "trial"
    with cases_by(shipped):
        done = winchcascade(
            "blind", "deal", "--cases", "1", "--seed", "5", "--out", out, "--jobs", "1"
        )
    assert done.returncode == 0, done.stderr
    assert f"SHA-256 {json.loads((out / 'trial.json').read_text())['sealed_sha256']}" in done.stdout
    assert deal(out, 1, 5).kept == 1
    assert "holds another trial" in one_sentence(
        "blind", "deal", "--cases", "1", "--seed", "6", "--out", out
    )
    words = ("deal", "--cases", "1", "--seed", "1", "--out", tmp_path / "t", "--scheduler", "here")
    assert "is no address" in one_sentence("blind", *words)


def test_score_prints_the_counts_and_replaces_no_answers(tmp_path: Path) -> None:
    trial = sealed_trial(tmp_path / "trial", answer("case-0001", "ke_shift"), answer("case-0002"))
    say(trial, "case-0001", "explained", cause("ke_shift"))
    say(trial, "case-0002", "no_gap")
    assert "2 of 2 diagnoses are correct" in winchcascade("blind", "score", trial).stdout
    assert (
        json.loads(winchcascade("blind", "score", trial, "--json", "-").stdout)["totals"]["named"][
            "of"
        ]
        == 1
    )
    assert "is an input of this command" in one_sentence(
        "blind", "score", trial, "--json", trial / SEALED, "--force"
    )
    assert "expected the folder of a trial" in one_sentence("blind", "score", tmp_path)
