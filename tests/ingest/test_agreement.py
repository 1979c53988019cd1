"""Channels that measure one thing are compared: each difference is reported, and nothing that
agrees is.
"""

from collections.abc import Callable

import numpy as np
import pytest
from shipped_log import Signal, channels, table

from winchcascade import Finding, Rig, load_rig
from winchcascade.ingest.checks.agreement import compare_motions, compare_powers, mean_speeds
from winchcascade.ingest.checks.quality import Checked, check
from winchcascade.ingest.checks.samples import Samples
from winchcascade.ingest.checks.signs import is_without_sign

Change = Callable[[Signal], Signal]

RIG = load_rig("hsu2026")
V_ONSET, STROKE = RIG.thresholds.v_onset, RIG.thresholds.stroke_min
T = table()[:, 0]
SEEN_GAIN = 0.002
"""A gain is found within this: sensor noise over three cycles."""
SIGN_SHARE = 0.999
"""A speed without a sign is given the right one in this share of what the line travels."""


def changed(name: str, change: Change) -> Checked:
    signals = channels(table())
    signals[name] = change(signals[name])
    return check(T, signals, RIG, simulated=False, open_circuit=False)


def findings(velocity: Change = lambda v: v, displacement: Change = lambda x: x) -> list[Finding]:
    signals = channels(table())
    log = Samples(
        T,
        {
            "velocity": velocity(signals["velocity"]),
            "displacement": displacement(signals["displacement"]),
        },
        RIG,
    )
    compare_motions(log)
    return log.findings


def coarse(step: float) -> Change:
    return lambda x: np.round(x / step) * step


# ---------------------------------------------------------------------------------- gain and zero
@pytest.mark.parametrize("gain", [0.1, 0.5, 0.9, 0.985, 1.015, 1.1, 2.0, 5.0])
def test_a_velocity_of_another_gain_is_reported_and_kept(gain: float) -> None:
    found = changed("velocity", lambda v: gain * v)
    (finding,) = found.findings
    assert (finding.kind, finding.channel, finding.action) == (
        "out_of_range",
        "velocity",
        "reported and kept",
    )
    assert float(finding.message.split()[3]) == pytest.approx(gain, rel=SEEN_GAIN)
    assert np.array_equal(found.channels["velocity"], gain * channels(table())["velocity"])


@pytest.mark.parametrize("zero", [-0.02, -0.007, 0.007, 0.02])
def test_a_velocity_with_another_zero_is_reported_and_kept(zero: float) -> None:
    found = changed("velocity", lambda v: v + zero)
    (finding,) = found.findings
    assert (finding.kind, finding.channel, finding.action) == (
        "out_of_range",
        "velocity",
        "reported and kept",
    )
    assert float(finding.message.split()[2]) == pytest.approx(zero, abs=1e-3)
    assert np.array_equal(found.channels["velocity"], channels(table())["velocity"] + zero)


@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.0])
def test_a_velocity_that_is_smoother_than_the_displacement_is_reported(seconds: float) -> None:
    rows = round(seconds * 25.0)
    found = findings(
        lambda v: np.convolve(np.pad(v, rows, "edge"), np.ones(rows) / rows, "same")[rows:-rows]
    )
    assert {f.kind for f in found} == {"channel_lag"}


def test_gain_and_zero_are_distinguished() -> None:
    zero, gain = findings(lambda v: 2 * v + 0.02)
    assert float(zero.message.split()[2]) == pytest.approx(0.02, abs=1e-3)
    assert float(gain.message.split()[3]) == pytest.approx(2.0, rel=SEEN_GAIN)


def test_a_displacement_that_drifts_is_not_called_a_velocity_that_does() -> None:
    (finding,) = findings(displacement=lambda x: x + 0.02 * T)
    assert "one of the two drifts" in finding.message


