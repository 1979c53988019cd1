"""What was found of each cause: its numbers beside what is plausible and known, and the shape of a law (Fig. 18e)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.diagnosis.causes import covariance_of
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.report.diagnosis_data import stator_current
from winchcascade.report.diagnosis_names import display_of, quantity_words
from winchcascade.report.model_figures import legend_above
from winchcascade.report.style import COLOURS, WIDTH
from winchcascade.rig.effects.effect import Change
from winchcascade.rig.effects.generator import share_of_k_e
from winchcascade.rig.parts import ROLLOFF_KNOTS, number_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import NamedCause, Reported
    from winchcascade.rig.effects.effect import Effect

ROLLOFF = "ke_rolloff"
DRAWS = 400
"""Draws of a law's fields for its band."""


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
    known = [n.sd for n in found.data.nuisances if n.path == (law.known_as or law.path)]
    nominal = number_of(found.data.nominal, law.path) if law.operation == "scale" else 1.0
    return max(known, default=0.0) / abs(nominal)


def rows_of(found: ModelDiagnosis) -> list[Row]:
    """Every number of the named causes, in their order."""
    rows = []
    for cause in found.causes:
        effect = found.suspects[cause.effect]
        free = freedom(effect)
        absent, low, high = (with_values(effect, x).reported for x in (free.absent, free.low, free.high))
        ends, tolerance = (low, high, absent), tolerance_of(found, effect)
        rows += [Row(cause, name, x, absent, min(ends), max(ends), tolerance) for name, x in cause.parameters.items()]
    return rows


