"""Cases of a trial: what is injected in each, and the campaign that a twin makes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import cycle
from pathlib import Path

import msgspec
import numpy as np

from winchcascade.blind.crane_motion import draw_motion
from winchcascade.blind.injected import OUTSIDERS, PARTS, Hidden, draw_hidden
from winchcascade.blind.twin import Twin, draw_twin, solve_twin
from winchcascade.blind.twin_log import read_log
from winchcascade.blind.twin_numbers import CRANE_LOGGER, LOADS
from winchcascade.core.run import Signal

STRENGTHS = (1.0, 0.4, 1.5)
"""Strengths of single effects, in turn; both effects of a pair have full strength."""

SHARES = {"none": 0.08, "outsider": 0.12, "pair": 0.12}
"""Share of each kind among the cases of a trial; in all others a single effect is injected."""


class DealtCase(msgspec.Struct, frozen=True):
    """Plan of one case before its values are drawn; the seed and the number decide them.

    Parameters
    ----------
    effects : strength of each injected effect, 1 for full
    kind : by which cases are counted
    outsider : cause beyond the catalogue
    """

    number: int
    seed: int
    effects: dict[str, float] = {}
    kind: str = "none"
    outsider: str | None = None

    @property
    def name(self) -> str:
        """Name of the folder of the case, which does not depend on what is injected."""
        return f"case-{self.number:04d}"


def plan_cases(count: int, seed: int) -> tuple[DealtCase, ...]:
    """Plan what is injected in each case of a trial of `blind deal`, in a random order."""
    rng = np.random.default_rng([seed, 0])
    counts = {kind: round(share * count) for kind, share in SHARES.items()}
    hidden: list[tuple[str, dict[str, float], str | None]] = [("none", {}, None)] * counts["none"]
    outsiders = _in_turn(list(OUTSIDERS), rng)
    hidden += [("outsider", {}, next(outsiders)) for _ in range(counts["outsider"])]
    hidden += [("pair", _pair(rng), None) for _ in range(counts["pair"])]
    singles, turn = _in_turn(list(PARTS), rng), int(rng.integers(len(STRENGTHS)))
    for k in range(count - len(hidden)):
        strength = STRENGTHS[(turn + k + k // len(PARTS)) % len(STRENGTHS)]
        hidden.append(("single", {next(singles): strength}, None))
    planned = [hidden[place] for place in rng.permutation(count)]
    return tuple(
        DealtCase(number, seed, effects, kind, outsider)
        for number, (kind, effects, outsider) in enumerate(planned, 1)
    )


def _in_turn(names: list[str], rng: np.random.Generator) -> Iterator[str]:
    """Names in a random order, repeated without end; the order is drawn when the first name is
    taken.
    """
    yield from cycle([names[k] for k in rng.permutation(len(names))])


def _pair(rng: np.random.Generator) -> dict[str, float]:
    """Two effects of different stages at full strength."""
    names = list(PARTS)
    while True:
        one, other = rng.choice(len(names), size=2, replace=False)
        if PARTS[names[one]].stage != PARTS[names[other]].stage:
            return {names[one]: 1.0, names[other]: 1.0}


def draw(case: DealtCase) -> tuple[Hidden, Twin, np.random.Generator]:
    """Injected values and the twin of a case, and the generator from which the logs are drawn
    next.
    """
    rng = np.random.default_rng([case.seed, case.number])
    hidden = draw_hidden(case.effects, case.outsider, rng)
    return hidden, draw_twin(hidden, rng), rng


ORIGIN = "Made by a numerical twin of the rig, with hidden numbers and effects"
"""Sentence on where the logs of a case come from."""

STATED_LOADS = {log: math.inf if log == "open_circuit" else ohm for log, ohm in LOADS.items()}
"""Load that the campaign.toml of a case states for each log, infinite for the open circuit.
[ohm]
"""

HEADERS = {
    "time": "Time (s)", "displacement": "Displacement (m)", "velocity": "Velocity (m/s)", "pressure": "Pressure (kg/cm2)",
    "force": "Force (N)", "torque": "Torque (N.m)", "vdc": "Vdc (V)", "idc": "Idc (A)",
}  # fmt: skip
"""Headers of the columns of a log, in the format of the logger of the crane."""

RIG = Path(__file__).with_name("rig.toml")
"""Rig file of every case but its name: the numbers of the twin, as well as they are known."""


def write_campaign(case: DealtCase, folder: Path) -> None:
    """Write the logs of a case, its campaign.toml and its rig file; the same case gives the same
    bytes every time.
    """
    _, twin, rng = draw(case)
    for log in STATED_LOADS:
        solved = solve_twin(twin, log, *draw_motion(log, rng))
        write_log(folder / f"{log}.csv", read_log(twin, solved, rng, CRANE_LOGGER))
    text = f'name = "blind {case.number}"\n' + RIG.read_text(encoding="utf-8")
    (folder / "rig.toml").write_bytes(text.encode())
    (folder / "campaign.toml").write_bytes(campaign_toml(case.name).encode())


def write_log(path: Path, columns: Mapping[str, Signal]) -> None:
    """Write a log in the format of the logger of the crane, with no more digits than a channel
    has.
    """
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    header = ",".join(HEADERS[name] for name in columns)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(
        ("\n".join([header, *(",".join(map(repr, row)) for row in rows)]) + "\n").encode()
    )


def campaign_toml(
    title: str,
    loads: Mapping[str, float] = STATED_LOADS,
    rig: str = "rig.toml",
    simulated: str | None = None,
) -> str:
    """Make the campaign.toml of a case.

    Parameters
    ----------
    loads : stated load of each log by its name [ohm]
    simulated : folder of the owner's own simulation of each run
    """
    lines = [f'title = "{title}"', f'rig = "{rig}"', "measured = false", f'origin = "{ORIGIN}"']
    for log, ohm in loads.items():
        own = [f'simulated = "{simulated}/{log}.csv"'] if simulated else []
        lines += ["", "[[run]]", f'file = "{log}.csv"', *own, f"load_ohm = {ohm!r}"]
    return "\n".join(lines) + "\n"
