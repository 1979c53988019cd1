"""What each cause of a fit moves in the logs, and whether that is as much as the rig file calls
relevant.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnosis_result import LargestChange, Minor, NamedCause
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.evidence import Fit
    from winchcascade.diagnosis.fit.suspects import Suspects


def moved_by(data: Fitted, suspects: Suspects, fit: Fit) -> dict[str, Signal]:
    """What each cause of a fit moves in the prediction beside the others, (M, 5) each, SI units."""
    acting = fit.acting(suspects)
    whole = data.predict(fit.nu, [*acting.values()])
    others = {name: [one for other, one in acting.items() if other != name] for name in acting}
    return {name: whole - data.predict(fit.nu, kept) for name, kept in others.items()}


def plateaus_of(data: Fitted) -> Signal:
    """Size of each channel in the phase of each block, (M, 5) in SI units."""
    return np.concatenate([log.courses[:, :, 0] for log in data.logs])


def share_of_plateau(data: Fitted, moved: Signal) -> Signal:
    """Root mean square over all logs of what moves in each channel, (5,), as a share of its
    plateau. [1]

    Parameters
    ----------
    moved : (M, 5) SI units
    """
    level = plateaus_of(data)
    counted = data.seen & (level > 0.0)
    share = np.where(counted, moved / np.where(counted, level, 1.0), 0.0)
    count = np.maximum(np.count_nonzero(counted, axis=0), 1)
    return np.asarray(np.sqrt(np.sum(share**2, axis=0) / count))


def changes_of_means(data: Fitted, moved: Signal) -> Iterator[tuple[int, int, int, float]]:
    """Numbers of log, channel and phase, and the change of the mean there as a share of the
    plateau. [1]

    Parameters
    ----------
    moved : as in `share_of_plateau`
    """
    place = np.repeat(np.arange(len(data.sizes)), data.sizes), data.blocks.phase
    count, total, plateau = np.zeros((3, len(data.sizes), len(PHASES), len(CHANNELS)))
    np.add.at(count, place, data.seen)
    np.add.at(total, place, np.where(data.seen, moved, 0.0))
    np.maximum.at(plateau, place, data.seen * plateaus_of(data))
    for log, phase, k in np.argwhere(plateau > 0.0).tolist():
        cell = log, phase, k
        yield log, k, phase, float(total[cell] / (count[cell] * max(plateau[cell], 1e-12)))


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
    of_channels = [
        LargestChange(CHANNELS[k], change, phase=PHASES[phase], load=data.logs[log].run.load)
        for log, k, phase, change in changes_of_means(data, moved)
    ]
    changes = [
        (abs(change.change) / max(limit, 1e-12), change)
        for limit, several in (
            (accuracy.relevant_efficiency, efficiencies),
            (accuracy.relevant_share, of_channels),
        )
        for change in several
    ]
    return max(changes, key=lambda pair: pair[0], default=(math.inf, None))
