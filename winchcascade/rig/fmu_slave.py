"""The rig inside of an FMU: what pythonfmu calls in another simulator (FMI 2.0 for co-simulation).

Only an FMU, or the export of one, imports this module, as it needs the extra `fmu`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import msgspec
from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real

from winchcascade.rig.ledger import LEDGER
from winchcascade.rig.parts import model_of_numbers, number_of, numbers_by_part, with_number
from winchcascade.rig.stepped_rig import SteppedRig

RESOURCE = "rig.json"
"""File of an FMU that holds the model and what is known of it."""

OUTPUTS = {
    "line_tension": ("force", "N", "tension of the line"),
    "torque_pto": ("torque", "N.m", "torque of the PTO shaft"),
    "torque_em": ("torque_em", "N.m", "air-gap torque of the machine"),
    "generator_speed": ("omega_gen", "rad/s", "speed of the high-speed shaft"),
    "stator_current": ("i_s", "A", "stator current, rms"),
    "vdc": ("vdc", "V", "voltage of the DC link"),
    "idc": ("idc", "A", "current of the load"),
    "gas_pressure": ("pressure", "Pa", "gauge pressure of the gas"),
}
"""Outputs: column of the solution, unit, what it is."""

LOST = tuple(
    name for name, one in LEDGER.items() if one.words.startswith("lost") and name != "shaft_loss"
)
"""Losses that are outputs; that of the shaft spring is not known at an instant."""

INPUTS = {
    "line_velocity": ("m/s", "velocity of the line at the end of a step, payout positive"),
    "load_resistance": ("ohm", "resistance of the load at the DC link"),
    "dc_voltage": (
        "V",
        "voltage at which a bus holds the DC link in place of the load, 0 for none",
    ),
}
"""Inputs: unit, what it is."""

SETTINGS = {
    "payout": ("m", "displacement of the line at the start"),
    "start_velocity": ("m/s", "velocity of the line at the start"),
    "step": ("s", "step of the rig; a step of the simulation is a whole number of them"),
    "rest_speed": ("m/s", "speed of the line within which friction changes its sign"),
}
"""Parameters beside the numbers of the rig: unit, what it is."""

GIVEN = {
    **{name: (unit, what) for name, (_, unit, what) in OUTPUTS.items()},
    **{f"loss_{name}": ("W", LEDGER[name].words) for name in LOST},
    "line_displacement": ("m", "displacement of the line"),
}
"""Everything that an FMU gives: unit, what it is."""


class Stated(msgspec.Struct, frozen=True):
    """What an FMU holds: model by part, unit, meaning and standard uncertainty of each number,
    description, and starts.
    """

    model: dict[str, dict[str, Any]]
    numbers: dict[str, tuple[str, str, float | None]]
    description: str
    step: float
    rest: float
    load: float


class WithUnit(Real):  # type: ignore[misc]  # pythonfmu has no types
    """A real variable with its unit, which pythonfmu leaves out."""

    def __init__(self, name: str, unit: str, **about: Any) -> None:
        super().__init__(name, **about)
        self.unit = unit

    def to_xml(self) -> Element:
        """The variable with its unit."""
        found: Element = super().to_xml()
        real = found.find("Real")
        if real is not None and self.unit != "1":
            real.set("unit", self.unit)
        return found


class RigSlave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """A rig: velocity of the line and load in, tension and all else out.

    The velocity is that at the end of a step, and changes evenly until then. What is given holds
    one `step` before it.
    """

    def __init__(self, **about: Any) -> None:
        super().__init__(**about)
        # a freed unit leaves its emptied module, in which a second one of the same process would
        # find no class
        self._module = sys.modules.pop(type(self).__module__, None)
        stated = msgspec.json.decode((Path(self.resources) / RESOURCE).read_bytes(), type=Stated)
        self.description, self.numbers = stated.description, stated.numbers
        self.model = model_of_numbers(stated.model)
        self.held = dict.fromkeys(INPUTS | SETTINGS, 0.0)
        self.held |= {
            "load_resistance": stated.load,
            "step": stated.step,
            "rest_speed": stated.rest,
        }
        self.found = dict.fromkeys(GIVEN, 0.0)
        self.rig: SteppedRig | None = None
        self._declare()

    def _declare(self) -> None:
        """Declare inputs, outputs and parameters."""
        for name, about in (INPUTS | SETTINGS).items():
            causality = Fmi2Causality.input if name in INPUTS else Fmi2Causality.parameter
            access = partial(self.held.get, name), partial(self.held.__setitem__, name)
            self._register(name, *about, causality, *access)
        for path, (unit, what, u) in self.numbers.items():
            text = what if u is None else f"{what}, u = {u:.3g} {unit}"
            number = partial(lambda path: number_of(self.model, path), path)
            self._register(
                path, unit, text, Fmi2Causality.parameter, number, partial(self._change, path)
            )
        for name, about in GIVEN.items():
            self._register(name, *about, Fmi2Causality.output, partial(self.found.get, name), None)

    def _register(
        self, name: str, unit: str, what: str, causality: Any, getter: Any, setter: Any
    ) -> None:
        """Declare one variable."""
        kind = {"variability": Fmi2Variability.continuous}
        if causality == Fmi2Causality.parameter:
            kind = {"variability": Fmi2Variability.fixed, "initial": Fmi2Initial.exact}
        variable = WithUnit(
            name, unit, causality=causality, description=what, getter=getter, setter=setter, **kind
        )
        self.register_variable(variable, nested=False)

    def _change(self, path: str, value: float) -> None:
        """Change a number of the model; it acts from the next initialization on."""
        self.model = with_number(self.model, path, value)

    def to_xml(self, model_options: Mapping[str, str] | None = None) -> Element:
        """The description of the FMU, with the units of its variables."""
        root: Element = super().to_xml(model_options or {})
        units = Element("UnitDefinitions")
        for unit in sorted({variable.unit for variable in self.vars.values()} - {"1"}):
            SubElement(units, "Unit", name=unit)
        root.insert(1, units)
        return root

    def exit_initialization_mode(self) -> None:
        """Begin at the velocity that the line has."""
        self.rig = SteppedRig(self.model, self.held["step"], self.held["rest_speed"])
        self.rig.begin(self.held["start_velocity"], self.held["payout"])

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        """Step to the velocity of the line; FMI gives the time, too."""
        rig, load = self.rig, self.held["load_resistance"]
        if rig is None:
            return False
        given = rig.advance(self.held["line_velocity"], step_size, load, self.held["dc_voltage"])
        v, x = rig.before()
        self.found.update(
            {name: given[column] for name, (column, _, _) in OUTPUTS.items()}, line_displacement=x
        )
        powers = rig.powers(v, x, load)
        self.found.update({f"loss_{name}": powers[name] for name in LOST})
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        """All that a later call goes back to."""
        kept = None if self.rig is None else self.rig.kept.tolist()
        numbers = numbers_by_part(self.model)
        return {"held": dict(self.held), "found": dict(self.found), "kept": kept, "model": numbers}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self.held.update(state["held"])
        self.found.update(state["found"])
        self.model = model_of_numbers(state["model"])
        if state["kept"] is not None:
            self.exit_initialization_mode()
            assert self.rig is not None
            self.rig.kept[:] = state["kept"]
