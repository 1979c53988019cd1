"""The rig with the causes that a diagnosis named: the text of its rig file with the effects at the values of the joint fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.rig_file import EffectNumber, StatedEffect
from winchcascade.diagnosis.causes import COVERED, LAW, covariance_of
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.rig_text import corrected_text, log_name, printable_name, rounded
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.rig.baseline import stated_effects

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis


def corrected_rig_text(found: ModelDiagnosis) -> str:
    """Write the named causes of a diagnosis into the text of its rig file; RigError where that is not possible."""
    return corrected_text(found.rig, stated_causes(found), found.title)


def corrected_rig(found: ModelDiagnosis) -> Rig:
    """The rig of a diagnosis with its named causes as effects."""
    return msgspec.structs.replace(found.rig, effects={**found.rig.effects, **stated_causes(found)})


def stated_causes(found: ModelDiagnosis) -> dict[str, StatedEffect]:
    """Named causes as effects that a rig file states, each with 95 % intervals and the logs of the fit.

    A cause that the rig file states already is a further change: its values become those of both together. A wrong load belongs
    to the campaign, and a radius that the logger shares has no effect of its own: both are left out.
    """
    logs = tuple(log_name(run) for k, run in enumerate(found.runs) if k not in found.data.withheld)
    names = [cause.effect for cause in found.causes if cause.effect == effect_name(cause.effect)]
    fit = found.found.best
    u = np.sqrt(np.diag(covariance_of(found.data, fit, found.found.scale)))
    stated = {}
    for name in names:
        others = [other for other in names if other != name]
        beside = f", fitted with {' and '.join(others)}" if others else ""
        source = f"diagnosis of {printable_name(found.title)}{beside}"
        place = fit.place[name]
        stated[name] = StatedEffect(_numbers(found, name, fit.x[place], u[place], source), logs)
    return stated


def _numbers(found: ModelDiagnosis, name: str, values: Signal, u: Signal, source: str) -> dict[str, EffectNumber]:
    """Fields of a cause, (k,), with their intervals; one at a bound of its range has none."""
    effect = found.suspects[name]
    earlier = {one.effect.name: one.values for one in stated_effects(found.rig)}.get(name)
    half = COVERED * np.hypot(u, LAW * np.abs(values - freedom(effect).absent))
    numbers = {}
    for k, field in enumerate(effect.fields):
        ends = np.tile(values, (3, 1))
        ends[:, k] += (-half[k], 0.0, half[k])
        changes = [with_values(effect, row) for row in ends]
        low, value, high = ((change if earlier is None else change.after(earlier)).values[k] for change in changes)
        low, value, high = (float(rounded(x, (high - low) / (2.0 * COVERED))) for x in (low, value, high))
        least, most = field.possible
        interval = {"low": max(low, least), "high": min(high, most)} if u[k] else {}
        numbers[field.name] = EffectNumber(value, field.unit, source, **interval)
    return numbers
