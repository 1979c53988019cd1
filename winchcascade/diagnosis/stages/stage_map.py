"""Map of the loss between two stages over motion and load: the laws that the logs show, with their
band, for look-up tables.

The laws of a map are made of its two axes alone, speed and torque for a shaft, so that they have a
value at every place. A share of the power is a share of the power at the axes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError, RigError
from winchcascade.core.integrate import rms
from winchcascade.core.run import Mask, Signal
from winchcascade.diagnosis.campaign_entries import Entries
from winchcascade.diagnosis.diagnosis_result import Reported
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.stages.stage_causes import stage_causes
from winchcascade.diagnosis.stages.stage_fit import StageFit, fit_of, most_probable
from winchcascade.diagnosis.stages.stage_rows import StageData
from winchcascade.diagnosis.stages.stage_samples import stage_data
from winchcascade.diagnosis.stages.stage_signals import StagePath, StageSignals, paths_of
from winchcascade.rig.effects.catalogue import EFFECTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run

BREAKPOINTS = 25
"""Breakpoints of each axis of the table: linear interpolation of a quadratic surface between them
errs by less than a thousandth of its curvature over the whole range."""

EDGE = 1e-9
"""A place that lies outside of the hull by less than this share of its extent lies on its edge.
[1]"""


class MappedLaw(msgspec.Struct, frozen=True):
    """A law of a map with its number, and the laws that explain the logs as well."""

    name: str
    label: str
    number: Reported
    alternatives: tuple[str, ...]


class LossMap(msgspec.Struct, frozen=True):
    """Loss over two axes: the measured points, the laws, and the laws as a table for interpolation.

    Parameters
    ----------
    fit, laws : the fit, and its laws with their numbers
    axes : names of the signals of the axes, the motion first
    motion, load : (n,) and (m,) breakpoints in SI units
    loss, u_loss : (m, n) loss and its standard uncertainty, also where no data lie [W]
    inside : (m, n) places within the hull of the points
    hull : (k, 2) its corners, motion and load, anticlockwise
    points : (p, 6) motion, load, power that goes in, that comes out, that is stored [W], and time
        [s] of each point
    held_out : root mean square of measured minus predicted loss of points that took no part in the
        fit [W]
    """

    fit: StageFit
    path: StagePath
    laws: tuple[MappedLaw, ...]
    axes: tuple[str, str]
    motion: Signal
    load: Signal
    loss: Signal
    u_loss: Signal
    inside: Mask
    hull: Signal
    points: Signal
    held_out: float

    @property
    def data(self) -> StageData:
        """Rows of the fit."""
        return self.fit.data

    @property
    def lost(self) -> Signal:
        """Power that is lost at each point, (p,). [W]"""
        return np.asarray(self.points[:, 2] - self.points[:, 3] - self.points[:, 4])

    @property
    def energy(self) -> float:
        """Energy that is lost in all points together. [J]"""
        return float(self.lost @ self.points[:, 5])


def mapped_path(runs: Sequence[Run], rig: Rig) -> StagePath:
    """The path that a map is made of: the shaft beside its terminals, else the first that has two
    axes.

    Raises
    ------
    LogError : two powers are not there
    """
    paths = paths_of(runs, rig)
    shaft = [
        path
        for path in paths
        if "mech" in (path.into.name, path.out.name) and path.into.name not in ("line", "hyd")
    ]
    return (shaft or list(paths))[0]


def make_loss_map(runs: Sequence[Run], rig: Rig) -> LossMap:
    """Fit the laws of a map to logs of one rig, and lay them onto a table.

    Raises
    ------
    LogError, CampaignError : the logs lack a power or a motion
    RigError : the stage has no two axes
    """
    path = mapped_path(runs, rig)
    data = stage_data(Entries(runs), rig, EFFECTS, paths=[path], mapped=True)
    if "" in data.axes[0]:
        raise RigError(
            f"rig {rig.name}: a loss map needs a motion and a load of one stage, such as speed and "
            f"torque, from {path.into.name} to {path.out.name}; log both."
        )
    fit = most_probable(fit_of(data))
    best, rows = fit.found.best, data.rows
    turned = np.where(rows.axes[:, 0] < 0.0, -1.0, 1.0)  # what turns the other way loses as much
    places = rows.axes * turned[:, None]
    moves = rows.axes[:, 0] != 0.0
    if not moves.any():
        raise LogError(
            f"{runs[0].name}: no operating point for a loss map, as {data.axes[0][0]} is 0 "
            "throughout; expected a stage at work."
        )
    motion, load = (
        np.linspace(float(x.min()), float(x.max()), BREAKPOINTS) for x in places[moves].T
    )
    grid = np.stack(np.meshgrid(motion, load), axis=-1)
    loss, slopes = _surface(fit, grid)
    covariance = fit.covariance(best)
    hull, inside = convex_hull(places[moves], grid)
    numbers, stated = data.numbers(best.names, best.x), data.numbers()
    stores = np.array([one.law.kind not in ("loss", "gain", "zero") for one in data.laws.values()])
    stored = -rows.columns[:, stores] @ numbers[stores]
    powers = rows.given - rows.columns @ stated, rows.given + rows.gap, stored
    points = np.column_stack([places, *powers, rows.width])[moves]
    return LossMap(
        fit=fit,
        path=path,
        laws=_laws(fit),
        axes=data.axes[0],
        motion=motion,
        load=load,
        loss=loss,
        u_loss=np.sqrt(np.maximum(np.einsum("...i,ij,...j", slopes, covariance, slopes), 0.0)),
        inside=inside,
        hull=hull,
        points=points,
        held_out=rms(fit.residual(best)),
    )


def _laws(fit: StageFit) -> tuple[MappedLaw, ...]:
    """Laws of a map: those of the fit, and those that the rig file states and the fit leaves as
    they are.
    """
    found, rows = {cause.effect: cause for cause in stage_causes(fit)}, []
    for name, one in fit.data.laws.items():
        label, named = fit.data.suspects[name].label, found.get(name)
        if named is not None:
            alike = tuple(other.effect for other in named.look_alikes)
            rows.append(MappedLaw(name, label, next(iter(named.parameters.values())), alike))
        elif one.stated is not None:
            value, half = one.stated.value, COVERED * one.stated.u
            rows.append(
                MappedLaw(
                    name, label, Reported(value, value - half, value + half, one.law.unit), ()
                )
            )
    return tuple(rows)


def _surface(fit: StageFit, grid: Signal) -> tuple[Signal, Signal]:
    """Loss over a grid of motion and load, (m, n) [W], and its derivative over the numbers of the
    fit, (m, n, k).
    """
    data, best = fit.data, fit.found.best
    x, y = grid.reshape(-1, 2).T
    power = np.abs(x * y)
    signals = {**dict(zip(data.axes[0], (x, y), strict=True)), "power": power, "drive": power}
    one = StageSignals(np.arange(float(power.size)), power, power, signals, {})
    # a store loses nothing, and what is no function of both axes has no place on the map
    mapped = [
        law.law.kind == "loss" and law.law.over.keys() <= signals.keys()
        for law in data.laws.values()
    ]
    slopes = np.zeros((power.size, len(mapped)))
    for k, (law, is_mapped) in enumerate(zip(data.laws.values(), mapped, strict=True)):
        if is_mapped:
            slopes[:, k] = -one.column(law.law)
    shape = (*grid.shape[:-1], len(best.names))
    return (slopes @ data.numbers(best.names, best.x)).reshape(shape[:-1]), slopes[
        :, fit.columns_of(best)
    ].reshape(shape)


def convex_hull(points: Signal, places: Signal) -> tuple[Signal, Mask]:
    """Corners of the convex hull of points, (k, 2), anticlockwise from the minimum x, and whether
    places, (..., 2), lie in it.

    Of points on a line the corners are the two ends, and no place lies in it.

    >>> points = np.array([[0.0, 0.0], [2, 0], [1, 2], [1, 0.5]])
    >>> square, inside = convex_hull(points, np.array([[1.0, 1.0], [0.0, 2.0]]))
    >>> square.tolist(), inside.tolist()
    ([[0.0, 0.0], [2.0, 0.0], [1.0, 2.0]], [True, False])
    """
    from scipy.spatial import ConvexHull, QhullError

    corners = np.unique(points, axis=0)
    try:
        hull = ConvexHull(corners)
    except QhullError:  # too few points, or all of them on a line
        return corners[:: max(1, len(corners) - 1)], np.zeros(places.shape[:-1], dtype=bool)
    beyond = (places @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=-1)
    found = corners[hull.vertices]
    return np.roll(found, -int(np.lexsort(found.T[::-1])[0]), axis=0), beyond <= EDGE * np.ptp(
        corners
    )
