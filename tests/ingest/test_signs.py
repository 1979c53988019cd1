"""Whatever signs a log is written with, payout comes out positive, and every inverted channel is
reported.
"""

from collections.abc import Sequence
from itertools import combinations, product

import numpy as np
import pytest
from loops import failures
from shipped_log import NAMES, Signal, channels, table

from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.checks.samples import Samples
from winchcascade.ingest.checks.signs import opposite_signs


def opposite(signals: dict[str, Signal]) -> list[str]:
    """Channels that are found to be of the opposite sign, in a log at 25 Hz of the rig of the
    paper.
    """
    t = np.arange(signals["velocity"].size, dtype=np.float64) / 25.0
    return [*opposite_signs(Samples(t, signals, built_in()))]


def turned(signals: dict[str, Signal], flipped: Sequence[str]) -> set[str]:
    """Channels that are found to be of the opposite sign once some are inverted."""
    return {*opposite({name: -x if name in flipped else x for name, x in signals.items()})}


def test_every_inverted_channel_is_found_and_corrected_and_no_other() -> None:
    def check(load: str, flipped: tuple[str, ...]) -> None:
        assert turned(channels(table(load)), flipped) == set(flipped)

    flips = [(), *combinations(NAMES, 1), *combinations(NAMES, 2), NAMES]
    assert failures(check, product(["r36ohm", "r4p5ohm", "open_circuit"], flips)) == []


@pytest.mark.parametrize(
    "flipped", [(), ("velocity",), ("displacement",), ("velocity", "displacement"), ("force",)]
)
def test_a_haul_in_alone_is_recognised_by_the_falling_pressure(flipped: tuple[str, ...]) -> None:
    signals = channels(table())
    back = np.flatnonzero(signals["velocity"] < -0.1)
    end = int(back[np.flatnonzero(np.diff(back) > 50)[0]])
    rows = slice(int(back[0]) - 25, end + 25)
    expected = set(flipped) - {"force"} if signals["force"][rows].max() < 20 else set(flipped)
    assert (
        turned({name: x[rows] for name, x in signals.items() if name in NAMES[:4]}, flipped)
        == expected
    )


def test_pressure_noise_alone_never_turns_the_velocity() -> None:
    v = channels(table())["velocity"]
    for seed in range(200):
        noise = 2e6 + 1e3 * np.random.default_rng(seed).standard_normal(v.size)
        assert opposite({"velocity": v, "pressure": noise}) == []


def test_holes_do_not_hide_a_flip() -> None:
    signals = channels(table())
    rng = np.random.default_rng(1)
    written = {
        n: np.where(rng.random(x.size) < 0.2, np.nan, -x if n == "velocity" else x)
        for n, x in signals.items()
    }
    assert opposite(written) == ["velocity"]
