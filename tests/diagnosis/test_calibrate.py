"""A rig from its open circuit: known numbers are found again, within the stated intervals."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from openlog import NOISE, estimated_rig, made_log, motion_run, steady_payouts
from rigs import truth_of

from winchcascade import calibrate, read_run, reduce, simulate
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import Calibrated, Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.calibrate import STRAINED, Calibration
from winchcascade.diagnosis.nuisances import (
    before_calibration,
    nuisances,
    quantity_of,
    shifted,
    with_quantity,
)
from winchcascade.report.results.calibration import calibration_report
from winchcascade.rig.baseline import baseline

RIG = built_in()

TRUE = {"k_e": "ke_ll", "mu_screw": "mu_screw", "eta_mesh": "eta_gear", "b_rotor": "b_visc"}
"""What a labelled campaign calls a number of the rig."""

FOUND = {"k_e", "mu_screw", "b_rotor"}


def number(calibration: Calibration, name: str) -> tuple[float, float, float]:
    n = next(n for n in calibration.numbers if n.name == name)
    return n.value, n.low, n.high


def with_tolerance(section: str, name: str, tolerance: float | None) -> Rig:
    stated = quantity_of(RIG, section, name)
    assert stated is not None
    return with_quantity(RIG, section, name, msgspec.structs.replace(stated, u=tolerance))


def drawn(seed: int) -> tuple[Run, dict[str, float]]:
    """A noisy log of a rig whose numbers, gains and zeros are drawn from their tolerances, and the numbers to be found.

    Damper and screw friction are drawn a tenth and a twentieth wide: they are what a calibration is for.
    """
    rng = np.random.default_rng(seed)
    motion = motion_run()
    moves = {(n.section, n.name): n.sd * rng.normal() for n in nuisances(RIG, [made_log(cycles=1)]) if n.kind == "rig"}
    moves["drivetrain", "b_rotor"] = 0.1 * 7.5e-4 * rng.normal()
    moves["restoring", "mu_screw"] = 0.05 * 0.04 * rng.normal()
    run = simulate(motion, baseline(shifted(RIG, moves))).run
    channels = dict(run.channels)
    for n in nuisances(RIG, [run]):
        if n.kind == "gain":
            channels[n.name] = channels[n.name] * (1.0 + n.sd * rng.normal())
        if n.kind == "zero":
            channels[n.name] = channels[n.name] + n.sd * rng.normal()
    channels = {name: x + rng.normal(0.0, NOISE.get(name, 0.0), x.size) for name, x in channels.items()}
    true = {
        name: getattr(getattr(RIG, section), name).value + moves[section, name]
        for section, name in (
            ("generator", "k_e"), ("restoring", "mu_screw"), ("drivetrain", "eta_mesh"), ("drivetrain", "b_rotor"),
        )
    }  # fmt: skip
    return msgspec.structs.replace(run, channels=channels, simulated=False), true


@pytest.mark.parametrize(("logs", "misses"), [(3, 2), pytest.param(10, 5, marks=pytest.mark.slow)])
def test_intervals_hold_the_true_numbers_as_often_as_they_state(logs: int, misses: int) -> None:
    """Of 12 or 40 intervals of 95 %, so many or fewer miss the true number with a probability above 0.95."""
    missed = []
    for seed in range(logs):
        run, true = drawn(seed)
        found = calibrate(run, RIG, steady_payouts(run))
        for name, value in true.items():
            _, low, high = number(found, name)
            missed += [(seed, name)] if not low <= value <= high else []
    assert len(missed) <= misses, missed


def test_without_noise_the_numbers_are_those_of_the_model() -> None:
    model = baseline(RIG)
    bent = msgspec.structs.replace(
        model,
        generator=msgspec.structs.replace(model.generator, k_e=0.0610),
        drivetrain=msgspec.structs.replace(model.drivetrain, b_rotor=9.0e-4),
        restoring=msgspec.structs.replace(model.restoring, mu=0.05),
    )
    run = made_log(bent)
    found = calibrate(run, RIG, steady_payouts(run))
    assert number(found, "k_e")[0] == pytest.approx(0.0610, rel=2e-4)
    assert number(found, "b_rotor")[0] == pytest.approx(9.0e-4, rel=5e-3)
    assert number(found, "mu_screw")[0] == pytest.approx(0.05, rel=5e-3)
    assert found.misfit < 1.5
    assert found.strained == ()
    assert found.settled


def test_a_fit_that_did_not_come_to_rest_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("winchcascade.diagnosis.calibrate.ROUNDS", 1)
    run = made_log(baseline(shifted(RIG, {("drivetrain", "b_rotor"): 2e-4})))
    found = calibrate(run, RIG, steady_payouts(run))
    assert not found.settled
    assert [tile.name for tile in calibration_report(found).tiles] == ["k_e"]


def test_a_number_of_which_the_log_says_nothing_new_is_marked() -> None:
    run = made_log(seed=1)
    found = calibrate(run, estimated_rig(), steady_payouts(run))
    assert {n.name for n in found.numbers if n.new} == FOUND
    assert [n.name for n in found.numbers if not n.new] == ["eta_mesh"]


@pytest.mark.parametrize(
    ("section", "name", "share", "found"),
    [
        ("winch", "r_drum", 0.01, "k_e"),
        ("drivetrain", "gear_ratio", 0.01, "k_e"),
        ("drivetrain", "eta_mesh", 0.01, "b_rotor"),
    ],
)
def test_an_uncertainty_contains_those_of_numbers_that_act_alike(
    section: str, name: str, share: float, found: str
) -> None:
    """The uncertainty is at least half of the one that is tied to it; the log contains a part of that itself."""
    run = made_log(seed=1)
    value = getattr(getattr(RIG, section), name).value
    calibration = calibrate(run, with_tolerance(section, name, share * value), steady_payouts(run))
    exact = calibrate(run, with_tolerance(section, name, 1e-6 * value), steady_payouts(run))
    wide, narrow = (next(n for n in one.numbers if n.name == found) for one in (calibration, exact))
    assert math.sqrt(wide.u**2 - narrow.u**2) > 0.5 * share * wide.value


def test_dry_friction_that_is_not_known_is_in_the_uncertainty(monkeypatch: pytest.MonkeyPatch) -> None:
    run = made_log(seed=1)
    wide = {n.name: n.u for n in calibrate(run, RIG, steady_payouts(run)).numbers}
    monkeypatch.setattr("winchcascade.diagnosis.nuisances.ABSENT", {})
    narrow = {n.name: n.u for n in calibrate(run, RIG, steady_payouts(run)).numbers}
    assert wide["mu_screw"] > 3.0 * narrow["mu_screw"]
    assert wide["b_rotor"] > 1.2 * narrow["b_rotor"]


def test_the_limits_of_the_maker_serve_where_the_gain_of_vdc_was_not_calibrated() -> None:
    run, sensor = made_log(seed=1), RIG.sensors["vdc"]
    sensors = {**RIG.sensors, "vdc": msgspec.structs.replace(sensor, u_gain=None)}
    k_e = calibrate(run, msgspec.structs.replace(RIG, sensors=sensors), steady_payouts(run)).numbers[0]
    assert k_e.u > 0.005 / math.sqrt(3.0) * k_e.value


def test_a_calibration_does_not_depend_on_an_earlier_one() -> None:
    run, rig = made_log(seed=1), estimated_rig()
    found = calibrate(run, rig, steady_payouts(run))
    calibrated = rig
    for n in found.numbers:
        prior = quantity_of(rig, n.section, n.name)
        number = Quantity(1.2 * n.value, n.unit, "", 1e-6 * n.value, Calibrated("earlier.csv", "", prior))
        calibrated = with_quantity(calibrated, n.section, n.name, number)
    assert before_calibration(calibrated) == rig
    assert calibrate(run, calibrated, steady_payouts(run)).numbers == found.numbers


def test_the_gain_of_the_voltage_is_not_reported_from_the_back_emf_constant() -> None:
    run = made_log(seed=1)
    found = calibrate(run, RIG, steady_payouts(run))
    assert found.together[0].startswith("k_e and gain of vdc (-0.9")


def test_a_mesh_that_is_not_known_cannot_be_told_from_the_damper() -> None:
    rig = with_tolerance("drivetrain", "eta_mesh", 0.05)
    run = made_log(seed=1)
    found = calibrate(run, rig, steady_payouts(run))
    assert any({"eta_mesh", "b_rotor"} <= set(pair.split()) for pair in found.together), found.together


def test_a_capacitor_known_to_a_tenth_widens_the_lag() -> None:
    rig = with_tolerance("dc_link", "c_dc", None)
    run = made_log(seed=1)
    payouts = steady_payouts(run)
    loose, tight = (calibrate(run, r, payouts).regression for r in (RIG, rig))
    assert loose.lag == tight.lag
    assert loose.u_lag > 2e-3 > tight.u_lag


def test_something_else_that_acts_is_reported_as_strain() -> None:
    model = baseline(RIG)
    run = made_log(msgspec.structs.replace(model, restoring=msgspec.structs.replace(model.restoring, exponent=1.3)))
    found = calibrate(run, RIG, steady_payouts(run))
    assert found.misfit > 2.0
    assert all(abs(strain.by) > STRAINED for strain in found.strained)
    assert "volume_gas" in {strain.name for strain in found.strained}


def test_only_the_cycles_that_count_are_looked_at_for_damper_and_screw() -> None:
    run = made_log(seed=1)
    spoilt = dict(run.channels)
    spoilt["force"] = np.where(run.t > 72.0, 2.0 * run.channels["force"], run.channels["force"])
    run = msgspec.structs.replace(run, channels=spoilt)
    found = calibrate(run, RIG, steady_payouts(run)[:2], cycles=(1, 2))
    assert number(found, "mu_screw")[0] == pytest.approx(0.04, rel=0.03)


def test_without_a_torque_sensor_the_force_serves() -> None:
    run = made_log(seed=1)
    bare = msgspec.structs.replace(run, channels={k: x for k, x in run.channels.items() if k != "torque"})
    found = calibrate(bare, RIG, steady_payouts(bare))
    damper = next(n for n in found.numbers if n.name == "b_rotor")
    assert damper.low <= 7.5e-4 <= damper.high
    assert damper.how == "line tension and pressure"


NAMED = ("none", "none_2", "ke_rolloff", "copper_heating", "electrical_lag")
"""Campaigns whose hidden effect, if any, leaves an open circuit's numbers alone."""

