"""What each phase of a cycle was like: time means, travel, top speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.cascade.energy import Cut, cut, integrals, largest, means
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


Span = tuple[float, float]


def summarise(
    run: Run, v_smooth: Signal, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | None], rig: Rig
) -> list[PhaseSummary]:
    """Summarise the phases of every cycle.

    Parameters
    ----------
    v_smooth : (n,) line velocity, smoothed [m/s]
    plateaus : of each cycle, None for one without
    """
    payouts = _payouts(run, v_smooth, cycles, _plateaus(run, plateaus, rig))
    holds = _holds(run, [c.hold for c in cycles])
    hauls = _haul_ins(run, v_smooth, [c.haul_in for c in cycles], rig)
    return [PhaseSummary(*phases) for phases in zip(payouts, holds, hauls, strict=True)]


def _present(run: Run, spans: Sequence[Span | None]) -> tuple[list[int], Cut]:
    """The cycles that have a phase, and its samples."""
    present = [k for k, span in enumerate(spans) if span is not None]
    return present, cut(run.t, np.array([span for span in spans if span is not None]).reshape(-1, 2))


def _column(x: Signal | None, count: int) -> list[float | None]:
    """Values as plain numbers, None for what is not measured and for a mean over no time."""
    if x is None:
        return [None] * count
    return [value if np.isfinite(value) else None for value in x.tolist()]


def _plateaus(run: Run, plateaus: Sequence[Plateau | None], rig: Rig) -> list[PlateauSummary | None]:
    spans = [None if p is None else (p.begin, max(p.braking, p.begin)) for p in plateaus]
    present, part = _present(run, spans)
    channels = part.channels(run, ("velocity", "force", "torque", "power_mech", "vdc", "idc"))
    columns = [channels["velocity"], channels.get("force"), channels.get("torque")]
    columns += [power(channels, stage, rig.r_drum) for stage in STAGES]
    means_of = [_column(None if x is None else means(part, x), len(present)) for x in columns]
    summaries: list[PlateauSummary | None] = [None] * len(plateaus)
    for k, (begin, end), speed, *rest in zip(present, part.windows.tolist(), *means_of, strict=True):
        plateau = plateaus[k]
        assert plateau is not None
        summaries[k] = PlateauSummary(begin, end, plateau.speed if speed is None else speed, *rest)
    return summaries


def _payouts(
    run: Run, v_smooth: Signal, cycles: Sequence[Cycle], plateaus: Sequence[PlateauSummary | None]
) -> list[PayoutSummary]:
    """Payouts; their travel from the displacement where there is one, else the integral of the velocity."""
    part = cut(run.t, np.array([(c.onset, c.payout_end) for c in cycles]).reshape(-1, 2))
    top = largest(part, v_smooth[part.rows])
    displacement = run.channels.get("displacement")
    if displacement is None:
        travel = integrals(part, run.channels["velocity"][part.rows])
    else:
        ends = np.interp(part.windows, run.t, displacement)
        travel = ends[:, 1] - ends[:, 0]
    rows = zip((part.windows[:, 1] - part.windows[:, 0]).tolist(), travel.tolist(), top.tolist(), plateaus, strict=True)
    return [PayoutSummary(*row) for row in rows]


def _holds(run: Run, spans: Sequence[Span | None]) -> list[HoldSummary | None]:
    present, part = _present(run, spans)
    channels = part.channels(run, ("force", "torque", "pressure"))
    columns = [
        _column(means(part, channels[name]) if name in channels else None, len(present))
        for name in ("force", "torque", "pressure")
    ]
    holds: list[HoldSummary | None] = [None] * len(spans)
    for k, (begin, end), *rest in zip(present, part.windows.tolist(), *columns, strict=True):
        holds[k] = HoldSummary(end - begin, *rest)
    return holds


def _haul_ins(run: Run, v_smooth: Signal, spans: Sequence[Span | None], rig: Rig) -> list[HaulInSummary | None]:
    present, part = _present(run, spans)
    channels = part.channels(run, ("velocity", "force"))
    force, watts = channels.get("force"), power(channels, "line", rig.r_drum)
    columns = [
        _column(largest(part, -v_smooth[part.rows]), len(present)),
        _column(None if force is None else means(part, force), len(present)),
        _column(None if force is None else -largest(part, -force), len(present)),
        _column(None if watts is None else integrals(part, watts), len(present)),
    ]
    hauls: list[HaulInSummary | None] = [None] * len(spans)
    for k, (begin, end), top, *rest in zip(present, part.windows.tolist(), *columns, strict=True):
        hauls[k] = HaulInSummary(end - begin, top or 0.0, *rest)
    return hauls
