"""The catalogue of effects: what the baseline leaves out, one suspect each, in the order of the energy cascade from its end."""

from __future__ import annotations

import difflib
import inspect
import math
import re
import textwrap
from dataclasses import Field, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from winchcascade.core.errors import OptionError
from winchcascade.rig.effects.clutch_drag import ClutchDrag
from winchcascade.rig.effects.copper_heating import CopperHeating
from winchcascade.rig.effects.current_gain import CurrentGain
from winchcascade.rig.effects.diode_drop import DiodeDrop
from winchcascade.rig.effects.drum_inertia import DrumInertia
from winchcascade.rig.effects.drum_layering import DrumLayering
from winchcascade.rig.effects.electrical_lag import ElectricalLag
from winchcascade.rig.effects.force_gain import ForceGain
from winchcascade.rig.effects.force_zero import ForceZero
from winchcascade.rig.effects.gas_polytropic import GasPolytropic
from winchcascade.rig.effects.gas_volume import GasVolume
from winchcascade.rig.effects.gear_mesh_loss import GearMeshLoss
from winchcascade.rig.effects.ke_rolloff import KeRolloff
from winchcascade.rig.effects.ke_shift import KeShift
from winchcascade.rig.effects.line_drag import LineDrag
from winchcascade.rig.effects.line_friction import LineFriction
from winchcascade.rig.effects.load_drift import LoadDrift
from winchcascade.rig.effects.piston_area import PistonArea
from winchcascade.rig.effects.precharge import Precharge
from winchcascade.rig.effects.rotor_friction import RotorFriction
from winchcascade.rig.effects.rotor_inertia import RotorInertia
from winchcascade.rig.effects.rotor_viscous import RotorViscous
from winchcascade.rig.effects.rotor_windage import RotorWindage
from winchcascade.rig.effects.screw_friction import ScrewFriction
from winchcascade.rig.effects.seal_friction import SealFriction
from winchcascade.rig.effects.sync_inductance import SyncInductance
from winchcascade.rig.effects.torque_gain import TorqueGain
from winchcascade.rig.effects.voltage_gain import VoltageGain

if TYPE_CHECKING:
    from collections.abc import Mapping

    from winchcascade.rig.parts import Model


class Effect(Protocol):
    """A suspect: a frozen dataclass whose fields a fit may find, absent at their defaults.

    `stage` is where in the cascade it acts, `reports` names what a diagnosis tells of it, with units, and `possible` gives the
    range outside of which a field has no physical meaning, both ends included; a fit keeps to the narrower bounds of the field.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    stage: ClassVar[str]
    reports: ClassVar[dict[str, str]]
    possible: ClassVar[dict[str, tuple[float, float]]]

    def bend(self, model: Model) -> Model:
        """Return the model with this effect in it."""

    def reported(self) -> dict[str, float]:
        """What a diagnosis reports of it, in the units of `reports`."""


EFFECTS: dict[str, type[Effect]] = {
    "ke_rolloff": KeRolloff,
    "ke_shift": KeShift,
    "copper_heating": CopperHeating,
    "sync_inductance": SyncInductance,
    "diode_drop": DiodeDrop,
    "load_drift": LoadDrift,
    "gear_mesh_loss": GearMeshLoss,
    "rotor_viscous": RotorViscous,
    "rotor_windage": RotorWindage,
    "rotor_friction": RotorFriction,
    "rotor_inertia": RotorInertia,
    "clutch_drag": ClutchDrag,
    "line_friction": LineFriction,
    "line_drag": LineDrag,
    "drum_inertia": DrumInertia,
    "drum_layering": DrumLayering,
    "gas_polytropic": GasPolytropic,
    "gas_volume": GasVolume,
    "precharge": Precharge,
    "piston_area": PistonArea,
    "seal_friction": SealFriction,
    "screw_friction": ScrewFriction,
    "torque_gain": TorqueGain,
    "force_zero": ForceZero,
    "force_gain": ForceGain,
    "voltage_gain": VoltageGain,
    "current_gain": CurrentGain,
    "electrical_lag": ElectricalLag,
}
"""Every effect by its name."""


@dataclass(frozen=True, slots=True)
class Words:
    """What an effect's docstring says: what is unmodelled, how it shows, what it is easily taken for, where it is described."""

    summary: str
    shows_as: str
    taken_for: str
    source: str


