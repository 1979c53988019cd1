"""Time columns: every way of writing the time of a sample gives the same clock."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest
from campaign_log import HEAD, NOON, ROWS, SAME, T, clean, efficiencies, kinds, read, stamps, text, with_time
from daily import daily
from loops import failures

from winchcascade.core.errors import LogError
from winchcascade.ingest.cells import looks_like_a_stamp, seconds
from winchcascade.ingest.layout import waveform

COARSE = 0.002
"""Stamps of a tenth or a whole second leave a few hundredths of a second open."""

BEFORE_MIDNIGHT = dt.datetime(2026, 4, 18, 23, 59, 30)
FORMS = [
    "%Y-%m-%dT%H:%M:%S.~", "%Y-%m-%d %H:%M:%S.~", "%Y-%m-%dT%H:%M:%S.~Z", "%Y-%m-%dT%H:%M:%S.~+08:00",
    "%Y-%m-%dT%H:%M:%S.~+0800", "%Y-%m-%dT%H:%M:%S.~+08", "%Y-%m-%d %H:%M:%S.~ +08:00", "%Y-%m-%d %H:%M:%S.~ UTC",
    "%Y-%m-%dT%H:%M:%S,~", "%Y%m%dT%H%M%S.~", "%Y/%m/%d %H:%M:%S.~", "%d.%m.%Y %H:%M:%S,~", "%d.%m.%y %H:%M:%S.~",
    "%m/%d/%Y %I:%M:%S.~ %p", "%m/%d/%Y %I:%M:%S.~%p", "%m/%d/%Y %H:%M:%S.~", "%d/%m/%Y %H:%M:%S.~", "%d-%b-%Y %H:%M:%S.~",
    "%d %B %Y %H:%M:%S.~", "%b %d, %Y %H:%M:%S.~", "%a %d %b %Y %H:%M:%S.~", "%Y-%m-%d-%H:%M:%S.~", "%Y-%m-%d, %H:%M:%S.~",
    "[%Y-%m-%d %H:%M:%S.~]", "%Y年%m月%d日 %H:%M:%S.~", "%Y/%m/%d 上午 %H:%M:%S.~", "%H時%M分%S.~秒", "%H:%M:%S.~",
    "%I:%M:%S.~ %p", "%I:%M:%S.~ a.m.", "%H:%M:%S:~", "%M:%S.~", "%M:%S,~",
]  # fmt: skip


@pytest.mark.slow
def test_a_stamp_in_any_form_gives_the_same_clock(tmp_path: Path) -> None:
    def check(form: str, delimiter: str) -> None:
        run = read(tmp_path, text(*with_time(stamps(form)), delimiter=delimiter))
        assert kinds(run) == set()
        assert run.fs == 25.0
        assert efficiencies(run) == pytest.approx(clean(), abs=SAME)

    assert failures(check, [(form, ";\t"[k % 2]) for k, form in enumerate(FORMS)]) == []


@pytest.mark.parametrize("form", daily(FORMS, FORMS[::4]))
def test_midnight_noon_and_the_full_hour_pass_without_a_step(form: str) -> None:
    evening, morning = BEFORE_MIDNIGHT, dt.datetime(2026, 4, 18, 11, 59, 30)
    for start in (evening, morning) if "%p" in form or "%I" not in form else ():
        marked = form.replace("上午", "")
        assert seconds(stamps(marked, start)) == pytest.approx(np.array(T), abs=1e-4)  # to the digits of the stamps


@pytest.mark.parametrize("form", ["%m/%d/%Y %H:%M:%S.~", "%d/%m/%Y %H:%M:%S.~"])
@pytest.mark.parametrize("day", [(4, 5), (4, 12), (4, 30), (12, 31)])
def test_day_and_month_are_distinguished_by_the_days_that_follow(form: str, day: tuple[int, int]) -> None:
    start = dt.datetime(2026, *day, 23, 59, 30)
    assert seconds(stamps(form, start)) == pytest.approx(np.array(T), abs=1e-4)


def test_months_are_known_in_several_languages() -> None:
    for march, april in (("Mar", "Apr"), ("März", "April"), ("mars", "avr."), ("marzo", "abril"), ("mrt", "apr")):
        assert seconds([f"31 {march} 2026 23:59:59", f"1 {april} 2026 00:00:00"]).tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    "text", ["", "12.5", "1:2", "a:b:c", "Time: now", "99999999999999999999", ":" * 9999, "1 " * 5000 + ":"]
)
def test_other_texts_are_no_stamps(text: str) -> None:
    assert not looks_like_a_stamp(text)
    assert np.isnan(seconds([text])).all()


def test_a_date_that_does_not_exist_is_no_stamp() -> None:
    assert np.isnan(seconds(["2026-02-30 10:00:00", "2026-03-01 10:00:00", "2026-03-01 10:00:01"])).tolist() == [
        True, False, False,
    ]  # fmt: skip


EPOCH = 1_776_500_000.0
NUMBERS = {
    "Time (ms)": [f"{1e3 * t:.0f}" for t in T],
    "Time (µs)": [f"{1e6 * t:.0f}" for t in T],
    "Time (ns)": [f"{1e9 * t:.0f}" for t in T],
    "Time (min)": [f"{t / 60:.9f}" for t in T],
    "Time [s]": [f"{EPOCH + t:.2f}" for t in T],
    "timestamp_ms": [f"{1e3 * (EPOCH + t):.0f}" for t in T],
    "Date/Time": [f"{46130.4166666667 + t / 86400:.11f}" for t in T],
    "Time (days)": [f"{46130.4166666667 + t / 86400:.11f}" for t in T],
    "Time": [f"{0.41667 + t / 86400:.11f}" for t in T],
    "DateTime": [f"{739_000.4 + t / 86400:.10f}" for t in T],
}

DIGITS = 1e-4
"""A day of a spreadsheet with eleven digits is good to a microsecond."""


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_that_name_their_unit_or_count_days_need_no_guess(name: str, tmp_path: Path) -> None:
    run = read(tmp_path, text(*with_time(NUMBERS[name], name)))
    assert kinds(run) == set()
    assert run.fs == pytest.approx(25.0, rel=1e-4)
    assert efficiencies(run) == pytest.approx(clean(), abs=DIGITS)


@pytest.mark.parametrize("scale", [1.0, 1e3])
@pytest.mark.parametrize("start", [0.0, EPOCH])
@pytest.mark.parametrize("name", ["Time", "unix time", "epoch"])
def test_seconds_and_milliseconds_without_a_name_are_distinguished(
    scale: float, start: float, name: str, tmp_path: Path
) -> None:
    run = read(tmp_path, text(*with_time([f"{scale * (start + t):.3f}" for t in T], name)))
    assert kinds(run) == {"unit_assumed"}
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME * EPOCH * 1e-7)  # rounding of a large number


@pytest.mark.parametrize("order", [("Date", "Time"), ("Time", "Date"), ("Datum", "Zeit")])
def test_the_time_of_day_decides_beside_a_date(order: tuple[str, str], tmp_path: Path) -> None:
    day, time = stamps("%d.%m.%Y", BEFORE_MIDNIGHT), stamps("%H:%M:%S.~", BEFORE_MIDNIGHT)
    first, second = (day, time) if order[0] != "Time" else (time, day)
    rows = [[a, b, *row[1:]] for a, b, row in zip(first, second, ROWS, strict=True)]
    run = read(tmp_path, text(rows, [*order, *HEAD[1:]]))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_date_and_a_time_under_one_name_between_blanks_are_one_stamp(tmp_path: Path) -> None:
    rows, head = with_time(stamps("%Y-%m-%d %H:%M:%S.~"))
    run = read(tmp_path, text(rows, [header.replace(" ", "") for header in head], delimiter="  "))
    assert kinds(run) == set()
    assert run.fs == 25.0


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S", "%H:%M:%S"])
def test_stamps_of_whole_seconds_are_spread_over_their_samples(form: str, tmp_path: Path) -> None:
    run = read(tmp_path, text(*with_time(stamps(form))))
    assert kinds(run) == {"repeated_stamp"}
    assert run.fs == pytest.approx(25.0, rel=1e-3)
    assert efficiencies(run) == pytest.approx(clean(), abs=COARSE)


def test_a_stamp_column_that_cannot_be_read_is_reported(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"0 readable stamps; expected seconds, milliseconds or dates"):
        read(tmp_path, text(*with_time(["soon"] * len(T))))


def test_the_first_stamp_of_a_waveform_is_read_too() -> None:
    assert waveform({"X0": "1.5", "Delta_X": "0.040000"}) == (0.04, 1.5)
    assert waveform({"Operator": "25 Hz", "Sample rate": "unknown", "dt": "0"}) == (None, 0.0)
    assert waveform({"Sample interval": "40 furlongs"}) == (None, 0.0)


def test_rows_with_a_stamp_and_no_number_are_kept_and_reported(tmp_path: Path) -> None:
    rows, head = with_time(stamps("%H:%M:%S.~", NOON))
    rows = [[row[0], *["OVL"] * 7] if k == 700 else row for k, row in enumerate(rows)]
    run = read(tmp_path, text(rows, head))
    assert kinds(run) == {"not_a_number"}
    assert run.samples == len(ROWS)


@pytest.mark.parametrize(
    ("before", "after"), [("+01:00", "+02:00"), ("+0200", "+0100"), ("-05", "-04"), ("Z", "+05:30")]
)
def test_an_offset_from_utc_that_changes_within_the_log_is_no_step(before: str, after: str, tmp_path: Path) -> None:
    middle = len(T) // 3
    zones = [(_zone(before), before)] * middle + [(_zone(after), after)] * (len(T) - middle)
    moments = [NOON + dt.timedelta(milliseconds=round(1000 * t)) for t in T]
    written = [
        f"{m + east:%Y-%m-%dT%H:%M:%S}.{m.microsecond // 1000:03d}{z}"
        for m, (east, z) in zip(moments, zones, strict=True)
    ]
    run = read(tmp_path, text(*with_time(written)))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def _zone(text: str) -> dt.timedelta:
    sign, digits = -1 if text[0] == "-" else 1, text.strip("Z+-").replace(":", "").ljust(4, "0")
    return sign * dt.timedelta(hours=int(digits[:2]), minutes=int(digits[2:]))


def test_an_offset_that_only_some_stamps_have_changes_nothing() -> None:
    assert seconds(["2026-03-29 01:00:00+01:00", "2026-03-29 01:00:01", "2026-03-29 01:00:02"]).tolist() == [
        0.0,
        1.0,
        2.0,
    ]
