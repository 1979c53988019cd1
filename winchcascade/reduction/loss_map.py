"""Power that is lost between two stages without storage, over torque and speed of the shaft: a surface fitted to points.

Energy conservation gives the loss of a point: what goes in, less what comes out, less the rate at which rotor, shaft spring and
DC-link capacitor take up energy. For the rotor that rate is J omega domega/dt. From line to shaft no such map exists: gas
and inertia store what goes in.

The surface is linear in its coefficients and has no constant, as a shaft at rest without torque loses nothing:

    P_loss = a w + b w^2 + c T^2 + d |T| + e w T

with friction that does not depend on speed (a), viscous friction and iron (b), copper (c), diodes (d) and a mesh that loses a
share of its power (e). It is fitted by least squares.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from winchcascade.core.accuracy import student
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.reduction.loss_points import LossPoints, columns_at

TERMS = {
    "speed": "N.m", "speed_squared": "N.m.s/rad", "torque_squared": "W/(N.m)2", "torque": "W/(N.m)", "speed_times_torque": "1",
}  # fmt: skip
"""Columns of the surface and units of their coefficients; of points that do not distinguish all, the first ones are fitted."""

CONDITION_MAX = 100.0
"""Largest condition number of scaled columns that are still distinguished: points all over a rectangle of torque and speed have
20 to 75, and from 100 on estimates suffer whatever the noise (Belsley, Kuh and Welsch 1980, Sec. 3.2). [1]"""

BREAKPOINTS = 25
"""Breakpoints of torque and of speed in the table: linear interpolation of a quadratic surface between them errs by less than a
thousandth of its curvature over the whole range."""

CLUSTERS = 12
"""Minimum number of cycles from which the errors of the points of one cycle are taken as correlated."""


class Coefficient(msgspec.Struct, frozen=True):
    """Coefficient of one column with its 95 % interval, in SI units.

    All three are None for a column that is left out, as the points do not distinguish it from those of `contained_in`. The
    interval alone is None where there are as many columns as points, so that no scatter shows.
    """

    term: str
    unit: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    contained_in: tuple[str, ...] = ()


class Surface(msgspec.Struct, frozen=True):
    """Surface of the loss: its coefficients and how well the points determine them.

    Parameters
    ----------
    values, covariance : (5,) and (5, 5), zero for columns that are left out
    freedom : degrees of freedom of the intervals; 0 for as many columns as points, which show no scatter
    condition : condition number of the columns that are fitted, each scaled to length one
    condition_all : the same of all five columns; infinite where some are the same
    residual : root mean square of what the surface leaves of the points [W]
    held_out : the same of points that took no part in the fit [W]; None for too few of them
    held_out_by : what was held out: each log, or of fewer than three each cycle
    """

    coefficients: tuple[Coefficient, ...]
    values: Signal
    covariance: Signal
    freedom: int
    condition: float
    condition_all: float
    residual: float
    held_out: float | None
    held_out_by: str


class LossMap(msgspec.Struct, frozen=True):
    """Loss over torque and speed: the points, the surface, and the surface as a table for interpolation.

    Parameters
    ----------
    hull : (k, 2) corners of the convex hull of the points, torque [N m] and speed [rad/s], anticlockwise
    torque, speed : (n,) and (m,) breakpoints [N m], [rad/s]
    loss, u_loss : (n, m) loss and its standard uncertainty [W]; NaN outside the hull
    energy, u_energy : lost in all points together, and its standard uncertainty, NaN where no scatter shows [J]
    """

    points: LossPoints
    surface: Surface
    hull: Signal
    torque: Signal
    speed: Signal
    loss: Signal
    u_loss: Signal
    energy: float
    u_energy: float


def make_loss_map(points: LossPoints) -> LossMap:
    """Fit the surface to some points and lay it onto a table within their hull."""
    surface = fit_surface(points)
    torque, speed = (np.linspace(float(x.min()), float(x.max()), BREAKPOINTS) for x in (points.torque, points.speed))
    grid = np.stack(np.meshgrid(torque, speed, indexing="ij"), axis=-1)
    corners, inside = convex_hull(np.column_stack((points.torque, points.speed)), grid)
    columns = columns_at(grid[..., 0], grid[..., 1])
    u = np.sqrt(np.maximum(np.einsum("...i,ij,...j", columns, surface.covariance, columns), 0.0))
    residual = (points.loss - points.columns @ surface.values) * points.duration
    _, place = np.unique(points.cycle, return_inverse=True)
    shifts = points.errors[:, :, 0].T @ points.duration
    return LossMap(
        points=points,
        surface=surface,
        hull=corners,
        torque=torque,
        speed=speed,
        loss=np.where(inside, columns @ surface.values, np.nan),
        u_loss=np.where(inside, u, np.nan),
        energy=float(points.loss @ points.duration),
        u_energy=math.hypot(*np.bincount(place, weights=residual), *shifts) if surface.freedom else math.nan,
    )


def fit_surface(points: LossPoints) -> Surface:
    """Fit the surface by least squares, with as many of its columns as the points distinguish.

    What is known of the sensors widens the intervals; those of which the rig file states no accuracy count as exact.
    """
    any_at = [k for k in range(len(TERMS)) if np.any(points.columns[:, k])]
    kept = any_at[:]
    while len(kept) > 1 and condition_number(points.columns[:, kept]) > CONDITION_MAX:
        kept.pop()
    x, by = points.columns[:, kept], "log" if np.unique(points.log).size >= 3 else "cycle"
    fitted = _solve(x, points.loss)
    residual = points.loss - x @ fitted
    covariance, freedom = _scatter(x, residual, points.cycle)
    for error in points.errors.swapaxes(0, 1):
        step = _solve(x + error[:, 1:][:, kept], points.loss + error[:, 0]) - fitted
        covariance = covariance + np.outer(step, step)
    values, whole = np.zeros(len(TERMS)), np.zeros((len(TERMS), len(TERMS)))
    values[kept], whole[np.ix_(kept, kept)] = fitted, covariance
    names, found = list(TERMS), []
    for k, (term, unit) in enumerate(TERMS.items()):
        if k in kept:
            value, half = float(values[k]), student(freedom) * math.sqrt(whole[k, k]) if freedom else math.nan
            ends = (value - half, value + half) if math.isfinite(half) else (None, None)
            found.append(Coefficient(term, unit, value, *ends))
        else:
            others = tuple(names[n] for n in kept) if k in any_at else ()
            found.append(Coefficient(term, unit, contained_in=others))
    return Surface(
        coefficients=tuple(found),
        values=values,
        covariance=whole,
        freedom=freedom,
        condition=condition_number(x),
        condition_all=condition_number(points.columns),
        residual=_rms(residual),
        held_out=_held_out(x, points.loss, points.log if by == "log" else points.cycle),
        held_out_by=by,
    )


def condition_number(x: Signal) -> float:
    """Condition number of columns scaled to length one; inf where they are dependent or a column is empty.

    >>> condition_number(np.eye(3)[:, :2])
    1.0
    """
    length = np.linalg.norm(x, axis=0)
    if not np.all(length > 0.0):
        return math.inf
    sizes = np.linalg.svd(x / length, compute_uv=False)
    if x.shape[0] < x.shape[1] or sizes[-1] <= 1e-12 * sizes[0]:
        return math.inf
    return float(sizes[0] / sizes[-1])


def _held_out(x: Signal, loss: Signal, groups: Index) -> float | None:
    """Root mean square error of points that took no part in the fit [W]; None where the others cannot be fitted."""
    errors = np.empty(loss.size)
    for group in np.unique(groups):
        out = groups == group
        if condition_number(x[~out]) == math.inf:
            return None
        errors[out] = loss[out] - x[out] @ _solve(x[~out], loss[~out])
    return _rms(errors)


def _solve(x: Signal, y: Signal) -> Signal:
    """Least squares of columns scaled to length one."""
    length = np.linalg.norm(x, axis=0)
    found: Signal = np.linalg.lstsq(x / length, y, rcond=None)[0] / length
    return found


def _rms(x: Signal) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _scatter(x: Signal, residual: Signal, cycle: Index) -> tuple[Signal, int]:
    """Covariance of the coefficients by the residuals of the points, and its degrees of freedom; 0 for none.

    Of many cycles the errors within each are added up before they are squared (Liang and Zeger 1986).
    """
    n, p = x.shape
    if n <= p:
        return np.full((p, p), np.nan), 0
    inverse = np.linalg.pinv(x)
    numbers, place = np.unique(cycle, return_inverse=True)
    if not CLUSTERS <= numbers.size < n:
        return np.asarray(residual @ residual / (n - p) * inverse @ inverse.T), n - p
    scores = np.stack([np.bincount(place, weights=row) for row in inverse * residual])
    return scores @ scores.T * (numbers.size / (numbers.size - 1.0) * (n - 1.0) / (n - p)), numbers.size - 1


EDGE = 1e-9
"""A place that lies outside of the hull by less than this share of its extent lies on its edge. [1]"""


def convex_hull(points: Signal, places: Signal) -> tuple[Signal, Mask]:
    """Corners of the convex hull of points, (k, 2), anticlockwise from the least x, and whether places, (..., 2), lie in it.

    Of points on a line the corners are the two ends, and no place lies in it.

    >>> square, inside = convex_hull(np.array([[0.0, 0.0], [2, 0], [1, 2], [1, 0.5]]), np.array([[1.0, 1.0], [0.0, 2.0]]))
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
    return np.roll(found, -int(np.lexsort(found.T[::-1])[0]), axis=0), beyond <= EDGE * np.ptp(corners)
