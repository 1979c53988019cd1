"""Numbers, jointly and run by run, laws (Fig. 18e) and odds of the causes, and how small an effect would have been named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from winchcascade.core.run import Signal
from winchcascade.diagnosis.causes import covariance_of
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause, Reported
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.diagnosis.thresholds import Threshold
from winchcascade.report.cause_words import runs_with_number, shown_as
from winchcascade.report.diagnosis_figures import stator_current
from winchcascade.report.digits import MINUS, number, upper
from winchcascade.report.gap_words import display_of, number_words, probability_words
from winchcascade.report.style import (
    COLOURS,
    Margins,
    broken,
    is_narrow,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
    wide_figure,
)
from winchcascade.report.svg_drawing import text_size
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.effect import Change, Display, Effect
from winchcascade.rig.effects.generator import share_of_k_e
from winchcascade.rig.parts import ROLLOFF_KNOTS, number_of, path_in_rig

ROLLOFF = "ke_rolloff"
DRAWS = 400
"""Draws of the fields of a law for its band."""

ROW = 0.52
"""Height of the row of a number. [in]"""


class Row(NamedTuple):
    """One number of a cause: absent value, plausible range, and the tolerance about the absent value, in reported units."""

    cause: NamedCause
    name: str
    found: Reported
    absent: float
    low: float
    high: float
    tolerance: float


def tolerance_of(found: ModelDiagnosis, effect: Effect) -> float:
    """Standard uncertainty of the number that an effect changes, in the unit in which the effect is reported; 0 for none."""
    law = effect.law
    if not isinstance(law, Change):
        return 0.0
    known = max((n.sd for n in found.data.nuisances if n.path == path_in_rig(law.path)), default=0.0)
    share = known / abs(number_of(found.data.nominal, law.path)) if law.operation == "scale" else known
    absent, moved = (with_values(effect, freedom(effect).absent + by).reported for by in (0.0, 1.0))
    return share * abs(moved - absent)


def cause_rows(found: ModelDiagnosis) -> list[Row]:
    """Every number of the named causes, in their order."""
    rows = []
    for cause in found.causes:
        effect = found.suspects[cause.effect]
        ends = [
            with_values(effect, x).reported for x in (freedom(effect).absent, freedom(effect).low, freedom(effect).high)
        ]
        known = (ends[0], min(ends), max(ends), tolerance_of(found, effect))
        rows += [Row(cause, name, value, *known) for name, value in cause.parameters.items()]
    return rows


_LINE = 22
"""Characters in a line below the name of a number in a narrow figure."""


def numbers_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw each number of the causes with its interval, beside its absent value, the tolerance there, and what is plausible."""
    rows = cause_rows(found)
    if not rows:
        return None
    narrow = is_narrow()
    pitch, (at, beside, over) = ROW + 0.12 * narrow, (0.38, 0.68, 0.27) if narrow else (0.42, 0.84, 0.4)
    height = 0.3 + pitch * len(rows) + 0.15 * narrow
    figure = wide_figure(height)
    texts = [_number_texts(row) for row in rows]
    if not narrow:  # the longest interval ends at the edge of the figure
        longest = max(text_size(interval, _BELOW).width for _, _, interval in texts) / 72.0 / figure.get_figwidth()
        beside = min(beside, 0.99 - longest)
        over = beside - at - 0.02
    for k, (row, (how, value, interval)) in enumerate(zip(rows, texts, strict=True)):
        middle, apart = (height - 0.48 - 0.15 * narrow - k * pitch) / height, 0.075 / height
        _number(figure.add_axes((at, middle - 0.12 / height, over, 0.24 / height)), row, how.factor)
        under = "top" if narrow else "center"
        for x, above, below in (
            (0.01, found.suspects[row.cause.effect].label, f"{how.what}, {how.unit}".removesuffix(", ")),
            (beside, value, interval),
        ):
            figure.text(x, middle + apart, above, va="center", fontsize=8.0, fontweight="bold")
            lines = broken(below, _LINE) if narrow else below
            figure.text(x, middle - (0.0 if narrow else apart), lines, va=under, fontsize=_BELOW, color=COLOURS["soft"])
    legend_above(
        figure,
        [
            line_entry("found, 95 %", "gen", marker="s", ms=4.5, lw=2.4),
            line_entry("rig file", lw=1.0, ls="--"),
            patch_entry("its tolerance, 95 %", "line", alpha=0.3, lw=0),
            patch_entry("plausible", "hold", ec=COLOURS["grid"]),
        ],
    )
    return figure


_BELOW = 6.8
"""Size of the interval and of what a number is, in the figure of the numbers. [pt]"""


