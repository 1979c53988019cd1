"""Write the corrected model of a diagnosis as JSON or as a MATLAB struct, for a model in Simulink or Python."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.files import write_content
from winchcascade.core.rig_file import Rig
from winchcascade.core.version import __version__
from winchcascade.diagnosis.corrected_rig import corrected_rig
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report.matlab_file import matlab_bytes
from winchcascade.rig.baseline import baseline, stated_effects
from winchcascade.rig.parts import ROLLOFF_KNOTS, Model, number_of, rolloff_curve

MODEL_SCHEMA = "winchcascade/model/1"

FORMATS = (".json", ".mat")

CURRENT_STEP = 0.25
"""Distance of the stator currents at which the roll-off is tabulated. [A]"""

RPM_PER_RAD_S = 30.0 / math.pi


class ExportedNumber(NamedTuple):
    """A number of the model: its path, the unit that is written, section and name in the rig file, empty for a law that has
    none, and the factor from the unit of the model.
    """

    path: str
    unit: str
    entry: str = ""
    factor: float = 1.0


NUMBERS = (
    ExportedNumber("winch.r_drum", "m", "winch.r_drum"),
    ExportedNumber("winch.inertia", "kg.m2", "winch.inertia"),
    ExportedNumber("winch.friction", "N.m"),
    ExportedNumber("winch.drag", "N.m.s/rad"),
    ExportedNumber("winch.layering", "1/m"),
    ExportedNumber("winch.stribeck", "N.m"),
    ExportedNumber("winch.stribeck_speed", "m/s"),
    ExportedNumber("restoring.lead", "m/rad", "restoring.lead"),
    ExportedNumber("restoring.lead_angle", "rad", "restoring.lead_angle"),
    ExportedNumber("restoring.half_angle", "rad", "restoring.half_angle"),
    ExportedNumber("restoring.mu", "1", "restoring.mu_screw"),
    ExportedNumber("restoring.eta_forward", "1"),
    ExportedNumber("restoring.eta_reverse", "1"),
    ExportedNumber("restoring.area", "m2", "restoring.area_piston"),
    ExportedNumber("restoring.pressure", "Pa", "restoring.p_precharge"),
    ExportedNumber("restoring.volume", "m3", "restoring.volume_gas"),
    ExportedNumber("restoring.exponent", "1"),
    ExportedNumber("restoring.cooling", "s"),
    ExportedNumber("restoring.seal_friction", "N"),
    ExportedNumber("restoring.stribeck", "N.m"),
    ExportedNumber("drivetrain.gear", "1", "drivetrain.gear_ratio"),
    ExportedNumber("drivetrain.eta_mesh", "1", "drivetrain.eta_mesh"),
    ExportedNumber("drivetrain.b_rotor", "N.m.s/rad", "drivetrain.b_rotor"),
    ExportedNumber("drivetrain.k_shaft", "N.m/rad", "drivetrain.k_shaft"),
    ExportedNumber("drivetrain.c_shaft", "N.m.s/rad", "drivetrain.c_shaft"),
    ExportedNumber("drivetrain.inertia_rotor", "kg.m2", "drivetrain.inertia_rotor"),
    ExportedNumber("drivetrain.windage", "N.m.s2/rad2"),
    ExportedNumber("drivetrain.friction", "N.m"),
    ExportedNumber("drivetrain.clutch_drag", "N.m"),
    ExportedNumber("generator.pole_pairs", "1", "generator.pole_pairs"),
    ExportedNumber("generator.k_e", "V.s/rad", "generator.k_e", RPM_PER_RAD_S),
    ExportedNumber("generator.r_s", "ohm", "generator.r_s"),
    ExportedNumber("generator.l_s", "H", "generator.l_s"),
    ExportedNumber("generator.v_diode", "V", "generator.v_diode"),
    ExportedNumber("dc_link.c_dc", "F", "dc_link.c_dc"),
    ExportedNumber("dc_link.r_bleed", "ohm", "dc_link.r_bleed"),
    ExportedNumber("dc_link.load_change", "1"),
)
"""Numbers of the model in the order of its parts; those of the sensors are apart."""


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
    content = matlab_bytes("model", record) if path.suffix.casefold() == ".mat" else _json(record)
    write_content(path, content, force=force)


def model_record(found: ModelDiagnosis) -> dict[str, Any]:
    """The corrected model: every number with its unit, source and nominal value; tables and errors of the sensors apart."""
    rig = corrected_rig(found)
    model, given = baseline(rig), found.data.nominal
    parts: dict[str, dict[str, Any]] = {}
    for number in NUMBERS:
        part, name = number.path.split(".")
        parts.setdefault(part, {})[name] = {
            "value": number.factor * number_of(model, number.path),
            "unit": number.unit,
            "as_given": number.factor * number_of(given, number.path),
            "source": _source(rig, number),
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


def _source(rig: Rig, number: ExportedNumber) -> str:
    """Source of a number in the rig file, and the effects that change it; "absent" where there is neither."""
    section, _, name = number.entry.partition(".")
    entry = getattr(getattr(rig, section), name) if name else None
    said = [] if entry is None else [entry.source or "rig file"]
    plain = baseline(msgspec.structs.replace(rig, effects={}))
    for effect in stated_effects(rig):
        if number_of(effect.apply(plain), number.path) != number_of(plain, number.path):
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


def _json(record: dict[str, Any]) -> bytes:
    return msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n"
