"""The cases of a trial: what each hides, and the campaign that a twin makes of it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from winchcascade.blind.injected import OUTSIDERS, PARTS, Hidden, draw_hidden
from winchcascade.blind.twin_numbers import LOADS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from winchcascade.blind.twin import Twin

Kind = Literal["single", "pair", "none", "outsider"]

STRENGTHS = (1.0, 0.4, 1.5)
"""Strengths of single effects, in turn; those of a pair are full."""

SHARES = {"none": 0.08, "outsider": 0.12, "pair": 0.12}
"""Of the cases of a trial; all others hide a single effect."""


NAME = re.compile(r"case-(?!0000)(?:[0-9]{4}|[1-9][0-9]{4,8})")
"""Names of cases, which are also those of their folders."""


class Case(msgspec.Struct, frozen=True):
    """What is decided of one case before anything is drawn: its number, what it hides, and how strongly."""

    number: int
    seed: int
    kind: Kind
    effects: dict[str, float]
    outsider: str | None = None

    @property
    def name(self) -> str:
        """Name of the case's folder, which tells nothing."""
        return f"case-{self.number:04d}"


class Answer(msgspec.Struct, frozen=True):
    """The sealed answer of one case.

    `parameters` are the true values that a diagnosis reports, by effect; `rig`, `loads` and `gains` the campaign's own numbers
    in SI units [loads in ohm], `laws` the shapes that the twin bends by.
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
    """Decide what each of a number of cases hides; the order tells nothing."""
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
    order = rng.permutation(count)
    return tuple(Case(number, seed, *hidden[place]) for number, place in enumerate(order, 1))


def _in_turn(names: list[str], rng: np.random.Generator) -> Iterator[str]:
    """Names in a drawn order, again and again."""
    order = [names[k] for k in rng.permutation(len(names))]
    while True:
        yield from order


def _pair(rng: np.random.Generator) -> dict[str, float]:
    """Two effects of different stages at full strength."""
    names = list(PARTS)
    while True:
        one, other = rng.choice(len(names), size=2, replace=False)
        if PARTS[names[one]].stage != PARTS[names[other]].stage:
            return {names[one]: 1.0, names[other]: 1.0}


def _stream(case: Case) -> np.random.Generator:
    return np.random.default_rng([case.seed, case.number])


def _draw(case: Case, rng: np.random.Generator) -> tuple[Hidden, Twin]:
    from winchcascade.blind.twin import draw_twin

    hidden = draw_hidden(case.effects, case.outsider, rng)
    return hidden, draw_twin(hidden, rng)


def answer_of(case: Case) -> Answer:
    """Draw what is true of a case, without moving the crane."""
    hidden, twin = _draw(case, _stream(case))
    return Answer(
        case.name, case.kind, case.effects, case.outsider, hidden.reported(), twin.numbers._asdict(), twin.loads, twin.gains,
        hidden.laws, None if case.outsider is None else hidden.outsiders[case.outsider],
    )  # fmt: skip


def make_campaign(case: Case) -> dict[str, bytes]:
    """Make the files of a case: its logs and their campaign.toml, the same bytes for the same case every time."""
    from winchcascade.blind.twin import make_log

    rng = _stream(case)
    _, twin = _draw(case, rng)
    files = {f"{log}.csv": log_text(make_log(twin, log, rng)).encode() for log in LOADS}
    return files | {"campaign.toml": campaign_text(case.name).encode()}


ORIGIN = "Made by a numerical twin of the rig, with hidden numbers and effects"
"""Sentence on where the logs of a case come from."""

HEADER = "Time (s),Displacement (m),Velocity (m/s),Pressure (kg/cm2),Force (N),Torque (N.m),Vdc (V),Idc (A)"
"""Head of a log, as the crane's logger writes it."""


def log_text(columns: dict[str, Any]) -> str:
    """Write a log as the crane's logger does: no more digits than a channel has."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([HEADER, *(",".join(map(repr, row)) for row in rows)]) + "\n"


def campaign_text(title: str) -> str:
    """The campaign.toml of a case."""
    lines = [f'title = "{title}"', "measured = false", f'origin = "{ORIGIN}"']
    for log, ohm in LOADS.items():
        load = "inf" if log == "open_circuit" else repr(ohm)
        lines += ["", "[[run]]", f'file = "{log}.csv"', f"load_ohm = {load}"]
    return "\n".join(lines) + "\n"
