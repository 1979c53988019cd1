"""Summary of each phase of a cycle: time means, travel, top speed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.cascade import BUILT_IN, Stream
from winchcascade.core.integrate import extremes, integrals, means_of
from winchcascade.core.quantity import KGCM2
from winchcascade.core.run import Signal
from winchcascade.reduction.phased_run import PhasedRun, span_end
from winchcascade.reduction.phases import Cycle

WRITTEN = {
    "begin": "begin_s", "braking": "braking_s", "duration": "duration_s", "travel": "travel_m", "speed": "speed_mps",
    "speed_max": "speed_max_mps", "force": "force_n", "force_min": "force_min_n", "torque": "torque_nm",
    "energy_line": "energy_line_j", "power_line": "power_line_w", "power_mech": "power_mech_w", "power_gen": "power_gen_w",
    "pressure": "pressure_kgcm2",
}  # fmt: skip
"""Names of the fields in written files, which have the units in them."""


class PlateauSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Time means from the plateau's beginning to the start of braking; SI units, None for what is not measured."""

    begin: float
    braking: float
    speed: float | None
    force: float | None
    torque: float | None
    power_line: float | None
    power_mech: float | None
    power_gen: float | None


class PayoutSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Payout: duration [s], travel [m], top speed of the smoothed velocity [m/s], and its plateau if it has one."""

    duration: float
    travel: float | None
    speed_max: float | None
    plateau: PlateauSummary | None


def mean_plateau_speed(payouts: Iterable[PayoutSummary]) -> float | None:
    """Mean speed of the plateaus of some payouts, None where there is none. [m/s]"""
    speeds = [payout.plateau.speed for payout in payouts if payout.plateau is not None]
    known = [speed for speed in speeds if speed is not None]
    return sum(known) / len(known) if known else None


class HoldSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Hold: duration [s] and time means of force [N], torque [N m] and gauge pressure, in the unit of the files [kg/cm2]."""

    duration: float
    force: float | None
    torque: float | None
    pressure: float | None