INSIDE = 18
"""Of 20 intervals of 95 %."""


@pytest.mark.slow
def test_the_numbers_of_labelled_campaigns_lie_in_their_intervals(shared: Path) -> None:
    inside = 0
    for case in NAMED:
        folder = shared / "labelled" / case
        truth = truth_of(folder)["rig"]
        run = read_run(folder / "open_circuit.csv", load=math.inf)
        plateaus = [(c.phases.onset, c.summary.payout.plateau) for c in reduce(run).complete]
        found = calibrate(run, RIG, [(onset, p.braking) for onset, p in plateaus if p is not None])
        for n in found.numbers:
            inside += n.low <= truth[TRUE[n.name]] <= n.high
        late = abs(found.regression.lag) > 3.0 * found.regression.u_lag
        assert late == (case == "electrical_lag"), case
    assert inside >= INSIDE


def test_a_log_with_a_load_is_rejected() -> None:
    run = made_log(cycles=1, load=18.0)
    with pytest.raises(LogError, match=r"made.csv: a log with a load of 18 ohm; a calibration needs an open circuit"):
        calibrate(run, RIG, steady_payouts(run))


def test_a_log_whose_load_is_unknown_is_rejected() -> None:
    run = msgspec.structs.replace(made_log(cycles=1), load=None)
    with pytest.raises(
        LogError, match=r"its load is unknown, .* give --load-ohm inf if no load was connected, or list"
    ):
        calibrate(run, RIG, steady_payouts(run))


