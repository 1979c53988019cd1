from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import (
    BASE,
    R_DRUM,
    RUN_DOWN,
    SCENARIOS,
    Scenario,
    Signals,
    make_log,
    metrics,
    motion,
    plateau,
    rotor_speed,
    signals,
    truth,
    write_csv,
)
from synthetic import Detection as Seen

EXACT = 1e-3
"""The noise-free clock ticks in milliseconds [s]."""
ROUNDED = 0.05
"""The force, in steps of 1.96 N, is written with one decimal [N]."""
LINEAR = replace(
    BASE,
    payouts=((9.6, 0.8),),
    ramp=("linear", 2.0),
    brake=("linear", 1.0),
    haul_ramp=("linear", 1.0),
)
"""Ramps of 0.4 m/s2 from a kink at 5 s."""


def constant(seconds: float) -> Signals:
    """Make 2000 N at 0.5 m/s, 117 N m, 200 V and 2 A: 1000, 450 and 400 W."""
    t = np.linspace(0, seconds, 101)
    one = np.ones_like(t)
    return Signals(t, 0.5 * t, 0.5 * one, 2e6 * one, 2000 * one, 117 * one, 200 * one, 2 * one)


def test_energy_of_constant_power_is_power_times_time() -> None:
    # Both ends lie between nodes.
    found = metrics(constant(10.0), (1.234, 5.234), open_circuit=False)
    assert found["energy_line_j"] == pytest.approx(4000)
    assert found["energy_mech_j"] == pytest.approx(4 * 117 * 0.5 / R_DRUM)
    assert found["power_gen_w"] == pytest.approx(400)
    assert found["eta_trans"] == pytest.approx(0.45)
    assert found["eta_pto"] == pytest.approx(0.4)


def test_open_circuit_has_no_generator_efficiency() -> None:
    mean = truth(SCENARIOS["open_circuit"]).mean
    assert mean["eta_gen"] is None
    assert mean["eta_pto"] is None
    assert mean["eta_trans"] is not None


def test_onset_of_a_linear_ramp_is_threshold_over_slope_after_the_kink() -> None:
    assert truth(LINEAR).cycles[0].onset == pytest.approx(5.0 + 0.03 / 0.4, abs=EXACT)


def test_payout_and_haul_in_of_linear_ramps_end_where_they_cross_the_threshold() -> None:
    span = {span.phase: span for span in motion(LINEAR).spans if span.cycle == 0}
    cycle = truth(LINEAR).cycles[0]
    assert cycle.payout[1] == pytest.approx(span["payout"].end - 0.03 / 0.8, abs=EXACT)
    assert cycle.haul_in is not None
    assert cycle.haul_in[0] == pytest.approx(span["haul_in"].start + 0.03 / 1.25, abs=EXACT)
    assert cycle.hold == (cycle.payout[1], cycle.haul_in[0])


def test_auto_cutoff_is_half_a_second_after_98_percent_of_the_plateau() -> None:
    cycle = truth(LINEAR).cycles[0]
    assert cycle.plateau_speed == pytest.approx(0.8)
    assert cycle.cutoff == pytest.approx(5.0 + 0.98 * 2.0 + 0.5, abs=EXACT)


def test_auto_cutoff_never_passes_the_start_of_braking() -> None:
    short = replace(LINEAR, payouts=((0.8 + 0.4 + 0.32, 0.8),))  # 0.4 s of plateau
    cycle = truth(short).cycles[0]
    assert cycle.cutoff == pytest.approx(5.0 + 2.0 + 0.4 + 0.02, abs=2 * EXACT)


def test_fixed_and_payout_windows_begin_at_the_onset() -> None:
    fixed = truth(LINEAR, rule=5.0).cycles[0]
    whole = truth(LINEAR, rule="payout").cycles[0]
    assert fixed.window == (fixed.payout[0], fixed.payout[0] + 5.0)
    assert whole.window == whole.payout


def test_a_spike_shorter_than_a_fifth_of_a_second_is_no_plateau() -> None:
    t = np.arange(0, 10, 0.01)
    v = np.where((t > 3) & (t < 3.15), 0.8, np.where(t > 5, 0.8, 0.5))
    speed, flat = plateau(Seen(t, v), 0.0, 10.0)
    assert speed == pytest.approx(0.8)
    assert flat is not None
    assert flat[0] == pytest.approx(5.0, abs=0.02)


def test_a_free_rotor_runs_down_exponentially() -> None:
    t = np.arange(0, 2, 0.001)
    u = rotor_speed(t, np.where(t < 1, 0.8, 0.0))
    assert u[1300] == pytest.approx(0.8 * np.exp(-0.301 / RUN_DOWN), rel=1e-6)


def test_the_plateau_is_near_the_example_log() -> None:
    exact = signals(motion(BASE), 36.0)
    i = int(np.searchsorted(exact.t, 12.0))
    seen = [exact.force[i], exact.torque[i], exact.vdc[i], exact.idc[i]]
    assert seen == pytest.approx([2520, 298, 238, 6.6], rel=0.05)


