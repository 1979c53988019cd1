"""Logs against their simulations, in the report of one log and in that of a campaign: log solid,
simulation markers (Figs 13 to 17), and where the energy of the line goes, load by load.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec

from winchcascade.core.campaign_file import joint_origin
from winchcascade.core.plain_text import first_of
from winchcascade.diagnosis.explain.model_comparison import (
    GROUPS,
    Account,
    LossBudget,
    modelled,
)
from winchcascade.reduction.campaign_record import LogSummary
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import (
    Block,
    Cell,
    Column,
    Note,
    Picture,
    Table,
)
from winchcascade.report.figures.model_figures import SHOWN, Drawn, budget_bars, given_names, panels
from winchcascade.report.figures.style import (
    cut_apart,
    evenly,
    load_looks,
)
from winchcascade.report.results.effects import call_all
from winchcascade.report.wording import load_words

PANELS = {
    "model-tether": ("pressure_kgcm2", "force_n", "power_gen_w"),
    "model-generator": ("torque_nm", "vdc_v", "idc_a"),
    "model-losses": ("loss_w", "eta_gen"),
}
"""Curves of each figure of a campaign."""

DRAWN_RUNS = 12
"""Logs that share a panel at most; of more, an even selection."""

MAX_NAMES = 3
"""Logs of a campaign that a reason for not being simulated names."""


class Named(NamedTuple):
    """One log: its name, its load [ohm], and what is kept of its comparison."""

    name: str
    load: float | None
    account: Account

    @property
    def load_words(self) -> str:
        """Its load as a text."""
        return load_words(self.load)


def run_parts(reduction: Reduction, account: Account | None) -> list[Block | None]:
    """Where the energy of one log goes in its simulation; where there is none, the reason.

    Parameters
    ----------
    account : what is kept of the log beside its simulation, which is made here if not given
    """
    run = reduction.run
    named = Named(run.name, run.load, account or modelled(reduction))
    return _parts([named], run.origin.word)


class _Kept(msgspec.Struct):
    """What a log's result keeps of its simulation; nothing where it was made without a report."""

    model: Account | None = None


def campaign_parts(runs: Sequence[LogSummary], folder: Path) -> list[Block | None]:
    """The logs of a campaign beside their simulations, all loads in a figure; empty where nothing
    was tried.

    Parameters
    ----------
    runs : in the order of their loads
    folder : of the results, which keep the simulations
    """
    logs = []
    for run in evenly(runs, DRAWN_RUNS):
        try:
            account = msgspec.json.decode((folder / run.result).read_bytes(), type=_Kept).model
        except (OSError, msgspec.DecodeError):  # a result of another making
            account = None
        logs += [] if account is None else [Named(run.name, run.load, account)]
    word = joint_origin([run.origin for run in runs]).word
    return _parts(logs, word, [run.load for run in runs])


def _parts(
    logs: Sequence[Named], word: str, loads: Sequence[float | None] | None = None
) -> list[Block | None]:
    """Reasons why logs are left out, and the others with their budgets; of a campaign with its
    loads, which have a colour each, also with their curves.
    """
    given, left_out = (
        [log for log in logs if bool(log.account.why) is without] for without in (False, True)
    )
    why = [Note(_reasons(left_out), "Left out", brief=False)] if left_out else []
    if not given:
        return [*why]
    return [
        *why,
        Note(_aim([log.account for log in given]), brief=False),
        *([] if loads is None else _curves(given, word, loads)),
        *_budget([log for log in given if log.account.budget is not None], word),
    ]


def _reasons(left_out: Sequence[Named]) -> str:
    """Why logs are not simulated, each reason with its logs."""
    found: dict[str, list[str]] = {}
    for log in left_out:
        found.setdefault(log.account.why.rstrip("."), []).append(log.name)
    named = [f"{first_of(names, MAX_NAMES)}: {why}" for why, names in found.items()]
    return f"{'; '.join(named)}."


