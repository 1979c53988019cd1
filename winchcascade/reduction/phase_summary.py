"""Summary of each phase of a cycle: time means, travel, top speed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from winchcascade.core.cascade import BUILT_IN, PAPER
from winchcascade.core.integrate import extremes, integrals, integrals_of, means_of
from winchcascade.core.quantity import KGCM2
from winchcascade.core.run import Signal
from winchcascade.reduction.phased_run import PhasedRun, whole_cycles

WRITTEN = {
    "begin": "begin_s", "braking": "braking_s", "duration": "duration_s", "travel": "travel_m", "speed": "speed_mps",
    "speed_max": "speed_max_mps", "force": "force_n", "force_min": "force_min_n", "torque": "torque_nm",
    "energy_line": "energy_line_j", "power_line": "power_line_w", "power_mech": "power_mech_w", "power_gen": "power_gen_w",
    "positive": "positive_j", "negative": "negative_j",
}  # fmt: skip
"""Names of the fields in written files, which have the units in them."""


class PlateauSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Time means from the plateau's beginning to the start of braking; SI units, None for what
    is not measured.
    """

    begin: float
    braking: float
    speed: float | None
    force: float | None
    torque: float | None
    power_line: float | None
    power_mech: float | None
    power_gen: float | None


class PayoutSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Payout: duration [s], travel [m], top speed of the smoothed velocity [m/s], and its
    plateau if it has one.
    """

    duration: float
    travel: float | None
    speed_max: float | None
    plateau: PlateauSummary | None


class HoldSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Hold: duration [s] and time means of force [N], torque [N m] and gauge pressure, in the
    unit of the files [kg/cm2].
    """

    duration: float
    force: float | None
    torque: float | None
    pressure_kgcm2: float | None


class HaulInSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Haul-in: duration [s], top speed as a magnitude [m/s], mean and minimum force [N], line
    energy, negative [J].
    """

    duration: float
    speed_max: float | None
    force: float | None
    force_min: float | None
    energy_line: float | None


class OperatingPoint(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Time means over a cycle that is a span: speed of the shaft [rpm] and torque [N m], None
    for what is not measured.
    """

    rpm_shaft: float | None
    torque: float | None


