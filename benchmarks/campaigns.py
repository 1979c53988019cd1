"""Cases of trials as data: what is injected, how it is logged and stated, and the campaign that
a twin makes of it.
"""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
from drawn_machine import PAPER, Machine
from machine_file import in_si_units, machine_toml
from machine_units import OF_EFFECTS
from owner_simulators import simulated_log
from run_history import History, twin_by_run

from winchcascade.blind.cases import STATED_LOADS, campaign_toml, write_log
from winchcascade.blind.crane_motion import draw_motion
from winchcascade.blind.drive import FINE
from winchcascade.blind.injected import Hidden, draw_hidden
from winchcascade.blind.truth import Truth, truth_by_effects
from winchcascade.blind.twin import FIXED, Twin, draw_twin, solve_twin
from winchcascade.blind.twin_log import read_log
from winchcascade.blind.twin_numbers import (
    CRANE_LOGGER,
    LOAD_SCATTER,
    SCATTER,
    Logger,
    Numbers,
)

PRODUCT = "product of k_e and gear ratio"
"""Kind of the cases in which a wrong entry of the one looks like a wrong entry of the other."""

NOMINAL = Numbers()


class WrongEntry(msgspec.Struct, frozen=True):
    """A wrong entry of the rig file or of one run: the suspect that describes it, the stated value
    over the true one [1], the log whose load is wrong, and whether the logger computes the motion
    of the line with the wrong radius, too.
    """

    effect: str
    factor: float
    log: str | None = None
    shared: bool = False

    @property
    def key(self) -> str:
        """Key of the number in the rig file."""
        return {"drum_radius": "r_drum"}.get(self.effect, self.effect.removesuffix("_convention"))

    def truth(self, twin: Twin, machine: Machine = PAPER) -> dict[str, float]:
        """True value of the number that a diagnosis reports of it."""
        if self.log is not None:
            return {"load_ohm": twin.loads[self.log] * machine.units.factor("ohm")}
        exact = {
            "r_drum": FIXED.r_drum * machine.units.factor("length"),
            "gear_ratio": FIXED.gear * machine.units.factor("gear"),
        }
        if self.key in exact:
            return {self.key: exact[self.key]}
        stated = getattr(machine.numbers, self.key) * self.factor
        return {f"{self.key}_ratio": getattr(twin.numbers, self.key) / stated}

    def product(self, twin: Twin, machine: Machine) -> dict[str, dict[str, float]]:
        """Values that give the true k_e times gear ratio, by the suspect that makes up for the
        whole error of the product.
        """
        product = twin.numbers.k_e / (machine.numbers.k_e * self.factor)  # true over stated
        gear = (
            machine.fixed.gear
            * machine.units.gear
            * (self.factor if self.key == "gear_ratio" else 1.0)
        )
        return {
            "gear_ratio": {"gear_ratio": gear * product},
            "ke_shift": {"k_e_change": product - 1.0},
            "k_e_convention": {"k_e_ratio": product},
        }


class Case(msgspec.Struct, frozen=True):
    """Plan of one case before its values are drawn; the seed and the number decide them.

    Parameters
    ----------
    effects : strength of each injected effect, 1 for full
    kind : of what is injected, where a family has several
    truth : what an honest answer may be, where that does not follow from the effects
    outsider : cause beyond the catalogue
    physics : further physics of the twin, by the names of `PHYSICS`
    reported : value of the reported parameter of an effect that is not drawn
    history : what changes from run to run
    order : of the runs, that of the loads if empty
    scatter : true scatter of the rig over the stated one [1]
    bias : error of the rig file, by number in stated uncertainties [1]
    calibrated : the rig file is calibrated from the open circuit of the campaign
    repeats : number of runs of each load
    entry : wrong entry of the rig file or of the campaign
    simulator : simulator of the owner's own simulation, a name of `SIMULATORS`
    machine : the rig, with its crane
    """

    family: str
    number: int
    seed: int = 0
    effects: dict[str, float] = {}
    kind: str = ""
    truth: Truth | None = None
    outsider: str | None = None
    physics: dict[str, float] = {}
    reported: dict[str, float] = {}
    history: History = History()
    order: tuple[str, ...] = ()
    scatter: float = 1.0
    bias: dict[str, float] = {}
    calibrated: bool = False
    logger: Logger = CRANE_LOGGER
    repeats: int = 1
    entry: WrongEntry | None = None
    simulator: str | None = None
    machine: Machine = PAPER

    @property
    def name(self) -> str:
        """Name of the folder of the case, which does not depend on what is injected."""
        return f"{self.number:04d}"

    @property
    def text(self) -> str:
        """What is injected and the settings of the campaign: the fields that are not their
        defaults, as JSON.
        """
        plain, own = (
            msgspec.to_builtins(case) for case in (Case(self.family, self.number, self.seed), self)
        )
        beside = ("kind", "truth", "machine")
        parts = {
            name: value
            for name, value in own.items()
            if value != plain[name] and name not in beside
        }
        words = [f"{name} {msgspec.json.encode(value).decode()}" for name, value in parts.items()]
        words += [self.machine.text] if self.machine != PAPER else []
        return ", ".join(words) or "nothing"


