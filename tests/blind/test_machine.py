"""Rigs of all sizes: the paper's rig in other units, rigs that are drawn, and what the twin and
the model make of them.
"""

import csv
import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from campaigns import (
    PRODUCT,
    Case,
    WrongEntry,
    draw,
    stated_loads,
    steps_of,
    truth_of,
    write_campaign,
)
from daily import daily
from drawn_machine import (
    DRUM,
    GEAR,
    PAPER,
    POWER,
    RATED_POWER,
    STROKE,
    STROKES,
    Machine,
    draw_machine,
)
from machine_file import LOG_FACTORS, in_si_units, machine_toml
from machine_units import Units
from owner_simulators import noise_free

from winchcascade import read_run, reduce
from winchcascade.blind.cases import STATED_LOADS, write_log
from winchcascade.blind.crane_motion import draw_motion, line_motion
from winchcascade.blind.drive import COLUMNS, GRID, Drive, run_drive
from winchcascade.blind.injected import INJECTED, Hidden
from winchcascade.blind.truth import Truth
from winchcascade.blind.twin import Solved, Twin, solve_twin
from winchcascade.blind.twin_numbers import LOADS, SENSORS, Fixed, Numbers, Restoring
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import PARTS, Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline, load_rig, missing_part
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.simulate import simulate

KINDS = ("gas_screw", "spring", "counterweight", "none")
OTHER = Units(length=4.0, time=2.0, force=20.0, volt=6.0, gear=0.4, lead=2.0)
"""A winch of 40 kW: drum of 0.52 m, gear 20."""

FIXED = Fixed()


def in_units(units: Units) -> Machine:
    """The paper's rig in other units; with another gear its machine has as many electrical turns
    for a turn of the drum.
    """
    return Machine(units)


@cache
def drawn(kind: str, seed: int = 0) -> Machine:
    return draw_machine(np.random.default_rng([7, KINDS.index(kind), seed]), kind)


def rig_of(machine: Machine, folder: Path) -> Rig:
    path = folder / "rig.toml"
    path.write_text(machine_toml(machine, "drawn"))
    return load_rig(path)


def numbers_of(rig: Rig) -> dict[str, Quantity]:
    """Numbers of a rig by section and key."""
    found = {}
    for section in ("winch", "restoring", "drivetrain", "generator", "dc_link"):
        part = getattr(rig, section)
        for key in PARTS[section].__struct_fields__:
            if isinstance(getattr(part, key), Quantity):
                found[f"{section}.{key}"] = getattr(part, key)
    return found


# ------------------------------------------------------------------------------------- similarity
WRITTEN = 2e-8
"""Share by which a number may differ that a rig file holds with nine digits."""

U_GAUGE = 0.06
"""Share by which the uncertainty of the absolute pressure is larger than the same share of the
gauge pressure.
"""


def test_the_rig_file_of_the_papers_rig_has_the_numbers_and_uncertainties_of_the_built_in_one(
    tmp_path: Path,
) -> None:
    own, paper = rig_of(PAPER, tmp_path), built_in()
    ours, theirs = numbers_of(own), numbers_of(paper)
    assert ours.keys() == theirs.keys()
    for key, number in theirs.items():
        assert ours[key].value == pytest.approx(number.value, rel=WRITTEN), key
        share = U_GAUGE if key == "restoring.p_precharge" else 1e-3
        assert (ours[key].u or 0.0) == pytest.approx(number.u or 0.0, rel=share), key
    assert own.thresholds == paper.thresholds


def test_the_rig_file_of_a_case_states_its_sensors_as_that_of_the_shipped_campaign(
    tmp_path: Path, fixtures: Path
) -> None:
    own, shipped = rig_of(PAPER, tmp_path), load_rig(fixtures / "campaign" / "rig.toml")
    for name, sensor in shipped.sensors.items():
        assert own.sensors[name].u_zero == (
            sensor.u_zero and pytest.approx(sensor.u_zero, rel=1e-3)
        ), name
        assert own.sensors[name].u_gain == sensor.u_gain
        assert own.sensors[name].resolution == (
            sensor.resolution and pytest.approx(sensor.resolution, rel=1e-3)
        )


