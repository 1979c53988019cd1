"""Channels that measure one thing are compared: each difference is reported, and nothing that
agrees is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from winchcascade import Finding, Run, read_run, reduce
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.core.run import Signal

Change = Callable[[Signal], Signal]

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
SEEN_GAIN = 0.003
"""A gain is found within this: sensor noise over three cycles."""


@cache
def clean() -> Run:
    return read_run(CAMPAIGN / "r36ohm.csv", rig=built_in(), load=36.0)


T = clean().t


def same(x: Signal) -> Signal:
    return x


def findings(**changes: Signal) -> list[Finding]:
    """Findings on channels beyond their lags in a log with some changed channels."""
    found = reduce(replace(clean(), channels={**clean().channels, **changes}), window=5.48)
    return [f for f in found.quality if f.kind in ("out_of_range", "speed_mismatch")]


def of_motion(velocity: Change = same, displacement: Change = same) -> list[Finding]:
    logged = clean().channels
    return findings(
        velocity=velocity(logged["velocity"]), displacement=displacement(logged["displacement"])
    )


def coarse(step: float) -> Change:
    return lambda x: np.round(x / step) * step


@pytest.mark.parametrize("gain", [0.1, 0.5, 0.9, 0.985, 1.015, 1.1, 2.0, 5.0])
def test_a_velocity_of_another_gain_is_reported(gain: float) -> None:
    (finding,) = [f for f in of_motion(lambda v: gain * v) if f.channel == "velocity"]
    assert (finding.kind, finding.removed) == ("out_of_range", 0)
    assert float(finding.message.split()[3]) == pytest.approx(gain, rel=SEEN_GAIN)


@pytest.mark.parametrize("zero", [-0.02, -0.007, 0.007, 0.02])
def test_a_velocity_with_another_zero_is_reported(zero: float) -> None:
    (finding,) = of_motion(lambda v: v + zero)
    assert (finding.kind, finding.channel) == ("out_of_range", "velocity")
    assert float(finding.message.split()[2]) == pytest.approx(zero, abs=1e-3)


@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.0])
def test_a_velocity_that_is_smoother_than_the_displacement_is_reported(seconds: float) -> None:
    rows, v = round(seconds * 25.0), clean().channels["velocity"]
    smooth = np.convolve(np.pad(v, rows, "edge"), np.ones(rows) / rows, "same")[rows:-rows]
    found = reduce(replace(clean(), channels={**clean().channels, "velocity": smooth}))
    assert ("channel_lag", "velocity") in {(f.kind, f.channel) for f in found.quality}


def test_gain_and_zero_are_distinguished() -> None:
    zero, gain = (f for f in of_motion(lambda v: 2 * v + 0.02) if f.channel == "velocity")
    assert float(zero.message.split()[2]) == pytest.approx(0.02, abs=1e-3)
    assert float(gain.message.split()[3]) == pytest.approx(2.0, rel=SEEN_GAIN)


def test_a_displacement_that_drifts_is_not_called_a_velocity_that_does() -> None:
    (finding,) = of_motion(displacement=lambda x: x + 0.02 * T)
    assert "one of the two drifts" in finding.message


HARMLESS: dict[str, tuple[Change, Change]] = {
    "as it is": (same, same),
    "a small gain": (lambda v: 1.007 * v, same),
    "a small zero": (lambda v: v + 0.003, same),
    "set back every 20 s": (same, lambda x: x - x[np.searchsorted(T, T // 20 * 20)]),
    "wraps at 5 m": (same, lambda x: np.mod(x, 5.0)),
    "counts both ways": (
        same,
        lambda x: np.concatenate(([0.0], np.cumsum(np.abs(np.diff(coarse(0.01)(x)))))),
    ),
    "is stuck for 5 s": (same, lambda x: np.where((T > 9) & (T < 14), x[225], x)),
    "steps of 10 cm": (same, coarse(0.1)),
    "velocity in steps of 0.1 m/s": (coarse(0.1), same),
    "a displacement at rest": (same, np.zeros_like),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_what_shows_no_gain_and_no_zero_gives_no_finding(name: str) -> None:
    assert of_motion(*HARMLESS[name]) == []


def with_power(factor: float) -> list[Finding]:
    logged, radius = clean().channels, built_in().r_drum
    assert radius is not None
    return findings(power_mech=factor * logged["torque"] * logged["velocity"] / radius)


@pytest.mark.parametrize("factor", [0.5, 0.95, 1.05])
def test_a_logged_power_that_torque_contradicts_is_reported(factor: float) -> None:
    (finding,) = [f for f in with_power(factor) if f.channel == "power_mech"]
    assert (finding.kind, finding.removed) == ("out_of_range", 0)
    assert float(finding.message.split()[2]) == pytest.approx(factor, rel=1e-3)


def test_a_logged_power_that_agrees_gives_no_finding() -> None:
    assert with_power(1.01) == []


@pytest.mark.parametrize("ratio", [0.9, 1.004])
def test_a_speed_that_contradicts_line_and_drum_is_reported(ratio: float) -> None:
    radius = built_in().r_drum
    assert radius is not None
    found = findings(speed=ratio * clean().channels["velocity"] / radius)
    assert [(f.kind, f.channel) for f in found] == (
        [("speed_mismatch", "speed")] if ratio == 0.9 else []
    )


def test_a_power_that_contradicts_torque_and_speed_of_a_bench_is_reported() -> None:
    t = 0.1 * np.arange(50)
    omega, torque = 60.0 + t, 2.0 + 0.1 * t
    channels = {"speed": omega, "torque": torque, "power_mech": -torque * omega}
    rig = parse_rig('name = "bench"\n[phases]\nfrom = "steps"\n', "bench.toml")
    found = reduce(Run("bench", t, channels, fs=10.0, samples=50), rig=rig)
    assert ("out_of_range", "power_mech") in {(f.kind, f.channel) for f in found.quality}
