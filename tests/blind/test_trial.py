"""Dealing and diagnosing: repeatable, resumable, blind, and within the folder of the trial."""

import hashlib
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from calls import call
from scratches import left_scratch
from small_trials import cases_by, fail_on_the_second, find_no_room, guess, shipped

from winchcascade.blind.cases import plan_cases
from winchcascade.blind.injected import OUTSIDERS, PARTS
from winchcascade.blind.score import score
from winchcascade.blind.trial import (
    SEALED,
    TRIAL,
    SealedAnswers,
    answer_of,
    deal,
    diagnose,
    open_seal,
    read_trial,
    seal,
)
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import OptionError, OutputError, WinchcascadeError
from winchcascade.core.jobs import Nobody, Workers
from winchcascade.core.store import LOCK, digest_of

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
    return {
        str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


@pytest.fixture(scope="module")
def dealt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trial") / "cases"
    assert deal(folder, CASES, SEED).faults == {}
    return folder


@pytest.fixture(scope="module")
def judged(dealt: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The cases with their diagnoses."""
    folder = shutil.copytree(dealt, tmp_path_factory.mktemp("judged") / "trial")
    assert diagnose(folder, guess).faults == {}
    return folder


@pytest.fixture
def trial(dealt: Path, tmp_path: Path) -> Path:
    return shutil.copytree(dealt, tmp_path / "trial")


# ---------------------------------------------------------------------------------------- dealing
def test_a_plan_holds_every_effect_at_every_strength_pairs_none_and_outsiders_in_no_order() -> None:
    plan = plan_cases(124, 1)
    singles = {pair for case in plan if case.kind == "single" for pair in case.effects.items()}
    assert singles == {(name, strength) for name in PARTS for strength in (0.4, 1.0, 1.5)}
    assert {case.outsider for case in plan if case.kind == "outsider"} == set(OUTSIDERS)
    pairs = [list(case.effects) for case in plan if case.kind == "pair"]
    assert all(PARTS[a].stage != PARTS[b].stage for a, b in pairs)
    kinds = [case.kind for case in plan]
    assert kinds.count("none") == 10
    assert kinds not in (sorted(kinds), [case.kind for case in plan_cases(124, 2)])


@pytest.mark.slow
def test_a_seed_deals_what_it_always_has(dealt: Path) -> None:
    sealed, _ = seal(SealedAnswers(7, tuple(answer_of(case) for case in plan_cases(20, 7))))
    assert hashlib.sha256(sealed).hexdigest()[:16] == "342c7fee891e6c4f"
    logs = b"".join(content(dealt / "case-0001").values())
    assert hashlib.sha256(logs).hexdigest()[:16] == "d670e857287fd2ab"


def test_a_dealt_case_is_a_campaign_of_seven_logs_that_says_nothing_of_what_it_hides(
    dealt: Path,
) -> None:
    campaign = load_campaign(dealt / "case-0001")
    assert campaign.title == "case-0001"
    assert [run.load for run in campaign.runs] == [float("inf"), 45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    assert all(run.file.is_file() for run in campaign.runs)
    assert {p.name for p in dealt.iterdir()} == {"case-0001", "case-0002", SEALED, TRIAL}
    words = {
        word
        for text in content(dealt / "case-0001").values()
        for word in re.findall(r"\w+", text.decode())
    }
    assert words.isdisjoint(PARTS)
    assert not any(word in (dealt / TRIAL).read_text() for word in ("seed", *PARTS))


@pytest.mark.slow
def test_a_call_that_was_cut_short_is_taken_up_and_ends_in_the_same_bytes(
    dealt: Path, tmp_path: Path
) -> None:
    out = tmp_path / "again"
    with pytest.raises(KeyboardInterrupt):
        deal(out, CASES, SEED, watch=Interrupt(1))
    assert {p.name for p in out.iterdir()} == {"case-0001", SEALED, TRIAL}
    left_scratch(out, as_folder=True)
    assert deal(out, CASES, SEED).kept == 1
    assert content(out) == content(dealt)
    assert not list(out.glob(".*"))


def test_another_trial_is_not_dealt_over_one_unless_forced(trial: Path, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="holds another trial"):
        deal(trial, CASES, SEED + 1)
    with cases_by(shipped):
        deal(trial, 1, SEED + 1, force=True)
    assert not (trial / "case-0002").exists()
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(OutputError, match="no folder of a trial"):
        deal(tmp_path, 1, 1)


# --------------------------------------------------------------------------------------- the seal
def test_changed_or_missing_answers_are_rejected(trial: Path) -> None:
    shutil.rmtree(trial / "case-0002")
    (trial / SEALED).write_text((trial / SEALED).read_text().replace('"seed": ', '"seed": 1'))
    for act in (open_seal, score, lambda folder: deal(folder, CASES, SEED)):
        with pytest.raises(OptionError, match="answers were changed after the cases were dealt"):
            act(trial)
    (trial / SEALED).unlink()
    with pytest.raises(OptionError, match=r"sealed\.json: cannot be read"):
        open_seal(trial)


@pytest.mark.parametrize(
    "record",
    [
        b"",
        b"[]",
        b"{}",
        b'{"schema": "winchcascade/trial/1"}',
        b'{"schema": "\xff"}',
        b'{"a": ' + 9999 * b"[",
    ],
)
def test_a_folder_without_a_record_of_a_trial_is_rejected(tmp_path: Path, record: bytes) -> None:
    if record:
        (tmp_path / TRIAL).write_bytes(record)
    with pytest.raises(OptionError, match=r"trial\.json"):
        read_trial(tmp_path)


# ------------------------------------------------------------------------------------- diagnosing
def test_a_diagnosis_sees_the_campaign_of_its_case_and_nothing_else(trial: Path) -> None:
    (trial / SEALED).unlink()  # it stays sealed: diagnose does without it
    assert diagnose(trial, guess).faults == {}
    logs = [
        "campaign.toml",
        "open_circuit.csv",
        *(f"r{r}ohm.csv" for r in ("18", "27", "36", "45", "4p5", "9")),
        "rig.toml",
    ]
    record = json.loads((trial / "diagnoses" / "case-0002.json").read_text())
    assert record["seen"] == [f"case-0002/{name}" for name in logs]


def test_what_is_diagnosed_is_kept_as_long_as_the_logs_are_the_same(
    trial: Path, tmp_path: Path
) -> None:
    with pytest.raises(KeyboardInterrupt):
        diagnose(trial, guess, watch=Interrupt(1))
    assert [diagnose(trial, guess).kept for _ in range(2)] == [1, 2]
    with (trial / "case-0001" / "r9ohm.csv").open("a") as log:
        log.write("999.0,0.0,0.0,20.0,200.0,0.0,0.0,0.0\n")
    assert diagnose(trial, guess).kept == 1
    assert diagnose(trial, guess, force=True).kept == 0
    assert diagnose(trial, guess, diagnoses=tmp_path / "elsewhere").kept == 0
    assert content(tmp_path / "elsewhere") == content(trial / "diagnoses")


def test_an_altered_diagnosis_is_not_scored_but_made_again_and_named(trial: Path) -> None:
    diagnose(trial, guess)
    before = content(trial)
    path = trial / "diagnoses" / "case-0001.json"
    path.write_bytes(path.read_bytes().replace(b'"explained"', b'"no_gap"'))
    with pytest.raises(OptionError, match=r"case-0001\.json: was altered after it was made"):
        score(trial)
    done = diagnose(trial, guess)
    assert (done.kept, done.altered) == (1, ("case-0001",))
    assert content(trial) == before


def test_a_case_that_fails_does_not_stop_the_others_and_leaves_what_is_there(trial: Path) -> None:
    done = diagnose(trial, fail_on_the_second)
    assert list(done.faults) == ["case-0002"]
    assert "too hard" in done.faults["case-0002"]
    before = content(trial)
    assert list(diagnose(trial, find_no_room, force=True).faults) == ["case-0001", "case-0002"]
    assert content(trial) == before
    shutil.rmtree(trial / "case-0001")
    with pytest.raises(OptionError, match="1 of 2 cases are missing, the first case-0001"):
        diagnose(trial, guess)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("cluster", [False, True])
def test_processes_and_a_cluster_deal_and_diagnose_the_same_bytes(
    dealt: Path, tmp_path: Path, cluster: bool
) -> None:
    from distributed import LocalCluster

    out, workers = tmp_path / "there", Workers(2)
    with LocalCluster(
        n_workers=int(cluster), threads_per_worker=1, dashboard_address=None
    ) as found:  # type: ignore[no-untyped-call]
        if cluster:
            workers = Workers(scheduler=found.scheduler_address)
        assert deal(out, CASES, SEED, workers=workers).faults == {}
        assert content(out) == content(dealt)
        assert diagnose(out, guess, workers=workers).faults == {}


# ------------------------------------------------------------------ nothing outside of the folder
NAMES = (
    "../user", "../../user", "case-0001/../../user", "..", ".", "", "user", "case-1", "CASE-0001", "case-0001/", "case-0001\n",
    "..\\user", "C:\\user", "\u0000", "case-0000",
)  # fmt: skip
LINKS = (
    TRIAL,
    SEALED,
    LOCK,
    "case-0001",
    "case-0001/r9ohm.csv",
    "diagnoses",
    "diagnoses/case-0001.json",
)
ACTS: dict[str, Callable[[Path], object]] = {
    "deal": lambda trial: deal(trial, 2, SEED),
    "deal by force": lambda trial: deal(trial, 1, SEED + 1, force=True),
    "diagnose": lambda trial: diagnose(trial, guess),
    "score": score,
}


def forge(trial: Path, name: str) -> None:
    """Name a case otherwise in the record of a trial and in its answers, with the digest that
    belongs to them.
    """
    answers = json.loads((trial / SEALED).read_bytes())
    answers["answers"][0]["case"] = name
    sealed = json.dumps(answers).encode()
    (trial / SEALED).write_bytes(sealed)
    record = json.loads((trial / TRIAL).read_bytes())
    (trial / TRIAL).write_text(
        json.dumps(record | {"cases": [name], "sealed_sha256": digest_of(sealed)})
    )


def link(trial: Path, user: Path, name: str) -> None:
    """Put a link to what the user has in the place of a file or folder of a trial."""
    place = trial / name
    target = user / "case-0001" if place.is_dir() else user / "own.json"
    shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)
    place.symlink_to(target)


@pytest.mark.parametrize("act", ACTS)
def test_no_forged_name_and_no_link_leads_a_call_out_of_its_folder(
    judged: Path, tmp_path: Path, act: str
) -> None:
    rejected = 0
    for k, name in enumerate((*NAMES, *LINKS)):
        trial, user = (
            shutil.copytree(judged, tmp_path / f"{k}" / "trial"),
            tmp_path / f"{k}" / "user",
        )
        (user / "case-0001").mkdir(parents=True)
        (user / "own.json").write_text('{"schema": "winchcascade/reduction/1", "mine": true}')
        for mine in ("campaign.toml", "r9ohm.csv", "case-0001.json"):
            (user / "case-0001" / mine).write_text("mine")
        before = content(user)
        if name in NAMES:
            forge(trial, name)
        else:
            link(trial, user, name)
        try:
            with cases_by(shipped):
                ACTS[act](trial)
        except WinchcascadeError:
            rejected += 1
        assert content(user) == before, name
    assert rejected >= len(NAMES)


def test_the_command_rejects_a_forged_name_with_one_sentence(trial: Path) -> None:
    forge(trial, "../user")
    for words in (
        ("deal", "--cases", "2", "--seed", f"{SEED}", "--out"),
        ("diagnose",),
        ("score",),
    ):
        said = call("blind", *words, trial)
        assert said.code == 2
        assert "case 1 is named '../user'; expected names such as case-0001" in said.err


def test_a_file_of_the_user_in_the_place_of_a_diagnosis_stays(trial: Path) -> None:
    path = trial / "diagnoses" / "case-0001.json"
    path.parent.mkdir()
    path.write_text('{"note": "winchcascade/diagnosis/1"}')
    with pytest.raises(OutputError, match="was not written by winchcascade"):
        diagnose(trial, guess)
    assert path.read_text() == '{"note": "winchcascade/diagnosis/1"}'
