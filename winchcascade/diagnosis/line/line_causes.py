"""What is reported of each cause of a winch without a model: its number with an interval, its probability, its alternatives,
and the motion that would best distinguish a cause from its strongest alternative.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from winchcascade.core.accuracy import student
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    Experiment,
    FittedEffect,
    NamedCause,
    Names,
    Reported,
    Spot,
)
from winchcascade.diagnosis.line.line_data import (
    NUMBERS,
    POWER,
    RANGED,
    Lines,
    block_means_of,
    columns_of,
    reported_number,
)
from winchcascade.diagnosis.line.line_selection import (
    MATERIAL,
    Choice,
    Moments,
    coefficients,
    errors_of,
    line_covariance,
    moments_of,
)
from winchcascade.diagnosis.line.line_stability import stability_of
from winchcascade.rig.stages import line_power

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.diagnosis.suspects import Suspects

AMBIGUOUS = 0.95
"""Maximum probability of a cause that another suspect can replace: the list of suspects is not complete. [1]"""

STEP, RAMP = 10.0, 1.0
"""Length of a step of a planned motion, and of the ramp to it. [s]"""

SWING = 4.0
"""Period of a planned swing of the speed. [s]"""

TOP = 0.97
"""Quantile of the speed in payout that a planned motion takes for its top."""

NEARLY = 0.7
"""Share of the largest significance from which a motion is planned; they are tried in order of effort."""


def line_causes(lines: Lines, m: Moments, choice: Choice, suspects: Suspects) -> tuple[NamedCause, ...]:
    """Every material cause of the chosen set, the one that closes most first."""
    numbers, everything = reported(lines, m, choice.chosen), moments_of(lines, lines.parts)
    named = [name for name in choice.chosen if is_material(lines, m, choice, name)]
    causes = []
    for name in named:
        alike = _look_alikes(lines, m, choice, name)
        without = tuple(n for n in choice.chosen if n != name)
        causes.append(
            NamedCause(
                effect=name,
                stage=suspects[name].stage,
                probability=min(choice.share_with(name), AMBIGUOUS if alike else 1.0),
                parameters={NUMBERS[name][0]: numbers[name]},
                weight=choice.error(without) - choice.error(choice.chosen),
                stability=stability_of(lines, everything, choice.chosen, name),
                look_alikes=alike,
                ablation=1.0 - squared_error(lines, m, without) / max(squared_error(lines, m, ()), 1e-300),
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def squared_error(lines: Lines, m: Moments, names: Names) -> float:
    """Squared error of a set on the judged parts by a fit without them. [W2]"""
    if not lines.judged[0].withheld:
        return float(errors_of(m, lines, names).sum())
    x = coefficients(m, lines, names)
    return float(sum(np.sum((part.gap - part.columns @ x) ** 2) for part in lines.judged))


def is_material(lines: Lines, m: Moments, choice: Choice, name: str) -> bool:
    """Whether a cause closes a share of the gap, or takes a share of the energy of payouts or haul-ins, that matters."""
    without = tuple(n for n in choice.chosen if n != name)
    if choice.error(without) - choice.error(choice.chosen) >= MATERIAL * (1.0 - choice.error(choice.chosen)):
        return True
    own = lines.names.index(name)
    taken = coefficients(m, lines, choice.chosen)[own]
    for number, phase in enumerate(PHASES):
        here = [(part, part.phase == number) for part in lines.fitted]
        energy = sum(float(np.sum((part.width * part.columns[:, own])[at])) for part, at in here) * taken
        line, gap = (
            sum(float(np.sum((part.width * power)[at])) for (part, at), power in zip(here, powers, strict=True))
            for powers in (
                [line_power(part.run)[part.here] for part in lines.fitted],
                [part.gap for part in lines.fitted],
            )
        )
        if phase != "hold" and abs(energy) >= MATERIAL * max(abs(line), abs(line + gap)) > 0.0:
            return True
    return False


def fitted_effects(lines: Lines, m: Moments, choice: Choice, named: Sequence[str]) -> tuple[FittedEffect, ...]:
    """Every suspect of the final fit with its number, then each that was left out though its fit closes more, with its number.

    One that was left out counts if it closes `MATERIAL` more of the gap on held-out cycles and its interval excludes zero.
    """
    numbers = reported(lines, m, choice.chosen)
    found = [FittedEffect(name, name in named, {NUMBERS[name][0]: numbers[name]}) for name in choice.chosen]
    for name in lines.names:
        if name in choice.chosen:
            continue
        larger = tuple(n for n in lines.names if n in (*choice.chosen, name))
        number = reported(lines, m, larger)[name]
        more = choice.error(choice.chosen) - choice.error(larger)
        apart = number.low > 0.0 or number.high < 0.0
        if apart and (more >= MATERIAL or choice.evidence[larger] > choice.evidence[choice.chosen]):
            found.append(FittedEffect(name, False, {NUMBERS[name][0]: number}, chosen=False))
    return tuple(found)


def again_alone(lines: Lines, names: Names) -> dict[str, Reported]:
    """The numbers of a set from the withheld parts alone, by effect; none where no part is withheld."""
    parts = tuple(msgspec.structs.replace(part, withheld=False) for part in lines.parts if part.withheld)
    alone = msgspec.structs.replace(lines, parts=parts)
    return reported(alone, moments_of(alone, parts), names) if parts else {}


def reported(lines: Lines, m: Moments, names: Names) -> dict[str, Reported]:
    """The number of each suspect of a set with its 95 % interval; Student's t for few folds."""
    x, bounds = coefficients(m, lines, names), lines.bounds
    u = np.sqrt(np.diag(line_covariance(lines, m, names))) * student(m.folds - 1)
    ends = np.array([x, np.maximum(x - u, bounds.low), np.minimum(x + u, bounds.high)])
    gain = 0.0
    if "force_gain" in names:
        gain = reported_number("force_gain", float(x[lines.names.index("force_gain")]))
    found = {}
    for name in names:
        k = lines.names.index(name)
        value, *interval = (reported_number(name, end) for end in ends[:, k].tolist())
        if name == "force_zero":
            value, *interval = (end / (1.0 + gain) for end in (value, *interval))
        eps = 1e-9 * float(bounds.inner_high[k] - bounds.inner_low[k])
        over, at = x[k] - bounds.inner_high[k], min(abs(x[k] - bounds.low[k]), abs(x[k] - bounds.high[k]))
        beyond = name in RANGED and bool(max(over, bounds.inner_low[k] - x[k]) > eps)
        side: Literal["low", "high"] = "low" if abs(value) < eps else "high"
        found[name] = Reported(
            value, min(interval), max(interval), NUMBERS[name][1], side if at <= eps else None, beyond_range=beyond
        )
    return found


