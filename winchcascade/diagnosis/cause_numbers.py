"""Numbers of the causes beside what is known and plausible of them, and the fitted law of the back-EMF constant (Fig. 18e)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.diagnosis.causes import posterior_of
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import NamedCause, Reported
from winchcascade.diagnosis.stator_current import stator_current
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.rig.effects.effect import Change, Effect
from winchcascade.rig.effects.generator import share_of_k_e
from winchcascade.rig.parts import ROLLOFF_KNOTS, number_of, path_in_rig

ROLLOFF = "ke_rolloff"

DRAWS = 400
"""Draws of the fields of a law for its band."""

POINTS = 120
"""Points of a law."""


class CauseNumber(NamedTuple):
    """One number of a cause: absent value, plausible range, and the tolerance about the absent value, in reported units."""

    cause: NamedCause
    name: str
    found: Reported
    absent: float
    low: float
    high: float
    tolerance: float


def tolerance_of(found: ModelDiagnosis, effect: Effect) -> float:
    """Standard uncertainty of the number that an effect changes, in the unit in which the effect is reported; 0 for none."""
    law = effect.law
    if not isinstance(law, Change):
        return 0.0
    known = max((n.sd for n in found.data.nuisances if n.path == path_in_rig(law.path)), default=0.0)
    share = known / abs(number_of(found.data.nominal, law.path)) if law.operation == "scale" else known
    absent, moved = (with_values(effect, freedom(effect).absent + by).reported for by in (0.0, 1.0))
    return share * abs(moved - absent)


def cause_numbers(found: ModelDiagnosis) -> list[CauseNumber]:
    """Every number of the named causes, in their order."""
    rows = []
    for cause in found.causes:
        effect = found.suspects[cause.effect]
        free = freedom(effect)
        absent, *ends = (with_values(effect, x).reported for x in (free.absent, free.low, free.high))
        known = (absent, min(absent, *ends), max(absent, *ends), tolerance_of(found, effect))
        rows += [CauseNumber(cause, name, value, *known) for name, value in cause.parameters.items()]
    return rows


class Profile(NamedTuple):
    """Share of the back-EMF constant that remains over the stator current [A rms], (n,) each: found and its 95 % band."""

    current: Signal
    left: Signal
    low: Signal
    high: Signal


def profile_of(found: ModelDiagnosis) -> Profile | None:
    """The roll-off with its band, as far as the data reach; None where it is no cause."""
    best = found.found.best
    if ROLLOFF not in best.names or all(cause.effect != ROLLOFF for cause in found.causes):
        return None
    place = best.place[ROLLOFF]
    fitted = best.x[place]
    root = np.linalg.eigh(posterior_of(found.found, best).covariance[place, place])
    spread = root.eigenvectors * np.sqrt(np.maximum(root.eigenvalues, 0.0))
    drawn = fitted + np.random.default_rng(0).standard_normal((DRAWS, fitted.size)) @ spread.T
    reached = float(np.max(stator_current(found)[0], initial=ROLLOFF_KNOTS[1]))
    current = np.linspace(0.0, reached, POINTS)
    fields = [fitted, *np.clip(drawn, best.free.minimum[place], best.free.maximum[place])]
    line, *lines = (share_of_k_e(tuple(x.tolist()), current) for x in fields)
    low, high = np.quantile(list(lines), (0.025, 0.975), axis=0)
    return Profile(current, line, low, high)