POWERS = {
    "winch.r_drum": (1, 0, 0, 0, 0, 0), "winch.inertia": (1, 2, 1, 0, 0, 0),
    "restoring.lead": (0, 0, 0, 0, 0, 1), "restoring.area_piston": (1, 0, 1, 0, 0, -1),
    "restoring.volume_gas": (1, 0, 1, 0, 0, 0), "drivetrain.gear_ratio": (0, 0, 0, 0, 1, 0),
    "drivetrain.b_rotor": (1, 1, 1, 0, -2, 0), "drivetrain.k_shaft": (1, 0, 1, 0, 0, 0),
    "drivetrain.c_shaft": (1, 1, 1, 0, 0, 0), "drivetrain.inertia_rotor": (1, 2, 1, 0, -2, 0),
    "generator.k_e": (0, 1, 0, 1, -1, 0), "generator.r_s": (-1, 1, -1, 2, 0, 0), "generator.l_s": (-1, 2, -1, 2, 0, 0),
    "generator.v_diode": (0, 0, 0, 1, 0, 0), "generator.speed_rated": (0, -1, 0, 0, 1, 0),
    "generator.i_rated": (1, -1, 1, -1, 0, 0), "dc_link.c_dc": (1, 0, 1, -2, 0, 0), "dc_link.r_bleed": (-1, 1, -1, 2, 0, 0),
}  # fmt: skip
"""Powers of length, time, force, voltage, gear and lead in each number of a rig file, the pressure
being free of them; the inductance is that of a machine with as many electrical turns for a turn of
the drum."""


def test_the_rig_file_in_other_units_has_each_number_times_its_powers_of_the_units(
    tmp_path: Path,
) -> None:
    paper, other = (numbers_of(rig_of(in_units(units), tmp_path)) for units in (Units(), OTHER))
    for key, number in paper.items():
        if key == "generator.pole_pairs":
            continue
        powers = POWERS.get(key, (0,) * 6)
        factor = math.prod(
            unit**power for unit, power in zip(msgspec.structs.astuple(OTHER), powers, strict=True)
        )
        assert other[key].value == pytest.approx(number.value * factor, rel=WRITTEN), key


ROUNDED = 2e-4
"""Largest share of a channel's largest value by which a rescaled log may differ: its own digits."""


@pytest.mark.slow
def test_a_rig_without_scatter_is_the_scaled_twin_of_the_paper(tmp_path: Path) -> None:
    case = Case("similar", 1, 3, {"rotor_inertia": 1.0})
    folders = [tmp_path / "paper", tmp_path / "other"]
    for folder, units in zip(folders, (Units(), OTHER), strict=True):
        folder.mkdir()
        write_campaign(msgspec.structs.replace(case, machine=in_units(units)), folder)
    runs = [load_campaign(folder).runs for folder in folders]
    loads = [[run.load or 0.0 for run in each] for each in runs]
    assert loads[1] == pytest.approx([ohm * OTHER.factor("ohm") for ohm in loads[0]])
    for paper, other in zip(*runs, strict=True):
        ours, theirs = columns_of(other.file), columns_of(paper.file)
        for name, factor in LOG_FACTORS.items():
            expected = theirs[name] * OTHER.factor(factor)
            assert np.max(np.abs(ours[name] - expected)) < ROUNDED * np.max(np.abs(expected)), name
    truths = [
        truth_of(msgspec.structs.replace(case, machine=in_units(units)))
        for units in (Units(), OTHER)
    ]
    assert truths[0].parameters == truths[1].parameters


def columns_of(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.reader(file))[1:]
    return dict(zip(LOG_FACTORS, np.array(rows, dtype=np.float64).T, strict=True))


STEPPED = 2e-3
"""Largest difference of the drive in other units, as a share: a diode that rests is looked for
in longer steps.
"""


