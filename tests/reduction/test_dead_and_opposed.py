"""Channels that are dead, stages of opposed powers, and the zero of the torque on a bench; sound
logs have none of them.
"""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import call

from winchcascade import read_run, reduce
from winchcascade.core.rig_toml import built_in

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"

RIG = """name = "dyno"
[cascade]
stages = [{stages}]
[phases]
from = "{source}"
"""
ACCURATE = '[sensors.torque]\nunit = "N.m"\nlow = -100\nhigh = 100\naccuracy_full_scale = 0.001\n'
CHANNELS = ("Speed (rpm)", "Torque (N.m)", "Vdc (V)", "Idc (A)")


def dyno(*, motor: bool = False) -> dict[str, np.ndarray]:
    """Rests and operating points of 10 s with noise: a generator of 80 %, or a motor of 80 %."""
    rng = np.random.default_rng(12)
    rpm, torque = (
        np.repeat(x, 200)
        for x in ((0.0, 200.0, 200.0, 0.0, 500.0, 500.0), (0.0, 30.0, 60.0, 0.0, 30.0, 60.0))
    )
    volt = 40.0 + 0.5 * rpm
    amp = (1.25 if motor else 0.8) * torque * rpm * math.pi / 30.0 / volt
    return {
        name: x + rng.normal(0.0, u, x.size)
        for name, x, u in zip(
            CHANNELS, (rpm, torque, volt, amp), (0.05, 0.1, 0.05, 0.01), strict=True
        )
    }


def quality(
    folder: Path, channels: dict[str, np.ndarray], *, stages: str = '"mech", "gen"', source: str = "whole", more: str = "",
    load: str = "",
) -> list[dict[str, Any]]:  # fmt: skip
    """Findings on a log of these channels."""
    t = 0.05 * np.arange(next(iter(channels.values())).size)
    log, rig = folder / "log.csv", folder / "rig.toml"
    head = ",".join(("Time (s)", *channels))
    np.savetxt(log, np.column_stack((t, *channels.values())), "%.6g", ",", header=head, comments="")
    rig.write_text(RIG.format(stages=stages, source=source) + more)
    options = ("--load-ohm", load) if load else ()
    called = call("reduce", log, "--rig", rig, *options, "--json", "-")
    assert called.code == 0, called
    found: list[dict[str, Any]] = json.loads(called.out)["quality"]
    return found


def of_kind(found: list[dict[str, Any]], kind: str) -> list[str | None]:
    return [f["channel"] for f in found if f["kind"] == kind]


# ---------------------------------------------------------------------------------- dead channels
@pytest.mark.parametrize("name", CHANNELS)
def test_a_channel_that_is_zero_throughout_while_its_stage_works_is_dead(
    tmp_path: Path, name: str
) -> None:
    channels = dyno() | {name: np.zeros(1200)}
    assert of_kind(quality(tmp_path, channels), "dead_channel") == [name.split()[0].lower()]


def test_a_blocked_motor_an_idle_machine_and_an_open_circuit_have_no_dead_channel(
    tmp_path: Path,
) -> None:
    blocked = dyno(motor=True) | {"Speed (rpm)": np.zeros(1200)}
    assert of_kind(quality(tmp_path, blocked, stages='"gen", "mech"'), "dead_channel") == []
    rest = {name: np.zeros(1200) for name in CHANNELS}
    rest["Torque (N.m)"] = np.random.default_rng(1).normal(0.0, 0.1, 1200)
    rest["Vdc (V)"] = np.random.default_rng(2).normal(0.0, 0.1, 1200)
    assert of_kind(quality(tmp_path, rest), "dead_channel") == []
    idle = dyno() | {"Idc (A)": np.zeros(1200)}
    assert of_kind(quality(tmp_path, idle, load="inf"), "dead_channel") == []


