"""Logs of a campaign whose efficiency lies far from that of the others.

The gains of the sensors are common to a campaign, so that they do not separate its logs. Over the loads the losses have known
forms: in the generator 1 / eta_gen is linear in 1 / R (copper) and R (friction), in the transmission 1 / eta_trans is
linear in v / P (a constant force) and v^2 / P (drag), with the speed v and the mechanical power P. By these laws the others
predict a log.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency_changes import ALPHA, PRIOR

ETA_SCATTER = 0.005
"""Relative standard deviation of an efficiency about these laws that is assumed before any is measured: the repeatability from
day to day, and what the laws leave of a real machine."""

ETA_DISTANCE_MIN = 0.01
"""Smallest distance of interest: twice the 0.005 to which an efficiency can be stated at best. [1]"""

MIN_OTHERS = 3
"""Minimum number of logs for each one that lies far from the others; with more of these the usual value is unclear."""

MAX_PAIRED = 30
"""Maximum number of logs of which pairs are tried: of more the others outvote two that were swapped."""

PHYSICAL_MIN = 1e-6
"""No rig has a load, a speed or a power below this, nor a load above its inverse. [ohm, m/s, W]"""


class LogEfficiency(msgspec.Struct, frozen=True):
    """Efficiencies of a log: means with their standard uncertainties without the gains, load [ohm], speed of the
    payouts [m/s] and mechanical power [W]. Only logs of one `kind` (rig, window rule, measured or not) are compared. `cycles`
    has the energies of each complete cycle to six digits, which two cycles share by being the same one alone.
    """

    name: str
    kind: Hashable
    load: float | None
    speed: float
    power: float | None
    eta: Mapping[str, float | None]
    uncertainty: Mapping[str, float | None]
    cycles: frozenset[str] = frozenset()


class Apart(msgspec.Struct, frozen=True):
    """A log whose efficiency lies apart from what the others let expect; `or_else` names logs that would explain it as well."""

    name: str
    metric: str
    value: float
    expected: float
    allowed: float
    or_else: tuple[str, ...] = ()


class _Rows(NamedTuple):
    """Logs that are compared, by the standard deviation of 1 / efficiency, (n,): 1 / efficiency and ln of the speed over it,
    (n,); terms of the law over it, (n, p); and the share of the losses, (n,).
    """

    sd: Signal
    y: Signal
    ln_v: Signal
    terms: Signal
    lost: Signal


class _Distance(NamedTuple):
    """Some logs against the law that the others give: how far 1 / efficiency lies off, and what their speed explains of that,
    (m,) each; the probability that chance alone separates them so far, and the square by which the others agree better.
    """

    off: Signal
    allowed: Signal
    chance: float
    square: float


def logs_apart(logs: Sequence[LogEfficiency]) -> list[Apart]:
    """Find the logs whose efficiency lies far from the others; open circuits, and what no rig has, take no part.

    One log at a time is left out and predicted from the others, then two where no single one explains it, as of two logs that
    were swapped. Significance is that of all these comparisons together.
    """
    loaded = [log for log in logs if log.load is None or PHYSICAL_MIN < log.load < 1.0 / PHYSICAL_MIN]
    given = {
        m: [log for log in loaded if (log.eta.get(m) or 0.0) > ETA_DISTANCE_MIN]
        for m in ("eta_trans", "eta_gen", "eta_pto")
    }
    tested = [m for m in ("eta_trans", "eta_gen") if len(given[m]) > 1] or ["eta_pto"]
    found: list[Apart] = []
    for metric in tested:
        for kind in dict.fromkeys(log.kind for log in given[metric]):
            found += _apart(metric, [log for log in given[metric] if log.kind == kind], len(tested))
    return found


def _apart(metric: str, logs: Sequence[LogEfficiency], metrics: int) -> list[Apart]:
    if metric != "eta_trans":
        logs = [log for log in logs if log.load is not None]
    left, rows = list(range(len(logs))), _rows(metric, logs)
    found: list[Apart] = []
    while rows is not None and len(found) < max(len(logs) // MIN_OTHERS, 1):
        chosen, others = _most_apart(rows, left, metrics)
        if not chosen:
            break
        left = [k for k in left if k not in chosen]
        for k in chosen:
            distance, y = _distance(rows, left, (k,)), float(rows.y[k] * rows.sd[k])
            expected, allowed = 1.0 / (y - float(distance.off[0])), float(distance.allowed[0]) / y**2
            or_else = tuple(logs[n].name for n in others)
            found.append(Apart(logs[k].name, metric, 1.0 / y, expected, allowed, or_else))
    return found


def _rows(metric: str, logs: Sequence[LogEfficiency]) -> _Rows | None:
    """The logs as rows, with as many terms of the law as their loads can determine; None where nothing can be compared."""
    eta = np.array([log.eta[metric] for log in logs])
    loads = [log.load for log in logs]
    distinct = len(set(loads)) if None not in loads else len(logs)
    v = np.array([max(log.speed, PHYSICAL_MIN) for log in logs])
    if metric == "eta_trans":
        if any((log.power or 0.0) < PHYSICAL_MIN for log in logs):
            return None
        power = np.array([log.power for log in logs])
        terms = np.column_stack([np.ones(len(logs)), v / power, v * v / power])
    else:
        r = np.array(loads, dtype=np.float64)
        terms = np.column_stack([np.ones(len(logs)), 1.0 / r, r])
    terms = terms[:, :distinct]
    terms /= np.linalg.norm(terms, axis=0) if len(logs) else 1.0
    u = np.array([log.uncertainty.get(metric) or 0.0 for log in logs]) / eta
    sd = np.hypot(ETA_SCATTER, u) / eta
    return _Rows(sd, 1.0 / eta / sd, np.log(v) / sd, terms / sd[:, None], 1.0 - eta)


def _distance(rows: _Rows, left: Sequence[int], out: Sequence[int]) -> _Distance:
    """Compare some logs, of those that are left, with what all others predict; chance alone where these give no law."""
    by, of = [k for k in left if k not in out], list(out)
    inverse = np.linalg.pinv(rows.terms[by], rcond=PHYSICAL_MIN)  # terms that go together, as at one speed, count once
    weights = rows.terms[of] @ inverse
    known = np.abs(weights @ rows.terms[by] - rows.terms[of]).max() <= PHYSICAL_MIN * np.abs(rows.terms[of]).max()
    off, moved = (x[of] - weights @ x[by] for x in (rows.y, rows.ln_v))
    allowed = rows.lost[of] * np.abs(moved) * rows.y[of] * rows.sd[of]
    beyond = np.maximum(np.abs(off) - allowed, 0.0) * np.sign(off)
    variance = np.eye(len(of)) + weights @ weights.T
    rest = rows.y[by] - rows.terms[by] @ (inverse @ rows.y[by])
    freedom = PRIOR + len(by) - rows.terms.shape[1]
    f = beyond @ np.linalg.solve(variance, beyond) / len(of) / ((PRIOR + rest @ rest) / freedom)
    far = known and bool(np.all(np.abs(beyond) / (rows.y[of] ** 2 * rows.sd[of]) >= ETA_DISTANCE_MIN))
    square, chance = float(off @ np.linalg.solve(variance, off)) if known else 0.0, 1.0
    if far:
        from scipy.special import fdtrc

        chance = float(fdtrc(len(of), freedom, f))
    return _Distance(off * rows.sd[of], allowed * rows.sd[of], chance, square)


def _significant(rows: _Rows, left: Sequence[int], metrics: int) -> dict[tuple[int, ...], float]:
    """The logs that lie apart from the others by more than chance allows, each alone, or two where no single one does, and the
    square by which the others agree better without them."""
    if len(left) <= rows.terms.shape[1]:
        return {}
    single: dict[tuple[int, ...], _Distance] = {(k,): _distance(rows, left, (k,)) for k in left}
    found = {logs: d.square for logs, d in single.items() if d.chance * len(left) * metrics < ALPHA}
    if found or not 2 * MIN_OTHERS <= len(left) <= MAX_PAIRED:
        return found
    pairs = {pair: _distance(rows, left, pair) for pair in combinations(left, 2)}
    best = min(pairs, key=lambda pair: pairs[pair].chance)
    return {best: pairs[best].square} if pairs[best].chance * len(pairs) * metrics < ALPHA else {}


def _most_apart(rows: _Rows, left: Sequence[int], metrics: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The log, or the two, that lie furthest from the others, and the logs without which nothing would; empty if none.

    Of the logs that explain it alone, the one counts without which the others agree best. That need not be the least probable
    one: a wrong log spoils the prediction of the log beside it, and its own speed may explain more of its distance.
    """
    found = _significant(rows, left, metrics)
    if not found:
        return (), ()
    few = left if len(left) <= MAX_PAIRED else []
    alone = [k for k in few if not _significant(rows, [n for n in left if n != k], metrics)]
    squares = {(k,): _distance(rows, left, (k,)).square for k in alone} or found
    best = max(squares, key=lambda logs: round(squares[logs], 6))  # the first of those that explain it equally well
    return best, tuple(k for k in alone if (k,) != best)
