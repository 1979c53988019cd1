"""The verdict on a gap, and which of the effects that are named are causes or candidates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from winchcascade.diagnosis.diagnosis_result import Alarm, NamedCause, Spot, Verdict
from winchcascade.diagnosis.verdict_limits import HALF, MARGIN, MOSTLY, OPEN

if TYPE_CHECKING:
    from collections.abc import Sequence

    Named = tuple[NamedCause, ...]


def verdict_of(signs: Sequence[Alarm], share: float) -> Verdict:
    """Verdict on a gap of which a share is closed.

    Explained needs more than a residual without structure: numbers that agree between runs and are
    plausible, no causes that cancel each other, no channel that a prediction makes worse, energies
    and efficiencies within their uncertainty. Unexplained: less than half is closed. Partly
    explained in between.
    """
    return "explained" if not signs else "unexplained" if share < HALF else "partly_explained"


def parted(
    causes: Sequence[NamedCause], signs: Sequence[Alarm], share: float
) -> tuple[Named, Named]:
    """Causes and candidates of a gap that is not explained: a name is a cause where the residual is
    small, and a candidate, which may imitate something else, otherwise.

    Parameters
    ----------
    share : of the gap that is closed [1]
    """
    small = share >= MOSTLY and all(
        one.size <= MARGIN * one.limit for one in signs if one.kind != "range"
    )
    cancelled = {
        name
        for one in signs
        if one.kind == "cancelling" and isinstance(one.about, Spot)
        for name in one.about.effects
    }
    listed = doubted(causes)
    steady = {one.effect for one in listed if small and not one.trends} - cancelled
    return tuple(one for one in listed if one.effect in steady), tuple(
        one for one in listed if one.effect not in steady
    )


def doubted(causes: Sequence[NamedCause]) -> Named:
    """Causes with the posterior that each may have while something else acts."""
    return tuple(
        msgspec.structs.replace(one, probability=min(one.probability, OPEN)) for one in causes
    )
