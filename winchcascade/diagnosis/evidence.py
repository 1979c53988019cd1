"""The fit of a set of suspects to a campaign, with every nuisance beside them, and what speaks for the set."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.diagnosis.solve import bounded_step, huber, joint_step, quadratic, weights
from winchcascade.diagnosis.suspects import Suspects, freedom, with_values

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.rig.effects.effect import ActiveEffect

STEP = 0.02
"""Share of a field's plausible range by which its derivative is taken."""

ROUNDS, ROUNDS_QUICK = 12, 5
"""Steps of a fit at most; of a quick one, which finds its columns anew once at most."""

SETTLED, SETTLED_QUICK = 0.05, 0.5
"""A fit has settled when a step improves its objective by less than this; a quick one sooner. [1]"""

AS_FORESEEN, AS_FORESEEN_QUICK = 0.8, 0.5
"""Columns are found anew when a step brings less than this share of what they promised; for a quick fit when less than that."""


class Fit(msgspec.Struct, frozen=True):
    """A set of suspects, fitted.

    `values` holds each suspect's fields, `nu` the nuisances in units of their tolerance, `loss` the robust objective with the
    nuisances' priors, `z` the whitened residuals. Of all fields in a row, nuisances done away with: `curve` (k, k) and `slope`
    (k,) of the objective, bounds `low` and `high` (k,). `j_nu` are the columns of the nuisances, `columns` those of suspects.
    """

    names: tuple[str, ...]
    values: tuple[Signal, ...]
    nu: Signal
    loss: float
    z: Signal
    curve: Signal
    slope: Signal
    low: Signal
    high: Signal
    j_nu: Signal
    columns: Mapping[str, Signal]

    def cost(self, scale: float) -> float:
        """What the freedom of its fields costs, residuals scaled by the square `scale`."""
        if not self.names:
            return 0.0
        return cost_of(self.curve / scale, self.slope / scale, np.concatenate(self.values), self.low, self.high)

    def effects(self, suspects: Suspects) -> list[ActiveEffect]:
        """The suspects with the values that were found."""
        return [with_values(suspects[name], x) for name, x in zip(self.names, self.values, strict=True)]


def all_columns(
    data: Fitted, suspects: Suspects, nu: Signal, values: Mapping[str, Signal], wanted: Iterable[str]
) -> dict[str, Signal]:
    """Whitened derivative of the prediction over fields of some suspects, each (M * 5, k), where those with `values` act."""
    made = {name: with_values(suspects[name], x) for name, x in values.items()}
    variants: list[tuple[Signal, list[ActiveEffect]]] = []
    steps: list[float] = []
    place: dict[str, slice] = {}
    for name in wanted:
        free = freedom(suspects[name])
        here = values.get(name, free.absent)
        others = [effect for other, effect in made.items() if other != name]
        place[name] = slice(len(steps), len(steps) + here.size)
        for k in range(here.size):
            step = STEP * (free.high[k] - free.low[k])
            step = -step if here[k] + step > free.high[k] else step
            moved = here.copy()
            moved[k] += step
            variants.append((nu, [*others, with_values(suspects[name], moved)]))
            steps.append(float(step))
    if not variants:
        return {}
    columns = data.whiten(data.differences(nu, [*made.values()], variants) / np.array(steps))
    return {name: columns[:, own] for name, own in place.items()}


def fit_set(
    data: Fitted,
    suspects: Suspects,
    names: tuple[str, ...],
    *,
    start: Fit | None = None,
    rows: Signal | None = None,
    quick: bool = False,
    reach: float = math.inf,
) -> Fit:
    """Fit a set of suspects by Gauss and Newton, nuisances beside them.

    Parameters
    ----------
    start : a fit to begin from, whose columns, if any, serve as long as they foresee what a step brings; suspects that it lacks
        begin absent
    rows : (M * 5,) weights of the residuals, 0 for what takes no part; 1 for all by default
    quick : a few steps, enough to tell which of some sets is best
    reach : largest magnitude of a nuisance, in units of its tolerance
    """
    begun = {} if start is None else dict(zip(start.names, start.values, strict=True))
    values = {name: begun.get(name, freedom(suspects[name]).absent) for name in names}
    nu = np.zeros(len(data.nuisances)) if start is None else np.clip(start.nu, -reach, reach)
    take = np.ones(data.measured.size) if rows is None else rows
    j_nu = _nuisance_columns(data, suspects, nu, values) if start is None or not start.j_nu.size else start.j_nu
    columns = {} if start is None else {name: start.columns[name] for name in names if name in start.columns}
    columns |= all_columns(data, suspects, nu, values, [name for name in names if name not in columns])
    here = _point(data, suspects, take, nu, values)
    low, high = _bounds(suspects, names)
    settled, foresight = (SETTLED_QUICK, AS_FORESEEN_QUICK) if quick else (SETTLED, AS_FORESEEN)
    renewals, fresh = (1 if quick else ROUNDS), True
    for _ in range(ROUNDS_QUICK if quick else ROUNDS):
        j_phi, x = _side_by_side(columns, names, here.z.size), _in_a_row(here.values)
        d_phi, d_nu, promised = _step(here, j_phi, j_nu, take, (low - x, high - x), reach)
        gained = 0.0
        for share in SHARES:
            there = _point(data, suspects, take, here.nu + share * d_nu, _moved(here.values, share * d_phi))
            if there.loss < here.loss:
                gained, here = here.loss - there.loss, there
                break
        if gained < settled and (fresh or promised < settled or not renewals):
            break
        if gained and abs(promised - gained) < settled:
            break  # as foreseen: this is the minimum
        fresh = renewals > 0 and gained < foresight * promised
        if fresh:
            renewals -= 1
            columns = all_columns(data, suspects, here.nu, here.values, names)
            j_nu = _nuisance_columns(data, suspects, here.nu, here.values)
    j_phi = _side_by_side(columns, names, here.z.size)
    q = quadratic(here.z, weights(here.z), j_nu * take[:, None], j_phi * take[:, None], here.nu)
    return Fit(
        names, tuple(here.values.values()), here.nu, here.loss, here.z, q.curve, q.slope, low, high, j_nu, columns
    )


