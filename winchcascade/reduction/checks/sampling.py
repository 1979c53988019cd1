"""Whether a log is sampled finely enough for its motion, in time and in the steps of its channels.

The reduction is repeated on every second and every third sample. Trapezoids and interpolated instants err by the square of the
sampling interval where the motion is smooth. So the change from the log to every second sample is three times the error of the
log itself (Richardson), that to every third sample eight times. Where the samples are so far apart that the start of the
motion is a kink between two of them, the interpolated onset errs in proportion to the interval: the changes are then once and
twice the error of the log.

A logger that rounds errs by up to half a step where the noise of a channel is smaller than that; larger noise averages out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import msgspec
import numpy as np

from winchcascade.core.cascade import ELECTRICAL
from winchcascade.core.integrate import integrals, median, quantile, white_noise
from winchcascade.core.run import Signal
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, REPORTED, Fault, PhasedLog
from winchcascade.reduction.efficiency import NOTHING, ratio, runs_idle
from winchcascade.reduction.energies import Energies
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phased_run import SHORTEST, PhasedRun, find_phases, find_windows

THINNED = ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2))
"""Steps and first samples of the thinned logs: every phase of every second and every third sample."""

FINE = 12
"""Number of samples within the smoothing width, and between onset and plateau, from which sampling needs no check: errors
of trapezoids and interpolated instants are then below 0.1 % of an energy."""

KINKED = 3
"""Fewer sampling intervals within the smoothing width smooth nothing, and the error of the onset is of first order."""

SMOOTHED = 5
"""Number of samples that a local quadratic needs to smooth: through three it passes exactly."""

EVENLY = 0.9
"""Share of the changes, by number and by square, that lie evenly apart in a channel that is slower than its log. [1]"""

STRAIGHT = 4
"""Shortest interval between values of an interpolated channel that is distinguished from the corners of a motion. [samples]"""

DITHERED = 0.5
"""Noise in steps of a channel from which rounding averages out, to less than 1 % of a step (Widrow). [1]"""

OF_ONSET = 0.5
"""Step of the velocity over the threshold of the onset from which it is reported: the onset then lies between two steps. [1]"""


def thinned_changes(phased: PhasedRun, energies: Energies) -> dict[str, Signal]:
    """Relative change of each stage's energy in each cycle on each thinned log, (5, k); NaN where a cycle is not found.

    Nothing where the sampling is clearly fine: enough samples lie within the smoothing width and within each ramp, or half of a
    payout without a plateau.
    """
    run, rig = phased.run, phased.rig
    ramps = [
        0.5 * (c.payout_end - c.onset) if p is None else p.begin - c.onset
        for c, p in zip(phased.cycles, phased.plateaus, strict=True)
        if not c.begins_inside
    ]
    whole = [w.fault is None for w in energies.windows]
    if not rig.phases.by_motion or not any(whole) or run.fs * min([rig.thresholds.smoothing, *ramps]) > FINE - 0.5:
        return {}
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
    if run.open_circuit:
        changes.pop("gen", None)  # no current flows, so that any of it is a large share
    return {stage: change[:, whole] for stage, change in changes.items()}


def sampled(changes: Mapping[str, Signal], energies: Energies) -> dict[str, tuple[float, ...]]:
    """What thinning changes of each stage's energy in each cycle, by the thinned log that changes the means most. [J]"""
    if not changes:
        return {}
    filled = {s: np.nan_to_num(change, nan=-1.0) for s, change in changes.items()}
    most = int(np.argmax(np.max([np.abs(c.mean(axis=1)) for c in filled.values()], axis=0)))
    joules = {}
    for stage, change in filled.items():
        changed = np.zeros(len(energies.windows))
        changed[[w.fault is None for w in energies.windows]] = change[most]
        joules[stage] = tuple((changed * np.array(energies.joules[stage])).tolist())
    return joules


