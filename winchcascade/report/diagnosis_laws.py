"""What was found of each cause: its numbers beside what is plausible and known, and the shape of a law (Fig. 18e)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.diagnosis.causes import covariance_of
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.report.diagnosis_data import stator_current
from winchcascade.report.diagnosis_names import quantity_words, told
from winchcascade.report.model_figures import legend_above
from winchcascade.report.style import COLOURS, WIDTH
from winchcascade.rig.parts import ROLLOFF_KNOTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.causes import Cause, Reported
    from winchcascade.diagnosis.diagnose import Diagnosis

ROLLOFF = "ke_rolloff"
DRAWS = 400
"""Draws of a law's fields for its band."""

_RELATIVE: dict[str, tuple[str, str]] = {
    "ke_shift": ("generator", "k_e"),
    "copper_heating": ("generator", "r_s"),
    "sync_inductance": ("generator", "l_s"),
    "rotor_inertia": ("drivetrain", "inertia_rotor"),
    "precharge": ("restoring", "p_precharge"),
    "piston_area": ("restoring", "area_piston"),
}
_ABSOLUTE: dict[str, tuple[str, str]] = {
    "diode_drop": ("generator", "v_diode"),
    "gear_mesh_loss": ("drivetrain", "eta_mesh"),
    "rotor_viscous": ("drivetrain", "b_rotor"),
    "drum_inertia": ("winch", "inertia"),
    "gas_volume": ("restoring", "volume_gas"),
    "screw_friction": ("restoring", "mu_screw"),
}
_LAW: dict[str, tuple[str, str]] = {
    "line_friction": ("winch", "friction"),
    "seal_friction": ("restoring", "seal_friction"),
    "rotor_friction": ("drivetrain", "friction"),
    "clutch_drag": ("drivetrain", "clutch_drag"),
}
_SENSOR: dict[str, tuple[str, str]] = {
    "torque_gain": ("gain", "torque"),
    "force_gain": ("gain", "force"),
    "voltage_gain": ("gain", "vdc"),
    "current_gain": ("gain", "idc"),
    "force_zero": ("zero", "force"),
    "load_drift": ("load", ""),
}
"""Effects that change what is known to a tolerance: a number of the rig file (relative or absolute), a law of the model
that the file does not state, a sensor, a load."""


class Row(NamedTuple):
    """One number of a cause: absent value, plausible range, and the tolerance about the absent value, in reported units."""

    cause: Cause
    name: str
    found: Reported
    absent: float
    low: float
    high: float
    tolerance: float


def tolerance_of(found: Diagnosis, effect: str) -> float:
    """Standard uncertainty of the number that an effect changes, in the unit in which the effect is reported; 0 for none."""
    rig = found.rig
    sd: float
    if effect in _RELATIVE | _ABSOLUTE | _LAW:
        section, name = (_RELATIVE | _ABSOLUTE | _LAW)[effect]
        sd = next((n.sd for n in found.data.nuisances if (n.section, n.name) == (section, name)), 0.0)
        if effect not in _RELATIVE:
            return sd
        value: float = getattr(getattr(rig, section), name).value
        return sd / abs(value + (ATMOSPHERE if effect == "precharge" else 0.0))
    kind, name = _SENSOR.get(effect, ("", ""))
    return max((n.sd for n in found.data.nuisances if n.kind == kind and (not name or n.name == name)), default=0.0)


def rows_of(found: Diagnosis) -> list[Row]:
    """Every number of the named causes, in their order."""
    rows = []
    for cause in found.causes:
        kind = found.suspects[cause.effect]
        free = freedom(kind)
        absent, low, high = (with_values(kind, x).reported() for x in (free.absent, free.low, free.high))
        for name, value in cause.parameters.items():
            ends = (low[name], high[name], absent[name])
            rows.append(
                Row(
                    cause,
                    name,
                    value,
                    absent[name],
                    min(ends),
                    max(ends),
                    tolerance_of(found, cause.effect) if len(cause.parameters) == 1 else 0.0,
                )
            )
    return rows


def numbers_figure(found: Diagnosis) -> Figure | None:
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
        how = told(row.cause.effect, row.name, row.found.unit)
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
    factor = told(row.cause.effect, row.name, row.found.unit).factor
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


def profile_of(found: Diagnosis, seed: int = 0) -> Profile | None:
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
    lines = np.array([_left(found, x, current) for x in drawn])
    return Profile(
        current, _left(found, best.values[k], current), np.quantile(lines, 0.025, axis=0),
        np.quantile(lines, 0.975, axis=0), reached,
    )  # fmt: skip


def _left(found: Diagnosis, values: Signal, current: Signal) -> Signal:
    """Share that is left, a monotone cubic between the knots. [1]"""
    from scipy.interpolate import PchipInterpolator

    at_knots: tuple[float, ...] = getattr(with_values(found.suspects[ROLLOFF], values), "left_at_knots")  # noqa: B009
    left: Signal = PchipInterpolator(ROLLOFF_KNOTS, (1.0, *at_knots))(current)
    return left


def profile_figure(found: Diagnosis) -> Figure | None:
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