def numbers_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw each number of the causes with its interval, beside its absent value, the tolerance there, and what is plausible."""
    rows = rows_of(found)
    if not rows:
        return None
    each = 0.52
    height = 0.3 + each * len(rows)
    figure = Figure((WIDTH, height))
    for k, row in enumerate(rows):
        top = height - 0.3 - k * each
        ax = figure.add_axes((0.42, (top - 0.3) / height, 0.4, 0.24 / height))
        _number(ax, row)
        how = display_of(row.cause.effect, row.name, row.found.unit)
        value, interval = quantity_words(row.cause.effect, row.name, row.found)
        middle = (top - 0.18) / height
        figure.text(0.01, middle + 0.075 / height, row.cause.effect, va="center", fontsize=8.0, fontweight="bold")
        what = f"{how.what}, {how.unit}" if how.unit else how.what
        figure.text(0.01, middle - 0.075 / height, what, va="center", fontsize=6.8, color=COLOURS["soft"])
        figure.text(0.84, middle + 0.075 / height, value, va="center", fontsize=8.0, fontweight="bold")
        figure.text(
            0.84,
            middle - 0.075 / height,
            interval.removesuffix(how.unit).rstrip(),
            va="center",
            fontsize=6.8,
            color=COLOURS["soft"],
        )
    legend_above(figure, _number_legend())
    return figure


def _number(ax: Axes, row: Row) -> None:
    factor = display_of(row.cause.effect, row.name, row.found.unit).factor
    low, high, absent = (x * factor for x in (row.low, row.high, row.absent))
    ax.axvspan(low, high, color=COLOURS["hold"], lw=0, zorder=0.1)
    if row.tolerance:
        ax.axvspan(
            absent - 1.96 * row.tolerance * factor, absent + 1.96 * row.tolerance * factor, color=COLOURS["line"],
            alpha=0.3, lw=0, zorder=0.2,
        )  # fmt: skip
    ax.axvline(absent, color=COLOURS["ink"], lw=1.0, ls="--", zorder=0.3)
    value, left, right = (x * factor for x in (row.found.value, row.found.low, row.found.high))
    ax.plot([left, right], [0, 0], color=COLOURS["gen"], lw=2.4, solid_capstyle="butt")
    ax.plot([value], [0], "s", ms=4.5, color=COLOURS["gen"])
    pad = 0.03 * max(high - low, 1e-12)
    ax.set_xlim(min(low, left) - pad, max(high, right) + pad)
    ax.set_ylim(-1, 1)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.grid(False)
    ax.tick_params(labelsize=6.5)


def _number_legend() -> list[tuple[Any, str]]:
    return [
        (Line2D([], [], marker="s", ms=4.5, color=COLOURS["gen"], lw=2.4), "found, 95 %"),
        (Line2D([], [], color=COLOURS["ink"], lw=1.0, ls="--"), "rig as given"),
        (Rectangle((0, 0), 1, 1, fc=COLOURS["line"], alpha=0.3, lw=0), "its tolerance, 95 %"),
        (Rectangle((0, 0), 1, 1, fc=COLOURS["hold"], ec=COLOURS["grid"], lw=0.4), "plausible"),
    ]


# ------------------------------------------------------------------------------------------------------------- Fig 18e
class Profile(NamedTuple):
    """Share of the back-EMF constant that is left over the stator current [A rms], (n,) each: found and its 95 % band."""

    current: Signal
    left: Signal
    low: Signal
    high: Signal
    reached: float


def profile_of(found: ModelDiagnosis, seed: int = 0) -> Profile | None:
    """The roll-off with its band, as far as the data reach; None where it is no cause."""
    best = found.found.best
    if ROLLOFF not in best.names or all(cause.effect != ROLLOFF for cause in found.causes):
        return None
    ends = np.cumsum([0, *(x.size for x in best.values)])
    k = best.names.index(ROLLOFF)
    place = slice(int(ends[k]), int(ends[k + 1]))
    covariance = covariance_of(found.data, best, found.found.scale)[place, place]
    root = np.linalg.eigh(covariance)
    spread = root.eigenvectors * np.sqrt(np.maximum(root.eigenvalues, 0.0))
    drawn = best.values[k] + np.random.default_rng(seed).standard_normal((DRAWS, best.values[k].size)) @ spread.T
    drawn = np.clip(drawn, best.low[place], best.high[place])
    stator, _ = stator_current(found)
    reached = float(np.max(stator, initial=ROLLOFF_KNOTS[1]))
    current = np.linspace(0.0, reached, 120)
    lines = np.array([share_of_k_e(tuple(x.tolist()), current) for x in drawn])
    return Profile(
        current, share_of_k_e(tuple(best.values[k].tolist()), current), np.quantile(lines, 0.025, axis=0),
        np.quantile(lines, 0.975, axis=0), reached,
    )  # fmt: skip


def profile_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the roll-off of the back-EMF constant over the stator current with its band (Fig. 18e)."""
    profile = profile_of(found)
    if profile is None:
        return None
    height = 2.7
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.09, right=0.985, top=1 - 0.28 / height, bottom=0.42 / height)
    ax.fill_between(profile.current, profile.low, profile.high, color=COLOURS["gen"], alpha=0.3, lw=0)
    ax.plot(profile.current, profile.left, color=COLOURS["gen"], lw=1.4)
    knots = np.array([x for x in ROLLOFF_KNOTS if x <= profile.reached])
    ax.plot(knots, np.interp(knots, profile.current, profile.left), "s", ms=3.5, color=COLOURS["gen"])
    ax.axhline(1.0, color=COLOURS["ink"], lw=0.9, ls="--")
    legend: list[tuple[Any, str]] = [
        (Line2D([], [], marker="s", ms=3.5, color=COLOURS["gen"], lw=1.4), "found, with knots"),
        (Rectangle((0, 0), 1, 1, fc=COLOURS["gen"], alpha=0.3, lw=0), "95 % band"),
        (Line2D([], [], color=COLOURS["ink"], lw=0.9, ls="--"), "rig as given"),
    ]
    rated = found.rig.generator.i_rated
    if rated is not None:
        ax.axvline(rated.value, color=COLOURS["soft"], lw=0.9, ls=":")
        legend.append((Line2D([], [], color=COLOURS["soft"], lw=0.9, ls=":"), f"rated, {rated.value:g} A"))
    ax.set_xlim(0.0, profile.reached * 1.01)
    ax.set_xlabel("Stator current (A rms)")
    ax.set_ylabel(r"$k_\mathrm{e}$ over its nominal value (1)")
    legend_above(figure, legend)
    return figure
