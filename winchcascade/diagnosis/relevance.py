"""Whether a significant cause matters to an engineer: whether it changes an efficiency or the mean of a channel by enough."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.contributions import EFFICIENCIES
from winchcascade.diagnosis.diagnosis_result import Contribution, LargestChange, Minor, NamedCause
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from winchcascade.diagnosis.evidence import Fit
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.suspects import Suspects


def minor_of(
    data: Fitted,
    suspects: Suspects,
    best: Fit,
    causes: Iterable[NamedCause],
    contributions: Sequence[Contribution],
) -> tuple[Minor, ...]:
    """Causes that change nothing by as much as the rig file calls relevant, each with its largest change."""
    accuracy, found = data.rig.model, []
    for cause in causes:
        changes = [
            (abs(change.change) / max(limit, 1e-12), change)
            for limit, several in (
                (accuracy.relevant_efficiency, of_efficiencies(cause.effect, contributions)),
                (accuracy.relevant_share, of_channels(data, suspects, best, cause.effect)),
            )
            for change in several
        ]
        ratio, largest = max(changes, key=lambda pair: pair[0], default=(math.inf, None))
        if largest is not None and ratio < 1.0:
            found.append(Minor(cause.effect, cause.stage, cause.parameters, largest))
    return tuple(found)


def of_efficiencies(effect: str, contributions: Sequence[Contribution]) -> list[LargestChange]:
    """What one cause changes of each efficiency of each run. [1]"""
    return [
        LargestChange(one.metric, part.value, load=one.load)
        for one in contributions
        if one.metric in EFFICIENCIES
        for part in one.parts
        if part.effect == effect
    ]


def of_channels(data: Fitted, suspects: Suspects, best: Fit, effect: str) -> list[LargestChange]:
    """What one cause changes of the mean of each channel in each phase of each log, as a share of its plateau. [1]"""
    acting = dict(zip(best.names, best.effects(suspects), strict=True))
    others = [one for name, one in acting.items() if name != effect]
    moved = data.predict(best.nu, [*acting.values()]) - data.predict(best.nu, others)
    level = np.concatenate([log.courses[:, :, 0] for log in data.logs])
    return [
        LargestChange(
            CHANNELS[k],
            float(np.mean(moved[here, k])) / max(float(np.max(level[here, k])), 1e-12),
            phase=PHASES[phase],
            load=data.logs[log].run.load,
        )
        for log, k, phase, here in data.cells()
        if here.size
    ]