def _number_texts(row: Row) -> tuple[Display, str, str]:
    """How a number of a cause is shown: its value with the unit, and its interval without."""
    how = display_of(row.cause.effect, row.name, row.found.unit)
    value, interval = number_words(how, row.found)
    return how, value, interval.removesuffix(how.unit).rstrip()


def _number(ax: Axes, row: Row, factor: float) -> None:
    low, high, absent, half = (x * factor for x in (row.low, row.high, row.absent, 1.96 * row.tolerance))
    ax.axvspan(low, high, color=COLOURS["hold"], lw=0, zorder=0.1)
    if half:
        ax.axvspan(absent - half, absent + half, color=COLOURS["line"], alpha=0.3, lw=0, zorder=0.2)
    ax.axvline(absent, color=COLOURS["ink"], lw=1.0, ls="--", zorder=0.3)
    value, left, right = (x * factor for x in (row.found.value, row.found.low, row.found.high))
    ax.plot([left, right], [0, 0], color=COLOURS["gen"], lw=2.4, solid_capstyle="butt")
    ax.plot([value], [0], "s", ms=4.5, color=COLOURS["gen"])
    pad = 0.03 * max(high - low, 1e-12)
    ax.set(xlim=(min(low, left) - pad, max(high, right) + pad), ylim=(-1, 1), yticks=[])
    ax.spines["left"].set_visible(False)
    ax.grid(False)
    ax.tick_params(labelsize=6.5)


# ------------------------------------------------------------------------------------------------------------- Fig 18e
class Profile(NamedTuple):
    """Share of the back-EMF constant that remains over the stator current [A rms], (n,) each: found and its 95 % band."""

    current: Signal
    left: Signal
    low: Signal
    high: Signal


def profile_of(found: ModelDiagnosis) -> Profile | None:
    """The roll-off with its band, as far as the data reach; None where it is no cause."""
    best = found.found.best
    if ROLLOFF not in best.names or all(cause.effect != ROLLOFF for cause in found.causes):
        return None
    place = best.place[ROLLOFF]
    fitted = best.x[place]
    root = np.linalg.eigh(covariance_of(found.data, best, found.found.scale)[place, place])
    spread = root.eigenvectors * np.sqrt(np.maximum(root.eigenvalues, 0.0))
    drawn = fitted + np.random.default_rng(0).standard_normal((DRAWS, fitted.size)) @ spread.T
    reached = float(np.max(stator_current(found)[0], initial=ROLLOFF_KNOTS[1]))
    current = np.linspace(0.0, reached, 120)
    fields = [fitted, *np.clip(drawn, best.bounds.low[place], best.bounds.high[place])]
    line, *lines = (share_of_k_e(tuple(x.tolist()), current) for x in fields)
    low, high = np.quantile(list(lines), (0.025, 0.975), axis=0)
    return Profile(current, line, low, high)


