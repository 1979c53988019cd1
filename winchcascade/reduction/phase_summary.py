"""What each phase of a cycle was like: time means, travel, top speed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

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

Summary = TypeVar("Summary")


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


def _windows(spans: Sequence[Span | None]) -> Signal:
    """Begin and end of a phase of the cycles that have it, (k, 2) [s]."""
    return np.array([span for span in spans if span is not None]).reshape(-1, 2)


def _of_cycles(spans: Sequence[Span | None], summaries: Iterator[Summary]) -> list[Summary | None]:
    """Summaries of a phase at the places of the cycles that have it, None at the others."""
    return [None if span is None else next(summaries) for span in spans]


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
    spans = [None if p is None else (p.begin, max(p.braking, p.begin)) for p in plateaus]
    windows, known = _windows(spans), [p.speed for p in plateaus if p is not None]
    signals = [_channel(run, name) for name in ("velocity", "force", "torque")]
    signals += [stream(run.channels, stage, rig.r_drum) for stage in STAGES]
    rows = zip(windows.tolist(), known, *_means(run, signals, windows), strict=True)
    return _of_cycles(
        spans,
        (PlateauSummary(a, b, flat if speed is None else speed, *rest) for (a, b), flat, speed, *rest in rows),
    )


def _holds(run: Run, spans: Sequence[Span | None]) -> list[HoldSummary | None]:
    windows = _windows(spans)
    columns = _means(run, [_channel(run, name) for name in ("force", "torque", "pressure")], windows)
    rows = zip(windows.tolist(), *columns, strict=True)
    return _of_cycles(spans, (HoldSummary(end - begin, *rest) for (begin, end), *rest in rows))


def _haul_ins(run: Run, v_smooth: Signal, spans: Sequence[Span | None], rig: Rig) -> list[HaulInSummary | None]:
    windows = _windows(spans)
    top = -extremes(run.t, v_smooth, windows)[0]
    force, line = run.channels.get("force"), stream(run.channels, "line", rig.r_drum)
    nothing: list[float | None] = [None] * len(windows)
    columns = [
        _means(run, [_channel(run, "force")], windows)[0],
        nothing if force is None else extremes(run.t, force, windows)[0].tolist(),
        nothing if line is None else integrals(run.t, line, windows).tolist(),
    ]
    rows = zip(windows.tolist(), top.tolist(), *columns, strict=True)
    return _of_cycles(spans, (HaulInSummary(end - begin, speed, *rest) for (begin, end), speed, *rest in rows))
