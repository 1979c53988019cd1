"""Whatever signs a log is written with, payout comes out positive and what was turned is told."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import KGCM2, SENSORS

from winchcascade.ingest.checks.signs import upright

Signal = NDArray[np.float64]
FOLDER = Path(__file__).parents[2] / "fixtures" / "campaign"
NAMES = tuple(SENSORS)
PAYOUT = slice(0, 500)
"""The first 20 s of each log: rest, one payout and a part of the hold."""


def channels(load: str, rows: slice = slice(None)) -> dict[str, Signal]:
    table = np.loadtxt(FOLDER / f"{load}.csv", delimiter=",", skiprows=1)[rows]
    return {name: table[:, k + 1] * (KGCM2 if name == "pressure" else 1.0) for k, name in enumerate(NAMES)}


def turned(signals: dict[str, Signal], flipped: Sequence[str]) -> set[str | None]:
    """Turn signs, set them upright, and see that every channel is back."""
    written = {name: -x if name in flipped else x.copy() for name, x in signals.items()}
    findings = upright(written)
    assert {f.kind for f in findings} <= {"sign_flipped"}
    for name, x in signals.items():
        assert np.array_equal(written[name], x), name
    return {f.channel for f in findings}


@pytest.mark.parametrize("flipped", [(), *combinations(NAMES, 1), *combinations(NAMES, 2), NAMES])
@pytest.mark.parametrize("load", ["r36ohm", "r4p5ohm", "open_circuit"])
def test_every_flip_is_found_and_turned_and_no_other(load: str, flipped: tuple[str, ...]) -> None:
    assert turned(channels(load), flipped) == set(flipped)


@pytest.mark.parametrize("flipped", [(), *combinations(NAMES, 1), ("velocity", "displacement"), NAMES])
@pytest.mark.parametrize("load", ["r36ohm", "r9ohm"])
def test_a_log_of_one_payout_is_enough(load: str, flipped: tuple[str, ...]) -> None:
    assert turned(channels(load, PAYOUT), flipped) == set(flipped)


@pytest.mark.parametrize("flipped", [(), ("velocity",), ("displacement",), ("velocity", "displacement"), ("force",)])
def test_a_haul_in_alone_is_told_by_the_falling_pressure(flipped: tuple[str, ...]) -> None:
    signals = channels("r36ohm")
    back = np.flatnonzero(signals["velocity"] < -0.1)
    end = int(back[np.flatnonzero(np.diff(back) > 50)[0]])
    rows = slice(int(back[0]) - 25, end + 25)
    expected = set(flipped) - {"force"} if signals["force"][rows].max() < 20 else set(flipped)
    assert turned({name: x[rows] for name, x in signals.items() if name in NAMES[:4]}, flipped) == expected


def test_pressure_noise_alone_never_turns_the_velocity() -> None:
    v = channels("r36ohm")["velocity"]
    for seed in range(200):
        noise = 2e6 + 1e3 * np.random.default_rng(seed).standard_normal(v.size)
        assert upright({"velocity": v.copy(), "pressure": noise}) == []


def test_holes_do_not_hide_a_flip() -> None:
    signals = channels("r36ohm")
    rng = np.random.default_rng(1)
    written = {n: np.where(rng.random(x.size) < 0.2, np.nan, -x if n == "velocity" else x) for n, x in signals.items()}
    assert [f.channel for f in upright(written)] == ["velocity"]


def test_a_line_that_never_moves_has_no_sign() -> None:
    still = {name: np.zeros(100) for name in NAMES}
    assert upright(still) == []