class HaulInSummary(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Haul-in: duration [s], top speed as a magnitude [m/s], mean and minimum force [N], line energy, negative [J]."""

    duration: float
    speed_max: float | None
    force: float | None
    force_min: float | None
    energy_line: float | None


class OperatingPoint(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Time means over a cycle that is a span: speed of the shaft [rpm] and torque [N m], None for what is not measured."""

    rpm_shaft: float | None
    torque: float | None


class BothWays(msgspec.Struct, frozen=True, rename={"positive": "positive_j", "negative": "negative_j"}):
    """Energies of one stage in a cycle that is a span, while its power is positive and while it is negative; the second is
    negative. Their difference is the integral of the magnitude. [J]
    """

    positive: float
    negative: float


class PhaseSummary(msgspec.Struct, frozen=True):
    """The three phases of one cycle; None for one that the log does not hold.

    `point` and, by stage, `both_ways` belong to cycles that are spans, as operating points of a dynamometer or waves; they are
    unset for others.
    """

    payout: PayoutSummary
    hold: HoldSummary | None
    haul_in: HaulInSummary | None
    point: OperatingPoint | msgspec.UnsetType = msgspec.UNSET
    both_ways: Mapping[str, BothWays] | msgspec.UnsetType = msgspec.UNSET


_MEANS = ("velocity", "force", "torque", "power_line", "power_mech", "power_gen")
"""What is averaged over a plateau, in the order of the fields of its summary."""


def summarise(phased: PhasedRun) -> list[PhaseSummary]:
    """Summarise the phases of every cycle."""
    run, cycles = phased.run, phased.cycles
    flat = _windows(cycles, [None if p is None else (p.begin, max(p.braking, p.begin)) for p in phased.plateaus])
    holds, hauls = _windows(cycles, [c.hold for c in cycles]), _windows(cycles, [c.haul_in for c in cycles])
    means = _means(phased, (*_MEANS, "pressure"), np.concatenate((flat, holds, hauls)))
    on_plateau, held, hauled_in = (means[k * len(cycles) : (k + 1) * len(cycles)] for k in range(3))
    held = [[f, torque, None if pa is None else pa / KGCM2] for _, f, torque, *_, pa in held]
    known = "velocity" in run.channels
    plateaus = [
        None if p is None else PlateauSummary(begin, braking, p.speed if speed is None and known else speed, *rest)
        for p, (begin, braking), (speed, *rest, _) in zip(phased.plateaus, flat.tolist(), on_plateau, strict=True)
    ]
    top = (-extremes(run.t, phased.v_smooth, hauls)[0]).tolist()
    force, line = run.channels.get("force"), BUILT_IN["line"].stream(run.channels, None)
    nothing: list[float | None] = [None] * len(cycles)
    minimum = nothing if force is None else extremes(run.t, force, hauls)[0].tolist()
    energy = nothing if line is None else integrals(run.t, line, hauls).tolist()
    hauled = zip(top, [force for _, force, *_ in hauled_in], minimum, energy, strict=True)
    points, flows = _points(phased), _both_ways(phased)
    return [
        PhaseSummary(
            PayoutSummary(
                _seconds(c.payout_end - c.onset),
                travel if math.isfinite(travel) else None,
                speed_max if known else None,
                plateau,
            ),
            None if c.hold is None else HoldSummary(_seconds(c.hold[1] - c.hold[0]), *hold),
            None
            if c.haul_in is None
            else HaulInSummary(_seconds(c.haul_in[1] - c.haul_in[0]), v if known else None, mean, low, joule),
            point,
            flow,
        )
        for c, travel, speed_max, plateau, hold, (v, mean, low, joule), point, flow in zip(
            cycles, phased.travel, phased.speed_max, plateaus, held, hauled, points, flows, strict=True
        )
    ]


def _points(phased: PhasedRun) -> list[OperatingPoint | msgspec.UnsetType]:
    """Mean speed and torque of each cycle that is a span; unset where payouts are found in a motion."""
    if phased.rig.phases.by_motion or not {"speed", "torque"} & phased.run.channels.keys():
        return [msgspec.UNSET] * len(phased.cycles)
    return [
        OperatingPoint(None if omega is None else omega * 30.0 / math.pi, torque)
        for omega, torque in _means(phased, ("speed", "torque"), _whole_spans(phased))
    ]


def _both_ways(phased: PhasedRun) -> Sequence[dict[str, BothWays] | msgspec.UnsetType]:
    """Energies of the stages of each cycle that is a span by the sign of the power; unset for cycles found in a motion."""
    if phased.rig.phases.by_motion:
        return [msgspec.UNSET] * len(phased.cycles)
    run, rig, spans = phased.run, phased.rig, _whole_spans(phased)
    found: list[dict[str, BothWays]] = [{} for _ in phased.cycles]
    for stage in rig.cascade.stages:
        watts = stage.watts(run.channels, rig.r_drum)
        if watts is None:
            continue
        parts = [integrals(run.t, side.__getitem__, spans) for side in (np.maximum(watts, 0.0), np.minimum(watts, 0.0))]
        for k, (positive, negative) in enumerate(np.transpose(parts).tolist()):
            found[k][stage.name] = BothWays(positive, negative)
    return found


def _whole_spans(phased: PhasedRun) -> Signal:
    """Begin and end of each cycle that is a span, (k, 2). [s]"""
    return np.array([(c.onset, span_end(c, phased.rig)) for c in phased.cycles]).reshape(-1, 2)


def _seconds(duration: float) -> float:
    """A difference of stamps without the error of their subtraction. [s]"""
    return round(duration, 9)


def _windows(cycles: Sequence[Cycle], spans: Sequence[tuple[float, float] | None]) -> Signal:
    """Begin and end of a phase in each cycle, (k, 2) [s]; without length where a cycle does not have it."""
    windows = [(c.onset, c.onset) if span is None else span for c, span in zip(cycles, spans, strict=True)]
    return np.array(windows).reshape(-1, 2)


def _means(phased: PhasedRun, names: Sequence[str], windows: Signal) -> list[list[float | None]]:
    """Time means of channels and powers in each window; None for what is not measured and for a mean over no time."""
    run = phased.run
    signals: dict[str, Stream | None] = {name: x.__getitem__ for name, x in run.channels.items()}
    signals |= {
        f"power_{stage.name}": stage.stream(run.channels, phased.rig.r_drum) for stage in phased.rig.cascade.stages
    }
    known = {k: x for k, name in enumerate(names) if (x := signals.get(name)) is not None}
    columns = np.full((len(windows), len(names)), np.nan)
    columns[:, list(known)] = means_of(run.t, list(known.values()), windows).T
    return [[value if math.isfinite(value) else None for value in row] for row in columns.tolist()]
