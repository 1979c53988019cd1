"""Texts of dates and times to seconds, and what else a file says of its clock: days of a spreadsheet, a sampling rate."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.quantity import find_unit

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

_MONTHS = {
    name: month
    for month, names in enumerate(
        (
            "jan ene gen", "feb fév fev", "mar mär mrt", "apr avr abr", "may mai mei maj mag", "jun juin giu", "jul juil lug",
            "aug aoû aou ago", "sep set", "oct okt ott out", "nov", "dec dez déc dic",
        ),
        start=1,
    )
    for name in names.split()
}  # fmt: skip
_STAMP = re.compile(
    r"""[\s"'\[]*(?:[^\W\d_]{2,9}\.?,?\s+(?=\S+\s+\S+\s))?                            # a weekday says nothing new
    (?:(?:(?P<a>\d{4})(?P<b>\d\d)(?P<c>\d\d)(?=[T\s])
      |(?P<d>\d{1,4})[-/.年\s](?P<e>\d{1,2}|[^\W\d_]{3,9}\.?)[-/.月\s]+(?P<f>\d{1,4})日?
      |(?P<month>[^\W\d_]{3,9})\.?\s+(?P<day>\d{1,2}),?\s+(?P<year>\d{4}))[\sT_,-]*)?
    (?P<noon1>[AaPp]\.?[Mm]\.?|上午|下午)?\s*
    (?:(?P<h>\d{1,3})[:時时](?P<m>\d\d)(?:[:分](?P<s>\d\d))?|(?<=T)(?P<hms>\d{6}))(?:[.,:](?P<frac>\d+))?秒?
    \s*(?P<noon2>[AaPp][.,]?[Mm][.,]?)?\s*(?P<zone>Z|(?:UTC|GMT)?(?:[+-]\d\d?(?::?\d\d)?)?)[\]"'\s]*$""",
    re.VERBOSE,
)
DAY = 86400.0
_LONG = 64
"""A stamp is shorter than this."""

_SERIAL = ((0.0, 1.0), (20000.0, 80000.0), (700_000.0, 780_000.0))
"""A part of a day, days since 1900 or 1904 (1954 to 2119), MATLAB's days since the year 0 (1916 to 2135)."""

_SHORTEST_DAY_STEP = 1e-5
"""Stamps this close together would be 100 kHz if they were seconds; as days they are less than a second apart."""

_Day = tuple[str, str, str]


def looks_like_a_stamp(text: str) -> bool:
    """Whether a cell is a date with a time, or a time of day.

    >>> looks_like_a_stamp("2026-04-18T10:00:00.040"), looks_like_a_stamp("12.5")
    (True, False)
    """
    return len(text) < _LONG and _STAMP.match(text) is not None


def seconds(texts: Sequence[str]) -> Signal:
    """Turn stamps into seconds since the first one; NaN for a text that is no stamp, midnight carried over. [s]

    >>> seconds(["18.04.2026 23:59:59,96", "19.04.2026 00:00:00,00"]).round(3).tolist()
    [0.0, 0.04]
    """
    days: dict[_Day | None, list[int]] = {}
    zones: dict[str, list[int]] = {}
    since = np.empty(len(texts))
    period = DAY
    for k, text in enumerate(texts):
        since[k], day, minutes, zone = _in_day(text)
        days.setdefault(day, []).append(k)
        if zone is not None:
            zones.setdefault(zone, []).append(k)
        period = 3600.0 if minutes else period
    good = np.flatnonzero(np.isfinite(since))
    if good.size == 0:
        return since
    if any(day is not None for day in days):
        for day, number in _numbers_of(days).items():
            since[days[day]] += DAY * number
        # Summer time begins or ends, and every stamp says how far it is from UTC.
        if len(zones) > 1 and "" not in zones:
            for zone, rows in zones.items():
                since[rows] -= _east_of_utc(zone)
        good = np.flatnonzero(np.isfinite(since))
    else:
        since[good] += period * np.cumsum(np.diff(since[good], prepend=since[good[0]]) < -period / 2)
    return since - since[good[0]] if good.size else since


def _east_of_utc(zone: str) -> float:
    """What the clock of a zone such as `Z`, `+0530` or `UTC-8` is ahead of UTC. [s]

    >>> [_east_of_utc(zone) for zone in ("Z", "+02:00", "UTC-8", "+530")]
    [0.0, 7200.0, -28800.0, 19800.0]
    """
    digits = "".join(c for c in zone if c.isdecimal())
    hours, minutes = (digits[:-2], digits[-2:]) if len(digits) > 2 else (digits, "0")
    return (-1.0 if "-" in zone else 1.0) * (int(hours or 0) * 3600.0 + int(minutes) * 60.0)


