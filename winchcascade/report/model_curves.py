"""Curves of means of a log and its simulation, and how far the two are apart."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.quantity import KGF
from winchcascade.reduction.energies import power

if TYPE_CHECKING:
    from collections.abc import Mapping

    from winchcascade.core.run import Signal
    from winchcascade.reduction.bins import Mask
    from winchcascade.report.model_data import Comparison

LEAST = 3
"""Bins of fewer samples are left out, or of fewer than there are cycles."""

FAINT = 0.02
"""Nor is anything divided by a mean below this share of the largest one: a ratio of two noises says nothing."""

MOST_BINS = 40
"""Bins of displacement and of velocity, about at most."""

MOST_SPEED_BINS = 200
"""Bins of generator speed: where those of the rig file are more, they are made wider."""

_KGCM2 = KGF * 1e4
_SPEED = "Generator speed (rpm)"


class Shown(NamedTuple):
    """How a quantity is shown: its title, its unit, the label of what it is drawn over, and a symbol for a bare axis."""

    title: str
    unit: str
    over: str = _SPEED
    symbol: str = ""


SHOWN = {
    "pressure_kgcm2": Shown("Gas pressure, gauge", "kg/cm²", "Line displacement (m)"),
    "force_n": Shown("Line force", "N", "Line velocity (m/s)"),
    "power_gen_w": Shown("Power at the DC link", "W"),
    "torque_nm": Shown("Torque behind the clutch", "N·m"),
    "vdc_v": Shown("Voltage of the DC link", "V"),
    "idc_a": Shown("Current of the DC link", "A"),
    "resistance_ohm": Shown("Apparent resistance", "Ω"),
    "loss_w": Shown("Electrical-side loss", "W"),
    "eta_gen": Shown("Electrical-stage efficiency", "1", symbol=r"$\eta_\mathrm{gen}$"),
}
"""Curves by their name in written files, in the order of the paper's Figs 13 to 17."""

HAUL_IN = "pressure_haul_in_kgcm2"
"""Curve of the pressure while the line is hauled in, drawn beside that of the payouts."""

_LOADED = ("power_gen_w", "torque_nm", "idc_a", "resistance_ohm", "loss_w", "eta_gen")
"""Curves that mean nothing in open circuit, where only the bleed carries a current."""

COMPARED = {
    "torque": ("N·m", 1.0),
    "vdc": ("V", 1.0),
    "idc": ("A", 1.0),
    "pressure": ("kg/cm²", 1.0 / _KGCM2),
    "force": ("N", 1.0),
}
"""Channels whose differences are told: unit, and what turns SI units into it."""


class Curve(msgspec.Struct, frozen=True):
    """Means of log and simulation over the same samples, bin by bin.

    `x` are the middles of the bins of generator speed, and means of displacement and velocity.
    """

    x: tuple[float, ...]
    log: tuple[float, ...]
    simulated: tuple[float, ...]


class Difference(msgspec.Struct, frozen=True):
    """Log minus simulation of one channel over the payouts: mean and root mean square, in the unit of `COMPARED`."""

    bias: float
    rms: float


# ------------------------------------------------------------------------------------------------------------ the bins
def means(x: Signal, width: float, *columns: Signal, least: int) -> tuple[Signal, ...]:
    """Average columns in bins of x, and give the middles of the bins before them; bins of few samples are left out.

    >>> import numpy as np
    >>> [c.tolist() for c in means(np.array([1.0, 2.0, 12.0]), 10.0, np.array([3.0, 5.0, 9.0]), least=2)]
    [[5.0], [4.0]]
    """
    if x.size == 0:
        return tuple(np.empty(0) for _ in range(1 + len(columns)))
    number = np.floor(x / width).astype(np.int64)
    low = int(number.min())
    count = np.bincount(number - low)
    full = np.flatnonzero(count >= max(least, 1))
    middles: Signal = (full + low).astype(np.float64) * width + 0.5 * width
    return (middles, *(np.bincount(number - low, weights=y)[full] / count[full] for y in columns))


def least_of(comparison: Comparison) -> int:
    """Samples that a bin must have: as many as there are cycles, `LEAST` at most."""
    return min(LEAST, len(comparison.cycles))


def speed_width(comparison: Comparison) -> float:
    """Width of the bins of generator speed: that of the rig file, unless it makes too many. [rpm]"""
    rpm = comparison.rpm[comparison.driven]
    return max(comparison.rig.thresholds.rpm_bin, round_width(float(np.ptp(rpm)) if rpm.size else 0.0, MOST_SPEED_BINS))


def round_width(extent: float, most: int = MOST_BINS) -> float:
    """Width of bins of which no more than so many cover an extent: 1, 2 or 5 times a power of ten.

    >>> round_width(10.0), round_width(2.2)
    (0.5, 0.1)
    """
    raw = max(extent, 1e-9) / most
    power_of_ten = 10.0 ** np.floor(np.log10(raw))
    return next(float(round(k * power_of_ten, 12)) for k in (1, 2, 5, 10) if k * power_of_ten >= raw * (1 - 1e-9))


