"""What each phase of a cycle was like: time means, travel, top speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.cascade.energy import energies, means
from winchcascade.cascade.power import STAGES, power

if TYPE_CHECKING:
    from winchcascade.phases.detect import Cycle
    from winchcascade.phases.window import Plateau
    from winchcascade.rigfile import Rig
    from winchcascade.run import Run, Signal


class PlateauSummary(msgspec.Struct, frozen=True):
    """Time means from the plateau's beginning to the start of braking; SI units, None for what is not measured."""

    begin: float
    braking: float
    speed: float
    force: float | None
    torque: float | None
    power_line: float | None
    power_mech: float | None
    power_gen: float | None


class PayoutSummary(msgspec.Struct, frozen=True):
    """Payout: duration [s], travel [m], top speed of the smoothed velocity [m/s], and its plateau if it has one."""

    duration: float
    travel: float
    speed_max: float
    plateau: PlateauSummary | None


class HoldSummary(msgspec.Struct, frozen=True):
    """Hold: duration [s] and time means of force [N], torque [N m] and gauge pressure [Pa]."""

    duration: float
    force: float | None
    torque: float | None
    pressure: float | None


class HaulInSummary(msgspec.Struct, frozen=True):
    """Haul-in: duration [s], top speed as a magnitude [m/s], mean and least force [N], line energy, negative [J]."""

    duration: float
    speed_max: float
    force: float | None
    force_min: float | None
    energy_line: float | None


class PhaseSummary(msgspec.Struct, frozen=True):
    """The three phases of one cycle; None for one that the log does not hold."""

    payout: PayoutSummary
    hold: HoldSummary | None
    haul_in: HaulInSummary | None


def summarise(
    run: Run, v_smooth: Signal, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | None], rig: Rig
) -> list[PhaseSummary]:
    """Summarise the phases of every cycle.

    Parameters
    ----------
    v_smooth : (n,) line velocity, smoothed [m/s]
    plateaus : of each cycle, None for one without
    """
    payouts = [(c.onset, c.payout_end) for c in cycles]
    holds = [c.hold for c in cycles]
    hauls = [c.haul_in for c in cycles]
    plateau_spans = [None if p is None else (p.begin, max(p.braking, p.begin)) for p in plateaus]
    channels = run.channels
    powers = {stage: power(run, stage, rig.r_drum) for stage in STAGES}
    force, torque = channels.get("force"), channels.get("torque")
    mean_over = {
        name: _means(run.t, x, plateau_spans)
        for name, x in {"speed": channels["velocity"], "force": force, "torque": torque}.items()
    }
    power_over = {stage: _means(run.t, x, plateau_spans) for stage, x in powers.items()}
    held = {name: _means(run.t, channels.get(name), holds) for name in ("force", "torque", "pressure")}
    hauled = _means(run.t, force, hauls)
    hauled_energy = _sums(run.t, powers["line"], hauls)
    travel = _travel(run, payouts)
    top = [_top(run.t, v_smooth, span) for span in payouts]
    summaries = []
    for k, cycle in enumerate(cycles):
        plateau, span = plateaus[k], plateau_spans[k]
        flat = None
        if plateau is not None and span is not None:
            speed = mean_over["speed"][k]
            flat = PlateauSummary(
                span[0],
                span[1],
                plateau.speed if speed is None else speed,
                mean_over["force"][k],
                mean_over["torque"][k],
                *(power_over[stage][k] for stage in STAGES),
            )
        payout = PayoutSummary(cycle.payout_end - cycle.onset, travel[k], top[k], flat)
        hold = None
        if cycle.hold is not None:
            hold = HoldSummary(cycle.hold[1] - cycle.hold[0], held["force"][k], held["torque"][k], held["pressure"][k])
        haul_in = None
        if cycle.haul_in is not None:
            haul_in = HaulInSummary(
                cycle.haul_in[1] - cycle.haul_in[0],
                _top(run.t, v_smooth, cycle.haul_in),
                hauled[k],
                None if force is None else _least(run.t, force, cycle.haul_in),
                hauled_energy[k],
            )
        summaries.append(PhaseSummary(payout, hold, haul_in))
    return summaries


_Span = tuple[float, float]


def _per_cycle(values: Signal, present: Sequence[int], count: int) -> list[float | None]:
    column: list[float | None] = [None] * count
    for k, value in zip(present, values.tolist(), strict=True):
        column[k] = value if np.isfinite(value) else None
    return column


def _means(t: Signal, x: Signal | None, spans: Sequence[_Span | None]) -> list[float | None]:
    """Time mean over each cycle's span; None without the channel, the phase, or any length of it."""
    return _over(t, x, spans, means)


def _sums(t: Signal, x: Signal | None, spans: Sequence[_Span | None]) -> list[float | None]:
    return _over(t, x, spans, energies)


def _over(t: Signal, x: Signal | None, spans: Sequence[_Span | None], integral: object) -> list[float | None]:
    if x is None:
        return [None] * len(spans)
    present = [k for k, span in enumerate(spans) if span is not None]
    windows = np.array([span for span in spans if span is not None]).reshape(-1, 2)
    return _per_cycle(integral(t, x, windows), present, len(spans))  # type: ignore[operator]


def _travel(run: Run, payouts: Sequence[_Span]) -> list[float]:
    """Travel of each payout, from the displacement where there is one, else the integral of the velocity. [m]"""
    spans = np.array(payouts).reshape(-1, 2)
    displacement = run.channels.get("displacement")
    if displacement is None:
        return energies(run.t, run.channels["velocity"], spans).tolist()
    ends = np.interp(spans, run.t, displacement)
    return (ends[:, 1] - ends[:, 0]).tolist()


def _inside(t: Signal, span: _Span) -> slice:
    first = int(np.searchsorted(t, span[0], side="left"))
    last = int(np.searchsorted(t, span[1], side="right"))
    return slice(min(first, t.size - 1), max(last, first + 1))


def _top(t: Signal, v: Signal, span: _Span) -> float:
    return float(np.max(np.abs(v[_inside(t, span)])))


def _least(t: Signal, x: Signal, span: _Span) -> float:
    return float(np.min(x[_inside(t, span)]))
