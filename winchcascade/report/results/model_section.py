"""The section of a log against its simulation, in the report of one log and in that of a campaign."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from msgspec.structs import replace

from winchcascade.core.rig_file import Rig
from winchcascade.diagnosis.compared_curves import samples_of
from winchcascade.diagnosis.loss_budget import GROUPS, LossBudget
from winchcascade.diagnosis.model_account import COMPARED, Account, ChannelDifference, Modelled
from winchcascade.report.content import Block, Column, Note, Picture, Section, Table, picture, section, table
from winchcascade.report.figures import model_figures as figures
from winchcascade.report.figures.style import cut_apart
from winchcascade.report.glossary import CHANNELS
from winchcascade.report.wording import load_words

TETHER = ("pressure_kgcm2", "force_n", "power_gen_w")
GENERATOR = ("torque_nm", "vdc_v", "idc_a", "resistance_ohm")
LOSSES = ("loss_w", "eta_gen")
"""Panels of the figures."""

MAX_NAMES = 3
"""Logs of a campaign that a reason for not being simulated names."""

UNKNOWN = ChannelDifference(math.nan, math.nan)
"""Difference of a channel that a log lacks."""

ALT = "Lines of the log and markers of the simulation; the mean differences are in the table."


# ---------------------------------------------------------------------------------------------------------- of one log
def run_section(found: Modelled) -> Section:
    """Lay one log beside its simulation; where there is none, give the reason. Called within the style of the figures."""
    account, comparison = found.account, found.comparison
    heading = _heading(account.word)
    if comparison is None:
        return section("model", heading, Note(account.why, "Left out", brief=False), folded=True)
    shown = [((*TETHER, "vdc_v"), "model-tether")] if account.open_circuit else [
        (TETHER, "model-tether"), (GENERATOR, "model-generator"), (LOSSES, "model-losses"),
    ]  # fmt: skip
    drawn, samples = [figures.Drawn("", account.curves)], samples_of(comparison)
    budget, words = account.budget, f"Dots: samples; lines: their means; markers: simulated. {_with([account])}"
    return section(
        "model", heading,
        Note(_aim([account], comparison.rig), brief=False),
        *(_panels(name, words, drawn, names, account, clouds=samples) for names, name in shown),
        table("differences", _LESS, CHANNEL_DIFFERENCES, account.differences.items(), brief=False),
        *_open_circuit(account),
        None if budget is None else _budget_picture([load_words(comparison.run.load)], [budget], [account]),
        None if budget is None else _one_budget_table(budget),
        folded=True,
    )  # fmt: skip


def _panels(
    name: str,
    words: str,
    drawn: Sequence[figures.Drawn],
    names: Sequence[str],
    account: Account,
    *,
    clouds: figures.Clouds | None = None,
    gear: float | None = None,
) -> Picture | None:
    """Picture of some panels, whose caption begins with what they show."""
    figure = figures.panels(drawn, names, word=account.word, rated=account.rated, clouds=clouds, gear=gear)
    return picture(figure, name, f"{shown_words(figures.given_names(drawn, names))} {words}".rstrip(), ALT)


def _open_circuit(account: Account) -> list[Block | None]:
    """The damper's sweep and the back-EMF's regression, where the log is an open circuit."""
    blocks: list[Block | None] = []
    sweep, fit, word = account.sweep, account.regression, account.word
    if sweep is not None:
        caption = (
            "Line tension in open circuit: log, and simulations with multiples of the damper of the rig file, "
            f"{sweep.nominal:.3g} N.m.s/rad. {_with([account])}"
        )
        figure = figures.damper_sweep(sweep, word=word, rated=account.rated)
        blocks.append(
            picture(figure, "model-damper", caption.rstrip(), "Curves of the line tension, one for each damper.")
        )
    if fit is not None:
        caption = (
            f"Voltage of the DC link in open circuit, and the back-EMF that it requires: {fit.slope:.5f} V/rpm, 95 % "
            f"{fit.low:.5f} to {fit.high:.5f}, R2 = {fit.r2:.4f}; rig file: {fit.reference:.4f} V/rpm."
        )
        alt = "Dots of voltages over generator speed with a line through zero; its slope is in the caption."
        blocks.append(picture(figures.back_emf_figure(fit, word=word), "model-emf", caption, alt))
    return blocks


# -------------------------------------------------------------------------------------------------------- of a campaign
class Named(NamedTuple):
    """One log of a campaign: its name, its load as a text (if that is unknown what the log is called), and what is kept
    of its comparison.
    """

    name: str
    load: str
    account: Account


def row_names(logs: Sequence[Named]) -> list[tuple[str, ...]]:
    """What each log is called in a row: its load, and its name, cut, where others have the same load."""
    count = Counter(log.load for log in logs)
    names = cut_apart([log.name for log in logs])
    return [(log.load, name) if count[log.load] > 1 else (log.load,) for log, name in zip(logs, names, strict=True)]


def campaign_section(logs: Sequence[Named], word: str) -> Section | None:
    """Lay the logs of a campaign beside their simulations, all loads in a figure; None where nothing was tried.

    Parameters
    ----------
    logs : in the order of their loads
    word : what the logs are called
    """
    given = [log._replace(account=replace(log.account, word=word)) for log in logs if not log.account.why]
    left_out = [log for log in logs if log.account.why]
    why = Note(_reasons(left_out), "Left out", brief=False) if left_out else None
    blocks = [Note(_aim([log.account for log in given]), brief=False), *_pictures_and_tables(given)] if given else []
    return section("model", _heading(word), why, *blocks, folded=True) if logs else None


def _reasons(left_out: Sequence[Named]) -> str:
    """Why logs are not simulated, each reason with its logs."""
    found: dict[str, list[str]] = {}
    for log in left_out:
        found.setdefault(log.account.why.rstrip("."), []).append(log.name)
    named = [
        f"{', '.join(names[:MAX_NAMES])}{f' and {len(names) - MAX_NAMES} more' * (len(names) > MAX_NAMES)}: {why}"
        for why, names in found.items()
    ]
    return f"{'; '.join(named)}."


def _pictures_and_tables(given: Sequence[Named]) -> list[Block | None]:
    """All loads in each figure, an open circuit's own figures, and the tables."""
    accounts = [log.account for log in given]
    drawn = figures.styled_by_load([log.load for log in given], [a.curves for a in accounts])
    rated, gear = (
        next((x for x in values if x is not None), None)
        for values in ([a.rated for a in accounts], [a.gear for a in accounts])
    )
    first = replace(accounts[0], rated=rated)
    opened = next((a for a in accounts if a.open_circuit), None)
    words = f"Lines: log; markers: simulated; means over the same samples. {_with(accounts)}"
    shown = (
        (TETHER, "model-tether", None),
        (GENERATOR[:1], "model-torque", gear),
        (GENERATOR[1:], "model-generator", None),
        (LOSSES, "model-losses", None),
    )
    booked = [(names, a.budget) for names, a in zip(row_names(given), accounts, strict=True) if a.budget is not None]
    budgets = [budget for _, budget in booked]
    return [
        *(_panels(name, words, drawn, panel, first, gear=above) for panel, name, above in shown),
        *([] if opened is None else _open_circuit(opened)),
        _differences_table(given),
        _budget_picture([", ".join(names) for names, _ in booked], budgets, accounts) if booked else None,
        _budget_table([", ".join(names) for names, _ in booked], budgets) if booked else None,
    ]


