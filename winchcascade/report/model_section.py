"""The section of a log against its simulation, in the report of one log and in that of a campaign."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from msgspec.structs import astuple, replace

from winchcascade.core.rig_file import Rig
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report import model_figures as figures
from winchcascade.report import sheet as content
from winchcascade.report.digits import number, upper
from winchcascade.report.model_account import (
    ALWAYS,
    COMPARED,
    GROUPS,
    NOTHING,
    SHOWN,
    Account,
    ChannelDifference,
    LossBudget,
    ModelComparison,
    abscissas,
    account_of,
    compare_with_baseline,
    quantities,
    speed_width,
)
from winchcascade.report.sheet import TableColumn
from winchcascade.report.style import cut_apart
from winchcascade.report.wording import load_words

TETHER = ("pressure_kgcm2", "force_n", "power_gen_w")
GENERATOR = ("torque_nm", "vdc_v", "idc_a", "resistance_ohm")
LOSSES = ("loss_w", "eta_gen")

CLOUD = 500
"""Samples of a log that are drawn in each panel at most; of more, an even selection."""

MAX_REASONS = 3
"""Logs of a campaign whose reason for not being simulated is named."""


class Modelled(NamedTuple):
    """A comparison with what is kept of it; without one the account gives the reason."""

    comparison: ModelComparison | None
    account: Account


def modelled(reduction: Reduction) -> Modelled:
    """Compare a log with the model that its rig file gives."""
    found = compare_with_baseline(reduction)
    if isinstance(found, ModelComparison):
        return Modelled(found, account_of(found))
    return Modelled(None, Account(why=found.why, word=reduction.run.origin.word))


# ---------------------------------------------------------------------------------------------------------- of one log
def run_section(found: Modelled) -> content.Section:
    """Lay one log beside its simulation; where there is none, give the reason. Called within the style of the figures."""
    account, comparison = found.account, found.comparison
    words = _words(account.word)
    if comparison is None:
        return content.section("model", words.heading, content.Note(f"Left out: {account.why}"))
    first = f" Of the {account.total} complete cycles the first {account.cycles} are simulated and compared."
    return content.section(
        "model",
        words.heading,
        content.Note(f"{_aim(account.word)}{_stated(comparison.rig)}{first if account.cycles < account.total else ''}"),
        *_run_pictures(comparison, account),
        _differences_table([account], [()], ()),
        *_open_circuit(account),
        None
        if account.budget is None
        else _budget_picture([load_words(comparison.run.load)], [account.budget], [account]),
        None if account.budget is None else _one_budget_table(account.budget),
    )


def _run_pictures(comparison: ModelComparison, account: Account) -> list[content.Picture | None]:
    """Figs 13, 14, 16 and 17 of one log."""
    means = (
        f"Dots: {_words(account.word).samples}; solid lines: their means; markers: means of the simulation over the same "
        f"samples ({_simulated_with([account])})."
    )
    speed = _speed_words(account, f"; bins of {speed_width(comparison):g} rpm")
    shown = [
        (TETHER, "model-tether", f"{means} {speed}"),
        (GENERATOR, "model-generator", means),
        (LOSSES, "model-losses", f"{means} {_STORED}"),
    ]
    if account.open_circuit:
        shown = [((*TETHER, "vdc_v"), "model-tether", f"{means} {speed} {_OPEN_CIRCUIT}")]
    drawn, dots = [figures.Drawn("", account.curves)], clouds(comparison)
    return [
        _panels(
            name, words, drawn, names, figures.panels(drawn, names, word=account.word, rated=account.rated, clouds=dots)
        )
        for names, name, words in shown
    ]


def _panels(
    name: str, words: str, drawn: Sequence[figures.Drawn], names: Sequence[str], figure: Figure | None
) -> content.Picture | None:
    """Picture of some panels, whose caption begins with what they show."""
    given = figures.given_names(drawn, names)
    return _picture(figure, name, f"{shown_words(given)} {words}") if given else None


def clouds(comparison: ModelComparison) -> figures.Clouds:
    """Samples of the log that stand behind its curves, in the units of the curves; an even selection of many."""
    log, found = quantities(comparison, comparison.run), {}
    for name, (x, own, *_) in abscissas(comparison).items():
        if name in log:
            rows = np.flatnonzero(own | comparison.haul_in if name == "pressure_kgcm2" else own)
            rows = rows[:: max(1, -(-rows.size // CLOUD))]
            found[name] = (x[rows], log[name][rows])
    return found


def _open_circuit(account: Account) -> list[content.Block | None]:
    """The damper's sweep and the back-EMF's regression, where the log is an open circuit."""
    blocks: list[content.Block | None] = []
    sweep, fit, word = account.sweep, account.regression, account.word
    if sweep is not None:
        factors = f"{', '.join(f'{factor:g}' for factor in sweep.factors[:-1])} and {sweep.factors[-1]:g}"
        caption = (
            f"Line tension in open circuit over generator speed, means in bins. Thick line: {_words(word).lines}; markers: "
            f"simulated ({_simulated_with([account])}) with the viscous damper of the fast shaft at {factors} times the "
            f"{sweep.nominal:.3g} N·m·s/rad of the rig file."
        )
        blocks.append(_picture(figures.damper_sweep(sweep, word=word, rated=account.rated), "model-damper", caption))
    if fit is not None:
        caption = (
            f"Open circuit above 1000 rpm: voltage of the DC link, {_words(word).lines}, and the back-EMF that it requires. "
            f"The line through zero has a slope of {fit.slope:.5f} V/rpm, 95 %: {fit.low:.5f} to {fit.high:.5f}, "
            f"R² = {fit.r2:.4f}, from {fit.points} samples; the rig {account.rig} has {fit.reference:.4f} V/rpm."
        )
        blocks.append(_picture(figures.back_emf_figure(fit, word=word), "model-emf", caption))
    return blocks


_ALTS = {
    "model-budget": "Stacked bars of the simulated loss budget; the energies are in the table.",
    "model-damper": "Curves of the line tension over generator speed, one for each damper.",
    "model-emf": "Dots of voltages over generator speed with a line through zero; its slope is in the caption.",
}


def _picture(figure: Figure | None, name: str, caption: str) -> content.Picture | None:
    return content.picture(
        figure, name, caption,
        _ALTS.get(name, "Lines of the log and markers of the simulation; the mean differences are in the table."),
    )  # fmt: skip


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


def campaign_section(logs: Sequence[Named], word: str) -> content.Section | None:
    """Lay the logs of a campaign beside their simulations, all loads in a figure; None where nothing was tried.

    Parameters
    ----------
    logs : in the order of their loads
    word : what the logs are called
    """
    given = [log._replace(account=replace(log.account, word=word)) for log in logs if not log.account.why]
    left_out = [log for log in logs if log.account.why]
    blocks: list[content.Block | None] = [
        *([content.Note(_reasons(left_out, alone=not given))] if left_out else []),
        *([content.Note(_aim(word)), *_campaign_pictures(given), *_campaign_tables(given)] if given else []),
    ]
    return content.section("model", _words(word).heading, *blocks) if blocks else None


def _reasons(left_out: Sequence[Named], *, alone: bool) -> str:
    whys = {log.account.why for log in left_out}
    if alone and len(whys) == 1:
        return f"Left out: {whys.pop()}"
    named = "; ".join(f"{log.name}: {log.account.why.rstrip('.')}" for log in left_out[:MAX_REASONS])
    more = f"; and {len(left_out) - MAX_REASONS} more" if len(left_out) > MAX_REASONS else ""
    return f"Not simulated: {named}{more}."


def _campaign_pictures(given: Sequence[Named]) -> list[content.Block | None]:
    accounts = [log.account for log in given]
    drawn, word = figures.styled_by_load([log.load for log in given], [a.curves for a in accounts]), accounts[0].word
    rated, gear = (
        next((x for x in values if x is not None), None)
        for values in ([a.rated for a in accounts], [a.gear for a in accounts])
    )
    opened = next((a for a in accounts if a.open_circuit), None)
    means = (
        f"Solid lines: {_words(word).lines}; markers: simulated ({_simulated_with(accounts)}); both are means in bins over the "
        "same samples."
    )
    shown = (
        (TETHER, "model-tether", f"{means} {_speed_words(accounts[0])}", None),
        (GENERATOR[:1], "model-torque", means if opened is None else f"{means} {_OPEN_CIRCUIT}", gear),
        (GENERATOR[1:], "model-generator", means, None),
        (LOSSES, "model-losses", f"{means} {_STORED}", None),
    )
    pictures = [
        _panels(name, words, drawn, names, figures.panels(drawn, names, word=word, rated=rated, gear=above))
        for names, name, words, above in shown
    ]
    return [*pictures, *([] if opened is None else _open_circuit(opened))]


def _campaign_tables(given: Sequence[Named]) -> list[content.Block | None]:
    accounts = [log.account for log in given]
    differences = _differences_table(accounts, [(log.name, log.load) for log in given], ("Log", "Load"))
    booked = {k: a.budget for k, a in enumerate(accounts) if a.budget is not None}
    if not booked:
        return [differences]
    names, budgets = row_names(given), list(booked.values())
    return [
        differences,
        _budget_picture(["\n".join(names[k]) for k in booked], budgets, accounts),
        _budget_table([", ".join(names[k]) for k in booked], budgets),
    ]


# -------------------------------------------------------------------------------------------------------- the captions
_SYMBOL = {"torque": "τ", "vdc": "Vdc", "idc": "Idc", "pressure": "p", "force": "F"}
_CALLED = {
    "torque": "τ: torque of the PTO shaft",
    "vdc": "Vdc, Idc: voltage and current of the DC link",
    "pressure": "p: gas pressure, gauge",
    "force": "F: line tension",
}
_DECIMALS = {"torque": 2, "vdc": 2, "idc": 3, "pressure": 3, "force": 1}
_UNKNOWN = ChannelDifference(math.nan, math.nan)
_FINE = 2000.0
"""With less energy of the line than this a budget has a decimal. [J]"""

_STORED = (
    "Stored energy: while the speed changes, J ω dω/dt goes into the rotor and τ dτ/dt / k into the shaft, which is taken off "
    "P_mech; C V dV/dt goes into the capacitor and is added to P_gen."
)

_OPEN_CIRCUIT = (
    "In open circuit only the bleed carries a current: torque, Idc and what follows from them mean nothing there and are left "
    "out."
)


class _Words(NamedTuple):
    """What measured logs, and others, are called: in the heading, by their motion, lines and samples, and in a table."""

    heading: str
    logged: str
    lines: str
    samples: str
    table: str


_MEASURED = _Words("Measured and simulated", "measured", "measured", "measured samples", "Measured")
_LOGGED = _Words("Log and simulation", "logged", "as logged", "samples of the log", "Log")


def _words(word: str) -> _Words:
    return _MEASURED if word == "measured" else _LOGGED


def shown_words(names: Sequence[str]) -> str:
    """What the panels of a figure show, in their order.

    >>> shown_words(["vdc_v", "torque_nm"])
    'Voltage of the DC link (a), torque of the PTO shaft (b) over generator speed.'
    """
    over = " over generator speed"
    words = [SHOWN[name].what for name in names]
    shared = over if all(w.endswith(over) for w in words) else ""
    letters = [f" ({letter})" if len(names) > 1 else "" for letter in "abcdefgh"[: len(names)]]
    text = ", ".join(f"{w.removesuffix(shared)}{letter}" for w, letter in zip(words, letters, strict=True))
    return f"{upper(text + shared)}."


def _simulated_with(accounts: Sequence[Account]) -> str:
    """With which rig the simulations were made, and what was added to it."""
    rigs = ", ".join(dict.fromkeys(account.rig for account in accounts))
    changed = ", ".join(dict.fromkeys(account.changed for account in accounts if account.changed))
    return f"rig {rigs} along the logged line motion, {f'with {changed}' if changed else 'as in its rig file'}"


def _stated(rig: Rig) -> str:
    """Sentence on the effects that a rig file states, empty for none."""
    return f" The rig file states effects, which the model includes: {', '.join(rig.effects)}." if rig.effects else ""


def _aim(word: str) -> str:
    """What the section is for."""
    return (
        f"The {_words(word).logged} motion of the line drives a model of the rig with the numbers of its rig file. "
        "Where markers leave the lines, rig and model differ: by how much stands in the table of differences, and a diagnosis "
        "looks for the cause."
    )


def _speed_words(account: Account, bins: str = "") -> str:
    """What the generator's speed is; `bins` states in which bins means are taken."""
    gear = "" if account.gear is None else f" times {account.gear:g}"
    return f"Generator speed: that of the drum{gear}, from each onset to the start of braking{bins}."