def draw(case: Case) -> tuple[Hidden, Twin, np.random.Generator]:
    """Injected values and the twin of a case, and the generator from which the logs are drawn
    next.
    """
    rng = np.random.default_rng([case.seed, case.number])
    machine = case.machine
    effects = {
        name: strength * machine.strengths.get(name, 1.0) for name, strength in case.effects.items()
    }
    hidden = draw_hidden(effects, case.outsider, rng, case.reported, duration=machine.crane.stroke)
    hidden = msgspec.structs.replace(hidden, physics=case.physics)
    return hidden, draw_twin(hidden, rng, case.scatter, machine.stated), rng


FILES = dict(
    zip(STATED_LOADS, ("open_circuit", *(f"load_{letter}" for letter in "abcdef")), strict=True)
)
"""Names of the logs of a rig whose loads are others than the paper's."""

PLAIN, CALIBRATED = "plain.toml", "calibrated.toml"
"""Of a case whose rig file is calibrated: the campaign with the rig file as it was before, and
the calibrated file.
"""

SIMULATED = "simulated"
"""Folder of the owner's own simulation."""


def write_campaign(case: Case, folder: Path) -> None:
    """Write the logs of a case, its campaign.toml and its rig file; the same case gives the same
    bytes every time.
    """
    _, twin, rng = draw(case)
    stated, entry, machine = stated_loads(case.machine), case.entry, case.machine
    if entry is not None and entry.log is not None:
        stated[entry.log] = round(stated[entry.log] * entry.factor, 3)
    loads, order = {}, (case.order or tuple(stated)) * case.repeats
    for k, (log, here) in enumerate(
        zip(order, twin_by_run(twin, case.history, order), strict=True)
    ):
        place = log if machine == PAPER else FILES[log]
        name = place if case.repeats == 1 else f"{place}_{k // len(stated) + 1:02d}"
        x, v, resting = draw_motion(log, rng, machine.crane)
        solved = solve_twin(here, log, x, v, resting, fine=steps_of(machine))
        columns = in_si_units(machine, read_log(here, solved, rng, case.logger))
        if entry is not None and entry.shared:
            columns |= {
                key: np.round(columns[key] * entry.factor, 4)
                for key in ("displacement", "velocity")
            }
        write_log(folder / f"{name}.csv", columns)
        if case.simulator is not None:
            write_log(folder / SIMULATED / f"{name}.csv", simulated_log(case.simulator, log, x, v))
        loads[name] = stated[log]
    title = f"{case.family} {case.number}"
    rig = "rig.toml"
    (folder / rig).write_bytes(_rig_file(case).encode())
    if case.calibrated:
        (folder / PLAIN).write_bytes(campaign_toml(title, loads, rig).encode())
        rig = CALIBRATED
        (folder / rig).write_bytes(_calibrated(folder).encode())
    text = campaign_toml(title, loads, rig, SIMULATED if case.simulator else None)
    (folder / "campaign.toml").write_bytes(text.encode())


