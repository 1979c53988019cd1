"""The model of the rig: against campaigns of an independent simulation, and against itself."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rigs import SENSORS, assert_followed, logs_of, own_model, truth_of

from winchcascade import read_run, reduce
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.kernel import COLUMNS
from winchcascade.rig.parts import changed
from winchcascade.rig.simulate import LEDGER, motion_of, simulate, solve, write_log


@pytest.mark.parametrize("case", ["none", "none_2"])
def test_a_campaign_without_an_effect_is_followed_with_the_rigs_own_numbers(shared: Path, case: str) -> None:
    folder = shared / "labelled" / case
    truth = truth_of(folder)
    gains = dict(zip(SENSORS, truth["sensor_gains"], strict=True))
    for log, load in logs_of(folder):
        run = read_run(log, load=load)
        assert_followed(run, simulate(run, own_model(truth)).run, gains)


BLURRED = 0.03
"""Largest difference of the motion of every fifth sample from that of all, at braking. [m/s]"""


def test_the_motion_of_a_coarse_log_is_not_blurred(fixtures: Path, tmp_path: Path) -> None:
    lines = (fixtures / "campaign" / "r36ohm.csv").read_text().splitlines()
    coarse = tmp_path / "5hz.csv"
    coarse.write_text("\n".join([lines[0], *lines[1::5]]) + "\n")
    whole, thinned = (motion_of(read_run(log), 1e-2) for log in (fixtures / "campaign" / "r36ohm.csv", coarse))
    k = min(whole.v.size, thinned.v.size)
    assert np.max(np.abs(whole.v[:k] - thinned.v[:k])) < BLURRED


HALVED = 5e-4
"""Halving the step changes no channel by more than this share of its plateau."""


@pytest.mark.parametrize("load", [math.inf, 45.0, 18.0, 4.5])
def test_half_the_step_changes_nothing(fixtures: Path, load: float) -> None:
    run = read_run(fixtures / "campaign" / "r18ohm.csv", load=load)
    model = baseline(built_in())
    coarse, fine = (simulate(run, model, step=step).run.channels for step in (5e-4, 2.5e-4))
    for name in SENSORS:
        plateau = float(np.quantile(np.abs(coarse[name]), 0.95))
        assert np.max(np.abs(coarse[name] - fine[name])) < HALVED * plateau, name


BALANCED = 1e-3


@pytest.mark.parametrize("load", [math.inf, 45.0, 9.0, 4.5])
def test_the_lines_energy_is_stored_lost_or_delivered(fixtures: Path, load: float) -> None:
    run = read_run(fixtures / "campaign" / "r18ohm.csv", load=load)
    energy = simulate(run, baseline(built_in())).energy
    last = int(np.argmax(energy["line"]))
    assert tuple(energy) == LEDGER
    assert sum(energy[name][last] for name in LEDGER[1:]) == pytest.approx(energy["line"][last], rel=BALANCED)
    assert all(energy[name][last] >= -1e-3 for name in LEDGER[1:])


def test_when_the_drum_slows_the_rotor_runs_on_alone(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)
    model = baseline(built_in())
    motion = motion_of(run, 1e-3)
    out = solve(model, motion, 18.0)
    torque, omega = out[:, COLUMNS.index("torque")], out[:, COLUMNS.index("omega_gen")]
    hauled = motion.v < -0.5
    assert np.all(torque >= 0.0)
    assert np.all(torque[hauled] == 0.0)
    slowing = (motion.v > 0.1) & (motion.a < -0.3)
    assert np.mean(omega[slowing] >= 50.0 * motion.v[slowing] / 0.13) > 0.5


@pytest.mark.parametrize("friction", [-0.01, 0.01])
def test_the_rotor_comes_to_rest_also_with_a_negative_tolerance_of_its_friction(
    fixtures: Path, friction: float
) -> None:
    run = read_run(fixtures / "campaign" / "open_circuit.csv", load=math.inf)
    model = changed(baseline(built_in()), "drivetrain.friction", "add", friction)
    omega = solve(model, motion_of(run, 1e-3), math.inf)[:, COLUMNS.index("omega_gen")]
    assert omega.max() > 100.0
    assert 0.0 <= omega[-1] < 0.02 * omega.max()


def test_a_simulation_never_looks_at_the_channels_it_predicts(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)
    blind = msgspec.structs.replace(run, channels={n: run.channels[n] for n in ("displacement", "velocity")})
    model = baseline(built_in())
    seen, unseen = simulate(run, model).run.channels, simulate(blind, model).run.channels
    assert all(np.array_equal(seen[name], unseen[name]) for name in SENSORS)


def test_a_simulated_log_is_read_without_a_finding_and_known_as_simulated(fixtures: Path, tmp_path: Path) -> None:
    run = read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)
    simulation = simulate(run, baseline(built_in()))
    path = tmp_path / "sim.csv"
    write_log(simulation, path)
    again = read_run(path, load=18.0)
    assert again.simulated
    assert again.findings == ()
    assert np.allclose(again.t, run.t)
    written, direct = reduce(again, window=5.96).mean, reduce(simulation.run, window=5.96).mean
    assert written.eta_gen == pytest.approx(direct.eta_gen, rel=1e-6)
    header = (fixtures / "campaign" / "r18ohm.csv").read_text().splitlines()[0]
    assert path.read_text().splitlines()[0].startswith(header + ",")


def test_the_smoothing_takes_noise_out_of_the_acceleration_and_leaves_braking(fixtures: Path) -> None:
    t = np.arange(0.0, 20.0, 0.04)
    v = np.interp(t, [0, 5, 7, 15, 16, 20], [0, 0, 1.0, 1.0, 0, 0])
    noisy = v + np.random.default_rng(3).normal(0.0, 0.004, t.size)
    run = read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)
    run = msgspec.structs.replace(run, t=t, fs=25.0, channels={"velocity": noisy})
    motion = motion_of(run, 1e-3)
    rest, braking = (motion.t > 1) & (motion.t < 4), (motion.t > 15.3) & (motion.t < 15.7)
    assert np.std(motion.a[rest]) < 0.05  # 0.14 without smoothing
    assert np.mean(motion.a[braking]) == pytest.approx(-1.0, abs=0.05)


def test_a_rig_file_without_a_part_names_all_that_it_lacks() -> None:
    with pytest.raises(
        RigError, match=r"rig kitepower: no model can be made, as it lacks r_drum under \[winch\], inertia"
    ):
        baseline(built_in("kitepower"))


def test_a_rig_without_a_one_way_clutch_has_no_model() -> None:
    def with_clutch(value: bool | None) -> Rig:
        rig = built_in()
        return msgspec.structs.replace(rig, drivetrain=msgspec.structs.replace(rig.drivetrain, one_way_clutch=value))

    assert baseline(with_clutch(None)) == baseline(with_clutch(True))
    with pytest.raises(RigError, match="one_way_clutch under"):
        baseline(with_clutch(False))


def paid_out(run: Run, factor: float) -> Run:
    """The same run with a larger motion."""
    channels = {name: factor * run.channels[name] for name in ("displacement", "velocity")}
    return msgspec.structs.replace(run, channels=channels)


def test_a_payout_that_would_press_the_gas_to_nothing_is_rejected(fixtures: Path) -> None:
    run = paid_out(read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0), 5.0)
    with pytest.raises(LogError) as fault:
        simulate(run, baseline(built_in()))
    assert str(fault.value) == (
        "r18ohm.csv: the line pays out 48.39 m, but after 41.62 m the piston would have pressed the gas of 4 L to nothing; "
        "expected less payout, so check the unit of velocity and displacement, volume_gas and area_piston of the rig file, "
        "and the effects."
    )


def test_a_payout_that_would_leave_the_rope_no_radius_is_rejected(fixtures: Path) -> None:
    run, model = read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0), baseline(built_in())
    thin = msgspec.structs.replace(model, winch=msgspec.structs.replace(model.winch, layering=-0.125))
    with pytest.raises(LogError, match=r"but at 8 m the rope would run on a radius of nothing; expected less motion"):
        simulate(run, thin)


@pytest.mark.parametrize(
    ("part", "number", "value", "sentence"),
    [
        ("drivetrain", "eta_mesh", -0.05, "mesh efficiency is -0.05; expected above 0 and at most 1"),
        ("restoring", "mu", -0.03, "friction coefficient of the screw is -0.03; expected 0 or more"),
        ("restoring", "volume", 0.0, r"gas volume \[m3\] is 0; expected above 0"),
        ("restoring", "pressure", 0.0, r"precharge pressure, absolute \[Pa\] is 0; expected above 0"),
        ("winch", "inertia", -0.1, r"inertia at the drum \[kg m2\] is -0.1; expected 0 or more"),
    ],
)
def test_numbers_that_no_rig_has_are_rejected(
    fixtures: Path, part: str, number: str, value: float, sentence: str
) -> None:
    run, model = read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0), baseline(built_in())
    bent = msgspec.structs.replace(getattr(model, part), **{number: value})
    with pytest.raises(RigError, match=sentence):
        simulate(run, msgspec.structs.replace(model, **{part: bent}))
