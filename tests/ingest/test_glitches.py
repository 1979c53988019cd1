"""A few samples that jump away and back are bridged; what the machine does, and what lasts, is kept as logged."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from loops import all_pairs, failures
from shipped_log import WINDOW, Signal, clean, column, row_after_onset, table, written
from synthetic import SCENARIOS, SENSORS, Scenario, make_log

from winchcascade import Finding, Run, load_rig, reduce
from winchcascade.ingest.checks.glitches import travelled
from winchcascade.ingest.checks.quality import check

RIG = load_rig("hsu2026")
BRIDGED = 0.003
"""Straight lines over five samples of a plateau change an energy by less than this share."""

CUT = {"idc": 0.0, "vdc": 1.3, "torque": 0.05}
"""Shares of current, voltage and torque while a chopper opens the circuit."""

INSIDE = 90
"""Samples from an onset to a place well inside its window, at 25 Hz."""


def inside(cycle: int) -> int:
    """A sample well inside the window of a cycle, counted from 0."""
    return row_after_onset(0.0, cycle=cycle) + INSIDE


def spoilt(values: Signal, word: str) -> Signal:
    return 3 * values if word == "x3" else np.full_like(values, float(word))


def spikes(run: Run) -> list[tuple[str | None, int | None]]:
    return [(f.channel, f.count) for f in run.findings if f.kind == "spike"]


def logged(scenario: Scenario | str, seed: int = 3) -> tuple[Signal, dict[str, Signal]]:
    """Stamps and channels of an invented log, SI units."""
    log = make_log(SCENARIOS[scenario] if isinstance(scenario, str) else scenario, np.random.default_rng(seed))
    return log.t, {name: sensor.unit * log.columns[sensor.header] for name, sensor in SENSORS.items()}


def findings(t: Signal, channels: Mapping[str, Signal], *, open_circuit: bool = False) -> list[Finding]:
    """The glitches found in a log's channels."""
    copies = {name: np.array(x) for name, x in channels.items()}
    found = check(t, copies, RIG, simulated=False, open_circuit=open_circuit).findings
    return [f for f in found if f.kind == "spike" and "jump" in f.message]


def in_payout(t: Signal, channels: Mapping[str, Signal]) -> int:
    """A sample in the middle of the first payout's plateau."""
    v = channels["velocity"]
    fast = np.flatnonzero(v > 0.9 * v.max())
    return int(fast[0]) + round(1.5 / float(t[1] - t[0]))


# ------------------------------------------------------------------------------------------------- what is bridged
def test_a_glitch_of_two_to_five_samples_is_bridged_and_reported(tmp_path: Path) -> None:
    names, words = ["velocity", "force", "torque", "vdc", "idc"], ["-9999", "32767", "0", "x3"]
    assert failures(partial(is_bridged, tmp_path), all_pairs(names, words, [2, 3, 4, 5])) == []


def is_bridged(folder: Path, name: str, word: str, samples: int) -> None:
    rows, k = table().copy(), inside(1)
    rows[k : k + samples, column(name)] = spoilt(rows[k : k + samples, column(name)], word)
    run = written(folder, rows)
    (finding,) = [f for f in run.findings if f.kind == "spike"]
    assert (finding.channel, finding.count, finding.removed) == (name, samples, samples)
    assert (finding.start, finding.end) == pytest.approx((rows[k, 0], rows[k + samples - 1, 0]), abs=1e-6)
    assert "samples jump" in finding.message
    assert "in 1 place" in finding.message
    result = reduce(run, window=WINDOW["r36ohm"])
    for spoilt_cycle, cycle in zip(result.cycles, clean().cycles, strict=True):
        assert spoilt_cycle.complete
        assert spoilt_cycle.window.onset == pytest.approx(cycle.window.onset, abs=1e-6)
        for energy in ("energy_line", "energy_mech", "energy_gen"):
            assert getattr(spoilt_cycle.metrics, energy) == pytest.approx(getattr(cycle.metrics, energy), rel=BRIDGED)


@pytest.mark.parametrize("samples", [2, 5])
@pytest.mark.parametrize("value", [-9999.0, -5.0, 5.0, 32.767])
def test_a_glitch_of_the_velocity_at_rest_starts_no_payout(tmp_path: Path, value: float, samples: int) -> None:
    rows = table().copy()
    k = row_after_onset(0.0) - 50
    rows[k : k + samples, column("velocity")] = value
    run = written(tmp_path, rows)
    assert spikes(run) == [("velocity", samples)]
    onsets = [c.window.onset for c in reduce(run, window=WINDOW["r36ohm"]).cycles]
    assert onsets == pytest.approx([c.window.onset for c in clean().cycles], abs=0.01)