def coarse_sampling(log: PhasedLog) -> Iterator[Fault]:
    """A log whose own error, by its changes on thinned logs, is too large, and one with payouts between two samples.

    The error is the root mean square over the cycles of the mean of the thinned logs of a kind.
    """
    run, windows = log.phased.run, log.energies.windows
    within = run.fs * log.phased.rig.thresholds.smoothing
    whole = [(w.onset, w.cutoff) for w in windows if w.fault is None]
    if not whole and within < 1.0:
        short = [(w.onset, w.cutoff) for w in windows if (w.cutoff - w.onset) * run.fs < SHORTEST]
        if short:
            yield Fault("no_window", None, {"rate": run.fs, "all": len(windows), "shortest": SHORTEST}, spans=short)
    by_second, by_third = (1.0, 2.0) if within < KINKED else (3.0, 8.0)
    error = extreme = 0.0
    for change in log.thinned.values():
        extreme = max(extreme, float(np.max(np.abs(np.nan_to_num(change, nan=-1.0)))))
        for part, over in ((change[:2], by_second), (change[2:], by_third)):
            lost = np.isnan(part).all(axis=0)
            some = np.where(lost, 0.0, part)
            mean = np.nanmean(some, axis=0)
            error = max(error, 1.0 if over == by_second and lost.any() else float(np.sqrt(np.mean(mean**2))) / over)
            if (
                within < SMOOTHED and over == by_second
            ):  # what cycles do not share is noise, of this log as of the thinned one
                shared, apart = float(mean.mean()), float(np.max(np.nanmax(some, axis=0) - np.nanmin(some, axis=0)))
                error = max(
                    error, abs(shared) / 3.0 + float(np.max(np.abs(mean - shared))) / math.sqrt(2.0), apart / 16.0
                )
    if error >= REPORTED:
        yield Fault(
            "coarse_sampling", None, {"rate": run.fs, "extreme": extreme, "error": min(error, extreme)}, spans=whole
        )


