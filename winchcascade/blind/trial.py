"""A trial: cases are dealt with their answers sealed, and diagnosed by someone who sees the logs alone."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import msgspec

from winchcascade import __version__
from winchcascade.blind.cases import Case, answer_of, make_campaign, plan_cases
from winchcascade.blind.envelope import SEALED, TRIAL, Envelope, Trial, open_seal, read_trial, seal, trial_bytes
from winchcascade.blind.numbers import LOADS
from winchcascade.campaign import CAMPAIGN_FILE
from winchcascade.errors import OptionError, OutputError
from winchcascade.files import check_replaceable, write_content
from winchcascade.tasks import Nobody, Outcome, Watch, run_here, run_there

DIAGNOSES, PREDICTIONS = "diagnoses", "predictions"
"""Folders of a trial beside its cases: a JSON for each case, and what the diagnosis predicted of its logs."""

_STALE = 3600.0
"""A scratch folder older than this is left of a call that was killed. [s]"""

Job = TypeVar("Job")
Made = TypeVar("Made")


class Diagnose(Protocol):
    """Whoever diagnoses a campaign: its logs in, the diagnosis out, as the nested records of its JSON."""

    def __call__(
        self, campaign_toml: Path, *, suspects: Mapping[str, type], seed: int, predictions: Path | None
    ) -> dict[str, Any]:
        """Diagnose one campaign and write what was predicted of its withheld logs into a folder."""


class Progress(msgspec.Struct, frozen=True):
    """What a call came to: the cases of the trial, how many were done already, and the fault of each that failed."""

    cases: tuple[str, ...]
    kept: int
    faults: dict[str, str]
    sha256: str


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
    OutputError : the folder cannot be made or holds something else
    """
    if cases < 1 or seed < 0:
        raise OptionError(f"--cases {cases} --seed {seed}: expected at least one case and a seed of 0 or more.")
    plan = plan_cases(cases, seed)
    content, trial = seal(Envelope(seed, tuple(answer_of(case) for case in plan)))
    _lay_out(out, content, trial, force=force)
    todo = [case for case in plan if not (out / case.name).is_dir()]
    orders = [_Deal(case, None if scheduler is not None else str(out)) for case in todo]
    faults: dict[str, str] = {}
    watch = watch or Nobody()
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


def _lay_out(out: Path, content: bytes, trial: Trial, *, force: bool) -> None:
    """Make the folder of a trial with its sealed answers, or find it made by an earlier call."""
    if (out / TRIAL).is_file():
        if read_trial(out).sealed_sha256 == trial.sealed_sha256:
            open_seal(out)
            _clear(out)
            return
        if not force:
            raise OptionError(
                f"{out}: holds another trial (other cases, seed or version); give --out a new folder or add --force."
            )
        _forget(out)
    elif out.is_dir() and any(out.iterdir()) and not force:
        raise OutputError(f"{out}: is not empty and no folder of a trial; give --out a new folder or add --force.")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise OutputError(f"{out}: the folder cannot be made ({fault.strerror}); choose another.") from None
    _clear(out)
    write_content(out / SEALED, content, force=force)
    write_content(out / TRIAL, trial_bytes(trial), force=force)


def _forget(out: Path) -> None:
    """Remove all that an earlier trial left, its record first, so that nothing half removed passes for a trial."""
    cases = read_trial(out).cases
    (out / TRIAL).unlink(missing_ok=True)
    for name in (*cases, DIAGNOSES, PREDICTIONS):
        if (out / name).is_dir():
            shutil.rmtree(out / name)


def _clear(out: Path) -> None:
    """Remove the scratch folders of calls that were cut short."""
    for part in (*out.glob(".case-*.part"), *(out / PREDICTIONS).glob(".case-*.part")):
        try:
            if time.time() - part.stat().st_mtime > _STALE:
                shutil.rmtree(part)
        except FileNotFoundError:  # another call was faster
            continue


def _deal_case(order: _Deal) -> _Dealt:
    files = make_campaign(order.case)
    if order.folder is None:
        return _Dealt(order.case.name, files)
    _write_folder(Path(order.folder) / order.case.name, files)
    return _Dealt(order.case.name, {})


