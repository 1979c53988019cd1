"""A log beside the simulation of its rig along the same line motion: curves, differences, loss
budget (Figs 13 to 17).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.integrate import rms
from winchcascade.core.quantity import KGCM2
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.core.scales import motion_of_runs
from winchcascade.reduction.bins import bin_width, engaged, stored_powers
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.rig.baseline import NoModel, model_of
from winchcascade.rig.ledger import LEDGER
from winchcascade.rig.simulate import Simulation, simulate

LONGEST = 20.0
"""Longest part of a log that is simulated, over the time of a stroke: as many of its first
complete cycles as it holds. [1]
"""

LEAD = 0.2
"""A part of a log begins before its first onset and ends after its last cycle by this, over the
time of a stroke. [1]
"""

BINS = 40
"""Maximum number of bins of a curve, which its markers show one by one."""

MIN_BIN_SAMPLES = 3
"""Minimum number of samples of a bin, or the number of cycles where these are fewer."""

FAINT = 0.02
"""Nothing is divided by a mean below this share of the maximum: a ratio of two noises has no
meaning. [1]
"""

COMPARED = {"torque": 1.0, "vdc": 1.0, "idc": 1.0, "pressure": 1.0 / KGCM2, "force": 1.0}
"""Channels whose differences are kept, and the factor that turns SI units into kg/cm2 for the
pressure.
"""

HAUL_IN = "pressure_haul_in_kgcm2"
"""Curve of the pressure while the line is hauled in, beside that of the payouts."""

CURVES = {
    "pressure_kgcm2": ("displacement", "payout"), HAUL_IN: ("displacement", "haul_in"), "force_n": ("velocity", "moving"),
    "vdc_v": ("rpm", "driven"), "power_gen_w": ("rpm", "driven"), "torque_nm": ("rpm", "driven"),
    "idc_a": ("rpm", "driven"), "loss_w": ("rpm", "driven"), "resistance_ohm": ("rpm", "driven"), "eta_gen": ("rpm", "driven"),
}  # fmt: skip
"""Each curve with what it is over and the samples that count."""

LOADED = ("power_gen_w", "torque_nm", "idc_a", "resistance_ohm", "loss_w", "eta_gen")
"""Curves without a meaning in open circuit, where only the bleed carries a current."""

RATIOS = {"resistance_ohm": ("vdc_v", "idc_a"), "eta_gen": ("output_w", "input_w")}
"""Curves that are the ratio of two means of a bin."""


class ComparedCurve(msgspec.Struct, frozen=True):
    """Means of log and simulation over the same samples, bin by bin of `x`: displacement,
    velocity or generator speed.
    """

    x: tuple[float, ...]
    log: tuple[float, ...]
    simulated: tuple[float, ...]


class ChannelDifference(msgspec.Struct, frozen=True):
    """Log minus simulation of one channel over the payouts: mean and root mean square, SI units
    or kg/cm2.
    """

    bias: float
    rms: float


GROUPS = {booked.group: booked.about for entry, booked in LEDGER.items() if entry != "line"}
"""Groups of entries of the ledger that are shown together, from the DC link back to the line,
and what they are.
"""


class LossBudget(msgspec.Struct, frozen=True):
    """Where the energy of the line goes in a simulation: means over the windows of the compared
    cycles [J].

    `line` and each of `GROUPS`, and `mech`, what of it reaches the torque sensor. `log` holds the
    energies that the log gives, by stage: line, mech, gen.
    """

    line: float
    groups: dict[str, float]
    mech: float
    log: dict[str, float]

    @property
    def shares(self) -> dict[str, float]:
        """Each group over the line's energy. [1]"""
        return {name: joule / self.line for name, joule in self.groups.items()}