def profile_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the roll-off of the back-EMF constant over the stator current with its band (Fig. 18e)."""
    profile = profile_of(found)
    if profile is None:
        return None
    figure, (ax,) = panel_figure(2.7, margins=Margins(head=0.28))
    ax.fill_between(profile.current, profile.low, profile.high, color=COLOURS["gen"], alpha=0.3, lw=0)
    ax.plot(profile.current, profile.left, color=COLOURS["gen"], lw=1.4)
    knots = np.array([x for x in ROLLOFF_KNOTS if x <= profile.current[-1]])
    ax.plot(knots, np.interp(knots, profile.current, profile.left), "s", ms=3.5, color=COLOURS["gen"])
    ax.axhline(1.0, color=COLOURS["ink"], lw=0.9, ls="--")
    entries = [
        line_entry("found, with knots", "gen", marker="s", ms=3.5, lw=1.4),
        patch_entry("95 % band", "gen", alpha=0.3, lw=0),
        line_entry("rig file", lw=0.9, ls="--"),
    ]
    rated = found.rig.generator.i_rated
    if rated is not None:
        ax.axvline(rated.value, color=COLOURS["soft"], lw=0.9, ls=":")
        entries.append(line_entry(f"rated, {rated.value:g} A", "soft", lw=0.9, ls=":"))
    ax.set(
        xlim=(0.0, profile.current[-1] * 1.01), xlabel="Stator current (A rms)",
        ylabel=r"$k_\mathrm{e}$ over its nominal value (1)",
    )  # fmt: skip
    legend_above(figure, entries)
    return figure


# ------------------------------------------------------------------------------------------------------------- the odds
FEW = 2
"""The best set is shown by its names if it has no more."""

SETS, OTHERS = 7, 5
"""Sets, and effects beside the causes, that are drawn at most."""

HOPELESS = -12.0
"""Odds below this power of ten are drawn as this."""

LONGEST_LABEL, LABEL_LINE = 56, 30
"""A label, and a line of it, is no longer than this. [characters]"""


def effect_odds(found: ModelDiagnosis) -> list[tuple[str, float]]:
    """Probability of each cause, then of its alternatives, then of the likeliest others."""
    shown = {cause.effect: cause.probability for cause in found.causes}
    for rival in (rival for cause in found.causes for rival in cause.look_alikes):
        shown.setdefault(rival.effect, rival.probability)
    others = {
        name: sum(p for names, p in found.sets.items() if name in names)
        for name in found.suspects
        if name not in shown and any(name in names for names in found.sets)
    }
    return [*shown.items(), *sorted(others.items(), key=lambda item: -item[1])[:OTHERS]]


def set_odds(found: ModelDiagnosis) -> list[tuple[str, float]]:
    """The likeliest sets by how they differ from the best, in plain names, with the power of ten of their relative odds."""
    likely = sorted(found.sets.items(), key=lambda item: -item[1])[:SETS]
    ranked = [(tuple(found.suspects[name].label for name in names), p) for names, p in likely]
    return [
        (difference_words(names, ranked[0][0]), max(math.log10(max(p, 1e-300) / ranked[0][1]), HOPELESS))
        for names, p in ranked
    ]


def difference_words(names: tuple[str, ...], best: tuple[str, ...]) -> str:
    """How a set differs from the best one; the best by its own names.

    >>> difference_words(("b",), ("a", "b")), difference_words(("b", "c"), ("a", "b")), difference_words((), ())
    ('without a', 'c for a', 'no cause')
    >>> difference_words(("a", "b"), ("a", "b", "c", "d", "e")), difference_words((), ("a", "b", "c"))
    ('only a + b', 'no effect')
    """
    all_names = " + ".join(names)
    if names == best:
        return all_names or "no cause" if len(names) <= FEW else f"the best, {len(names)} effects"
    gone, new = [n for n in best if n not in names], " + ".join(n for n in names if n not in best)
    if len(gone) > FEW and len(names) <= FEW:
        return f"only {all_names}" if names else "no effect"
    lost = " + ".join(gone) if len(gone) <= FEW else f"{len(gone)} of them"
    return f"{new} for {lost}" if gone and new else f"with {new}" if new else f"without {lost}"


def odds_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the probability of effects and the odds of sets of effects."""
    effects, sets = effect_odds(found) if found.causes else [], set_odds(found)
    if len(sets) < 2:
        return None
    height = 0.75 + 0.26 * max(len(effects), len(sets))
    named = {cause.effect for cause in found.causes}
    figure, panels = _odds_panels(height, with_effects=bool(effects))
    if effects:
        names, p = zip(*effects, strict=True)
        ax = panels[0]
        _bars(ax, [found.suspects[name].label for name in names], p, [name in named for name in names])
        for k, each in enumerate(p):
            ax.text(each + 0.03, k, probability_words(each), va="center", fontsize=6.8)
        ax.set(xlim=(0.0, 1.0), xlabel="Probability (1)")
        label_panel(ax, "a", "Effects")
    ax = panels[-1]
    texts = [
        upper(t) if len(t) <= LONGEST_LABEL else f"{upper(t)[: LONGEST_LABEL - 1].rstrip(' +')} …" for t, _ in sets
    ]
    _bars(
        ax,
        [broken(text, LABEL_LINE) for text in texts],
        [power - HOPELESS + 0.15 for _, power in sets],
        [not k for k in range(len(sets))],
        HOPELESS - 0.15,
    )
    ax.xaxis.set_major_locator(FixedLocator([-12, -8, -4, 0]))
    ax.set(
        xlim=(HOPELESS - 0.15, 0.2), xlabel="Odds relative to the best set (1)",
        xticklabels=[f"≤ 10$^{{{MINUS}12}}$", f"10$^{{{MINUS}8}}$", f"10$^{{{MINUS}4}}$", "1"],
    )  # fmt: skip
    if effects:
        label_panel(ax, "b", "Sets of causes")
    return figure


def _odds_panels(height: float, *, with_effects: bool) -> tuple[Figure, list[Axes]]:
    """A figure of some height [in] with a panel for the effects, if there are any, and one for their sets."""
    if is_narrow():
        return panel_figure(height, 1, 1 + with_effects)
    figure, bottom, top = wide_figure(height), 0.42 / height, 1 - 0.72 / height
    left = 0.72 if with_effects else 0.4
    places = [(0.215, 0.17)] * with_effects + [(left, 0.985 - left)]
    return figure, [figure.add_axes((x, bottom, across, top)) for x, across in places]


