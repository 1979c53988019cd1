"""Injected faults: each is a function from a random generator to a `Trial`; sizes are drawn from the ranges beside each.

Every fault has a name; trial `k` of a fault is the same in every version of the package.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from logs import HEADERS, NOISE, Log, Signal, base, bench, rounded
from numpy.typing import NDArray
from scipy.signal import lfilter

Rng = np.random.Generator
Rows = Sequence[tuple[int, int]]
"""Stretches of rows, the last excluded."""

SEED = 20261127
RATES = (5.0, 10.0, 25.0, 50.0, 100.0, 200.0)
USUAL = (10.0, 25.0, 100.0)
CHANNELS = ("displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")
ELECTRICAL = ("vdc", "idc")
POWERS = ("force", "torque", "vdc", "idc")
CODES = (-999.0, -9999.0, 999.0, 9999.0, 99999.0, 32767.0, -32768.0, 65535.0, 1e6, -1e6, 1e10)
"""Constants that loggers and instruments write where they have no reading."""


@dataclass(frozen=True)
class Trial:
    """One injected fault: the undamaged log, the damaged one, what was touched, and the times of the damage. [s]

    `always` marks a fault that counts as one whatever it does to the energies, such as a repeatability that is none.
    """

    what: str
    true: Log
    damaged: Log
    touched: frozenset[str]
    spans: Sequence[tuple[float, float]] = ()
    always: bool = False


Fault = Callable[[Rng, int], Trial]
"""Makes trial `k` of a fault."""

FAULTS: dict[str, tuple[Fault, int]] = {}
"""Every fault by name, with the number of its trials."""


def fault(name: str, trials: int) -> Callable[[Fault], Fault]:
    """Register a fault."""

    def register(make: Fault) -> Fault:
        FAULTS[name] = make, trials
        return make

    return register


def trial(name: str, k: int) -> Trial:
    """Make one trial."""
    return FAULTS[name][0](np.random.default_rng([SEED, zlib.crc32(name.encode()), k]), k)


# --- what the faults share


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Draw a size of which every decade is as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: Rng, size: float) -> float:
    """Give a size either sign."""
    return size if rng.random() < 0.5 else -size


def pick(rng: Rng, k: int, rates: Sequence[float] = USUAL) -> Log:
    """Take one of three logs at one of some rates."""
    return base(("r36ohm", "r4p5ohm", "r18ohm")[k % 3], rates[int(rng.integers(len(rates)))])


def some(rng: Rng) -> tuple[str, ...]:
    """One channel, the two electrical ones, or all that come from one amplifier."""
    groups = [(POWERS[rng.integers(4)],)] * 7 + [ELECTRICAL, ELECTRICAL, ("torque", "vdc", "idc"), POWERS]
    return groups[rng.integers(len(groups))]


def payouts(log: Log) -> list[tuple[int, int]]:
    """Rows of each payout, from the speed of the line or the shaft above a third of its highest."""
    v = log["velocity" if "velocity" in log.table else "speed"]
    moving = np.convolve(v > np.max(v) / 3.0, np.ones(max(3, round(log.rate)) // 2 * 2 + 1), "same") > 0
    edges = np.flatnonzero(np.diff(np.concatenate(([0], moving.astype(int), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def spot(rng: Rng, log: Log, seconds: float) -> tuple[int, int]:
    """Draw a stretch of rows: mostly in the first 6 s of a payout, where the window is, sometimes anywhere."""
    spans = payouts(log)
    first, last = spans[rng.integers(len(spans))]
    chance = rng.random()
    if chance > 0.92:
        first, last = 0, len(log.t)
    elif chance < 0.8:
        last = min(last, first + round(6.0 * log.rate))
    count = max(1, round(seconds * log.rate))
    start = int(rng.integers(first, max(first + 1, last - min(count, (last - first) // 2))))
    return start, min(start + count, len(log.t) - 1)


def times(log: Log, places: Rows) -> list[tuple[float, float]]:
    """Give the times of rows. [s]"""
    return [(float(log.t[a]), float(log.t[max(a, b - 1)])) for a, b in places]


def overwrite(
    log: Log, channels: Iterable[str], places: Rows, what: str, new: Callable[[str, Signal, int, int], Signal | float]
) -> Trial:
    """Replace stretches of some channels."""
    columns = {}
    for channel in channels:
        x = log[channel].astype(float).copy()
        for a, b in places:
            x[a:b] = new(channel, x, a, b)
        columns[channel] = x
    where = ", ".join(f"{a}:{b}" for a, b in places)
    what = f"{what} in {', '.join(columns)} at rows {where}"
    return Trial(what, log, log.changed(**columns), frozenset(columns), times(log, places))


def line_between(x: Signal, a: int, b: int) -> Signal:
    """Straight line between the neighbours of a stretch."""
    ends = [max(a - 1, 0), min(b, len(x) - 1)]
    return np.interp(np.arange(a, b), ends, x[ends])


def whole(log: Log, what: str, **columns: Signal) -> Trial:
    """Replace whole columns, rounded as the logger does."""
    new = {channel: rounded(channel, x) for channel, x in columns.items()}
    return Trial(what, log, log.changed(**new), frozenset(columns))


# --- samples of one channel: 17 faults in 7 channels of 3 logs, half of them at 25 Hz, and the same on a bench without a line

SAMPLES = {
    "spike 10 %": (1, "add", 0.1), "spike 30 %": (1, "add", 0.3), "spike 100 %": (1, "add", 1.0),
    "glitch of 3, 30 %": (3, "add", 0.3), "glitch of 5, 100 %": (5, "add", 1.0),
    "1 zero": (1, "set", 0.0), "4 zeros": (4, "set", 0.0), "12 zeros": (12, "set", 0.0), "50 zeros": (50, "set", 0.0),
    "1 code": (1, "set", -999.0), "20 codes": (20, "set", -999.0),
    "12 held": (12, "hold", 0.0), "25 held": (25, "hold", 0.0), "75 held": (75, "hold", 0.0),
    "12 on a line": (12, "line", 0.0), "25 on a line": (25, "line", 0.0), "75 on a line": (75, "line", 0.0),
}  # fmt: skip
"""Number of samples, how they change, and the size: a share of the range of the channel, or a value."""


def samples(rng: Rng, k: int, *, count: int, how: str, size: float, on_bench: bool) -> Trial:
    """Change some samples of one channel within a payout."""
    rate = 25.0 if k % 2 else RATES[rng.integers(len(RATES))]
    channels = ("speed", "torque", "vdc", "idc") if on_bench else CHANNELS
    log = bench(rate) if on_bench else base(("r36ohm", "r4p5ohm", "r18ohm")[k % 3], rate)
    channel = channels[k // 6 % len(channels)]
    inside = [(a, b) for a, b in payouts(log) if b - a > 2]
    first, last = inside[rng.integers(len(inside))]
    a = int(rng.integers(first, max(first + 1, min(last, len(log.t) - count - 5))))
    x = log[channel]
    step = either(rng, size * float(np.quantile(x, 0.995) - np.quantile(x, 0.005)))
    new = {
        "add": lambda _c, x, a, b: x[a:b] + step,
        "set": lambda *_: size,
        "hold": lambda _c, x, a, _b: x[a],
        "line": lambda _c, x, a, b: line_between(x, a, b),
    }[how]
    return overwrite(log, [channel], [(a, a + count)], f"{count} samples: {how} {size:g}", new)


for _name, (_count, _how, _size) in SAMPLES.items():
    fault(_name, 42)(partial(samples, count=_count, how=_how, size=_size, on_bench=False))
    fault(f"bench: {_name}", 24)(partial(samples, count=_count, how=_how, size=_size, on_bench=True))


# --- clock


@fault("clock: unit of the stamps", 12)
def wrong_unit(rng: Rng, k: int) -> Trial:
    """Header and stamps differ: milliseconds, minutes, microseconds, hours, or row numbers under "Time (s)"."""
    log = pick(rng, k)
    unit, factor = [
        ("s", 1e3), ("s", log.rate), ("ms", 1.0), ("s", 1 / 60), ("min", 1.0), ("s", 1e6), ("us", 1e3),
        ("s", 1 / 3600), ("ms", log.rate), ("s", 10.0), ("s", 0.1), ("s", 100.0),
    ][k % 12]  # fmt: skip
    damaged = log.changed(time=np.round(float(factor) * log.t, 9))
    headers = {**HEADERS, "time": f"Time ({unit})"}
    what = f"stamps in seconds times {factor:g} under Time ({unit})"
    return Trial(what, log, replace(damaged, headers=headers), frozenset({"time"}))


@fault("clock: rate", 12)
def nominal_rate(rng: Rng, k: int) -> Trial:
    """The clock counts rows with a rate that is wrong by 1.01 to 1.5, or 2 to 50."""
    log = pick(rng, k)
    factor = log_uniform(rng, 1.01, 1.5) if k % 5 < 3 else log_uniform(rng, 2.0, 50.0)
    factor = factor if rng.random() < 0.5 else 1.0 / factor
    stamps = np.round(log.t * factor, 6)
    return Trial(f"clock at {factor:.4g} of its rate", log, log.changed(time=stamps), frozenset({"time"}))


@fault("clock: lost rows", 12)
def lost_rows(rng: Rng, k: int) -> Trial:
    """Rows lost for 0.06 to 10 s, one to three times, and the clock renumbered as if nothing were missing."""
    log = pick(rng, k)
    places = [spot(rng, log, log_uniform(rng, 0.06, 10.0)) for _ in range(rng.integers(1, 4))]
    gone = np.concatenate([np.arange(a, b) for a, b in places])
    return renumbered(log, np.setdiff1d(np.arange(len(log.t)), gone), f"rows {places} lost, clock renumbered")


@fault("clock: repeated rows", 12)
def repeated_rows(rng: Rng, k: int) -> Trial:
    """A buffer of 0.1 to 5 s written twice, or two of them in the wrong order, under a clock of row numbers."""
    log = pick(rng, k)
    a, b = spot(rng, log, log_uniform(rng, 0.1, 5.0))
    rows = np.arange(len(log.t))
    if k % 2:
        return renumbered(log, np.concatenate((rows[:b], rows[a:])), f"rows {a}:{b} written twice")
    end = min(2 * b - a, len(rows))
    order = np.concatenate((rows[:a], rows[b:end], rows[a:b], rows[end:]))
    return renumbered(log, order, f"rows {a}:{b} written after those that follow")


def renumbered(log: Log, rows: NDArray[np.intp], what: str) -> Trial:
    """Take rows in an order, under stamps of row numbers."""
    damaged = log.rows(rows)
    stamps = np.round(log.t[0] + np.arange(len(rows)) * log.step, 6)
    jumps = stamps[1:][np.abs(np.diff(damaged.t) - log.step) > 0.01 * log.step]
    touched = frozenset({"time", "displacement"})
    return Trial(what, log, damaged.changed(time=stamps), touched, [(t, t) for t in jumps.tolist()])


@fault("clock: starts again", 12)
def restarted(rng: Rng, k: int) -> Trial:
    """The clock starts again at zero within a payout or anywhere, or wraps at 32.768 or 65.536 s."""
    log = pick(rng, k)
    a, _ = spot(rng, log, 0.1)
    stamps, what = np.where(np.arange(len(log.t)) < a, log.t, log.t - log.t[a]), f"clock starts again at row {a}"
    if k % 3 == 0:
        period = 32.768 * float(rng.integers(1, 3))
        stamps, what = np.mod(log.t, period), f"clock wraps at {period} s"
    return Trial(what, log, log.changed(time=np.round(stamps, 6).astype(np.float64)), frozenset({"time"}))


@fault("clock: coarse stamps", 12)
def coarse_stamps(rng: Rng, k: int) -> Trial:
    """Stamps cut to 2 to 50 sampling intervals, or rows that arrive in bursts of 2 to 50 a millisecond apart."""
    log = pick(rng, k)
    size = round(log_uniform(rng, 2, 50))
    number = np.arange(len(log.t))
    stamps, what = log.t[number // size * size], f"stamps cut to {size * log.step:g} s"
    if k % 2:
        arrival = log.t[np.minimum(number // size * size + size - 1, len(log.t) - 1)]
        stamps = np.round(arrival + min(0.001, 0.5 * log.step) * np.mod(number, size), 6)
        what = f"stamps of arrival in bursts of {size} rows"
    return Trial(what, log, log.changed(time=stamps), frozenset({"time"}))


@fault("counter starts again", 12)
def counter_restarted(rng: Rng, k: int) -> Trial:
    """The encoder's counter returns to zero within a payout, in a log with or without a velocity column."""
    log = pick(rng, k)
    log = log if k % 2 else log.without("velocity")
    a, _ = spot(rng, pick(rng, k, [log.rate]), 0.1)
    x = log["displacement"].copy()
    x[a:] = np.round(x[a:] - x[a], 4)
    touched = frozenset({"displacement", "velocity"})
    return Trial(
        f"displacement starts again at row {a}", log, log.changed(displacement=x), touched, times(log, [(a, a + 1)])
    )


