"""Thresholds that a rig file leaves open: shares of the scales of the logs that are read with
it.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace
from rigs import calibrated_rig

from winchcascade import Run, read_run, reduce
from winchcascade.core.log_thresholds import (
    SHARES,
    completed,
    log_scales,
    motion_of_displacement,
    not_stated,
    with_thresholds,
)
from winchcascade.core.rig_file import Rig, Thresholds
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.core.run import Signal
from winchcascade.core.scales import motion_of_log

CAMPAIGN = Path(__file__).parents[1] / "fixtures" / "campaign"
OWN = replace(calibrated_rig(), thresholds=Thresholds())
"""The rig of the rebuilt campaign without its thresholds."""

CRANE = 0.25
"""Largest share by which thresholds of a crane log differ from the published ones: ramps differ
from log to log, and loads slow the line."""

T = np.arange(0.0, 120.0, 0.04)


def strokes(speed: float = 0.9, ramp: float = 1.0) -> Signal:
    """Velocity of two payouts and haul-ins with straight ramps. [m/s]"""
    at = np.cumsum([5.0, ramp, 10.0, ramp, 8.0, ramp, 10.0, ramp, 5.0])
    one = np.array([0.0, speed, speed, 0.0, 0.0, -speed, -speed, 0.0, 0.0])
    return np.asarray(np.interp(T, np.concatenate((at, at[-1] + at)), np.concatenate((one, one))))


def run_of(**channels: Signal) -> Run:
    return Run("made", T, channels, 25.0, T.size)


@pytest.mark.parametrize("log", ["r18ohm", "r27ohm", "r36ohm", "r45ohm", "open_circuit"])
def test_a_log_of_the_papers_crane_gives_about_the_published_thresholds(log: str) -> None:
    run = read_run(CAMPAIGN / f"{log}.csv", campaign=False)
    found, paper = with_thresholds(OWN, [run]).thresholds, built_in().thresholds
    for name in SHARES:
        assert getattr(found, name) == pytest.approx(getattr(paper, name), rel=CRANE), name


def test_what_a_rig_states_is_kept_and_what_it_leaves_open_follows_the_log() -> None:
    rig = replace(OWN, thresholds=Thresholds(settle=3.0))
    found = with_thresholds(rig, [run_of(velocity=strokes())]).thresholds
    assert found.settle == 3.0
    assert found.v_onset == pytest.approx(0.03, rel=0.01)
    rise = 0.8  # from a tenth to nine tenths of a ramp of 1 s
    assert found.smoothing == pytest.approx(SHARES["smoothing"][1] * rise, rel=0.01)
    assert not_stated(replace(rig, thresholds=found)) == ()


def test_several_runs_give_one_set_by_the_fastest_and_the_median() -> None:
    runs = [
        run_of(velocity=strokes(speed, ramp))
        for speed, ramp in ((0.3, 1.0), (0.9, 1.5), (0.6, 2.5))
    ]
    found = with_thresholds(OWN, runs).thresholds
    assert found.v_onset == pytest.approx(0.9 / 30.0, rel=0.01)
    assert found.smoothing == pytest.approx(SHARES["smoothing"][1] * 0.8 * 1.5, rel=0.01)


@pytest.mark.parametrize("every", [1, 5])
def test_a_displacement_in_steps_gives_the_scales_of_its_velocity(every: int) -> None:
    v = strokes()
    x = np.round(np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.04))) / 8e-4) * 8e-4
    found, true = motion_of_displacement(T[::every], x[::every]), motion_of_log(T, v)
    assert found is not None
    assert true is not None
    assert (found.speed, found.stroke) == pytest.approx((true.speed, true.stroke), rel=0.02)
    assert found.ramp == pytest.approx(true.ramp, rel=0.1)


@pytest.mark.parametrize("digit", [1e-6, 0.01])
def test_noise_of_a_line_that_rests_is_no_motion(digit: float) -> None:
    noise = digit * np.round(np.random.default_rng(0).normal(0.0, 0.004, T.size) / digit)
    scales = log_scales(T, {"velocity": noise}, OWN)
    assert (scales.speed, scales.stroke) == (math.inf, math.inf)
    assert reduce(run_of(velocity=noise), rig=OWN).cycles == ()


def test_a_line_that_starts_within_one_sample_moves() -> None:
    v = np.where(np.abs(strokes()) > 0.45, np.sign(strokes()) * 0.9, 0.0)
    assert log_scales(T, {"velocity": v}, OWN).speed == 0.9


def test_spikes_that_are_taken_out_later_do_not_set_the_scales() -> None:
    v = strokes()
    v[[400, 900, 2000]] = 9999.0
    run = read_run(pd.DataFrame({"Time (s)": T, "Velocity (m/s)": v}), rig=OWN)
    assert run.rig is not None
    assert run.rig.thresholds.v_onset == pytest.approx(0.03, rel=0.01)


def test_a_slow_shaft_turns_from_a_share_of_its_top_speed_on() -> None:
    omega = np.abs(strokes(speed=0.2))  # two revolutions a minute
    run = read_run(pd.DataFrame({"Time (s)": T, "n (rad/s)": omega}), rig=Rig(name="bench"))
    assert run.rig is not None
    assert run.rig.phases.omega_onset == pytest.approx(0.2 / 50.0, rel=0.01)


def test_one_finding_names_the_thresholds_that_follow_the_log_and_none_where_all_are_stated() -> (
    None
):
    frame = pd.DataFrame({"Time (s)": T, "Velocity (m/s)": strokes()})
    open_ = [f for f in reduce(read_run(frame, rig=OWN)).quality if f.kind == "thresholds_assumed"]
    assert len(open_) == 1
    assert "v_onset 0.03 m/s" in open_[0].message
    for rig in (built_in(), completed(OWN, log_scales(T, {"velocity": strokes()}, OWN))):
        assert "thresholds_assumed" not in {
            f.kind for f in reduce(read_run(frame, rig=rig)).quality
        }
    given = reduce(read_run(frame, rig=built_in()), rig=OWN).quality
    assert [f.kind for f in given].count("thresholds_assumed") == 1


def test_a_rig_file_that_states_its_motion_has_no_finding_for_the_torque_alone() -> None:
    stated = "\n".join(
        f'{name} = {{ value = 0.5, unit = "{unit}" }}'
        for name, (_, _, unit) in SHARES.items()
        if name != "tau_engaged"
    )
    rig = parse_rig(f'name = "mine"\n[thresholds]\n{stated}\n', "mine.toml")
    frame = pd.DataFrame(
        {"Time (s)": T, "Velocity (m/s)": strokes(), "Torque (N.m)": np.maximum(strokes(40.0), 0.0)}
    )
    run = read_run(frame, rig=rig)
    assert "thresholds_assumed" not in {f.kind for f in run.findings}
    assert run.rig is not None
    assert run.rig.thresholds.tau_engaged == pytest.approx(40.0 / 130.0, rel=0.01)
