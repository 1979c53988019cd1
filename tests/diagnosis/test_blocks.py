"""A log in blocks: every phase is covered, nothing twice, no block in two phases; and the noise
of their means.
"""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from openlog import FS, NOISE, made_log
from rigs import blocks_on, calibrated_rig, course_of, scale_of

from winchcascade.core.integrate import white_noise
from winchcascade.core.run import Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.diagnosis.fit.block_means import (
    BLOCK,
    HAUL_IN,
    HOLD,
    PAYOUT,
    PHASES,
    Blocks,
    changing,
)
from winchcascade.diagnosis.fit.block_noise import (
    MAX_NOISE,
    NOISELESS,
    noise_of,
    with_extra,
    with_ramps,
    without_slack,
)
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.ingest.read import read_run
from winchcascade.reduction.phases import detect, smoothed_velocity
from winchcascade.rig.baseline import baseline
from winchcascade.rig.line_velocity import SMOOTHING, line_velocity
from winchcascade.rig.parts import with_part

RIG = calibrated_rig()

MIN_COVERED = 0.97
"""Samples that lie in blocks: what is left are stretches shorter than half a block, and the last
sample.
"""

WITHIN = 0.15
"""The noise of a log of two minutes is found to this share."""


@pytest.fixture
def run(fixtures: Path) -> Run:
    return read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)


@pytest.mark.parametrize("every", [1, 5])
def test_blocks_cover_the_log_and_each_lies_within_one_phase_of_one_cycle(
    run: Run, every: int
) -> None:
    channels = {name: x[::every] for name, x in run.channels.items()}
    run = msgspec.structs.replace(run, t=run.t[::every], channels=channels, fs=run.fs / every)
    blocks, taken = blocks_on(run, RIG), np.zeros(run.t.size, dtype=int)
    cycles = detect(run, smoothed_velocity(run, RIG.thresholds), RIG.thresholds)
    spans = {(k, PAYOUT): (cycle.onset, cycle.payout_end) for k, cycle in enumerate(cycles, 1)}
    spans |= {(k, HAUL_IN): cycle.haul_in for k, cycle in enumerate(cycles, 1) if cycle.haul_in}
    for a, b, phase, number in zip(
        blocks.start, blocks.stop, blocks.phase, blocks.cycle, strict=True
    ):
        taken[a:b] += 1
        first, last = run.t[a], run.t[b - 1]
        if phase == HOLD:
            assert all(last < begin or first >= end for begin, end in spans.values())
        else:
            begin, end = spans[int(number), int(phase)]
            assert begin <= first <= last < end
    assert taken.max() == 1
    assert np.mean(taken) > MIN_COVERED
    assert np.median(blocks.count) == (
        4 if every == 5 else round(BLOCK * scale_of(run).ramp * run.fs)
    )
    follows = (
        (blocks.start[1:] == blocks.stop[:-1])
        & (np.diff(blocks.phase) == 0)
        & (np.diff(blocks.cycle) == 0)
    )
    assert np.array_equal(blocks.joined, [False, *follows])


def test_only_the_cycles_that_count_are_cut(run: Run) -> None:
    whole, second = blocks_on(run, RIG), blocks_on(run, RIG, (2, 2))
    assert set(whole.cycle.tolist()) == {0, 1, 2, 3}
    assert second.start.tolist() == whole.start[whole.cycle == 2].tolist()
    assert set(blocks_on(run, RIG, (1, 2)).cycle.tolist()) == {
        0,
        1,
        2,
    }  # rest before the first payout goes with it


def test_a_block_that_a_gap_has_emptied_is_dropped_and_the_next_is_not_joined(run: Run) -> None:
    lost = (run.t > 9.0) & (run.t < 9.9)
    kept = {name: x[~lost] for name, x in run.channels.items()}
    gap = np.array([[run.t[~lost][run.t[~lost] <= 9.0][-1], run.t[run.t >= 9.9][0]]])
    holed = msgspec.structs.replace(run, t=run.t[~lost], channels=kept, gaps={"clock": gap})
    blocks = blocks_on(holed, RIG)
    after = int(np.flatnonzero(holed.t[blocks.start] >= 9.9)[0])
    assert blocks.joined[after : after + 2].tolist() == [False, True]
    assert np.all(blocks.count >= 0.5 * BLOCK * scale_of(holed).ramp * run.fs)


