"""The best load of a campaign, claimed only where the line moved alike at all loads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.reduction.campaign_record import SPEED_ALIKE, LogSummary, cascade_of, unlike_motion

SEED = 20260
"""Seed of the draws from which the probability follows that a load is the best."""

DRAWS = 20_000
"""Number of draws: the probability is known within a standard error of 0.0035, 0.5 over the root of this, or better."""


class Best(NamedTuple):
    """The log of the highest eta_pto, the probability that its load is the best, the best log of the next load, and how many
    logs the best load has.
    """

    run: LogSummary
    likely: float
    following: LogSummary
    logs: int


class LoadRanking(NamedTuple):
    """The best load, or why none is claimed: "" where there is one; and the smallest and largest plateau speed. [m/s]"""

    best: Best | None
    reason: str
    speeds: tuple[float, float] | None


def rank_loads(runs: Sequence[LogSummary]) -> LoadRanking:
    """The best load of some logs, if their plateau speeds are within `SPEED_ALIKE`; an open circuit is not compared."""
    given = _compared(runs)
    speeds = [run.plateau_speed_mps for run in given]
    known = [speed for speed in speeds if speed is not None]
    ends = (min(known), max(known)) if known else None
    if len({run.load_ohm for run in given}) < 2:
        return LoadRanking(None, "no two loads have an efficiency with its uncertainty", ends)
    if ends is None or len(known) < len(speeds):
        lacking = given[speeds.index(None)].load_ohm
        return LoadRanking(None, f"plateau speed unknown at {lacking:g} ohm; loads are compared at one motion", ends)
    unlike = unlike_motion(given)
    if unlike is not None:
        return LoadRanking(None, motion_words(*unlike), ends)
    return LoadRanking(_best(given), "", ends)


def motion_words(slow: LogSummary, fast: LogSummary) -> str:
    """Plateau speeds of the slowest and the fastest of some logs with a load, and what follows from them."""
    ends = " to ".join(f"{run.plateau_speed_mps:.2f} m/s at {run.load_ohm:g} ohm" for run in (slow, fast))
    return f"plateau speeds differ, {ends}; loads are compared at one motion, within {100 * SPEED_ALIKE:g} %"


def _compared(runs: Sequence[LogSummary]) -> list[LogSummary]:
    """Logs with a load and an efficiency of the whole cascade with its uncertainty."""
    eta = cascade_of(runs).overall
    given = [run for run in runs if run.standard_uncertainty.get(eta) and run.mean.get(eta) is not None]
    return [run for run in given if run.load_ohm is not None and not run.open_circuit]


def _best(given: Sequence[LogSummary]) -> Best:
    """The load of the log of the highest efficiency of the whole cascade, and the next load; of logs of two loads or more.

    Each mean is drawn from a normal distribution with its standard uncertainty, the logs independent of each other: as
    logs with the same sensors share their errors, the true probability is rather higher. A load is the best where any of
    its logs is.
    """
    eta = cascade_of(given).overall
    loads = np.array([run.load_ohm for run in given], dtype=float)
    mean = np.array([run.mean[eta] for run in given])
    u = np.array([run.standard_uncertainty[eta] for run in given])
    drawn = mean + u * np.random.default_rng(SEED).standard_normal((DRAWS, len(given)))
    share = np.bincount(np.argmax(drawn, axis=1), minlength=len(given)) / DRAWS
    order = np.argsort(-mean, kind="stable")
    same = loads == loads[order[0]]
    following = next(k for k in order.tolist() if not same[k])
    return Best(given[order[0]], float(share[same].sum()), given[following], int(same.sum()))


def ranking_record(runs: Sequence[LogSummary]) -> dict[str, object]:
    """The ranking as fields of the record of a campaign: the best load or null, and why none is claimed."""
    ranking, eta = rank_loads(runs), cascade_of(runs).overall
    best = None
    if ranking.best is not None:
        run = ranking.best.run
        best = {
            "load_ohm": run.load_ohm,
            "run": run.name,
            "metric": eta,
            "value": run.mean[eta],
            "probability": ranking.best.likely,
        }
    return {
        "best_load": best,
        "best_load_reason": ranking.reason.replace("ohm", "Ω") or None,
        "plateau_speeds_mps": ranking.speeds,
    }