def _budget_picture(
    names: Sequence[str], budgets: Sequence[LossBudget], accounts: Sequence[Account]
) -> content.Picture | None:
    """Stacked bars of the loss budgets."""
    words = _words(accounts[0].word)
    reached = " and ".join(
        what
        for stage, what in (("mech", "shaft"), ("gen", "DC link"))
        if any(stage in budget.log for budget in budgets)
    )
    points = (
        f"; points below it: shares of the {words.logged} energy of the line that reach {reached}" if reached else ""
    )
    bleed = "; in open circuit the DC link feeds its bleed alone" if any(a.open_circuit for a in accounts) else ""
    return _picture(
        figures.budget_bars(names, budgets, word=accounts[0].word),
        "model-budget",
        f"Simulated loss budget ({_simulated_with(accounts)}): where the energy of the simulated line goes within the "
        "integration window, as a mean over the cycles; beside each bar that energy. The stroke across a bar is what reaches "
        f"the torque sensor{points}. Inertia is that of rotor and drum{bleed}.",
    )


# ---------------------------------------------------------------------------------------------------------- the tables
def _differences_table(
    accounts: Sequence[Account], firsts: Sequence[tuple[str, ...]], head: tuple[str, ...]
) -> content.Table | None:
    """Log minus simulation over the payouts, a row for each log; None where no channel can be compared.

    Parameters
    ----------
    firsts : first cells of each row, under the names of `head`, before the number of cycles
    """
    names = [name for name in COMPARED if any(name in account.differences for account in accounts)]
    if not names:
        return None
    notes = (
        *(f"{_CALLED[name]}." for name in names if name in _CALLED),
        "A bias below zero: the simulation lies above the log.",
        "In open circuit torque and Idc are not compared." if any(a.open_circuit for a in accounts) else "",
        "Of a long log the first complete cycles are compared." if any(a.cycles < a.total for a in accounts) else "",
    )
    return content.make_table(
        "differences",
        f"{_words(accounts[0].word).table} − simulated over the payouts: mean (bias) and root mean square (rms).",
        [
            *(TableColumn[object](name, text=True) for name in head),
            TableColumn("Cycles"),
            *(
                TableColumn(f"{_SYMBOL[name]} {what}", COMPARED[name][0], _DECIMALS[name])
                for name in names
                for what in ("bias", "rms")
            ),
        ],
        [
            (
                *first,
                f"{a.cycles}",
                *(x for name in names for x in astuple(a.differences.get(name, _UNKNOWN))),
            )
            for first, a in zip(firsts, accounts, strict=True)
        ],
        note=" ".join(filter(None, notes)),
    )


