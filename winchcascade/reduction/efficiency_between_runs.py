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
from winchcascade.reduction.efficiency_changes import ALPHA, PRIOR, probability

SMOOTH = 0.005
"""Relative standard deviation of an efficiency about these laws that is assumed before any is measured: the repeatability from
day to day, and what the laws leave of a real machine."""

FAR = 0.01
"""Smallest distance of interest: twice the 0.005 to which an efficiency can be stated at best. [1]"""

MAX_FAR = 3
"""Minimum number of logs for each one that lies far from the others; with more of these the usual value is unclear."""

MAX_PAIRED = 30
"""Maximum number of logs of which pairs are tried: of more the others outvote two that were swapped."""

ALONE = 1e-6
"""Share of its own variance below which a log decides a term of the law by itself. [1]"""

TINY = 1e-6
"""No rig has a load, a speed or a power below this, nor a load above its inverse. [ohm, m/s, W]"""

LAWS = 3
"""Terms of the laws above, the constant included."""


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
    """Logs that are compared: 1 / efficiency and its standard deviation, (n,); terms of the law, (n, p); ln of the speed and
    share of the losses, (n,).
    """

    y: Signal
    sd: Signal
    terms: Signal
    ln_v: Signal
    lost: Signal


def logs_apart(logs: Sequence[LogEfficiency]) -> list[Apart]:
    """Find the logs whose efficiency lies far from the others; open circuits, and what no rig has, take no part.

    One log at a time is left out and predicted from the others, then two where no single one explains it, as of two logs that
    were swapped. Significance is that of all these comparisons together.
    """
    loaded = [log for log in logs if log.load is None or TINY < log.load < 1.0 / TINY]
    given = {m: [log for log in loaded if (log.eta.get(m) or 0.0) > FAR] for m in ("eta_trans", "eta_gen", "eta_pto")}
    tested = [m for m in ("eta_trans", "eta_gen") if len(given[m]) > 1] or ["eta_pto"]
    found: list[Apart] = []
    for metric in tested:
        for kind in dict.fromkeys(log.kind for log in given[metric]):
            found += _apart(metric, [log for log in given[metric] if log.kind == kind], len(tested))
    return found


