"""A log beside the simulation of its rig along the same line motion: curves, differences, loss budget (Figs 13 to 17)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import msgspec
import numpy as np

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.quantity import KGCM2
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.diagnosis.loss_budget import LossBudget, budget_of
from winchcascade.reduction.bins import engaged, stored_powers
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.rig.baseline import NoModel, model_of
from winchcascade.rig.simulate import Simulation, simulate

LONGEST = 200.0
"""Longest part of a log that is simulated: as many of its first complete cycles as it holds. [s]"""

LEAD = 2.0
"""A part of a log begins before its first onset and ends after its last cycle by this. [s]"""

BINS = 40
"""Maximum number of bins of a curve, which its markers show one by one."""

MIN_BIN_SAMPLES = 3
"""Minimum number of samples of a bin, or the number of cycles where these are fewer."""

FAINT = 0.02
"""Nothing is divided by a mean below this share of the maximum: a ratio of two noises has no meaning. [1]"""

COMPARED = {"torque": 1.0, "vdc": 1.0, "idc": 1.0, "pressure": 1.0 / KGCM2, "force": 1.0}
"""Channels whose differences are kept, and the factor that turns SI units into kg/cm2 for the pressure."""

HAUL_IN = "pressure_haul_in_kgcm2"
"""Curve of the pressure while the line is hauled in, beside that of the payouts."""

LOADED = ("power_gen_w", "torque_nm", "idc_a", "resistance_ohm", "loss_w", "eta_gen")
"""Curves without a meaning in open circuit, where only the bleed carries a current."""

CURVES = ("pressure_kgcm2", HAUL_IN, "force_n", "vdc_v", *LOADED)
"""Names of all curves."""


class ModelComparison(msgspec.Struct, frozen=True):
    """A log and its simulation at the same stamps.

    `run` is the log or its first part, `cycles` are the complete cycles in it, of `total`. `payout`, `driven` and `haul_in`,
    (n,) each, select the samples of these cycles that count: of their payouts, of the part of these before braking while the
    clutch drives the generator, and of their haul-ins; bridged samples do not count.
    """

    run: Run
    rig: Rig
    cycles: tuple[CycleResult, ...]
    total: int
    simulation: Simulation
    payout: Mask
    driven: Mask
    haul_in: Mask

    @property
    def rpm(self) -> Signal:
        """Generator speed that the line velocity gives while the clutch is engaged, gear v / r_drum, (n,) [rpm]."""
        return np.asarray(self.run.channels["velocity"] * (self.rig.rpm_per_velocity or 0.0))


class ComparedCurve(msgspec.Struct, frozen=True):
    """Means of log and simulation over the same samples, bin by bin of `x`: displacement, velocity or generator speed."""

    x: tuple[float, ...]
    log: tuple[float, ...]
    simulated: tuple[float, ...]


class ChannelDifference(msgspec.Struct, frozen=True):
    """Log minus simulation of one channel over the payouts: mean and root mean square, SI units or kg/cm2."""

    bias: float
    rms: float


class Account(msgspec.Struct, frozen=True, omit_defaults=True):
    """All that is kept of one comparison; `why` is the reason if there is none.

    `word` is what the log is called, `effects` are those that the rig file states, `cycles` of `total` complete cycles are
    compared, `rated` is the generator's speed [rpm], `gear` its speed over that of the drum.
    """

    why: str = ""
    word: str = "log"
    rig: str = ""
    effects: tuple[str, ...] = ()
    cycles: int = 0
    total: int = 0
    rated: float | None = None
    gear: float | None = None
    curves: dict[str, ComparedCurve] = {}
    differences: dict[str, ChannelDifference] = {}
    budget: LossBudget | None = None


def modelled(reduction: Reduction) -> Account:
    """Compare a log with the model that its rig file gives."""
    found = compare_with_baseline(reduction)
    return Account(why=found, word=reduction.run.origin.word) if isinstance(found, str) else account_of(found)


def compare_with_baseline(reduction: Reduction) -> ModelComparison | str:
    """Simulate a log with the numbers of its rig file and the effects that it states; else the reason, in one sentence."""
    model, run = model_of(reduction.rig), reduction.run
    if "velocity" not in run.channels:
        return "the log has no line velocity, which drives a simulation."
    if isinstance(model, NoModel):
        return model.why
    if run.load is None:
        return "the load of the log is not known; give it by --load-ohm or in a campaign.toml."
    complete = reduction.complete
    cycles = tuple(c for c in complete if _end(c) - complete[0].phases.onset <= LONGEST)
    if not cycles:
        return f"no complete cycle ends within {LONGEST:g} s of its onset, the longest that is simulated."
    run = between(run, cycles[0].phases.onset - LEAD, _end(cycles[-1]) + LEAD)
    try:
        simulation = simulate(run, model)
    except WinchcascadeError as fault:
        return str(fault).removeprefix(f"{run.name}: ")
    if not all(np.isfinite(x).all() for x in simulation.run.channels.values()):
        return "along this motion the model gives no finite numbers; check unit and scale of the velocity."
    phases, plateaus = [c.phases for c in cycles], [c.summary.payout.plateau for c in cycles]
    braking = [p.payout_end if flat is None else flat.braking for p, flat in zip(phases, plateaus, strict=True)]
    whole = ~within(run.t, all_gaps(run, tuple(run.channels)))
    return ModelComparison(
        run=run,
        rig=reduction.rig,
        cycles=cycles,
        total=len(complete),
        simulation=simulation,
        payout=within(run.t, [(p.onset, p.payout_end) for p in phases]) & whole,
        driven=engaged(run, phases, plateaus, reduction.rig)
        & within(run.t, [(p.onset, end) for p, end in zip(phases, braking, strict=True)])
        & whole,
        haul_in=within(run.t, [p.haul_in for p in phases if p.haul_in is not None]) & whole,
    )


def _end(cycle: CycleResult) -> float:
    """End of a cycle: of its haul-in, where the log holds it. [s]"""
    last = cycle.phases.haul_in or cycle.phases.hold or (0.0, cycle.phases.payout_end)
    return max(last[1], cycle.window.cutoff)


def between(run: Run, begin: float, end: float) -> Run:
    """The part of a log between two instants. [s]"""
    rows = slice(*np.searchsorted(run.t, (begin, end)).tolist())
    channels = {name: x[rows] for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[rows], channels=channels, samples=run.t[rows].size)


def within(t: Signal, spans: Iterable[Sequence[float]] | Signal) -> Mask:
    """Samples that lie in any of some spans, both ends included, (n,)."""
    inside = np.zeros(t.size, dtype=bool)
    for begin, end in spans:
        inside[np.searchsorted(t, begin) : np.searchsorted(t, end, side="right")] = True
    return inside


# ----------------------------------------------------------------------------------------------------- what is kept of it
def account_of(comparison: ModelComparison) -> Account:
    """Put together what is kept of a comparison."""
    rig = comparison.rig
    rated, gear = rig.generator.speed_rated, rig.drivetrain.gear_ratio
    return Account(
        word=comparison.run.origin.word,
        rig=rig.name,
        effects=tuple(rig.effects),
        cycles=len(comparison.cycles),
        total=comparison.total,
        rated=None if rated is None else rated.value * 30.0 / math.pi,
        gear=None if gear is None else gear.value,
        curves=curves_of(comparison),
        differences=differences_of(comparison),
        budget=budget_of(comparison.simulation, comparison.cycles),
    )


def differences_of(comparison: ModelComparison) -> dict[str, ChannelDifference]:
    """Log minus simulation over the payouts, channel by channel; torque and Idc not in open circuit."""
    run, model, rows = comparison.run.channels, comparison.simulation.run.channels, comparison.payout
    left_out = ("torque", "idc") if comparison.run.open_circuit else ()
    apart = {
        name: (run[name][rows] - model[name][rows]) * factor
        for name, factor in COMPARED.items()
        if name in run and name not in left_out and rows.any()
    }
    return {name: ChannelDifference(float(np.mean(x)), float(np.sqrt(np.mean(x**2)))) for name, x in apart.items()}


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
    """Make the curves of Figs 13 to 17 that a log has the channels for; in open circuit those that mean something there.

    Pressure is drawn over displacement, out and back, tension over velocity, and all else over generator speed while the clutch
    is engaged. An efficiency or a resistance is the ratio of two means of a bin.
    """
    c = comparison
    both = quantities(c, c.run), quantities(c, c.simulation.run)

    def means(names: Sequence[str], x: Signal, rows: Mask, width: float = 0.0) -> dict[str, Signal]:
        return _means({name: np.array([x, *(side[name] for side in both)])[:, rows] for name in names if name in both[0]},
                      width, min(MIN_BIN_SAMPLES, len(c.cycles)))  # fmt: skip

    velocity, displacement = c.run.channels["velocity"], c.run.channels.get("displacement")
    electrical = ("torque_nm", "vdc_v", "idc_a", "power_gen_w", "input_w", "output_w", "loss_w")
    found = means(("force_n",), velocity, c.driven | c.haul_in)
    if displacement is not None:
        found |= means(("pressure_kgcm2",), displacement, c.payout) | means((HAUL_IN,), displacement, c.haul_in)
    if c.rig.rpm_per_velocity is not None:
        found |= means(electrical, c.rpm, c.driven, c.rig.thresholds.rpm_bin)
    for name, above, below in (("resistance_ohm", "vdc_v", "idc_a"), ("eta_gen", "output_w", "input_w")):
        if above in found and below in found:
            x, *upper = found[above]
            lower = found[below][1:]
            strong = lower > FAINT * np.max(lower, axis=1, keepdims=True, initial=0.0)
            found[name] = np.array([x, *(upper / np.where(strong, lower, np.nan))])
    shown = set(CURVES) - set(LOADED if c.run.open_circuit else ())
    return {name: _curve(table) for name, table in found.items() if name in shown and np.isfinite(table).all(0).any()}


def _means(columns: dict[str, Signal], width: float, minimum: int) -> dict[str, Signal]:
    """Means of x, log and simulation, (3, n) by name, in bins of x that are no narrower than a width, (3, bins)."""
    import pandas as pd

    found = {}
    for name, column in columns.items():
        x = column[0]
        table = pd.DataFrame(column.T).groupby(np.floor(x / max(width, float(np.ptp(x)) / BINS, 1e-9)) if x.size else x)
        found[name] = table.mean()[table.size() >= minimum].to_numpy().T
    return found


def _curve(table: Signal) -> ComparedCurve:
    """The bins of a table, (3, bins), in which all is known, to five significant digits as they are kept with a result."""
    known = table[:, np.isfinite(table).all(axis=0)]
    return ComparedCurve(*(tuple(float(f"{value:.5g}") for value in row) for row in known.tolist()))