def test_means_and_scatter_are_those_of_the_samples() -> None:
    run = made_log(cycles=1)
    blocks, ramp = blocks_on(run, RIG), 3.0 + 2.0 * run.t
    noisy = ramp + np.random.default_rng(4).normal(0.0, 0.1, run.t.size)
    assert blocks.mean(ramp) == pytest.approx(
        [ramp[a:b].mean() for a, b in zip(blocks.start, blocks.stop, strict=True)]
    )
    assert blocks.scatter(ramp) == pytest.approx(0.0, abs=1e-5)
    assert math.sqrt(float(np.mean(blocks.scatter(noisy) ** 2))) == pytest.approx(0.1, rel=0.1)


# ------------------------------------------------------------------------------------ their noise
@pytest.mark.parametrize("sd", [0.01, 5.0])
@pytest.mark.parametrize("ringing", [0.0, 20.0])
def test_white_noise_is_found_over_a_ramp_and_a_ringing_tether(sd: float, ringing: float) -> None:
    t = np.arange(0.0, 110.0, 1.0 / FS)
    smooth = 40.0 * sd * t + ringing * sd * np.sin(2.0 * math.pi * 2.2 * t)
    assert white_noise(smooth + np.random.default_rng(7).normal(0.0, sd, t.size)) == pytest.approx(
        sd, rel=WITHIN
    )
    assert white_noise(np.sin(t)) < 1e-5
    assert white_noise(np.floor(t) * 0.5) == pytest.approx(0.5 / math.sqrt(12.0))


def test_the_noise_of_sensors_and_velocity_is_that_of_the_means_of_blocks() -> None:
    quiet, noisy = made_log(), made_log(seed=11)
    course = course_of(noisy, RIG)
    off = noisy.channels["velocity"] - quiet.channels["velocity"]
    actual = float(
        np.std(course.blocks.mean(local_quadratic(quiet.t, off, SMOOTHING * course.scale.ramp)))
    )
    assert line_velocity(noisy, course.scale.ramp).noise(
        round(float(np.median(course.blocks.count)))
    ) == pytest.approx(actual, rel=WITHIN)
    own = noise_of(course, baseline(RIG), course.predict(baseline(RIG))).own[
        :, CHANNELS.index("torque")
    ]
    assert own == pytest.approx(NOISE["torque"] / np.sqrt(course.blocks.count), rel=WITHIN)


@pytest.mark.parametrize("load", [math.inf, 18.0])
def test_a_channel_says_nothing_where_the_model_leaves_it_open(fixtures: Path, load: float) -> None:
    model, run = baseline(RIG), read_run(fixtures / "campaign" / "r18ohm.csv", load=load)
    course = course_of(run, RIG)
    seen = noise_of(course, model, course.predict(model)).seen
    force, vdc, idc = (CHANNELS.index(name) for name in ("force", "vdc", "idc"))
    assert not seen[course.blocks.phase == HOLD, force].any()  # friction points either way
    assert seen[:, CHANNELS.index("pressure")].all()
    assert seen[:, idc].any() == math.isfinite(load)
    assert seen[course.blocks.phase == HAUL_IN, vdc].any() == math.isfinite(
        load
    )  # the bleed alone empties the capacitor


def test_what_scatters_beyond_the_sensors_is_added_and_a_smooth_gap_is_not() -> None:
    run, model = made_log(seed=3), baseline(RIG)
    course = course_of(run, RIG)
    blocks, noise = course.blocks, noise_of(course, model, course.predict(model))
    smooth = np.linspace(0.0, 200.0, blocks.size)[:, None] * np.ones(len(CHANNELS))
    assert with_extra(noise, blocks, smooth).own == pytest.approx(noise.own)
    k, payout = CHANNELS.index("force"), blocks.phase == PHASES.index("payout")
    smooth[payout, k] += np.random.default_rng(5).normal(0.0, 30.0, int(payout.sum()))
    found = with_extra(noise, blocks, smooth)
    assert np.median(found.total[payout, k]) == pytest.approx(30.0, rel=0.3)
    assert found.own[~payout] == pytest.approx(noise.own[~payout])


