"""A log in blocks: every phase is covered, nothing twice, no block in two phases."""

import math
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from openlog import made_log

from winchcascade import read_run
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.block_means import BLOCK, PHASES, Blocks, blocks_of
from winchcascade.reduction.phases import detect, smoothed_velocity

RIG = built_in()
MIN_COVERED = 0.97
"""Samples that lie in blocks: what is left are stretches shorter than half a block, and the last sample."""


@pytest.fixture
def run(fixtures: Path) -> Run:
    return read_run(fixtures / "campaign" / "r18ohm.csv", load=18.0)


def inside(blocks: Blocks, run: Run) -> list[slice]:
    return [slice(a, b) for a, b in zip(blocks.start.tolist(), blocks.stop.tolist(), strict=True)]


def test_blocks_cover_the_log_and_no_sample_twice(run: Run) -> None:
    blocks = blocks_of(run, RIG)
    taken = np.zeros(run.t.size, dtype=int)
    for block in inside(blocks, run):
        taken[block] += 1
    assert taken.max() == 1
    assert np.mean(taken) > MIN_COVERED


def test_blocks_of_a_coarse_log_are_longer_and_cover_it(run: Run) -> None:
    channels = {name: x[::5] for name, x in run.channels.items()}
    coarse = msgspec.structs.replace(run, t=run.t[::5], channels=channels, fs=run.fs / 5)
    blocks = blocks_of(coarse, RIG)
    assert blocks.count.min() >= 3
    assert np.median(blocks.count) == 4
    assert blocks.count.sum() > MIN_COVERED * coarse.t.size
    assert np.mean(blocks.joined) > 0.5


def test_a_block_lies_within_one_phase_of_one_cycle(run: Run) -> None:
    blocks = blocks_of(run, RIG)
    cycles = detect(run, smoothed_velocity(run, RIG.thresholds), RIG.thresholds)
    spans = {}
    for number, cycle in enumerate(cycles, 1):
        assert cycle.haul_in is not None
        spans[number, "payout"] = (cycle.onset, cycle.payout_end)
        spans[number, "haul_in"] = cycle.haul_in
    for block, phase, cycle_number in zip(
        inside(blocks, run), blocks.phase.tolist(), blocks.cycle.tolist(), strict=True
    ):
        first, last = run.t[block][0], run.t[block][-1]
        if PHASES[phase] == "hold":
            assert all(last < begin or first >= end for begin, end in spans.values())
        else:
            begin, end = spans[cycle_number, PHASES[phase]]
            assert begin <= first <= last < end


def test_blocks_last_about_one_period_of_the_tethers_ringing(run: Run) -> None:
    seconds = blocks_of(run, RIG).count / run.fs
    assert np.all((seconds > 0.5 * BLOCK) & (seconds < 1.5 * BLOCK))
    assert np.median(seconds) == pytest.approx(BLOCK, abs=0.5 / run.fs)


def test_only_the_cycles_that_count_are_cut(run: Run) -> None:
    whole, second = blocks_of(run, RIG), blocks_of(run, RIG, (2, 2))
    assert set(whole.cycle.tolist()) == {0, 1, 2, 3}
    assert set(second.cycle.tolist()) == {2}
    assert second.start.tolist() == whole.start[whole.cycle == 2].tolist()
    assert set(blocks_of(run, RIG, (1, 2)).cycle.tolist()) == {0, 1, 2}  # rest before the first payout goes with it


def test_joined_blocks_follow_each_other_in_one_phase(run: Run) -> None:
    blocks = blocks_of(run, RIG)
    for k, m in pairwise(range(blocks.size)):
        follows = blocks.start[m] == blocks.stop[k] and blocks.phase[m] == blocks.phase[k]
        assert bool(blocks.joined[m]) == (follows and blocks.cycle[m] == blocks.cycle[k])
    assert not blocks.joined[0]


def test_a_block_that_a_gap_has_emptied_is_dropped_and_the_next_is_not_joined(run: Run) -> None:
    lost = (run.t > 9.0) & (run.t < 9.9)
    kept = {name: x[~lost] for name, x in run.channels.items()}
    gap = np.array([[run.t[~lost][run.t[~lost] <= 9.0][-1], run.t[run.t >= 9.9][0]]])
    holed = msgspec.structs.replace(run, t=run.t[~lost], channels=kept, gaps={"clock": gap})
    blocks = blocks_of(holed, RIG)
    after = int(np.flatnonzero(holed.t[blocks.start] >= 9.9)[0])
    assert not blocks.joined[after]
    assert blocks.joined[after + 1]
    assert np.all(blocks.count >= 0.5 * BLOCK * run.fs)


def test_means_and_scatter_are_those_of_the_samples() -> None:
    run = made_log(cycles=1)
    blocks = blocks_of(run, RIG)
    ramp = 3.0 + 2.0 * run.t
    noisy = ramp + np.random.default_rng(4).normal(0.0, 0.1, run.t.size)
    direct = [float(np.mean(ramp[block])) for block in inside(blocks, run)]
    assert blocks.mean(ramp) == pytest.approx(direct)
    assert blocks.scatter(ramp) == pytest.approx(0.0, abs=1e-5)
    assert math.sqrt(float(np.mean(blocks.scatter(noisy) ** 2))) == pytest.approx(0.1, rel=0.1)