@pytest.mark.parametrize("name", ["displacement", "pressure"])
@pytest.mark.parametrize("value", [-9999.0, 32767.0])
def test_an_error_code_is_bridged_in_channels_without_an_energy(tmp_path: Path, name: str, value: float) -> None:
    rows, k = table().copy(), inside(1)
    rows[k : k + 3, column(name)] = value
    assert spikes(written(tmp_path, rows)) == [(name, 3)]


def test_a_glitch_of_a_fast_log_spans_more_samples() -> None:
    def check(name: str, seconds: float, rate: float) -> None:
        t, channels = logged(Scenario(rate=rate))
        k, samples = in_payout(t, channels), max(2, round(seconds * rate))
        channels[name][k : k + samples] = 3 * np.ptp(channels[name])
        assert [(f.channel, f.count) for f in findings(t, channels)] == [(name, samples)]

    names = ["velocity", "force", "torque", "vdc", "idc"]
    assert failures(check, all_pairs(names, [0.02, 0.1], [50.0, 100.0, 200.0])) == []


def test_a_row_of_zeros_is_bridged_in_all_channels(tmp_path: Path) -> None:
    rows, k = table().copy(), inside(1)
    rows[k : k + 3, 1:] = 0.0
    assert {name for name, _ in spikes(written(tmp_path, rows))} >= {"displacement", "force", "torque", "vdc", "idc"}


def test_error_codes_of_all_channels_at_once_are_bridged(tmp_path: Path) -> None:
    rows, k = table().copy(), inside(1)
    rows[k : k + 3, 1:] = -9999.0
    assert spikes(written(tmp_path, rows)) == [(name, 3) for name in SENSORS]


@pytest.mark.parametrize("place", [0, -3])
def test_error_codes_at_an_end_of_the_log_are_bridged(tmp_path: Path, place: int) -> None:
    rows = table().copy()
    rows[place % len(rows) :][:3, column("vdc")] = -9999.0
    assert spikes(written(tmp_path, rows)) == [("vdc", 3)]


def test_glitches_near_each_other_are_each_bridged(tmp_path: Path) -> None:
    rows, k = table().copy(), inside(1)
    for place in (k, k + 6, k + 40):
        rows[place : place + 2, column("torque")] = 0.0
    run = written(tmp_path, rows)
    assert spikes(run) == [("torque", 6)]
    assert "in 3 places" in run.findings[0].message


def test_a_glitch_next_to_empty_cells_is_bridged(tmp_path: Path) -> None:
    rows, k = table().copy(), inside(1)
    rows[k : k + 2, column("idc")] = -9999.0
    rows[k + 2 : k + 4, column("idc")] = np.nan
    run = written(tmp_path, rows)
    assert spikes(run) == [("idc", 2)]
    assert run.channels["idc"].min() > -1


# ----------------------------------------------------------------------------------------------------- what is kept
@pytest.mark.parametrize("name", SCENARIOS)
def test_invented_logs_have_no_glitch(name: str) -> None:
    t, channels = logged(name)
    assert findings(t, channels, open_circuit=SCENARIOS[name].load == float("inf")) == []


@pytest.mark.parametrize("seed", range(5))
def test_ten_times_the_usual_noise_is_no_glitch(seed: int) -> None:
    for load in (36.0, float("inf")):
        t, channels = logged(Scenario(noise=10.0, load=load), seed)
        assert findings(t, channels, open_circuit=load == float("inf")) == []


@pytest.mark.parametrize("steps", [10, 30, 100])
def test_coarse_steps_are_no_glitch(steps: int) -> None:
    for load in (36.0, float("inf")):
        t, channels = logged(Scenario(load=load))
        coarse = {name: np.round(x / np.ptp(x) * steps) * np.ptp(x) / steps for name, x in channels.items()}
        assert findings(t, coarse, open_circuit=load == float("inf")) == []


