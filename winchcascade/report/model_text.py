"""Captions and tables of a log against its simulation: what is logged, what simulated, and with what."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.report.digits import number
from winchcascade.report.model_budget import ALWAYS, GROUPS, NOTHING
from winchcascade.report.model_curves import COMPARED
from winchcascade.report.report_model import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.report.model_account import Account, Regression, Sweep
    from winchcascade.report.model_budget import Budget

_SYMBOL = {"torque": "τ", "vdc": "Vdc", "idc": "Idc", "pressure": "p", "force": "F"}
_CALLED = {
    "torque": "τ: torque behind the clutch",
    "vdc": "Vdc, Idc: voltage and current of the DC link",
    "pressure": "p: gas pressure, gauge",
    "force": "F: line force",
}
_DECIMALS = {"torque": 2, "vdc": 2, "idc": 3, "pressure": 3, "force": 1}
_FINE = 2000.0
"""With less energy of the line than this a budget is told to a tenth of a joule. [J]"""

_WORDS = {
    "pressure_kgcm2": "gas pressure over displacement (haul-ins dashed)",
    "force_n": "line force over line velocity (haul-ins left of zero)",
    "power_gen_w": "power at the DC link over generator speed",
    "torque_nm": "torque behind the clutch over generator speed",
    "vdc_v": "voltage of the DC link over generator speed",
    "idc_a": "current of the DC link over generator speed",
    "resistance_ohm": "apparent resistance Vdc / Idc over generator speed",
    "loss_w": "electrical-side loss P_mech − P_gen over generator speed (Eq. 11 of Hsu et al. 2026)",
    "eta_gen": "efficiency of the electrical stage over generator speed, mean P_gen over mean P_mech of each bin (Eq. 6)",
}
"""What each panel shows, by the name of its curve."""

OPEN_CIRCUIT = (
    "In open circuit only the bleed carries a current: torque, Idc and what follows from them mean nothing there and are left "
    "out."
)


def heading(word: str) -> str:
    """Heading of the section; a log that was not measured is not called so."""
    return "Measured and simulated" if word == "measured" else "Log and simulation"


def as_what(word: str) -> str:
    """How the lines of logs are told in a caption."""
    return "measured" if word == "measured" else "as logged"


def shown_words(names: Sequence[str]) -> str:
    """What the panels of a figure show, in their order.

    >>> shown_words(["vdc_v", "torque_nm"])
    'Voltage of the DC link (a), torque behind the clutch (b) over generator speed.'
    """
    over = " over generator speed"
    words = [_WORDS[name] for name in names]
    if all(w.endswith(over) for w in words):
        words = [w.removesuffix(over) for w in words]
    else:
        over = ""
    if len(names) > 1:
        words = [f"{w} ({letter})" for letter, w in zip("abcdefgh", words, strict=False)]
    text = ", ".join(words) + over
    return f"{text[0].upper()}{text[1:]}."


def simulated_with(accounts: Sequence[Account]) -> str:
    """With which rig the simulations were made, and what was added to it."""
    rigs = ", ".join(dict.fromkeys(account.rig for account in accounts))
    changed = ", ".join(dict.fromkeys(account.changed for account in accounts if account.changed))
    return f"rig {rigs} along the logged line motion, {f'with {changed}' if changed else 'as in its rig file'}"


def aim(word: str) -> str:
    """What the section is for."""
    logged = "measured" if word == "measured" else "logged"
    return (
        f"The {logged} motion of the line drives a model of the rig with the numbers of its rig file. Where markers leave the "
        "lines, rig and model differ: by how much stands in the table of differences, and a diagnosis looks for the cause."
    )


def part_note(account: Account) -> str:
    """Which cycles are compared where it is not all; an empty text where it is."""
    if account.cycles == account.total:
        return ""
    return f"Of the {account.total} complete cycles the first {account.cycles} are simulated and compared."


def one_log(account: Account) -> str:
    """What dots, lines and markers of a figure of one log are."""
    dots = "measured samples" if account.word == "measured" else "samples of the log"
    return (
        f"Dots: {dots}; solid lines: their means; markers: means of the simulation over the same "
        f"samples ({simulated_with([account])})."
    )


def all_logs(accounts: Sequence[Account]) -> str:
    """What lines and markers of a figure of several logs are; all of them are called alike."""
    return (
        f"Solid lines: {as_what(accounts[0].word)}; markers: simulated ({simulated_with(accounts)}); both are means in bins "
        "over the same samples."
    )


def speed_words(account: Account, width: float | None = None) -> str:
    """What the generator's speed is, and in which bins means are taken."""
    gear = "" if account.gear is None else f" times {account.gear:g}"
    bins = "" if width is None else f"; bins of {width:g} rpm"
    return f"Generator speed: that of the drum{gear}, from each onset to the start of braking{bins}."


def sweep_caption(account: Account, sweep: Sweep) -> str:
    """What the sweep of the damper shows."""
    factors = ", ".join(f"{factor:g}" for factor in sweep.factors[:-1])
    return (
        f"Line force in open circuit over generator speed, means in bins. Thick line: {as_what(account.word)}; markers: "
        f"simulated ({simulated_with([account])}) with the viscous damper of the fast shaft at {factors} and "
        f"{sweep.factors[-1]:g} times the {sweep.nominal:.3g} N·m·s/rad of the rig file."
    )