def stated_loads(machine: Machine) -> dict[str, float]:
    """Load that a campaign states for each log, infinite for the open circuit. [ohm]"""
    if machine == PAPER:
        return dict(STATED_LOADS)
    ohm = machine.units.factor("ohm")
    return {
        log: math.inf if log == "open_circuit" else float(f"{here * ohm:.6g}")
        for log, here in machine.loads.items()
    }


def steps_of(machine: Machine) -> int:
    """Steps of the twin in an interval of its grid, more where the machine has more poles."""
    return FINE * max(1, math.ceil(machine.fixed.pole_pairs / FIXED.pole_pairs - 0.01))


def _rig_file(case: Case) -> str:
    """The rig file of a campaign: sensors known as the twin draws their errors, and the wrong
    entries of the case.
    """
    shares = {name: getattr(SCATTER, name) / getattr(NOMINAL, name) for name in case.bias}
    factors = {
        "mu_screw" if name == "mu" else name: 1.0 + by * shares[name]
        for name, by in case.bias.items()
    }
    if case.entry is not None and case.entry.log is None:
        factors[case.entry.key] = case.entry.factor
    return machine_toml(case.machine, f"{case.family} {case.number}", factors)


def _calibrated(folder: Path) -> str:
    """The rig file of a campaign, calibrated by the open circuit that is written there."""
    from winchcascade.diagnosis.handover.calibrate import calibrate
    from winchcascade.diagnosis.handover.rig_text import calibrated_text
    from winchcascade.ingest.read import read_run
    from winchcascade.rig.baseline import load_rig

    run = read_run(folder / "open_circuit.csv", load=math.inf)
    return calibrated_text(calibrate(run, load_rig(folder / "rig.toml")))


EFFECT_OF = {
    "k_e": "ke_shift", "r_s": "copper_heating", "l_s": "sync_inductance", "b_rotor": "rotor_viscous", "p_gas": "precharge",
    "area": "piston_area", "v_gas": "gas_volume", "eta_mesh": "gear_mesh_loss", "mu": "screw_friction",
    "torque": "torque_gain", "force": "force_gain", "vdc": "voltage_gain", "idc": "current_gain", "pressure": "pressure_gain",
}  # fmt: skip
"""Effect by which a wrong number or gain of the rig is named."""

REAL = 2.5
"""Deviation of a number from the rig file, in stated uncertainties, from which it is a true
cause. [1]
"""


def _wrong_numbers(case: Case, twin: Twin) -> tuple[str, ...]:
    """Effects that describe true deviations of a twin from a rig file that is worse than it
    states.
    """
    if not case.bias and case.scatter == 1.0:
        return ()
    by = {
        name: (true - stated) / u - case.bias.get(name, 0.0)
        for name, true, stated, u in zip(
            twin.numbers._fields, twin.numbers, NOMINAL, SCATTER, strict=True
        )
    }
    by |= {name: (gain - 1.0) / LOAD_SCATTER for name, gain in twin.gains.items()}
    return tuple(
        EFFECT_OF[name]
        for name, deviation in by.items()
        if name in EFFECT_OF and abs(deviation) >= REAL
    )


def truth_of(case: Case) -> Truth:
    """What is injected in a case, with its true numbers, and what an honest answer may be."""
    hidden, twin, _ = draw(case)
    entry = case.entry
    machine = case.machine
    if entry is None:
        parameters = {
            name: {
                of: x * machine.units.factor(OF_EFFECTS.get(name, "one")) for of, x in row.items()
            }
            for name, row in hidden.reported().items()
        }
    elif case.kind == PRODUCT:
        parameters = entry.product(twin, machine)
    else:
        parameters = {entry.effect: entry.truth(twin, machine)}
    if case.outsider is not None:
        found = Truth("outsider", honest="no cause with certainty")
    elif case.truth is not None:
        found = msgspec.structs.replace(case.truth, effects=case.effects, parameters=parameters)
    else:
        effects = case.effects if entry is None else {entry.effect: 1.0}
        found = truth_by_effects(effects, parameters, beside=_wrong_numbers(case, twin))
    return msgspec.structs.replace(
        found,
        kind=case.kind or found.kind,
        what=case.text,
        run=None if entry is None or entry.log is None else f"{entry.log}.csv",
    )
