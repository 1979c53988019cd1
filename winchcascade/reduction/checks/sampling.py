"""Whether a log is sampled finely enough for its motion, in time and in the steps of its channels.

The reduction is repeated on every second and every third sample. Trapezoids and interpolated
instants err by the square of the sampling interval where the motion is smooth: the change from the
log to every second sample is three times the error of the log itself, that to every third sample
eight times (Richardson). What the phases of the thinned logs and the cycles do not share is no
error of the mean.

A logger that rounds errs by up to half a step where the noise of a channel is smaller than that;
larger noise averages out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import msgspec
import numpy as np

from winchcascade.core.integrate import ENOUGH, distinct, integrals, median, quantile, white_noise
from winchcascade.core.run import Signal
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, REPORTED, Fault, PhasedLog
from winchcascade.reduction.efficiency import SMALLEST
from winchcascade.reduction.efficiency_changes import REPEATABILITY
from winchcascade.reduction.energies import Energies
from winchcascade.reduction.phased_run import PhasedRun, find_phases, find_windows

THINNED = ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2))
"""Steps and first samples of the thinned logs: every phase of every second and every third
sample.
"""

FINE = 12
"""Number of samples within the smoothing width, and between onset and plateau, from which sampling
needs no check: errors of trapezoids and interpolated instants are then below 0.1 % of an energy."""

EVENLY = 0.9
"""Share of the changes that lie evenly apart in a channel that is slower than its log. [1]"""

DITHERED = 0.5
"""Noise in steps of a channel from which rounding averages out, to less than 1 % of a step
(Widrow). [1]
"""

OF_ONSET = 0.5
"""Step of the velocity over the threshold of the onset from which it is reported: the onset then
lies between two steps. [1]
"""


def thinned_changes(phased: PhasedRun, energies: Energies) -> dict[str, Signal]:
    """Relative change of each stage's energy in each cycle on each thinned log, (5, k); NaN where a
    cycle is not found.

    Nothing where the sampling is clearly fine: enough samples lie within the smoothing width and
    within each ramp, or half of a payout without a plateau.
    """
    run, rig, cycles = phased.run, phased.rig, phased.cycles
    ramps = [
        0.5 * (c.payout_end - c.onset) if p is None else p.begin - c.onset
        for c, p in zip(cycles, phased.plateaus, strict=True)
        if not c.begins_inside
    ]
    whole = [w.fault is None for w in energies.windows]
    if (
        not rig.phases.by_motion
        or not any(whole)
        or run.fs * min([rig.thresholds.smoothing, *ramps]) > FINE - 0.5
    ):
        return {}
    streams = {
        stage.name: stage.stream
        for stage in rig.cascade.stages
        if energies.joules[stage.name] is not None
    }
    changes = {stage: np.full((len(THINNED), len(cycles)), np.nan) for stage in streams}
    middles = np.array([0.5 * (c.onset + c.payout_end) for c in cycles])
    for row, (step, first) in enumerate(THINNED):
        t, channels = run.t[first::step], {name: x[first::step] for name, x in run.channels.items()}
        some = msgspec.structs.replace(
            run, t=t, channels=channels, fs=run.fs / step, samples=run.samples // step
        )
        thinned = find_phases(some, rig, phased.rule)
        for cycle, window in zip(thinned.cycles, find_windows(thinned), strict=True):
            same = np.flatnonzero(
                (middles > cycle.onset) & (middles <= cycle.payout_end) & (window.fault is None)
            )
            for stage, stream in streams.items():
                if same.size and (watts := stream(channels, rig.r_drum)) is not None:
                    into = np.array(energies.joules[stage])[same]
                    changed = integrals(t, watts, np.array([[window.onset, window.cutoff]])) - into
                    changes[stage][row, same] = changed / np.maximum(np.abs(into), energies.nothing)
    if run.open_circuit:
        changes.pop("gen", None)  # no current flows, so that any of it is a large share
    return {stage: change[:, whole] for stage, change in changes.items()}


def sampled(changes: Mapping[str, Signal], energies: Energies) -> dict[str, tuple[float, ...]]:
    """What thinning changes of each stage's energy in each cycle, by the thinned log that
    changes the means most. [J]
    """
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
    """A log whose energy of a stage errs too much by its changes on thinned logs, all of it where
    these lose a cycle.

    Each cycle of each thinned log gives the error of the log itself. A window that one of them puts
    elsewhere, as noise near a limit does, is no error of the sampling: the median leaves it out.
    """
    error, of_log = 0.0, np.array([step**2 - 1.0 for step, _ in THINNED])[:, None]
    for change in log.thinned.values():
        found = np.isfinite(change)
        lost = not found[:2].any(axis=0).all()
        error = max(error, 1.0 if lost else abs(median((change / of_log)[found])))
    if error >= REPEATABILITY:  # smaller ones hide in it
        spans = [(cycle.window.onset, cycle.window.cutoff) for cycle in log.complete]
        yield Fault("coarse_sampling", None, spans, {"rate": log.run.fs, "error": error})


def held_channels(log: PhasedLog) -> Iterator[Fault]:
    """Channels that keep their value for several samples while the line pays out: late by half
    of the interval on average.
    """
    phased, run, reported = log.phased, log.run, set[str]()
    ramps = [k for k, p in enumerate(phased.plateaus) if p and not phased.cycles[k].begins_inside]
    if not ramps:
        return
    k = ramps[len(ramps) // 2]
    cycle, end = phased.cycles[k], int(np.searchsorted(run.t, log.energies.windows[k].cutoff))
    for stage, power in log.powers.items():
        watts = float(
            power.stream(run.channels, log.rig.r_drum)(slice(max(end - 1, 0), end + 1)).mean()
        )
        joules = (log.energies.joules[stage] or [0.0])[k]
        for name in power.channels:
            every = update_interval(run.channels[name][phased.rows(cycle.onset, cycle.payout_end)])
            late = 0.5 * (every - 1) / run.fs
            if (
                joules > log.energies.nothing
                and late * watts / joules >= REPORTED
                and name not in reported
            ):
                reported.add(name)
                values = {
                    "every": every,
                    "interval": every / run.fs,
                    "late": late,
                    "error": late * watts / joules,
                }
                yield Fault("held", name, [(cycle.onset, cycle.payout_end)], values)


def update_interval(x: Signal) -> int:
    """Samples between the changes of a channel; 1 where they do not lie evenly apart. [samples]

    >>> update_interval(np.repeat(np.arange(20.0), 3))
    3
    """
    at = np.flatnonzero(np.diff(x))
    if x.size < MIN_COMPARED or not 1 < at.size <= 0.6 * x.size:
        return 1
    apart = np.diff(at).astype(np.float64)
    every = median(apart)
    uneven = np.abs(apart - every * np.maximum(np.round(apart / every), 1.0)) > (
        1.0 if every > 3.0 else 0.0
    )
    return round(every) if np.mean(uneven) <= 1.0 - EVENLY else 1


def coarse_resolution(log: PhasedLog) -> Iterator[Fault]:
    """Channels whose step is coarse for an energy that counts: half a step changes it by the
    other factor of the power.
    """
    windows, errors = [(c.window.onset, c.window.cutoff) for c in log.complete], dict[str, float]()
    payouts = [
        (log.phased.cycles[k].onset, log.phased.cycles[k].payout_end) for k in log.phased.chosen()
    ]
    for power in log.powers.values() if windows and not log.run.simulated else ():
        logged = {name: log.samples(name, windows) for name in power.channels}
        watts = abs(float(power.stream(logged, log.rig.r_drum)(slice(None)).mean()))
        for term in power.terms:
            for name, other in zip(term.channels, term.channels[::-1], strict=True):
                weight = float(np.abs(logged[other]).mean()) if other != name else 1.0
                share = 0.5 * abs(term.scale(log.rig.r_drum)) * weight / max(watts, SMALLEST)
                errors[name] = max(errors.get(name, 0.0), share)
    for name, per_step in errors.items():
        onset = OF_ONSET * log.rig.thresholds.v_onset if name == "velocity" else math.inf
        step = recorded_step(
            log.samples(name, payouts), min(REPORTED / max(per_step, SMALLEST), onset)
        )
        if step and per_step * step < 1e9:
            yield Fault("coarse_resolution", name, (), {"step": step, "error": per_step * step})


def recorded_step(x: Signal, least: float) -> float:
    """Step in which a channel is recorded, 0 where it has none, one below the least, or noise
    beyond it. [SI unit]

    Values that a logger rounds repeat; a bridged or repaired value does not pass for a fine
    resolution. A channel that holds two values, as a friction or a brake does, or changes a few
    times, has none.
    """
    x = x[:ENOUGH]
    changes = np.abs(np.diff(x))
    changes = changes[changes > 0.0]
    if changes.size < MIN_COMPARED // 2 or (step := quantile(changes, 0.05)) < least:
        return 0.0
    coarse = white_noise(x) <= DITHERED * step and 2 < distinct(x).size <= 0.5 * x.size
    return step if coarse else 0.0
