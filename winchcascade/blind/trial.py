"""A trial: cases are generated with sealed answers, and diagnosed from the logs alone."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import msgspec

from winchcascade.blind.cases import (
    SEALED,
    TRIAL,
    Case,
    SealedAnswers,
    Trial,
    answer_of,
    make_campaign,
    open_seal,
    plan_cases,
    read_trial,
    seal,
    trial_bytes,
)
from winchcascade.blind.twin_numbers import LOADS
from winchcascade.core.campaign_file import CAMPAIGN_FILE, load_campaign
from winchcascade.core.errors import CampaignError, OptionError, OutputError
from winchcascade.core.files import check_replaceable, scratch_folder, write_content
from winchcascade.core.jobs import Nobody, Watch, Workers
from winchcascade.core.store import (
    Kept,
    State,
    altered,
    digest_of,
    files_within,
    foreign,
    inside,
    kept,
    locked,
    make_folder,
    make_one,
    not_empty,
    with_digest,
)
from winchcascade.core.version import __version__

if TYPE_CHECKING:
    from winchcascade.diagnosis.suspects import Suspects

DIAGNOSES, PREDICTIONS = "diagnoses", "predictions"
"""Folders of a trial beside its cases: a JSON for each case, and what the diagnosis predicted of its logs."""


class Diagnose(Protocol):
    """A function that diagnoses a campaign: its logs in, the diagnosis out, as the nested records of its JSON."""

    def __call__(
        self, campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None
    ) -> dict[str, object]:
        """Diagnose one campaign and write the predictions of its held-out logs into a folder."""


class DiagnosisMethod(msgspec.Struct, frozen=True):
    """How cases are diagnosed: by a function of a module, so that another process finds it; with effects by name that may be
    named as causes, and with a seed.
    """

    diagnose: Diagnose
    suspects: Suspects
    seed: int = 0


class TrialProgress(msgspec.Struct, frozen=True):
    """Result of a call: the cases of the trial, how many were done already, the fault of each that failed, and the cases whose
    diagnosis did not match its digest and was made again.
    """

    cases: tuple[str, ...]
    kept: int
    faults: dict[str, str]
    sha256: str
    altered: tuple[str, ...] = ()

    @property
    def made(self) -> int:
        """Cases that the call did itself."""
        return len(self.cases) - self.kept - len(self.faults)


def deal(
    out: Path,
    cases: int,
    seed: int,
    *,
    workers: Workers | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> TrialProgress:
    """Generate a trial in a folder: the sealed answers first, then each case, its folder whole or not at all.

    Called again with the same numbers it generates the missing cases; the same numbers give the same bytes.

    Parameters
    ----------
    workers : one process of this machine if not given
    force : replace another trial, and use a folder that holds something else too

    Raises
    ------
    OptionError : the numbers make no trial, the folder holds another trial, or its answers were changed
    OutputError : the folder cannot be made or locked, holds something else, or holds a link
    """
    if cases < 1 or seed < 0:
        raise OptionError(f"--cases {cases} --seed {seed}: expected at least one case and a seed of 0 or more.")
    plan = plan_cases(cases, seed)
    content, trial = seal(SealedAnswers(seed, tuple(answer_of(case) for case in plan)))
    workers, watch = workers or Workers(), watch or Nobody()
    make_folder(out, ours=(out / TRIAL).is_file(), what="a trial", force=force)
    with locked(out, watch.waiting):
        _lay_out(out, content, trial, force=force)
        orders = {case.name: case for case in plan if not inside(out, case.name).is_dir()}
        work = partial(_deal_case, folder=str(out) if workers.scheduler is None else None)
        faults: dict[str, str] = {}
        watch.begin(cases - len(orders), len(orders))
        for name, outcome in workers.run(work, orders, watch):
            if outcome.value is None:
                faults[name] = outcome.fault or ""
            elif outcome.value:
                _write_folder(out / name, outcome.value)
        return TrialProgress(trial.cases, cases - len(orders), faults, trial.sealed_sha256)


def _lay_out(out: Path, content: bytes, trial: Trial, *, force: bool) -> None:
    """Write the sealed answers into the folder of a trial, or check those of an earlier call."""
    if inside(out, TRIAL).is_file():
        if read_trial(out).sealed_sha256 == trial.sealed_sha256:
            open_seal(out)
            return
        if not force:
            raise OptionError(
                f"{out}: holds another trial (other cases, seed or version); give --out a new folder or add --force."
            )
        _forget(out)
    elif not force and set(foreign(out)) - {SEALED}:  # answers without a record are of a call that was cut short
        raise not_empty(out, "a trial")
    write_content(inside(out, SEALED), content, force=force)
    write_content(inside(out, TRIAL), trial_bytes(trial), force=force)


def _forget(out: Path) -> None:
    """Remove an earlier trial, its record first, so that no half of one passes for a trial.

    The folders are checked before the first is removed: no link is followed, and none is removed either.
    """
    folders = [inside(out, name) for name in (*read_trial(out).cases, DIAGNOSES, PREDICTIONS)]
    for folder in folders:
        files_within(folder)
    (out / TRIAL).unlink(missing_ok=True)
    for folder in folders:
        if folder.is_dir():
            shutil.rmtree(folder)


def _deal_case(case: Case, folder: str | None) -> dict[str, bytes]:
    """Make the files of a case and write them into the folder of the trial; without one they are returned."""
    files = make_campaign(case)
    if folder is None:
        return files
    _write_folder(Path(folder) / case.name, files)
    return {}


def _write_folder(folder: Path, files: Mapping[str, bytes], *, known: Iterable[str] = ()) -> None:
    """Write a folder of files, whole or not at all; a folder of that name is replaced.

    Parameters
    ----------
    known : files of the folder that is replaced, beyond those of the same names, which this tool made

    Raises
    ------
    OutputError : the folder that is there holds a link or a file that this tool did not make
    """
    strange = sorted(set(files_within(folder)) - set(files) - set(known))
    if strange:
        raise OutputError(
            f"{folder / strange[0]}: was not written by winchcascade and stands where a result is replaced; move it elsewhere."
        )
    with scratch_folder(folder.parent) as part:
        for name, content in files.items():
            path = inside(part, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        part.chmod(0o755)
        if folder.is_dir():
            shutil.rmtree(folder)
        os.replace(part, folder)


class _Order(msgspec.Struct, frozen=True):
    """One case to diagnose; its files where the worker has no access to the folder of the trial."""

    name: str
    key: str
    files: Mapping[str, bytes] | None


class _Diagnosed(msgspec.Struct, frozen=True):
    """A diagnosis as JSON, and the predicted logs by their place under the folder of the case."""

    record: bytes
    predictions: dict[str, bytes]


class _Marked(msgspec.Struct):
    """The entry of an earlier diagnosis that holds how it was made."""

    trial: Kept


def diagnose(
    folder: Path,
    method: DiagnosisMethod,
    *,
    workers: Workers | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> TrialProgress:
    """Diagnose every case of a trial from its logs alone; the answers stay sealed.

    Each case is diagnosed in a separate folder elsewhere that holds only its logs. A diagnosis with the same suspects, seed and
    version is kept, unless `force` is set.

    Parameters
    ----------
    workers : one process of this machine if not given

    Raises
    ------
    OptionError : the folder is no trial, a case of it is missing, or the scheduler cannot be reached
    OutputError : the folder cannot be locked, or holds a link
    """
    workers, watch = workers or Workers(), watch or Nobody()
    read_trial(folder)  # a folder that is no trial is not locked
    with locked(folder, watch.waiting):
        trial = read_trial(folder)
        _all_dealt(folder, trial)
        for made in (DIAGNOSES, PREDICTIONS):
            make_one(inside(folder, made), "another trial")
        keys = {name: _key(inside(folder, name), method) for name in trial.cases}
        states = {name: _state_of(folder, name, keys[name]) for name in trial.cases}
        todo = [name for name in trial.cases if force or states[name] != "kept"]
        here = str(folder) if workers.scheduler is None else None
        orders = {name: _Order(name, keys[name], None if here else _files(folder / name)) for name in todo}
        work = partial(_diagnose_case, method=method, folder=here)
        faults: dict[str, str] = {}
        watch.begin(len(trial.cases) - len(todo), len(todo))
        for name, outcome in workers.run(work, orders, watch):
            if outcome.value is None:
                faults[name] = outcome.fault or ""
                if outcome.rejected and states[name] == "other":  # the present one has other logs, suspects or version
                    inside(folder, f"{DIAGNOSES}/{name}.json").unlink(missing_ok=True)
            elif outcome.value.record:
                _write_diagnosis(folder, name, outcome.value)
        redone = tuple(name for name in trial.cases if states[name] == "altered")
        return TrialProgress(trial.cases, len(trial.cases) - len(todo), faults, trial.sealed_sha256, redone)


def _all_dealt(folder: Path, trial: Trial) -> None:
    missing = [name for name in trial.cases if not inside(folder, f"{name}/{CAMPAIGN_FILE}").is_file()]
    if missing:
        raise OptionError(
            f"{folder}: {len(missing)} of {len(trial.cases)} cases are missing, the first {missing[0]}; "
            "give blind deal the same command again to deal them."
        )


def _files(case: Path) -> dict[str, bytes]:
    """The campaign of a case and its logs, none of them a link."""
    paths = {name: inside(case, name) for name in (CAMPAIGN_FILE, *(f"{log}.csv" for log in LOADS))}
    return {name: path.read_bytes() for name, path in paths.items() if path.is_file()}


def _key(case: Path, method: DiagnosisMethod) -> str:
    """Digest of everything that a diagnosis depends on."""
    files = {name: digest_of(content) for name, content in _files(case).items()}
    return digest_of(repr((__version__, sorted(method.suspects), method.seed, files)).encode())


def _state_of(folder: Path, name: str, key: str) -> State:
    """Whether an earlier call made a case's diagnosis and predictions from the same logs with the same suspects and seed."""
    found = kept(inside(folder, f"{DIAGNOSES}/{name}.json"), "trial")
    if not isinstance(found, Kept):
        return found
    if found.key != key:
        return "other"
    return "altered" if altered(inside(folder, f"{PREDICTIONS}/{name}"), found.files) else "kept"