def _named(budgets: Sequence[LossBudget]) -> list[str]:
    """Groups that a table names, from the line to the DC link: the usual ones, and others in which there is something."""
    return [g for g in reversed(GROUPS) if g in ALWAYS or any(abs(b.shares[g]) >= NOTHING for b in budgets)]


def _parts_note(groups: Sequence[str]) -> str:
    text = "; ".join(f"{GROUPS[g].name}: {GROUPS[g].about}" for g in groups if GROUPS[g].about)
    return f"{upper(text)}."


def _joules(budget: LossBudget, groups: Sequence[str]) -> list[str]:
    """Energy of the line, and of each group."""
    return [number(x, 1 if budget.line < _FINE else 0) for x in (budget.line, *(budget.groups[g] for g in groups))]


def _budget_table(names: Sequence[str], budgets: Sequence[LossBudget]) -> content.Table:
    """Loss budget of several logs, a row for each, mean energies of their windows."""
    groups = _named(budgets)
    return content.make_table(
        "loss-budget",
        "Simulated loss budget: energy of the line in the window and where it goes, means over the cycles.",
        [
            TableColumn[object]("Load", text=True),
            *(TableColumn(name, "J") for name in ("total", *(GROUPS[g].name for g in groups))),
        ],
        [(name, *_joules(budget, groups)) for name, budget in zip(names, budgets, strict=True)],
        note=_parts_note(groups),
    )


def _one_budget_table(budget: LossBudget) -> content.Table:
    """Loss budget of one log, a row for each part, in joules and in percent of the line's energy."""
    groups = _named([budget])
    line, *joules = _joules(budget, groups)
    return content.make_table(
        "loss-budget",
        "Simulated loss budget, from the line to the DC link: energies in the window, means over the cycles.",
        [
            TableColumn[object]("Part", text=True),
            TableColumn("Energy", "J"),
            TableColumn("Share of the line's", "%", 2),
        ],
        [(GROUPS[g].name, joule, 100 * budget.shares[g]) for g, joule in zip(groups, joules, strict=True)],
        below=[("from the line", line, 100 * sum(budget.shares.values()))],
        note=_parts_note(groups),
    )
