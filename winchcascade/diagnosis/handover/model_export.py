"""Write the corrected model of a diagnosis as JSON, as a MATLAB struct, or as an FMU for other
simulators.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.extras import require
from winchcascade.core.files import check_ending, json_bytes, write_content
from winchcascade.core.machine_parts import NUMBERS_OF, Restoring, measures
from winchcascade.core.matlab_file import matlab_bytes
from winchcascade.core.rig_file import Rig
from winchcascade.core.scales import motion_of_runs
from winchcascade.core.version import __version__
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.handover.posterior import posterior_of_rig
from winchcascade.diagnosis.handover.rig_text import corrected_rig
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.rig.baseline import baseline, stated_effects
from winchcascade.rig.fmu_export import write_fmu
from winchcascade.rig.parts import (
    PARTS,
    ROLLOFF_KNOTS,
    Model,
    every_number,
    number_of,
    numbers_of,
    path_in_rig,
    rolloff_curve,
)
from winchcascade.rig.physics import RPM

MODEL_SCHEMA = "winchcascade/model/1"

FORMATS = (".json", ".mat", ".fmu")

CURRENT_STEP = 0.05
"""Distance of the stator currents at which the roll-off is tabulated, over the rated one. [1]"""

EXPORTED = {"generator.k_e": ("V.s/rad", RPM)}
"""Units in which numbers are written that are not those of the model, and the factors to them."""

DERIVED = {"restoring": {"eta_forward": "1", "eta_reverse": "1"}}
"""Numbers that follow from those of a part, with their units."""


PULL = set(measures(Restoring)) - set(NUMBERS_OF["gas_screw"])
"""Numbers of a restoring module without gas; all others are of screw, piston and gas."""


def check_export(path: Path | None) -> None:
    """Reject a name that is of no format: OptionError."""
    check_ending(path, FORMATS, "--export")
    if path is not None and path.suffix.casefold() == ".fmu":
        require("pythonfmu", f"--export {path}")


def write_export(
    found: ModelDiagnosis | StageDiagnosis, path: Path, *, force: bool = False
) -> None:
    """Write the corrected model of a diagnosis in the format that the name of the file states.

    Raises
    ------
    OptionError : the rig has no model
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
        to replace it
    """
    if not isinstance(found, ModelDiagnosis):
        raise OptionError(
            f"--export {path}: no model can be made of rig {found.rig.name}; leave --export out."
        )
    if path.suffix.casefold() == ".fmu":
        _write_unit(found, path, force=force)
        return
    record = model_record(found)
    content = (
        matlab_bytes("model", record) if path.suffix.casefold() == ".mat" else json_bytes(record)
    )
    write_content(path, content, force=force)


def _write_unit(found: ModelDiagnosis, path: Path, *, force: bool) -> None:
    """Write the corrected rig as an FMU, each number with its uncertainty by the posterior, and
    the verdict in its words.
    """
    best, *moved = posterior_of_rig(found).models()
    u = {}
    for number in every_number():
        change = np.array([number_of(one, number) - number_of(best, number) for one in moved])
        if change.any():
            u[number] = float(np.linalg.norm(change))
    judgement = found.judgement
    known = {"causes": judgement.causes, "candidates": judgement.candidates}
    named = "".join(f"; {kind}: {', '.join(names)}" for kind, names in known.items() if names)
    about = f"{found.title}, rig {found.rig.name}, by winchcascade {__version__}: {judgement.verdict}{named}"
    load = min(
        (log.load for log in found.data.logs if math.isfinite(log.load)),
        default=best.dc_link.r_bleed,
    )
    write_fmu(best, path, motion_of_runs(found.runs), load, about, u, force=force)


def model_record(found: ModelDiagnosis) -> dict[str, Any]:
    """The corrected model: every number with its unit, source and nominal value; tables and
    errors of the sensors apart.
    """
    rig = corrected_rig(found)
    model, given = baseline(rig), found.data.nominal
    parts = {}
    for part in PARTS:
        units = {name: number.unit for name, number in numbers_of(part).items()} | DERIVED.get(
            part, {}
        )
        if part == "restoring":
            units = {name: unit for name, unit in units.items() if _is_there(name, rig)}
        parts[part] = {
            name: _number(rig, (given, model), f"{part}.{name}", unit)
            for name, unit in units.items()
        }
    return {
        "schema": MODEL_SCHEMA,
        "written_by": f"winchcascade/{__version__}",
        "title": found.title,
        "rig": rig.name,
        "verdict": found.judgement.verdict,
        "causes": list(found.judgement.causes),
        "candidates": list(found.judgement.candidates),
        "effects": {
            name: {key: msgspec.structs.asdict(number) for key, number in effect.fields.items()}
            for name, effect in rig.effects.items()
        },
        "logs": [run.name for run in found.runs],
        **parts,
        "back_emf": _back_emf(model),
        "sensors": {
            "gain": dict(model.sensors.gain),
            "zero": dict(model.sensors.zero),
            "electrical_lag": model.sensors.electrical_lag,
        },
    }


def _is_there(name: str, rig: Rig) -> bool:
    """Whether the restoring module of a rig has a number."""
    return name not in PULL if rig.restoring.has_gas else name in rig.restoring.own


def _number(rig: Rig, models: tuple[Model, Model], path: str, unit: str) -> dict[str, Any]:
    """One number of the model as given and as corrected, with its unit and its source."""
    shown, factor = EXPORTED.get(path, (unit, 1.0))
    given, value = (factor * number_of(model, path) for model in models)
    return {"value": value, "unit": shown, "as_given": given, "source": _source(rig, path)}


def _source(rig: Rig, path: str) -> str:
    """Source of a number in the rig file, and the effects that change it; "absent" where there
    is neither.
    """
    section, name = path_in_rig(path).split(".")
    entry = getattr(getattr(rig, section), name, None)
    said = [] if entry is None else [entry.source or "rig file"]
    plain = baseline(msgspec.structs.replace(rig, effects={}))
    for effect in stated_effects(rig):
        if number_of(effect.apply(plain), path) != number_of(plain, path):
            fields = rig.effects[effect.effect.name].fields.values()
            sources = ", ".join(dict.fromkeys(field.source for field in fields if field.source))
            said.append(f"{effect.effect.name}{f' ({sources})' if sources else ''}")
    return "; ".join(said) or "absent"


def _back_emf(model: Model) -> dict[str, Any]:
    """Back-EMF constant over the stator current, line to line, rms, per mechanical speed; and
    flux linkage without current.
    """
    machine = model.generator
    k_e = machine.k_e * RPM
    over_rated = np.arange(0.0, ROLLOFF_KNOTS[-1] + 0.5 * CURRENT_STEP, CURRENT_STEP)
    current, share = over_rated * machine.i_rated, rolloff_curve(machine.rolloff)(over_rated)
    return {
        "flux_linkage": {"value": math.sqrt(2.0 / 3.0) * k_e / machine.pole_pairs, "unit": "Wb"},
        "stator_current_a": current.tolist(),
        "share": share.tolist(),
        "k_e_v_s_per_rad": (k_e * share).tolist(),
    }
