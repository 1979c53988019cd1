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
    seen, phases = data.seen, len(PHASES)
    place = np.repeat(np.arange(len(data.sizes)), data.sizes) * phases + data.blocks.phase
    order = np.argsort(place, kind="stable")
    cells, first = np.unique(place[order], return_index=True)
    of_blocks = (np.add, seen), (np.add, moved * seen), (np.maximum, plateaus_of(data) * seen)
    count, total, plateau = (over.reduceat(1.0 * x[order], first) for over, x in of_blocks)
    change = total / np.maximum(count, 1.0) / np.maximum(plateau, 1e-12)
    for cell, k in np.argwhere(plateau > 0.0).tolist():
        log, phase = divmod(int(cells[cell]), phases)
        yield log, k, phase, float(change[cell, k])


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
