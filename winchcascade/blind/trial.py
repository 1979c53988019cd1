"""A trial: cases are dealt with their answers sealed, and diagnosed by someone who sees the logs alone."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar

import msgspec

from winchcascade.blind.cases import Case, answer_of, make_campaign, plan_cases
from winchcascade.blind.sealed_answers import SEALED, TRIAL, Envelope, Trial, open_seal, read_trial, seal, trial_bytes
from winchcascade.blind.twin_numbers import LOADS
from winchcascade.core.campaign_file import CAMPAIGN_FILE, load_campaign
from winchcascade.core.errors import CampaignError, OptionError, OutputError
from winchcascade.core.files import check_replaceable, write_content
from winchcascade.core.jobs import Nobody, Outcome, Watch, run_here, run_there
from winchcascade.core.scratch import clear, clear_once, scratch_folder
from winchcascade.core.signals import signals_held
from winchcascade.core.store import (
    LOCK,
    Digest,
    altered,
    digest_in,
    digest_of,
    files_within,
    foreign,
    inside,
    locked,
    with_digest,
)
from winchcascade.core.version import __version__

if TYPE_CHECKING:
    from winchcascade.diagnosis.suspects import Suspects

DIAGNOSES, PREDICTIONS = "diagnoses", "predictions"
"""Folders of a trial beside its cases: a JSON for each case, and what the diagnosis predicted of its logs."""

Job = TypeVar("Job")
Made = TypeVar("Made")


class Diagnose(Protocol):
    """Whoever diagnoses a campaign: its logs in, the diagnosis out, as the nested records of its JSON."""

    def __call__(
        self, campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None
    ) -> dict[str, Any]:
        """Diagnose one campaign and write what was predicted of its withheld logs into a folder."""


class Progress(msgspec.Struct, frozen=True):
    """What a call came to: the cases of the trial, how many were done already, the fault of each that failed, and the cases
    whose diagnosis did not match its digest and was made again.
    """

    cases: tuple[str, ...]
    kept: int
    faults: dict[str, str]
    sha256: str
    altered: tuple[str, ...] = ()


class _Deal(msgspec.Struct, frozen=True):
    """One case to deal, and the folder of the trial; without one the files come back."""

    case: Case
    folder: str | None


class _Dealt(msgspec.Struct, frozen=True):
    name: str
    files: dict[str, bytes]


def deal(
    out: Path,
    cases: int,
    seed: int,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> Progress:
    """Deal a trial into a folder: answers sealed first, then each case, its folder whole or not at all.

    Called again with the same numbers it deals what is missing; the same numbers give the same bytes.

    Parameters
    ----------
    jobs : processes of this machine
    scheduler : address of a Dask scheduler that does the work instead
    force : replace another trial, and use a folder that holds something else too

    Raises
    ------
    OptionError : the numbers make no trial, another trial stands there, or its answers were changed
    OutputError : the folder cannot be made or locked, holds something else, or holds a link
    """
    if cases < 1 or seed < 0:
        raise OptionError(f"--cases {cases} --seed {seed}: expected at least one case and a seed of 0 or more.")
    plan = plan_cases(cases, seed)
    content, trial = seal(Envelope(seed, tuple(answer_of(case) for case in plan)))
    watch = watch or Nobody()
    _make_folder(out, force=force)
    with locked(out, watch.waiting):
        _lay_out(out, content, trial, force=force)
        todo = [case for case in plan if not inside(out, case.name).is_dir()]
        orders = [_Deal(case, None if scheduler is not None else str(out)) for case in todo]
        faults: dict[str, str] = {}
        watch.begin(cases - len(todo), len(todo))
        for outcome in _outcomes(_deal_case, orders, jobs, scheduler):
            name = todo[outcome.place].name
            if outcome.value is None:
                faults[name] = outcome.fault or ""
            elif outcome.value.files:
                _write_folder(out / name, outcome.value.files)
            watch.done(name, outcome.fault)
        return Progress(trial.cases, cases - len(todo), faults, trial.sealed_sha256)


def _outcomes(
    work: Callable[[Job], Made], jobs: Sequence[Job], workers: int, scheduler: str | None
) -> Iterator[Outcome[Made]]:
    if scheduler is not None:
        return run_there(work, jobs, scheduler=scheduler)
    return run_here(work, jobs, workers=workers)


def _make_folder(out: Path, *, force: bool) -> None:
    """Make the folder of a trial, or refuse one that holds something else; one with a lock is of a call that has begun."""
    if not force and not (out / TRIAL).is_file() and not (out / LOCK).exists() and foreign(out):
        raise _not_empty(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise OutputError(f"{out}: the folder cannot be made ({fault.strerror}); choose another.") from None


def _not_empty(out: Path) -> OutputError:
    return OutputError(f"{out}: is not empty and no folder of a trial; give --out a new folder or add --force.")


def _lay_out(out: Path, content: bytes, trial: Trial, *, force: bool) -> None:
    """Put the sealed answers into the folder of a trial, or find them put there by an earlier call."""
    _clear(out)
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
        raise _not_empty(out)
    write_content(inside(out, SEALED), content, force=force)
    write_content(inside(out, TRIAL), trial_bytes(trial), force=force)


def _forget(out: Path) -> None:
    """Remove all that an earlier trial left, its record first, so that nothing half removed passes for a trial.

    The folders are looked at before the first is removed: no link is followed, and none is removed either.
    """
    folders = [inside(out, name) for name in (*read_trial(out).cases, DIAGNOSES, PREDICTIONS)]
    for folder in folders:
        files_within(folder)
    (out / TRIAL).unlink(missing_ok=True)
    for folder in folders:
        if folder.is_dir():
            shutil.rmtree(folder)


def _clear(out: Path) -> None:
    """Remove what calls that were cut short left in the folder of a trial."""
    for place in (out, inside(out, DIAGNOSES), inside(out, PREDICTIONS)):
        clear(place)
    clear_once(Path(gettempdir()))


def _deal_case(order: _Deal) -> _Dealt:
    files = make_campaign(order.case)
    if order.folder is None:
        return _Dealt(order.case.name, files)
    _write_folder(Path(order.folder) / order.case.name, files)
    return _Dealt(order.case.name, {})


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
        with signals_held():
            if folder.is_dir():
                shutil.rmtree(folder)
            os.replace(part, folder)


class _Order(msgspec.Struct, frozen=True):
    """One case to diagnose: its files or the folder they stand in, who diagnoses, whom he suspects, and with what seed."""

    name: str
    key: str
    diagnose: Diagnose
    suspects: Suspects
    seed: int
    folder: str | None = None
    files: Mapping[str, bytes] | None = None


class _Diagnosed(msgspec.Struct, frozen=True):
    """A diagnosis as JSON, and the predicted logs by their place under the case's folder."""

    record: bytes
    predictions: dict[str, bytes]