def regression_caption(account: Account, fit: Regression) -> str:
    """What was fitted to the open circuit, with its interval."""
    return (
        f"Open circuit above 1000 rpm: voltage of the DC link, {as_what(account.word)}, and the back-EMF that it asks for. The "
        f"line through zero has a slope of {fit.slope:.5f} V/rpm, 95 %: {fit.low:.5f} to {fit.high:.5f}, R² = {fit.r2:.4f}, "
        f"from {fit.points} samples; the rig {account.rig} has {fit.reference:.4f} V/rpm."
    )


def budget_caption(accounts: Sequence[Account]) -> str:
    """What the stacked bars and the points on them are."""
    caption = (
        f"Simulated loss budget ({simulated_with(accounts)}): where the energy of the simulated line goes within the "
        "integration window, as a mean over the cycles; beside each bar that energy. The stroke across a bar "
        "is what reaches the torque sensor"
    )
    logged = {stage for a in accounts if a.budget is not None for stage in a.budget.log}
    reached = " and ".join(what for stage, what in (("mech", "shaft"), ("gen", "DC link")) if stage in logged)
    if reached:
        word = "measured" if accounts[0].word == "measured" else "logged"
        caption += f"; points below it: shares of the {word} energy of the line that reach {reached}"
    caption += ". Inertia is that of rotor and drum"
    if any(a.open_circuit for a in accounts):
        caption += "; in open circuit the DC link feeds its bleed alone"
    return caption + "."


# ---------------------------------------------------------------------------------------------------------- the tables
def differences_table(
    accounts: Sequence[Account], firsts: Sequence[tuple[str, ...]], head: tuple[str, ...]
) -> Table | None:
    """Log minus simulation over the payouts, a row for each log; None where no channel can be compared.

    Parameters
    ----------
    firsts : first cells of each row, under the names of `head`, before the number of cycles
    """
    names = [name for name in COMPARED if any(name in account.differences for account in accounts)]
    if not names:
        return None
    word = "Measured" if accounts[0].word == "measured" else "Log"
    note = "".join(f"{_CALLED[name]}. " for name in names if name in _CALLED)
    note += "A bias below zero: the simulation lies above the log."
    if any(account.open_circuit for account in accounts):
        note += " In open circuit torque and Idc are not compared."
    if any(account.cycles < account.total for account in accounts):
        note += " Of a long log the first complete cycles are compared."
    return Table(
        id="differences",
        caption=f"{word} − simulated over the payouts: mean (bias) and root mean square (rms).",
        head=(*head, "Cycles", *(f"{_SYMBOL[name]} {what}" for name in names for what in ("bias", "rms"))),
        units=(*("" for _ in head), "", *(COMPARED[name][0] for name in names for _ in range(2))),
        rows=tuple((*first, f"{a.cycles}", *_differences(a, names)) for first, a in zip(firsts, accounts, strict=True)),
        text_columns=tuple(range(len(head))),
        note=note,
    )


def _differences(account: Account, names: Sequence[str]) -> list[str]:
    cells = []
    for name in names:
        found = account.differences.get(name)
        values = (None, None) if found is None else (found.bias, found.rms)
        cells += [number(value, _DECIMALS[name]) for value in values]
    return cells


def _named(budgets: Sequence[Budget]) -> list[str]:
    """Groups that a table names, from the line to the DC link: the usual ones, and others in which there is something."""
    return [g for g in reversed(GROUPS) if g in ALWAYS or any(abs(b.shares[g]) >= NOTHING for b in budgets)]


_PARTS = {
    "stored": "stored gas: held by the accumulator when the window ends",
    "screw": "screw: friction of the ball screw",
    "line": "line losses: between line and torque sensor",
    "inertia": "inertia: rotor and drum still turning",
    "capacitor": "capacitor: charge of the DC link",
    "shaft": "shaft: its spring and damping",
    "mesh": "mesh: gear teeth",
    "damper": "damper: viscous drag of the fast shaft",
    "copper": "copper: resistance of the stator",
    "diodes": "diodes: drop of the bridge",
    "dc": "DC link: delivered",
}
"""What the parts of a budget are."""


def _parts_note(groups: Sequence[str]) -> str:
    told = "; ".join(_PARTS[g] for g in groups if g in _PARTS)
    return f"{told[:1].upper()}{told[1:]}."


def budget_table(names: Sequence[str], budgets: Sequence[Budget]) -> Table:
    """Loss budget of several logs, a row for each, mean energies of their windows."""
    groups = _named(budgets)

    def row(name: str, b: Budget) -> tuple[str, ...]:
        decimals = 1 if b.line < _FINE else 0
        return (name, number(b.line, decimals), *(number(b.groups[g], decimals) for g in groups))

    return Table(
        id="loss-budget",
        caption="Simulated loss budget: energy of the line in the window and where it goes, means over the cycles.",
        head=("Load", "total", *(GROUPS[g].name for g in groups)),
        units=("", *("J" for _ in range(1 + len(groups)))),
        rows=tuple(row(name, b) for name, b in zip(names, budgets, strict=True)),
        note=_parts_note(groups),
    )


def one_budget_table(budget: Budget) -> Table:
    """Loss budget of one log, a row for each part, in joules and in percent of the line's energy."""
    groups = _named([budget])
    decimals = 1 if budget.line < _FINE else 0
    rows = [(GROUPS[g].name, number(budget.groups[g], decimals), number(100 * budget.shares[g], 2)) for g in groups]
    return Table(
        id="loss-budget",
        caption="Simulated loss budget, from the line to the DC link: energies in the window, means over the cycles.",
        head=("Part", "Energy", "Share of the line's"),
        units=("", "J", "%"),
        rows=(*rows, ("from the line", number(budget.line, decimals), number(100 * sum(budget.shares.values()), 2))),
        summary=1,
        note=_parts_note(groups),
    )
