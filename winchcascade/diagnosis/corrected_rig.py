"""The rig with the causes that a diagnosis named: the text of its rig file with the effects at the values of the joint fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import EffectNumber, Rig, StatedEffect
from winchcascade.diagnosis.causes import COVERED, LAW, covariance_of
from winchcascade.diagnosis.nuisances import quantity_of, with_quantity
from winchcascade.diagnosis.rig_text import corrected_text, log_name, printable_name, rounded
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.rig.baseline import stated_effects
from winchcascade.rig.effects.wrong_entries import SHARED_RADIUS

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis


def corrected_rig_text(found: ModelDiagnosis) -> str:
    """Write the named causes of a diagnosis into the text of its rig file; RigError where that is not possible."""
    return corrected_text(found.rig, stated_causes(found), corrected_entries(found), found.title)


def corrected_rig(found: ModelDiagnosis) -> Rig:
    """The rig of a diagnosis with its named causes as effects."""
    rig = msgspec.structs.replace(found.rig, effects={**found.rig.effects, **stated_causes(found)})
    for place, number in corrected_entries(found).items():
        rig = with_quantity(rig, *place, number)
    return rig


def corrected_entries(found: ModelDiagnosis) -> dict[tuple[str, str], Quantity]:
    """Numbers of the rig file, by section and name, that named wrong entries correct, with their standard uncertainty.

    A wrong load of one run is an entry of the campaign and not among them.
    """
    fit = found.found.best
    u = np.sqrt(np.diag(covariance_of(found.data, fit, found.found.scale)))
    numbers = {}
    for cause in found.causes:
        entry, k = found.suspects[cause.effect].entry, fit.place[cause.effect].start
        if entry is None or not entry.number:
            continue
        section, _, name = entry.number.partition(".")
        stated = quantity_of(found.rig, section, name)
        if stated is not None:
            share = 1.0 + float(fit.x[k])
            source = f"diagnosis of {printable_name(found.title)}: {share:.4g} times the stated number"
            numbers[section, name] = Quantity(
                stated.value * share, stated.unit, source, abs(stated.value) * float(u[k])
            )
    return numbers


def stated_causes(found: ModelDiagnosis) -> dict[str, StatedEffect]:
    """Named causes as effects that a rig file states, each with 95 % intervals and the logs of the fit.

    A cause that the rig file states already is a further change: its values become those of both together. Wrong entries are
    corrected themselves; only the motion that a logger computes with the same wrong radius gets its scale.
    """
    logs = tuple(log_name(run) for k, run in enumerate(found.runs) if k not in found.data.withheld)
    names = [cause.effect for cause in found.causes]
    fit = found.found.best
    u = np.sqrt(np.diag(covariance_of(found.data, fit, found.found.scale)))
    stated = {}
    for name in names:
        others = [other for other in names if other != name]
        beside = f", fitted with {' and '.join(others)}" if others else ""
        source = f"diagnosis of {printable_name(found.title)}{beside}"
        place = fit.place[name]
        entry = found.suspects[name].entry
        if found.suspects[name].law is SHARED_RADIUS.law:
            scale = 1.0 / (1.0 + float(fit.x[place.start])) - 1.0
            stated["encoder_scale"] = StatedEffect({"scale_error": EffectNumber(scale, "1", source)}, logs)
        if entry is not None and (entry.number or entry.log >= 0):
            continue
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
