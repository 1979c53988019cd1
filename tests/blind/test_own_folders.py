"""Commands that are led out of their folders: by names in the files of a trial, by links, and by files like their own.

What lies elsewhere is the user's: no attempt may remove or replace any of it.
"""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
from calls import call
from seeds import text
from small_trials import cases_by, guess, shipped
from test_files import MENTIONS

from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.blind.cases import SEALED, TRIAL, seal, trial_bytes
from winchcascade.blind.trial import DiagnosisMethod, deal, diagnose
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.store import LOCK, digest_of
from winchcascade.rig.effects.catalogue import EFFECTS

pytestmark = pytest.mark.skipif(os.name == "nt", reason="makes links as POSIX does")

ATTEMPTS = 100
DEAL = ("blind", "deal", "--cases", "1", "--seed", "7", "--jobs", "1", "--out")

Act = Callable[[Path], None]


class Attempt(NamedTuple):
    """One way to lead a command astray: what is done to its folder, then the command."""

    name: str
    lead: Callable[[Path, Path], None]
    act: Act
    of: str


NAMES = (
    "../user", "../../user", "case-0001/../../user", "/user", "..", ".", "", "user", "case-1", "case-00001", "CASE-0001",
    "case-0001/", "case-0001\n", "..\\user", "C:\\user", "case-0001/../case-0001", "\u0000", "case-0000",
)  # fmt: skip


def forge(out: Path, user: Path, name: str) -> None:
    """Name a case otherwise in the record of a trial and in its answers, with the digest that belongs to them."""
    name = str(user) if name == "/user" else name
    answers = json.loads((out / SEALED).read_bytes())
    answers["answers"][0]["case"] = name
    content = json.dumps(answers).encode()
    (out / SEALED).write_bytes(content)
    record = json.loads((out / TRIAL).read_bytes())
    (out / TRIAL).write_text(json.dumps(record | {"cases": [name], "sealed_sha256": digest_of(content)}))


def link(out: Path, user: Path, name: str) -> None:
    """Put a link to what the user has in the place of a file or folder of results."""
    place = out / name
    is_folder = place.is_dir() or name in ("predictions", "diagnoses", "predictions/case-0001", "dataset", "runs")
    if place.is_dir():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(user / "case-0001" if is_folder else user / "own.json")


def dealt(out: Path, *, force: bool = False, seed: int = 7) -> None:
    deal(out, 1, seed, force=force)


def diagnosed(out: Path, *, force: bool = False) -> None:
    diagnose(out, DiagnosisMethod(guess, EFFECTS), force=force)


def scored(out: Path) -> None:
    assert call("blind", "score", out).code in (0, 2)


def batched(out: Path, *, force: bool = False) -> None:
    run_batch(make_plan([str(out.parent / "log.csv")]), out, Products(workbook=True), force=force)


def reforced(out: Path) -> None:
    dealt(out, force=True, seed=8)


TRIAL_LINKS = (
    TRIAL, SEALED, LOCK, "case-0001", "case-0001/r9ohm.csv", "case-0001/campaign.toml", "diagnoses", "predictions",
    "diagnoses/case-0001.json", "predictions/case-0001", "predictions/case-0001/before", "predictions/case-0001/mine.csv",
)  # fmt: skip
BATCH_LINKS = (
    LOCK, "runs", "dataset", "runs/log.csv.json", "runs/log.csv.html", "runs/log.csv.pdf", "campaign.json", "campaign.html",
    "campaign.pdf", "campaign.xlsx", "dataset/runs.parquet", "dataset/cycles.parquet", "dataset/bins.parquet",
)  # fmt: skip


def attempts() -> Iterator[Attempt]:
    acts: dict[str, Act] = {act.__name__: act for act in (dealt, reforced, diagnosed, scored)}
    for lead, names in ((forge, NAMES), (link, TRIAL_LINKS)):
        for name in names:
            for act in acts:
                yield Attempt(f"{act}, {lead.__name__} {name!r}", partial(lead, name=name), acts[act], "trial")
    for name in BATCH_LINKS:
        for force in (False, True):
            act_now = partial(batched, force=force)
            yield Attempt(f"batch, force {force}, link {name}", partial(link, name=name), act_now, "batch")


