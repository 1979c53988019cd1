"""Signs that the causes of a fit are not the whole truth, as one table: what each compares, with
which limit, how often it rings where nothing is wrong, and what it detects.

A limit holds for all comparisons of a campaign together. Those of energies and efficiencies follow
from their number, those of the residual from campaigns with the right model: 5 % of these have any
alarm. `python benchmarks/alarms.py` measures it.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    AlarmKind,
    Contribution,
    NamedCause,
    Spot,
    StageEnergy,
)
from winchcascade.diagnosis.fit.evidence import Fit
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import Suspects
from winchcascade.diagnosis.judge.closure import ModelClosure
from winchcascade.diagnosis.judge.relevance import moved_by, share_of_plateau
from winchcascade.diagnosis.judge.residuals import block_rms, scatter, unsteadiness
from winchcascade.diagnosis.verdict_limits import (
    CANCELLED,
    CANCELLED_SHARE,
    CHANCE,
    FALSE_ALARM,
    LIKELY,
    PULLED,
    RESTLESS,
    SELDOM,
    STRUCTURED,
    UNSTEADY,
    WORSE,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from winchcascade.core.rig_file import ModelAccuracy


class Judged(msgspec.Struct, frozen=True):
    """What signs are sought in: a fit of some logs and, once they are known, what follows from it.

    `fitted` are the causes of the fit, `causes` those of them that matter.
    """

    data: Fitted
    suspects: Suspects
    fit: Fit
    fitted: tuple[NamedCause, ...] = ()
    causes: tuple[NamedCause, ...] = ()
    closure: ModelClosure | None = None
    energies: tuple[StageEnergy, ...] = ()
    contributions: tuple[Contribution, ...] = ()


class Sign(msgspec.Struct, frozen=True):
    """A kind of sign: what it `compares`, in which `unit`, and every comparison of its kind,
    within its limit or beyond.

    `rate` is the share of campaigns with the right model in which it rings, 0 where it did in none
    of 65 [1]; `detects` is the size of a fault that brings the usual largest comparison to the
    limit, in its unit.
    """

    kind: AlarmKind
    compares: str
    unit: str
    of: Callable[[Judged], Iterable[Alarm]]
    rate: float
    detects: float


def ringing(judged: Judged, *groups: Iterable[Sign]) -> tuple[Alarm, ...]:
    """What is beyond its limit, group by group, the worst of each first."""
    found: list[Alarm] = []
    for signs in groups:
        beyond = [alarm for sign in signs for alarm in sign.of(judged) if alarm.size > alarm.limit]
        found += sorted(beyond, key=lambda alarm: -alarm.size / max(alarm.limit, DUST))
    return tuple(found)


DUST = 1e-12
"""What no size or limit of a sign is smaller than, where one divides by it. [1]"""


# -------------------------------------------------------------------------------- of the residual
def structures(judged: Judged) -> Iterator[Alarm]:
    """Blocks that the fit leaves, by channel and phase."""
    for at, rms in block_rms(judged.data, judged.fit.z).items():
        yield Alarm("structure", Spot(*at), rms, STRUCTURED)


def scatters(judged: Judged) -> Iterator[Alarm]:
    """Samples within blocks of payout, by channel."""
    for channel, ratio in scatter(judged.data, judged.suspects, judged.fit).items():
        yield Alarm("scatter", Spot(channel, "payout", within_blocks=True), ratio, RESTLESS)


def ripples(judged: Judged) -> Iterator[Alarm]:
    """Blocks about their smooth course, by channel and phase."""
    for at, ratio in unsteadiness(judged.data, judged.suspects, judged.fit).items():
        yield Alarm("ripple", Spot(*at), ratio, UNSTEADY)


def pulls(judged: Judged) -> Iterator[Alarm]:
    """Nuisances of the fit."""
    for nuisance, size in zip(judged.data.nuisances, judged.fit.nu.tolist(), strict=True):
        yield Alarm("nuisance", nuisance, abs(size), PULLED)


OF_THE_RESIDUAL = (
    Sign(
        "structure",
        "root mean square of the blocks of a channel in a phase over all logs",
        "noise",
        structures,
        rate=SELDOM,
        detects=1.4,
    ),
    Sign(
        "scatter",
        "scatter within the blocks of payout, the worst log",
        "noise and model",
        scatters,
        rate=SELDOM,
        detects=2.3,
    ),
    Sign(
        "ripple",
        "scatter of blocks about a smooth course, the median of the logs",
        "noise",
        ripples,
        rate=SELDOM,
        detects=4.3,
    ),
    Sign(
        "nuisance",
        "a number of rig, sensors or model against its tolerance",
        "tolerance",
        pulls,
        rate=SELDOM,
        detects=PULLED,
    ),
)
"""Signs that the residual of a fit alone shows."""


# ---------------------------------------------------------------------------------- of the causes
def drifts(causes: Iterable[NamedCause]) -> Iterator[Alarm]:
    """Chance of a number that differs between runs: not this effect, or not it alone."""
    for cause in causes:
        for trend in cause.trends:
            size = -math.log10(max(trend.chance, 1e-300))
            yield Alarm("drift", Spot(effects=(cause.effect,)), size, -math.log10(CHANCE))


def implausible(causes: Iterable[NamedCause]) -> Iterator[Alarm]:
    """Numbers beyond their plausible range or at the limit of what is possible."""
    for cause in causes:
        beyond = any(number.beyond_range or number.at_limit for number in cause.parameters.values())
        yield Alarm("range", Spot(effects=(cause.effect,)), float(beyond), 0.0)


def improbable(causes: Iterable[NamedCause]) -> Iterator[Alarm]:
    """Probability that another explanation is the true one."""
    for cause in causes:
        yield Alarm(
            "improbable", Spot(effects=(cause.effect,)), 1.0 - cause.probability, 1.0 - LIKELY
        )


def cancelling(judged: Judged) -> Iterator[Alarm]:
    """Pairs of causes in a channel over all logs: where they cancel each other, one of them may
    only undo the other.
    """
    data = judged.data
    if len(judged.fit.names) < 2:
        return
    moved = moved_by(data, judged.suspects, judged.fit)
    shares = {name: share_of_plateau(data, x) for name, x in moved.items()}
    for one, other in combinations(moved, 2):
        smaller = np.minimum(shares[one], shares[other]).tolist()
        both = share_of_plateau(data, moved[one] + moved[other]).tolist()
        for channel, each, together in zip(CHANNELS, smaller, both, strict=True):
            if each > CANCELLED_SHARE:
                spot, size = Spot(channel, effects=(one, other)), each / max(together, DUST)
                yield Alarm("cancelling", spot, size, 1.0 / CANCELLED)


def made_worse(judged: Judged) -> Iterator[Alarm]:
    """Channels of held-out predictions, against noise and the deviation of the model."""
    data, closure = judged.data, judged.closure
    if closure is None:
        return
    allowed = np.where(data.seen & np.isfinite(closure.residual), data.noise**2, np.nan)
    for name, gap in closure.channels.items():
        mean = float(np.nanmean(allowed[:, CHANNELS.index(name)]))
        grown = (gap.after**2 - gap.before**2) / mean if mean > 0.0 else 0.0
        yield Alarm("worse", Spot(name), math.sqrt(max(grown, 0.0)), WORSE)


OF_THE_CAUSES = (
    Sign(
        "drift",
        "the number of a cause between runs",
        "power of ten of its chance",
        lambda one: drifts(one.fitted),
        rate=0.0,
        detects=-math.log10(CHANCE),
    ),
    Sign(
        "range",
        "the number of a cause against what is plausible",
        "1",
        lambda one: implausible(one.causes),
        rate=0.0,
        detects=0.0,
    ),
    Sign(
        "improbable",
        "the posterior of what is not a cause",
        "1",
        lambda one: improbable(one.causes),
        rate=0.0,
        detects=1.0 - LIKELY,
    ),
    Sign(
        "cancelling",
        "what each of two causes moves over what both move",
        "1",
        cancelling,
        rate=0.0,
        detects=1.0 / CANCELLED,
    ),
    Sign(
        "worse",
        "a channel of the held-out logs with the causes and without",
        "noise and model",
        made_worse,
        rate=0.0,
        detects=WORSE,
    ),
)
"""Signs that the causes show."""


# ------------------------------------------------------------------- of energies and efficiencies
def largest_of(count: int) -> float:
    """Standard uncertainties that none of some differences exceeds but with the probability
    `FALSE_ALARM` (Sidak 1967). [1]

    The uncertainties follow from the discrepancies that a fit finds, of which there are about as
    many as differences: they have Student's distribution with as many degrees of freedom.

    >>> round(largest_of(46), 1), round(largest_of(7), 1)
    (4.0, 5.1)
    """
    from scipy.special import stdtrit

    each = -math.expm1(math.log1p(-FALSE_ALARM) / max(count, 1))
    return -float(stdtrit(max(count, 1), 0.5 * each))


def unbalanced(energies: Iterable[StageEnergy]) -> Iterator[Alarm]:
    """Energies by run, phase and stage, all of the campaign together."""
    known = [one for one in energies if one.u > 0.0]
    limit = largest_of(len(known))
    for one in known:
        spot = Spot(f"energy_{one.stage}", one.phase, run=one.run)
        yield Alarm("energy", spot, abs(one.measured - one.after) / one.u, limit)


STAGES_OF = {"eta_pto": ("line", "gen"), "eta_trans": ("line", "mech"), "eta_gen": ("mech", "gen")}
"""Stages whose energies make each efficiency."""


def left_over(
    contributions: Iterable[Contribution], energies: Iterable[StageEnergy], accuracy: ModelAccuracy
) -> Iterator[Alarm]:
    """Residuals of efficiencies against what the rig file calls relevant and the uncertainty of
    their energies.
    """
    contributions = tuple(contributions)
    window = {(one.log, one.metric): abs(one.measured) for one in contributions}
    share = {
        (one.run, one.stage): _share_of_window(
            one, window.get((one.run, f"energy_{one.stage}"), math.nan)
        )
        for one in energies
        if one.phase == "payout" and one.measured
    }
    efficiencies = [
        one for one in contributions if one.metric in STAGES_OF and math.isfinite(one.measured)
    ]
    within = largest_of(len(efficiencies))
    for one in efficiencies:
        residual = next((part.value for part in one.parts if part.kind == "residual"), 0.0)
        first, last = (share.get((one.log, stage), math.inf) for stage in STAGES_OF[one.metric])
        known = within * abs(one.measured) * math.hypot(first, last)
        yield Alarm(
            "residual",
            Spot(one.metric, load=one.load),
            abs(residual),
            accuracy.relevant_efficiency + known,
        )


def _share_of_window(energy: StageEnergy, window: float) -> float:
    """Standard uncertainty of the energy of a window over that energy: noise averages out less than
    over a whole payout. [1]

    Parameters
    ----------
    window : mean energy of a window [J]; NaN where it is unknown
    """
    longer = abs(energy.measured) / (energy.cycles * window) if window > 0.0 else 1.0
    return energy.u / abs(energy.measured) * math.sqrt(max(longer, 1.0))


OF_ENERGIES = (
    Sign(
        "energy",
        "an energy of a run, phase and stage",
        "standard uncertainty",
        lambda one: unbalanced(one.energies),
        rate=FALSE_ALARM,
        detects=4.0,
    ),
    Sign(
        "residual",
        "an efficiency that the fit leaves, its energies' uncertainty allowed",
        "1",
        lambda one: left_over(one.contributions, one.energies, one.data.rig.model),
        rate=FALSE_ALARM,
        detects=0.02,
    ),
)
"""Signs that the energies of the logs show."""

SIGNS = (OF_THE_RESIDUAL, OF_THE_CAUSES, OF_ENERGIES)
"""Every sign, in groups."""