# --- zeros, codes, ranges


@fault("zeros", 18)
def zeros(rng: Rng, k: int) -> Trial:
    """Exact zeros for 0.2 to 10 s, at one to three places, in one or several channels."""
    log = pick(rng, k, RATES)
    places = [spot(rng, log, log_uniform(rng, 0.2, 10.0)) for _ in range(rng.integers(1, 4))]
    return overwrite(log, some(rng), places, "exact zeros", lambda *_: 0.0)


@fault("codes", 18)
def codes(rng: Rng, k: int) -> Trial:
    """A code of an instrument from one sample to 5 s, at one to six places."""
    log = pick(rng, k, RATES)
    code = CODES[rng.integers(len(CODES))]
    channel = ("velocity", "displacement", *POWERS)[rng.integers(6)]
    places = [spot(rng, log, log_uniform(rng, log.step, 5.0)) for _ in range(rng.integers(1, 7))]
    return overwrite(log, [channel], places, f"code {code:g}", lambda *_: code)


@fault("ends of a range", 12)
def small_codes(rng: Rng, k: int) -> Trial:
    """A constant within the range of a channel for 0.2 to 5 s: -1, or an end of the range of its sensor."""
    log = pick(rng, k, RATES)
    channel = POWERS[rng.integers(4)]
    ends = {"force": (19613.3, -1.0), "torque": (500.0, -500.0), "vdc": (1000.0, -1.0), "idc": (50.0, -1.0)}[channel]
    code = ends[rng.integers(2)]
    places = [spot(rng, log, log_uniform(rng, 0.2, 5.0)) for _ in range(rng.integers(1, 4))]
    return overwrite(log, [channel], places, f"constant {code:g}", lambda *_: code)


