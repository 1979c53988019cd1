"""Curves of a log and of its simulation: means over the same samples in bins of speed or displacement (Figs 13 to 17)."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.quantity import KGCM2
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.model_comparison import ModelComparison
from winchcascade.reduction.bins import stored_powers

MIN_BIN_SAMPLES = 3
"""Minimum number of samples of a bin, or the number of cycles where these are fewer."""

FAINT = 0.02
"""Nothing is divided by a mean below this share of the maximum: a ratio of two noises has no meaning. [1]"""

MAX_BINS = 40
"""Maximum number of bins of displacement and of velocity, about."""

MAX_SPEED_BINS = 200
"""Maximum number of bins of generator speed: where those of the rig file are more, they are made wider."""

HAUL_IN = "pressure_haul_in_kgcm2"
"""Curve of the pressure while the line is hauled in, beside that of the payouts."""

LOADED = ("power_gen_w", "torque_nm", "idc_a", "resistance_ohm", "loss_w", "eta_gen")
"""Curves without a meaning in open circuit, where only the bleed carries a current."""

CURVES = ("pressure_kgcm2", HAUL_IN, "force_n", "vdc_v", *LOADED)
"""Names of all curves."""


class ComparedCurve(msgspec.Struct, frozen=True):
    """Means of log and simulation over the same samples, bin by bin.

    `x` are the middles of the bins of generator speed, and means of displacement and velocity.
    """

    x: tuple[float, ...]
    log: tuple[float, ...]
    simulated: tuple[float, ...]


def means(x: Signal, width: float, *columns: Signal, minimum: int) -> tuple[Signal, ...]:
    """Average columns in bins of x, and give the middles of the bins before them; bins of few samples are left out.

    >>> [c.tolist() for c in means(np.array([1.0, 2.0, 12.0]), 10.0, np.array([3.0, 5.0, 9.0]), minimum=2)]
    [[5.0], [4.0]]
    """
    if x.size == 0:
        return tuple(np.empty(0) for _ in range(1 + len(columns)))
    number = np.floor(x / width).astype(np.int64)
    low = int(number.min())
    count = np.bincount(number - low)
    full = np.flatnonzero(count >= max(minimum, 1))
    middles: Signal = (full + low).astype(np.float64) * width + 0.5 * width
    return (middles, *(np.bincount(number - low, weights=y)[full] / count[full] for y in columns))


def minimum_of(comparison: ModelComparison) -> int:
    """Samples that a bin must have."""
    return min(MIN_BIN_SAMPLES, len(comparison.cycles))


def speed_width(comparison: ModelComparison) -> float:
    """Width of the bins of generator speed: that of the rig file, unless it makes too many. [rpm]"""
    rpm = comparison.rpm[comparison.driven]
    return max(comparison.rig.thresholds.rpm_bin, round_width(float(np.ptp(rpm)) if rpm.size else 0.0, MAX_SPEED_BINS))


def round_width(extent: float, maximum: int = MAX_BINS) -> float:
    """Width of bins of which no more than a given number cover an extent: 1, 2 or 5 times a power of ten.

    >>> round_width(10.0), round_width(2.2)
    (0.5, 0.1)
    """
    raw = max(extent, 1e-9) / maximum
    power_of_ten = 10.0 ** np.floor(np.log10(raw))
    return next(float(round(k * power_of_ten, 12)) for k in (1, 2, 5, 10) if k * power_of_ten >= raw * (1 - 1e-9))


def kept(x: Signal) -> tuple[float, ...]:
    """Numbers to five significant digits, as they are kept with a result."""
    return tuple(float(f"{value:.5g}") for value in x.tolist())


class Abscissa(NamedTuple):
    """What a curve is drawn over, (n,), the samples that count, (n,), and the width of a bin.

    A curve has the mean of each bin as its abscissa, or the middle of the bin if `middles` is set.
    """

    x: Signal
    rows: NDArray[np.bool_]
    width: float
    middles: bool = False


def abscissas(comparison: ModelComparison) -> dict[str, Abscissa]:
    """What each quantity is drawn over: displacement, out and back, velocity (Fig. 13a, b), or generator speed.

    Over speed only the samples count in which the clutch is engaged (Figs 13c and 14 to 17).
    """
    run, found = comparison.run.channels, {}
    v, x = run["velocity"], run.get("displacement")
    if x is not None:
        found["pressure_kgcm2"] = Abscissa(x, comparison.payout, round_width(float(np.ptp(x))))
        found[HAUL_IN] = found["pressure_kgcm2"]._replace(rows=comparison.haul_in)
    found["force_n"] = Abscissa(v, comparison.driven | comparison.haul_in, round_width(float(np.ptp(v))))
    if comparison.rig.rpm_per_velocity is not None:
        speed = Abscissa(comparison.rpm, comparison.driven, speed_width(comparison), middles=True)
        found |= dict.fromkeys(("torque_nm", "vdc_v", "idc_a", "power_gen_w", "input_w", "output_w", "loss_w"), speed)
    return found


def quantities(comparison: ModelComparison, run: Run) -> dict[str, Signal]:
    """Channels and powers of the log or of its simulation that are compared, (n,) each by name.

    The loss is P_mech - P_gen (Eq. 11) less what goes into rotor, shaft and capacitor while the speed changes, with the numbers
    of the model: without this a machine that speeds up would seem to lose what it stores.
    """
    channels, model = run.channels, comparison.simulation.model
    names = (("torque_nm", "torque"), ("vdc_v", "vdc"), ("idc_a", "idc"), ("force_n", "force"))
    found = {name: channels[channel] for name, channel in names if channel in channels}
    if "pressure" in channels:
        found["pressure_kgcm2"] = found[HAUL_IN] = channels["pressure"] / KGCM2
    powers = {f"power_{name}_w": BUILT_IN[name].watts(channels, comparison.rig.r_drum) for name in ("mech", "gen")}
    found |= {name: watt for name, watt in powers.items() if watt is not None}
    if found.keys() >= powers.keys():
        shaft = model.drivetrain
        numbers = shaft.inertia_rotor, shaft.k_shaft, model.dc_link.c_dc
        stored = {name: of(slice(0, run.t.size)) for name, of in stored_powers(run, comparison.rig, *numbers).items()}
        found["input_w"] = found["power_mech_w"] - stored["rotor"] - stored.get("spring", 0.0)
        found["output_w"] = found["power_gen_w"] + stored["capacitor"]
        found["loss_w"] = found["input_w"] - found["output_w"]
    return found


def curves_of(comparison: ModelComparison) -> dict[str, ComparedCurve]:
    """Make the curves of Figs 13 to 17 that a log has the channels for; in open circuit those that mean something there."""
    log, simulated = (quantities(comparison, run) for run in (comparison.run, comparison.simulation.run))
    found: dict[str, tuple[Signal, ...]] = {}
    for name, (x, rows, width, middles) in abscissas(comparison).items():
        if name in log:
            columns = (column[rows] for column in (x, log[name], simulated[name]))
            middle, *binned = means(x[rows], width, *columns, minimum=minimum_of(comparison))
            found[name] = (middle if middles else binned[0], *binned[1:])
    for name, above, below in (("resistance_ohm", "vdc_v", "idc_a"), ("eta_gen", "output_w", "input_w")):
        if above in found and below in found:
            found[name] = (found[above][0], *map(_ratio, found[above][1:], found[below][1:]))
    shown = set(CURVES) - set(LOADED if comparison.run.open_circuit else ())
    curves = {name: _curve(*columns) for name, columns in found.items() if name in shown}
    return {name: curve for name, curve in curves.items() if curve.x}


def _ratio(above: Signal, below: Signal) -> Signal:
    """One column of means over another, not a number where the lower is faint, (n,)."""
    strong = below > FAINT * np.max(below, initial=0.0)
    found: Signal = np.divide(above, below, out=np.full(below.size, np.nan), where=strong)
    return found


def _curve(x: Signal, log: Signal, simulated: Signal) -> ComparedCurve:
    whole = np.isfinite(log) & np.isfinite(simulated)
    return ComparedCurve(kept(x[whole]), kept(log[whole]), kept(simulated[whole]))


SAMPLES = 500
"""Maximum number of samples of a log beside a curve; of more an even selection."""


def samples_of(comparison: ModelComparison) -> dict[str, tuple[Signal, Signal]]:
    """Samples of the log from which its curves are averaged, x and y, (k,) each by the name of the curve."""
    log, found = quantities(comparison, comparison.run), {}
    for name, (x, own, *_) in abscissas(comparison).items():
        if name in log:
            rows = np.flatnonzero(own | comparison.haul_in if name == "pressure_kgcm2" else own)
            rows = rows[:: max(1, -(-rows.size // SAMPLES))]
            found[name] = (x[rows], log[name][rows])
    return found