def test_the_equations_of_the_drive_are_invariant_under_the_units() -> None:
    factor, fine = OTHER.factor, 20
    _, v = line_motion("r9ohm", np.random.default_rng(5))
    v = v[: v.size // 4]
    here = Drive(FIXED, Numbers(), LOADS["r9ohm"])
    plain, _ = run_drive(v / FIXED.r_drum, np.ones(v.size - 1), here, fine)
    scaled = Numbers()._replace(
        k_e=Numbers().k_e * factor("volt_per_rotor"),
        r_s=Numbers().r_s * factor("ohm"),
        l_s=Numbers().l_s * factor("henry"),
        b_rotor=Numbers().b_rotor * factor("damping_rotor"),
        c_dc=Numbers().c_dc * factor("farad"),
    )
    fixed = FIXED._replace(
        gear=FIXED.gear * OTHER.gear,
        k_shaft=FIXED.k_shaft * factor("torque"),
        c_shaft=FIXED.c_shaft * factor("damping"),
        j_rotor=FIXED.j_rotor * factor("inertia_rotor"),
        pole_pairs=FIXED.pole_pairs / OTHER.gear,
        v_diode=FIXED.v_diode * factor("volt"),
    )
    slower = (
        np.interp(np.arange(2 * v.size - 1) * 0.5, np.arange(v.size), v) / FIXED.r_drum / OTHER.time
    )
    there = Drive(fixed, scaled, LOADS["r9ohm"] * factor("ohm"))
    found, _ = run_drive(slower, np.ones(slower.size - 1), there, fine // 2)
    both = 0.5 * (found[::2] + found[1::2])
    for k, quantity in enumerate(("torque", "volt", "ampere", "omega_rotor")):
        expected = plain[:, k] * factor(quantity)
        assert np.max(np.abs(both[:, k] - expected)) < STEPPED * np.max(expected), COLUMNS[k]


# ---------------------------------------------------------------------------------------- drawing
@pytest.mark.parametrize("kind", KINDS)
def test_drawn_rigs_are_of_all_sizes_within_what_is_stated(kind: str) -> None:
    rigs = [drawn(kind, seed) for seed in range(60)]
    f = [rig.units.factor for rig in rigs]
    power = [RATED_POWER * one("torque") / one("time") for one in f]
    drum = [FIXED.r_drum * one("length") for one in f]
    gear = [FIXED.gear * rig.units.gear for rig in rigs]
    stroke = [STROKE * rig.crane.stroke * one("length") for rig, one in zip(rigs, f, strict=True)]
    for found, (low, high) in (
        (power, POWER),
        (drum, DRUM),
        (stroke, STROKES),
        (gear, (1.0, GEAR[1])),
    ):
        assert low * 0.999 <= min(found) < max(found) <= high * 1.001
    assert max(power) > 1e3 * min(power)
    assert max(drum) > 10.0 * min(drum)
    pairs = [rig.fixed.pole_pairs / rig.units.gear for rig in rigs]
    assert np.allclose(pairs, np.round(pairs))
    assert {1, 20} <= {round(count) for count in pairs}
    rates = [1.0 / (rig.logger.interval * rig.units.time) for rig in rigs]
    assert 5.0 * 0.999 < min(rates) < max(rates) < 200.0 * 1.001


def test_a_rig_has_what_the_model_of_its_file_lets_an_effect_act_on(tmp_path: Path) -> None:
    rigs = [drawn(kind, seed) for kind in KINDS for seed in range(8)]
    assert {rig.direct for rig in rigs} == {True, False}
    for rig in rigs:
        file = rig_of(rig, tmp_path)
        assert file.restoring.kind == rig.restoring.kind
        assert file.drivetrain.direct == rig.direct
        for name in INJECTED:
            assert rig.has(name) == (not missing_part(EFFECTS[name], file)), (name, rig.text)


def test_the_truth_of_a_drawn_rig_is_in_its_units() -> None:
    machine = drawn("gas_screw")
    case = Case(
        "sizes",
        1,
        1,
        {"line_friction": 1.0, "rotor_viscous": 1.0, "drum_layering": 1.0},
        machine=machine,
    )
    hidden, _, _ = draw(case)
    found, factor = truth_of(case).parameters, machine.units.factor
    assert found["line_friction"]["torque"] == pytest.approx(
        hidden.effects["line_friction"] * factor("torque")
    )
    per_rotor = factor("torque_rotor") / factor("omega_rotor")
    assert found["rotor_viscous"]["b_extra"] == pytest.approx(
        hidden.effects["rotor_viscous"] * per_rotor
    )
    layering = found["drum_layering"]["radius_change_per_10_m"]
    assert layering * factor("length") == pytest.approx(hidden.effects["drum_layering"])


@pytest.mark.parametrize("effect", ["gear_ratio", "k_e_convention"])
def test_each_suspect_of_a_wrong_product_makes_the_stated_product_the_true_one(
    effect: str, tmp_path: Path
) -> None:
    machine = next(rig for seed in range(9) if not (rig := drawn("spring", seed)).direct)
    case = Case(
        "product",
        1,
        1,
        kind=PRODUCT,
        truth=Truth(),
        entry=WrongEntry(effect, 1.06),
        machine=machine,
    )
    _, twin, _ = draw(case)
    (tmp_path / "rig.toml").write_text(machine_toml(machine, "wrong", {case.entry.key: 1.06}))  # type: ignore[union-attr]
    stated, factor = numbers_of(load_rig(tmp_path / "rig.toml")), machine.units.factor
    k_e, gear = stated["generator.k_e"].value, stated["drivetrain.gear_ratio"].value
    true = twin.numbers.k_e * factor("volt_per_rotor") * machine.fixed.gear * machine.units.gear
    found = truth_of(case).parameters
    assert k_e * found["gear_ratio"]["gear_ratio"] == pytest.approx(true, rel=1e-6)
    assert k_e * (1.0 + found["ke_shift"]["k_e_change"]) * gear == pytest.approx(true, rel=1e-6)
    assert k_e * found["k_e_convention"]["k_e_ratio"] * gear == pytest.approx(true, rel=1e-6)


# ------------------------------------------------------------------------------ restoring modules
PULLS = {
    "spring": Restoring("spring", force=200.0, stiffness=10.0, friction=15.0),
    "counterweight": Restoring("counterweight", weight=250.0, friction=15.0),
    "none": Restoring("none"),
}
"""Restoring modules beside the gas, whose energy is that of its own law."""

ENERGY = 1e-3
"""Share of the work of the line by which its energy may deviate: the ends of a stroke are found
within a step.
"""


def solve_with(restoring: Restoring) -> tuple[Solved, Twin]:
    x, v = line_motion("r18ohm", np.random.default_rng(5))
    twin = Twin(Numbers(), dict(LOADS), dict.fromkeys(SENSORS, 1.0), Hidden(), restoring=restoring)
    return solve_twin(twin, "r18ohm", x, v, 0.0), twin


@pytest.mark.parametrize("kind", KINDS)
def test_the_work_of_the_line_in_payout_is_in_shaft_and_restoring_module_or_lost(kind: str) -> None:
    restoring = PULLS.get(kind, Restoring())
    found, twin = solve_with(restoring)
    end = int(np.argmax(np.diff(found.x) < 0.0))
    speed = np.diff(found.x[: end + 1]) / GRID
    travel, torque = found.x[end], found.channels["torque"][:end]
    work = GRID * float(np.sum(found.channels["force"][:end] * speed))
    shaft = GRID * float(np.sum(torque * speed / FIXED.r_drum))
    if kind == "gas_screw":
        from winchcascade.blind.twin import efficiencies

        forward, _ = efficiencies(Numbers().mu, FIXED)
        push = (
            found.channels["pressure"][:end]
            * Numbers().area
            * FIXED.lead
            / (2.0 * math.pi * FIXED.r_drum)
        )
        held = GRID * float(np.sum(push * speed)) / forward
    else:
        held = restoring.force * travel + 0.5 * restoring.stiffness * travel**2
        held += (restoring.weight + restoring.friction) * travel
    assert work == pytest.approx(shaft + held, rel=ENERGY)
    assert ("pressure" in found.channels) == twin.restoring.has_gas


def test_a_line_that_nothing_pulls_back_is_slack_and_one_with_a_weight_never_is() -> None:
    slack, taut = (
        solve_with(PULLS[kind])[0].channels["force"] for kind in ("none", "counterweight")
    )
    assert np.min(slack) == 0.0
    assert np.min(taut) > 100.0


# ------------------------------------------------------------------------------------ the product
FOLLOWED = 3e-3
"""Share of the largest plateau mean of a channel by which the plateau means of model and twin
may differ.
"""

TESTED = ("open_circuit", "r45ohm", "r18ohm", "r4p5ohm")


def true_machine(machine: Machine, twin: Twin) -> Machine:
    """A rig whose file states what the twin has."""
    return msgspec.structs.replace(
        machine, numbers=twin.numbers, restoring=twin.restoring, loads=twin.loads
    )


@pytest.mark.parametrize("kind", daily(KINDS, ("none",)))
@pytest.mark.parametrize("seed", daily(range(4), (0,)))
def test_the_model_of_the_true_rig_agrees_with_the_twin(
    kind: str, seed: int, tmp_path: Path
) -> None:
    machine = drawn(kind, seed)
    _, twin, rng = draw(Case("followed", 1, seed, machine=machine))
    twin = msgspec.structs.replace(twin, gains=dict.fromkeys(SENSORS, 1.0))
    rig = rig_of(true_machine(machine, twin), tmp_path)
    means: dict[str, list[tuple[float, float]]] = {}
    for log in TESTED:
        solved = solve_twin(
            twin, log, *draw_motion(log, rng, machine.crane), fine=steps_of(machine)
        )
        write_log(tmp_path / "log.csv", in_si_units(machine, noise_free(twin, solved)))
        load = math.inf if log == "open_circuit" else twin.loads[log] * machine.units.factor("ohm")
        run = read_run(tmp_path / "log.csv", rig=rig, load=load)
        simulated, v = simulate(run, baseline(rig)).run, run.channels["velocity"]
        plateau, haul_in = v > 0.97 * np.max(v), v < 0.9 * np.min(v)
        for name in SENSORS:
            if name in simulated.channels:
                a, b = run.channels[name], simulated.channels[name]
                means.setdefault(name, []).append(
                    (float(np.mean(a[plateau])), float(np.mean(b[plateau])))
                )
        force = means["force"][-1][0]
        at_back = [float(np.mean(one.channels["force"][haul_in])) for one in (run, simulated)]
        assert abs(at_back[0] - at_back[1]) < FOLLOWED * force
    assert ("pressure" in means) == machine.restoring.has_gas
    for name, pairs in means.items():
        largest = max(measured for measured, _ in pairs)
        assert max(abs(a - b) for a, b in pairs) < FOLLOWED * largest, (name, machine.text, pairs)


EFFICIENCY = (0.3, 0.95)
"""Ends of eta_pto of a drawn rig."""


LOSSLESS = {"efficiency_above_one"}
"""Finding where nothing is lost between line and shaft, without a restoring module: eta_trans is
1, and noise lifts it.
"""


@pytest.mark.parametrize("kind", daily(KINDS, ("none",)))
@pytest.mark.parametrize("seed", daily(range(5), (0,)))
def test_a_drawn_case_is_reduced_without_findings(kind: str, seed: int, tmp_path: Path) -> None:
    machine = drawn(kind, seed)
    write_campaign(Case("drawn", 1, seed, machine=machine, logger=machine.logger), tmp_path)
    rig, campaign = load_rig(tmp_path / "rig.toml"), load_campaign(tmp_path)
    assert [run.load for run in campaign.runs] == list(stated_loads(machine).values())
    assert len(campaign.runs) == len(STATED_LOADS)
    for run in campaign.runs:
        found = reduce(read_run(run.file, rig=rig, load=run.load))
        assert len(found.cycles) == 3
        kinds = {finding.kind for finding in found.quality}
        assert kinds <= (LOSSLESS if kind == "none" else set()), (machine.text, found.quality)
        eta = found.mean.eta_pto
        if run.load == math.inf:
            assert eta is None
        else:
            assert eta is not None
            assert EFFICIENCY[0] < eta < EFFICIENCY[1]