@pytest.mark.parametrize("hold", [2, 3, 5])
def test_values_that_a_logger_repeats_are_no_glitch(hold: int) -> None:
    t, channels = logged(Scenario(rate=100.0))
    held = {name: x[np.arange(x.size) // hold * hold] for name, x in channels.items()}
    assert findings(t, held) == []


@pytest.mark.parametrize(("name", "size"), [("torque", 150.0), ("vdc", 80.0), ("force", 1500.0), ("velocity", 0.5)])
def test_a_step_that_stays_and_one_that_decays_are_no_glitch(name: str, size: float) -> None:
    t, channels = logged("smooth")
    later = t - t[in_payout(t, channels)]
    decay = np.where(later >= 0, np.exp(-np.clip(later, 0, 9) / 0.06), 0)
    assert findings(t, channels | {name: channels[name] + size * decay}) == []
    stay = ((later >= 0) & (later < 2)) * size / channels[name][in_payout(t, channels)]
    with_it = ("force", "torque", "vdc", "idc") if name != "velocity" else ("velocity",)  # one load or one motion
    assert findings(t, channels | {other: channels[other] * (1 + stay) for other in with_it}) == []


@pytest.mark.parametrize("hertz", [1.5, 3.0, 5.7, 8.0, 11.0])
@pytest.mark.parametrize("rate", [25.0, 100.0])
def test_a_snap_load_that_rings_is_no_glitch(hertz: float, rate: float) -> None:
    t, channels = logged(Scenario(rate=rate))
    later = np.clip(t - t[in_payout(t, channels)], 0, None)
    ring = 6000.0 * np.exp(-3 * later) * np.sin(2 * np.pi * hertz * later)
    assert findings(t, channels | {"force": channels["force"] + ring}) == []


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_a_slack_line_that_the_torque_follows_is_no_glitch(samples: int) -> None:
    t, channels = logged("smooth")
    k = in_payout(t, channels)
    for name in ("force", "torque"):
        channels[name][k : k + samples] *= 0.02
    assert findings(t, channels) == []


@pytest.mark.parametrize("samples", [2, 3, 5])
@pytest.mark.parametrize("size", [1.0, 4.0])
def test_a_snap_load_that_the_torque_follows_is_no_glitch(size: float, samples: int) -> None:
    t, channels = logged("smooth")
    k = in_payout(t, channels)
    channels["force"][k : k + samples] += 2500 * size
    channels["torque"][k : k + samples] += 40 * size
    assert findings(t, channels) == []


@pytest.mark.parametrize("samples", [2, 3, 4, 5])
def test_a_stop_that_the_displacement_shows_is_no_glitch(samples: int) -> None:
    t, channels = logged("smooth")
    k = in_payout(t, channels)
    channels["displacement"] = channels["displacement"].copy()
    channels["displacement"][k:] -= samples * channels["velocity"][k] * (t[1] - t[0])
    channels["velocity"][k : k + samples] = 0.0
    assert findings(t, channels) == []


def test_a_current_that_a_chopper_cuts_again_and_again_has_no_glitch() -> None:
    t, channels = logged("smooth")
    off = (np.arange(t.size) % 20 < 3) & (channels["velocity"] > 0.3)
    cut = {name: np.where(off, share * channels[name], channels[name]) for name, share in CUT.items()}
    assert findings(t, channels | cut) == []


@pytest.mark.parametrize("samples", [6, 8, 20])
def test_a_dip_that_lasts_longer_and_that_the_machine_follows_is_kept(samples: int) -> None:
    t, channels = logged("smooth")
    k = in_payout(t, channels)
    for name in ("force", "torque", "vdc", "idc"):
        channels[name][k : k + samples] *= 0.3
    assert findings(t, channels) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_saturated_sensor_is_reported_and_kept(seed: int) -> None:
    t, channels = logged("smooth", seed)
    k = in_payout(t, channels)
    channels["torque"] = np.minimum(1.5 * channels["torque"], 1.4 * channels["torque"][k])
    assert findings(t, channels) == []


def test_travel_between_two_samples_is_told_by_displacement_velocity_and_a_straight_line() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.4, 0.5])
    channels = {
        "displacement": np.array([5.0, 5.1, 5.3, 9.0, 5.9]),
        "velocity": np.array([7.0, 1.0, np.nan, 2.0, 3.0]),
    }
    assert travelled(t, channels, 1, 4) == pytest.approx((0.8, 1.5 * 0.3 + 2.5 * 0.1, 2.0 * 0.4))