def slow_channel(log: PhasedLog) -> Iterator[Fault]:
    """Channels that keep their value for several samples while the line pays out, or that are straight between slower values.

    A held channel is late by half of the interval on average. A velocity that is straight begins a payout too early, by a
    quarter of it; of another channel the curvature of the ramp is lost.
    """
    phased, run, r_drum = log.phased, log.phased.run, log.phased.rig.r_drum
    ramps = [
        (k, c, p)
        for k, (c, p) in enumerate(zip(phased.cycles, phased.plateaus, strict=True))
        if p and not c.begins_inside
    ]
    if not ramps:
        return
    k, cycle, plateau = ramps[len(ramps) // 2]
    rows, ramp = phased.rows(cycle.onset, plateau.braking), plateau.begin - cycle.onset
    end, reported = int(np.searchsorted(run.t, log.energies.windows[k].cutoff)), set()
    for stage in phased.rig.cascade.stages:
        product, watts, joules = (
            stage.power(run.channels, r_drum),
            stage.stream(run.channels, r_drum),
            log.energies.joules[stage.name],
        )
        if product is None or watts is None or joules is None or joules[k] <= NOTHING:
            continue
        if run.open_circuit and stage.name in ELECTRICAL:
            continue
        power = float(watts(slice(max(end - 1, 0), end + 1)).mean())
        for name in [name for name in dict.fromkeys(product.channels) if name not in reported]:
            x = run.channels[name][rows]
            held, between = update_interval(np.diff(x)), update_interval(np.diff(x, 2))
            h, name_of_fault = held / run.fs, "held"
            seconds = 0.5 * (held - 1) / run.fs
            if held == 1 and between >= STRAIGHT:
                h, name_of_fault = between / run.fs, "straight"
                seconds = 0.25 * h if name == "velocity" else h * h / (12.0 * max(ramp, h))
            share = seconds * power / joules[k]
            if share >= REPORTED:
                reported.add(name)
                values = {"every": round(h * run.fs), "interval": h, "late": seconds, "share": share}
                yield Fault(name_of_fault, name, values, spans=[(cycle.onset, cycle.payout_end)])


def update_interval(change: Signal) -> int:
    """Samples between the changes of a channel, or of its slope; 1 where they do not lie evenly apart. [samples]

    >>> update_interval(np.tile([0.0, 0.0, 1.0], 20))
    3
    """
    size = np.abs(change)
    if size.size < MIN_COMPARED or not size.any():
        return 1
    at = np.flatnonzero(size > max(6.0 * quantile(size, 0.4), 1e-6 * float(size.max())))
    apart = np.diff(at).astype(np.float64)
    steady = 2 * np.count_nonzero(apart == 1.0) > 1.2 * apart.size
    apart = apart[apart > 1.0]  # a value between two samples bends twice
    if steady or apart.size < STRAIGHT or np.sum(size[at] ** 2) < EVENLY * np.sum(size**2):
        return 1
    every = median(apart)
    uneven = np.abs(apart - every * np.maximum(np.round(apart / every), 1.0)) > (1.0 if every >= STRAIGHT else 0.0)
    return round(every) if np.count_nonzero(uneven) <= (1.0 - EVENLY) * apart.size else 1


def coarse_resolution(log: PhasedLog) -> Iterator[Fault]:
    """Channels whose step is coarse for an energy that is evaluated; in open circuit Vdc and Idc are in none.

    The mean of a channel is weighted by the other factor of its power: an error divided by it is the share of the energy that
    the error changes.
    """
    phased, run, joules, windows = log.phased, log.phased.run, log.energies.joules, log.energies.windows
    chosen = [phased.rows(w.onset, w.cutoff) for k in phased.chosen() if (w := windows[k]).fault is None]
    of = joules.get("gen") or (), joules.get("line") or ()
    idle = run.open_circuit or runs_idle([ratio(gen, line) for gen, line in zip(*of, strict=False)])
    levels: dict[str, float] = {}
    for stage in phased.rig.cascade.stages if chosen and not run.simulated else ():
        product = stage.power(run.channels, phased.rig.r_drum)
        if product is None or max(joules[stage.name] or [0.0]) <= NOTHING or (stage.name in ELECTRICAL and idle):
            continue
        for name, other in [
            both for term in product.terms for both in zip(term.channels, term.channels[::-1], strict=True)
        ]:
            x, weight = run.channels[name], run.channels[other] if other != name else np.ones(run.t.size)
            of_windows = [abs(float(x[r] @ weight[r])) / max(float(np.abs(weight[r]).sum()), NOTHING) for r in chosen]
            levels[name] = min(median(np.array(of_windows)), levels.get(name, math.inf))
    for name, level in levels.items():
        by_onset = OF_ONSET * phased.rig.thresholds.v_onset if name == "velocity" else math.inf
        step = recorded_step(phased, name, min(2.0 * REPORTED * level, by_onset))
        if 2.0 * REPORTED * level < step < 1e9 * level or step >= by_onset:
            moves = "; the onset moves too, which may raise or lower them" if step >= by_onset else ""
            values = {"share": step / level, "error": 0.5 * step / level, "moves": moves}
            yield Fault("coarse_resolution", name, values, {"step": step})


def recorded_step(phased: PhasedRun, name: str, minimum: float) -> float:
    """Step in which a channel is recorded in payouts, 0 where it has none, one below `minimum`, or noise beyond it.

    The step explains nearly all changes between the samples that were logged, so that a bridged or repaired value does not pass
    for a fine resolution. A channel that holds two values, as a friction or a brake does, has none. [SI unit of the channel]
    """
    t, x = phased.run.t, phased.run.channels[name]
    payouts = [phased.rows(phased.cycles[k].onset, phased.cycles[k].payout_end) for k in phased.chosen()]
    logged = np.ones(t.size, dtype=bool)
    for begin, end in all_gaps(phased.run, (name,)):
        logged &= (t <= begin) | (t >= end)
    courses = [x[rows][logged[rows]] for rows in payouts]
    every = np.concatenate([np.diff(course) for course in courses])
    changes = np.abs(every[every != 0.0])
    changes = changes[changes > 1e-9 * float(np.max(np.abs(x)))]
    if changes.size < MIN_COMPARED // 2 or 1.4 * (small := float(np.sort(changes)[int(0.05 * changes.size)])) < minimum:
        return 0.0
    step = float(np.mean(changes[(changes > 0.7 * small) & (changes < 1.4 * small)]))
    few = changes[changes < 4.5 * step] / step  # of more steps, the error of the step is too large
    multiple = (np.abs(few - np.round(few)) < 0.2) & (few > 0.5)
    alike = np.abs(np.diff(every)) < 0.2 * step
    straight = np.count_nonzero(alike & (np.abs(every[1:]) > 0.5 * step)) > 0.85 * few.size
    two_values = np.count_nonzero(np.unique(np.concatenate(courses), return_counts=True)[1] > 0.01 * every.size) <= 2
    noisy = white_noise(max(courses, key=len)) > DITHERED * step
    return 0.0 if np.mean(multiple) < 0.95 or straight or two_values or noisy else step