def _look_alikes(lines: Lines, m: Moments, choice: Choice, name: str) -> tuple[Alternative, ...]:
    """Suspects of the smallest sets without a cause for which the evidence is not clearly lower, the most likely first."""
    good = [names for names in choice.evidence if name not in names and choice.as_good(names)]
    smallest = [names for names in good if not any(set(other) < set(names) for other in good)]
    best: dict[str, Names] = {}
    for names in sorted(smallest, key=lambda names: -choice.evidence[names]):
        for other in names:
            if other not in choice.chosen:
                best.setdefault(other, names)
    return tuple(
        Alternative(other, choice.share_with(other), _difference(lines, m, choice.chosen, names))
        for other, names in best.items()
    )


def _swaps(lines: Lines, choice: Choice, name: str) -> list[tuple[str, Names]]:
    """Sets with another suspect in place of one cause, and which."""
    kept = [n for n in choice.chosen if n != name]
    others = [n for n in lines.names if n not in choice.chosen]
    return [(other, tuple(n for n in lines.names if n in (*kept, other))) for other in others]


def _difference(lines: Lines, m: Moments, one: Names, other: Names) -> Spot:
    """In which phase two sets differ most, as a root mean square."""
    apart = coefficients(m, lines, one) - coefficients(m, lines, other)
    blocks, mean = block_means_of(lines.parts, [part.columns @ apart for part in lines.parts])
    known = np.isfinite(mean)
    sums = np.bincount(blocks.phase[known], mean[known] ** 2, len(PHASES))
    worst = int(np.argmax(sums))
    return Spot(
        POWER, PHASES[worst], bias=math.sqrt(float(sums[worst]) / np.count_nonzero(blocks.phase[known] == worst))
    )


