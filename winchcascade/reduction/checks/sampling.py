"""Whether a log is sampled finely enough for its motion: the reduction is repeated on every second and every third sample.

Trapezoids and interpolated instants err by the square of the sampling interval where the motion is smooth. So the change from
the log to every second sample is three times the error of the log itself (Richardson), that to every third sample eight times.
Where the samples are so far apart that the start of the motion is a kink between two of them, the interpolated onset errs in
proportion to the interval: the changes are then once and twice the error of the log.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import integrals, median, quantile
from winchcascade.core.run import Finding
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.energies import STAGES, sources, stream
from winchcascade.reduction.phased_run import find_phases
from winchcascade.reduction.windows import SHORTEST, find_windows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.energies import Energies
    from winchcascade.reduction.phased_run import PhasedRun
    from winchcascade.reduction.phases import Cycle

THINNED = ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2))
"""Steps and first samples of the thinned logs: every phase of every second and every third sample."""

FINE = 12
"""Samples within the smoothing width, and between onset and plateau, from which sampling is fine enough without a look: errors
of trapezoids and interpolated instants are then below 0.1 % of an energy."""

SMOOTHED = 5
"""Samples that a local quadratic needs to smooth: through three it passes exactly."""

KINKED = 3
"""Fewer sampling intervals within the smoothing width smooth nothing, and the error of the onset is of first order."""

REPORTED = 0.005
"""Error of an energy of a cycle from which coarse sampling is reported. [1]"""


HELD = 0.9
"""Share of the steps of a channel that must be equally far apart, for one that is updated more slowly than it is logged. [1]"""

FEWEST = 8
"""Fewer steps show no interval."""

COARSE_STEP = 3.0
"""Steps of a channel that is held are mostly larger than so many of its smallest: those of a coarse resolution are not."""

BENT = 3.0
"""A channel that was interpolated bends by more than so many of its usual bends at each of its values,"""

CLEARLY = 6.0
"""and by so many at half of them: a bend is a second difference, the usual one the 70 % quantile of all."""

ROUNDING = 1e-6
"""Bends below this share of the largest are of rounding. [1]"""

FEWEST_STRAIGHT = 4
"""Fewer intervals between its values show no interpolation."""

LEAST_INTERVAL = 4
"""Samples of the shortest interval that is told from the corners of a motion."""


class Sampling(msgspec.Struct, frozen=True):
    """What thinning changes of each stage's energy in each cycle [J], by the phase that changes the means most; findings."""

    changes: Mapping[str, tuple[float, ...]]
    findings: tuple[Finding, ...]


def check_sampling(phased: PhasedRun, energies: Energies) -> Sampling:
    """Repeat a reduction on thinned logs, unless the sampling is clearly fine.

    Parameters
    ----------
    energies : of the log as it is, with its windows
    """
    run, rig, cycles = phased.run, phased.rig, phased.cycles
    whole = np.array([w.fault is None for w in energies.windows], dtype=bool)
    if not whole.any():
        return Sampling({}, _no_window(phased, energies))
    held = _held_channels(phased, energies)
    if _clearly_fine(phased):
        return Sampling({}, held)
    changes = {s: c[:, whole] for s, c in thinned_changes(phased, energies).items()}
    if run.open_circuit:
        changes.pop("gen", None)  # no current flows, so that any of it is a large share
    if not changes:
        return Sampling({}, held)
    error = max(_own_error(change, rig.thresholds.smoothing * run.fs) for change in changes.values())
    largest = int(
        np.argmax([max(abs(np.nan_to_num(c[row], nan=-1.0).mean()) for c in changes.values()) for row in range(5)])
    )
    joules = {}
    for stage, change in changes.items():
        changed = np.zeros(len(cycles))
        changed[whole] = np.nan_to_num(change[largest], nan=-1.0)
        joules[stage] = tuple((changed * np.array(energies.joules[stage])).tolist())
    if error < REPORTED:
        return Sampling(joules, held)
    most = max(float(np.max(np.abs(np.nan_to_num(c, nan=-1.0)))) for c in changes.values())
    onsets = [c.onset for c, w in zip(cycles, whole, strict=True) if w]
    return Sampling(
        joules,
        (
            *held,
            Finding(
                "coarse_sampling",
                f"{run.fs:.3g} Hz is too coarse for this motion: every second or third sample alone changes an energy of a "
                f"cycle by up to {most:.1%}, so that the log itself may err by {min(error, most):.1%}",
                "reported and part of the uncertainty; log faster, or use the window payout",
                start=min(onsets),
                end=max(w.cutoff for w in energies.windows if w.fault is None),
                count=len(onsets),
            ),
        ),
    )