@pytest.mark.parametrize(
    "name", ["Force (N)", "Torque (N.m)", "Vdc (V)", "Idc (A)", "Velocity (m/s)"]
)
def test_a_dead_channel_of_a_winch_is_named_and_gives_no_metric(tmp_path: Path, name: str) -> None:
    with (CAMPAIGN / "r36ohm.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    k = head.index(name)
    log = tmp_path / "log.csv"
    with log.open("w", newline="") as file:
        csv.writer(file).writerows([head, *([*row[:k], "0", *row[k + 1 :]] for row in rows)])
    rig = built_in()
    found = reduce(read_run(log, rig=rig, load=36.0), rig=rig, window=5.48)
    channel = name.split()[0].lower()
    assert [f.channel for f in found.quality if f.kind in ("dead_channel", "stuck")] == [channel]
    assert "stuck" not in {f.kind for f in found.quality}
    lost = {
        "force": "energy_line",
        "torque": "energy_mech",
        "vdc": "energy_gen",
        "idc": "energy_gen",
    }.get(channel)
    assert lost is None or found.mean[lost] is None


# --------------------------------------------------------------------------------- opposed powers
@pytest.mark.parametrize("source", ["whole", "steps"])
def test_stages_whose_powers_anticorrelate_are_reported(tmp_path: Path, source: str) -> None:
    sound, channels = dyno(), dyno()
    channels["Idc (A)"] = -channels["Idc (A)"]
    assert len(of_kind(quality(tmp_path, channels, source=source), "sign_mismatch")) == 1
    assert of_kind(quality(tmp_path, sound, source=source), "sign_mismatch") == []


def test_a_steady_point_and_a_machine_that_swings_show_a_wrong_sign_too(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t = 0.05 * np.arange(2000)
    for rpm in (np.full(t.size, 300.0), 300.0 * np.sin(0.8 * t)):
        rpm = rpm + rng.normal(0.0, 0.05, t.size)
        torque = 0.1 * rpm + rng.normal(0.0, 0.1, t.size)
        watts = 0.8 * torque * rpm * math.pi / 30.0
        volt = np.full(t.size, 100.0) + rng.normal(0.0, 0.05, t.size)
        channels = dict(zip(CHANNELS, (rpm, torque, volt, watts / volt), strict=True))
        assert of_kind(quality(tmp_path, channels), "sign_mismatch") == []
        assert (
            len(of_kind(quality(tmp_path, channels | {"Idc (A)": -watts / volt}), "sign_mismatch"))
            == 1
        )


def test_powers_that_are_noise_have_no_sign(tmp_path: Path) -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        channels = {name: rng.normal(0.0, 1.0, 400) for name in CHANNELS}
        assert of_kind(quality(tmp_path, channels), "sign_mismatch") == []


# ----------------------------------------------------------------------------- zero of the torque
@pytest.mark.parametrize("source", ["whole", "steps"])
@pytest.mark.parametrize(("sensors", "zero", "found"), [
    ("", 0.0, []), ("", 5.0, ["torque"]), ("", -5.0, ["torque"]), ("", 1.0, []),
    (ACCURATE, 1.0, ["torque"]), (ACCURATE, 0.1, []),
])  # fmt: skip
def test_a_torque_that_is_not_zero_while_the_shaft_rests_is_found(
    tmp_path: Path, source: str, sensors: str, zero: float, found: list[str]
) -> None:
    channels = dyno()
    channels["Torque (N.m)"] += zero
    assert of_kind(quality(tmp_path, channels, source=source, more=sensors), "zero_offset") == found


def test_a_torque_that_a_current_holds_at_rest_is_no_zero(tmp_path: Path) -> None:
    channels = dyno(motor=True)
    at_rest = np.abs(channels["Speed (rpm)"]) < 1.0
    channels["Torque (N.m)"][at_rest] += 20.0
    channels["Idc (A)"][at_rest] += 3.0
    assert of_kind(quality(tmp_path, channels, stages='"gen", "mech"'), "zero_offset") == []


def test_the_measured_dynamometer_has_a_zero_of_its_torque() -> None:
    log = Path(__file__).parents[2] / "fixtures" / "measured" / "vdyno_steps.csv"
    record = json.loads(call("reduce", log, "--json", "-").out)
    (found,) = [f for f in record["quality"] if f["kind"] == "zero_offset"]
    assert (found["channel"], found["count"] > 1) == ("torque", True)
