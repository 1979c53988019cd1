"""Whether a log is sampled finely enough for its motion, in time and in the steps of its channels.

The reduction is repeated on every second and every third sample. Trapezoids and interpolated instants err by the square of the
sampling interval where the motion is smooth. So the change from the log to every second sample is three times the error of the
log itself (Richardson), that to every third sample eight times. Where the samples are so far apart that the start of the
motion is a kink between two of them, the interpolated onset errs in proportion to the interval: the changes are then once and
twice the error of the log.

A logger that truncates records every value too low by half a step on average. One that rounds deviates by less, but by up to
half a step where the noise is smaller than the step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache

import msgspec
import numpy as np

from winchcascade.core.cascade import ELECTRICAL
from winchcascade.core.integrate import integrals, largest, median, quantile
from winchcascade.core.run import Finding, Run, Signal
from winchcascade.ingest.checks.channel_findings import text_of
from winchcascade.reduction.efficiency import NOTHING, ratio, runs_idle
from winchcascade.reduction.energies import Energies
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phased_run import SHORTEST, PhasedRun, Window, find_phases, find_windows

THINNED = ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2))
"""Steps and first samples of the thinned logs: every phase of every second and every third sample."""

FINE = 12
"""Number of samples within the smoothing width, and between onset and plateau, from which sampling needs no check: errors
of trapezoids and interpolated instants are then below 0.1 % of an energy."""

SMOOTHED = 5
"""Number of samples that a local quadratic needs to smooth: through three it passes exactly."""

KINKED = 3
"""Fewer sampling intervals within the smoothing width smooth nothing, and the error of the onset is of first order."""

REPORTED = 0.005
"""Smallest error of an energy of a cycle, by its sampling or by half a step, that is reported. [1]"""

ROUNDED = 1e-9
"""Changes below this share of the largest value are of rounding. [1]"""


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
    run, windows, smoothing = phased.run, energies.windows, phased.rig.thresholds.smoothing
    whole = np.array([w.fault is None for w in windows], dtype=bool)
    if not whole.any():  # due to the sampling where samples are farther apart than the smoothing is wide
        short = [w for w in windows if (w.cutoff - w.onset) * run.fs < SHORTEST]
        message = (
            f"{len(short)} of {len(windows)} windows are shorter than {SHORTEST:g} sampling intervals, and payouts may lie "
            f"between two samples"
        )
        coarse = bool(short) and run.fs * smoothing < 1.0
        return Sampling({}, (_too_coarse(run, message, "no energy is computed", short),) if coarse else ())
    held = _held_channels(phased, energies)
    if _clearly_fine(phased):
        return Sampling({}, held)
    changes = {s: c[:, whole] for s, c in thinned_changes(phased, energies).items()}
    if run.open_circuit:
        changes.pop("gen", None)  # no current flows, so that any of it is a large share
    if not changes:
        return Sampling({}, held)
    error = max(_own_error(change, smoothing * run.fs) for change in changes.values())
    filled = {s: np.nan_to_num(change, nan=-1.0) for s, change in changes.items()}
    largest = int(np.argmax(np.max([np.abs(c.mean(axis=1)) for c in filled.values()], axis=0)))
    joules = {}
    for stage, change in filled.items():
        changed = np.zeros(len(windows))
        changed[whole] = change[largest]
        joules[stage] = tuple((changed * np.array(energies.joules[stage])).tolist())
    extreme = max(float(np.max(np.abs(change))) for change in filled.values())
    message = (
        f"every second or third sample alone changes an energy of a cycle by up to {extreme:.1%}, so that the log itself may "
        f"err by {min(error, extreme):.1%}"
    )
    found = _too_coarse(run, message, "reported and part of the uncertainty", [w for w in windows if w.fault is None])
    return Sampling(joules, held if error < REPORTED else (*held, found))


def _too_coarse(run: Run, message: str, action: str, windows: Sequence[Window]) -> Finding:
    """The finding of a sampling that is too coarse, over some windows in order of time."""
    return Finding(
        "coarse_sampling",
        f"{run.fs:.3g} Hz is too coarse for this motion: {message}",
        f"{action}; log faster, or use the window payout",
        start=windows[0].onset,
        end=windows[-1].cutoff,
        count=len(windows),
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
    end = int(np.searchsorted(run.t, energies.windows[k].cutoff))
    found: dict[str, Finding] = {}
    r_drum = phased.rig.r_drum

    @cache
    def recorded_late(name: str) -> tuple[float, str]:
        return _recorded_late(run.channels[name][rows], name, run.fs, plateau.begin - cycle.onset)

    for stage in phased.rig.cascade.stages:
        product, watts = stage.power(run.channels, r_drum), stage.stream(run.channels, r_drum)
        joules = energies.joules[stage.name]
        if product is None or watts is None or joules is None or joules[k] <= NOTHING:
            continue
        if run.open_circuit and stage.name in ELECTRICAL:
            continue
        power = float(watts(slice(max(end - 1, 0), end + 1)).mean())
        for name in product.channels:
            late, how = recorded_late(name)
            if late * power / joules[k] >= REPORTED:
                message = f"{name} is {how}; energies of {name} may err by {late * power / joules[k]:.1%}"
                action = "reported and kept; log it with every sample"
                found.setdefault(name, Finding("coarse_sampling", message, action, name, cycle.onset, cycle.payout_end))
    return tuple(found.values())


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
        return late, (
            f"updated every {every} samples ({every / fs:.2g} s) and held in between, so that it is {late:.2g} s late on "
            f"average"
        )
    every = _straight_interval(x)
    h = every / fs
    late = 0.25 * h if name == "velocity" else h * h / (12.0 * max(ramp, h))
    return late if every > 1 else 0.0, (
        f"straight between values that lie {every} samples ({h:.2g} s) apart, as if interpolated from a slower log, which has "
        f"the effect of up to {late:.2g} s"
    )


HELD = 0.9
"""Share of the steps of a channel that must be equally far apart, for one that is updated more slowly than it is logged. [1]"""

MIN_STEPS = 8
"""Smallest number of steps that shows an interval."""

COARSE_STEP = 3.0
"""Minimum ratio of most steps of a channel that is held to its smallest step; a coarse resolution has smaller steps. [1]"""


def _update_interval(x: Signal) -> int:
    """Samples from one update of a channel to the next, 1 for one that is updated with every sample."""
    step = np.diff(x)
    at = np.flatnonzero(step)
    apart = np.diff(at)
    if 2 * at.size > 1.2 * step.size or apart.size < MIN_STEPS:
        return 1
    every = int(median(apart.astype(np.float64)))
    size = np.abs(step[at])
    regular = np.count_nonzero(apart % every == 0) >= HELD * apart.size
    return every if regular and median(size) > COARSE_STEP * float(size.min()) else 1


BENT = 3.0
"""Smallest bend of an interpolated channel at each of its values, in usual bends: 70 % quantiles of all second differences."""

CLEARLY = 6.0
"""Smallest median of these bends, in usual bends."""

ROUNDING = 1e-6
"""Bends below this share of the largest are of rounding. [1]"""

MIN_STRAIGHT = 4
"""Smallest number of intervals between its values that shows an interpolation."""

MIN_INTERVAL = 4
"""Shortest interval that is distinguished from the corners of a motion, in samples."""


def _straight_interval(x: Signal) -> int:
    """Samples between the values of a channel that was interpolated by straight lines, 1 for one that was not."""
    if x.size < MIN_INTERVAL * MIN_STRAIGHT or 2 * np.count_nonzero(np.diff(x)) <= 1.2 * (x.size - 1):
        return 1
    bend = np.abs(np.diff(x, 2))
    usual = max(quantile(bend, 0.7), ROUNDING * float(bend.max()))
    at = np.flatnonzero(bend > BENT * usual)
    if at.size == 0 or np.sum(bend[at] ** 2) < HELD * np.sum(bend**2) or median(bend[at]) < CLEARLY * usual:
        return 1
    apart = np.diff(at)
    apart = apart[apart > 1]  # a value between two samples bends at both
    if apart.size < MIN_STRAIGHT:
        return 1
    every = median(apart.astype(np.float64))
    uneven = np.abs(apart - every * np.maximum(np.round(apart / every), 1.0)) > 1.0
    return round(every) if every >= MIN_INTERVAL and np.count_nonzero(uneven) <= (1.0 - HELD) * apart.size else 1


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

    Where the log is smoothed, thinning also removes the smoothing. Richardson's extrapolation then uses the whole change, as a
    root mean square over the cycles. Where it is not smoothed, the extrapolation uses only the change that the cycles share.
    What differs between cycles is the error of noise. It is as large in the log as in a thinned log, so that the difference
    of the two is the square root of 2 of it. What differs between the two thinned logs is of a higher order; an eighth of it
    remains in the log.
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
        error = max(error, abs(shared) / 3.0 + float(np.max(np.abs(twice - shared))) / math.sqrt(2.0), apart / 8.0)
    return error


def thinned_changes(phased: PhasedRun, energies: Energies) -> dict[str, Signal]:
    """Relative change of each stage's energy in each cycle on each thinned log, (5, k); NaN where a cycle is not found."""
    run, rig = phased.run, phased.rig
    known = {s.name: np.array(joules) for s in rig.cascade.stages if (joules := energies.joules[s.name]) is not None}
    changes = {stage: np.full((len(THINNED), len(phased.cycles)), np.nan) for stage in known}
    middles = np.array([0.5 * (c.onset + c.payout_end) for c in phased.cycles])
    for row, (step, first) in enumerate(THINNED):
        t, channels = run.t[first::step], {name: x[first::step] for name, x in run.channels.items()}
        some = msgspec.structs.replace(run, t=t, channels=channels, fs=run.fs / step, samples=run.samples // step)
        thinned = find_phases(some, rig, phased.rule)
        found = [(c, w) for c, w in zip(thinned.cycles, find_windows(thinned), strict=True) if w.fault is None]
        spans = np.array([(w.onset, w.cutoff) for _, w in found]).reshape(-1, 2)
        inside = [(middles > c.onset) & (middles <= c.payout_end) for c, _ in found]
        same = [(n, k) for n, here in enumerate(inside) for k in np.flatnonzero(here).tolist()]
        at, cycle = np.array(same, dtype=np.intp).reshape(-1, 2).T
        for stage in rig.cascade.stages:
            watts = stage.stream(channels, rig.r_drum)
            if watts is not None and stage.name in known:
                into = known[stage.name]
                changed = integrals(t, watts, spans)[at] - into[cycle]
                changes[stage.name][row, cycle] = changed / np.maximum(np.abs(into[cycle]), NOTHING)
    return changes


def resolution_findings(phased: PhasedRun, energies: Energies) -> list[Finding]:
    """Report channels whose step is coarse for an energy that is evaluated; no channel is changed.

    In open circuit Vdc and Idc enter no efficiency.
    """
    run, joules = phased.run, energies.joules
    chosen = [w for k in phased.chosen() if (w := energies.windows[k]).fault is None]
    if not chosen or run.simulated:
        return []
    of = joules.get("gen") or (), joules.get("line") or ()
    delivered = [ratio(gen, line) for gen, line in zip(*of, strict=False)]
    idle = run.open_circuit or runs_idle(delivered)
    levels: dict[str, float] = {}
    for stage in phased.rig.cascade.stages:
        product = stage.power(run.channels, phased.rig.r_drum)
        evaluated = max(joules[stage.name] or [0.0]) > NOTHING and not (stage.name in ELECTRICAL and idle)
        if product is not None and evaluated:
            pairs = [pair for term in product.terms for pair in zip(term.channels, term.channels[::-1], strict=True)]
            for name, other in pairs:
                level = median(np.array([_level(phased, name, other, w) for w in chosen]))
                levels[name] = min(level, levels.get(name, math.inf))
    return [f for name, level in levels.items() if (f := _coarse(phased, name, level)) is not None]


def _level(phased: PhasedRun, name: str, other: str, window: Window) -> float:
    """Mean of a channel in a window, weighted by the other factor of its power: an error of the channel divided by it is the
    share of the energy that the error changes. [SI unit of the channel]
    """
    rows = phased.rows(window.onset, window.cutoff)
    x = phased.run.channels[name][rows]
    if name == other:
        return abs(float(x.mean()))
    weight = phased.run.channels[other][rows]
    return abs(float(x @ weight)) / max(float(np.abs(weight).sum()), NOTHING)


OF_ONSET = 0.5
"""Step of the velocity over the threshold of the onset from which it is reported: the onset then lies between two steps. [1]"""


def _coarse(phased: PhasedRun, name: str, level: float) -> Finding | None:
    """The finding of one channel, None where its step is fine."""
    by_onset = OF_ONSET * phased.rig.thresholds.v_onset if name == "velocity" else math.inf
    step = recorded_step(phased, name, min(2.0 * REPORTED * level, by_onset))
    if step == 0.0 or level <= ROUNDED * step:
        return None
    error, of_onset = 0.5 * step / level, step >= by_onset
    channel = phased.rig.known_channels[name]
    message = (
        f"{name} is recorded in steps of {text_of(channel, step, 3)} {channel.unit}, {step / level:.1%} of its mean in the "
        f"windows; if the logger truncates, energies of {name} are up to {error:.1%} too low"
    ) + ("; the onset moves too, which may raise or lower them" if of_onset else "")
    finding = Finding("coarse_resolution", message, "reported and kept; record it with more digits", name)
    return finding if error > REPORTED or of_onset else None


SWITCHED = 2
"""Number of values between which a channel switches; a channel that is recorded in steps has more."""

SELDOM = 0.01
"""Share of the samples in which such a channel may hold another value. [1]"""


def switches(x: Signal) -> bool:
    """Whether a channel holds one or two values, and others in a few samples alone, as a friction or a brake does.

    >>> switches(np.tile([-4000.0, 4000.0], 50)), switches(np.tile([1.0, 2.0, 3.0], 50))
    (True, False)
    """
    return int(np.count_nonzero(np.unique(x, return_counts=True)[1] > SELDOM * x.size)) <= SWITCHED


MIN_CHANGES = 6
"""Smallest number of changes of a channel that shows a step."""

SMALL = 0.05
"""Quantile of the changes that is taken for a single step: a few values between the steps do not hide it."""

SEVERAL = 4.5
"""Largest change that is compared with multiples of the step, in steps: of more, the error of the step is too large."""

MULTIPLE = 0.2
"""A change is a multiple of the step within this share of it: a logger may write the steps with rounded digits. [1]"""

NEARLY_ALL = 0.95
"""Share of these changes that must be multiples; of a channel without steps it is less than a half. [1]"""

STRAIGHT = 0.85
"""Share of the changes that follow an equal one, above which they are the slope of a straight ramp without noise. [1]"""


def recorded_step(phased: PhasedRun, name: str, minimum: float) -> float:
    """Step in which a channel is recorded in payouts, 0 where it has none or one below `minimum`. [SI unit of the channel]

    `smallest_step` of the ingest takes the smallest change of all. Here the step must explain nearly all changes, so that a
    bridged or repaired value does not pass for a fine resolution.
    """
    t, x, gaps = phased.run.t, phased.run.channels[name], all_gaps(phased.run, (name,))
    payouts = [phased.rows(phased.cycles[k].onset, phased.cycles[k].payout_end) for k in phased.chosen()]
    courses = [np.diff(x[rows]) for rows in payouts]
    for begin, end in gaps:  # the changes that were logged, not bridged
        outside = [(t[rows][1:] <= begin) | (t[rows][:-1] >= end) for rows in payouts]
        courses = [np.where(logged, change, np.nan) for logged, change in zip(outside, courses, strict=True)]
    courses = [change[np.isfinite(change)] for change in courses] if len(gaps) else courses
    changes = np.abs(np.concatenate(courses))
    changes = changes[changes > ROUNDED * largest(x)]
    if changes.size < MIN_CHANGES:
        return 0.0
    small = int(SMALL * changes.size)
    changes.partition(small)
    step = float(changes[small])
    if 1.4 * step < minimum:  # as of most channels
        return 0.0
    step = float(np.mean(changes[(changes > 0.7 * step) & (changes < 1.4 * step)]))
    few = changes[changes < SEVERAL * step] / step
    multiple = (np.abs(few - np.round(few)) < MULTIPLE) & (few > 0.5)
    if few.size < MIN_CHANGES or np.count_nonzero(multiple) < NEARLY_ALL * few.size:
        return 0.0
    alike = sum(
        np.count_nonzero((np.abs(np.diff(d)) < MULTIPLE * step) & (np.abs(d[1:]) > 0.5 * step)) for d in courses
    )
    return 0.0 if alike > STRAIGHT * few.size or switches(np.concatenate([x[rows] for rows in payouts])) else step