HARMLESS: dict[str, tuple[Change, Change]] = {
    "as it is": (lambda v: v, lambda x: x),
    "a small gain": (lambda v: 1.007 * v, lambda x: x),
    "a small zero": (lambda v: v + 0.003, lambda x: x),
    "set back every 20 s": (lambda v: v, lambda x: x - x[np.searchsorted(T, T // 20 * 20)]),
    "wraps at 5 m": (lambda v: v, lambda x: np.mod(x, 5.0)),
    "counts both ways": (
        lambda v: v,
        lambda x: np.concatenate(([0.0], np.cumsum(np.abs(np.diff(coarse(0.01)(x)))))),
    ),
    "is stuck for 5 s": (lambda v: v, lambda x: np.where((T > 9) & (T < 14), x[225], x)),
    "steps of 10 cm": (lambda v: v, coarse(0.1)),
    "velocity in steps of 0.1 m/s": (coarse(0.1), lambda x: x),
    "velocity half a second late": (lambda v: np.concatenate((np.zeros(12), v[:-12])), lambda x: x),
    "holes in the velocity": (
        lambda v: np.where(np.arange(v.size) % 40 == 0, np.nan, v),
        lambda x: x,
    ),
    "a displacement at rest": (lambda v: v + 0.5, np.zeros_like),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_what_says_nothing_of_gain_and_zero_gives_no_finding(name: str) -> None:
    assert findings(*HARMLESS[name]) == []


def test_blocks_leave_out_holes_and_gaps() -> None:
    t = np.concatenate((np.arange(1000) / 100, 30.0 + np.arange(1000) / 100))
    v = np.full(t.size, 0.5)
    v[[200, 250]] = np.nan  # between two blocks, and in the second of these
    blocks = mean_speeds(Samples(t, {"velocity": v, "displacement": 0.5 * t}, RIG), V_ONSET)
    assert blocks.v == pytest.approx(0.5)
    assert blocks.by_displacement == pytest.approx(0.5)
    assert blocks.seconds == pytest.approx(1.0)
    assert blocks.v.size == 19 - 1 - 2


# --------------------------------------------------------------------------- speed without a sign
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_speed_without_a_sign_is_given_the_direction_of_the_displacement(sign: float) -> None:
    found = changed("velocity", lambda v: sign * np.abs(v))
    (finding,) = found.findings
    assert (finding.kind, finding.channel) == ("sign_flipped", "velocity")
    v = channels(table())["velocity"]
    right = np.sign(found.channels["velocity"]) == np.sign(v)
    assert np.abs(v[right]).sum() > SIGN_SHARE * np.abs(v).sum()


@pytest.mark.parametrize(
    ("velocity", "displacement"),
    [
        (lambda v: v, lambda x: x),
        (lambda v: np.full(v.size, 0.95), lambda x: x),
        (np.abs, lambda x: np.concatenate(([0.0], np.cumsum(np.abs(np.diff(x)))))),
        (np.abs, np.zeros_like),
        (lambda v: np.maximum(v, 0.0), lambda x: x),
    ],
    ids=["signed", "held", "counts both ways", "at rest", "payout alone"],
)
def test_no_other_velocity_passes_for_a_speed_without_a_sign(
    velocity: Change, displacement: Change
) -> None:
    signals = channels(table())
    log = Samples(
        T,
        {
            "velocity": velocity(signals["velocity"]),
            "displacement": displacement(signals["displacement"]),
        },
        RIG,
    )
    assert not is_without_sign(log, V_ONSET, STROKE)


# ------------------------------------------------------------------------------- mechanical power
def with_power(factor: float) -> dict[str, Signal]:
    signals = channels(table())
    assert RIG.r_drum is not None
    return signals | {"power_mech": factor * signals["torque"] * signals["velocity"] / RIG.r_drum}


def of_power(signals: dict[str, Signal], rig: Rig = RIG) -> list[Finding]:
    log = Samples(T, signals, rig)
    compare_powers(log)
    return log.findings


@pytest.mark.parametrize("factor", [0.5, 0.95, 1.05])
def test_a_logged_power_that_torque_contradicts_is_reported_and_kept(factor: float) -> None:
    (finding,) = of_power(with_power(factor))
    assert (finding.kind, finding.channel, finding.removed) == ("out_of_range", "power_mech", 0)
    assert float(finding.message.split()[2]) == pytest.approx(factor, rel=1e-3)
    assert (
        finding in check(T, with_power(factor), RIG, simulated=False, open_circuit=False).findings
    )


def test_a_logged_power_that_agrees_or_cannot_be_compared_gives_no_finding() -> None:
    assert of_power(with_power(1.01)) == []
    assert of_power(channels(table())) == []
    assert of_power({name: np.zeros(T.size) for name in ("power_mech", "torque", "velocity")}) == []