@fault("last value held", 12)
def last_value(rng: Rng, k: int) -> Trial:
    """The last value held for 0.3 to 8 s."""
    log = pick(rng, k, RATES)
    places = [spot(rng, log, log_uniform(rng, 0.3, 8.0))]
    return overwrite(log, some(rng), places, "last value held", lambda _c, x, a, _b: float(x[a]))


@fault("unplugged", 12)
def unplugged(rng: Rng, k: int) -> Trial:
    """Noise about zero instead of the signal for 0.3 to 10 s."""
    log = pick(rng, k, RATES)
    places = [spot(rng, log, log_uniform(rng, 0.3, 10.0))]
    noise = lambda c, _x, a, b: rounded(c, NOISE[c] * rng.standard_normal(b - a))  # noqa: E731
    return overwrite(log, some(rng), places, "noise about zero", noise)


@fault("filled in", 12)
def filled_in(rng: Rng, k: int) -> Trial:
    """Rows lost for 0.3 to 6 s and filled in by straight lines, in one, some or all channels."""
    log = pick(rng, k, RATES)
    places = [spot(rng, log, log_uniform(rng, 0.3, 6.0)) for _ in range(rng.integers(1, 3))]
    channels = CHANNELS if k % 2 else some(rng)
    fill = lambda c, x, a, b: rounded(c, line_between(x, a, b))  # noqa: E731
    return overwrite(log, channels, places, "filled in by straight lines", fill)