class BothWays(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Energies of one stage in a whole cycle while its power is positive, and while it is
    negative, which are negative. [J]
    """

    positive: float
    negative: float


class PhaseSummary(msgspec.Struct, frozen=True):
    """The three phases of one cycle; None for one that the log does not hold.

    `point` belongs to cycles that are spans, as operating points of a dynamometer or waves,
    `both_ways`, by stage, to these and to cycles of a rig file that states its stages; they are
    unset for others.
    """

    payout: PayoutSummary
    hold: HoldSummary | None
    haul_in: HaulInSummary | None
    point: OperatingPoint | UnsetType = UNSET
    both_ways: Mapping[str, BothWays] | UnsetType = UNSET


def mean_plateau_speed(payouts: Iterable[PayoutSummary]) -> float | None:
    """Mean speed of the plateaus of some payouts, None where there is none. [m/s]"""
    speeds = [payout.plateau.speed for payout in payouts if payout.plateau is not None]
    known = [speed for speed in speeds if speed is not None]
    return sum(known) / len(known) if known else None


def summarise(phased: PhasedRun) -> list[PhaseSummary]:
    """Summarise the phases of every cycle; lengths are rounded to the error of the subtraction
    of stamps.
    """
    run, cycles, known = phased.run, phased.cycles, "velocity" in phased.run.channels
    flat = [None if p is None else (p.begin, max(p.braking, p.begin)) for p in phased.plateaus]
    phases = flat, [c.hold for c in cycles], [c.haul_in for c in cycles]
    nowhere = [(c.onset, c.onset) for c in cycles]
    spans = np.array(
        [span or at for of in phases for span, at in zip(of, nowhere, strict=True)]
    ).reshape(-1, 2)
    powers = [f"power_{stage}" for stage in PAPER.names]
    velocity, force, torque, pressure, *watts = _means(
        phased, ["velocity", "force", "torque", "pressure", *powers], spans
    )
    hauls = spans[2 * len(cycles) :]
    top = (-extremes(run.t, phased.v_smooth, hauls)[0]).tolist()
    minimum = (
        extremes(run.t, run.channels["force"], hauls)[0].tolist()
        if "force" in run.channels
        else None
    )
    line = BUILT_IN["line"].stream(run.channels, None)
    energy = None if line is None else integrals(run.t, line, hauls).tolist()
    points: list[OperatingPoint | UnsetType] = [UNSET] * len(cycles)
    if not phased.rig.phases.by_motion and {"speed", "torque"} & run.channels.keys():
        speeds, torques = _means(phased, ["speed", "torque"], whole_cycles(phased))
        rpm = [None if omega is None else omega * 30.0 / math.pi for omega in speeds]
        points = list(map(OperatingPoint, rpm, torques))
    flows, found = _both_ways(phased), []
    for k, (c, p) in enumerate(zip(cycles, phased.plateaus, strict=True)):
        held, hauled = k + len(cycles), k + 2 * len(cycles)
        plateau, hold, haul_in = None, None, None
        if p is not None:
            speed = p.speed if known and velocity[k] is None else velocity[k]
            begin, braking = spans[k].tolist()
            of_channels = (column[k] for column in (force, torque, *watts))
            plateau = PlateauSummary(begin, braking, speed, *of_channels)
        if c.hold is not None:
            gauge = pressure[held]
            hold = HoldSummary(
                round(c.hold[1] - c.hold[0], 9),
                force[held],
                torque[held],
                None if gauge is None else gauge / KGCM2,
            )
        if c.haul_in is not None:
            lowest, joules = (None if of is None else of[k] for of in (minimum, energy))
            haul_in = HaulInSummary(
                round(c.haul_in[1] - c.haul_in[0], 9),
                top[k] if known else None,
                force[hauled],
                lowest,
                joules,
            )
        travel = phased.travel[k] if math.isfinite(phased.travel[k]) else None
        speed_max = phased.speed_max[k] if known else None
        payout = PayoutSummary(round(c.payout_end - c.onset, 9), travel, speed_max, plateau)
        found.append(PhaseSummary(payout, hold, haul_in, points[k], flows[k]))
    return found


def _both_ways(phased: PhasedRun) -> Sequence[dict[str, BothWays] | UnsetType]:
    """Energies of the stages of each whole cycle by the sign of the power; unset for payouts and
    the stages of the paper.
    """
    run, rig = phased.run, phased.rig
    if rig.phases.by_motion and not rig.cascade.configured:
        return [UNSET] * len(phased.cycles)
    found: list[dict[str, BothWays]] = [{} for _ in phased.cycles]
    for stage in rig.cascade.stages:
        watts = stage.watts(run.channels, rig.r_drum)
        if watts is not None:
            sides = [side.__getitem__ for side in (np.maximum(watts, 0.0), np.minimum(watts, 0.0))]
            for cycle, both in zip(
                found, integrals_of(run.t, sides, whole_cycles(phased)).T.tolist(), strict=True
            ):
                cycle[stage.name] = BothWays(*both)
    return found


def _means(phased: PhasedRun, names: Sequence[str], windows: Signal) -> list[list[float | None]]:
    """Time means of channels and powers in k windows, (m, k); None for what is not measured and
    for a mean over no time.
    """
    run, cascade = phased.run, phased.rig.cascade
    powers = cascade.streams(run.channels, phased.rig.r_drum)
    streams = {name: x.__getitem__ for name, x in run.channels.items()} | {
        f"power_{name}": watts for name, watts in powers.items()
    }
    known = [name for name in names if name in streams]
    found = dict(
        zip(known, means_of(run.t, [streams[name] for name in known], windows), strict=True)
    )
    nothing = np.full(len(windows), np.nan)
    return [
        [x if math.isfinite(x) else None for x in found.get(name, nothing).tolist()]
        for name in names
    ]
