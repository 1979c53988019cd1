"""The section of logs against their simulations, in the report of one log and in that of a
campaign.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from winchcascade.core.plain_text import first_of
from winchcascade.core.run import Run
from winchcascade.diagnosis.explain.model_comparison import (
    COMPARED,
    GROUPS,
    Account,
    ChannelDifference,
    LossBudget,
)
from winchcascade.report.content import (
    Block,
    Cell,
    Column,
    Note,
    Section,
    Table,
    picture,
    section,
    table,
)
from winchcascade.report.figures import model_figures as figures
from winchcascade.report.figures.style import cut_apart
from winchcascade.report.glossary import CHANNELS
from winchcascade.report.wording import load_words

PANELS = {
    "model-tether": ("pressure_kgcm2", "force_n", "power_gen_w"),
    "model-generator": ("torque_nm", "vdc_v", "idc_a", "resistance_ohm"),
    "model-losses": ("loss_w", "eta_gen"),
}
"""Curves of each figure."""

MAX_NAMES = 3
"""Logs of a campaign that a reason for not being simulated names."""


class Named(NamedTuple):
    """One log: its name, its load as a text (if that is unknown what the log is called), and
    what is kept of its comparison.
    """

    name: str
    load: str
    account: Account


def run_section(run: Run, account: Account) -> Section:
    """Lay one log beside its simulation; where there is none, give the reason. Called within the
    style of the figures.
    """
    section_of_one = campaign_section(
        [Named(run.name, load_words(run.load), account)], account.word
    )
    assert section_of_one is not None  # there is a log
    return section_of_one


def campaign_section(logs: Sequence[Named], word: str) -> Section | None:
    """Lay the logs of a campaign beside their simulations, all loads in a figure; None where
    nothing was tried.

    Parameters
    ----------
    logs : in the order of their loads
    word : what the logs are called
    """
    given, left_out = (
        [log for log in logs if bool(log.account.why) is without] for without in (False, True)
    )
    why = [Note(_reasons(left_out), "Left out", brief=False)] if left_out else []
    heading = "Measured and simulated" if word == "measured" else "Log and simulation"
    return (
        section("model", heading, *why, *(_blocks(given, word) if given else []), folded=True)
        if logs
        else None
    )


def _reasons(left_out: Sequence[Named]) -> str:
    """Why logs are not simulated, each reason with its logs."""
    found: dict[str, list[str]] = {}
    for log in left_out:
        found.setdefault(log.account.why.rstrip("."), []).append(log.name)
    named = [f"{first_of(names, MAX_NAMES)}: {why}" for why, names in found.items()]
    return f"{'; '.join(named)}."


def _blocks(given: Sequence[Named], word: str) -> list[Block | None]:
    """All logs in each figure, and the tables."""
    accounts = [log.account for log in given]
    drawn = figures.styled_by_load([log.load for log in given], [a.curves for a in accounts])
    rated, gear = (
        next((x for x in values if x is not None), None)
        for values in ([a.rated for a in accounts], [a.gear for a in accounts])
    )
    return [
        Note(_aim(accounts), brief=False),
        *(
            picture(
                figures.panels(drawn, names, word=word, rated=rated, gear=gear), name,
                f"{shown_words(figures.given_names(drawn, names))} Lines: log; markers: "
                f"simulated; means of the same samples.",
                "Lines of the log and markers of the simulation; the mean differences are in the "
                "table.",
            )
            for name, names in PANELS.items()
        ),
        _differences_table(given),
        *_budget([log for log in given if log.account.budget is not None], word),
    ]  # fmt: skip


def shown_words(names: Sequence[str]) -> str:
    """What the panels of a figure show, in their order.

    >>> shown_words(["vdc_v", "torque_nm"])
    'Voltage of the DC link (a), torque of the PTO shaft (b) over generator speed.'
    """
    over = " over generator speed"
    words = [figures.SHOWN[name].what for name in names]
    shared = over if all(w.endswith(over) for w in words) else ""
    letters = [f" ({letter})" if len(names) > 1 else "" for letter in "abcdefgh"[: len(names)]]
    text = ", ".join(
        f"{w.removesuffix(shared)}{letter}" for w, letter in zip(words, letters, strict=True)
    )
    return f"{text[:1].upper()}{text[1:]}{shared}."


def _aim(accounts: Sequence[Account]) -> str:
    """What is compared: the rig, effects that its file states, and how many cycles."""
    rigs = ", ".join(dict.fromkeys(account.rig for account in accounts))
    effects = ", ".join(dict.fromkeys(name for account in accounts for name in account.effects))
    stated = f", with the effects that it states: {effects}" if effects else ""
    some = any(a.cycles < a.total for a in accounts)
    first = " Of long logs the first complete cycles are compared." if some else ""
    return (
        f"The logged motion of the line drives a model of {rigs} as in its rig file{stated}.{first}"
    )


# ------------------------------------------------------------------------------------- the tables
Difference = tuple[Named, str, ChannelDifference]
"""A log, a channel, and its difference from the simulation."""


def _differences_table(given: Sequence[Named]) -> Table[Difference] | None:
    """Log minus simulation over the payouts, a row for each channel of each log."""
    several: list[Column[Difference]] = [
        Column("log", lambda row: row[0].name),
        Column("load", lambda row: row[0].load),
    ]
    return table(
        "differences", "Log - simulation over the payouts: mean (bias) and root mean square (rms).",
        [
            *(several if len(given) > 1 else []),
            Column("channel", lambda row: CHANNELS[row[1]].label),
            Column("unit", lambda row: CHANNELS[row[1]].unit),
            Column("bias", lambda row: row[2].bias, signed=True, own_digits=True),
            Column("rms", lambda row: row[2].rms, own_digits=True),
        ],
        [(log, name, one) for name in COMPARED for log in given if (one := log.account.differences.get(name)) is not None],
        brief=False,
    )  # fmt: skip


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
    count = Counter(log.load for log in logs)
    names = cut_apart([log.name for log in logs])
    return [
        f"{log.load}, {name}" if count[log.load] > 1 else log.load
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
        picture(
            figures.budget_bars(names, budgets, word=word), "model-budget",
            "Simulated loss budget in the integration window; marks: what reaches shaft and DC "
            "link.",
            "Stacked bars of the parts; the energies are in the table.",
        ),
        Table(
            "loss-budget", "Simulated loss budget in the window, means over the cycles.", columns, shown, [[*line, ""]],
            brief=False,
        ),
    ]  # fmt: skip