@fault("slow channel", 12)
def slow_channel(rng: Rng, k: int) -> Trial:
    """A channel that is updated every 2 samples to 1 s, and written as zero or empty in between."""
    log = pick(rng, k, RATES)
    size = max(2, round(log_uniform(rng, 2.0 * log.step, 1.0) * log.rate))
    fill = (0.0, np.nan)[k % 2]
    channels = (POWERS[rng.integers(4)],) if rng.random() < 0.7 else ELECTRICAL
    kept = np.arange(len(log.t)) % size == 0
    columns = {c: np.where(kept, log[c], fill) for c in channels}
    what = f"{', '.join(channels)} updated every {size} rows, {fill:g} in between"
    return Trial(what, log, log.changed(**columns), frozenset(channels))


@fault("scattered losses", 12)
def scattered(rng: Rng, k: int) -> Trial:
    """0.5 to 30 % of the samples lost at random, written as zero, as a code or as the sample before."""
    log = pick(rng, k, RATES)
    share = log_uniform(rng, 0.005, 0.3)
    channels = (POWERS[rng.integers(4)],) if rng.random() < 0.7 else ELECTRICAL
    lost = rng.random(len(log.t)) < share
    fill = (0.0, CODES[rng.integers(len(CODES))], np.nan)[k % 3]
    columns = {c: np.where(lost, np.roll(log[c], 1) if fill != fill else fill, log[c]) for c in channels}
    what = f"{100 * share:.1f} % of {', '.join(channels)} lost, {fill:g} (nan: the sample before) instead"
    return Trial(what, log, log.changed(**columns), frozenset(channels))


