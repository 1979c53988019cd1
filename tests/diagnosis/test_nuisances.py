"""What is known to a tolerance only: of the built-in rig, by name, size and order."""

import math
from itertools import groupby

import msgspec
import pytest
from openlog import FS, made_log
from rigs import calibrated_rig, scales_on

from winchcascade.core.rig_file import Sensor
from winchcascade.diagnosis.fit.nuisances import (
    OF_THE_BRIDGE,
    OF_THE_MODEL,
    SKEW,
    nuisances,
    sensor_errors,
    with_quantity,
)
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import number_of

RIG = calibrated_rig()
LOG = made_log(cycles=1)
RUNS = [msgspec.structs.replace(LOG, load=load) for load in (math.inf, 18.0, 18.0, 4.5)]
SCALES = scales_on(RIG, RUNS)
NUISANCES = nuisances(RIG, RUNS, SCALES)

STATED = {
    ("restoring", "mu_screw"): 0.0005,
    ("restoring", "area_piston"): 0.002 * 7850e-6,
    ("restoring", "p_precharge"): 0.001 * 20.5 * 98066.5,
    ("restoring", "volume_gas"): 0.003 * 4e-3,
    ("drivetrain", "eta_mesh"): 0.002,
    ("drivetrain", "b_rotor"): 0.01 * 7.5e-4,
    ("generator", "k_e"): 0.001 * 0.0620,
    ("generator", "r_s"): 0.005 * 0.61,
    ("generator", "l_s"): 0.007 * 3.35e-3,
    ("dc_link", "c_dc"): 0.1 * 2.2e-3,
}
"""One standard uncertainty of each number of the rig, as its file states it; SI units."""

ZEROS = {"pressure": 0.03 * 98066.5, "force": 2.0, "torque": 0.3, "idc": 0.005}


def test_kinds_come_in_order() -> None:
    kinds = [kind for kind, _ in groupby(n.kind for n in NUISANCES)]
    assert kinds == ["rig", "law", "load", "gain", "timing", "zero", "discrepancy"]


def test_numbers_of_the_rig_have_the_tolerance_of_its_file_and_of_the_model() -> None:
    found = {(n.section, n.name): n.sd for n in NUISANCES if n.kind == "rig"}
    assert set(found) == set(STATED) | set(OF_THE_MODEL)
    for (section, name), sd in found.items():
        value = getattr(getattr(RIG, section), name).value
        of_the_model = OF_THE_MODEL.get((section, name), 0.0) * value
        of_the_bridge = OF_THE_BRIDGE * SCALES.voltage if name == "v_diode" else 0.0
        expected = math.hypot(STATED.get((section, name), 0.0), of_the_model, of_the_bridge)
        assert sd == pytest.approx(expected, rel=1e-3), name


def test_every_load_has_one_deviation_and_an_open_circuit_none() -> None:
    assert [(n.name, n.load, n.sd) for n in NUISANCES if n.kind == "load"] == [
        ("18 ohm", 18.0, 0.001), ("4.5 ohm", 4.5, 0.001),
    ]  # fmt: skip


def test_gains_are_common_to_all_logs_and_timing_leaves_the_pressure_out() -> None:
    gains = {n.name: n.sd for n in NUISANCES if n.kind == "gain"}
    assert gains == dict.fromkeys(("pressure", "force", "torque", "vdc", "idc"), 0.001)
    timing = {n.name: n.sd for n in NUISANCES if n.kind == "timing"}
    assert timing == pytest.approx(dict.fromkeys(("force", "torque", "vdc", "idc"), SKEW / FS))


def test_the_bridge_of_a_slow_machine_is_known_less_well_when_its_current_rises() -> None:
    pairs = RIG.generator.pole_pairs
    assert pairs is not None
    few = msgspec.structs.replace(pairs, value=pairs.value / 16.0)
    slow = msgspec.structs.replace(
        RIG, generator=msgspec.structs.replace(RIG.generator, pole_pairs=few)
    )
    found = {(n.kind, n.name): n.sd for n in nuisances(slow, RUNS, SCALES)}
    rest = {(n.kind, n.name): n.sd for n in NUISANCES}
    period = 2.0 * math.pi / (few.value * SCALES.omega_rotor)
    assert found["timing", "vdc"] == pytest.approx(period / 24.0)
    # 2 l_s di/dt over the drop of the model, at a current that reaches its size within the ramp
    inductance = RIG.generator.l_s
    assert inductance is not None
    of_the_model = 3.0 / math.pi * 2.0 * math.pi / period
    rising = 2.0 / SCALES.ramp / of_the_model * inductance.value
    stated = STATED["generator", "l_s"]
    assert found["rig", "l_s"] == pytest.approx(math.hypot(stated, rising), rel=1e-3)
    changed = {("timing", name) for name in ("force", "torque", "vdc", "idc")} | {("rig", "l_s")}
    assert {key for key, sd in rest.items() if sd < found[key]} == changed
    assert all(sd == found[key] for key, sd in rest.items() if key not in changed)


def test_every_log_has_zeros_of_its_own() -> None:
    zeros = [n for n in NUISANCES if n.kind == "zero"]
    assert [(n.log, n.name) for n in zeros] == [(log, name) for log in range(4) for name in ZEROS]
    assert all(n.sd == pytest.approx(ZEROS[n.name], rel=1e-3) for n in zeros)


def test_a_channel_that_is_not_logged_has_no_errors() -> None:
    bare = [
        msgspec.structs.replace(run, channels={"velocity": run.channels["velocity"]})
        for run in RUNS
    ]
    assert {n.kind for n in nuisances(RIG, bare, SCALES)} == {"rig", "law", "load"}


def test_makers_limits_serve_where_nothing_was_calibrated_in_place() -> None:
    assert sensor_errors(None) == (0.0, 0.0)
    limits = Sensor(unit="N", high=2000.0, accuracy_full_scale=0.002, accuracy_reading=0.005)
    assert sensor_errors(limits) == pytest.approx(
        (math.hypot(0.005, 0.002) / math.sqrt(3.0), 4.0 / math.sqrt(3.0))
    )
    below = Sensor(unit="N", low=-500.0, high=0.0, accuracy_full_scale=0.002)
    assert sensor_errors(below) == pytest.approx((0.002 / math.sqrt(3.0), 1.0 / math.sqrt(3.0)))
    assert sensor_errors(msgspec.structs.replace(limits, u_gain=0.001)) == pytest.approx(
        (0.001, 4.0 / math.sqrt(3.0))
    )


def test_a_nuisance_moves_its_number_of_the_model_as_another_rig_file_would() -> None:
    nominal = baseline(RIG)
    for n in NUISANCES:
        if n.kind == "rig":
            stated = getattr(getattr(RIG, n.section), n.name)
            other = with_quantity(
                RIG, n.section, n.name, msgspec.structs.replace(stated, value=stated.value + n.sd)
            )
            moved, exact = n.apply(nominal, n.sd), baseline(other)
            assert number_of(moved, n.path) == pytest.approx(number_of(exact, n.path), rel=1e-12), n
            assert moved != nominal


def test_a_nuisance_has_a_name_for_reports() -> None:
    names = [str(n) for n in NUISANCES]
    assert {
        "k_e",
        "load of 18 ohm",
        "gain of force",
        "timing of vdc",
        "zero of idc in log 4",
    } <= set(names)
    assert len(set(names)) == len(names)
