"""The cases of a trial: what is injected in each, the campaign that a twin makes of it, and the sealed answers.

The answers are one file beside the cases; the record of the trial holds its digest. A diagnosis needs neither. A score opens
the answers and rejects them if they were changed after the cases were generated.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

import msgspec
import numpy as np

from winchcascade.blind.injected import OUTSIDERS, PARTS, Hidden, draw_hidden
from winchcascade.blind.twin_numbers import LOADS
from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes
from winchcascade.core.rig_toml import DEFAULT_RIG
from winchcascade.core.run import Signal
from winchcascade.core.store import digest_of, inside
from winchcascade.core.version import __version__

if TYPE_CHECKING:
    from winchcascade.blind.twin import Twin

Content = TypeVar("Content")

Kind = Literal["single", "pair", "none", "outsider"]

STRENGTHS = (1.0, 0.4, 1.5)
"""Strengths of single effects, in turn; both effects of a pair have full strength."""

SHARES = {"none": 0.08, "outsider": 0.12, "pair": 0.12}
"""Share of each kind among the cases of a trial; in all others a single effect is injected."""

NAME = re.compile(r"case-(?!0000)(?:[0-9]{4}|[1-9][0-9]{4,8})")
"""Pattern of the names of cases, which are also the names of their folders."""


class Case(msgspec.Struct, frozen=True):
    """Plan of one case before its values are drawn: its number, and the strength of each injected effect, or the outsider."""

    number: int
    seed: int
    kind: Kind
    effects: dict[str, float]
    outsider: str | None = None

    @property
    def name(self) -> str:
        """Name of the folder of the case, which does not depend on what is injected."""
        return f"case-{self.number:04d}"


class Answer(msgspec.Struct, frozen=True):
    """The sealed answer of one case.

    `parameters` are the true values that a diagnosis reports, by effect; `rig`, `loads` and `gains` the numbers of the campaign
    in SI units [loads in ohm], `laws` the numbers of the laws of the injected effects.
    """

    case: str
    kind: Kind
    effects: dict[str, float]
    outsider: str | None
    parameters: dict[str, dict[str, float]]
    rig: dict[str, float]
    loads: dict[str, float]
    gains: dict[str, float]
    laws: dict[str, float]
    outsider_size: float | None = None


def plan_cases(count: int, seed: int) -> tuple[Case, ...]:
    """Plan what is injected in each of a number of cases, in a random order."""
    rng = np.random.default_rng([seed, 0])
    counts = {kind: round(share * count) for kind, share in SHARES.items()}
    hidden: list[tuple[Kind, dict[str, float], str | None]] = [("none", {}, None)] * counts["none"]
    outsiders = _in_turn(list(OUTSIDERS), rng)
    hidden += [("outsider", {}, next(outsiders)) for _ in range(counts["outsider"])]
    hidden += [("pair", _pair(rng), None) for _ in range(counts["pair"])]
    singles, turn = _in_turn(list(PARTS), rng), int(rng.integers(len(STRENGTHS)))
    for k in range(count - len(hidden)):
        strength = STRENGTHS[(turn + k + k // len(PARTS)) % len(STRENGTHS)]
        hidden.append(("single", {next(singles): strength}, None))
    return tuple(Case(number, seed, *hidden[place]) for number, place in enumerate(rng.permutation(count), 1))


def _in_turn(names: list[str], rng: np.random.Generator) -> Iterator[str]:
    """Names in a random order, repeated without end; the order is drawn when the first name is taken."""
    yield from cycle([names[k] for k in rng.permutation(len(names))])


def _pair(rng: np.random.Generator) -> dict[str, float]:
    """Two effects of different stages at full strength."""
    names = list(PARTS)
    while True:
        one, other = rng.choice(len(names), size=2, replace=False)
        if PARTS[names[one]].stage != PARTS[names[other]].stage:
            return {names[one]: 1.0, names[other]: 1.0}


def _draw(case: Case) -> tuple[Hidden, Twin, np.random.Generator]:
    """Injected values and the twin of a case, and the generator from which the logs are drawn next."""
    from winchcascade.blind.twin import draw_twin

    rng = np.random.default_rng([case.seed, case.number])
    hidden = draw_hidden(case.effects, case.outsider, rng)
    return hidden, draw_twin(hidden, rng), rng


def answer_of(case: Case) -> Answer:
    """Draw the true numbers of a case without making its logs."""
    hidden, twin, _ = _draw(case)
    return Answer(
        case.name, case.kind, case.effects, case.outsider, hidden.reported(), twin.numbers._asdict(), twin.loads, twin.gains,
        hidden.laws, None if case.outsider is None else hidden.outsiders[case.outsider],
    )  # fmt: skip


def make_campaign(case: Case) -> dict[str, bytes]:
    """Make the files of a case: its logs and their campaign.toml, the same bytes for the same case every time."""
    from winchcascade.blind.twin import make_log

    _, twin, rng = _draw(case)
    texts = {f"{log}.csv": log_text(make_log(twin, log, rng)) for log in LOADS} | {
        "campaign.toml": campaign_toml(case.name)
    }
    return {name: text.encode() for name, text in texts.items()}


ORIGIN = "Made by a numerical twin of the rig, with hidden numbers and effects"
"""Sentence on where the logs of a case come from."""

STATED_LOADS = {log: math.inf if log == "open_circuit" else ohm for log, ohm in LOADS.items()}
"""Load that the campaign.toml of a case states for each log, infinite for the open circuit. [ohm]"""

HEADER = "Time (s),Displacement (m),Velocity (m/s),Pressure (kg/cm2),Force (N),Torque (N.m),Vdc (V),Idc (A)"
"""Header of a log, in the format of the logger of the crane."""


def log_text(columns: dict[str, Signal]) -> str:
    """Write a log in the format of the logger of the crane, with no more digits than a channel has."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([HEADER, *(",".join(map(repr, row)) for row in rows)]) + "\n"