@fault("clipped", 12)
def clipped(rng: Rng, k: int) -> Trial:
    """An amplifier that saturates at 70 to 97 % of the largest value."""
    log = pick(rng, k, RATES)
    channel = POWERS[rng.integers(4)]
    share = rng.uniform(0.70, 0.97)
    return whole(
        log, f"{channel} clipped at {share:.3f}", **{channel: np.minimum(log[channel], share * log[channel].max())}
    )


@fault("other range", 12)
def other_range(rng: Rng, k: int) -> Trial:
    """A meter that changes its range for 0.3 to 10 s: values are 10 or 1000 times too large or small."""
    log = pick(rng, k, RATES)
    factor = (10.0, 0.1, 1000.0, 0.001)[k % 4]
    places = [spot(rng, log, log_uniform(rng, 0.3, 10.0))]
    channel = POWERS[rng.integers(4)]
    return overwrite(log, [channel], places, f"times {factor:g}", lambda _c, x, a, b: np.round(factor * x[a:b], 6))


# --- coarse sampling


@fault("sampled too slowly", 12)
def picked(rng: Rng, k: int) -> Trial:
    """Single samples, or averages over the interval, at 0.2 to 5 Hz."""
    log = pick(rng, k, [100.0])
    every = round(100.0 / log_uniform(rng, 0.2, 5.0))
    if k % 2:
        return Trial(
            f"every {every}th of 100 Hz", log, log.rows(np.arange(every // 2, len(log.t), every)), frozenset({"time"})
        )
    means = log.table.groupby(np.arange(len(log.t)) // every).mean().round(6)
    return Trial(f"averages of {every} at 100 Hz", log, replace(log, table=means), frozenset({"time"}))


@fault("held between updates", 12)
def held(rng: Rng, k: int) -> Trial:
    """One or two channels updated every 0.3 to 3 s and held in between."""
    log = pick(rng, k)
    size = max(2, round(log_uniform(rng, 0.3, 3.0) * log.rate))
    channels = ELECTRICAL if rng.random() < 0.3 else (POWERS[rng.integers(4)],)
    last = np.arange(len(log.t)) // size * size
    columns = {c: log[c][last] for c in channels}
    return Trial(f"{', '.join(channels)} held for {size} rows", log, log.changed(**columns), frozenset(channels))


@fault("coarse digits", 12)
def coarse_digits(rng: Rng, k: int) -> Trial:
    """One channel recorded in steps of 0.3 to 30 % of its largest value, rounded or truncated."""
    log = pick(rng, k)
    channel = ("velocity", *POWERS)[rng.integers(5)]
    step = float(f"{log_uniform(rng, 0.003, 0.3) * np.max(np.abs(log[channel])):.1g}")
    how = (np.round, np.trunc, np.floor)[k % 3]
    damaged = log.changed(**{channel: np.round(how(log[channel] / step) * step, 6)})
    return Trial(f"{channel} in steps of {step:g} by {how.__name__}", log, damaged, frozenset({channel}))


# --- load, gains, zeros, lags


@fault("load stated wrongly", 12)
def stated_load(rng: Rng, k: int) -> Trial:
    """A stated load that is 12 % to a factor of 3 off, in milliohm or kilohm, or inf."""
    log = pick(rng, k)
    assert log.load is not None
    factor = log_uniform(rng, 1.12, 3.0)
    load = log.load * (factor, 1.0 / factor, factor, 1e3, 1e-3, np.inf)[k % 6]
    touched = frozenset({"load", *ELECTRICAL})
    return Trial(f"load {load:.4g} stated for {log.load:g} ohm", log, replace(log, load=load), touched, always=True)


@fault("gain of vdc or idc", 12)
def wrong_gain(rng: Rng, k: int) -> Trial:
    """A gain of Vdc or Idc that is 12 % to a factor of 2 off, or 2, 5, 10 or 1000; or Idc computed with a wrong load."""
    log = pick(rng, k)
    assert log.load is not None
    channel = ELECTRICAL[rng.integers(2)]
    factor = log_uniform(rng, 1.12, 2.0) if k % 5 < 3 else (2.0, 5.0, 10.0, 1000.0)[rng.integers(4)]
    factor = factor if rng.random() < 0.5 else 1.0 / factor
    if k % 4 == 3:
        damaged = replace(log.changed(idc=rounded("idc", log["vdc"] / log.load / factor)), load=log.load * factor)
        return Trial(f"Idc computed with {factor:.4g} of the load", log, damaged, frozenset({"idc", "load"}))
    damaged = log.changed(**{channel: np.round(factor * log[channel], 6)})
    return Trial(f"{channel} times {factor:.4g}", log, damaged, frozenset({channel, "load"}))


def late(log: Log, channel: str, lag: float | Signal) -> Signal:
    """A channel read late; beyond the ends it goes on mirrored. [s]"""
    low, high = log.t[0], log.t[-1]
    t = log.t - lag
    return np.interp(np.where(t < low, 2 * low - t, np.where(t > high, 2 * high - t, t)), log.t, log[channel])


LAGS = {"velocity": (0.1, ("velocity",)), "idc": (0.1, ("idc",)), "torque": (0.25, ("torque",)), "force": (0.25, ("force",)),
        "loggers": (0.25, ("torque", *ELECTRICAL))}  # fmt: skip
"""Smallest lag that is to be reported, where one sample is less [s], and the channels that are late together."""


@fault("lag", 30)
def lag(rng: Rng, k: int) -> Trial:
    """Channels late or early by the smallest lag that is to be reported to 2 s; in some trials from a place on."""
    log = pick(rng, k)
    smallest, channels = list(LAGS.values())[k % 5]
    size = either(rng, log_uniform(rng, 1.05 * max(smallest, log.step), 2.0))
    begin = spot(rng, log, 0.1)[0] if k % 4 == 3 else 0
    columns = {c: np.concatenate((log[c][:begin], late(log, c, size)[begin:])) for c in channels}
    return whole(log, f"{', '.join(channels)} {size:+.3f} s late from row {begin} on", **columns)


@fault("second clock", 12)
def second_clock(rng: Rng, k: int) -> Trial:
    """A channel on a clock of its own that runs 0.3 to 3 % fast or slow."""
    log = pick(rng, k)
    channel = ("velocity", "torque", "vdc", "idc")[k % 4]
    rate = 1.0 + either(rng, log_uniform(rng, 0.003, 0.03))
    return whole(log, f"{channel} on a clock at {rate:.4f}", **{channel: late(log, channel, (1.0 - rate) * log.t)})


@fault("low-pass filter", 12)
def filtered(rng: Rng, k: int) -> Trial:
    """A filter of first order with a time constant of 0.1 s (or one sample) to 1.5 s in one amplifier."""
    log = pick(rng, k)
    channel = ("velocity", "torque", "vdc", "idc")[k % 4]
    tau = log_uniform(rng, 1.05 * max(0.25 if channel == "torque" else 0.1, log.step), 1.5)
    keep = np.exp(-log.step / tau)
    x = log[channel]
    smooth = lfilter([1 - keep], [1, -keep], x, zi=[keep * x[0]])[0]
    return whole(log, f"{channel} behind a filter of {tau:.3f} s", **{channel: smooth})


ZEROS = {
    "torque": (1.5, 30.0),
    "idc": (0.025, 1.0),
    "vdc": (1.5, 20.0),
    "force": (85.0, 800.0),
    "velocity": (0.005, 0.028),
}
"""Offsets from five standard uncertainties of a zero on; force from where its band at rest may end. In the file's unit."""


@fault("zero", 30)
def zero(rng: Rng, k: int) -> Trial:
    """A zero that is off all over the log, drifts to its size, or steps at a place."""
    log = pick(rng, k)
    channel = list(ZEROS)[k % 5]
    size = either(rng, log_uniform(rng, *ZEROS[channel]))
    begin = spot(rng, log, 0.1)[0]
    share = (log.t - log.t[0]) / (log.t[-1] - log.t[0])
    how, shape = [
        ("constant", 1.0),
        ("constant", 1.0),
        ("drifting", share),
        (f"from row {begin} on", np.arange(len(log.t)) >= begin),
    ][k // 5 % 4 if channel in ("torque", "idc", "vdc") else 0]
    return whole(log, f"zero of {channel} {size:+.4g}, {how}", **{channel: log[channel] + size * shape})


@fault("gain that changes", 24)
def changing_gain(rng: Rng, k: int) -> Trial:
    """A gain that changes by 3 to 30 % between two cycles, in one cycle, or drifts over the log."""
    log = pick(rng, k)
    channel = POWERS[rng.integers(4)]
    change = either(rng, log_uniform(rng, 0.03, 0.3))
    starts = [max(0, a - round(log.rate)) for a, _ in payouts(log)]
    cycle = int(rng.integers(1, len(starts)))
    rows = np.arange(len(log.t), dtype=np.float64)
    stop = starts[cycle + 1] if cycle + 1 < len(starts) else len(rows)
    how, shape = [
        ("from a cycle on", rows >= starts[cycle]), ("in a cycle", (rows >= starts[cycle]) & (rows < stop)),
        ("drifting", rows / len(rows)),
    ][k % 3]  # fmt: skip
    return whole(
        log,
        f"gain of {channel} {100 * change:+.1f} % {how}",
        **{channel: log[channel] * (1 + change * np.asarray(shape, float))},
    )
