"""Sentences about the owner's own simulation: what the logs are compared with, and where it differs from the rig's model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.report.diagnosis_names import display_of, number_words, phase_words
from winchcascade.report.gap_words import NAMES, size_text
from winchcascade.rig.effects.simplifications import SIMPLIFICATIONS

if TYPE_CHECKING:
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, ModelForm, OwnSimulation


def has_own_simulation(found: DiagnosisResult) -> bool:
    """Whether the logs are compared with a simulation of the owner and not with the rig's model as given."""
    return isinstance(found, ModelDiagnosis) and found.own_simulation is not None


def baseline_words(found: DiagnosisResult) -> str:
    """What the logs are compared with, as in a legend."""
    return "your simulation" if has_own_simulation(found) else "rig as given"


def simulated_words(found: DiagnosisResult, how: str = "") -> str:
    """What the logs are compared with, as in a caption.

    Parameters
    ----------
    how : in what way, such as block by block
    """
    if has_own_simulation(found):
        return f"your simulation, {how}" if how else "your simulation"
    return f"simulated, {how}, by the rig as given" if how else "simulated by the rig as given"


def own_simulation_words(found: DiagnosisResult) -> list[str]:
    """What the own simulation has in another form than the rig's model, the largest difference first; none without one."""
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    if own is None:
        return []
    if not own.forms:
        return ["Your simulation agrees with the rig's model as given within its tolerances."]
    causes = {cause.effect for cause in found.causes}
    return [_form_words(form, own, named=form.likely in causes) for form in own.forms]


def _form_words(form: ModelForm, own: OwnSimulation, *, named: bool) -> str:
    """One difference between an own simulation and the rig's model.

    Parameters
    ----------
    named : the logs have the same effect, as a cause
    """
    load = "" if form.load is None else " in open circuit" if math.isinf(form.load) else f" at {form.load:g} ohm"
    place = (
        f"its {NAMES[form.channel]} is {size_text(form.channel, form.bias)} {'higher' if form.bias > 0.0 else 'lower'} during "
        f"{phase_words(form.phase)}{load}"
    )
    differs = f"Your simulation differs from the rig's model in the {form.stage} stage"
    if form.likely is None:
        return f"{differs}: {place}; no effect and no usual simplification explains it."
    if form.likely in SIMPLIFICATIONS:
        return f"{differs}; likely {own.likely[form.likely].display.what}: {place}."
    effect, numbers = own.likely[form.likely], own.numbers[form.likely].items()
    displays = [(display_of(form.likely, name, value.unit), value) for name, value in numbers]
    sizes = "; ".join(f"{how.what} {number_words(how, value)[0]}" for how, value in displays)
    too = " The logs have this effect too; only what differs of it is part of their gap." if named else ""
    return (
        f"Your simulation already contains {effect.label} ({form.likely}, {form.stage} stage): {sizes}; {place}.{too}"
    )