def _apart(metric: str, logs: Sequence[LogEfficiency], metrics: int) -> list[Apart]:
    if metric != "eta_trans":
        logs = [log for log in logs if log.load is not None]
    left = list(range(len(logs)))
    rows = _rows(metric, logs)
    found: list[Apart] = []
    while rows is not None and len(found) < max(len(logs) // MAX_FAR, 1):
        chosen, others = _most_apart(rows, left, metrics)
        if not chosen:
            break
        left = [k for k in left if k not in chosen]
        for k in chosen:
            off, allowed, _ = (float(x[-1]) for x in _left_out(rows, [*left, k]))
            eta, expected = 1.0 / float(rows.y[k]), 1.0 / (float(rows.y[k]) - off)
            or_else = tuple(logs[n].name for n in others)
            found.append(Apart(logs[k].name, metric, eta, expected, allowed * eta * eta, or_else))
    return found


def _rows(metric: str, logs: Sequence[LogEfficiency]) -> _Rows | None:
    """The logs as rows, with as many terms of the law as their loads can determine; None where nothing can be compared."""
    eta = np.array([log.eta[metric] for log in logs])
    loads = [log.load for log in logs]
    distinct = len(set(loads)) if None not in loads else len(logs)
    v = np.array([max(log.speed, TINY) for log in logs])
    if metric == "eta_trans":
        if any((log.power or 0.0) < TINY for log in logs):
            return None
        power = np.array([log.power for log in logs])
        terms = np.column_stack([np.ones(len(logs)), v / power, v * v / power])
    else:
        r = np.array(loads, dtype=np.float64)
        terms = np.column_stack([np.ones(len(logs)), 1.0 / r, r])
    terms = terms[:, : min(LAWS, distinct)]
    terms /= np.linalg.norm(terms, axis=0) if len(logs) else 1.0
    u = np.array([log.uncertainty.get(metric) or 0.0 for log in logs]) / eta
    return _Rows(1.0 / eta, np.hypot(SMOOTH, u) / eta, terms, np.log(v), 1.0 - eta)


def _left_out(rows: _Rows, left: Sequence[int]) -> tuple[Signal, Signal, Signal]:
    """Each of the logs against the law that the others give: how far 1 / efficiency lies off, what its speed explains of that,
    and the share of its own variance in that of a prediction, 1 less its leverage; (k,) each, NaN where the others give no law.
    """
    sd = rows.sd[left]
    q, size, _ = np.linalg.svd(rows.terms[left] / sd[:, None], full_matrices=False)
    q = q[:, size > ALONE * size[0]]  # terms that go together, as at one speed, count once
    own = 1.0 - np.sum(q * q, axis=1)
    own[own < ALONE] = np.nan
    y, ln_v = rows.y[left] / sd, rows.ln_v[left] / sd
    off, speed = ((x - q @ (q.T @ x)) * sd / own for x in (y, ln_v))
    return off, rows.lost[left] * np.abs(speed) * rows.y[left], own


def _chances(rows: _Rows, left: Sequence[int]) -> tuple[Signal, Signal]:
    """Probability for each log that chance alone separates it so far from the others, (k,); 1 where these give no law.

    With it the distance in standard deviations, by whose square the others agree better without the log.
    """
    off, allowed, own = _left_out(rows, left)
    freedom = PRIOR + len(left) - 1 - rows.terms.shape[1]
    apart = np.abs(off) * np.sqrt(own) / rows.sd[left]
    square = np.nansum((off * own / rows.sd[left]) ** 2) - apart**2  # of the others alone
    scale = (PRIOR + np.maximum(square, 0.0)) / freedom
    beyond = np.maximum(np.abs(off) - allowed, 0.0)
    t = beyond / rows.sd[left] * np.sqrt(own / scale)
    of_interest = beyond / rows.y[left] ** 2 >= FAR
    chances = [probability(x, freedom) if far else 1.0 for x, far in zip(t.tolist(), of_interest, strict=True)]
    return np.array(chances), np.nan_to_num(apart)


def _pair_chance(rows: _Rows, left: Sequence[int], pair: tuple[int, int]) -> float:
    """Probability that chance alone separates two logs so far from the others; 1 where these give no law.

    Both are left out, so that neither hides the other.
    """
    by = [k for k in left if k not in pair]
    square = 0.0
    for k, one in enumerate(pair):
        off, allowed, _ = (float(x[-1]) for x in _left_out(rows, [*by, one]))
        if not (abs(off) - allowed) / rows.y[one] ** 2 >= FAR:  # nor where it is no number
            return 1.0
        off, allowed, own = (float(x[-1]) for x in _left_out(rows, [*by, *pair[: k + 1]]))  # by what came before it too
        square += own * (max(abs(off) - allowed, 0.0) / rows.sd[one]) ** 2
    rest, _, share = _left_out(rows, by)
    freedom = PRIOR + len(by) - rows.terms.shape[1]
    scale = (PRIOR + float(np.nansum((rest * share / rows.sd[by]) ** 2))) / freedom
    return float((1.0 + square / scale / freedom) ** (-0.5 * freedom))  # of Fisher's F with 2 and `freedom` degrees


def _significant(rows: _Rows, left: Sequence[int], metrics: int) -> list[tuple[int, ...]]:
    """The logs that lie apart from the others by more than chance allows, each alone, or two where no single one does."""
    if len(left) <= rows.terms.shape[1]:
        return []
    chances = dict(zip(left, _chances(rows, left)[0].tolist(), strict=True))
    found: list[tuple[int, ...]] = [(k,) for k in left if chances[k] * len(left) * metrics < ALPHA]
    pairs = list(combinations(left, 2)) if not found and 2 * MAX_FAR <= len(left) <= MAX_PAIRED else []
    of_pairs = {pair: _pair_chance(rows, left, pair) * len(pairs) * metrics for pair in pairs}
    best = min(of_pairs, key=lambda pair: of_pairs[pair], default=(-1, -1))
    return [best] if of_pairs.get(best, 1.0) < ALPHA else found


def _most_apart(rows: _Rows, left: Sequence[int], metrics: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The log, or the two, that lie furthest from the others, and the logs without which nothing would; empty if none.

    Of the logs that explain it alone, the one counts without which the others agree best. That need not be the least probable
    one: a wrong log spoils the prediction of the log beside it, and its own speed may explain more of its distance.
    """
    found = _significant(rows, left, metrics)
    if not found:
        return (), ()
    few = left if len(left) <= MAX_PAIRED else []
    alone: list[tuple[int, ...]] = [(k,) for k in few if not _significant(rows, [n for n in left if n != k], metrics)]
    apart = dict(zip(left, _chances(rows, left)[1].tolist(), strict=True))
    best = max(alone or found, key=lambda logs: max(apart[k] for k in logs))
    return best, tuple(k for (k,) in alone if (k,) != best)
