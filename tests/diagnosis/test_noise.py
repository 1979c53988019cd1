"""Noise of a log as its own samples tell it."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from openlog import FS, NOISE, made_log

from winchcascade import read_run
from winchcascade.core.integrate import white_noise
from winchcascade.core.rig_toml import built_in
from winchcascade.core.smooth import local_quadratic
from winchcascade.diagnosis.block_means import PHASES, blocks_of
from winchcascade.diagnosis.misfit import NOISELESS, noise_of, with_extra
from winchcascade.diagnosis.predict import CHANNELS, Course
from winchcascade.rig.baseline import baseline
from winchcascade.rig.line_velocity import line_velocity

WITHIN = 0.15
"""The noise of a log of two minutes is found to this share."""

T = np.arange(0.0, 110.0, 1.0 / FS)


@pytest.mark.parametrize("sd", [0.01, 0.3, 5.0])
@pytest.mark.parametrize("ringing", [0.0, 5.0, 20.0])
def test_white_noise_is_found_over_a_ramp_and_a_ringing_tether(sd: float, ringing: float) -> None:
    smooth = 40.0 * sd * T + ringing * sd * np.sin(2.0 * math.pi * 2.2 * T)
    found = white_noise(smooth + np.random.default_rng(7).normal(0.0, sd, T.size))
    assert found == pytest.approx(sd, rel=WITHIN)


def test_a_smooth_signal_has_no_noise_and_a_coarse_one_that_of_its_resolution() -> None:
    assert white_noise(np.sin(T)) < 1e-5
    steps = np.floor(T) * 0.5
    assert white_noise(steps) == pytest.approx(0.5 / math.sqrt(12.0))
    assert white_noise(np.zeros(500)) == 0.0
    assert white_noise(T[:5]) == 0.0


def test_the_noise_of_the_smoothed_velocity_is_that_of_its_block_means() -> None:
    quiet, noisy = made_log(), made_log(seed=11)
    blocks = blocks_of(quiet, built_in())
    off = noisy.channels["velocity"] - quiet.channels["velocity"]
    actual = float(np.std(blocks.mean(local_quadratic(quiet.t, off, 11.0 / FS))))
    assert line_velocity(noisy).noise(round(float(np.median(blocks.count)))) == pytest.approx(actual, rel=WITHIN)


def test_a_channel_says_nothing_where_the_model_leaves_it_open(fixtures: Path) -> None:
    model = baseline(built_in())
    for load in (math.inf, 18.0):
        run = read_run(fixtures / "campaign" / "r18ohm.csv", load=load)
        course = Course(run, blocks_of(run, built_in()))
        seen = noise_of(course, model, course.predict(model)).seen
        held = course.blocks.phase == PHASES.index("hold")
        force, vdc, idc = (CHANNELS.index(name) for name in ("force", "vdc", "idc"))
        assert not seen[held, force].any()  # friction points either way
        assert seen[:, CHANNELS.index("pressure")].all()
        assert seen[:, idc].any() == math.isfinite(load)
        hauled = course.blocks.phase == PHASES.index("haul_in")
        assert seen[hauled, vdc].any() == math.isfinite(load)  # a capacitor that the bleed alone empties


def test_sensors_noise_in_a_block_falls_with_the_root_of_its_samples() -> None:
    run, model = made_log(seed=3), baseline(built_in())
    course = Course(run, blocks_of(run, built_in()))
    own = noise_of(course, model, course.predict(model)).own
    k = CHANNELS.index("torque")
    assert own[:, k] == pytest.approx(NOISE["torque"] / np.sqrt(course.blocks.count), rel=WITHIN)


def test_what_scatters_beyond_the_sensors_is_added_and_a_smooth_gap_is_not() -> None:
    run, model = made_log(seed=3), baseline(built_in())
    course = Course(run, blocks_of(run, built_in()))
    blocks, noise = course.blocks, noise_of(course, model, course.predict(model))
    smooth = np.linspace(0.0, 200.0, blocks.size)[:, None] * np.ones(len(CHANNELS))
    assert with_extra(noise, blocks, smooth).own == pytest.approx(noise.own)
    k, payout = CHANNELS.index("force"), blocks.phase == PHASES.index("payout")
    gusts = smooth.copy()
    gusts[payout, k] += np.random.default_rng(5).normal(0.0, 30.0, int(payout.sum()))
    found = with_extra(noise, blocks, gusts)
    assert np.median(found.total[payout, k]) == pytest.approx(30.0, rel=0.3)
    assert found.own[~payout] == pytest.approx(noise.own[~payout])


def test_a_simulation_without_noise_counts_as_known_to_a_share_and_a_measured_log_does_not() -> None:
    run, model = made_log(), baseline(built_in())
    assert run.simulated
    course = Course(run, blocks_of(run, built_in()))
    predicted = course.predict(model)
    assert np.all(noise_of(course, model, predicted).own >= NOISELESS * np.max(np.abs(predicted), axis=0))
    measured = msgspec.structs.replace(run, simulated=False)
    course = Course(measured, blocks_of(measured, built_in()))
    assert np.all(noise_of(course, model, predicted).own[:, 0] < 1e-2 * NOISELESS * np.max(predicted[:, 0]))
