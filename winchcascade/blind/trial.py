"""A trial in a folder: cases are dealt with sealed answers, or come with a truth.json each; they
are diagnosed from their logs.

The sealed answers are one file beside the cases; the record of the trial holds its digest. A
diagnosis needs neither. A score opens the answers and rejects them if they were changed after the
cases were generated.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path

import msgspec

from winchcascade.blind.cases import DealtCase, draw, plan_cases, write_campaign
from winchcascade.blind.truth import TRUTH_FILE, Truth, decoded, truth_by_effects
from winchcascade.core.campaign_file import CAMPAIGN_FILE
from winchcascade.core.errors import OptionError
from winchcascade.core.files import check_replaceable, json_bytes, scratch_folder, write_content
from winchcascade.core.jobs import Nobody, Watch, Workers
from winchcascade.core.store import (  # fmt: skip
    Kept,
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

SEALED, TRIAL, DIAGNOSES = "sealed.json", "trial.json", "diagnoses"
"""Files of a trial: the answers, the record without them, and the folder with the JSON of each
diagnosis.
"""

SEALED_SCHEMA, TRIAL_SCHEMA = "winchcascade/sealed/1", "winchcascade/trial/1"

NAME = re.compile(r"case-(?!0000)(?:[0-9]{4}|[1-9][0-9]{4,8})")
"""Pattern of the names of dealt cases, which are also the names of their folders."""


class Answer(msgspec.Struct, frozen=True):
    """The sealed answer of one case.

    `parameters` are the true values that a diagnosis reports, by effect; `rig`, `loads` and `gains`
    the numbers of the campaign in SI units [loads in ohm], `laws` the numbers of the laws of the
    injected effects.
    """

    case: str
    kind: str
    effects: dict[str, float]
    outsider: str | None
    parameters: dict[str, dict[str, float]]
    rig: dict[str, float] = {}
    loads: dict[str, float] = {}
    gains: dict[str, float] = {}
    laws: dict[str, float] = {}
    outsider_size: float | None = None

    @property
    def truth(self) -> Truth:
        """What an honest answer may be."""
        if self.outsider is not None:
            return Truth("outsider", self.outsider, "no cause with certainty")
        return truth_by_effects(self.effects, self.parameters)


def answer_of(case: DealtCase) -> Answer:
    """Draw the true numbers of a case without making its logs."""
    hidden, twin, _ = draw(case)
    return Answer(
        case.name, case.kind, case.effects, case.outsider, hidden.reported(), twin.numbers._asdict(), twin.loads, twin.gains,
        hidden.laws, None if case.outsider is None else hidden.outsiders[case.outsider],
    )  # fmt: skip


class SealedAnswers(msgspec.Struct, frozen=True):
    """All answers of a trial, with the seed from which the cases were generated."""

    seed: int
    answers: tuple[Answer, ...]
    schema: str = SEALED_SCHEMA


class Trial(msgspec.Struct, frozen=True):
    """Record of a trial without its answers: its cases and the digest of the sealed answers."""

    cases: tuple[str, ...]
    sealed_sha256: str
    version: str = __version__
    schema: str = TRIAL_SCHEMA


class TrialProgress(msgspec.Struct, frozen=True):
    """Result of a call: the cases of the trial, how many were done already, the fault of each that
    failed, the digest of the answers, and the cases whose diagnosis did not match its digest and
    was made again.
    """

    cases: tuple[str, ...]
    kept: int
    faults: dict[str, str]
    sha256: str | None = None
    altered: tuple[str, ...] = ()

    @property
    def made(self) -> int:
        """Cases that the call did itself."""
        return len(self.cases) - self.kept - len(self.faults)


def seal(sealed: SealedAnswers) -> tuple[bytes, Trial]:
    """Put answers into the bytes of a sealed file, and make the record of the trial with their
    digest.
    """
    content = json_bytes(sealed)
    return content, Trial(tuple(a.case for a in sealed.answers), digest_of(content))


def read_trial(folder: Path) -> Trial:
    """Read the record of a trial; OptionError if the folder is none, or names cases that are no
    names of folders.
    """
    path = inside(folder, TRIAL)
    trial = decoded(
        path,
        Trial,
        "the folder of a trial, as blind deal makes it, or of campaigns with a truth.json each",
    )
    if trial.schema != TRIAL_SCHEMA:
        raise OptionError(f"{path}: has the schema {trial.schema}; expected {TRIAL_SCHEMA}.")
    for number, name in enumerate(
        trial.cases, 1
    ):  # they are also the names of folders, which are replaced
        if NAME.fullmatch(name) is None or name in trial.cases[: number - 1]:
            raise OptionError(
                f"{path}: case {number} is named {name!r}; expected names such as case-0001, each "
                f"once. The file was changed "
                "by hand; deal the trial again."
            )
    return trial


def open_seal(folder: Path) -> tuple[Trial, SealedAnswers]:
    """Open the answers of a trial; OptionError if the folder is none, the answers are missing,
    or they were changed.
    """
    trial, path = read_trial(folder), inside(folder, SEALED)
    sealed = decoded(path, SealedAnswers, "the answers of a trial, without which none is scored")
    found = digest_of(path.read_bytes())
    if (
        found != trial.sealed_sha256
        or tuple(answer.case for answer in sealed.answers) != trial.cases
    ):
        raise OptionError(
            f"{path}: the answers were changed after the cases were dealt: their SHA-256 is "
            f"{found}, {TRIAL} has "
            f"{trial.sealed_sha256}; put the dealt file back, or deal again."
        )
    return trial, sealed


def case_names(folder: Path) -> tuple[str, ...]:
    """Names of the cases of a trial: those of its record or, without one, of the folders with a
    campaign and its truth. OptionError if the folder is no trial, or a case of it is missing.
    """
    own = sorted(
        path.parent
        for path in folder.glob(f"*/{TRUTH_FILE}")
        if (path.parent / CAMPAIGN_FILE).is_file()
    )
    if own and not (folder / TRIAL).exists():
        return tuple(case.name for case in own)
    names = read_trial(folder).cases
    missing = [name for name in names if not inside(folder, f"{name}/{CAMPAIGN_FILE}").is_file()]
    if missing:
        raise OptionError(
            f"{folder}: {len(missing)} of {len(names)} cases are missing, the first {missing[0]}; "
            "give blind deal the same command again to deal them."
        )
    return names


def deal(
    out: Path,
    cases: int,
    seed: int,
    *,
    workers: Workers | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> TrialProgress:
    """Generate a trial in a folder: the sealed answers first, then each case, its folder whole or
    not at all.

    Called again with the same numbers it generates the missing cases; the same numbers give the
    same bytes. `force` replaces another trial, and uses a folder that holds something else too.
    OptionError if the numbers make no trial, the folder holds another one, or its answers were
    changed; OutputError if it cannot be used.
    """
    if cases < 1 or seed < 0:
        raise OptionError(
            f"--cases {cases} --seed {seed}: expected at least one case and a seed of 0 or more."
        )
    plan = plan_cases(cases, seed)
    content, trial = seal(SealedAnswers(seed, tuple(answer_of(case) for case in plan)))
    workers, watch = workers or Workers(), watch or Nobody()
    make_folder(out, ours=(out / TRIAL).is_file(), what="a trial", force=force)
    with locked(out, watch.waiting):
        _lay_out(out, content, trial, force=force)
        orders = {case.name: case for case in plan if not inside(out, case.name).is_dir()}
        watch.begin(cases - len(orders), len(orders))
        done = workers.run(partial(write_whole_campaign, folder=str(out)), orders, watch)
        faults = {name: outcome.fault for name, outcome in done if outcome.fault is not None}
    return TrialProgress(trial.cases, cases - len(orders), faults, trial.sealed_sha256)


def _lay_out(out: Path, content: bytes, trial: Trial, *, force: bool) -> None:
    """Write the sealed answers into the folder of a trial, or check those of an earlier call."""
    if inside(out, TRIAL).is_file():
        earlier = read_trial(out)
        if earlier.sealed_sha256 == trial.sealed_sha256:
            open_seal(out)
            return
        if not force:
            raise OptionError(
                f"{out}: holds another trial (other cases, seed or version); give --out a new "
                f"folder or add --force."
            )
        folders = [
            folder
            for name in (*earlier.cases, DIAGNOSES)
            if files_within(folder := inside(out, name))
        ]
        (out / TRIAL).unlink()  # first, so that no half of a trial passes for one
        for folder in folders:
            shutil.rmtree(folder)
    elif not force and set(foreign(out)) - {
        SEALED
    }:  # answers without a record are of a call that was cut short
        raise not_empty(out, "a trial")
    write_content(inside(out, SEALED), content, force=force)
    write_content(inside(out, TRIAL), json_bytes(trial), force=force)


def write_whole_campaign(case: DealtCase, folder: str) -> None:
    """Write the campaign of a case into a folder of its name, whole or not at all."""
    with scratch_folder(Path(folder)) as part:
        write_campaign(case, part)
        part.chmod(0o755)
        os.replace(part, Path(folder) / case.name)


Diagnose = Callable[[Path], Mapping[str, object]]
"""A function of a module that diagnoses a campaign: its campaign.toml in, the JSON out as nested
records.
"""


def diagnose(
    folder: Path,
    method: Diagnose,
    *,
    diagnoses: Path | None = None,
    only: Collection[str] | None = None,
    workers: Workers | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> TrialProgress:
    """Diagnose every case of a trial from its logs alone; the answers stay sealed.

    A dealt case is diagnosed in a folder elsewhere that holds only its campaign, one with a
    truth.json where it is. A diagnosis of the same logs by the same version is kept, unless `force`
    is set.

    Parameters
    ----------
    diagnoses : folder of the results, by default `DIAGNOSES` in that of the trial
    only : cases to diagnose; all if not given

    Raises
    ------
    OptionError : the folder is no trial, a case of it is missing, or the scheduler cannot be
        reached
    OutputError : the folder cannot be locked, or holds a link
    """
    workers, watch = workers or Workers(), watch or Nobody()
    names = tuple(name for name in case_names(folder) if only is None or name in only)
    out = inside(folder, DIAGNOSES) if diagnoses is None else diagnoses
    make_one(out)
    with locked(out, watch.waiting):
        keys = {name: _key(inside(folder, name)) for name in names}
        earlier = {name: kept(inside(out, f"{name}.json"), "trial") for name in names}
        redone = tuple(name for name, found in earlier.items() if found == "altered")
        todo = [
            name
            for name, found in earlier.items()
            if force or not isinstance(found, Kept) or found.key != keys[name]
        ]
        for name in todo:
            check_replaceable(out / f"{name}.json", force=False)
        watch.begin(len(names) - len(todo), len(todo))
        work = partial(_diagnose_case, method=method, folder=str(folder), out=str(out))
        done = workers.run(work, {name: (name, keys[name]) for name in todo}, watch)
        faults = {name: outcome.fault for name, outcome in done if outcome.fault is not None}
    return TrialProgress(names, len(names) - len(todo), faults, altered=redone)


def _key(case: Path) -> str:
    """Digest of everything that a diagnosis depends on."""
    digests = {
        name: digest_of(path.read_bytes())
        for name, path in files_within(case).items()
        if name != TRUTH_FILE
    }
    return digest_of(repr((__version__, digests)).encode())


def _diagnose_case(order: tuple[str, str], method: Diagnose, folder: str, out: str) -> None:
    """Diagnose one case, and write the result."""
    name, key = order
    case = Path(folder) / name
    with scratch_folder() as scratch:
        alone = (
            case if (case / TRUTH_FILE).exists() else Path(shutil.copytree(case, scratch / name))
        )
        found = method(alone / CAMPAIGN_FILE)
    write_content(
        Path(out) / f"{name}.json",
        with_digest(found, "trial", {"case": name, "key": key}, indent=1),
    )
