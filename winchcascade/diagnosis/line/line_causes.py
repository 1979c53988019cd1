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
from winchcascade.diagnosis.diagnosis_result import Alternative, Experiment, NamedCause, Names, Reported, Spot
from winchcascade.diagnosis.line.line_data import NUMBERS, POWER, Lines, beside, block_means_of, columns_of, with_span
from winchcascade.diagnosis.line.line_selection import Choice, Moments, coefficients, moments_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.diagnosis.suspects import Suspects

RIVALS = 2
"""Maximum number of alternatives of each cause that are named."""

LIKELY = 0.05
"""Share of resampled sets of cycles that choose an alternative from which it is named even if the logged cycles exclude it."""

STEP, RAMP = 10.0, 1.0
"""Length of a step of a planned motion, and of the ramp to it. [s]"""

SWING = 4.0
"""Period of a planned swing of the speed. [s]"""

TOP = 0.97
"""Quantile of the speed in payout that a planned motion takes for its top."""

NEARLY = 0.7
"""Share of the largest significance from which a motion is planned; they are tried in order of effort."""


def line_causes(lines: Lines, m: Moments, choice: Choice, suspects: Suspects) -> tuple[NamedCause, ...]:
    """Every cause of the chosen set, the one that closes most first."""
    numbers = reported(lines, m, choice.chosen)
    causes = [
        NamedCause(
            effect=name,
            stage=suspects[name].stage,
            probability=sum(p for names, p in choice.probability.items() if name in names),
            parameters={NUMBERS[name][0]: numbers[name]},
            look_alikes=_alternatives(lines, m, choice, name),
            weight=choice.error(tuple(n for n in choice.chosen if n != name)) - choice.error(choice.chosen),
        )
        for name in choice.chosen
    ]
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def again_alone(lines: Lines, names: Names) -> dict[str, Reported]:
    """The numbers of a set from the withheld parts alone, by effect; none where no part is withheld."""
    parts = tuple(msgspec.structs.replace(part, withheld=False) for part in lines.parts if part.withheld)
    return reported(msgspec.structs.replace(lines, parts=parts), moments_of(parts), names) if parts else {}


def reported(lines: Lines, m: Moments, names: Names) -> dict[str, Reported]:
    """The number of each suspect of a set with its 95 % interval; Student's t for few folds."""
    x = coefficients(m, lines, names)
    u = np.sqrt(np.diag(line_covariance(lines, m, names))) * student(m.folds - 1)
    ends = np.array([x, np.maximum(x - u, lines.low), np.minimum(x + u, lines.high)])
    found = dict(zip(lines.names, ends.T.tolist(), strict=True))
    gain = found.get("force_gain", [0.0])[0]
    if "force_zero" in found:
        found["force_zero"] = [end / (1.0 + gain) for end in found["force_zero"]]
    if "force_gain" in found:  # F_read = (1 + g) F reverses the order of the ends of h = 1 / (1 + g) - 1
        value, low, high = (-h / (1.0 + h) for h in found["force_gain"])
        found["force_gain"] = [value, high, low]
    numbers = ((name, *found[name]) for name in names)
    return {name: Reported(value, low, high, NUMBERS[name][1]) for name, value, low, high in numbers}


def line_covariance(lines: Lines, m: Moments, names: Names) -> Signal:
    """Covariance of the coefficients of a set, (suspects, suspects), 0 for those outside it or at a bound.

    Samples of one fold are no independent numbers: the sum of its scores varies (Liang and Zeger 1986), with G / (G - 1) for G
    folds. A wider span for the slope of the velocity moves the numbers too, as either smooths fast motion: the error of the
    span in use follows from two of them and is added as a standard uncertainty, in the diagonal.
    """
    x = coefficients(m, lines, names)
    free = (lines.low < x) & (x < lines.high) & [name in names for name in lines.names]
    inside, found = np.flatnonzero(free), np.zeros((x.size, x.size))
    if inside.size:
        within = np.ix_(inside, inside)
        scores = (m.slope - m.curve @ x)[:, inside]
        inverse = np.linalg.pinv(m.curve.sum(axis=0)[within], hermitian=True)
        found[within] = m.folds / (m.folds - 1.0) * inverse @ scores.T @ scores @ inverse
        found[inside, inside] += (_error_of_span(lines, names) ** 2)[inside]
    return found


def _error_of_span(lines: Lines, names: Names) -> Signal:
    """Error of each coefficient due to the span of the slope, (suspects,), from its change with another span.

    The error of the slope of a quadratic over k samples on either side is the third derivative times (3 k^2 + 3 k - 1) / 5, in
    squares of the step (Savitzky and Golay 1964).
    """
    other = next((span for span in lines.spans if span > lines.span), lines.spans[max(len(lines.spans) - 2, 0)])
    if other == lines.span or "drum_inertia" not in names:
        return np.zeros(len(lines.names))
    there = with_span(lines, other)
    counts = (beside(lines.parts[0].run, span) for span in (lines.span, other))
    own, its = ((3.0 * k * k + 3.0 * k - 1.0) / 5.0 for k in counts)
    moved = coefficients(moments_of(there.fitted), there, names) - coefficients(moments_of(lines.fitted), lines, names)
    return moved * (own / (its - own))


def _alternatives(lines: Lines, m: Moments, choice: Choice, name: str) -> tuple[Alternative, ...]:
    """Suspects in place of a cause with which the set predicts as well, best first."""
    found = [
        (choice.error(swapped), other, swapped)
        for other, swapped in _swaps(lines, choice, name)
        if choice.as_good(swapped) and (choice.even(swapped) or choice.probability[swapped] >= LIKELY)
    ]
    return tuple(
        Alternative(other, choice.probability[swapped], _difference(lines, m, choice.chosen, swapped))
        for _, other, swapped in sorted(found)[:RIVALS]
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
    swaps = [(choice.error(s), name, other, s) for name in named for other, s in _swaps(lines, choice, name)]
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