def _write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a folder of files, whole or not at all; a folder of that name is replaced."""
    part = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.", suffix=".part"))
    try:
        for name, content in files.items():
            path = part / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        part.chmod(0o755)
        if folder.is_dir():
            shutil.rmtree(folder)
        os.replace(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


class _Order(msgspec.Struct, frozen=True):
    """One case to diagnose: its files or the folder they stand in, who diagnoses, whom he suspects, and with what seed."""

    name: str
    key: str
    diagnose: Diagnose
    suspects: Mapping[str, type]
    seed: int
    folder: str | None = None
    files: Mapping[str, bytes] | None = None


class _Diagnosed(msgspec.Struct, frozen=True):
    """A diagnosis as JSON, and the predicted logs by their place under the case's folder."""

    record: bytes
    predictions: dict[str, bytes]


class _Mark(msgspec.Struct):
    key: str


class _Marked(msgspec.Struct):
    """What an earlier diagnosis says of how it was made."""

    trial: _Mark


def diagnose(
    folder: Path,
    who: Diagnose,
    suspects: Mapping[str, type],
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
    """
    trial = read_trial(folder)
    _all_dealt(folder, trial)
    for made in (DIAGNOSES, PREDICTIONS):
        (folder / made).mkdir(exist_ok=True)
    _clear(folder)
    keys = {name: _key(folder / name, suspects, seed) for name in trial.cases}
    todo = [name for name in trial.cases if force or not _is_kept(folder, name, keys[name])]
    orders = [
        _Order(name, keys[name], who, suspects, seed, files=_files(folder / name))
        if scheduler is not None
        else _Order(name, keys[name], who, suspects, seed, folder=str(folder))
        for name in todo
    ]
    faults: dict[str, str] = {}
    watch = watch or Nobody()
    watch.begin(len(trial.cases) - len(todo), len(todo))
    for outcome in _outcomes(_diagnose_case, orders, jobs, scheduler):
        name = todo[outcome.place]
        if outcome.value is None:
            faults[name] = outcome.fault or ""
            (folder / DIAGNOSES / f"{name}.json").unlink(missing_ok=True)
        elif outcome.value.record:
            _write_diagnosis(folder, name, outcome.value)
        watch.done(name, outcome.fault)
    return Progress(trial.cases, len(trial.cases) - len(todo), faults, trial.sealed_sha256)


def _all_dealt(folder: Path, trial: Trial) -> None:
    missing = [name for name in trial.cases if not (folder / name / CAMPAIGN_FILE).is_file()]
    if missing:
        raise OptionError(
            f"{folder}: {len(missing)} of {len(trial.cases)} cases are missing, the first {missing[0]}; "
            "give blind deal the same command again to deal them."
        )


def _files(case: Path) -> dict[str, bytes]:
    names = [CAMPAIGN_FILE, *(f"{log}.csv" for log in LOADS)]
    return {name: (case / name).read_bytes() for name in names if (case / name).is_file()}


def _key(case: Path, suspects: Mapping[str, type], seed: int) -> str:
    """Digest of everything that a diagnosis depends on."""
    digest = hashlib.sha256(repr((__version__, sorted(suspects), seed)).encode())
    for name, content in _files(case).items():
        digest.update(name.encode() + hashlib.sha256(content).digest())
    return digest.hexdigest()


def _is_kept(folder: Path, name: str, key: str) -> bool:
    try:
        return msgspec.json.decode((folder / DIAGNOSES / f"{name}.json").read_bytes(), type=_Marked).trial.key == key
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False


def _diagnose_case(order: _Order) -> _Diagnosed:
    """Diagnose one case in a folder that holds its logs and nothing else."""
    files = order.files if order.folder is None else _files(Path(order.folder) / order.name)
    with tempfile.TemporaryDirectory(prefix="winchcascade-") as scratch:
        case, predicted = Path(scratch) / order.name, Path(scratch) / PREDICTIONS
        predicted.mkdir()
        _write_folder(case, files or {})
        found = order.diagnose(case / CAMPAIGN_FILE, suspects=order.suspects, seed=order.seed, predictions=predicted)
        logs = {str(p.relative_to(predicted)): p.read_bytes() for p in sorted(predicted.rglob("*.csv"))}
    record = msgspec.json.encode({**found, "trial": {"case": order.name, "key": order.key}})
    made = _Diagnosed(msgspec.json.format(record, indent=1) + b"\n", logs)
    if order.folder is None:
        return made
    _write_diagnosis(Path(order.folder), order.name, made)
    return _Diagnosed(b"", {})


def _write_diagnosis(folder: Path, name: str, made: _Diagnosed) -> None:
    """Write what was found of a case: the predictions first, the JSON last, as it tells that all is there."""
    path = folder / DIAGNOSES / f"{name}.json"
    check_replaceable(path, force=False)
    _write_folder(folder / PREDICTIONS / name, made.predictions)
    write_content(path, made.record)
