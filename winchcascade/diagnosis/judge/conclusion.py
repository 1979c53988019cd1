"""How a search concludes: its best set has no imitator, and no smaller set predicts held-out logs better."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.search import Found, gone_on, weighing
from winchcascade.diagnosis.judge.alarms import OF_THE_RESIDUAL, Judged, cancelling, ringing
from winchcascade.diagnosis.judge.causes import look_alikes_of
from winchcascade.diagnosis.judge.closure import (
    HeldOut,
    closes_more,
    share_closed,
)
from winchcascade.diagnosis.judge.stability import stabilities
from winchcascade.diagnosis.verdict_limits import DISPENSABLE

if TYPE_CHECKING:
    from collections.abc import Callable


RESUMED = 4
"""Maximum number of times that a search goes on from what its conclusion finds."""


def concluded(data: Fitted, found: Found, held_out: HeldOut, on_progress: Callable[[str], None]) -> Found:
    """A search at its end: its best set has no imitator, and no smaller set predicts held-out logs better.

    Look-alikes of its causes are fitted. Where one of these has more evidence, the search goes on from there.
    """
    for _ in range(RESUMED):
        found = predicting_best(without_imitators(data, found), held_out)
        look_alikes_of(found)
        further = gone_on(found, on_progress)
        if further.best.names == found.best.names:
            break
        found = further
    return found


def predicting_best(found: Found, held_out: HeldOut) -> Found:
    """A search without a best set of several causes of which fewer, or another effect alone, predict held-out logs better; or
    as well, where causes of the set cancel each other.
    """
    best, data = found.best, held_out.data
    if len(best.names) < 2:
        return found
    fewer = [found.fit(tuple(n for n in best.names if n != name)) for name in best.names]
    tried = {fit.names: fit for fit in (best, *fewer, *found.singles()) if found.allowed(fit.names)}
    closures = {names: held_out.of(found, fit) for names, fit in tried.items()}
    own, worth = closures.pop(best.names), weighing(found).worth
    chosen = [names for names, closure in closures.items() if closes_more(data, closure, own, held_out.seed)]
    one = Judged(data, found.problem.suspects, best)
    if not chosen and any(pair.size > pair.limit for pair in cancelling(one)):
        chosen = [names for names, closure in closures.items() if closure.share >= own.share - DISPENSABLE]
    if not chosen:
        return found
    names = max(chosen, key=lambda names: worth(tried[names]))
    least = worth(tried[names])
    larger = {other for other, fit in found.fits.items() if len(other) > len(names) and worth(fit) > least}
    smaller = msgspec.structs.replace(found, rejected=found.rejected | larger)
    smaller.about(tried[names])
    return predicting_best(smaller.led_by(names), held_out)


def without_imitators(data: Fitted, found: Found) -> Found:
    """A search whose best set has no cause that differs from run to run while the others close the gap as well without it.

    Its law is not the one that acts; it takes up what the laws of the others, or the model, have in another form.
    """
    best, suspects = found.best, found.problem.suspects
    several = stabilities(data, found) if len(best.names) > 1 else {}
    for name in (name for name, stability in several.items() if stability.trends):
        fewer = found.fit(tuple(n for n in best.names if n != name))
        lost = share_closed(data, suspects, best) - share_closed(data, suspects, fewer)
        if lost < DISPENSABLE and not ringing(Judged(data, suspects, fewer), OF_THE_RESIDUAL):
            left = msgspec.structs.replace(found, imitators=found.imitators | {name})
            return without_imitators(data, gone_on(left))
    return found