# -------------------------------------------------------------------------------------------------------- the captions
def _heading(word: str) -> str:
    return "Measured and simulated" if word == "measured" else "Log and simulation"


def shown_words(names: Sequence[str]) -> str:
    """What the panels of a figure show, in their order.

    >>> shown_words(["vdc_v", "torque_nm"])
    'Voltage of the DC link (a), torque of the PTO shaft (b) over generator speed.'
    """
    over = " over generator speed"
    words = [figures.SHOWN[name].what for name in names]
    shared = over if all(w.endswith(over) for w in words) else ""
    letters = [f" ({letter})" if len(names) > 1 else "" for letter in "abcdefgh"[: len(names)]]
    text = ", ".join(f"{w.removesuffix(shared)}{letter}" for w, letter in zip(words, letters, strict=True))
    return f"{text[:1].upper()}{text[1:]}{shared}."


def _with(accounts: Sequence[Account]) -> str:
    """What was added to the model of the rig file; empty where nothing was."""
    changed = ", ".join(dict.fromkeys(account.changed for account in accounts if account.changed))
    return f"Simulated with {changed}." if changed else ""


def _aim(accounts: Sequence[Account], rig: Rig | None = None) -> str:
    """What is compared: the rig, effects that its file states, and how many cycles."""
    rigs = ", ".join(dict.fromkeys(account.rig for account in accounts))
    effects = f", with the effects that it states: {', '.join(rig.effects)}" if rig and rig.effects else ""
    some = any(a.cycles < a.total for a in accounts)
    first = f" Of {accounts[0].total} complete cycles the first {accounts[0].cycles} are compared." if some else ""
    if some and len(accounts) > 1:
        first = " Of long logs the first complete cycles are compared."
    return f"The logged motion of the line drives a model of {rigs} as in its rig file{effects}.{first}"