class _Mark(msgspec.Struct):
    key: str
    files: dict[str, str] = {}


class _Marked(msgspec.Struct):
    """What an earlier diagnosis says of how it was made."""

    trial: _Mark


def diagnose(
    folder: Path,
    who: Diagnose,
    suspects: Suspects,
    *,
    seed: int = 0,
    jobs: int = 1,
    scheduler: str | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> Progress:
    """Diagnose every case of a trial from its logs alone; the answers stay sealed.

    Each case is diagnosed in a folder of its own elsewhere, with nothing but its logs. What was diagnosed already with the same
    suspects, seed and version is kept, unless `force` says otherwise.

    Parameters
    ----------
    who : diagnoses a campaign; a function of a module, so that another process can find it
    suspects : effects by name that may be named

    Raises
    ------
    OptionError : the folder is no trial, a case of it is missing, or the scheduler cannot be reached
    OutputError : the folder cannot be locked, or holds a link
    """
    watch = watch or Nobody()
    read_trial(folder)  # a folder that is no trial is not locked
    with locked(folder, watch.waiting):
        trial = read_trial(folder)
        _all_dealt(folder, trial)
        _clear(folder)
        for made in (DIAGNOSES, PREDICTIONS):
            _make_sub(inside(folder, made))
        keys = {name: _key(inside(folder, name), suspects, seed) for name in trial.cases}
        states = {name: _state_of(folder, name, keys[name]) for name in trial.cases}
        todo = [name for name in trial.cases if force or states[name] != "kept"]
        orders = [
            _Order(name, keys[name], who, suspects, seed, files=_files(folder / name))
            if scheduler is not None
            else _Order(name, keys[name], who, suspects, seed, folder=str(folder))
            for name in todo
        ]
        faults: dict[str, str] = {}
        watch.begin(len(trial.cases) - len(todo), len(todo))
        for outcome in _outcomes(_diagnose_case, orders, jobs, scheduler):
            name = todo[outcome.place]
            if outcome.value is None:
                faults[name] = outcome.fault or ""
                if outcome.rejected and states[name] == "other":  # what is there is of other logs, suspects or version
                    inside(folder, f"{DIAGNOSES}/{name}.json").unlink(missing_ok=True)
            elif outcome.value.record:
                _write_diagnosis(folder, name, outcome.value)
            watch.done(name, outcome.fault)
        redone = tuple(name for name in trial.cases if states[name] == "altered")
        return Progress(trial.cases, len(trial.cases) - len(todo), faults, trial.sealed_sha256, redone)


def _make_sub(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as fault:
        raise OutputError(f"{folder}: the folder cannot be made ({fault.strerror}); choose another trial.") from None


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


def _key(case: Path, suspects: Suspects, seed: int) -> str:
    """Digest of everything that a diagnosis depends on."""
    files = {name: digest_of(content) for name, content in _files(case).items()}
    return digest_of(repr((__version__, sorted(suspects), seed, files)).encode())


def _state_of(folder: Path, name: str, key: str) -> Literal["kept", "altered", "other"]:
    """Whether an earlier call made a case's diagnosis and predictions from the same logs with the same suspects and seed.

    `altered`: it did, but what is there now does not match its digest. A diagnosis of version 0.1.0 has no digest and is made
    again.
    """
    try:
        content = inside(folder, f"{DIAGNOSES}/{name}.json").read_bytes()
        mark = msgspec.json.decode(content, type=_Marked).trial
    except OSError:
        return "other"
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return "altered"
    digest = digest_in(content)
    if digest is not Digest.RIGHT:
        return "altered" if digest is Digest.WRONG else "other"
    if mark.key != key:
        return "other"
    return "altered" if altered(inside(folder, f"{PREDICTIONS}/{name}"), mark.files) else "kept"


def _diagnose_case(order: _Order) -> _Diagnosed:
    """Diagnose one case in a folder that holds its logs and nothing else."""
    files = order.files if order.folder is None else _files(Path(order.folder) / order.name)
    with scratch_folder() as scratch:
        case, predicted = scratch / order.name, scratch / PREDICTIONS
        predicted.mkdir()
        _write_folder(case, files or {})
        _check_campaign(case)
        found = order.diagnose(case / CAMPAIGN_FILE, suspects=order.suspects, seed=order.seed, predictions=predicted)
        logs = {name: path.read_bytes() for name, path in files_within(predicted).items() if path.suffix == ".csv"}
    digests = {name: digest_of(content) for name, content in logs.items()}
    about = {"case": order.name, "key": order.key, "files": digests}
    made = _Diagnosed(with_digest(found, "trial", about, indent=1), logs)
    if order.folder is None:
        return made
    _write_diagnosis(Path(order.folder), order.name, made)
    return _Diagnosed(b"", {})


def _check_campaign(case: Path) -> None:
    """Refuse a case whose campaign names a log or a rig file that lies elsewhere."""
    campaign = load_campaign(case / CAMPAIGN_FILE)
    for run in campaign.runs:
        if run.file.parent != case:
            raise CampaignError(
                f"{case.name}/{CAMPAIGN_FILE}: names the log {run.file}, which is not in the folder of the case; deal the "
                "trial again."
            )
    if campaign.rig is not None and Path(campaign.rig).name != campaign.rig:
        raise CampaignError(
            f"{case.name}/{CAMPAIGN_FILE}: names the rig file {campaign.rig}, which is not in the folder of the case; deal the "
            "trial again."
        )


def _write_diagnosis(folder: Path, name: str, made: _Diagnosed) -> None:
    """Write what was found of a case: the predictions first, the JSON last, as it tells that all is there."""
    path = inside(folder, f"{DIAGNOSES}/{name}.json")
    check_replaceable(path, force=False)
    try:
        known = msgspec.json.decode(path.read_bytes(), type=_Marked).trial.files
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        known = {}
    _write_folder(inside(folder, f"{PREDICTIONS}/{name}"), made.predictions, known=known)
    write_content(path, made.record)
