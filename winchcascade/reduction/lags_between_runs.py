"""Lags of the logs of a campaign taken together: one that all logs share, and one that a single log
has.

Each log determines a lag to its own uncertainty; what the law of a relation leaves out is common to
the logs. Their median is therefore known better than the lag of any of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import median, medians_of_others
from winchcascade.reduction.reduction_result import Relation

LOGS_MIN = 3
"""Smallest number of logs that are compared: of two that differ, either may be late."""

OF_LEAST = 0.5
"""Smallest lag that is reported of several logs, as a share of that of one log. [1]"""

KNOWN = 2.0
"""A log is compared if its law leaves out at most this many standard uncertainties of the lag that
is known best: an idle machine leaves out more. [1]"""


class LagBetween(NamedTuple):
    """A lag that shows beside other logs: names of the logs that have it, of how many; lag and
    standard uncertainty. [s]"""

    names: tuple[str, ...]
    all: int
    relation: Relation
    lag: float
    u: float


def lags_between(logs: Mapping[str, Sequence[Relation]]) -> Iterator[LagBetween]:
    """Lags that at least three logs share, and those of single logs that differ from the others.

    Parameters
    ----------
    logs : relations of each log of a campaign, by its name
    """
    kinds = dict.fromkeys((r.y, r.x, r.law) for relations in logs.values() for r in relations)
    for kind in kinds:
        known = {
            name: r
            for name, relations in logs.items()
            for r in relations
            if (r.y, r.x, r.law) == kind
        }
        best = min(r.u_law for r in known.values())
        clear = KNOWN * min(r.u for r in known.values())
        known = {name: r for name, r in known.items() if r.u_law <= clear}
        if len(known) < LOGS_MIN:
            continue
        lags = np.array([r.lag for r in known.values()])
        own = np.array(
            [max(r.u**2 - r.u_law**2, (OF_LEAST * r.u_law) ** 2) for r in known.values()]
        )
        of_mean = float(1.0 / np.sqrt(np.sum(1.0 / own)))
        usual, first = median(lags), next(iter(known.values()))
        shared = math.hypot(of_mean, best)
        if abs(usual) >= max(OF_LEAST * first.least, CERTAIN * shared):
            yield LagBetween(tuple(known), len(known), first, usual, shared)
        of_others = medians_of_others(lags).tolist()
        for (name, r), others in zip(known.items(), of_others, strict=True):
            u = math.hypot(r.u, of_mean)
            if not r.deviates and abs(r.lag - others) >= max(OF_LEAST * r.least, CERTAIN * u):
                yield LagBetween((name,), len(known), r, r.lag - others, u)
