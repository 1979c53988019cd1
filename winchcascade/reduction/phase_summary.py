"""What each phase of a cycle was like: time means, travel, top speed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import extremes, integrals, means
from winchcascade.reduction.energies import STAGES, stream

if TYPE_CHECKING:
    from winchcascade.core.integrate import Stream
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.phased_run import PhasedRun
    from winchcascade.reduction.phases import Plateau


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


def summarise(phased: PhasedRun) -> list[PhaseSummary]:
    """Summarise the phases of every cycle."""
    run, rig, cycles = phased.run, phased.rig, phased.cycles
    flat = _plateaus(run, phased.plateaus, rig)
    paid_out = [
        PayoutSummary(c.payout_end - c.onset, travel, top, p)
        for c, travel, top, p in zip(cycles, phased.travel, phased.speed_max, flat, strict=True)
    ]
    holds = _holds(run, [c.hold for c in cycles])
    hauls = _haul_ins(run, phased.v_smooth, [c.haul_in for c in cycles], rig)
    return [PhaseSummary(*phases) for phases in zip(paid_out, holds, hauls, strict=True)]


def _present(spans: Sequence[Span | None]) -> tuple[list[int], Signal]:
    """The cycles that have a phase, and its begin and end, (k, 2) [s]."""
    present = [k for k, span in enumerate(spans) if span is not None]
    return present, np.array([span for span in spans if span is not None]).reshape(-1, 2)


def _means(run: Run, signals: Sequence[Stream | None], windows: Signal) -> list[list[float | None]]:
    """Time means of signals over windows; None for what is not measured and for a mean over no time."""
    return [
        [None] * len(windows) if x is None else [_finite(value) for value in means(run.t, x, windows).tolist()]
        for x in signals
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _channel(run: Run, name: str) -> Stream | None:
    return run.channels[name].__getitem__ if name in run.channels else None


def _plateaus(run: Run, plateaus: Sequence[Plateau | None], rig: Rig) -> list[PlateauSummary | None]:
    present, windows = _present([None if p is None else (p.begin, max(p.braking, p.begin)) for p in plateaus])
    signals = [_channel(run, name) for name in ("velocity", "force", "torque")]
    signals += [stream(run.channels, stage, rig.r_drum) for stage in STAGES]
    summaries: list[PlateauSummary | None] = [None] * len(plateaus)
    for k, (begin, end), speed, *rest in zip(present, windows.tolist(), *_means(run, signals, windows), strict=True):
        plateau = plateaus[k]
        assert plateau is not None
        summaries[k] = PlateauSummary(begin, end, plateau.speed if speed is None else speed, *rest)
    return summaries


def _holds(run: Run, spans: Sequence[Span | None]) -> list[HoldSummary | None]:
    present, windows = _present(spans)
    columns = _means(run, [_channel(run, name) for name in ("force", "torque", "pressure")], windows)
    holds: list[HoldSummary | None] = [None] * len(spans)
    for k, (begin, end), *rest in zip(present, windows.tolist(), *columns, strict=True):
        holds[k] = HoldSummary(end - begin, *rest)
    return holds


def _haul_ins(run: Run, v_smooth: Signal, spans: Sequence[Span | None], rig: Rig) -> list[HaulInSummary | None]:
    present, windows = _present(spans)
    top = -extremes(run.t, v_smooth, windows)[0]
    force, line = run.channels.get("force"), stream(run.channels, "line", rig.r_drum)
    nothing: list[float | None] = [None] * len(windows)
    columns = [
        _means(run, [_channel(run, "force")], windows)[0],
        nothing if force is None else extremes(run.t, force, windows)[0].tolist(),
        nothing if line is None else integrals(run.t, line, windows).tolist(),
    ]
    hauls: list[HaulInSummary | None] = [None] * len(spans)
    for k, (begin, end), speed, *rest in zip(present, windows.tolist(), top.tolist(), *columns, strict=True):
        hauls[k] = HaulInSummary(end - begin, speed, *rest)
    return hauls