def _bars(ax: Axes, names: Sequence[str], widths: Sequence[float], named: Sequence[bool], left: float = 0.0) -> None:
    """Draw a bar for each name, from the top, green for the causes."""
    ax.barh(
        range(len(names)),
        widths,
        left=left,
        height=0.62,
        color=[COLOURS["gen" if own else "loss"] for own in named],
        lw=0,
    )
    ax.set(yticks=range(len(names)), ylim=(len(names) - 0.4, -0.6))
    ax.set_yticklabels(names, fontsize=7.0)
    ax.grid(False, axis="y")


# ------------------------------------------------------------------------------------------------------- what is unseen
def threshold_words(one: Threshold, how: Display) -> str:
    """The value from which an effect would have been named, with its unit."""
    if one.value is None:
        return "no plausible value"
    size = abs(one.value - one.absent) * how.factor
    text = number(one.value * how.factor, 1 - math.floor(math.log10(max(size, 1e-12))))
    return f"{'+' if how.signed and one.value > 0.0 else ''}{text} {how.unit}".rstrip()


BESIDE = 2
"""Panels in a row."""

PANEL, AROUND, BETWEEN = 1.12, 0.85, 0.62
"""Height of a panel, margins above and below all of them, and space between two rows. [in]"""

NAMED_RUNS = 8
"""Maximum number of runs of which each is named by its load."""

WIDE = 4.0
"""An interval that is longer than the median one by more than this factor leaves its panel."""

MARKED = {"order": "changes from run to run", "load": "changes with the load", "scatter": "differs between runs"}
"""What the title of a panel states of a number that is not steady."""


def stability_figure(found: DiagnosisResult) -> Figure | None:
    """Draw the number of each cause from every run alone, one panel per cause, with the joint number and its interval."""
    causes = [cause for cause in found.causes if runs_with_number(cause)]
    if not causes:
        return None
    rows = -(-len(causes) // BESIDE)
    height = AROUND + PANEL * rows + BETWEEN * (rows - 1)
    margins, gaps = Margins(left=0.075, head=0.52, foot=0.33), {"wspace": 0.2, "hspace": BETWEEN / PANEL}
    figure, panels = panel_figure(height, rows, BESIDE, margins=margins, gaps=gaps)
    for ax, cause in zip(panels, causes, strict=False):
        _run_by_run(ax, found, cause)
    for ax in panels[len(causes) :]:
        ax.set_axis_off()
    legend_above(
        figure,
        [
            line_entry("one run alone, 95 %", "ink", marker="o", ms=3.5, lw=1.1),
            line_entry("joint fit", "gen", lw=1.2),
            patch_entry("its interval, 95 %", "gen", alpha=0.25, lw=0),
        ],
    )
    return figure


def _run_by_run(ax: Axes, found: DiagnosisResult, cause: NamedCause) -> None:
    """Draw the numbers of one cause over the runs."""
    how, joint, stability = shown_as(found, cause), next(iter(cause.parameters.values())), cause.stability
    if stability is None:
        return
    table = np.array([(one.value, one.low, one.high) for one in stability.runs]) * how.factor
    at, (value, low, high) = np.arange(1, len(table) + 1), table.T
    ax.axhspan(joint.low * how.factor, joint.high * how.factor, color=COLOURS["gen"], alpha=0.25, lw=0)
    ax.axhline(joint.value * how.factor, color=COLOURS["gen"], lw=1.2)
    ax.vlines(at, low, high, color=COLOURS["ink"], lw=1.1)
    ax.plot(at, value, ls="none", marker="o", ms=3.5, color=COLOURS["ink"])
    usual = high - low <= WIDE * np.nanmedian(high - low)
    ends = np.array([*low[usual], *high[usual], joint.low * how.factor, joint.high * how.factor])
    pad = 0.08 * float(np.ptp(ends))
    ax.set(xlim=(0.5, len(table) + 0.5), ylim=(ends.min() - pad, ends.max() + pad))
    if len(table) <= NAMED_RUNS:
        texts = [load_words(run.load).replace("open circuit", "open") for run in found.runs]
        ax.set_xticks(at, texts, fontsize=6.5)
    else:
        ax.set_xlabel("Run, in the order of the campaign")
    marks = ", ".join(MARKED[trend.along] for trend in stability.trends)
    ax.set_title(
        f"{found.suspects[cause.effect].label}{f': {marks}' if marks else ''}\n{how.what} ({how.unit or 1})",
        loc="left", pad=3, fontsize=7.2, color=COLOURS["mech" if marks else "ink"],
    )  # fmt: skip
    ax.grid(False, axis="x")
