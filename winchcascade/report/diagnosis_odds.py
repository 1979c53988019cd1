"""How likely each effect and each set of effects is, and how small an effect would have been seen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.report.diagnosis_names import display_of, probability_words
from winchcascade.report.digits import MINUS, number
from winchcascade.report.style import COLOURS, WIDTH, label_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.selection import Linear

FEW = 2
"""The best set is told by its names if it has no more."""

SETS, OTHERS = 7, 5
"""So many sets, and so many effects beside the causes, are drawn at most."""

HOPELESS = -12.0
"""Odds below this power of ten are drawn as this."""

_SHORT = 42
"""A label is no longer than this. [characters]"""


def effect_odds(found: ModelDiagnosis) -> list[tuple[str, float]]:
    """Probability of each cause, then of its rivals, then of the likeliest others."""
    shown = {cause.effect: cause.probability for cause in found.causes}
    for cause in found.causes:
        for rival in cause.rivals:
            shown.setdefault(rival.effect, rival.probability)
    others = {
        name: sum(p for names, p in found.sets.items() if name in names)
        for name in found.suspects
        if name not in shown and any(name in names for names in found.sets)
    }
    return [*shown.items(), *sorted(others.items(), key=lambda item: -item[1])[:OTHERS]]


def set_odds(found: ModelDiagnosis) -> list[tuple[str, float]]:
    """The likeliest sets by how they differ from the best, with the power of ten of their odds relative to it."""
    ranked = sorted(found.sets.items(), key=lambda item: -item[1])[:SETS]
    if not ranked:
        return []
    first, top = ranked[0]
    return [(difference_words(names, first), max(math.log10(max(p, 1e-300) / top), HOPELESS)) for names, p in ranked]


def difference_words(names: tuple[str, ...], best: tuple[str, ...]) -> str:
    """How a set differs from the best one; the best by its own names.

    >>> difference_words(("b",), ("a", "b")), difference_words(("b", "c"), ("a", "b")), difference_words((), ())
    ('without a', 'c for a', 'no cause')
    >>> difference_words(("a", "b"), ("a", "b", "c", "d", "e")), difference_words((), ("a", "b", "c"))
    ('only a + b', 'no effect')
    """
    if names == best:
        return (
            " + ".join(names) if 0 < len(names) <= FEW else f"the best, {len(names)} effects" if names else "no cause"
        )
    gone, new = [n for n in best if n not in names], [n for n in names if n not in best]
    if len(gone) > FEW and len(names) <= FEW:
        return f"only {' + '.join(names)}" if names else "no effect"
    lost = " + ".join(gone) if len(gone) <= FEW else f"{len(gone)} of them"
    if gone and new:
        return f"{' + '.join(new)} for {lost}"
    return f"with {' + '.join(new)}" if new else f"without {lost}"


def odds_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the probability of effects and the odds of sets of effects."""
    effects, sets = effect_odds(found) if found.causes else [], set_odds(found)
    if len(sets) < 2:
        return None
    height = 0.75 + 0.2 * max(len(effects), len(sets))
    figure = Figure((WIDTH, height))
    if effects:
        ax = figure.add_axes((0.15, 0.42 / height, 0.2, 1 - 0.72 / height))
        _effect_bars(ax, found, effects)
        label_panel(ax, "a", "Effects")
    left = 0.715 if effects else 0.4
    ax = figure.add_axes((left, 0.42 / height, 0.985 - left, 1 - 0.72 / height))
    _set_bars(ax, sets)
    if effects:
        label_panel(ax, "b", "Sets of causes")
    return figure