class _Point(NamedTuple):
    """Where a fit stands: nuisances, fields of the suspects, whitened residuals that count, and the objective."""

    nu: Signal
    values: Mapping[str, Signal]
    z: Signal
    loss: float


def _point(data: Fitted, suspects: Suspects, take: Signal, nu: Signal, values: Mapping[str, Signal]) -> _Point:
    z = data.residual(nu, _made(suspects, values)) * take
    return _Point(nu, values, z, huber(z) + 0.5 * float(nu @ nu))


def _step(
    here: _Point, j_phi: Signal, j_nu: Signal, take: Signal, room: tuple[Signal, Signal], reach: float
) -> tuple[Signal, Signal, float]:
    """The step of fields and nuisances that the columns ask for, and by how much they promise the objective to fall.

    Parameters
    ----------
    j_phi, j_nu : columns of the fields and of the nuisances
    take : weights of the residuals
    room : how far each field may go down and up
    """
    w, seen = weights(here.z), (j_phi * take[:, None], j_nu * take[:, None])
    d_phi, d_nu = bounded_step(quadratic(here.z, w, seen[1], seen[0], here.nu), *room)
    if np.any(np.abs(here.nu + d_nu) > reach):
        d_phi, d_nu = joint_step(here.z, w, seen, here.nu, room, reach)
    foreseen, nu = here.z - (j_nu @ d_nu + j_phi @ d_phi) * take, here.nu + d_nu
    return d_phi, d_nu, here.loss - huber(foreseen) - 0.5 * float(nu @ nu)


def _nuisance_columns(data: Fitted, suspects: Suspects, nu: Signal, values: Mapping[str, Signal]) -> Signal:
    made = _made(suspects, values)
    return data.nuisance_columns(nu, made, data.predict(nu, made))


SHARES = (1.0, 0.4, 0.15, 0.05)
"""Shares of a step that are tried until one brings the objective down."""


def _made(suspects: Suspects, values: Mapping[str, Signal]) -> list[ActiveEffect]:
    return [with_values(suspects[name], x) for name, x in values.items()]


def _moved(values: Mapping[str, Signal], step: Signal) -> dict[str, Signal]:
    ends = np.cumsum([0, *(v.size for v in values.values())])
    return {name: v + step[a:b] for (name, v), a, b in zip(values.items(), ends[:-1], ends[1:], strict=True)}


def _in_a_row(values: Mapping[str, Signal]) -> Signal:
    return np.concatenate([*values.values()]) if values else np.zeros(0)


def _side_by_side(columns: Mapping[str, Signal], names: Sequence[str], rows: int) -> Signal:
    return np.hstack([columns[name] for name in names]) if names else np.zeros((rows, 0))


def _bounds(suspects: Suspects, names: Sequence[str]) -> tuple[Signal, Signal]:
    free = [freedom(suspects[name]) for name in names]
    low, high = (
        _in_a_row({n: f.low for n, f in zip(names, free, strict=True)}),
        _in_a_row({n: f.high for n, f in zip(names, free, strict=True)}),
    )
    return low, high


def cost_of(curve: Signal, slope: Signal, x: Signal, low: Signal, high: Signal) -> float:
    """What the freedom of fields costs: the share of their plausible ranges that the data leave (Laplace).

    A field at its bound keeps a half of its normal or, where the objective rises from the bound, an exponential.

    Parameters
    ----------
    curve, slope : (k, k) and (k,) of the objective at the fields `x`, (k,)
    """
    span = high - low
    eps = 1e-9 * span
    at_bound = (x <= low + eps) | (x >= high - eps)
    inside = ~at_bound
    cost = 0.0
    if inside.any():
        scaled = curve[np.ix_(inside, inside)] * np.outer(span[inside], span[inside]) + np.eye(int(inside.sum()))
        cost += 0.5 * float(np.linalg.slogdet(scaled)[1]) - 0.5 * int(inside.sum()) * math.log(2.0 * math.pi)
    for k in np.flatnonzero(at_bound):
        width = math.sqrt(0.5 * math.pi / max(float(curve[k, k]), 1e-300))
        cost += math.log(span[k] / min(width, 1.0 / max(abs(float(slope[k])), 1e-300), span[k]))
    return max(cost, 0.0)