class Account(msgspec.Struct, frozen=True, omit_defaults=True):
    """All that is kept of one comparison; `why` is the reason if there is none.

    `word` is what the log is called, `effects` are those that the rig file states, `cycles` of
    `total` complete cycles are compared, `rated` is the generator's speed [rpm], `gear` its speed
    over that of the drum.
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


class SimulatedLog(NamedTuple):
    """The first complete cycles of a log, the part of it that holds them, and its simulation at
    the same stamps.
    """

    run: Run
    rig: Rig
    cycles: tuple[CycleResult, ...]
    simulation: Simulation


class Samples(NamedTuple):
    """What the curves of a log are over, (n,) each in SI units and rpm, and which samples count;
    bridged ones do not.

    `payout` and `haul_in` are those of the cycles, `driven` those of a payout before braking while
    the clutch drives the generator, `moving` both of the latter.
    """

    velocity: Signal
    displacement: Signal
    rpm: Signal
    payout: Mask
    driven: Mask
    haul_in: Mask
    moving: Mask


def modelled(reduction: Reduction) -> Account:
    """Compare a log with the model that its rig file gives."""
    found, word = simulated_log(reduction), reduction.run.origin.word
    if isinstance(found, str):
        return Account(why=found, word=word)
    rig, samples = reduction.rig, samples_of(found)
    rated, gear = rig.generator.speed_rated, rig.drivetrain.gear_ratio
    return Account(
        word=word,
        rig=rig.name,
        effects=tuple(rig.effects),
        cycles=len(found.cycles),
        total=len(reduction.complete),
        rated=None if rated is None else rated.value * 30.0 / math.pi,
        gear=None if gear is None else gear.value,
        curves=_curves(found, samples),
        differences=_differences(found, samples.payout),
        budget=_budget(found),
    )


def simulated_log(reduction: Reduction) -> SimulatedLog | str:
    """Simulate a log with the numbers of its rig file and the effects that it states; else the
    reason, in one sentence.
    """
    model, run, complete = model_of(reduction.rig), reduction.run, reduction.complete
    if "velocity" not in run.channels:
        return "the log has no line velocity, which drives a simulation."
    if isinstance(model, NoModel):
        return model.why
    if run.load is None:
        return "the load of the log is not known; give it by --load-ohm or in a campaign.toml."
    time = motion_of_runs([run]).time
    longest, lead = LONGEST * time, LEAD * time
    cycles = tuple(c for c in complete if _end(c) - complete[0].phases.onset <= longest)
    if not cycles:
        return f"no complete cycle ends within {longest:.3g} s of its onset, the longest that is simulated."
    first, last = np.searchsorted(
        run.t, (cycles[0].phases.onset - lead, _end(cycles[-1]) + lead)
    ).tolist()
    channels = {name: x[first:last] for name, x in run.channels.items()}
    run = msgspec.structs.replace(run, t=run.t[first:last], channels=channels, samples=last - first)
    try:
        simulation = simulate(run, model)
    except WinchcascadeError as fault:
        return str(fault).removeprefix(f"{run.name}: ")
    if not all(np.isfinite(x).all() for x in simulation.run.channels.values()):
        return "along this motion the model gives no finite numbers; check unit and scale of the velocity."
    return SimulatedLog(run, reduction.rig, cycles, simulation)


def _end(cycle: CycleResult) -> float:
    """End of a cycle: of its haul-in, where the log holds it. [s]"""
    last = cycle.phases.haul_in or cycle.phases.hold or (0.0, cycle.phases.payout_end)
    return max(last[1], cycle.window.cutoff)


def samples_of(found: SimulatedLog) -> Samples:
    """Find what the curves of a log are over, and which of its samples count."""
    run, phases = found.run, [c.phases for c in found.cycles]
    plateaus = [c.summary.payout.plateau for c in found.cycles]
    braking = [
        p.payout_end if flat is None else flat.braking
        for p, flat in zip(phases, plateaus, strict=True)
    ]
    whole = ~within(run.t, all_gaps(run, tuple(run.channels)))
    driven = engaged(run, phases, plateaus, found.rig) & whole
    driven &= within(run.t, [(p.onset, end) for p, end in zip(phases, braking, strict=True)])
    haul_in = within(run.t, [p.haul_in for p in phases if p.haul_in is not None]) & whole
    return Samples(
        velocity=run.channels["velocity"],
        displacement=run.channels.get("displacement", np.full(run.t.size, math.nan)),
        rpm=run.channels["velocity"] * (found.rig.rpm_per_velocity or math.nan),
        payout=within(run.t, [(p.onset, p.payout_end) for p in phases]) & whole,
        driven=driven,
        haul_in=haul_in,
        moving=driven | haul_in,
    )


def within(t: Signal, spans: Iterable[Sequence[float]] | Signal) -> Mask:
    """Samples that lie in any of some spans, both ends included, (n,)."""
    inside = np.zeros(t.size, dtype=bool)
    for begin, end in spans:
        inside[np.searchsorted(t, begin) : np.searchsorted(t, end, side="right")] = True
    return inside


def _differences(found: SimulatedLog, payout: Mask) -> dict[str, ChannelDifference]:
    """Log minus simulation over the payouts, channel by channel; torque and Idc not in open
    circuit.
    """
    run, model = found.run.channels, found.simulation.run.channels
    left_out = ("torque", "idc") if found.run.open_circuit else ()
    apart = {
        name: (run[name] - model[name])[payout] * factor
        for name, factor in COMPARED.items()
        if name in run and name not in left_out and payout.any()
    }
    return {name: ChannelDifference(float(np.mean(x)), rms(x)) for name, x in apart.items()}


def quantities(found: SimulatedLog, run: Run) -> dict[str, Signal]:
    """Channels and powers of the log or of its simulation that are compared, (n,) each by name.

    The loss is P_mech - P_gen (Eq. 11) less what goes into rotor, shaft and capacitor while the
    speed changes, with the numbers of the model: without this a machine that speeds up would seem
    to lose what it stores.
    """
    channels, shaft = run.channels, found.simulation.model.drivetrain
    names = (("torque_nm", "torque"), ("vdc_v", "vdc"), ("idc_a", "idc"), ("force_n", "force"))
    columns = {name: channels[channel] for name, channel in names if channel in channels}
    if "pressure" in channels:
        columns["pressure_kgcm2"] = columns[HAUL_IN] = channels["pressure"] / KGCM2
    mech, gen = (BUILT_IN[name].watts(channels, found.rig.r_drum) for name in ("mech", "gen"))
    if gen is not None:
        columns["power_gen_w"] = gen
    if mech is not None and gen is not None:
        numbers = shaft.inertia_rotor, shaft.k_shaft, found.simulation.model.dc_link.c_dc
        stored = stored_powers(run, found.rig, np.arange(run.t.size), *numbers)
        columns["input_w"] = mech - stored["rotor"] - stored.get("spring", 0.0)
        columns["output_w"] = gen + stored["capacitor"]
        columns["loss_w"] = columns["input_w"] - columns["output_w"]
    return columns


def _curves(found: SimulatedLog, samples: Samples) -> dict[str, ComparedCurve]:
    """Curves of Figs 13 to 17 that a log has the channels for; in open circuit those that mean
    something there.

    Each is of means in bins of what it is over; bins of few samples are left out.
    """
    log, simulated = (quantities(found, run) for run in (found.run, found.simulation.run))
    minimum, curves = min(MIN_BIN_SAMPLES, len(found.cycles)), {}
    for name in (name for name in CURVES if not (found.run.open_circuit and name in LOADED)):
        over, here = (getattr(samples, field) for field in CURVES[name])
        columns, rows = RATIOS.get(name, (name,)), here & ~np.isnan(over)
        if not rows.any() or not {*columns} <= log.keys():
            continue
        x = over[rows]
        least = bin_width(found.rig, float(x.max())) if CURVES[name][0] == "rpm" else 1e-9
        place = np.floor(x / max(least, float(np.ptp(x)) / BINS)).astype(np.intp)
        place -= place.min()
        count = np.bincount(place)
        sides = [side[column][rows] for side in (log, simulated) for column in columns]
        sums = np.array([np.bincount(place, values) for values in (x, *sides)])
        means = sums[:, count >= minimum] / count[count >= minimum]
        curve = (
            means
            if len(columns) == 1
            else np.array([means[0], _ratio(*means[1:3]), _ratio(*means[3:5])])
        )
        known = curve[:, np.isfinite(curve).all(axis=0)]
        if known.size:
            curves[name] = ComparedCurve(
                *(tuple(float(f"{value:.5g}") for value in row) for row in known.tolist())
            )
    return curves


def _ratio(above: Signal, below: Signal) -> Signal:
    """One row of means over another, not a number where the lower is faint, (bins,)."""
    return above / np.where(below > FAINT * np.max(below, initial=0.0), below, np.nan)


def _budget(found: SimulatedLog) -> LossBudget | None:
    """Book the energy of a simulation between onset and cutoff of each cycle, as a mean over the
    cycles.
    """
    t, ends = found.run.t, np.array([(c.window.onset, c.window.cutoff) for c in found.cycles]).T
    booked = {
        name: np.diff(np.interp(ends, t, x), axis=0) for name, x in found.simulation.energy.items()
    }
    joule = {name: float(np.mean(x)) for name, x in booked.items()}
    if joule["line"] <= 0.0:
        return None
    groups = {
        name: sum(joule[entry] for entry, of in LEDGER.items() if of.group == name)
        for name in GROUPS
    }
    logged = {
        stage: [x for c in found.cycles if (x := c.metrics[f"energy_{stage}"]) is not None]
        for stage in (("line",) if found.run.open_circuit else ("line", "mech", "gen"))
    }
    return LossBudget(
        line=joule["line"],
        groups=groups,
        mech=joule["line"] - sum(joule[entry] for entry, of in LEDGER.items() if of.before),
        log={
            stage: float(np.mean(x)) for stage, x in logged.items() if len(x) == len(found.cycles)
        },
    )