def _effect_bars(ax: Axes, found: ModelDiagnosis, effects: list[tuple[str, float]]) -> None:
    named = {cause.effect for cause in found.causes}
    for k, (name, p) in enumerate(effects):
        ax.barh(k, p, height=0.62, color=COLOURS["gen" if name in named else "loss"], lw=0)
        ax.text(p + 0.03, k, probability_words(p), va="center", fontsize=6.8)
    ax.set_yticks(range(len(effects)), [name for name, _ in effects], fontsize=7.0)
    ax.set_ylim(max(len(effects), 1) - 0.4, -0.6)
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel("Probability (1)")
    ax.grid(False, axis="y")


def _set_bars(ax: Axes, sets: list[tuple[str, float]]) -> None:
    for k, (_, power) in enumerate(sets):
        ax.barh(
            k,
            power - HOPELESS + 0.15,
            left=HOPELESS - 0.15,
            height=0.62,
            color=COLOURS["gen" if k == 0 else "loss"],
            lw=0,
        )
    ax.set_yticks(range(len(sets)), [_shortened(text) for text, _ in sets], fontsize=7.0)
    ax.set_ylim(len(sets) - 0.4, -0.6)
    ax.set_xlim(HOPELESS - 0.15, 0.2)
    ax.xaxis.set_major_locator(FixedLocator([-12, -8, -4, 0]))
    ax.set_xticklabels([f"≤ 10$^{{{MINUS}12}}$", f"10$^{{{MINUS}8}}$", f"10$^{{{MINUS}4}}$", "1"])
    ax.set_xlabel("Odds relative to the best set (1)")
    ax.grid(False, axis="y")


def _shortened(text: str) -> str:
    return text if len(text) <= _SHORT else f"{text[: _SHORT - 1].rstrip(' +')} …"


# ------------------------------------------------------------------------------------------------------- what is unseen
class Threshold(NamedTuple):
    """The smallest value of a reported number that would have been named in these logs; None where no plausible one would."""

    effect: str
    name: str
    unit: str
    absent: float
    value: float | None


def thresholds(found: ModelDiagnosis) -> list[Threshold]:
    """How large each effect, acting alone, would have to be to be named in these logs.

    By the rule that chose the causes: logs as the expansion about the fit foresees them with so much of the effect, without
    their noise, and more evidence for it than for nothing.
    """
    rows = []
    for name, effect in found.suspects.items():
        share = _least_share(found.found.linear, name, found.found.scale)
        seen = None if share is None else _reported(found, name, share)
        rows.append(Threshold(name, effect.parameter, effect.unit, _reported(found, name, 0.0), seen))
    return rows


def threshold_words(one: Threshold) -> str:
    """The value from which an effect would have been named, with its unit."""
    how = display_of(one.effect, one.name, one.unit)
    if one.value is None:
        return "no plausible value"
    size = abs(one.value - one.absent) * how.factor
    text = number(one.value * how.factor, 1 - math.floor(math.log10(max(size, 1e-12))))
    return f"{'+' if how.signed and one.value > 0.0 else ''}{text} {how.unit}".rstrip()


def _reported(found: ModelDiagnosis, name: str, share: float) -> float:
    free = freedom(found.suspects[name])
    end = _far_end(free.absent, free.low, free.high)
    return with_values(found.suspects[name], free.absent + share * (end - free.absent)).reported


def _far_end(absent: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The bound of each field that is farther from its absent value, (k,)."""
    return np.where(high - absent >= absent - low, high, low)


def _least_share(linear: Linear, name: str, scale: float) -> float | None:
    """Share of the way from absent to the far bound at which an effect gains evidence over nothing, by halving."""
    if not _gains(linear, name, scale, 1.0):
        return None
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _gains(linear, name, scale, middle) else (middle, high)
    return high


def _gains(linear: Linear, name: str, scale: float, share: float) -> bool:
    place = linear.place[name]
    step = np.zeros_like(linear.absent)
    step[place] = share * (_far_end(linear.absent, linear.low, linear.high)[place] - linear.absent[place])
    planted = msgspec.structs.replace(linear, value=linear.absent, slope=linear.curve @ step)
    return planted.evidence((name,), scale) > planted.evidence((), scale)
