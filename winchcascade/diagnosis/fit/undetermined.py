"""What some logs cannot know of a rig: directions in which its stated numbers change nothing that
is logged.

Without the speed of the rotor, a gear ratio that is larger by a factor, with back-EMF constant and
inductance smaller by the same and losses and inertia by its square, gives the same logs. Such
directions are the singular vectors of the whitened derivatives whose singular values are below 1:
numbers that change by a factor e along them move the logs by less than one standard deviation in
all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import median_and_error
from winchcascade.diagnosis.fit.nuisances import SECTIONS
from winchcascade.rig.parts import changed, in_rig_file, number_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.fit.marginal import Together
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.fit.suspects import Suspects

STEP = 1e-5
"""Relative change of a number by which its derivative is taken: numbers move the logs by some 1e5
standard deviations, and a direction must cancel to less than one, beside curvature and rounding.
[1]"""

UNSEEN = 1.0
"""Standard deviations of all logs together by which a direction moves them that they do not
show. [1]
"""

TAKES_PART = 0.05
"""Smallest power, relative to the largest, of a number that takes part in a direction. [1]"""

LEADS = 0.5
"""A number leads a direction if it moves the logs by more than this share of what the strongest
does. [1]
"""

ENGAGED = 0.5
"""Share of the top speed above which the clutch is engaged and shaft and line turn together. [1]"""

GEAR_KNOWN = 0.005
"""Relative standard uncertainty of a gear ratio by logged speeds, at least: slip and encoder of
the line. [1]
"""

GEAR, RATED = "drivetrain.gear", "generator.i_rated"
"""Paths of the gear ratio, and of the rated current, which no log shows."""


class Direction(msgspec.Struct, frozen=True):
    """A direction that the logs do not know.

    `powers` are those of the numbers of the model, by their paths, whose common factor changes
    nothing [1]; `leading` the ones that would move the logs most by themselves.
    """

    powers: dict[str, float]
    leading: tuple[str, ...]

    @property
    def product(self) -> tuple[str, str] | None:
        """The two numbers of which only the product is known; None where it is another
        combination.
        """
        if len(self.leading) != 2:
            return None
        first, second = (self.powers[path] for path in self.leading)
        return (
            (self.leading[0], self.leading[1])
            if abs(first + second) < TAKES_PART * abs(first)
            else None
        )

    def suspects(self, suspects: Suspects) -> tuple[frozenset[str], ...]:
        """Suspects that change each of the leading numbers alone and alike in every run, by
        name.
        """
        alone = {n: e.path for n, e in suspects.items() if e.law is None and e.over_runs is None}
        return tuple(
            frozenset(n for n, path in alone.items() if path == one) for one in self.leading
        )


def undetermined(data: Fitted) -> tuple[Direction, ...]:
    """Directions in which the stated numbers of a rig change nothing in some logs, with sensors as
    they are.

    The logs of extreme loads are compared.
    """
    stated = (f"{section}.{name}" for section in SECTIONS for name in in_rig_file(section))
    paths = [path for path in stated if path != RATED and number_of(data.nominal, path) != 0.0]
    columns = np.array([_moved(data, path) for path in paths]).T
    ratio = measured_gear(data.rig, [log.run for log in data.logs])
    if ratio is not None and GEAR in paths:
        columns = np.vstack([columns, np.where(np.array(paths) == GEAR, 1.0 / ratio[1], 0.0)])
    _, size, ways = np.linalg.svd(columns, full_matrices=False)
    strength, found = np.linalg.norm(columns, axis=0), []
    for way in _sparse(ways[size < UNSEEN]):
        powers = {p: float(x) for p, x in zip(paths, way, strict=True) if abs(x) > TAKES_PART}
        if len(powers) < 2:
            continue
        moves = {p: abs(x) * float(strength[paths.index(p)]) for p, x in powers.items()}
        strongest = max(moves.values())
        leading = tuple(p for p in powers if moves[p] > LEADS * strongest)
        found.append(Direction({p: x / powers[leading[0]] for p, x in powers.items()}, leading))
    return tuple(found)


def _moved(data: Fitted, path: str) -> Signal:
    """What a number moves in two logs over their noise, for each relative change of it, (n,).
    [1]
    """
    rows = []
    for log in (data.logs[k] for k in data.extreme_loads):
        other = changed(data.nominal, path, "scale", STEP)
        moved = log.course.predict(other) - log.course.predict(data.nominal)
        seen = log.noise.seen & (log.noise.logged > 0.0) & np.isfinite(moved)
        z = np.divide(moved, STEP * log.noise.logged, out=np.zeros_like(moved), where=seen)
        rows.append(z.ravel())
    return np.concatenate(rows)


TIES = 1e-6
"""Share by which each number is preferred to the next as one that a direction is named by, of
two that do as well. [1]
"""


def _sparse(ways: Signal) -> Signal:
    """The basis of the space of some directions, (k, n), in which each of k numbers is 1 in one
    direction and 0 in all others.

    These are the numbers that a QR decomposition with pivoting takes first. The directions of equal
    singular values are any basis of their space; this one depends on the space alone.
    """
    from scipy.linalg import qr

    *_, order = qr(ways * (1.0 - TIES * np.arange(ways.shape[1])), pivoting=True)
    own = np.sort(order[: len(ways)])
    return np.asarray(np.linalg.solve(ways[:, own], ways))


def measured_gear(rig: Rig, runs: Sequence[Run]) -> tuple[float, float] | None:
    """Gear ratio over the stated one by the logged speed of the generator, and its relative
    standard uncertainty. [1]

    None where no log has it. The logged motion is that of the drum while the clutch is engaged.
    """
    column, radius = rig.columns.get("speed"), rig.r_drum
    if column is None or column.side != "generator" or radius is None:
        return None
    ratios = []
    for run in runs:
        if {"speed", "velocity"} <= run.channels.keys():
            v = run.channels["velocity"]
            engaged = v > ENGAGED * float(np.max(v))
            ratios.append(run.channels["speed"][engaged] * radius / v[engaged])
    if not ratios:
        return None
    ratio, u = median_and_error(np.concatenate(ratios))
    return ratio, max(u / ratio, GEAR_KNOWN)


def alike(directions: Sequence[Direction], suspects: Suspects) -> tuple[Together, ...]:
    """Suspects of each direction by the number that they change: the logs know these numbers
    only together.
    """
    return tuple(groups for one in directions if all(groups := one.suspects(suspects)))