def _no_window(phased: PhasedRun, energies: Energies) -> tuple[Finding, ...]:
    """No window of a log is whole: that is due to the sampling where samples are farther apart than the smoothing is wide."""
    windows, run = energies.windows, phased.run
    short = [w for w in windows if (w.cutoff - w.onset) * run.fs < SHORTEST]
    if not short or run.fs * phased.rig.thresholds.smoothing >= 1.0:
        return ()
    return (
        Finding(
            "coarse_sampling",
            f"{run.fs:.3g} Hz is too coarse for this motion: {len(short)} of {len(windows)} windows are shorter than "
            f"{SHORTEST:g} sampling intervals, and payouts may lie between two samples",
            "no energy is computed; log faster, or use the window payout",
            start=short[0].onset,
            end=short[-1].cutoff,
            count=len(short),
        ),
    )


def _held_channels(phased: PhasedRun, energies: Energies) -> tuple[Finding, ...]:
    """Channels that keep their value for several samples while the line pays out, or that are straight between slower values.

    A held channel is late by half of the interval on average. A velocity that is straight begins a payout too early, by a
    quarter of it; of another channel the curvature of the ramp is lost.
    """
    run, both = phased.run, zip(phased.cycles, phased.plateaus, strict=True)
    ramps = [(k, c, p) for k, (c, p) in enumerate(both) if p and not c.begins_inside]
    if not ramps:
        return ()
    k, cycle, plateau = ramps[len(ramps) // 2]
    rows = phased.rows(cycle.onset, plateau.braking)
    found: list[Finding] = []
    for stage in STAGES:
        watts, joules = stream(run.channels, stage, phased.rig.r_drum), energies.joules[stage]
        if watts is None or joules is None or joules[k] <= NOTHING or (stage == "gen" and run.open_circuit):
            continue
        end = np.searchsorted(run.t, energies.windows[k].cutoff)
        power = float(watts(slice(max(int(end) - 1, 0), int(end) + 1)).mean())
        for name in sources(run.channels, stage):
            late, how = _recorded_late(run.channels[name][rows], name, run.fs, plateau.begin - cycle.onset)
            share = late * power / joules[k]
            if share >= REPORTED and name not in {f.channel for f in found}:
                message = f"{name} is {how}; energies of {name} may err by {share:.1%}"
                action = "reported and kept; log it with every sample"
                found.append(Finding("coarse_sampling", message, action, name, cycle.onset, cycle.payout_end))
    return tuple(found)


def _recorded_late(x: Signal, name: str, fs: float, ramp: float) -> tuple[float, str]:
    """By how much a channel is late that changes more slowly than it is logged, 0 for one that does not, and how it does. [s]

    Parameters
    ----------
    fs : sampling rate [Hz]
    ramp : time from the onset to the plateau [s]
    """
    every = _update_interval(x)
    if every > 1:
        late = 0.5 * (every - 1) / fs
        said = (
            f"updated every {every} samples ({every / fs:.2g} s) and held in between, so that it is {late:.2g} s late"
        )
        return late, f"{said} on average"
    every = _straight_interval(x)
    h = every / fs
    late = 0.25 * h if name == "velocity" else h * h / (12.0 * max(ramp, h))
    return late if every > 1 else 0.0, (
        f"straight between values that lie {every} samples ({h:.2g} s) apart, as if interpolated from a slower log, which has "
        f"the effect of up to {late:.2g} s"
    )


def _update_interval(x: Signal) -> int:
    """Samples from one update of a channel to the next, 1 for one that is updated with every sample."""
    step = np.diff(x)
    if 2 * np.count_nonzero(step) > 1.2 * step.size:
        return 1
    at = np.flatnonzero(step)
    apart = np.diff(at)
    if apart.size < FEWEST:
        return 1
    every = int(median(apart.astype(np.float64)))
    size = np.abs(step[at])
    regular = np.count_nonzero(apart % every == 0) >= HELD * apart.size
    return every if regular and median(size) > COARSE_STEP * float(size.min()) else 1


def _straight_interval(x: Signal) -> int:
    """Samples between the values of a channel that was interpolated by straight lines, 1 for one that was not."""
    if x.size < LEAST_INTERVAL * FEWEST_STRAIGHT or 2 * np.count_nonzero(np.diff(x)) <= 1.2 * (x.size - 1):
        return 1
    bend = np.abs(np.diff(x, 2))
    usual = max(quantile(bend, 0.7), ROUNDING * float(bend.max()))
    at = np.flatnonzero(bend > BENT * usual)
    if at.size == 0 or np.sum(bend[at] ** 2) < HELD * np.sum(bend**2) or median(bend[at]) < CLEARLY * usual:
        return 1
    apart = np.diff(at)
    apart = apart[apart > 1]  # a value between two samples bends at both
    if apart.size < FEWEST_STRAIGHT:
        return 1
    every = median(apart.astype(np.float64))
    uneven = np.abs(apart - every * np.maximum(np.round(apart / every), 1.0)) > 1.0
    return round(every) if every >= LEAST_INTERVAL and np.count_nonzero(uneven) <= (1.0 - HELD) * apart.size else 1


def _clearly_fine(phased: PhasedRun) -> bool:
    """Whether enough samples lie within the smoothing width and within each ramp, or half of a payout without a plateau."""
    ramps = [
        0.5 * (c.payout_end - c.onset) if p is None else p.begin - c.onset
        for c, p in zip(phased.cycles, phased.plateaus, strict=True)
        if not c.begins_inside
    ]
    return phased.run.fs * min([phased.rig.thresholds.smoothing, *ramps]) > FINE - 0.5


def _own_error(change: Signal, within: float) -> float:
    """Error of an energy of a cycle of the log itself, from its changes on thinned logs, (5, k). [1]

    Where the log is smoothed, thinning takes away the smoothing too, and Richardson's extrapolation is taken for all of the
    change, root mean square over the cycles. Where it is not, only for what the cycles share: by what they differ noise errs,
    as much in the log as in a thinned one. What the two phases differ by is of a higher order, an eighth in the log.
    Below `KINKED` sampling intervals the error is taken as of first order.

    Parameters
    ----------
    within : samples within the smoothing width
    """
    second, third = change[:2], change[2:]
    if np.isnan(second).all(axis=0).any():
        return 1.0
    twice = np.nanmean(second, axis=0)
    thrice = np.nanmean(np.where(np.isnan(third).all(axis=0), 0.0, third), axis=0)
    by_second, by_third = (1.0, 2.0) if within < KINKED else (3.0, 8.0)
    error = float(max(np.sqrt(np.mean(twice**2)) / by_second, np.sqrt(np.mean(thrice**2)) / by_third))
    if within < SMOOTHED:
        shared = float(twice.mean())
        apart = 0.5 * float(np.max(np.nanmax(second, axis=0) - np.nanmin(second, axis=0)))
        error = max(error, abs(shared) / 3.0 + float(np.max(np.abs(twice - shared))), apart / 8.0)
    return error


def thinned_changes(phased: PhasedRun, energies: Energies) -> dict[str, Signal]:
    """Relative change of each stage's energy in each cycle on each thinned log, (5, k); NaN where a cycle is not found."""
    known = {stage: np.array(found) for stage in STAGES if (found := energies.joules[stage]) is not None}
    changes = {stage: np.full((len(THINNED), len(phased.cycles)), np.nan) for stage in known}
    for row, (step, first) in enumerate(THINNED):
        thinned = find_phases(_thinned(phased.run, step, first), phased.rig, phased.rule)
        joules, cycle = _energies_of(thinned, phased.cycles)
        for stage, joule in joules.items():
            into = known[stage][cycle]
            changes[stage][row, cycle] = (joule - into) / np.maximum(np.abs(into), NOTHING)
    return changes


def _thinned(run: Run, step: int, first: int) -> Run:
    """Every so-manyth sample of a log, from one of its first on."""
    return msgspec.structs.replace(
        run,
        t=run.t[first::step],
        channels={name: x[first::step] for name, x in run.channels.items()},
        fs=run.fs / step,
        samples=run.samples // step,
    )


def _energies_of(thinned: PhasedRun, wanted: Sequence[Cycle]) -> tuple[Mapping[str, Signal], NDArray[np.intp]]:
    """Energies of the stages in those cycles of a thinned log that are cycles of the whole one, and which these are."""
    run, windows = thinned.run, find_windows(thinned)
    spans = np.array([(w.onset, w.cutoff) for w in windows]).reshape(-1, 2)
    middles = np.array([0.5 * (c.onset + c.payout_end) for c in wanted])
    begin, end = np.array([(c.onset, c.payout_end) for c in thinned.cycles]).reshape(-1, 2).T
    at = np.searchsorted(begin, middles) - 1
    same = (at >= 0) & (middles <= end[np.maximum(at, 0)]) if begin.size else np.zeros(middles.size, dtype=bool)
    same[same] &= np.array([windows[k].fault is None for k in at[same]], dtype=bool)
    watts = {stage: stream(run.channels, stage, thinned.rig.r_drum) for stage in STAGES}
    joules = {s: integrals(run.t, w, spans)[at[same]] for s, w in watts.items() if w is not None}
    return joules, np.flatnonzero(same)