def words(kind: type[Effect]) -> Words:
    """Take an effect's docstring apart.

    >>> words(EFFECTS["force_zero"]).shows_as
    'force alone, by the same amount in every phase.'
    """
    text = inspect.cleandoc(kind.__doc__ or "")
    parts = re.split(r"^(?:Shows as|Easily taken for|Source):", text, flags=re.MULTILINE)
    summary, shows_as, taken_for, source = (" ".join(part.split()) for part in parts)
    return Words(summary, shows_as, taken_for, source)


def find_effect(name: str) -> type[Effect]:
    """Look an effect up by its name.

    Raises
    ------
    OptionError : no effect has that name
    """
    if name in EFFECTS:
        return EFFECTS[name]
    near = difflib.get_close_matches(name, EFFECTS, n=3, cutoff=0.5)
    hint = f"; names like it: {', '.join(near)}" if near else ""
    raise OptionError(f"effect {name!r} is not in the catalogue{hint}; `winchcascade effects` lists all.")


def make_effect(name: str, values: Mapping[str, float]) -> Effect:
    """Make an effect from its name and the fields that are not absent.

    >>> make_effect("diode_drop", {"v_d_extra": 0.3})
    DiodeDrop(v_d_extra=0.3)

    Raises
    ------
    OptionError : no such effect or field, or a value that is not finite or has no physical meaning
    """
    kind = find_effect(name)
    for field, value in values.items():
        if field not in kind.possible:
            raise OptionError(f"effect {name} has no field {field!r}; it has {', '.join(kind.possible)}.")
        low, high = kind.possible[field]
        if not (math.isfinite(value) and low <= value <= high):
            unit = _units(kind)[field]
            raise OptionError(
                f"effect {name}: {field} is {value:g}, but must lie between {low:g} and {high:g} [{unit}]."
            )
    return replace(kind(), **values)


def describe(name: str | None = None) -> str:
    """Tell about one effect, or about all of them in a table.

    Raises
    ------
    OptionError : no effect has that name
    """
    return _table() if name is None else _sheet(name, find_effect(name))


_WHAT = 36
"""Width of the table's column of what is unmodelled."""


def _table() -> str:
    rows = [("name", "stage", "what is unmodelled", "parameter (unit)")]
    for name, kind in EFFECTS.items():
        parameter = ", ".join(f"{reported} ({unit})" for reported, unit in kind.reports.items())
        rows.append((name, kind.stage, words(kind).summary, parameter))
    lines = []
    for name, stage, what, parameter in rows:
        first, *more = textwrap.wrap(what, _WHAT, break_on_hyphens=False)
        lines.append(f"{name:<16} {stage:<12} {first:<{_WHAT}} {parameter}")
        lines += [f"{'':<29} {line}".rstrip() for line in more]
    return "\n".join(lines)


def _sheet(name: str, kind: type[Effect]) -> str:
    said = words(kind)
    reports = ", ".join(f"{reported} ({unit})" for reported, unit in kind.reports.items())
    paragraphs = [
        f"{name} ({kind.stage}): {said.summary}",
        f"Shows as: {said.shows_as}",
        f"Easily taken for: {said.taken_for}",
        f"Source: {said.source}",
        f"Reports: {reports}",
    ]
    for field in fields(kind):
        of = field.metadata
        paragraphs.append(
            f"{field.name} [{of['unit']}]: {of['low']:g} to {of['high']:g}, absent {field.default:g}; {of['source']}."
        )
    return "\n".join(textwrap.fill(text, 100, subsequent_indent="    ", break_on_hyphens=False) for text in paragraphs)


def _units(kind: type[Effect]) -> dict[str, str]:
    return {field.name: field.metadata["unit"] for field in fields(kind)}