@pytest.mark.parametrize(
    "name", ["stop", "long_early_stop", "reversal", "long_reversal", "everything"]
)
@pytest.mark.parametrize("smoothed", [False, True])
def test_stops_and_short_reversals_belong_to_their_payout(name: str, smoothed: bool) -> None:
    found = truth(SCENARIOS[name], smoothed=smoothed)
    travels = [cycle.summary["payout"]["travel_m"] for cycle in found.cycles]
    assert travels == pytest.approx([9.6] * 3, abs=0.05)


@pytest.mark.parametrize(
    ("name", "complete"),
    [
        ("starts_in_payout", [False, True, True]),
        ("starts_in_hold", [True, True]),
        ("starts_in_haul_in", [True, True]),
        ("ends_in_ramp", [True, True, False]),
        ("ends_in_payout", [True, True, True]),
        ("ends_in_haul_in", [True, True, True]),
        ("aborted_payout", [True, True, True]),
    ],
)
def test_a_cycle_is_complete_when_its_whole_window_is_logged(
    name: str, complete: list[bool]
) -> None:
    assert [cycle.complete for cycle in truth(SCENARIOS[name]).cycles] == complete


def test_a_payout_that_the_log_cuts_has_no_payout_window() -> None:
    found = truth(SCENARIOS["ends_in_payout"], rule="payout")
    assert [cycle.complete for cycle in found.cycles] == [True, True, False]


def test_means_and_deviations_leave_out_incomplete_cycles() -> None:
    found = truth(SCENARIOS["ends_in_ramp"])
    first, second = (float(cycle.metrics["eta_pto"] or 0) for cycle in found.cycles[:2])
    assert found.mean["eta_pto"] == pytest.approx((first + second) / 2)
    assert found.max_deviation_percent["eta_pto"] == pytest.approx(
        100 * abs(first - second) / (first + second)
    )
    assert truth(SCENARIOS["one_cycle"]).max_deviation_percent["eta_pto"] is None


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_keeps_the_rig_in_bounds(name: str) -> None:
    scenario = SCENARIOS[name]
    moved = motion(scenario)
    exact = signals(moved, scenario.load)
    assert exact.force.min() >= 0
    assert np.all(exact.torque[exact.velocity <= 0] == 0)
    assert all(
        np.isfinite(column).all()
        for column in make_log(scenario, np.random.default_rng(0)).columns.values()
    )
    assert np.abs(np.diff(moved.v)).max() < 0.01  # no jump of velocity: ramps join


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_both_truths_are_near_each_other(name: str) -> None:
    exact, smoothed = truth(SCENARIOS[name]), truth(SCENARIOS[name], smoothed=True)
    assert len(exact.cycles) == len(smoothed.cycles) > 0
    for one, other in zip(exact.cycles, smoothed.cycles, strict=True):
        assert one.onset == pytest.approx(other.onset, abs=0.06)
        assert one.cutoff == pytest.approx(other.cutoff, abs=0.08)
        assert one.onset < one.cutoff <= one.payout[1]


def test_the_line_is_back_at_zero_after_every_haul_in() -> None:
    moved = motion(SCENARIOS["differing_travel"])
    ends = [span.end for span in moved.spans if span.phase == "haul_in"]
    assert np.abs(np.interp(ends, moved.t, moved.x)).max() < 0.01


def test_a_log_without_noise_reads_the_exact_signals() -> None:
    log = make_log(SCENARIOS["exact"], np.random.default_rng(0))
    moved = motion(SCENARIOS["exact"])
    assert log.columns["Velocity (m/s)"] == pytest.approx(
        np.interp(log.t, moved.t, moved.v), abs=1e-12
    )


def test_the_same_seed_makes_the_same_log() -> None:
    one, other = (make_log(BASE, np.random.default_rng(3)) for _ in range(2))
    assert all(np.array_equal(one.columns[name], other.columns[name]) for name in one.columns)


def test_uneven_stamps_rise() -> None:
    log = make_log(SCENARIOS["uneven_stamps"], np.random.default_rng(0))
    assert np.diff(log.t).min() > 0.01
    assert np.diff(log.t).std() > 0.005


@pytest.mark.parametrize("scenario", [BASE, SCENARIOS["thousand_hertz"]])
def test_a_written_log_has_the_headers_of_the_example(scenario: Scenario, tmp_path: Path) -> None:
    log = make_log(scenario, np.random.default_rng(0))
    write_csv(log, tmp_path / "log.csv")
    lines = (tmp_path / "log.csv").read_text().splitlines()
    headers = "Time (s),Displacement (m),Velocity (m/s),Pressure (kg/cm2),Force (N),Torque (N.m),Vdc (V),Idc (A)"
    assert lines[0] == headers
    assert len(lines) == log.t.size + 1
    last = [float(text) for text in lines[-1].split(",")]
    assert last == pytest.approx(
        [log.t[-1], *(column[-1] for column in log.columns.values())], abs=ROUNDED
    )
