"""The sealed answers of a trial: one file beside the cases, and its digest in the trial's own record.

Whoever diagnoses the cases needs neither. Whoever scores them opens the seal, and an answer that was changed after the cases
were dealt is refused.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import msgspec

from winchcascade.blind.cases import NAME, Answer
from winchcascade.core.errors import OptionError
from winchcascade.core.store import inside
from winchcascade.core.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

SEALED, TRIAL = "sealed.json", "trial.json"
"""Files of a trial: the answers, and what may be known of them."""

SEALED_SCHEMA = "winchcascade/sealed/1"
TRIAL_SCHEMA = "winchcascade/trial/1"


class Envelope(msgspec.Struct, frozen=True):
    """All answers of a trial, with the seed that dealt it."""

    seed: int
    answers: tuple[Answer, ...]
    schema: str = SEALED_SCHEMA


class Trial(msgspec.Struct, frozen=True):
    """What may be known of a trial before it is scored: its cases and the digest of the sealed answers."""

    cases: tuple[str, ...]
    sealed_sha256: str
    version: str = __version__
    schema: str = TRIAL_SCHEMA


def seal(envelope: Envelope) -> tuple[bytes, Trial]:
    """Put answers into the bytes of a sealed file, and make the trial's record with their digest."""
    content = msgspec.json.format(msgspec.json.encode(envelope), indent=1) + b"\n"
    return content, Trial(tuple(a.case for a in envelope.answers), hashlib.sha256(content).hexdigest())


def trial_bytes(trial: Trial) -> bytes:
    """The record of a trial as it is written."""
    return msgspec.json.format(msgspec.json.encode(trial), indent=1) + b"\n"


def read_trial(folder: Path) -> Trial:
    """Read the record of a trial; OptionError says why a folder is none."""
    path = inside(folder, TRIAL)
    try:
        trial = msgspec.json.decode(path.read_bytes(), type=Trial)
    except OSError as fault:
        raise OptionError(
            f"{path}: cannot be read ({fault.strerror}); expected the folder of a trial, as blind deal makes it."
        ) from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(f"{path}: is no record of a trial ({fault}); deal the trial again.") from None
    if trial.schema != TRIAL_SCHEMA:
        raise OptionError(f"{path}: has the schema {trial.schema}; expected {TRIAL_SCHEMA}.")
    _check_names(trial.cases, path)
    return trial


def _check_names(names: Sequence[str], path: Path) -> None:
    """Refuse names that are not those of cases: they are also names of folders, which are replaced."""
    for number, name in enumerate(names, 1):
        if NAME.fullmatch(name) is None or name in names[: number - 1]:
            raise OptionError(
                f"{path}: case {number} is named {name!r}; expected names such as case-0001, each once. The file was changed "
                "by hand; deal the trial again."
            )


def open_seal(folder: Path) -> tuple[Trial, Envelope]:
    """Open the answers of a trial.

    Raises
    ------
    OptionError : the folder is no trial, the answers are missing, or they are not those that were dealt
    """
    trial, path = read_trial(folder), inside(folder, SEALED)
    try:
        content = path.read_bytes()
    except OSError as fault:
        raise OptionError(
            f"{path}: cannot be read ({fault.strerror}); without the answers no trial is scored."
        ) from None
    found = hashlib.sha256(content).hexdigest()
    if found != trial.sealed_sha256:
        raise OptionError(
            f"{path}: the answers were changed after the cases were dealt: their SHA-256 is {found}, {TRIAL} has "
            f"{trial.sealed_sha256}; put the dealt file back, or deal again."
        )
    try:
        envelope = msgspec.json.decode(content, type=Envelope)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(f"{path}: holds no answers that this version can read ({fault}); deal again.") from None
    _check_names([answer.case for answer in envelope.answers], path)
    return trial, envelope
