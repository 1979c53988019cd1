"""Clocks: lost, repeated, swapped or wrong stamps are put right where that is safe, and any way
of writing a time is read.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import msgspec
import numpy as np
import pytest
from campaign_log import (
    HEAD,
    LOST,
    NOON,
    ROWS,
    SAME,
    T,
    clean,
    efficiencies,
    kinds,
    read,
    stamps,
    text,
    with_time,
)
from hypothesis import given
from hypothesis import strategies as st

from winchcascade.core.errors import LogError
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.clock import BACKWARD_STEPS_MAX, read_clock, require_rising
from winchcascade.ingest.log_clock import clock_of_digits
from winchcascade.ingest.stamps import looks_like_a_stamp, seconds

H = 0.04
STAMPS = np.array(T)
LINE = H * np.arange(2000, dtype=np.float64)
DATA = np.array(ROWS, dtype=float)
T_TEXTS = [row[0] for row in ROWS]

COARSE = 0.002
"""Stamps of whole seconds leave a few hundredths of a second open; a float of fourteen digits
keeps steps of 4 ms.
"""


def log(times: np.ndarray, rows: np.ndarray | None = None, digits: int = 4) -> str:
    """The log with other stamps, or the log sampled at other moments."""
    body = DATA if rows is None else rows
    return text(
        [
            [f"{t:.{digits}f}", *(f"{x:.6g}" for x in row[1:])]
            for t, row in zip(times, body, strict=True)
        ],
        HEAD,
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
EVERY_THIRD = np.where(np.isin(np.arange(STAMPS.size), [300, 800, 1500]), STAMPS - H, STAMPS)
ROW_FAULTS = {
    "30 s lost while the line holds": (without(*range(500, 1250)), {"dropped_samples"}),
    "every row twice": (np.repeat(without(), 2), {"repeated_stamp"}),
    "rows swapped": (swapped((300, 301), (1300, 1302)), {"backward_stamp"}),
    "the log twice": (np.tile(without(), 2), {"backward_stamp"}),
}
STAMP_FAULTS = {
    "one stamp 100 s ahead": (with_stamp(700, 128.0), {"backward_stamp"}),
    "one stamp 5 s behind": (with_stamp(700, 23.0), {"backward_stamp"}),
    "first stamp ahead": (with_stamp(0, 500.0), {"backward_stamp"}),
    "last stamp behind": (with_stamp(-1, 0.0), {"backward_stamp"}),
    "one stamp a third of an interval late": (with_stamp(700, 28.013), {"clock_jitter"}),
    "stamps repeated": (EVERY_THIRD, {"repeated_stamp"}),
    "set back by an hour": (36000 + stepped(1200, -3600.0), {"backward_stamp"}),
    "set back by half a second": (stepped(1200, -0.5), {"backward_stamp"}),
    "a counter that begins again": (np.mod(STAMPS + 40.0, 65.536), {"backward_stamp"}),
    "ten minutes of pause between cycles": (stepped(920, 600.0), {"dropped_samples"}),
    "jitter of 20 %": (STAMPS + H * JITTER, {"clock_jitter"}),
}
FAULTS = {what: (STAMPS[rows], DATA[rows], found) for what, (rows, found) in ROW_FAULTS.items()}
FAULTS |= {what: (times, DATA, found) for what, (times, found) in STAMP_FAULTS.items()}


@pytest.mark.parametrize("what", FAULTS)
def test_faults_of_rows_and_stamps_are_reported_and_change_little(
    what: str, tmp_path: Path
) -> None:
    times, rows, expected = FAULTS[what]
    run = read(tmp_path, log(times, rows))
    assert kinds(run) == expected
    assert np.all(np.diff(run.t) > 0)
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


@pytest.mark.parametrize(
    ("rate", "digits"),
    [
        (10, 2),
        (100, 2),
        pytest.param(1000, 3, marks=pytest.mark.slow),
        (30, 2),
        (30, 3),
        (200 / 3, 2),
        (75, 2),
        (25.6, 2),
        (7, 2),
    ],
)
def test_an_even_clock_gives_no_finding_whatever_its_rate_and_rounding(
    rate: float, digits: int, tmp_path: Path
) -> None:
    t = np.arange(0, STAMPS[-1], 1 / rate)
    run = read(tmp_path, log(t, sampled(t), digits))
    assert kinds(run) <= {"stuck"}  # straight lines between two equal samples hold a value
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


HARDLY = 1e-310 * np.arange(2000, dtype=np.float64)
HARDLY[500:700], HARDLY[1500:] = np.nan, 1e16 + np.arange(500)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (np.full(50, 5.0), "does not advance; expected stamps that rise"), (LINE[::-1], "does not advance"),
        (np.random.default_rng(1).uniform(0, 100, 4 * BACKWARD_STEPS_MAX), r"runs backward at "
                                                                           r"more than "
                                                                           r".*\[columns\]"),
        (np.full(50, np.nan), "0 readable stamps"), (np.array([0.0, np.nan, np.nan]), "1 readable "
                                                                                      "stamp;"),
        (HARDLY, "does not advance"),
    ],
)  # fmt: skip
def test_a_column_that_is_no_clock_is_rejected(times: np.ndarray, words: str) -> None:
    with pytest.raises(LogError, match=words):
        read_clock(times, "log.csv")
    with pytest.raises(LogError, match="to be distinguished"):
        require_rising(np.array([0.0, 2e-314, 1.0, 2.0]), "log.csv")


def test_a_steady_clock_is_left_alone_and_lost_rows_are_counted() -> None:
    clock = read_clock(LINE, "log.csv")
    assert clock.t is LINE
    assert (clock.rows, clock.findings) == (None, ())
    clock = read_clock(np.delete(LINE, slice(500, 512)), "log.csv")
    assert clock.gaps.tolist() == [[LINE[499], LINE[512]]]
    assert [(f.kind, f.count, f.removed) for f in clock.findings] == [("dropped_samples", 12, 12)]


def test_unreadable_stamps_are_filled_between_their_neighbours() -> None:
    times = LINE.copy()
    times[[0, 700, 701, -1]] = np.nan
    clock = read_clock(times, "log.csv")
    assert clock.t == pytest.approx(LINE[1:-1])
    assert [(f.kind, f.count, f.removed) for f in clock.findings] == [("not_a_number", 4, 2)]
    crowded = read_clock(
        np.insert(LINE, 500, np.full(3000, np.nan)), "log.csv"
    )  # rows between two tables
    assert crowded.t == pytest.approx(LINE)
    assert crowded.findings[0].removed == 3000


@given(
    st.lists(
        st.floats(-1e9, 1e9) | st.just(float("nan")) | st.just(1e300) | st.integers(0, 9),
        min_size=3,
        max_size=60,
    ),
    st.booleans(),
)
def test_a_repaired_clock_always_rises_and_keeps_its_rows(
    values: list[float], ordered: bool
) -> None:
    times = np.array(sorted(values) if ordered else values, dtype=float)
    try:
        clock = read_clock(times, "log.csv")
    except LogError:
        return
    assert np.all(np.diff(clock.t) > 0)
    assert clock.t.size == (times.size if clock.rows is None else clock.rows.size)


# -------------------------------------------------------------------------- how times are written
BEFORE_MIDNIGHT = dt.datetime(2026, 4, 18, 23, 59, 30)
FORMS = [
    "%Y-%m-%dT%H:%M:%S.~", "%Y-%m-%dT%H:%M:%S.~+0800", "%Y-%m-%dT%H:%M:%S,~", "%Y%m%dT%H%M%S.~", "%d.%m.%Y %H:%M:%S,~",
    "%m/%d/%Y %I:%M:%S.~ %p", "%d-%b-%Y %H:%M:%S.~", "%b %d, %Y %H:%M:%S.~", "[%Y-%m-%d "
                                                                             "%H:%M:%S.~]", "%H時%M分%S.~秒",
    "%Y年%m月%d日 %H:%M:%S.~", "%H:%M:%S:~", "%M:%S,~",
]  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_midnight_noon_and_the_full_hour_pass_without_a_step(form: str) -> None:
    for start in (BEFORE_MIDNIGHT, dt.datetime(2026, 4, 18, 11, 59, 30)):
        assert seconds(stamps(form, start)) == pytest.approx(
            STAMPS, abs=1e-4
        )  # to the digits of the stamps


@pytest.mark.parametrize("form", ["%m/%d/%Y %H:%M:%S.~", "%d/%m/%Y %H:%M:%S.~"])
@pytest.mark.parametrize("day", [(4, 5), (4, 30), (12, 31)])
def test_day_and_month_are_distinguished_by_the_days_that_follow(
    form: str, day: tuple[int, int]
) -> None:
    assert seconds(stamps(form, dt.datetime(2026, *day, 23, 59, 30))) == pytest.approx(
        STAMPS, abs=1e-4
    )


@pytest.mark.parametrize(
    ("texts", "since"),
    [
        (["31 März 2026 23:59:59", "1 April 2026 00:00:00"], [0.0, 1.0]),
        (["31 mars 2026 23:59:59", "1 avr. 2026 00:00:00"], [0.0, 1.0]),
        (
            ["2026-03-29 01:00:00+01:00", "2026-03-29 01:00:01", "2026-03-29 01:00:02"],
            [0.0, 1.0, 2.0],
        ),
        (["2026-02-30 10:00:00", "2026-03-01 10:00:00", "2026-03-01 10:00:01"], [np.nan, 0.0, 1.0]),
    ],
)
def test_months_zones_and_dates_that_do_not_exist(texts: list[str], since: list[float]) -> None:
    np.testing.assert_array_equal(seconds(texts), since)


def test_an_offset_from_utc_that_changes_within_the_log_is_no_step(tmp_path: Path) -> None:
    middle = len(T) // 3
    winter = [
        f"{stamp}+01:00" for stamp in stamps("%Y-%m-%dT%H:%M:%S.~", NOON + dt.timedelta(hours=1))
    ]
    summer = [
        f"{stamp}+02:00" for stamp in stamps("%Y-%m-%dT%H:%M:%S.~", NOON + dt.timedelta(hours=2))
    ]
    run = read(tmp_path, text(*with_time(winter[:middle] + summer[middle:])))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    "other", ["", "12.5", "1:2", "a:b:c", "Time: now", "99999999999999999999", ":" * 9999]
)
def test_other_texts_are_no_stamps(other: str) -> None:
    assert not looks_like_a_stamp(other)
    assert np.isnan(seconds([other])).all()


EPOCH = 1_776_500_000.0
NUMBERS = {
    "Time (ms)": [f"{1e3 * t:.0f}" for t in T],
    "Time (min)": [f"{t / 60:.9f}" for t in T],
    "timestamp_ms": [f"{1e3 * (EPOCH + t):.0f}" for t in T],
    "Date/Time": [f"{46130.4166666667 + t / 86400:.11f}" for t in T],
    "Time": [f"{0.41667 + t / 86400:.11f}" for t in T],
}


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_that_name_their_unit_or_count_days_need_no_guess(
    name: str, tmp_path: Path
) -> None:
    run = read(tmp_path, text(*with_time(NUMBERS[name], name)))
    assert kinds(run) == set()
    assert run.fs == pytest.approx(25.0, rel=1e-4)
    assert efficiencies(run) == pytest.approx(
        clean(), abs=1e-4
    )  # a day with eleven digits is good to a microsecond


@pytest.mark.parametrize("order", [("Date", "Time"), ("Time", "Date")])
def test_the_time_of_day_decides_beside_a_date(order: tuple[str, str], tmp_path: Path) -> None:
    day, time = stamps("%d.%m.%Y", BEFORE_MIDNIGHT), stamps("%H:%M:%S.~", BEFORE_MIDNIGHT)
    first, second = (day, time) if order[0] == "Date" else (time, day)
    rows = [[a, b, *row[1:]] for a, b, row in zip(first, second, ROWS, strict=True)]
    run = read(tmp_path, text(rows, [*order, *HEAD[1:]]))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_stamps_of_whole_seconds_are_spread_and_unreadable_ones_rejected(tmp_path: Path) -> None:
    run = read(tmp_path, text(*with_time(stamps("%H:%M:%S"))))
    assert kinds(run) == {"repeated_stamp"}
    assert run.fs == pytest.approx(25.0, rel=1e-3)
    assert efficiencies(run) == pytest.approx(clean(), abs=COARSE)
    with pytest.raises(
        LogError, match=r"0 readable stamps; expected seconds, milliseconds or dates"
    ):
        read(tmp_path, text(*with_time(["soon"] * len(T))))


@pytest.mark.parametrize("start", [NOON, NOON.replace(hour=23, minute=59, second=30)], ids=str)
@pytest.mark.parametrize(("form", "near"), [("%H%M%S.~", SAME), ("%Y%m%d%H%M%S.~", COARSE)])
def test_digits_of_a_clock_are_read_as_a_clock(
    start: dt.datetime, form: str, near: float, tmp_path: Path
) -> None:
    run = read(tmp_path, text(*with_time(stamps(form, start))))
    assert kinds(run) == set()
    assert run.t[-1] - run.t[0] == pytest.approx(T[-1], abs=0.005)
    assert efficiencies(run) == pytest.approx(clean(), abs=near)


@pytest.mark.parametrize(
    "plain",
    [
        H * np.arange(5000), LINE + 95740.0, 50.0 * np.arange(100), np.full(50, 95740.0), -LINE - 1, LINE * np.nan, np.empty(0),
        np.array([95958.0, 95959.0, 100005.0]), np.array([20260230235959.0, 20260231000000.0]), 1.7e9 + LINE,
        np.array([1e300, 2e300, np.inf]),
    ],
)  # fmt: skip
def test_numbers_that_may_be_plain_are_no_clock_of_digits(plain: np.ndarray) -> None:
    assert clock_of_digits(plain) is None


def test_of_columns_without_a_name_the_one_that_rises_is_the_clock_and_one_that_counts_rows_is_none(
    tmp_path: Path,
) -> None:
    run = read(tmp_path, text(*with_time(T_TEXTS, "Unnamed: 0")))
    assert kinds(run) == {"unit_assumed"}
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)
    counted = text(*with_time(map(str, range(len(T))), "index"))
    with pytest.raises(
        LogError, match=r"no time column and no sampling interval; the log has .*sample_rate_hz"
    ):
        read(tmp_path, counted)
    assert (
        read(tmp_path, counted, rig=msgspec.structs.replace(built_in(), sample_rate=25.0)).fs
        == 25.0
    )
