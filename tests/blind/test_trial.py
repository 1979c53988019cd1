"""Dealing and diagnosing: repeatable, resumable, and blind."""

import json
import shutil
from pathlib import Path

import pytest
from scratches import left_scratch
from small_trials import cases_by, fail_on_the_second, find_no_room, guess, once, shipped

from winchcascade.blind.cases import SEALED, plan_cases
from winchcascade.blind.injected import OUTSIDERS, PARTS
from winchcascade.blind.score import score
from winchcascade.blind.trial import DiagnosisMethod, deal, diagnose
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import OptionError, OutputError
from winchcascade.core.jobs import Nobody, Workers
from winchcascade.rig.effects.catalogue import EFFECTS

CASES, SEED = 2, 20260


class Interrupt(Nobody):
    """A watch that interrupts a call once so many are done."""

    def __init__(self, after: int) -> None:
        self.left = after

    def done(self, name: str, fault: str | None) -> None:  # noqa: ARG002
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def dealt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trial") / "cases"
    with cases_by(once):
        assert deal(folder, CASES, SEED).faults == {}
    return folder


@pytest.fixture
def trial(dealt: Path, tmp_path: Path) -> Path:
    return shutil.copytree(dealt, tmp_path / "trial")


def test_a_plan_holds_every_effect_at_every_strength_pairs_none_and_outsiders() -> None:
    plan = plan_cases(124, 1)
    singles = [case.effects for case in plan if case.kind == "single"]
    assert {(name, s) for case in singles for name, s in case.items()} == {
        (n, s) for n in PARTS for s in (0.4, 1.0, 1.5)
    }
    assert {case.outsider for case in plan if case.kind == "outsider"} == set(OUTSIDERS)
    pairs = [list(case.effects) for case in plan if case.kind == "pair"]
    assert all(PARTS[a].stage != PARTS[b].stage for a, b in pairs)
    assert sum(case.kind == "none" for case in plan) == 10


def test_the_order_of_a_plan_shows_nothing() -> None:
    kinds = [case.kind for case in plan_cases(60, 1)]
    assert kinds != sorted(kinds)
    assert kinds != [case.kind for case in plan_cases(60, 2)]