def _budget_picture(names: Sequence[str], budgets: Sequence[LossBudget], accounts: Sequence[Account]) -> Picture | None:
    """Stacked bars of the loss budgets."""
    caption = (
        f"Simulated loss budget in the integration window; marks: what reaches shaft and DC link. {_with(accounts)}"
    )
    figure = figures.budget_bars(names, budgets, word=accounts[0].word)
    return picture(figure, "model-budget", caption.rstrip(), "Stacked bars; the energies are in the table.")


# ---------------------------------------------------------------------------------------------------------- the tables
_LESS = "Log - simulation over the payouts: mean (bias) and root mean square (rms)."

CHANNEL_DIFFERENCES: tuple[Column[tuple[str, ChannelDifference]], ...] = (
    Column("channel", lambda row: CHANNELS[row[0]].label),
    Column("unit", lambda row: CHANNELS[row[0]].unit),
    Column("bias", lambda row: row[1].bias, signed=True, own_digits=True),
    Column("rms", lambda row: row[1].rms, own_digits=True),
)
"""Difference of a channel, of one log."""


def _differences_table(given: Sequence[Named]) -> Table[Named] | None:
    """Log minus simulation over the payouts, a row for each log; None where no channel can be compared."""
    names = [name for name in COMPARED if any(name in log.account.differences for log in given)]
    columns: list[Column[Named]] = [
        Column("log", lambda log: log.name),
        Column("load", lambda log: log.load),
        Column("cycles", lambda log: log.account.cycles, decimals=0),
        *(column for name in names for column in _difference_columns(name)),
    ]
    return table("differences", _LESS, columns, given if names else (), brief=False)


def _difference_columns(name: str) -> list[Column[Named]]:
    """Bias and root mean square of a channel."""
    term = CHANNELS[name]

    def of(log: Named) -> ChannelDifference:
        return log.account.differences.get(name, UNKNOWN)

    return [
        Column(f"{term.symbol} bias", lambda log: of(log).bias, term.unit, term.decimals, signed=True),
        Column(f"{term.symbol} rms", lambda log: of(log).rms, term.unit, term.decimals),
    ]


ALWAYS = ("stored", "screw", "line", "inertia", "mesh", "damper", "copper", "diodes", "dc")
"""Groups that a table shows in any case, from the line to the DC link; others only where there is something in them."""

NOTHING = 5e-4
"""A share of the energy of the line below this is not named. [1]"""

FINE = 2000.0
"""With less energy of the line than this a budget has a decimal. [J]"""


def _named(budgets: Sequence[LossBudget]) -> list[str]:
    """Groups that a table names, from the line to the DC link: the usual ones, and others in which there is something."""
    return [g for g in reversed(GROUPS) if g in ALWAYS or any(abs(b.shares[g]) >= NOTHING for b in budgets)]


def _decimals(budgets: Sequence[LossBudget]) -> int:
    return 1 if any(budget.line < FINE for budget in budgets) else 0


def _joules(group: str, row: tuple[str, LossBudget]) -> float:
    return row[1].groups[group]


def _budget_table(names: Sequence[str], budgets: Sequence[LossBudget]) -> Table[tuple[str, LossBudget]] | None:
    """Loss budget of several logs, a row for each, mean energies of their windows."""
    decimals = _decimals(budgets)
    columns: list[Column[tuple[str, LossBudget]]] = [
        Column("load", lambda row: row[0]),
        Column("line", lambda row: row[1].line, "J", decimals),
        *(Column(GROUPS[g].name, partial(_joules, g), "J", decimals) for g in _named(budgets)),
    ]
    caption = "Simulated loss budget: energy of the line in the window and where it goes, means over the cycles."
    return table("loss-budget", caption, columns, list(zip(names, budgets, strict=True)), brief=False)


def _one_budget_table(budget: LossBudget) -> Table[str]:
    """Loss budget of one log, a row for each part, in joules and in percent of the line's energy."""
    columns: list[Column[str]] = [
        Column("part", lambda g: GROUPS[g].name),
        Column("energy", lambda g: budget.groups[g], "J", _decimals([budget])),
        Column("share of the line", lambda g: 100.0 * budget.shares[g], "%", 2),
        Column("what it is", lambda g: GROUPS[g].about),
    ]
    below = [("from the line", budget.line, 100.0 * sum(budget.shares.values()), "")]
    caption = "Simulated loss budget in the window, means over the cycles."
    return Table("loss-budget", caption, columns, _named([budget]), below, brief=False)