def campaign_toml(title: str, loads: Mapping[str, float] = STATED_LOADS) -> str:
    """Make the campaign.toml of a case, with the built-in rig for which the twin stands.

    Parameters
    ----------
    loads : stated load of each log by its name [ohm]
    """
    lines = [f'title = "{title}"', f'rig = "{DEFAULT_RIG}"', "measured = false", f'origin = "{ORIGIN}"']
    for log, ohm in loads.items():
        lines += ["", "[[run]]", f'file = "{log}.csv"', f"load_ohm = {ohm!r}"]
    return "\n".join(lines) + "\n"


SEALED, TRIAL = "sealed.json", "trial.json"
"""Files of a trial: the answers, and the record without them."""

SEALED_SCHEMA = "winchcascade/sealed/1"
TRIAL_SCHEMA = "winchcascade/trial/1"


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


def seal(sealed: SealedAnswers) -> tuple[bytes, Trial]:
    """Put answers into the bytes of a sealed file, and make the record of the trial with their digest."""
    content = trial_bytes(sealed)
    return content, Trial(tuple(a.case for a in sealed.answers), digest_of(content))


def trial_bytes(record: Trial | SealedAnswers) -> bytes:
    """Content of the file of the record of a trial, or of its answers."""
    return json_bytes(record)


def read_trial(folder: Path) -> Trial:
    """Read the record of a trial; OptionError gives the reason if the folder is no trial."""
    path = inside(folder, TRIAL)
    content = _content(path, "expected the folder of a trial, as blind deal makes it.")
    trial = decoded(path, content, Trial, "is no record of a trial", "deal the trial again")
    if trial.schema != TRIAL_SCHEMA:
        raise OptionError(f"{path}: has the schema {trial.schema}; expected {TRIAL_SCHEMA}.")
    _check_names(trial.cases, path)
    return trial


def _content(path: Path, expected: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as fault:
        raise OptionError(f"{path}: cannot be read ({fault.strerror}); {expected}") from None


def decoded(path: Path, content: bytes, kind: type[Content], what: str, remedy: str) -> Content:
    """Decode the content of a file of a trial; OptionError with what is wrong and what to do if that is not possible."""
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(f"{path}: {what} ({fault}); {remedy}.") from None


def _check_names(names: Sequence[str], path: Path) -> None:
    """Reject names that are not those of cases: they are also names of folders, which are replaced."""
    for number, name in enumerate(names, 1):
        if NAME.fullmatch(name) is None or name in names[: number - 1]:
            raise OptionError(
                f"{path}: case {number} is named {name!r}; expected names such as case-0001, each once. The file was changed "
                "by hand; deal the trial again."
            )


def open_seal(folder: Path) -> tuple[Trial, SealedAnswers]:
    """Open the answers of a trial.

    Raises
    ------
    OptionError : the folder is no trial, the answers are missing, or they were changed
    """
    trial, path = read_trial(folder), inside(folder, SEALED)
    content = _content(path, "without the answers no trial is scored.")
    found = digest_of(content)
    if found != trial.sealed_sha256:
        raise OptionError(
            f"{path}: the answers were changed after the cases were dealt: their SHA-256 is {found}, {TRIAL} has "
            f"{trial.sealed_sha256}; put the dealt file back, or deal again."
        )
    sealed = decoded(path, content, SealedAnswers, "holds no answers that this version can read", "deal again")
    _check_names([answer.case for answer in sealed.answers], path)
    return trial, sealed