def ratio(above: Signal, below: Signal) -> Signal:
    """One column of means over another, not a number where the lower is faint, (n,)."""
    strong = below > FAINT * np.max(below, initial=0.0)
    found: Signal = np.divide(above, below, out=np.full(below.size, np.nan), where=strong)
    return found


# ---------------------------------------------------------------------------------------------------------- the curves
def curves_of(comparison: Comparison) -> dict[str, Curve]:
    """Make the curves of Figs 13 to 17 that a log has the channels for; in open circuit those that mean something there."""
    found = _tether_curves(comparison) | _speed_curves(comparison)
    left_out = _LOADED if comparison.run.open_circuit else ()
    return {name: curve for name, curve in found.items() if curve.x and name not in left_out}


def _tether_curves(comparison: Comparison) -> dict[str, Curve]:
    """Pressure over displacement, out and back, and force over velocity (Fig. 13a, b)."""
    run, model = comparison.run.channels, comparison.simulation.run.channels
    least = least_of(comparison)
    found: dict[str, Curve] = {}
    if "pressure" in run and "displacement" in run:
        x = run["displacement"]
        width = round_width(float(np.ptp(x)))
        for name, rows in (("pressure_kgcm2", comparison.payout), (HAUL_IN, comparison.haul_in)):
            pair = (y["pressure"][rows] / _KGCM2 for y in (run, model))
            found[name] = _curve(*means(x[rows], width, x[rows], *pair, least=least)[1:])
    if "force" in run:
        rows = comparison.driven | comparison.haul_in
        v = run["velocity"]
        width = round_width(float(np.ptp(v)))
        found["force_n"] = _curve(
            *means(v[rows], width, v[rows], run["force"][rows], model["force"][rows], least=least)[1:]
        )
    return found


def _speed_curves(comparison: Comparison) -> dict[str, Curve]:
    """What is drawn over generator speed while the clutch is engaged (Figs 13c and 14 to 17)."""
    if comparison.rig.rpm_per_velocity is None:
        return {}
    rows = comparison.driven
    rpm, width = comparison.rpm[rows], speed_width(comparison)
    run = speed_columns(comparison.run.channels, comparison.rig.r_drum, rows)
    model = speed_columns(comparison.simulation.run.channels, comparison.rig.r_drum, rows)
    found: dict[str, Curve] = {}
    middles: Signal = np.empty(0)
    both: dict[str, tuple[Signal, Signal]] = {}
    for name in run:
        middles, *pair = means(rpm, width, run[name], model[name], least=least_of(comparison))
        both[name] = (pair[0], pair[1])
        if name in SHOWN:
            found[name] = _curve(middles, *pair)
    for name, above, below in (("resistance_ohm", "vdc_v", "idc_a"), ("eta_gen", "power_gen_w", "power_mech_w")):
        if above in both and below in both:
            found[name] = _curve(middles, *(ratio(both[above][k], both[below][k]) for k in range(2)))
    return found


def speed_columns(channels: Mapping[str, Signal], r_drum: float | None, rows: Mask) -> dict[str, Signal]:
    """Channels and powers that are averaged over generator speed, with the loss P_mech - P_gen (Eq. 11)."""
    names = {"torque_nm": "torque", "vdc_v": "vdc", "idc_a": "idc"}
    found = {name: channels[channel][rows] for name, channel in names.items() if channel in channels}
    for name, stage in (("power_mech_w", "mech"), ("power_gen_w", "gen")):
        watts = power(channels, stage, r_drum)
        if watts is not None:
            found[name] = watts[rows]
    if "power_mech_w" in found and "power_gen_w" in found:
        found["loss_w"] = found["power_mech_w"] - found["power_gen_w"]
    return found


def _curve(x: Signal, log: Signal, simulated: Signal) -> Curve:
    whole = np.isfinite(log) & np.isfinite(simulated)
    return Curve(kept(x[whole]), kept(log[whole]), kept(simulated[whole]))


def kept(x: Signal) -> tuple[float, ...]:
    """Numbers to five significant digits, as they are kept with a result."""
    return tuple(float(f"{value:.5g}") for value in x.tolist())


# --------------------------------------------------------------------------------------------------------- differences
def differences_of(comparison: Comparison) -> dict[str, Difference]:
    """Log minus simulation over the payouts, channel by channel; torque and Idc not in open circuit."""
    run, model, rows = comparison.run.channels, comparison.simulation.run.channels, comparison.payout
    names = [n for n in COMPARED if n in run and not (comparison.run.open_circuit and n in ("torque", "idc"))]
    found = {}
    for name in names if rows.any() else ():
        apart = (run[name][rows] - model[name][rows]) * COMPARED[name][1]
        found[name] = Difference(float(np.mean(apart)), float(np.sqrt(np.mean(apart**2))))
    return found