def _diagnose_case(order: _Order, method: DiagnosisMethod, folder: str | None) -> _Diagnosed:
    """Diagnose one case in a folder that holds its logs and nothing else; write the result, or without a folder return it."""
    files = order.files if folder is None else _files(Path(folder) / order.name)
    with scratch_folder() as scratch:
        case, predicted = scratch / order.name, scratch / PREDICTIONS
        predicted.mkdir()
        _write_folder(case, files or {})
        _check_campaign(case)
        found = method.diagnose(case / CAMPAIGN_FILE, suspects=method.suspects, seed=method.seed, predictions=predicted)
        logs = {name: path.read_bytes() for name, path in files_within(predicted).items() if path.suffix == ".csv"}
    about = {
        "case": order.name,
        "key": order.key,
        "files": {name: digest_of(content) for name, content in logs.items()},
    }
    made = _Diagnosed(with_digest(found, "trial", about, indent=1), logs)
    if folder is None:
        return made
    _write_diagnosis(Path(folder), order.name, made)
    return _Diagnosed(b"", {})


def _check_campaign(case: Path) -> None:
    """Reject a case whose campaign names a log or a rig file in another folder."""
    campaign = load_campaign(case / CAMPAIGN_FILE)
    elsewhere = [f"the log {run.file}" for run in campaign.runs if run.file.parent != case]
    if campaign.rig is not None and Path(campaign.rig).name != campaign.rig:
        elsewhere.append(f"the rig file {campaign.rig}")
    if elsewhere:
        raise CampaignError(
            f"{case.name}/{CAMPAIGN_FILE}: names {elsewhere[0]}, which is not in the folder of the case; deal the trial again."
        )


def _write_diagnosis(folder: Path, name: str, made: _Diagnosed) -> None:
    """Write the diagnosis of a case: the predictions first, the JSON last, as it marks the case as complete."""
    path = inside(folder, f"{DIAGNOSES}/{name}.json")
    check_replaceable(path, force=False)
    try:
        known = msgspec.json.decode(path.read_bytes(), type=_Marked).trial.files
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        known = {}
    _write_folder(inside(folder, f"{PREDICTIONS}/{name}"), made.predictions, known=known)
    write_content(path, made.record)
