"""Write the corrected model of a diagnosis as JSON or as a MATLAB struct, for a model in Simulink or Python."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes, write_content
from winchcascade.core.matlab_file import matlab_bytes
from winchcascade.core.rig_file import Rig
from winchcascade.core.version import __version__
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.rig_text import corrected_rig
from winchcascade.rig.baseline import baseline, stated_effects
from winchcascade.rig.parts import ROLLOFF_KNOTS, Model, number_of, path_in_rig, rolloff_curve

MODEL_SCHEMA = "winchcascade/model/1"

FORMATS = (".json", ".mat")

CURRENT_STEP = 0.25
"""Distance of the stator currents at which the roll-off is tabulated. [A]"""

RPM_PER_RAD_S = 30.0 / math.pi

UNITS = {
    "winch": {
        "r_drum": "m", "inertia": "kg.m2", "friction": "N.m", "drag": "N.m.s/rad", "layering": "1/m", "stribeck": "N.m",
        "stribeck_speed": "m/s",
    },
    "restoring": {
        "lead": "m/rad", "lead_angle": "rad", "half_angle": "rad", "mu": "1", "eta_forward": "1", "eta_reverse": "1",
        "area": "m2", "pressure": "Pa", "volume": "m3", "exponent": "1", "cooling": "s", "seal_friction": "N",
        "stribeck": "N.m",
    },
    "drivetrain": {
        "gear": "1", "eta_mesh": "1", "b_rotor": "N.m.s/rad", "k_shaft": "N.m/rad", "c_shaft": "N.m.s/rad",
        "inertia_rotor": "kg.m2", "windage": "N.m.s2/rad2", "friction": "N.m", "clutch_drag": "N.m",
    },
    "generator": {"pole_pairs": "1", "k_e": "V.s/rad", "r_s": "ohm", "l_s": "H", "v_diode": "V"},
    "dc_link": {"c_dc": "F", "r_bleed": "ohm", "load_change": "1"},
}  # fmt: skip
"""Units in which the numbers of the model are written, in the order of its parts; those of the sensors are apart."""

FACTORS = {"generator.k_e": RPM_PER_RAD_S}
"""Factors from the unit of the model to the unit that is written, where they differ."""


def check_export(path: Path | None) -> None:
    """Reject a name that is of no format: OptionError."""
    if path is not None and path.suffix.casefold() not in FORMATS:
        raise OptionError(f"--export {path}: expected a name that ends in {' or '.join(FORMATS)}.")


def write_export(found: ModelDiagnosis | LineDiagnosis, path: Path, *, force: bool = False) -> None:
    """Write the corrected model of a diagnosis in the format that the name of the file states.

    Raises
    ------
    OptionError : the rig has no model
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    if not isinstance(found, ModelDiagnosis):
        raise OptionError(f"--export {path}: no model can be made of rig {found.rig.name}; leave --export out.")
    record = model_record(found)
    content = matlab_bytes("model", record) if path.suffix.casefold() == ".mat" else json_bytes(record)
    write_content(path, content, force=force)


def model_record(found: ModelDiagnosis) -> dict[str, Any]:
    """The corrected model: every number with its unit, source and nominal value; tables and errors of the sensors apart."""
    rig = corrected_rig(found)
    model, given = baseline(rig), found.data.nominal
    parts = {
        part: {
            name: {
                "value": FACTORS.get(path, 1.0) * number_of(model, path),
                "unit": unit,
                "as_given": FACTORS.get(path, 1.0) * number_of(given, path),
                "source": _source(rig, path),
            }
            for name, unit in units.items()
            for path in (f"{part}.{name}",)
        }
        for part, units in UNITS.items()
    }
    return {
        "schema": MODEL_SCHEMA,
        "written_by": f"winchcascade/{__version__}",
        "title": found.title,
        "rig": rig.name,
        "verdict": found.verdict,
        "causes": [cause.effect for cause in found.causes],
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


def _source(rig: Rig, path: str) -> str:
    """Source of a number in the rig file, and the effects that change it; "absent" where there is neither."""
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
    """Back-EMF constant over the stator current, line to line, rms, per mechanical speed; and flux linkage without current."""
    machine = model.generator
    k_e = machine.k_e * RPM_PER_RAD_S
    current = np.arange(0.0, ROLLOFF_KNOTS[-1] + 0.5 * CURRENT_STEP, CURRENT_STEP)
    share = rolloff_curve(machine.rolloff)(current)
    return {
        "flux_linkage": {"value": math.sqrt(2.0 / 3.0) * k_e / machine.pole_pairs, "unit": "Wb"},
        "stator_current_a": current.tolist(),
        "share": share.tolist(),
        "k_e_v_s_per_rad": (k_e * share).tolist(),
    }