@pytest.mark.parametrize(
    ("name", "says"),
    [("force", "no line tension, which damper and screw friction"), ("vdc", "no DC voltage, which a back")],
)
def test_a_log_without_what_a_calibration_needs_is_rejected(name: str, says: str) -> None:
    run = made_log(cycles=1)
    bare = msgspec.structs.replace(run, channels={k: x for k, x in run.channels.items() if k != name})
    with pytest.raises(LogError, match=says):
        calibrate(bare, RIG, steady_payouts(run))


def test_a_rig_without_a_generator_is_rejected() -> None:
    run = made_log(cycles=1)
    with pytest.raises(RigError, match="rig kitepower: no model can be made, as it lacks"):
        calibrate(run, built_in("kitepower"), steady_payouts(run))


def test_a_number_without_an_estimate_is_rejected() -> None:
    run = made_log(cycles=1)
    free = msgspec.structs.replace(RIG.drivetrain, b_rotor=Quantity(0.0, "N.m.s/rad"))
    with pytest.raises(
        RigError, match=r"b_rotor under \[drivetrain\] is 0; a calibration starts from an estimate, give one"
    ):
        calibrate(run, msgspec.structs.replace(RIG, drivetrain=free), steady_payouts(run))


def test_an_estimate_that_is_far_off_does_not_hold_the_number_back() -> None:
    run = made_log(seed=1)
    half = msgspec.structs.replace(RIG.drivetrain, b_rotor=Quantity(2.5e-4, "N.m.s/rad"))
    found = calibrate(run, msgspec.structs.replace(RIG, drivetrain=half), steady_payouts(run))
    _, low, high = number(found, "b_rotor")
    assert low <= 7.5e-4 <= high


def test_an_open_circuit_that_delivers_power_is_rejected(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "r36ohm.csv", load=math.inf)
    with pytest.raises(LogError, match=r"stated as an open circuit, but it delivers .* W .*without load"):
        calibrate(run, built_in(), [(4.8, 12.0)])
