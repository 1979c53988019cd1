"""Whether the channels of the energies are recorded in steps that are fine enough for their level.

A logger that truncates records every value too low by half a step on average. One that rounds deviates by less, but by up to
half a step where the noise is smaller than the step.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.run import CHANNELS, CLOCK, Finding
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.efficiency_changes import IDLE
from winchcascade.reduction.energies import STAGES, sources

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.reduction.energies import Energies
    from winchcascade.reduction.phased_run import PhasedRun
    from winchcascade.reduction.windows import Window

REPORTED = 0.005
"""Share of an energy that half a step may change, from which the step is reported. [1]"""

OF_ONSET = 0.5
"""Step of the velocity over the threshold of the onset from which it is reported: the onset then lies between two steps. [1]"""

ROUNDING = 1e-9
"""Changes below this share of the largest value are of rounding. [1]"""

FEWEST = 6
"""Fewer changes of a channel show no step."""

SMALL = 0.05
"""Quantile of the changes that is taken for a single step: a few values between the steps do not hide it."""

SEVERAL = 4.5
"""Only changes of up to so many steps are compared with multiples of the step: of more, its own error is too large."""

MULTIPLE = 0.2
"""A change is a multiple of the step within this share of it: a logger may write the steps with rounded digits. [1]"""

NEARLY_ALL = 0.95
"""Share of these changes that must be multiples; of a channel without steps it is less than a half. [1]"""

STRAIGHT = 0.85
"""Share of the changes that follow an equal one, above which they are the slope of a straight ramp without noise. [1]"""


def resolution_findings(phased: PhasedRun, energies: Energies) -> list[Finding]:
    """Report channels whose step is coarse for an energy that is evaluated; no channel is changed.

    In open circuit Vdc and Idc enter no efficiency.
    """
    run = phased.run
    chosen = [w for k in phased.chosen() if (w := energies.windows[k]).fault is None]
    if not chosen or run.simulated:
        return []
    levels: dict[str, float] = {}
    for stage in STAGES:
        joules = energies.joules[stage]
        if joules is None or max(joules) <= NOTHING or (stage == "gen" and (run.open_circuit or _idle(energies))):
            continue
        names = sources(run.channels, stage)
        for name, other in zip(names, names[::-1], strict=True):
            level = median(np.array([_level(phased, name, other, w) for w in chosen]))
            levels[name] = min(level, levels.get(name, math.inf))
    return [f for name, level in levels.items() if (f := _coarse(phased, name, level)) is not None]


def _idle(energies: Energies) -> bool:
    """Whether the machine delivers so little of the line energy that it runs as in an open circuit, whatever load is stated."""
    line, gen = energies.joules["line"], energies.joules["gen"]
    return line is not None and gen is not None and max(gen) < IDLE * max(line)


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


def _coarse(phased: PhasedRun, name: str, level: float) -> Finding | None:
    """The finding of one channel, None where its step is fine."""
    step = recorded_step(phased, name)
    if step == 0.0 or level <= ROUNDING * step:
        return None
    error = 0.5 * step / level
    of_onset = name == "velocity" and step >= OF_ONSET * phased.rig.thresholds.v_onset
    if error <= REPORTED and not of_onset:
        return None
    onset = "; the onset moves too, which may raise or lower them" if of_onset else ""
    return Finding(
        "coarse_resolution",
        f"{name} is recorded in steps of {step:.3g} {CHANNELS[name].unit}, {step / level:.1%} of its mean in the windows; if "
        f"the logger truncates, energies of {name} are up to {error:.1%} too low{onset}",
        "reported and kept; record it with more digits",
        name,
    )


def recorded_step(phased: PhasedRun, name: str) -> float:
    """Step in which a channel is recorded during the payouts, 0 where it has none. [SI unit of the channel]

    `smallest_step` of the ingest takes the smallest change of all. Here the step must explain nearly all changes, so that a
    bridged or repaired value does not pass for a fine resolution.
    """
    courses = [_changes(phased, name, k) for k in phased.chosen()]
    changes = np.abs(np.concatenate(courses))
    changes = np.sort(changes[changes > ROUNDING * float(np.max(np.abs(phased.run.channels[name])))])
    if changes.size < FEWEST:
        return 0.0
    step = changes[int(SMALL * changes.size)]
    step = float(np.mean(changes[(changes > 0.7 * step) & (changes < 1.4 * step)]))
    few = changes[changes < SEVERAL * step] / step
    multiple = (np.abs(few - np.round(few)) < MULTIPLE) & (few > 0.5)
    if few.size < FEWEST or np.count_nonzero(multiple) < NEARLY_ALL * few.size:
        return 0.0
    alike = sum(
        np.count_nonzero((np.abs(np.diff(d)) < MULTIPLE * step) & (np.abs(d[1:]) > 0.5 * step)) for d in courses
    )
    return 0.0 if alike > STRAIGHT * few.size else step


def _changes(phased: PhasedRun, name: str, k: int) -> Signal:
    """Changes of a channel from sample to sample in a payout, without those that were bridged, (n,)."""
    run, cycle = phased.run, phased.cycles[k]
    rows = phased.rows(cycle.onset, cycle.payout_end)
    t, change = run.t[rows], np.diff(run.channels[name][rows])
    logged = np.ones(change.size, dtype=bool)
    for gaps in (run.gaps.get(name), run.gaps.get(CLOCK)):
        for begin, end in () if gaps is None else gaps:
            logged &= (t[1:] <= begin) | (t[:-1] >= end)
    found: Signal = change[logged]
    return found
