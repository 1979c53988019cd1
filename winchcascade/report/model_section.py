"""The section of a log against its simulation, in the report of one log and in that of a campaign."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.quantity import KGF
from winchcascade.report import model_figures as figures
from winchcascade.report import model_text as text
from winchcascade.report.model_account import Account, account_of
from winchcascade.report.model_bars import budget_bars
from winchcascade.report.model_curves import speed_columns, speed_width
from winchcascade.report.model_data import Comparison, compare_with_baseline
from winchcascade.report.model_open import back_emf_figure, damper_sweep
from winchcascade.report.report_model import Note, Picture, Section
from winchcascade.report.style import cut_apart, svg_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from winchcascade.reduction.reduction_result import Reduction
    from winchcascade.report.report_model import Block

TETHER = ("pressure_kgcm2", "force_n", "power_gen_w")
GENERATOR = ("torque_nm", "vdc_v", "idc_a", "resistance_ohm")
LOSSES = ("loss_w", "eta_gen")

CLOUD = 500
"""Samples of a log that are drawn in each panel at most; of more, an even selection."""

MOST_REASONS = 3
"""Logs of a campaign whose reason for not being simulated is told."""


class Modelled(NamedTuple):
    """A comparison with what is kept of it; without one the account says why."""

    comparison: Comparison | None
    account: Account


def modelled(reduction: Reduction) -> Modelled:
    """Compare a log with the model that its rig file gives."""
    found = compare_with_baseline(reduction)
    if isinstance(found, Comparison):
        return Modelled(found, account_of(found))
    return Modelled(None, Account(why=found.why, word=reduction.run.origin.word))


# ---------------------------------------------------------------------------------------------------------- of one log
def run_section(found: Modelled) -> Section:
    """Lay one log beside its simulation; where there is none, say why. To be called in the house style."""
    account, comparison = found.account, found.comparison
    if comparison is None:
        return Section("model", text.heading(account.word), (Note(f"Left out: {account.why}"),))
    part = text.part_note(account)
    blocks: list[Block | None] = [Note(f"{text.aim(account.word)} {part}".rstrip())]
    blocks += _run_pictures(comparison, account)
    blocks.append(text.differences_table([account], [()], ()))
    blocks += _open_circuit(account)
    if account.budget is not None:
        bars = budget_bars([_load(comparison)], [account.budget], word=account.word)
        blocks.append(_picture(bars, "model-budget", text.budget_caption([account])))
        blocks.append(text.one_budget_table(account.budget))
    return Section("model", text.heading(account.word), tuple(b for b in blocks if b is not None))


def _run_pictures(comparison: Comparison, account: Account) -> list[Block | None]:
    """Figs 13, 14, 16 and 17 of one log."""
    drawn = [figures.Drawn("", account.curves)]
    dots = clouds(comparison)
    means = text.one_log(account)
    speed = text.speed_words(account, speed_width(comparison))

    def made(names: Sequence[str], name: str, more: str = "") -> Picture | None:
        figure = figures.panels(drawn, names, word=account.word, rated=account.rated, columns=2, clouds=dots)
        caption = text.shown_words(figures.given_names(drawn, names)) if figure is not None else ""
        return _picture(figure, name, f"{caption} {means}{more}")

    if account.open_circuit:
        return [made((*TETHER, "vdc_v"), "model-tether", f" {speed} {text.OPEN_CIRCUIT}")]
    return [
        made(TETHER, "model-tether", f" {speed}"),
        made(GENERATOR, "model-generator"),
        made(LOSSES, "model-losses"),
    ]


def clouds(comparison: Comparison) -> figures.Clouds:
    """Samples of the log that stand behind its curves, in the units of the curves; an even selection of many."""
    run = comparison.run.channels
    found: figures.Clouds = {}
    moving = np.flatnonzero(comparison.payout | comparison.haul_in)
    coupled = np.flatnonzero(comparison.driven | comparison.haul_in)
    if "pressure" in run and "displacement" in run:
        rows = _even(moving)
        found["pressure_kgcm2"] = (run["displacement"][rows], run["pressure"][rows] / (KGF * 1e4))
    if "force" in run:
        rows = _even(coupled)
        found["force_n"] = (run["velocity"][rows], run["force"][rows])
    rows = _even(np.flatnonzero(comparison.driven))
    counted = np.zeros(comparison.run.t.size, dtype=bool)
    counted[rows] = True
    for name, y in speed_columns(run, comparison.rig.r_drum, counted).items():
        found[name] = (comparison.rpm[counted], y)
    return found


def _even(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """An even selection of rows, `CLOUD` at most."""
    return rows[:: max(1, -(-rows.size // CLOUD))]


def _load(comparison: Comparison) -> str:
    load = comparison.run.load
    return "open circuit" if load is None or np.isinf(load) else f"{load:g} Ω"


def _open_circuit(account: Account) -> list[Block | None]:
    """The damper's sweep and the back-EMF's regression, where the log is an open circuit."""
    blocks: list[Block | None] = []
    if account.sweep is not None:
        figure = damper_sweep(account.sweep, word=account.word, rated=account.rated)
        blocks.append(_picture(figure, "model-damper", text.sweep_caption(account, account.sweep)))
    if account.regression is not None:
        figure = back_emf_figure(account.regression, word=account.word)
        blocks.append(_picture(figure, "model-emf", text.regression_caption(account, account.regression)))
    return blocks


def _picture(figure: Figure | None, name: str, caption: str) -> Picture | None:
    if figure is None:
        return None
    alt = {
        "model-budget": "Stacked bars of the simulated loss budget; the energies are in the table.",
        "model-damper": "Curves of the line force over generator speed, one for each damper.",
        "model-emf": "Dots of voltages over generator speed with a line through zero; its slope is in the caption.",
    }.get(name, "Lines of the log and markers of the simulation; the mean differences are in the table.")
    return Picture(name, caption, alt, svg_text(figure, name))


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
    given = [
        log._replace(account=msgspec.structs.replace(log.account, word=word)) for log in logs if not log.account.why
    ]
    left_out = [log for log in logs if log.account.why]
    blocks: list[Block | None] = [Note(_reasons(left_out, alone=not given))] if left_out else []
    if given:
        blocks.append(Note(text.aim(word)))
        blocks += _campaign_pictures(given)
        blocks += _campaign_tables(given)
    return Section("model", text.heading(word), tuple(b for b in blocks if b is not None)) if blocks else None


def _reasons(left_out: Sequence[Named], *, alone: bool) -> str:
    whys = list(dict.fromkeys(log.account.why for log in left_out))
    if alone and len(whys) == 1:
        return f"Left out: {whys[0]}"
    told = [f"{log.name}: {log.account.why.rstrip('.')}" for log in left_out[:MOST_REASONS]]
    more = f"; and {len(left_out) - MOST_REASONS} more" if len(left_out) > MOST_REASONS else ""
    return f"Not simulated: {'; '.join(told)}{more}."


def _campaign_pictures(given: Sequence[Named]) -> list[Block | None]:
    accounts = [log.account for log in given]
    drawn = figures.by_load([log.load for log in given], [a.curves for a in accounts])
    rated = next((a.rated for a in accounts if a.rated is not None), None)
    gear = next((a.gear for a in accounts if a.gear is not None), None)
    means = text.all_logs(accounts)
    opened = next((a for a in accounts if a.open_circuit), None)

    def made(names: Sequence[str], name: str, more: str = "", above: float | None = None) -> Picture | None:
        figure = figures.panels(drawn, names, word=accounts[0].word, rated=rated, columns=2, gear=above)
        caption = text.shown_words(figures.given_names(drawn, names)) if figure is not None else ""
        return _picture(figure, name, f"{caption} {means}{more}")

    left_out = f" {text.OPEN_CIRCUIT}" if opened is not None else ""
    blocks: list[Block | None] = [
        made(TETHER, "model-tether", f" {text.speed_words(accounts[0])}"),
        made(GENERATOR[:1], "model-torque", left_out, gear),
        made(GENERATOR[1:], "model-generator"),
        made(LOSSES, "model-losses"),
    ]
    return blocks + (_open_circuit(opened) if opened is not None else [])


def _campaign_tables(given: Sequence[Named]) -> list[Block | None]:
    accounts = [log.account for log in given]
    booked = [
        (name, log.account.budget)
        for name, log in zip(row_names(given), given, strict=True)
        if log.account.budget is not None
    ]
    blocks: list[Block | None] = [
        text.differences_table(accounts, [(log.name, log.load) for log in given], ("Log", "Load"))
    ]
    if booked:
        names, budgets = zip(*booked, strict=True)
        bars = budget_bars(["\n".join(name) for name in names], budgets, word=accounts[0].word)
        blocks.append(_picture(bars, "model-budget", text.budget_caption(accounts)))
        blocks.append(text.budget_table([", ".join(name) for name in names], budgets))
    return blocks