class PlannedMotion(msgspec.Struct, frozen=True):
    """A planned motion: speed (n,) [m/s] and line tension (n,) [N] over even stamps t (n,) [s], the force about `pull` [N]."""

    name: Literal["speed_steps", "force_steps", "out_and_back", "swing"]
    t: Signal
    velocity: Signal
    force: Signal
    pull: float


def plan(lines: Lines, m: Moments, choice: Choice, named: Sequence[str]) -> Experiment | None:
    """Choose the motion in which the causes and the set that comes nearest with one of them swapped differ most.

    Parameters
    ----------
    named : causes that may be the one
    """
    swaps = [(-choice.evidence[s], name, other, s) for name in named for other, s in _swaps(lines, choice, name)]
    if not swaps:
        return None
    _, name, other, swapped = min(swaps)
    residual = choice.error(choice.chosen) * choice.gap / sum(part.here.size for part in lines.fitted)
    noise = max(math.sqrt(residual), 1e-9)  # root mean square of the residual of a sample [W]
    motions = _motions(lines)
    scores = [_score(lines, m, (choice.chosen, swapped), motion, noise) for motion in motions]
    z, motion = next((z, motion) for z, motion in zip(scores, motions, strict=True) if z >= NEARLY * max(scores))
    return Experiment(motion.name, float(motion.velocity.max()), (name, other), z, force=motion.pull)


def _motions(lines: Lines) -> tuple[PlannedMotion, ...]:
    """Motions that are tried, at the speeds and forces of the campaign."""
    v, f = (
        np.concatenate([part.run.channels[name][part.here] for part in lines.fitted]) for name in ("velocity", "force")
    )
    top = float(np.quantile(v[v > 0.0] if np.any(v > 0.0) else np.abs(v), TOP))
    fast = v > 0.5 * top
    pull, fs = float(np.median(f[fast] if fast.any() else f)), lines.parts[0].run.fs
    one, shares, turns = np.ones(4), np.array([0.25, 0.5, 0.75, 1.0]), np.array([1.0, -1.0, 1.0, -1.0])
    t = np.arange(0.0, 4.0 * STEP, 1.0 / fs)
    swing = top * (0.75 - 0.25 * np.cos(2.0 * math.pi * t / SWING))
    return (
        PlannedMotion("speed_steps", *_stepped(fs, top * shares, pull * one), pull),
        PlannedMotion("force_steps", *_stepped(fs, 0.5 * top * one, np.linspace(0.5 * pull, 1.5 * pull, 4)), pull),
        PlannedMotion("out_and_back", *_stepped(fs, 0.5 * top * turns, pull * one), pull),
        PlannedMotion("swing", t, swing, np.full(t.size, pull), pull),
    )


def _stepped(fs: float, speeds: Signal, forces: Signal) -> tuple[Signal, Signal, Signal]:
    """Stamps, speed and force of a motion in steps, with ramps from rest and back to it."""
    end = speeds.size * STEP + RAMP
    t = np.arange(0.0, end, 1.0 / fs)
    corners = np.ravel(np.column_stack([np.arange(speeds.size) * STEP + RAMP, np.arange(1, speeds.size + 1) * STEP]))
    v = np.interp(t, [0.0, *corners, end], [0.0, *np.repeat(speeds, 2), 0.0])
    return t, v, np.interp(t, corners, np.repeat(forces, 2))


def _score(lines: Lines, m: Moments, sets: tuple[Names, Names], motion: PlannedMotion, noise: float) -> float:
    """Significance with which a motion distinguishes two sets; the numbers of the second may adapt within the logs. [sigma]"""
    one, other = sets
    channels = {"velocity": motion.velocity, "force": motion.force}
    run = Run("planned", motion.t, channels, fs=lines.parts[0].run.fs, samples=motion.t.size)
    columns = columns_of(run, lines.names, lines.span) / noise
    columns = columns[np.isfinite(columns).all(axis=1)]
    own = np.flatnonzero([name in other for name in lines.names])
    z, j = columns @ (coefficients(m, lines, one) - coefficients(m, lines, other)), columns[:, own]
    precision = np.linalg.pinv(line_covariance(lines, m, other)[np.ix_(own, own)], hermitian=True)
    pull = j.T @ z
    return math.sqrt(max(float(z @ z - pull @ np.linalg.pinv(j.T @ j + precision, hermitian=True) @ pull), 0.0))
