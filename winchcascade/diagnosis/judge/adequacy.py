"""Whether the causes of a fit are the whole truth: signs that an empty list of alarms about the residual does not show."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnosis_result import Alarm, Spot
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.verdict_limits import CANCELLED, CANCELLED_SHARE, FALSE_ALARM, LIKELY

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from winchcascade.core.rig_file import ModelAccuracy
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Contribution, NamedCause, StageEnergy
    from winchcascade.diagnosis.fit.evidence import Fit
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.fit.suspects import Suspects


def drifts(causes: Iterable[NamedCause]) -> list[Alarm]:
    """Causes whose number differs between runs or lies beyond its plausible range: not this effect, or not it alone."""
    found = []
    for cause in causes:
        for trend in cause.stability.trends if cause.stability else ():
            size = -math.log10(max(trend.chance, 1e-300))
            found.append(Alarm("drift", Spot(effects=(cause.effect,)), size, 3.0))
        if any(number.beyond_range or number.at_limit for number in cause.parameters.values()):
            found.append(Alarm("range", Spot(effects=(cause.effect,)), 1.0, 0.0))
    return found


def improbable(causes: Iterable[NamedCause]) -> list[Alarm]:
    """Causes in place of which others are more likely."""
    unlikely = [cause for cause in causes if cause.probability < LIKELY]
    return [Alarm("improbable", Spot(effects=(one.effect,)), 1.0 - one.probability, 1.0 - LIKELY) for one in unlikely]


def moved_by(data: Fitted, suspects: Suspects, fit: Fit) -> dict[str, Signal]:
    """What each cause of a fit moves in the prediction beside the others, (M, 5) each, SI units."""
    acting = dict(zip(fit.names, fit.effects(suspects), strict=True))
    whole = data.predict(fit.nu, [*acting.values()])
    return {
        name: whole - data.predict(fit.nu, [one for other, one in acting.items() if other != name]) for name in acting
    }


def cancelling(data: Fitted, moved: Mapping[str, Signal]) -> list[Alarm]:
    """Pairs of causes that cancel each other in a channel over all logs: one of them may only undo the other."""
    level = np.concatenate([log.courses[:, :, 0] for log in data.logs])
    found = []
    for one, other in combinations(moved, 2):
        for k, channel in enumerate(CHANNELS):
            here = data.seen[:, k] & (level[:, k] > 0.0)
            a, b = (moved[name][here, k] / level[here, k] for name in (one, other))
            if not here.any():
                continue
            smaller, both = min(_rms(a), _rms(b)), _rms(a + b)
            if smaller > CANCELLED_SHARE and both < CANCELLED * smaller:
                found.append(
                    Alarm(
                        "cancelling", Spot(channel, effects=(one, other)), smaller / max(both, 1e-12), 1.0 / CANCELLED
                    )
                )
    return found


def _rms(x: Signal) -> float:
    return float(np.sqrt(np.mean(x**2)))


def unbalanced(energies: Iterable[StageEnergy]) -> list[Alarm]:
    """Energies by run, phase and stage that the fit leaves beyond their uncertainty, all of the campaign together."""
    sizes = [(one, abs(one.measured - one.after) / one.u) for one in energies if one.u > 0.0]
    limit = largest_of(len(sizes))
    return [
        Alarm("energy", Spot(f"energy_{one.stage}", one.phase, run=one.run), size, limit)
        for one, size in sizes
        if size > limit
    ]


def largest_of(count: int) -> float:
    """Standard uncertainties that none of some differences exceeds but with the probability `FALSE_ALARM` (Sidak 1967). [1]

    The uncertainties follow from the discrepancies that a fit finds, of which there are about as many as differences: they
    have Student's distribution with as many degrees of freedom.

    >>> round(largest_of(46), 1), round(largest_of(7), 1)
    (4.0, 5.1)
    """
    from scipy.special import stdtrit

    each = -math.expm1(math.log1p(-FALSE_ALARM) / max(count, 1))
    return -float(stdtrit(max(count, 1), 0.5 * each))


STAGES_OF = {"eta_pto": ("line", "gen"), "eta_trans": ("line", "mech"), "eta_gen": ("mech", "gen")}
"""Stages whose energies make each efficiency."""


def left_over(
    contributions: Sequence[Contribution], energies: Iterable[StageEnergy], accuracy: ModelAccuracy
) -> list[Alarm]:
    """Residuals of efficiencies that exceed what the rig file calls relevant, beyond the uncertainty of their energies."""
    window = {(one.log, one.metric): abs(one.measured) for one in contributions}
    share = {
        (one.run, one.stage): _share_of_window(one, window.get((one.run, f"energy_{one.stage}"), math.nan))
        for one in energies
        if one.phase == "payout" and one.measured
    }
    limit, found = accuracy.relevant_efficiency, []
    efficiencies = [one for one in contributions if one.metric in STAGES_OF and math.isfinite(one.measured)]
    within = largest_of(len(efficiencies))
    for one in efficiencies:
        residual = next((part.value for part in one.parts if part.kind == "residual"), 0.0)
        first, last = (share.get((one.log, stage), math.inf) for stage in STAGES_OF[one.metric])
        if abs(residual) - within * abs(one.measured) * math.hypot(first, last) > limit:
            found.append(Alarm("residual", Spot(one.metric, load=one.load), abs(residual), limit))
    return found


def _share_of_window(energy: StageEnergy, window: float) -> float:
    """Standard uncertainty of the energy of a window over that energy: noise averages out less than over a whole payout. [1]

    Parameters
    ----------
    window : mean energy of a window [J]; NaN where it is unknown
    """
    longer = abs(energy.measured) / (energy.cycles * window) if window > 0.0 else 1.0
    return energy.u / abs(energy.measured) * math.sqrt(max(longer, 1.0))