def _in_day(text: str) -> tuple[float, _Day | None, bool, str | None]:
    """Seconds since midnight, the parts of the date, whether a text shows minutes and seconds alone, and its zone.

    The zone is empty for a stamp without one, and None for a text that is no stamp.
    """
    found = _STAMP.match(text) if len(text) < _LONG else None
    if found is None:
        return float("nan"), None, False, None
    h, m, s, frac = found.group("h", "m", "s", "frac")
    if found["hms"]:
        h, m, s = found["hms"][:2], found["hms"][2:4], found["hms"][4:]
    minutes = s is None and frac is not None
    if minutes:  # 00:01.2, as a spreadsheet shows minutes and seconds
        h, m, s = "0", h, m
    hour = int(h)
    noon = (found["noon1"] or found["noon2"] or "").lower()
    if noon:
        hour = hour % 12 + (12 if noon.startswith("p") or noon == "下午" else 0)
    in_day = hour * 3600.0 + int(m) * 60.0 + int(s or 0) + (float("0." + frac) if frac else 0.0)
    for names in (("a", "b", "c"), ("d", "e", "f"), ("day", "month", "year")):
        if found[names[0]] is not None:
            return in_day, (found[names[0]], found[names[1]], found[names[2]]), False, found["zone"]
    return in_day, None, minutes, found["zone"]


def _numbers_of(days: Mapping[_Day | None, object]) -> dict[_Day | None, float]:
    """Number each day from the first; of day before month and month before day the order that exists and spans fewer days."""
    best: dict[_Day | None, float] = {}
    rank = (float("inf"), float("inf"))
    for month_first in (False, True):
        numbers = {day: float("nan") if day is None else _number_of(day, month_first) for day in days}
        real = [n for n in numbers.values() if np.isfinite(n)]
        this = (float(len(numbers) - len(real)), max(real) - min(real) if real else 0.0)
        if this < rank:
            best, rank = {day: n - min(real, default=0.0) for day, n in numbers.items()}, this
    return best


def _number_of(day: _Day, month_first: bool) -> float:
    """Number of a day; NaN for one that does not exist."""
    first, second, third = day
    if len(first) > 2:
        first, third = third, first
    elif month_first and second.isdecimal():
        first, second = second, first
    year = int(third) + (2000 if int(third) < 100 else 0)
    name = second.casefold().rstrip(".")
    month = int(name) if name.isdecimal() else _MONTHS.get(name[:4], _MONTHS.get(name[:3], 0))
    try:
        return float(date(year, month, int(first)).toordinal())
    except ValueError:
        return float("nan")


def serial_days(values: Signal) -> Signal | None:
    """Seconds since the first stamp, if the stamps are days as a spreadsheet or MATLAB counts them; else None. [s]

    >>> serial_days(np.array([46130.25, 46130.2500005, 46130.250001])).round(3).tolist()
    [0.0, 0.043, 0.086]
    """
    good = values[np.isfinite(values)]
    step = np.diff(good[:1000])
    if not step.any() or not 0 < median(step[step != 0]) < _SHORTEST_DAY_STEP:
        return None
    low, high = float(good.min()), float(good.max())
    if not any(a <= low and high <= b for a, b in _SERIAL):
        return None
    since: Signal = (values - good[0]) * DAY
    return since


_STEP_KEYS = frozenset(
    """deltax dt dts step sampleinterval sampleintervals samplinginterval samplingintervals sampleperiod samplingperiod
    sampletime samplingtime scaninterval loginterval logginginterval wfincrement timestep timeinterval abtastintervall
    abtastzeit périodedéchantillonnage 取樣間隔 取樣週期 採樣間隔 採樣週期 采样间隔 采样周期 サンプリング間隔""".split()
)
_RATE_KEYS = frozenset(
    """samplerate samplingrate samplefrequency samplingfrequency samplespersecond scanrate lograte loggingrate datarate
    acquisitionrate fs rate abtastrate abtastfrequenz messrate fréquencedéchantillonnage 取樣率 取樣頻率 採樣率 採樣頻率
    采样率 采样频率 サンプリング周波数 サンプリングレート""".split()
)
_AMOUNT = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)[\s,;]*([^\s,;()\[\]]*)")


def waveform(properties: Mapping[str, str]) -> tuple[float | None, float]:
    """Sampling interval and first stamp that a preamble states. [s]

    >>> waveform({"Sample rate": "25 Hz"}), waveform({"Sampling interval [ms]": "40"})
    ((0.04, 0.0), (0.04, 0.0))
    """
    step, start = None, 0.0
    for key, value in properties.items():
        name, _, bracket = re.sub(r"[(\[（]", "\n", key).partition("\n")
        letters = "".join(c for c in name.casefold() if c.isalnum())
        known = next((k for k in (letters, letters.removesuffix("hz"), letters.removesuffix("s")) if k in _KEYS), "")
        amount = _AMOUNT.match(value)
        if amount is None:
            continue
        number, unit = float(amount[1].replace(",", ".")), bracket.strip(" )]）") or amount[2]
        if known in _STEP_KEYS and number > 0:
            scale = find_unit(unit or "s")
            step = number * scale.factor if scale is not None and scale.dimension == "time" else step
        elif known in _RATE_KEYS and number > 0:
            step = 1.0 / (number * _per_second(unit))
        elif letters == "x0":
            start = number
    return step, start


_KEYS = _STEP_KEYS | _RATE_KEYS


def _per_second(unit: str) -> float:
    """What one of a unit of rates is per second: Hz, kHz, S/s, kS/s, samples per minute."""
    small = unit.casefold()
    if "min" in small:
        return 1.0 / 60.0
    return {"k": 1e3, "m": 1e6}.get(small[:1], 1.0)