@pytest.fixture(scope="module", autouse=True)
def shipped_logs() -> Iterator[None]:
    """What a log holds does not matter here."""
    with cases_by(shipped):
        yield


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What is led astray: a trial with a diagnosis and a batch, and beside them what a user has."""
    place = tmp_path_factory.mktemp("folders")
    dealt(place / "trial")
    diagnosed(place / "trial")
    (place / "log.csv").write_text(text())
    batched(place / "batch")
    user = place / "user"
    (user / "case-0001" / "before").mkdir(parents=True)
    (user / "own.json").write_text('{"schema": "winchcascade/reduction/1", "mine": true}')
    for name in ("campaign.toml", "r9ohm.csv", "log.csv.json", "runs.parquet", "before/r9ohm.csv", "mine.txt"):
        (user / "case-0001" / name).write_text("mine")
    return place


def snapshot(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_nothing_outside_of_a_folder_of_results_is_removed_or_replaced(folders: Path, tmp_path: Path) -> None:
    before = snapshot(folders / "user")
    tried, rejected = 0, 0
    for attempt in attempts():
        tried += 1
        place = tmp_path / f"{tried}"
        place.mkdir()
        for name in ("user", attempt.of):
            shutil.copytree(folders / name, place / name)
        shutil.copy(folders / "log.csv", place)
        attempt.lead(place / attempt.of, place / "user")
        try:
            attempt.act(place / attempt.of)
        except WinchcascadeError:
            rejected += 1
        assert snapshot(place / "user") == before, attempt.name
        shutil.rmtree(place)
    assert tried >= ATTEMPTS
    assert rejected > 0.6 * tried


@pytest.mark.parametrize(
    ("of", "place"),
    [("batch", "runs/log.csv.json"), ("batch", "campaign.json"), ("batch", "campaign.html"), ("batch", "campaign.xlsx"),
     ("batch", "dataset/runs.parquet"), ("batch", "runs/log.csv.html"), ("trial", "diagnoses/case-0001.json")],
)  # fmt: skip
def test_a_file_that_mentions_the_mark_stays_in_a_folder_of_results(
    folders: Path, tmp_path: Path, of: str, place: str
) -> None:
    for k, content in enumerate(MENTIONS.values()):
        out = tmp_path / f"{k}" / of
        shutil.copytree(folders / of, out)
        shutil.copy(folders / "log.csv", out.parent)
        (out / place).write_text(content)
        if of == "batch":
            with pytest.raises(WinchcascadeError, match="was not written by winchcascade"):
                batched(out)
        else:
            diagnosed(out)
        assert (out / place).read_text() == content


def test_a_users_file_among_predictions_is_not_removed(folders: Path, tmp_path: Path) -> None:
    trial = shutil.copytree(folders / "trial", tmp_path / "trial")
    notes = trial / "predictions" / "case-0001" / "notes.txt"
    notes.write_text("mine")
    done = diagnose(trial, DiagnosisMethod(guess, EFFECTS, seed=1))
    assert "notes.txt: was not written by winchcascade" in done.faults["case-0001"]
    assert notes.read_text() == "mine"


def test_a_case_whose_campaign_names_a_log_elsewhere_is_rejected(folders: Path, tmp_path: Path) -> None:
    trial = shutil.copytree(folders / "trial", tmp_path / "trial")
    path = trial / "case-0001" / "campaign.toml"
    for name in (str(tmp_path / "log.csv"), "../../log.csv"):
        path.write_text(f'[[run]]\nfile = "{name}"\nload_ohm = 9.0\n')
        assert (
            "is not in the folder of the case" in diagnose(trial, DiagnosisMethod(guess, EFFECTS)).faults["case-0001"]
        )
    path.write_text('rig = "/etc/rig.toml"\n[[run]]\nfile = "r9ohm.csv"\nload_ohm = 9.0\n')
    assert "names the rig file /etc/rig.toml" in diagnose(trial, DiagnosisMethod(guess, EFFECTS)).faults["case-0001"]


def test_the_command_rejects_a_forged_name_with_one_sentence(folders: Path, tmp_path: Path) -> None:
    trial = shutil.copytree(folders / "trial", tmp_path / "trial")
    forge(trial, tmp_path / "user", "../user")
    for words in ((*DEAL, trial), (*DEAL, trial, "--force"), ("blind", "diagnose", trial), ("blind", "score", trial)):
        said = call(*words)
        assert said.code == 2
        assert "case 1 is named '../user'; expected names such as case-0001" in said.err


def test_a_sealed_file_of_other_names_is_rejected(tmp_path: Path, folders: Path) -> None:
    from winchcascade.blind.cases import SealedAnswers, open_seal

    trial = shutil.copytree(folders / "trial", tmp_path / "trial")
    content, record = seal(SealedAnswers(7, ()))
    forged = content.replace(
        b"[]", (trial / SEALED).read_bytes().partition(b'"answers": ')[2].partition(b"],\n")[0] + b"]"
    )
    forged = forged.replace(b"case-0001", b"../user00")
    (trial / SEALED).write_bytes(forged)
    (trial / TRIAL).write_bytes(trial_bytes(record).replace(record.sealed_sha256.encode(), digest_of(forged).encode()))
    with pytest.raises(WinchcascadeError, match=r"sealed\.json: case 1 is named '\.\./user00'"):
        open_seal(trial)
