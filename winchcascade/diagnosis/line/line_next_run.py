"""What to test next with a winch without a model: the motion that would best tell a cause from its strongest rival."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.run import Run
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


class Motion(msgspec.Struct, frozen=True):
    """A planned motion: what it is, and its speed (n,) [m/s] and line force (n,) [N] over even stamps t (n,) [s]."""

    words: str
    t: Signal
    velocity: Signal
    force: Signal


class LineExperiment(msgspec.Struct, frozen=True):
    """One motion that would tell two suspects apart, and by how many standard deviations."""

    profile: str
    speed: float
    separates: tuple[str, str]
    expected_z: float


def plan(lines: Lines, m: Moments, choice: Choice, named: Sequence[str], spread: float) -> LineExperiment | None:
    """Choose the motion in which the causes and the set that comes nearest with one of them swapped differ most.

    Parameters
    ----------
    named : causes that may be the one
    spread : root mean square of what the causes leave of a sample [W]
    """
    swaps = [(choice.error(s), name, other, s) for name in named for other, s in swaps_of(lines, choice, name)]
    if not swaps:
        return None
    _, name, other, swapped = min(swaps)
    motions = motions_of(lines)
    scores = [apart(lines, m, choice.chosen, swapped, motion, spread) for motion in motions]
    best = next(k for k, z in enumerate(scores) if z >= NEARLY * max(scores))
    return LineExperiment(motions[best].words, float(motions[best].velocity.max()), (name, other), scores[best])


def motions_of(lines: Lines) -> tuple[Motion, ...]:
    """Motions that are tried, at the speeds and forces of the campaign."""
    v = np.concatenate([part.run.channels["velocity"][part.here] for part in lines.fitted])
    f = np.concatenate([part.run.channels["force"][part.here] for part in lines.fitted])
    out = v > 0.0
    top = float(np.quantile(v[out] if out.any() else np.abs(v), TOP))
    pull = float(np.median(f[v > 0.5 * top] if np.any(v > 0.5 * top) else f))
    shares = np.array([0.25, 0.5, 0.75, 1.0])
    low, high = 0.5 * pull, 1.5 * pull
    fs = lines.parts[0].run.fs
    one = np.ones(4)
    t = np.arange(0.0, 4.0 * STEP, 1.0 / fs)
    swing = top * (0.75 - 0.25 * np.cos(2.0 * math.pi * t / SWING))
    return (
        _stepped(
            f"reel-out at a constant line force of {pull / 1e3:.1f} kN, in steps to a quarter, half, three quarters and all of "
            f"{top:.1f} m/s, {STEP:g} s each",
            fs, top * shares, pull * one,
        ),
        _stepped(
            f"reel-out at a constant {0.5 * top:.1f} m/s, the line force in steps from {low / 1e3:.1f} kN to "
            f"{high / 1e3:.1f} kN, {STEP:g} s each",
            fs, 0.5 * top * one, np.linspace(low, high, 4),
        ),
        _stepped(
            f"reel-out and haul-in by turns at {0.5 * top:.1f} m/s and a constant line force of {pull / 1e3:.1f} kN, "
            f"{STEP:g} s each",
            fs, 0.5 * top * np.array([1.0, -1.0, 1.0, -1.0]), pull * one,
        ),
        Motion(
            f"reel-out at a constant line force of {pull / 1e3:.1f} kN, the speed swinging between {0.5 * top:.1f} and "
            f"{top:.1f} m/s every {SWING:g} s, for {4.0 * STEP:g} s",
            t, swing, np.full(t.size, pull),
        ),
    )  # fmt: skip


def _stepped(words: str, fs: float, speeds: Signal, forces: Signal) -> Motion:
    """A motion in steps, with ramps from rest and back to it."""
    t = np.arange(0.0, speeds.size * STEP + RAMP, 1.0 / fs)
    corners = np.ravel(np.column_stack([np.arange(speeds.size) * STEP + RAMP, np.arange(1, speeds.size + 1) * STEP]))
    v = np.interp(t, [0.0, *corners, speeds.size * STEP + RAMP], [0.0, *np.repeat(speeds, 2), 0.0])
    return Motion(words, t, v, np.interp(t, corners, np.repeat(forces, 2)))


def apart(lines: Lines, m: Moments, one: Names, other: Names, motion: Motion, spread: float) -> float:
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
