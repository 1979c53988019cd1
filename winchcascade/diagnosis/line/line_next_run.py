"""What to test next with a winch without a model: the motion that would best tell a cause from its strongest rival."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnosis_result import Experiment
from winchcascade.diagnosis.line.line_causes import covariance_of, swaps_of
from winchcascade.diagnosis.line.line_data import columns_of, width_of
from winchcascade.diagnosis.line.line_selection import coefficients

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.line.line_data import Lines
    from winchcascade.diagnosis.line.line_selection import Choice, Moments, Names

STEP, RAMP = 10.0, 1.0
"""Length of a step of a planned motion, and of the ramp to it. [s]"""

SWING = 4.0
"""Period of a planned swing of the speed. [s]"""

TOP = 0.97
"""Quantile of the speed in payout that a planned motion takes for its top."""


NEARLY = 0.7
"""Of the motions that tell this share of the most, the first is planned: they are in order of effort."""


class PlannedMotion(msgspec.Struct, frozen=True):
    """A planned motion: speed (n,) [m/s] and line force (n,) [N] over even stamps t (n,) [s], the force about `pull` [N]."""

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
    swaps = [(choice.error(s), name, other, s) for name in named for other, s in swaps_of(lines, choice, name)]
    if not swaps:
        return None
    _, name, other, swapped = min(swaps)
    motions = motions_of(lines)
    left = choice.error(choice.chosen) * choice.gap / sum(part.here.size for part in lines.fitted)
    spread = math.sqrt(left)  # root mean square of what the causes leave of a sample [W]
    scores = [apart(lines, m, choice.chosen, swapped, motion, spread) for motion in motions]
    best = next(k for k, z in enumerate(scores) if z >= NEARLY * max(scores))
    motion = motions[best]
    return Experiment(motion.name, float(motion.velocity.max()), (name, other), scores[best], force=motion.pull)


def motions_of(lines: Lines) -> tuple[PlannedMotion, ...]:
    """Motions that are tried, at the speeds and forces of the campaign."""
    v = np.concatenate([part.run.channels["velocity"][part.here] for part in lines.fitted])
    f = np.concatenate([part.run.channels["force"][part.here] for part in lines.fitted])
    out = v > 0.0
    top = float(np.quantile(v[out] if out.any() else np.abs(v), TOP))
    pull = float(np.median(f[v > 0.5 * top] if np.any(v > 0.5 * top) else f))
    shares = np.array([0.25, 0.5, 0.75, 1.0])
    fs = lines.parts[0].run.fs
    one, turns = np.ones(4), np.array([1.0, -1.0, 1.0, -1.0])
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
    t = np.arange(0.0, speeds.size * STEP + RAMP, 1.0 / fs)
    corners = np.ravel(np.column_stack([np.arange(speeds.size) * STEP + RAMP, np.arange(1, speeds.size + 1) * STEP]))
    v = np.interp(t, [0.0, *corners, speeds.size * STEP + RAMP], [0.0, *np.repeat(speeds, 2), 0.0])
    return t, v, np.interp(t, corners, np.repeat(forces, 2))


def apart(lines: Lines, m: Moments, one: Names, other: Names, motion: PlannedMotion, spread: float) -> float:
    """Significance with which a motion tells one set from another, whose numbers may adapt as far as the logs allow. [sigma]"""
    run = Run("planned", motion.t, {"velocity": motion.velocity, "force": motion.force}, fs=lines.parts[0].run.fs,
              samples=motion.t.size)  # fmt: skip
    columns = columns_of(run, lines.names, width_of(run, lines.span))
    sound = np.isfinite(columns).all(axis=1)
    own = np.array([lines.names.index(name) for name in other])
    z = columns[sound] @ (coefficients(m, lines, one) - coefficients(m, lines, other)) / max(spread, 1e-9)
    j = columns[np.ix_(sound, own)] / max(spread, 1e-9)
    known = np.linalg.pinv(covariance_of(lines, m, other)[np.ix_(own, own)], hermitian=True)
    pull = j.T @ z
    return math.sqrt(max(float(z @ z - pull @ np.linalg.pinv(j.T @ j + known, hermitian=True) @ pull), 0.0))
