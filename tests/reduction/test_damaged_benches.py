"""Benches without a line whose log or rig file is wrong: every fault is reported; each log is
made here.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import call

STEP = 0.05
CHANNELS = ("Speed (rpm)", "Torque (N.m)", "Vdc (V)", "Idc (A)")
RIG = 'name = "dyno"\n[cascade]\nstages = ["mech", "gen"]\n[phases]\nfrom = "steps"\n'


def dyno() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Four operating points of 10 s behind a rest, with noise, and a generator of 80 %."""
    rng = np.random.default_rng(12)
    rpm, torque = (
        np.repeat(x, 200)
        for x in ((0.0, 200.0, 200.0, 500.0, 500.0), (0.0, 30.0, 60.0, 30.0, 60.0))
    )
    volt = 40.0 + 0.5 * rpm
    clean = (rpm, torque, volt, 0.8 * torque * rpm * np.pi / 30.0 / volt)
    noise = (0.05, 0.1, 0.05, 0.01)
    return STEP * np.arange(rpm.size), {
        name: x + rng.normal(0.0, u, x.size)
        for name, x, u in zip(CHANNELS, clean, noise, strict=True)
    }


def reduced(
    folder: Path, channels: dict[str, np.ndarray], rig: str | None = RIG
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Record of a log of these channels, and its findings."""
    t = STEP * np.arange(next(iter(channels.values())).size)
    log, toml, record = folder / "log.csv", folder / "rig.toml", folder / "out.json"
    np.savetxt(
        log,
        np.column_stack((t, *channels.values())),
        "%.6g",
        ",",
        header=f"Time (s),{','.join(channels)}",
        comments="",
    )
    toml.write_text(rig or "")
    options: list[str | Path] = ["--rig", toml] if rig else []
    called = call("reduce", log, "--json", record, *options)
    assert called.code == 0, called
    found = json.loads(record.read_text())
    return found, found["quality"]


def test_a_sound_bench_has_no_finding(tmp_path: Path) -> None:
    found, quality = reduced(tmp_path, dyno()[1])
    assert quality == []
    assert found["total"]["eta_gen"] == pytest.approx(0.8, abs=0.001)


@pytest.mark.parametrize("source", ["steps", "whole"])
@pytest.mark.parametrize("wrong", ["Speed (rpm)", "Torque (N.m)"])
def test_power_against_the_cascade_is_the_reason_for_a_missing_efficiency(
    source: str, wrong: str, tmp_path: Path
) -> None:
    channels = dyno()[1]
    channels[wrong] = -channels[wrong]
    found, quality = reduced(tmp_path, channels, RIG.replace("steps", source))
    assert found["total"]["eta_gen"] is None
    opposed, finding = quality
    assert (opposed["kind"], finding["kind"]) == ("sign_mismatch", "out_of_range")
    assert "eta_gen has no value in" in finding["message"]
    assert "check the sign of torque and speed and the order of the stages" in finding["message"]
    sign = '[stage.mech]\npower = "-torque * speed"\n'
    found, quality = reduced(tmp_path, channels, RIG.replace("steps", source) + sign)
    assert quality == []
    assert found["total"]["eta_gen"] == pytest.approx(0.8, abs=0.001)


@pytest.mark.parametrize(
    ("head", "unit"), [("Torque (N.m)", "Torque (kN.m)"), ("Idc (A)", "Idc (mA)")]
)
def test_an_efficiency_of_less_than_a_hundredth_is_a_wrong_unit(
    head: str, unit: str, tmp_path: Path
) -> None:
    _, quality = reduced(
        tmp_path, {unit if name == head else name: x for name, x in dyno()[1].items()}
    )
    assert ["check the units" in f["message"] for f in quality] == [True]


def test_the_reason_for_a_stage_without_power_names_the_channel_that_is_lost(
    tmp_path: Path,
) -> None:
    channels = dyno()[1]
    channels["Torque (N.m)"][:] = np.nan
    _, quality = reduced(tmp_path, channels)
    assert [f["message"].rpartition(": ")[2] for f in quality if "stage mech" in f["message"]] == [
        "the log has no torque"
    ]


def proposals(folder: Path, channels: dict[str, np.ndarray], rig: str | None = None) -> list[str]:
    """What a log is said to be for which the rig file leaves the source of cycles open."""
    return [f["message"] for f in reduced(folder, channels, rig)[1] if f["kind"] == "phase_source"]


def test_a_bench_without_a_rig_file_gets_the_fitting_source_of_cycles(tmp_path: Path) -> None:
    channels = dyno()[1]
    assert [
        '4 steady stretches and no line: for operating points of a machine set from = "steps"' in m
        for m in proposals(tmp_path, channels)
    ] == [True]
    rng, t = np.random.default_rng(3), np.arange(0.0, 120.0, STEP)
    wandering = {
        "Speed (rpm)": 300.0 + 100.0 * np.sin(0.9 * t),
        "Torque (N.m)": 40.0 + rng.normal(0.0, 1.0, t.size),
    }
    assert [
        'for the energies of the whole record set from = "whole"' in m
        for m in proposals(tmp_path, wandering)
    ] == [True]


def test_a_sea_gets_waves_and_a_winch_nothing(tmp_path: Path) -> None:
    t = np.arange(0.0, 200.0, STEP)
    v = 0.5 * np.sin(1.1 * t) + 0.3 * np.sin(0.83 * t + 1.0)
    sea = {"Velocity (m/s)": v, "Force (N)": 2000.0 + 900.0 * v}
    assert ["reciprocates without rests, in " in m for m in proposals(tmp_path, sea)] == [True]
    assert proposals(tmp_path, sea, 'name = "buoy"\n[phases]\nfrom = "waves"\n') == []
    strokes = np.interp(
        t % 20.0,
        (0.0, 3.0, 4.0, 8.0, 9.0, 12.0, 13.0, 17.0, 18.0, 20.0),
        (0, 0, 0.8, 0.8, 0, 0, -0.8, -0.8, 0, 0),
    )
    assert (
        proposals(tmp_path, {"Velocity (m/s)": strokes, "Force (N)": 2000.0 + 900.0 * strokes})
        == []
    )
    turning = {"Drum speed (rpm)": 60.0 * strokes, "Torque (N.m)": 90.0 * np.maximum(strokes, 0.0)}
    assert proposals(tmp_path, turning) == []


def switched() -> dict[str, np.ndarray]:
    """A dyno with drag whose load is switched at speed, with rests; its torque holds still where
    there is no load.
    """
    rng = np.random.default_rng(7)
    points = (
        (0.0, 0.0),
        (300.0, 40.0),
        (300.0, 0.0),
        (600.0, 0.0),
        (600.0, 50.0),
        (0.0, 0.0),
        (450.0, 25.0),
        (450.0, 70.0),
    )
    rpm, load = (np.repeat(x, 200) for x in zip(*points, strict=True))
    omega, volt = np.convolve(rpm, np.ones(12) / 12.0, "same") * np.pi / 30.0, 48.0 + 0.02 * rpm
    torque = load * (1.0 + rng.normal(0.0, 0.004, rpm.size)) + 2.2 * (omega > 1.0) + 0.05
    amperes = 0.8 * load * omega / volt * (1.0 + rng.normal(0.0, 0.004, rpm.size))
    clean = (
        omega * 30.0 / np.pi + rng.normal(0.0, 0.3, rpm.size),
        torque,
        volt + rng.normal(0.0, 0.02, rpm.size),
        amperes,
    )
    return {
        name: np.round(x, 1 if name == "Torque (N.m)" else 3)
        for name, x in zip(CHANNELS, clean, strict=True)
    }


def faults(quality: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Findings of samples that are lost, by kind and channel."""
    return [
        (f["kind"], f["channel"])
        for f in quality
        if f["kind"] in ("spike", "stuck", "dropped_samples")
    ]


@pytest.mark.parametrize("noise", [True, False])
def test_a_load_that_is_switched_at_speed_and_a_machine_at_rest_are_no_faults(
    noise: bool, tmp_path: Path
) -> None:
    channels = switched()
    if not noise:
        channels["Idc (A)"][channels["Idc (A)"] < 0.01] = (
            0.013  # zero error of a sensor that is read in coarse steps
        )
    found, quality = reduced(tmp_path, channels)
    assert faults(quality) == []
    assert all(cycle["complete"] for cycle in found["cycles"])
    assert len(found["cycles"]) == 6


PUMP = 'name = "pump"\n[cascade]\nstages = ["mech", "hyd"]\n[phases]\nfrom = "steps"\n'


def test_a_pressure_that_a_valve_sets_may_jump_and_one_that_the_torque_contradicts_may_not(
    tmp_path: Path,
) -> None:
    rng = np.random.default_rng(3)
    bar = np.repeat((20.0, 160.0, 160.0, 5.0, 90.0), 200)
    speed = 1500.0 + rng.normal(0.0, 0.5, bar.size)
    channels = {
        "Speed (rpm)": speed,
        "Torque (N.m)": 0.35 * bar * (1.0 + rng.normal(0.0, 0.003, bar.size)),
        "Pressure (bar)": bar * (1.0 + rng.normal(0.0, 0.003, bar.size)),
        "Flow (L/min)": 0.02 * speed,
    }
    assert faults(reduced(tmp_path, channels, PUMP)[1]) == []
    channels["Pressure (bar)"][260:330] = 0.0
    assert faults(reduced(tmp_path, channels, PUMP)[1]) == [("spike", "pressure")]


def test_a_saturated_power_at_the_terminals_is_reported(tmp_path: Path) -> None:
    channels = switched()
    watts = channels.pop("Vdc (V)") * channels.pop("Idc (A)") + np.random.default_rng(4).normal(
        0.0, 3.0, 1600
    )
    channels["P_ac (W)"] = np.minimum(watts, 1800.0)
    rig = RIG.replace('"gen"', '"ac"') + '[columns]\npower_ac = "P_ac (W)"\n'
    found = [f["kind"] for f in reduced(tmp_path, channels, rig)[1] if f["channel"] == "power_ac"]
    assert "out_of_range" in found


def flywheel(step: float, idle: float, coasts: bool) -> dict[str, np.ndarray]:
    """A flywheel that a quiet supply of 24 V drives for 28 s, and that then runs into 8 ohm.

    Parameters
    ----------
    step : of the voltage [V]
    idle : current of the supply at the end [A]
    coasts : whether the voltage shows the speed between supply and load
    """
    rng, t = np.random.default_rng(1), np.arange(0.0, 80.0, STEP)
    on, brakes = (t > 10.0) & (t < 38.0), (t >= 40.0) & (t < 70.0)
    spins_up = 250.0 * (1.0 - np.exp(-np.clip(t - 10.0, 0.0, 28.0) / 6.0))
    omega = spins_up * np.exp(-np.clip(t - 38.0, 0.0, None) / 15.0)
    volt = np.where(on, 24.0, np.where(brakes | coasts, 0.08 * omega, 0.0))
    drawn = idle + 12.0 * np.exp(-np.clip(t - 10.0, 0.0, None) / 6.0)
    amperes = np.where(on, drawn, np.where(brakes, volt / 8.0, 0.0))
    torque = np.where(on, 0.05 * amperes, np.where(brakes, -0.06 * amperes, -0.005))
    return {
        "Speed (rpm)": np.round(omega * 30.0 / np.pi + rng.normal(0.0, 0.5, t.size), 1),
        "Torque (N.m)": np.round(torque + rng.normal(0.0, 0.01, t.size), 3),
        "Vdc (V)": step * np.round((volt + rng.normal(0.0, 0.004, t.size)) / step),
        "Idc (A)": np.round(amperes + rng.normal(0.0, 0.02, t.size), 3),
    }


@pytest.mark.parametrize("coasts", [False, True])
@pytest.mark.parametrize("idle", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("step", [0.001, 0.1])
def test_a_supply_that_is_quiet_is_no_fault_of_the_voltage(
    step: float, idle: float, coasts: bool, tmp_path: Path
) -> None:
    _, quality = reduced(tmp_path, flywheel(step, idle, coasts))
    assert faults(quality) == []
