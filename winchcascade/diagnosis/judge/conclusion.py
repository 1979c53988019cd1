"""How a search concludes: its best set has no imitator, and no smaller set predicts held-out
logs better.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.search import Found, gone_on, weighing
from winchcascade.diagnosis.judge.alarms import OF_THE_RESIDUAL, Judged, cancelling, ringing
from winchcascade.diagnosis.judge.causes import COVERED, look_alikes_of
from winchcascade.diagnosis.judge.closure import HeldOut, share_closed
from winchcascade.diagnosis.judge.relevance import moved_by, share_of_plateau
from winchcascade.diagnosis.judge.stability import stabilities
from winchcascade.diagnosis.verdict_limits import DISPENSABLE, LAW

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from winchcascade.core.run import Signal


RESUMED_MAX = 4
"""Maximum number of times that a search goes on from what its conclusion finds."""


MUCH_MORE = 2.0
"""Share of the gap that a smaller set leaves in the logs of its own fit, over the most that the best
set leaves on held-out logs, from which it is not tried on these: they hardly leave less. [1]"""


def concluded(
    data: Fitted, found: Found, held_out: HeldOut, on_progress: Callable[[str], None]
) -> Found:
    """A search at its end: its best set has no imitator, and no smaller set predicts held-out logs
    better.

    Look-alikes of its causes are fitted. Where one of these has more evidence, the search goes on
    from there.
    """
    for _ in range(RESUMED_MAX):
        on_progress("predicting withheld runs with fewer causes")
        found = predicting_best(without_imitators(data, found), held_out)
        look_alikes_of(found)
        further = gone_on(found, on_progress)
        if further.best.names == found.best.names:
            break
        found = further
    return found


def predicting_best(found: Found, held_out: HeldOut) -> Found:
    """A search without a best set that predicts held-out logs worse than nothing does, and without
    one of several causes of which fewer, or another effect alone, predict them better; or as well,
    where causes of the set cancel each other.
    """
    best, data = found.best, held_out.data
    if best.names and held_out.of(found, best).high < 0.0:
        without = msgspec.structs.replace(found, rejected=found.rejected | {best.names})
        return predicting_best(gone_on(without), held_out)
    if len(best.names) < 2:
        return found
    of_best, worth = held_out.of(found, best), weighing(found).worth
    suspects = found.problem.suspects
    cancel = any(pair.size > pair.limit for pair in cancelling(Judged(data, suspects, best)))
    spared = DISPENSABLE if cancel else 0.0
    least = 1.0 - MUCH_MORE * (1.0 - of_best.low) - spared
    fewer = [found.without(name) for name in best.names]
    fewer = [fit for fit in fewer if share_closed(data, suspects, fit) >= least]
    tried = {fit.names: fit for fit in (*fewer, *found.singles()) if found.allowed(fit.names)}
    closures = {names: held_out.of(found, fit) for names, fit in tried.items()}
    chosen = [names for names, closure in closures.items() if closure.closes_more_than(of_best)]
    if not chosen and cancel:
        chosen = [
            names for names, closure in closures.items() if closure.share >= of_best.share - spared
        ]
    if not chosen:
        return found
    names = max(chosen, key=lambda names: worth(tried[names]))
    of_smaller = worth(tried[names])
    larger = {
        other
        for other, fit in found.fits.items()
        if len(other) > len(names) and worth(fit) > of_smaller
    }
    smaller = msgspec.structs.replace(found, rejected=found.rejected | larger)
    smaller.about(tried[names])
    return predicting_best(smaller.led_by(names), held_out)


def is_within_law(moved: Mapping[str, Signal], name: str) -> bool:
    """Whether a cause moves no channel by more than what the law of one other cause leaves open of
    what that moves.

    >>> moved = {"large": np.array([0.1, 0.0]), "small": np.array([0.001, 0.0])}
    >>> [is_within_law(moved, name) for name in moved]
    [False, True]

    Parameters
    ----------
    moved : (5,) what each cause moves in each channel, as a share of its plateau [1]
    """
    by_cause = moved[name]
    return any(np.all(by_cause <= COVERED * LAW * x) for other, x in moved.items() if other != name)


def without_imitators(data: Fitted, found: Found) -> Found:
    """A search whose best set has no cause without which the others close the gap as well, and
    which differs from run to run or moves no more than what the law of another leaves open.

    Its law is not the one that acts; it takes up what the laws of the others, or the model, have in
    another form.
    """
    best, suspects = found.best, found.problem.suspects
    if len(best.names) < 2:
        return found
    differing = {name for name, stability in stabilities(data, found).items() if stability.trends}
    moved = {name: share_of_plateau(data, x) for name, x in moved_by(data, suspects, best).items()}
    for name in (name for name in best.names if name in differing or is_within_law(moved, name)):
        fewer = found.without(name)
        lost = share_closed(data, suspects, best) - share_closed(data, suspects, fewer)
        if lost < DISPENSABLE and not ringing(Judged(data, suspects, fewer), OF_THE_RESIDUAL):
            left = msgspec.structs.replace(found, imitators=found.imitators | {name})
            return without_imitators(data, gone_on(left))
    return found