def _curves(given: Sequence[Named], word: str, loads: Sequence[float | None]) -> list[Picture]:
    """All logs in each figure."""
    looks = load_looks(loads)
    drawn = [Drawn(log.load_words, log.account.curves, *looks[log.load]) for log in given]
    rated, gear = (
        next((x for log in given if (x := getattr(log.account, name)) is not None), None)
        for name in ("rated", "gear")
    )
    return [
        Picture(
            name,
            f"{shown_words(given_names(drawn, names))} Lines: log; markers: simulated; "
            f"means of the same samples.",
            "Lines of the log and markers of the simulation over generator speed or motion.",
            partial(panels, drawn, names, word=word, rated=rated, gear=gear),
        )
        for name, names in PANELS.items()
        if given_names(drawn, names)
    ]


def shown_words(names: Sequence[str]) -> str:
    """What the panels of a figure show, in their order.

    >>> shown_words(["vdc_v", "torque_nm"])
    'Voltage of the DC link (a), torque of the PTO shaft (b) over generator speed.'
    """
    over = " over generator speed"
    words = [SHOWN[name].what for name in names]
    shared = over if all(w.endswith(over) for w in words) else ""
    letters = [f" ({letter})" if len(names) > 1 else "" for letter in "abcdefgh"[: len(names)]]
    text = ", ".join(
        f"{w.removesuffix(shared)}{letter}" for w, letter in zip(words, letters, strict=True)
    )
    return f"{text[:1].upper()}{text[1:]}{shared}."


def _aim(accounts: Sequence[Account]) -> str:
    """What is compared: the rig, effects that its file states, and how many cycles."""
    rigs = ", ".join(dict.fromkeys(account.rig for account in accounts))
    effects = call_all(dict.fromkeys(name for account in accounts for name in account.effects))
    stated = f", with the effects that it states: {effects}" if effects else ""
    some = any(a.cycles < a.total for a in accounts)
    first = " Of long logs the first complete cycles are compared." if some else ""
    return (
        f"The logged motion of the line drives a model of {rigs} as in its rig file{stated}.{first}"
    )


# ------------------------------------------------------------------------------------- the tables
ALWAYS = ("line losses", "inertia", "mesh", "damper", "copper", "diodes", "DC link")
"""Groups that a table shows in any case, from the line to the DC link; others only where there
is something in them.
"""

GROUP_SHARE_MIN = 5e-4
"""A share of the energy of the line below this is not named. [1]"""

DECIMAL_BELOW = 2000.0
"""With less energy of the line than this a budget has a decimal. [J]"""


def row_names(logs: Sequence[Named]) -> list[str]:
    """What each log is called beside a bar: its load, and its name, cut, where others have the
    same load.
    """
    count = Counter(log.load_words for log in logs)
    names = cut_apart([log.name for log in logs])
    return [
        f"{log.load_words}, {name}" if count[log.load_words] > 1 else log.load_words
        for log, name in zip(logs, names, strict=True)
    ]


def _budget(logs: Sequence[Named], word: str) -> list[Block | None]:
    """Where the energy of the line goes in the simulation of each log: bars, and a row for each
    part.
    """
    budgets = [log.account.budget for log in logs if log.account.budget is not None]
    if not budgets:
        return []
    names = row_names(logs)
    shown = [
        g
        for g in reversed(GROUPS)
        if g in ALWAYS or any(abs(b.shares[g]) >= GROUP_SHARE_MIN for b in budgets)
    ]

    def energy(budget: LossBudget, name: str) -> Column[str]:
        return Column(
            name, lambda g: budget.groups[g], "J", 1 if budget.line < DECIMAL_BELOW else 0
        )

    columns: list[Column[str]] = [Column("part", str), *map(energy, budgets, names)]
    line: list[Cell] = ["from the line", *(budget.line for budget in budgets)]
    if len(budgets) == 1:
        columns.append(Column("share of the line", lambda g: 100.0 * budgets[0].shares[g], "%", 2))
        line.append(100.0 * sum(budgets[0].shares.values()))
    columns.append(Column("what it is", GROUPS.__getitem__))
    return [
        Picture(
            "model-budget",
            "Simulated loss budget in the integration window; marks: what reaches shaft and DC "
            "link.",
            "Stacked bars of the parts; the energies are in the table.",
            partial(budget_bars, names, budgets, word=word),
        ),
        Table(
            "loss-budget", "Simulated loss budget in the window, means over the cycles.", columns, shown, [[*line, ""]],
            brief=False,
        ),
    ]  # fmt: skip
