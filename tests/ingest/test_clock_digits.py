"""Clocks of digits: 095959.96 is four hundredths of a second before ten, and plain seconds stay plain seconds."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest
from campaign_log import HEAD, NOON, ROWS, SAME, T, clean, efficiencies, kinds, read, stamps, text, with_time

from winchcascade.ingest.clock import clock_of_digits

ROUNDED = 0.002
"""A float of fourteen digits before the point keeps steps of 4 ms behind it."""

STARTS = [NOON, NOON - dt.timedelta(seconds=30), NOON.replace(hour=23, minute=59, second=30)]
EVEN = 0.04 * np.arange(5000)


@pytest.mark.parametrize("start", STARTS, ids=str)
@pytest.mark.parametrize(("form", "near"), [("%H%M%S.~", SAME), ("%Y%m%d%H%M%S.~", ROUNDED)])
def test_digits_of_a_clock_are_read_as_a_clock(start: dt.datetime, form: str, near: float, tmp_path: Path) -> None:
    run = read(tmp_path, text(*with_time(stamps(form, start))))
    assert kinds(run) == set()
    assert run.fs == pytest.approx(25.0, rel=1e-4)
    assert run.t[-1] - run.t[0] == pytest.approx(T[-1], abs=0.005)
    assert efficiencies(run) == pytest.approx(clean(), abs=near)


@pytest.mark.parametrize(
    "plain",
    [
        EVEN, EVEN + 95740.0, EVEN[:1000] + 95700.0, 50.0 * np.arange(100), 1000 * EVEN, np.full(50, 95740.0),
        np.array([95958.0, 95959.0, 100005.0, 100006.0]), np.array([20260230235959.0, 20260231000000.0]), -EVEN - 1,
        EVEN * np.nan, np.empty(0), np.array([1e300, 2e300, np.inf]), 1.7e9 + EVEN,
    ],
)  # fmt: skip
def test_numbers_that_may_be_plain_are_no_clock_of_digits(plain: np.ndarray) -> None:
    assert clock_of_digits(plain) is None


def test_digits_of_a_clock_that_names_seconds_are_seconds(tmp_path: Path) -> None:
    rows = [[s, *row[1:]] for s, row in zip(stamps("%H%M%S.~"), ROWS, strict=True)]
    assert "dropped_samples" in kinds(read(tmp_path, text(rows, HEAD)))