@pytest.mark.parametrize("simulated", [True, False])
def test_a_simulation_without_noise_counts_as_known_to_a_share_and_a_measured_log_does_not(
    simulated: bool,
) -> None:
    run, model = msgspec.structs.replace(made_log(), simulated=simulated), baseline(RIG)
    course = course_of(run, RIG)
    predicted = course.predict(model)
    own = noise_of(course, model, predicted).own[:, 0] / (NOISELESS * np.max(predicted[:, 0]))
    assert np.all(own >= 1.0) if simulated else np.all(own < 1e-2)


@pytest.mark.parametrize("goes_slack", [True, False])
def test_the_force_of_a_slack_line_says_nothing(goes_slack: bool) -> None:
    model = with_part(baseline(RIG), "winch", goes_slack=goes_slack)
    course = course_of(made_log(seed=3), RIG)
    predicted, k = course.predict(model), CHANNELS.index("force")
    noise = noise_of(course, model, predicted)
    slack = course.blocks.phase == HAUL_IN
    predicted[slack, k] = 0.5 * MAX_NOISE * noise.own[slack, k]
    seen = without_slack(noise, model, predicted).seen
    assert noise.seen[slack, k].any()
    assert seen[slack, k].any() != goes_slack
    assert np.array_equal(np.delete(seen, k, axis=1), np.delete(noise.seen, k, axis=1))
    assert np.array_equal(seen[~slack, k], noise.seen[~slack, k])


def slow_ramps(blocks: Blocks, length: int) -> Signal:
    """A speed that rises over some blocks of each payout and is even after them, (m,). [m/s]"""
    payout = blocks.phase == PHASES.index("payout")
    first = np.flatnonzero(payout & np.diff(payout.astype(int), prepend=0) > 0)
    since = (
        np.arange(blocks.size)
        - first[np.maximum(np.searchsorted(first, np.arange(blocks.size), "right") - 1, 0)]
    )
    return np.where(payout, np.minimum((since + 1.0) / length, 1.0), 0.0)


def test_what_a_fit_leaves_within_slow_ramps_is_noise_there_alone() -> None:
    run, model = made_log(seed=3, cycles=4), baseline(RIG)
    course = course_of(run, RIG)
    blocks = course.blocks
    noise, speed = noise_of(course, model, course.predict(model)), slow_ramps(blocks, 8)
    k, ramps = CHANNELS.index("torque"), changing(blocks, speed)
    smooth = np.linspace(0.0, 200.0, blocks.size)[:, None] * np.ones(len(CHANNELS))
    assert ramps.any()
    assert np.array_equal(with_ramps(noise, blocks, smooth, speed).own, noise.own)
    rough = smooth.copy()
    rough[ramps, k] += np.random.default_rng(5).normal(0.0, 30.0, int(ramps.sum()))
    found = with_ramps(noise, blocks, rough, speed)
    assert np.median(found.total[ramps, k]) == pytest.approx(30.0, rel=0.4)
    assert np.array_equal(np.delete(found.own, k, axis=1), np.delete(noise.own, k, axis=1))
    even = (speed == 1.0) & (np.roll(speed, 1) == 1.0) & (np.roll(speed, -1) == 1.0)
    assert np.array_equal(found.own[even], noise.own[even])


def test_a_ramp_of_one_or_two_blocks_shows_no_scatter_of_its_own() -> None:
    course = course_of(made_log(seed=3, cycles=4), RIG)
    blocks, model = course.blocks, baseline(RIG)
    noise = noise_of(course, model, course.predict(model))
    rough = np.random.default_rng(5).normal(0.0, 30.0, (blocks.size, len(CHANNELS)))
    assert np.array_equal(with_ramps(noise, blocks, rough, slow_ramps(blocks, 2)).own, noise.own)
