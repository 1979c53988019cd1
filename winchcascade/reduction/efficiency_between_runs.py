"""Logs of a campaign whose efficiency lies far from that of the others.

The gains of the sensors are common to a campaign, so that they do not separate its logs. Over the
loads the losses have known forms: in the generator 1 / eta_gen is linear in 1 / R (copper) and R
(friction), in the transmission 1 / eta_trans is linear in v / P (a constant force) and v^2 / P
(drag), with the speed v and the mechanical power P. By these laws the others predict a log.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency_changes import ALPHA, PRIOR
from winchcascade.reduction.reduction_result import Relation

ETA_SCATTER = 0.005
"""Relative standard deviation of an efficiency about these laws that is assumed before any is
measured: the repeatability from day to day, and what the laws leave of a real machine."""

ETA_DISTANCE_MIN = 0.01
"""Smallest distance of interest: twice the 0.005 to which an efficiency can be stated at best.
[1]
"""

MIN_OTHERS = 3
"""Minimum number of logs for each one that lies far from the others; with more of these the
usual value is unclear.
"""

MAX_TRIED = 30
"""Maximum number of logs each of which is tried as the one that explains why any lies apart; of
more the others outvote it.
"""

EXTREME = 1e-6
"""No log of a campaign has a load that is so small a share of the median one, or so many times it,
nor a speed or a power that is so small a share of the largest. [1]"""


class LogEfficiency(msgspec.Struct, frozen=True):
    """Efficiencies of a log: means with their standard uncertainties without the gains, load [ohm],
    speed of the payouts [m/s] and mechanical power [W]. Only logs of one `kind` (rig, window rule,
    measured or not) are compared. `cycles` has the energies of each complete cycle to six digits,
    which two cycles share by being the same one alone; `relations` are how its channels follow its
    motion.
    """

    name: str
    kind: Hashable
    load: float | None
    speed: float
    power: float | None
    eta: Mapping[str, float | None]
    uncertainty: Mapping[str, float | None]
    cycles: frozenset[str] = frozenset()
    relations: tuple[Relation, ...] = ()


class Apart(msgspec.Struct, frozen=True):
    """A log whose efficiency lies apart from what the others let expect; `or_else` names logs
    that would explain it as well.
    """

    name: str
    metric: str
    value: float
    expected: float
    allowed: float
    or_else: tuple[str, ...] = ()


class _Rows(NamedTuple):
    """Logs that are compared, by the standard deviation of 1 / efficiency, (n,): 1 / efficiency and
    ln of the speed over it, (n,); terms of the law over it, (n, p); and the share of the losses,
    (n,).
    """

    sd: Signal
    y: Signal
    ln_v: Signal
    terms: Signal
    lost: Signal


class _Distances(NamedTuple):
    """Logs, each against the law that the others give, (n,) each: how far 1 / efficiency lies off,
    and what its speed explains of that; the probability that chance alone separates it so far, and
    the square by which the others agree better without it.
    """

    off: Signal
    allowed: Signal
    chance: Signal
    square: Signal


def logs_apart(logs: Sequence[LogEfficiency]) -> list[Apart]:
    """Find the logs whose efficiency lies far from the others; open circuits, and what no rig has,
    take no part.

    One log at a time is left out and predicted from the others. Significance is that of all these
    comparisons together.
    """
    finite = [log.load for log in logs if log.load is not None and log.load < math.inf]
    usual = median(np.array(finite)) if finite else math.nan
    loaded = [log for log in logs if log.load is None or EXTREME < log.load / usual < 1.0 / EXTREME]
    given = {
        m: [log for log in loaded if (log.eta.get(m) or 0.0) > ETA_DISTANCE_MIN]
        for m in ("eta_trans", "eta_gen", "eta_pto")
    }
    tested = [m for m in ("eta_trans", "eta_gen") if len(given[m]) > 1] or ["eta_pto"]
    found: list[Apart] = []
    for metric in tested:
        for kind in dict.fromkeys(log.kind for log in given[metric]):
            found += _apart(
                metric, [log for log in given[metric] if log.kind == kind], ALPHA / len(tested)
            )
    return found


def _apart(metric: str, logs: Sequence[LogEfficiency], alpha: float) -> list[Apart]:
    """The logs of one kind that lie apart with a probability of chance below `alpha`, the furthest
    first.

    Of the logs that explain alone why any lies apart, the one counts without which the others agree
    best. That need not be the least probable one: a wrong log spoils the prediction of the log
    beside it, and its own speed may explain more of its distance.
    """
    logs = [log for log in logs if metric == "eta_trans" or log.load is not None]
    rows, left = _rows(metric, logs), list(range(len(logs)))
    found: list[Apart] = []
    while rows is not None and len(found) < max(len(logs) // MIN_OTHERS, 1):
        far = _significant(rows, left, alpha)
        if not far:
            break
        tried = left if len(left) <= MAX_TRIED else []
        alone = [k for k in tried if not _significant(rows, [n for n in left if n != k], alpha)]
        apart = _distances(rows, left)
        places = [left.index(k) for k in alone or far]
        place = max(
            places, key=lambda n: round(float(apart.square[n]), 6)
        )  # the first of those that explain it equally well
        best = left.pop(place)
        y, others = (
            float(rows.y[best] * rows.sd[best]),
            tuple(logs[k].name for k in alone if k != best),
        )
        expected = 1.0 / (y - float(apart.off[place]))
        allowed = float(apart.allowed[place]) / y**2
        found.append(Apart(logs[best].name, metric, 1.0 / y, expected, allowed, others))
    return found


def _rows(metric: str, logs: Sequence[LogEfficiency]) -> _Rows | None:
    """The logs as rows, with as many terms of the law as their loads can determine; None where
    nothing can be compared.
    """
    eta = np.array([log.eta[metric] for log in logs])
    loads = [log.load for log in logs]
    distinct = len(set(loads)) if None not in loads else len(logs)
    v, watts = np.array([log.speed for log in logs]), np.array([log.power or 0.0 for log in logs])
    v = np.maximum(v, EXTREME * np.max(v, initial=0.0))
    if metric == "eta_trans":
        if np.any(watts <= EXTREME * np.max(watts, initial=0.0)):
            return None
        terms = np.column_stack([np.ones(len(logs)), v / watts, v * v / watts])
    else:
        r = np.array(loads, dtype=np.float64)
        terms = np.column_stack([np.ones(len(logs)), 1.0 / r, r])
    terms = terms[:, :distinct]
    size = np.linalg.norm(terms, axis=0)
    terms = np.divide(terms, size, out=np.zeros_like(terms), where=size > 0.0)
    u = np.array([log.uncertainty.get(metric) or 0.0 for log in logs]) / eta
    sd = np.hypot(ETA_SCATTER, u) / eta
    return _Rows(sd, 1.0 / eta / sd, np.log(v) / sd, terms / sd[:, None], 1.0 - eta)


def _significant(rows: _Rows, left: Sequence[int], alpha: float) -> list[int]:
    """The logs, of those that are left, that lie apart from the others by more than chance
    allows.
    """
    if len(left) <= rows.terms.shape[1]:
        return []
    chance = _distances(rows, left).chance.tolist()
    return [k for k, of in zip(left, chance, strict=True) if of * len(left) < alpha]


def _distances(rows: _Rows, left: Sequence[int]) -> _Distances:
    """Compare each of the logs that are left with what the others predict; chance alone where these
    give no law.

    A log that is left out changes the fit of all by its leverage alone (Cook 1977).
    """
    sd, y, ln_v, terms, lost = (x[left] for x in rows)
    basis, size, _ = np.linalg.svd(terms, full_matrices=False)
    basis = basis[
        :, size > EXTREME * size[0]
    ]  # terms that go together, as at one speed, count once
    free = 1.0 - np.einsum("ij,ij->i", basis, basis)
    known = free > EXTREME**2
    free = np.where(known, free, 1.0)
    residual, moved = (x - basis @ (basis.T @ x) for x in (y, ln_v))
    off, allowed = residual / free, lost * np.abs(moved / free) * y * sd
    beyond, square = np.maximum(np.abs(off) - allowed, 0.0), off**2 * free
    freedom = PRIOR + len(left) - 1 - terms.shape[1]
    f = beyond**2 * free / ((PRIOR + residual @ residual - square) / freedom)
    far = known & (beyond / (y**2 * sd) >= ETA_DISTANCE_MIN)
    chance = np.ones(len(left))
    if far.any():
        from scipy.special import fdtrc

        chance[far] = fdtrc(1, freedom, f[far])
    return _Distances(off * sd, allowed * sd, chance, np.where(known, square, 0.0))