def test_a_dealt_case_is_a_campaign_of_seven_logs_that_says_nothing_of_what_it_hides(dealt: Path) -> None:
    campaign = load_campaign(dealt / "case-0001")
    assert campaign.title == "case-0001"
    assert [run.load for run in campaign.runs] == [float("inf"), 45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    assert all(run.file.is_file() for run in campaign.runs)
    assert {p.name for p in dealt.iterdir()} == {"case-0001", "case-0002", "sealed.json", "trial.json"}
    assert all(name not in text.decode() for text in content(dealt / "case-0001").values() for name in PARTS)


def test_a_call_that_was_cut_short_is_taken_up_and_ends_in_the_same_bytes(dealt: Path, tmp_path: Path) -> None:
    out = tmp_path / "again"
    with cases_by(once), pytest.raises(KeyboardInterrupt):
        deal(out, CASES, SEED, watch=Interrupt(1))
    assert {p.name for p in out.iterdir()} == {"case-0001", "sealed.json", "trial.json"}
    left_scratch(out, as_folder=True)
    with cases_by(once):
        assert deal(out, CASES, SEED).kept == 1
    assert content(out) == content(dealt)
    assert not list(out.glob(".*"))


def test_another_trial_is_not_dealt_over_one_unless_forced(trial: Path) -> None:
    with pytest.raises(OptionError, match="holds another trial"):
        deal(trial, CASES, SEED + 1)
    with cases_by(shipped):
        deal(trial, 1, SEED + 1, force=True)
    assert not (trial / "case-0002").exists()


def test_a_folder_of_something_else_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(OutputError, match="no folder of a trial"):
        deal(tmp_path, 1, 1)


def test_a_trial_with_changed_answers_is_not_dealt_on(trial: Path) -> None:
    shutil.rmtree(trial / "case-0002")
    (trial / SEALED).write_text("{}")
    with pytest.raises(OptionError, match="answers were changed"):
        deal(trial, CASES, SEED)


def test_a_diagnosis_sees_the_logs_of_its_case_and_nothing_else(trial: Path) -> None:
    (trial / SEALED).unlink()  # it stays sealed: diagnose does without it
    assert diagnose(trial, DiagnosisMethod(guess, EFFECTS, seed=3)).faults == {}
    record = json.loads((trial / "diagnoses" / "case-0002.json").read_text())
    logs = ["campaign.toml", "open_circuit.csv", *(f"r{r}ohm.csv" for r in ("18", "27", "36", "45", "4p5", "9"))]
    ahead = [f"predictions/{when}/r36ohm.csv" for when in ("after", "before")]
    assert record["seen"] == [*(f"case-0002/{name}" for name in logs), *ahead]
    assert record["seed"] == 3
    for when in ("before", "after"):
        assert (trial / "predictions" / "case-0002" / when / "r36ohm.csv").is_file()


def test_what_is_diagnosed_is_kept_as_long_as_suspects_and_logs_are_the_same(trial: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        diagnose(trial, DiagnosisMethod(guess, EFFECTS), watch=Interrupt(1))
    assert diagnose(trial, DiagnosisMethod(guess, EFFECTS)).kept == 1
    assert diagnose(trial, DiagnosisMethod(guess, EFFECTS)).kept == 2
    fewer = {name: EFFECTS[name] for name in list(PARTS)[1:]}
    assert diagnose(trial, DiagnosisMethod(guess, fewer)).kept == 0
    with (trial / "case-0001" / "r9ohm.csv").open("a") as log:
        log.write("999.0,0.0,0.0,20.0,200.0,0.0,0.0,0.0\n")
    assert diagnose(trial, DiagnosisMethod(guess, fewer)).kept == 1
    assert diagnose(trial, DiagnosisMethod(guess, fewer), force=True).kept == 0


@pytest.mark.parametrize("name", ["diagnoses/case-0001.json", "predictions/case-0001/after/r36ohm.csv"])
def test_an_altered_diagnosis_is_made_again_and_named(trial: Path, name: str) -> None:
    diagnose(trial, DiagnosisMethod(guess, EFFECTS))
    before = content(trial)
    (trial / name).write_bytes((trial / name).read_bytes().replace(b"0.9", b"0.8"))
    assert content(trial) != before
    done = diagnose(trial, DiagnosisMethod(guess, EFFECTS))
    assert (done.kept, done.altered) == (1, ("case-0001",))
    assert content(trial) == before


def test_an_altered_diagnosis_is_not_scored(trial: Path) -> None:
    diagnose(trial, DiagnosisMethod(guess, EFFECTS))
    path = trial / "diagnoses" / "case-0002.json"
    path.write_bytes(path.read_bytes().replace(b'"verdict": "explained"', b'"verdict": "no_gap"'))
    with pytest.raises(OptionError, match=r"case-0002\.json: was altered after it was made"):
        score(trial)


def test_a_diagnosis_without_a_digest_is_made_again(trial: Path) -> None:
    diagnose(trial, DiagnosisMethod(guess, EFFECTS))
    path = trial / "diagnoses" / "case-0001.json"
    record = json.loads(path.read_bytes())
    del record["trial"]["sha256"], record["trial"]["files"]
    path.write_text(json.dumps(record))
    done = diagnose(trial, DiagnosisMethod(guess, EFFECTS))
    assert (done.kept, done.altered) == (1, ())


def test_a_diagnosis_that_fails_for_lack_of_room_leaves_the_one_that_is_there(trial: Path) -> None:
    diagnose(trial, DiagnosisMethod(guess, EFFECTS))
    before = content(trial)
    done = diagnose(trial, DiagnosisMethod(find_no_room, EFFECTS), force=True)
    assert list(done.faults) == ["case-0001", "case-0002"]
    assert content(trial) == before


def test_a_case_that_cannot_be_diagnosed_does_not_stop_the_others(trial: Path) -> None:
    done = diagnose(trial, DiagnosisMethod(fail_on_the_second, EFFECTS))
    assert list(done.faults) == ["case-0002"]
    assert "too hard" in done.faults["case-0002"]
    assert [p.name for p in (trial / "diagnoses").iterdir()] == ["case-0001.json"]


def test_a_trial_that_is_not_dealt_to_its_end_is_not_diagnosed(trial: Path) -> None:
    shutil.rmtree(trial / "case-0001")
    with pytest.raises(OptionError, match="1 of 2 cases are missing, the first case-0001"):
        diagnose(trial, DiagnosisMethod(guess, EFFECTS))


@pytest.mark.slow
def test_processes_deal_and_diagnose_the_same_bytes(dealt: Path, tmp_path: Path) -> None:
    out = tmp_path / "two"
    assert deal(out, CASES, SEED, workers=Workers(2)).faults == {}
    assert content(out) == content(dealt)
    assert diagnose(out, DiagnosisMethod(guess, EFFECTS), workers=Workers(2)).faults == {}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_deals_and_diagnoses_the_same_bytes(dealt: Path, tmp_path: Path) -> None:
    from distributed import LocalCluster

    out = tmp_path / "there"
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:  # type: ignore[no-untyped-call]
        assert deal(out, CASES, SEED, workers=Workers(scheduler=cluster.scheduler_address)).faults == {}
        assert content(out) == content(dealt)
        assert (
            diagnose(out, DiagnosisMethod(guess, EFFECTS), workers=Workers(scheduler=cluster.scheduler_address)).faults
            == {}
        )
    assert (out / "predictions" / "case-0001" / "after" / "r36ohm.csv").is_file()
