"""Figures of a scored trial: what each effect was taken for, and how far the parameters are from the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from winchcascade.blind.score import NO_GAP, NOTHING, UNEXPLAINED, hidden_name, taken_as
from winchcascade.report.digits import MINUS
from winchcascade.report.model_figures import legend_above
from winchcascade.report.style import COLOURS, WIDTH
from winchcascade.report.trial_words import hidden_order

if TYPE_CHECKING:
    from winchcascade.blind.score import CaseScore, Score

SEVERAL = "several"
"""Column of the cases that were taken for more than one effect."""


def taken_figure(score: Score) -> Figure | None:
    """Draw a matrix of counts: what was hidden over what it was taken for; pairs are left to the table."""
    cases = score.of_kind("single", "none", "outsider")
    if not cases:
        return None
    rows, columns = _rows(score, cases), _columns(score, cases)
    counts, wrong = np.zeros((2, len(rows), len(columns)), dtype=int)
    for case in cases:
        place = rows.index(hidden_name(case)), columns.index(_column(case))
        counts[place] += 1
        wrong[place] += not case.went_well
    height = 1.5 + 0.145 * len(rows)
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.2, right=0.985, top=1 - 1.35 / height, bottom=0.1 / height)
    for i, j in zip(*np.nonzero(counts), strict=True):
        colour = COLOURS["mech" if wrong[i, j] else "gen"]
        ax.scatter(j, i, s=52, marker="s", color=colour, alpha=0.35, linewidths=0)
        if wrong[i, j]:
            ax.scatter(j, i, s=52, marker="s", facecolors="none", edgecolors=colour, linewidths=1.0)
        ax.text(j, i, str(counts[i, j]), ha="center", va="center", fontsize=6.5, color=COLOURS["ink"])
    ax.set_xticks(range(len(columns)), columns, rotation=90, fontsize=6.5)
    ax.set_yticks(range(len(rows)), rows, fontsize=6.5)
    ax.xaxis.tick_top()
    ax.set_xlim(-0.6, len(columns) - 0.4)
    ax.set_ylim(len(rows) - 0.4, -0.6)
    return figure


def _rows(score: Score, cases: tuple[CaseScore, ...]) -> list[str]:
    hidden = {hidden_name(case) for case in cases}
    return [name for name in hidden_order(score) if name in hidden]


def _columns(score: Score, cases: tuple[CaseScore, ...]) -> list[str]:
    """Columns in the order of the rows, so that what is named stands on the diagonal."""
    taken = {_column(case) for case in cases}
    rows = [NO_GAP if name == NOTHING else name for name in _rows(score, cases)]
    named = [name for name in rows if name in taken]
    last = [name for name in (SEVERAL, UNEXPLAINED) if name in taken]
    return [*named, *sorted(taken - set(named) - set(last)), *last]


def _column(case: CaseScore) -> str:
    taken = taken_as(case)
    return SEVERAL if " + " in taken else taken


def coverage_figure(score: Score) -> Figure | None:
    """Draw each diagnosed parameter with its interval, less the truth, over the size of the true change."""
    found = []
    for case in score.cases:
        for p in case.parameters:
            if p.value is None or p.low is None or p.high is None:
                continue
            absent = 1.0 if p.parameter in ("n", "k_e_ratio_at_10_a") else 0.0
            size = abs(p.truth - absent)
            found.append((p.effect, p.covered, [(v - p.truth) / size for v in (p.value, p.low, p.high)]))
    if not found:
        return None
    found.sort(key=lambda row: row[0])
    figure = Figure((WIDTH, 2.6))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.09, right=0.985, top=0.91, bottom=0.36)
    for k, (_, covered, (value, low, high)) in enumerate(found):
        colour = COLOURS["gen" if covered else "mech"]
        ax.plot([k, k], [low, high], color=colour, linewidth=1.1)
        ax.plot([k], [value], marker="o" if covered else "x", markersize=2.6, color=colour)
    ax.axhline(0.0, color=COLOURS["soft"], linewidth=0.6)
    kinds = (("gen", "o", "interval holds the truth"), ("mech", "x", "does not"))
    legend_above(
        figure, [(Line2D([], [], color=COLOURS[c], lw=1.1, marker=m, markersize=3.5), text) for c, m, text in kinds]
    )
    names = [row[0] for row in found]
    firsts = [k for k, name in enumerate(names) if k == 0 or names[k - 1] != name]
    ax.set_xticks(firsts, [names[k] for k in firsts], rotation=90, fontsize=6.0)
    ax.set_ylabel(f"(found {MINUS} true) / size (1)")
    return figure
