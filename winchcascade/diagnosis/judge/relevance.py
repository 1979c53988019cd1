"""Which causes matter: what each changes, in what the rig file calls relevant, and effects that
only hint.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnosis_result import (
    LargestChange,
    Minor,
    NamedCause,
)
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from winchcascade.core.run import Signal


def minor_of(
    data: Fitted,
    causes: Iterable[NamedCause],
    changes: Mapping[str, Sequence[LargestChange]],
    moved: Mapping[str, Signal],
) -> tuple[Minor, ...]:
    """Causes that change nothing by as much as the rig file calls relevant, each with its largest
    change.

    Parameters
    ----------
    changes : what each cause changes of the efficiencies, by the model
    moved : (M, 5) what each moves, SI units
    """
    found = []
    for cause in causes:
        ratio, largest = largest_change(data, changes[cause.effect], moved[cause.effect])
        if largest is not None and ratio < 1.0:
            found.append(Minor(cause.effect, cause.stage, cause.parameters, largest))
    return tuple(found)


def largest_change(
    data: Fitted, efficiencies: Sequence[LargestChange], moved: Signal
) -> tuple[float, LargestChange | None]:
    """The largest change that an effect makes, and its size in what the rig file calls relevant.
    [1]
    """
    accuracy = data.rig.model
    changes = [
        (abs(change.change) / max(limit, 1e-12), change)
        for limit, several in (
            (accuracy.relevant_efficiency, efficiencies),
            (accuracy.relevant_share, _changes_of_channels(data, moved)),
        )
        for change in several
    ]
    return max(changes, key=lambda pair: pair[0], default=(math.inf, None))


def _changes_of_channels(data: Fitted, moved: Signal) -> list[LargestChange]:
    """What a cause that moves blocks, (M, 5), changes of the mean of each channel in each phase of
    each log, as a share of its plateau. [1]
    """
    level = np.concatenate([log.courses[:, :, 0] for log in data.logs])
    return [
        LargestChange(
            CHANNELS[k],
            float(np.mean(moved[here, k])) / max(float(np.max(level[here, k])), 1e-12),
            phase=PHASES[phase],
            load=data.logs[log].run.load,
        )
        for log, k, phase, here in data.cells()
        if here.size and np.max(level[here, k]) > 0.0
    ]
