"""The model of the rig: against campaigns of an independent simulation, and against itself."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rigs import SENSORS, assert_followed, logs_of, motion_along, own_model, truth_of

from winchcascade import read_run, reduce
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.kernel import COLUMNS
from winchcascade.rig.ledger import LEDGER
from winchcascade.rig.parts import with_part
from winchcascade.rig.simulate import simulate, solve, write_log

MODEL = baseline(built_in())


@pytest.fixture
def r18ohm(fixtures: Path) -> Run:
    return read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)


@pytest.mark.parametrize("case", ["none", "none_2"])
def test_a_campaign_without_an_effect_is_followed_with_the_rigs_own_numbers(
    shared: Path, case: str
) -> None:
    folder = shared / "labelled" / case
    truth = truth_of(folder)
    gains = dict(zip(SENSORS, truth["sensor_gains"], strict=True))
    for log, load in logs_of(folder):
        run = read_run(log, load=load)
        assert_followed(run, simulate(run, own_model(truth)).run, gains)


def test_the_motion_of_a_coarse_log_is_not_blurred(fixtures: Path, tmp_path: Path) -> None:
    lines = (fixtures / "campaign" / "r36ohm.csv").read_text().splitlines()
    coarse = tmp_path / "5hz.csv"
    coarse.write_text("\n".join([lines[0], *lines[1::5]]) + "\n")
    whole, thinned = (
        motion_along(read_run(log), 1e-2) for log in (fixtures / "campaign" / "r36ohm.csv", coarse)
    )
    k = min(whole.v.size, thinned.v.size)
    assert np.max(np.abs(whole.v[:k] - thinned.v[:k])) < 0.03  # at braking [m/s]


def test_the_smoothing_takes_noise_out_of_the_acceleration_and_leaves_braking(r18ohm: Run) -> None:
    t = np.arange(0.0, 20.0, 0.04)
    v = np.interp(t, [0, 5, 7, 15, 16, 20], [0, 0, 1.0, 1.0, 0, 0])
    noisy = v + np.random.default_rng(3).normal(0.0, 0.004, t.size)
    motion = motion_along(
        msgspec.structs.replace(r18ohm, t=t, fs=25.0, channels={"velocity": noisy}), 1e-3
    )
    rest, braking = (motion.t > 1) & (motion.t < 4), (motion.t > 15.3) & (motion.t < 15.7)
    assert np.std(motion.a[rest]) < 0.05  # 0.14 without smoothing
    assert np.mean(motion.a[braking]) == pytest.approx(-1.0, abs=0.05)


@pytest.mark.parametrize("load", [math.inf, 18.0, 4.5])
def test_half_the_step_changes_nothing_and_the_energy_of_the_line_is_stored_lost_or_delivered(
    r18ohm: Run, load: float
) -> None:
    run = msgspec.structs.replace(r18ohm, load=load)
    coarse, fine = (simulate(run, MODEL, step=step) for step in (5e-4, 2.5e-4))
    for name in SENSORS:
        plateau = float(np.quantile(np.abs(coarse.run.channels[name]), 0.95))
        assert (
            np.max(np.abs(coarse.run.channels[name] - fine.run.channels[name])) < 5e-4 * plateau
        ), name
    energy = coarse.energy
    last = int(np.argmax(energy["line"]))
    booked = [energy[name][last] for name in LEDGER if name != "line"]
    assert list(energy) == list(LEDGER)
    assert sum(booked) == pytest.approx(energy["line"][last], rel=1e-3)
    assert min(booked) >= -1e-3


def test_when_the_drum_slows_the_rotor_runs_on_alone(r18ohm: Run) -> None:
    motion = motion_along(r18ohm, 1e-3)
    out = solve(MODEL, motion, 18.0)
    torque, omega = out[:, COLUMNS.index("torque")], out[:, COLUMNS.index("omega_gen")]
    assert np.all(torque >= 0.0)
    assert np.all(torque[motion.v < -0.5] == 0.0)
    slowing = (motion.v > 0.1) & (motion.a < -0.3)
    assert np.mean(omega[slowing] >= 50.0 * motion.v[slowing] / 0.13) > 0.5


@pytest.mark.parametrize("friction", [-0.01, 0.01])
def test_the_rotor_comes_to_rest_also_with_a_negative_tolerance_of_its_friction(
    r18ohm: Run, friction: float
) -> None:
    model = with_part(MODEL, "drivetrain", friction=friction)
    omega = solve(model, motion_along(r18ohm, 1e-3), math.inf)[:, COLUMNS.index("omega_gen")]
    assert omega.max() > 100.0
    assert 0.0 <= omega[-1] < 0.02 * omega.max()


def test_a_simulation_never_looks_at_the_channels_it_predicts(r18ohm: Run) -> None:
    blind = msgspec.structs.replace(
        r18ohm, channels={n: r18ohm.channels[n] for n in ("displacement", "velocity")}
    )
    seen, unseen = simulate(r18ohm, MODEL).run.channels, simulate(blind, MODEL).run.channels
    assert all(np.array_equal(seen[name], unseen[name]) for name in SENSORS)


def test_a_simulated_log_is_read_without_a_finding_and_known_as_simulated(
    r18ohm: Run, tmp_path: Path
) -> None:
    simulation = simulate(r18ohm, MODEL)
    path = tmp_path / "sim.csv"
    write_log(simulation, path)
    again = read_run(path, load=18.0)
    assert again.simulated
    assert again.findings == ()
    assert np.allclose(again.t, r18ohm.t)
    written, direct = reduce(again, window=5.96).mean, reduce(simulation.run, window=5.96).mean
    assert written.eta_gen == pytest.approx(direct.eta_gen, rel=1e-6)


def test_a_rig_that_lacks_numbers_or_a_one_way_clutch_has_no_model() -> None:
    with pytest.raises(
        RigError, match=r"no model can be made, as it lacks r_drum, inertia under \[winch\]"
    ):
        baseline(built_in("kitepower"))
    rig = built_in()
    other = msgspec.structs.replace(
        rig, drivetrain=msgspec.structs.replace(rig.drivetrain, one_way_clutch=False)
    )
    with pytest.raises(RigError, match="one_way_clutch under"):
        baseline(other)


def test_a_motion_that_gas_or_drum_do_not_allow_is_rejected(r18ohm: Run) -> None:
    channels = {name: 5.0 * r18ohm.channels[name] for name in ("displacement", "velocity")}
    with pytest.raises(
        LogError, match=r"pays out 48\.39 m, but after 41\.62 m .* the gas of 4 L to nothing"
    ):
        simulate(msgspec.structs.replace(r18ohm, channels=channels), MODEL)
    with pytest.raises(
        LogError,
        match=r"but at 8 m the rope would run on a radius of nothing; expected less motion",
    ):
        simulate(r18ohm, with_part(MODEL, "winch", layering=-0.125))


@pytest.mark.parametrize(
    ("part", "number", "value", "sentence"),
    [
        (
            "drivetrain",
            "eta_mesh",
            -0.05,
            "mesh efficiency is -0.05; expected above 0 and at most 1",
        ),
        (
            "restoring",
            "mu",
            -0.03,
            "friction coefficient of the screw is -0.03; expected 0 or more",
        ),
        ("restoring", "volume", 0.0, "volume of the gas is 0 m3; expected above 0"),
        ("generator", "v_diode", -0.1, "drop of a diode is -0.1 V; expected 0 or more"),
        ("winch", "inertia", -0.1, "inertia at the drum is -0.1 kg.m2; expected 0 or more"),
        ("generator", "k_e", math.nan, "k_e is NaN"),
    ],
)
def test_numbers_that_no_rig_has_are_rejected(
    r18ohm: Run, part: str, number: str, value: float, sentence: str
) -> None:
    with pytest.raises(RigError, match=sentence):
        simulate(r18ohm, with_part(MODEL, part, **{number: value}))
