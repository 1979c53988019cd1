"""Velocity and displacement before phases are known: blocks, and a speed without a sign."""

from collections.abc import Callable

import numpy as np
import pytest
from shipped_log import Signal, channels, table

from winchcascade import load_rig
from winchcascade.ingest.checks.motion import Travel, is_without_sign, mean_speeds
from winchcascade.ingest.checks.quality import Checked, check

Change = Callable[[Signal], Signal]

RIG = load_rig("hsu2026")
T = table()[:, 0]
SIGN_SHARE = 0.999
"""A speed without a sign is given the right one in this share of what the line travels."""


def changed(name: str, change: Change) -> Checked:
    signals = channels(table())
    signals[name] = change(signals[name])
    return check(T, signals, RIG, simulated=False, open_circuit=False)


def test_blocks_leave_out_holes_and_gaps() -> None:
    t = np.concatenate((np.arange(1000) / 100, 30.0 + np.arange(1000) / 100))
    v = np.full(t.size, 0.5)
    v[[200, 250]] = np.nan  # between two blocks, and in the second of these
    blocks = mean_speeds(Travel(t, v, 0.5 * t, 0.01), RIG.thresholds)
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
    travel = Travel(T, velocity(signals["velocity"]), displacement(signals["displacement"]), 0.04)
    assert not is_without_sign(travel, RIG.thresholds)
