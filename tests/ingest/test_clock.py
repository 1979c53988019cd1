"""Clocks: stamps that are lost, repeated, swapped, wrong or set back are found, and put right where that is safe."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from campaign_log import HEAD, LOST, ROWS, T, clean, efficiencies, kinds, read, text
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core.errors import LogError
from winchcascade.ingest.clock import MANY, read_clock, require_rising

H = 0.04
STAMPS = np.array(T)
LINE = H * np.arange(2000, dtype=np.float64)
DATA = np.array(ROWS, dtype=float)


def log(stamps: np.ndarray, rows: np.ndarray | None = None, digits: int = 4) -> str:
    """The log with other stamps, or the log sampled at other moments."""
    body = DATA if rows is None else rows
    return text(
        [[f"{t:.{digits}f}", *(f"{x:.6g}" for x in row[1:])] for t, row in zip(stamps, body, strict=True)], HEAD
    )


def sampled(t: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(t, STAMPS, column) for column in DATA.T])


def with_stamp(k: int, value: float) -> np.ndarray:
    t = STAMPS.copy()
    t[k] = value
    return t


def stepped(k: int, step: float) -> np.ndarray:
    return STAMPS + np.where(np.arange(STAMPS.size) >= k, step, 0.0)


def swapped(*pairs: tuple[int, int]) -> np.ndarray:
    order = np.arange(STAMPS.size)
    for a, b in pairs:
        order[[a, b]] = order[[b, a]]
    return order


def without(*lost: int) -> np.ndarray:
    return np.setdiff1d(np.arange(STAMPS.size), lost)


JITTER = np.random.default_rng(3).uniform(-0.2, 0.2, STAMPS.size)
ROWS_KEPT = {
    "one row lost": (without(700), {"dropped_samples"}),
    "twelve rows lost": (without(*range(700, 712)), {"dropped_samples"}),
    "every 87th row lost": (without(*range(100, 2700, 87)), {"dropped_samples"}),
    "30 s lost while the line holds": (without(*range(500, 1250)), {"dropped_samples"}),
    "rows twice": (np.sort(np.append(without(), [300, 800, 1500])), {"repeated_stamp"}),
    "every row twice": (np.repeat(without(), 2), {"repeated_stamp"}),
    "rows swapped": (swapped((300, 301), (1300, 1302)), {"backward_stamp"}),
    "rows swapped at 20 places": (swapped(*((k, k + 1) for k in range(50, 2700, 130))), {"backward_stamp"}),
    "the log twice": (np.tile(without(), 2), {"backward_stamp"}),
}
STAMPED = {
    "one stamp 100 s ahead": (with_stamp(700, 128.0), {"backward_stamp"}),
    "one stamp 5 s behind": (with_stamp(700, 23.0), {"backward_stamp"}),
    "one stamp zero": (with_stamp(700, 0.0), {"backward_stamp"}),
    "one stamp huge": (with_stamp(700, 9e9), {"backward_stamp"}),
    "first stamp ahead": (with_stamp(0, 500.0), {"backward_stamp"}),
    "last stamp behind": (with_stamp(-1, 0.0), {"backward_stamp"}),
    "one stamp a third of an interval late": (with_stamp(700, 28.013), {"clock_jitter"}),
    "stamps repeated": (
        np.where(np.isin(np.arange(STAMPS.size), [300, 800, 1500]), STAMPS - H, STAMPS),
        {"repeated_stamp"},
    ),
    "set back by an hour": (36000 + stepped(1200, -3600.0), {"backward_stamp"}),
    "set back by half a second": (stepped(1200, -0.5), {"backward_stamp"}),
    "started again at zero": (stepped(1200, -STAMPS[1200]), {"backward_stamp"}),
    "ten minutes of pause between cycles": (stepped(920, 600.0), {"dropped_samples"}),
    "jitter of 20 %": (STAMPS + H * JITTER, {"clock_jitter"}),
    "jitter of 4 %": (STAMPS + H * JITTER / 5, set()),
}


@pytest.mark.parametrize("what", ROWS_KEPT)
def test_lost_doubled_and_swapped_rows_are_reported_and_change_little(what: str, tmp_path: Path) -> None:
    rows, expected = ROWS_KEPT[what]
    run = read(tmp_path, log(STAMPS[rows], DATA[rows]))
    assert kinds(run) == expected
    assert np.all(np.diff(run.t) > 0)
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


@pytest.mark.parametrize("what", STAMPED)
def test_wrong_stamps_are_reported_and_change_little(what: str, tmp_path: Path) -> None:
    stamps, expected = STAMPED[what]
    run = read(tmp_path, log(stamps))
    assert kinds(run) == expected
    assert np.all(np.diff(run.t) > 0)
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


@pytest.mark.parametrize(
    ("rate", "digits"),
    [
        (10, 2),
        (20, 2),
        (50, 2),
        (100, 2),
        (1000, 3),
        (30, 2),
        (30, 3),
        (60, 2),
        (200 / 3, 2),
        (75, 2),
        (25.6, 2),
        (24, 2),
        (7, 2),
    ],
)
def test_an_even_clock_gives_no_finding_whatever_its_rate_and_rounding(
    rate: float, digits: int, tmp_path: Path
) -> None:
    t = np.arange(0, STAMPS[-1], 1 / rate)
    run = read(tmp_path, log(t, sampled(t), digits))
    assert kinds(run) == set()
    assert run.fs == pytest.approx(rate, rel=1e-3)  # the first and last stamp are rounded
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


@pytest.mark.parametrize(("rate", "digits"), [(120, 2), (12.8, 1), (25, 0), (25, 1)])
def test_samples_that_share_a_coarse_stamp_are_spread_and_none_is_lost(
    rate: float, digits: int, tmp_path: Path
) -> None:
    t = np.arange(0, STAMPS[-1], 1 / rate)
    run = read(tmp_path, log(np.floor(t * 10**digits + 1e-6) / 10**digits, sampled(t), digits))
    assert kinds(run) == {"repeated_stamp"}
    assert run.t.size == t.size
    assert run.fs == pytest.approx(rate, rel=1e-3)
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


def test_uneven_stamps_are_used_as_they_are(tmp_path: Path) -> None:
    t = np.cumsum(np.random.default_rng(3).uniform(0.02, 0.08, 5000))
    t = t[t < STAMPS[-1]]
    run = read(tmp_path, log(t, sampled(t)))
    assert kinds(run) == {"clock_jitter"}
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        (np.full(50, 5.0), "does not advance; expected stamps that rise"),
        (LINE[::-1], "does not advance; expected stamps that rise"),
        (np.random.default_rng(1).uniform(0, 100, 4 * MANY), r"runs backward at more than \d+ places.*\[columns\]"),
        (np.full(50, np.nan), "0 readable stamps"),
        (np.array([0.0, np.nan, np.nan]), "1 readable stamp;"),
    ],
)
def test_a_column_that_is_no_clock_is_rejected(stamps: np.ndarray, words: str) -> None:
    with pytest.raises(LogError, match=words):
        read_clock(stamps, "log.csv")


def test_lost_rows_are_counted_and_the_gap_lies_between_good_stamps() -> None:
    clock = read_clock(np.delete(LINE, slice(500, 512)), "log.csv")
    assert clock.gaps.tolist() == [[LINE[499], LINE[512]]]
    assert [(f.kind, f.count, f.removed) for f in clock.findings] == [("dropped_samples", 12, 12)]


def test_a_steady_clock_is_left_alone() -> None:
    clock = read_clock(LINE, "log.csv")
    assert clock.t is LINE
    assert clock.rows is None
    assert clock.findings == ()


def test_swapped_rows_go_back_to_where_they_were() -> None:
    order = np.arange(LINE.size)
    order[[700, 701]] = order[[701, 700]]
    clock = read_clock(LINE[order], "log.csv")
    assert clock.rows is not None
    assert np.array_equal(order[clock.rows], np.arange(LINE.size))
    assert np.array_equal(clock.t, LINE)


def test_unreadable_stamps_are_filled_between_their_neighbours() -> None:
    t = LINE.copy()
    t[[0, 700, 701, -1]] = np.nan
    clock = read_clock(t, "log.csv")
    assert clock.t == pytest.approx(LINE[1:-1])
    assert [(f.kind, f.count, f.removed) for f in clock.findings] == [("not_a_number", 4, 2)]
    assert clock.findings[0].action == "filled between their neighbours; 2 rows at the ends left out"


@given(
    st.lists(
        st.floats(-1e9, 1e9) | st.just(float("nan")) | st.just(1e300) | st.integers(0, 9), min_size=3, max_size=60
    ),
    st.booleans(),
)
def test_a_repaired_clock_always_rises_and_keeps_its_rows(values: list[float], ordered: bool) -> None:
    stamps = np.array(sorted(values) if ordered else values, dtype=float)
    try:
        clock = read_clock(stamps, "log.csv")
    except LogError:
        return
    assert np.all(np.diff(clock.t) > 0)
    assert clock.t.size == (stamps.size if clock.rows is None else clock.rows.size)


def test_stamps_of_wrong_bytes_are_rejected() -> None:
    with pytest.raises(LogError, match="to be distinguished"):
        require_rising(np.array([0.0, 2e-314, 1.0, 2.0]), "log.csv")
    require_rising(np.array([0.0, 1e-9, 1.0]), "log.csv")


def test_rows_without_a_stamp_and_without_room_are_no_samples() -> None:
    stamps = np.concatenate([LINE[:500], np.full(3000, np.nan), LINE[500:], np.full(7, np.nan)])
    clock = read_clock(stamps, "log")
    assert clock.rows is not None
    assert clock.rows.tolist() == [*range(500), *range(3500, 5000)]
    assert clock.t == pytest.approx(LINE)
    (finding,) = clock.findings
    assert finding.message == "3007 stamps could not be read"
    assert finding.action == (
        "7 rows at the ends left out; 3000 rows between stamps that leave no room for them left out"
    )
    assert finding.removed == 3007
    assert (finding.start, finding.end) == pytest.approx((LINE[499], LINE[500]), abs=1e-4)


def test_stamps_that_are_lost_with_their_rows_are_filled_as_before() -> None:
    stamps = np.delete(LINE, [700])
    stamps[[300, 301, 699]] = np.nan
    clock = read_clock(stamps, "log")
    assert clock.rows is None or clock.rows.size == stamps.size
    assert clock.t[300:302] == pytest.approx(LINE[300:302])


def test_a_log_with_empty_rows_in_it_reduces_like_the_clean_one(tmp_path: Path) -> None:
    whole, broken = log(STAMPS).splitlines(), log(STAMPS).splitlines()
    broken[400:400] = ["," * 7] * 2500
    a, b = (efficiencies(read(tmp_path, "\n".join([*lines, ""]))) for lines in (whole, broken))
    assert a == pytest.approx(b)


def test_stamps_that_hardly_move_and_miss_some_are_rejected_and_no_warning() -> None:
    stamps = 1e-310 * np.arange(2000, dtype=np.float64)
    stamps[500:700] = np.nan
    stamps[1500:] = 1e16 + np.arange(500)
    with pytest.raises(LogError, match="does not advance"):
        read_clock(stamps, "log")
