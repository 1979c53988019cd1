"""Injected faults: each is a function from an undamaged log and a random generator to a `Trial`,
under a name of its own.

Sizes are drawn from the ranges beside each. Trial `k` of a fault is the same in every version of
the package.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from fault_logs import HEADERS, NOISE, Log, Signal, base, bench, rounded
from numpy.typing import NDArray
from scipy.signal import lfilter

Rng = np.random.Generator
Rows = Sequence[tuple[int, int]]
"""Stretches of rows, the last excluded."""

SEED = 20261127
RATES = (5.0, 10.0, 25.0, 50.0, 100.0, 200.0)
USUAL = (10.0, 25.0, 100.0)
NAMES = ("r36ohm", "r4p5ohm", "r18ohm")
CHANNELS = ("displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")
ELECTRICAL = ("vdc", "idc")
POWERS = ("force", "torque", "vdc", "idc")
CODES = (-999.0, -9999.0, 999.0, 9999.0, 99999.0, 32767.0, -32768.0, 65535.0, 1e6, -1e6, 1e10)
"""Constants that loggers and instruments write where they have no reading."""


@dataclass(frozen=True)
class Trial:
    """One injected fault: the undamaged log, the damaged one, what was touched, and the times of
    the damage. [s]

    `always` marks a fault that counts as one whatever it does to the energies, such as a
    repeatability that is none.
    """

    what: str
    true: Log
    damaged: Log
    touched: frozenset[str]
    spans: Sequence[tuple[float, float]] = ()
    always: bool = False


Fault = Callable[[Rng, int, Log], Trial]
"""Makes trial `k` of a fault from one of three logs at one of some rates."""

FAULTS: dict[str, tuple[Fault, int, Sequence[float]]] = {}
"""Every fault by name, with the number of its trials and the rates of the logs. [Hz]"""


def fault(name: str, trials: int, rates: Sequence[float] = USUAL) -> Callable[[Fault], Fault]:
    """Register a fault."""

    def register(make: Fault) -> Fault:
        FAULTS[name] = make, trials, rates
        return make

    return register


def trial(name: str, k: int) -> Trial:
    """Make one trial."""
    make, _, rates = FAULTS[name]
    rng = np.random.default_rng([SEED, zlib.crc32(name.encode()), k])
    return make(rng, k, base(NAMES[k % 3], rates[int(rng.integers(len(rates)))]))


# --- what the faults share


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Draw a size of which every decade is as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: Rng, low: float, high: float) -> float:
    """Draw a size of either sign."""
    return log_uniform(rng, low, high) * (1.0 if rng.random() < 0.5 else -1.0)


def one(rng: Rng, _k: int) -> tuple[str, ...]:
    """A channel of a power."""
    return (POWERS[rng.integers(4)],)


def some(rng: Rng, _k: int) -> tuple[str, ...]:
    """One channel, the two electrical ones, or all that come from one amplifier."""
    groups = [(POWERS[rng.integers(4)],)] * 7 + [
        ELECTRICAL,
        ELECTRICAL,
        ("torque", "vdc", "idc"),
        POWERS,
    ]
    return groups[rng.integers(len(groups))]


def payouts(log: Log) -> list[tuple[int, int]]:
    """Rows of each payout, from the speed of the line or the shaft above a third of its highest."""
    v = log["velocity" if "velocity" in log.table else "speed"]
    moving = (
        np.convolve(v > np.max(v) / 3.0, np.ones(max(3, round(log.rate)) // 2 * 2 + 1), "same") > 0
    )
    edges = np.flatnonzero(np.diff(np.concatenate(([0], moving.astype(int), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def spot(rng: Rng, log: Log, seconds: float) -> tuple[int, int]:
    """Draw a stretch of rows: mostly in the first 6 s of a payout, where the window is,
    sometimes anywhere.
    """
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


New = Callable[[str, Signal, int, int], Signal | float]
"""What replaces rows a to b of a channel."""


def overwrite(log: Log, channels: Iterable[str], places: Rows, what: str, new: New) -> Trial:
    """Replace stretches of some channels."""
    columns = {}
    for channel in channels:
        x = log[channel].copy()
        for a, b in places:
            x[a:b] = new(channel, x, a, b)
        columns[channel] = x
    where = ", ".join(f"{a}:{b}" for a, b in places)
    what = f"{what} in {', '.join(columns)} at rows {where}"
    return Trial(what, log, log.changed(**columns), frozenset(columns), times(log, places))


def whole(log: Log, what: str, **columns: Signal) -> Trial:
    """Replace whole columns, rounded as the logger does."""
    new = {channel: rounded(channel, x) for channel, x in columns.items()}
    return Trial(f"{what} in {', '.join(columns)}", log, log.changed(**new), frozenset(columns))


def on_line(x: Signal, a: int, b: int) -> Signal:
    """Straight line between the neighbours of a stretch."""
    ends = [max(a - 1, 0), min(b, len(x) - 1)]
    return np.interp(np.arange(a, b), ends, x[ends])


# --- samples of one channel: 17 faults in 7 channels of 3 logs, half of them at 25 Hz, and the same
# on a bench without a line

SAMPLES = {
    "spike 10 %": (1, "add", 0.1), "spike 30 %": (1, "add", 0.3), "spike 100 %": (1, "add", 1.0),
    "glitch of 3, 30 %": (3, "add", 0.3), "glitch of 5, 100 %": (5, "add", 1.0),
    "1 zero": (1, "set", 0.0), "4 zeros": (4, "set", 0.0), "12 zeros": (12, "set", 0.0), "50 zeros": (50, "set", 0.0),
    "1 code": (1, "set", -999.0), "20 codes": (20, "set", -999.0),
    "12 held": (12, "hold", 0.0), "25 held": (25, "hold", 0.0), "75 held": (75, "hold", 0.0),
    "12 on a line": (12, "line", 0.0), "25 on a line": (25, "line", 0.0), "75 on a line": (75, "line", 0.0),
}  # fmt: skip
"""Number of samples, how they change, and the size: a share of the range of the channel, or a
value.
"""


def samples(
    rng: Rng, k: int, log: Log, *, count: int, how: str, size: float, on_bench: bool
) -> Trial:
    """Change some samples of one channel within a payout."""
    rate = 25.0 if k % 2 else log.rate
    log, channels = (
        (bench(rate), ("speed", *POWERS[1:])) if on_bench else (base(log.name, rate), CHANNELS)
    )
    channel = channels[k // 6 % len(channels)]
    inside = [(a, b) for a, b in payouts(log) if b - a > 2]
    first, last = inside[rng.integers(len(inside))]
    a = int(rng.integers(first, max(first + 1, min(last, len(log.t) - count - 5))))
    step = (
        (1 - 2 * int(rng.integers(2)))
        * size
        * float(np.subtract(*np.quantile(log[channel], (0.995, 0.005))))
    )
    new: dict[str, New] = {
        "add": lambda _c, x, a, b: x[a:b] + step, "set": lambda *_: size,
        "hold": lambda _c, x, a, _b: float(x[a]), "line": lambda _c, x, a, b: on_line(x, a, b),
    }  # fmt: skip
    return overwrite(log, [channel], [(a, a + count)], f"{count} samples: {how} {size:g}", new[how])


for _name, (_count, _how, _size) in SAMPLES.items():
    for _prefix, _trials in (("", 42), ("bench: ", 24)):
        _make = partial(samples, count=_count, how=_how, size=_size, on_bench=bool(_prefix))
        fault(f"{_prefix}{_name}", _trials, RATES)(_make)


# --- stretches of 0.2 to 10 s at one to six places

ENDS = {
    "force": (19613.3, -1.0),
    "torque": (500.0, -500.0),
    "vdc": (1000.0, -1.0),
    "idc": (50.0, -1.0),
}
"""Ends of the range of each sensor, or -1, in the unit of the file."""


def noise_alone(rng: Rng, _k: int) -> New:
    """A plug that is out."""
    return lambda c, _x, a, b: rounded(c, NOISE[c] * rng.standard_normal(b - a))


def code(rng: Rng, _k: int) -> New:
    """One code for the whole log."""
    chosen = CODES[rng.integers(len(CODES))]
    return lambda *_: chosen


STRETCHES: dict[str, tuple[int, float, float, int, Callable[[Rng, int], Sequence[str]], Callable[[Rng, int], New]]] = {
    "zeros": (18, 0.2, 10.0, 3, some, lambda *_: lambda *_: 0.0),
    "codes": (18, 0.01, 5.0, 6, lambda rng, _k: (("velocity", "displacement", *POWERS)[rng.integers(6)],), code),
    "ends of a range": (12, 0.2, 5.0, 3, one, lambda _r, k: lambda c, *_: ENDS[c][k % 2]),
    "last value held": (12, 0.3, 8.0, 1, some, lambda *_: lambda _c, x, a, _b: float(x[a])),
    "unplugged": (12, 0.3, 10.0, 1, some, noise_alone),
    "filled in": (12, 0.3, 6.0, 2, some, lambda *_: lambda c, x, a, b: rounded(c, on_line(x, a, b))),
    "filled in everywhere": (12, 0.3, 6.0, 2, lambda *_: CHANNELS, lambda *_: lambda c, x, a, b: rounded(c, on_line(x, a, b))),
    "other range": (12, 0.3, 10.0, 1, one, lambda _r, k: lambda _c, x, a, b: x[a:b] * (10.0, 0.1, 1e3, 1e-3)[k % 4]),
}  # fmt: skip
"""Trials, shortest and longest stretch [s], most places, channels, and what is written instead."""


def stretches(rng: Rng, k: int, log: Log, *, name: str) -> Trial:
    """Write something else over stretches of some channels."""
    _, low, high, most, channels, new = STRETCHES[name]
    places = [spot(rng, log, log_uniform(rng, low, high)) for _ in range(rng.integers(1, most + 1))]
    return overwrite(log, channels(rng, k), places, name, new(rng, k))


for _name, (_trials, *_) in STRETCHES.items():
    fault(_name, _trials, RATES)(partial(stretches, name=_name))


# --- clock


@fault("clock: unit of the stamps", 12)
def wrong_unit(_rng: Rng, k: int, log: Log) -> Trial:
    """Header and stamps differ: milliseconds, minutes, microseconds, hours, or row numbers under
    "Time (s)".
    """
    unit, factor = [
        ("s", 1e3), ("s", log.rate), ("ms", 1.0), ("s", 1 / 60), ("min", 1.0), ("s", 1e6), ("us", 1e3),
        ("s", 1 / 3600), ("ms", log.rate), ("s", 10.0), ("s", 0.1), ("s", 100.0),
    ][k % 12]  # fmt: skip
    damaged = replace(
        log.changed(time=factor * log.t), headers={**HEADERS, "time": f"Time ({unit})"}
    )
    return Trial(
        f"stamps in seconds times {factor:g} under Time ({unit})", log, damaged, frozenset({"time"})
    )


@fault("clock: rate", 12)
def nominal_rate(rng: Rng, k: int, log: Log) -> Trial:
    """The clock counts rows with a rate that is wrong by 1.01 to 1.5, or 2 to 50."""
    factor = log_uniform(rng, 1.01, 1.5) if k % 5 < 3 else log_uniform(rng, 2.0, 50.0)
    factor = factor if rng.random() < 0.5 else 1.0 / factor
    stamps = np.round(log.t * factor, 6)
    return Trial(
        f"clock at {factor:.4g} of its rate", log, log.changed(time=stamps), frozenset({"time"})
    )


@fault("clock: lost or repeated rows", 24)
def renumbered(rng: Rng, k: int, log: Log) -> Trial:
    """Rows lost for 0.06 to 10 s, written twice for 0.1 to 5 s, or in the wrong order, under a
    clock of row numbers.
    """
    rows = np.arange(len(log.t))
    a, b = spot(rng, log, log_uniform(rng, 0.1, 5.0))
    end = min(2 * b - a, len(rows))
    if k % 2:
        places = [spot(rng, log, log_uniform(rng, 0.06, 10.0)) for _ in range(rng.integers(1, 4))]
        what, kept = "lost", np.setdiff1d(rows, np.concatenate([rows[a:b] for a, b in places]))
    elif k % 4:
        what, kept = "written twice", np.concatenate((rows[:b], rows[a:]))
    else:
        what, kept = "written late", np.concatenate((rows[:a], rows[b:end], rows[a:b], rows[end:]))
    return numbered(log, kept, f"rows {what}")


def numbered(
    log: Log, rows: NDArray[np.intp], what: str, touched: str = "displacement", always: bool = False
) -> Trial:
    """Take rows in an order, under stamps of row numbers."""
    damaged = log.rows(rows)
    stamps = np.round(log.t[0] + np.arange(len(rows)) * log.step, 6)
    jumps = stamps[1:][np.abs(np.diff(damaged.t) - log.step) > 0.01 * log.step]
    spans = [(t, t) for t in jumps.tolist()]
    return Trial(
        what, log, damaged.changed(time=stamps), frozenset({"time", touched}), spans, always
    )


@fault("clock: starts again", 12)
def restarted(rng: Rng, k: int, log: Log) -> Trial:
    """The clock starts again at zero within a payout or anywhere, or wraps at 32.768 or 65.536
    s.
    """
    a, _ = spot(rng, log, 0.1)
    period = 32.768 * float(rng.integers(1, 3))
    stamps = (
        np.where(np.arange(len(log.t)) < a, log.t, log.t - log.t[a])
        if k % 3
        else np.mod(log.t, period)
    )
    what = f"clock starts again at row {a}" if k % 3 else f"clock wraps at {period} s"
    return Trial(
        what, log, log.changed(time=np.round(stamps, 6).astype(np.float64)), frozenset({"time"})
    )


@fault("clock: coarse stamps", 12)
def coarse_stamps(rng: Rng, k: int, log: Log) -> Trial:
    """Stamps cut to 2 to 50 sampling intervals, or rows that arrive in bursts of 2 to 50 a
    millisecond apart.
    """
    size = round(log_uniform(rng, 2, 50))
    number = np.arange(len(log.t))
    stamps = log.t[number // size * size]
    if k % 2:
        arrival = log.t[np.minimum(number // size * size + size - 1, len(log.t) - 1)]
        stamps = np.round(arrival + min(0.001, 0.5 * log.step) * np.mod(number, size), 6)
    what = f"stamps {'of arrival in bursts' if k % 2 else 'cut to blocks'} of {size} rows"
    return Trial(what, log, log.changed(time=stamps), frozenset({"time"}))


@fault("counter starts again", 12)
def counter_restarted(rng: Rng, k: int, log: Log) -> Trial:
    """The encoder's counter returns to zero within a payout, in a log with or without a velocity
    column.
    """
    a, _ = spot(rng, log, 0.1)
    x = log["displacement"].copy()
    x[a:] = np.round(x[a:] - x[a], 4)
    log = log if k % 2 else without_velocity(log)
    touched = frozenset({"displacement", "velocity"})
    return Trial(
        f"displacement starts again at row {a}",
        log,
        log.changed(displacement=x),
        touched,
        times(log, [(a, a + 1)]),
    )


def without_velocity(log: Log) -> Log:
    """Leave the velocity out."""
    return replace(log, table=log.table.drop(columns="velocity"))


# --- samples that are missing, slow or coarse


@fault("slow channel", 12, RATES)
def slow_channel(rng: Rng, k: int, log: Log) -> Trial:
    """A channel that is updated every 2 samples to 1 s, and written as zero or empty in between."""
    size = max(2, round(log_uniform(rng, 2.0 * log.step, 1.0) * log.rate))
    kept = np.arange(len(log.t)) % size == 0
    columns = {c: np.where(kept, log[c], (0.0, np.nan)[k % 2]) for c in some(rng, k)}
    return Trial(
        f"{', '.join(columns)} updated every {size} rows",
        log,
        log.changed(**columns),
        frozenset(columns),
    )


@fault("scattered losses", 12, RATES)
def scattered(rng: Rng, k: int, log: Log) -> Trial:
    """0.5 to 30 % of the samples lost at random, written as zero, as a code or as the sample
    before.
    """
    share = log_uniform(rng, 0.005, 0.3)
    lost = rng.random(len(log.t)) < share
    fill = (0.0, CODES[rng.integers(len(CODES))], np.nan)[k % 3]
    columns = {
        c: np.where(lost, np.roll(log[c], 1) if fill != fill else fill, log[c])
        for c in some(rng, k)
    }
    what = f"{100 * share:.1f} % of {', '.join(columns)} lost, {fill:g} (nan: the sample before) instead"
    return Trial(what, log, log.changed(**columns), frozenset(columns))


@fault("sampled too slowly", 12, [100.0])
def picked(rng: Rng, k: int, log: Log) -> Trial:
    """Single samples, or averages over the interval, at 0.2 to 5 Hz."""
    every = round(100.0 / log_uniform(rng, 0.2, 5.0))
    single = log.rows(np.arange(every // 2, len(log.t), every))
    means = replace(log, table=log.table.groupby(np.arange(len(log.t)) // every).mean().round(6))
    what = f"{('averages', 'one')[k % 2]} of {every} samples"
    return Trial(what, log, single if k % 2 else means, frozenset({"time"}))


@fault("held between updates", 12)
def held(rng: Rng, k: int, log: Log) -> Trial:
    """Some channels are updated every 0.3 to 3 s and held in between."""
    size = max(2, round(log_uniform(rng, 0.3, 3.0) * log.rate))
    last = np.arange(len(log.t)) // size * size
    return whole(log, f"held for {size} rows", **{c: log[c][last] for c in some(rng, k)})


@fault("coarse digits", 12)
def coarse_digits(rng: Rng, k: int, log: Log) -> Trial:
    """One channel recorded in steps of 0.3 to 30 % of its largest value, rounded or truncated."""
    channel = ("velocity", *POWERS)[rng.integers(5)]
    step = float(f"{log_uniform(rng, 0.003, 0.3) * np.max(np.abs(log[channel])):.1g}")
    how = (np.round, np.trunc, np.floor)[k % 3]
    damaged = log.changed(**{channel: np.round(how(log[channel] / step) * step, 6)})
    return Trial(
        f"{channel} in steps of {step:g} by {how.__name__}", log, damaged, frozenset({channel})
    )


# --- load, gains, zeros, lags


@fault("load stated wrongly", 12)
def stated_load(rng: Rng, k: int, log: Log) -> Trial:
    """A stated load that is 12 % to a factor of 3 off, in milliohm or kilohm, or inf."""
    factor = log_uniform(rng, 1.12, 3.0)
    load = (log.load or 1.0) * (factor, 1.0 / factor, factor, 1e3, 1e-3, np.inf)[k % 6]
    touched = frozenset({"load", *ELECTRICAL})
    return Trial(
        f"load {load:.4g} stated for {log.load} ohm",
        log,
        replace(log, load=load),
        touched,
        always=True,
    )


@fault("gain of vdc or idc", 12)
def wrong_gain(rng: Rng, k: int, log: Log) -> Trial:
    """A gain of Vdc or Idc that is 12 % to a factor of 2 off, or 2, 5, 10 or 1000; or Idc
    computed with a wrong load.
    """
    factor = log_uniform(rng, 1.12, 2.0) if k % 5 < 3 else (2.0, 5.0, 10.0, 1000.0)[rng.integers(4)]
    factor = factor if rng.random() < 0.5 else 1.0 / factor
    load = (log.load or 1.0) * factor
    channel = ELECTRICAL[rng.integers(2)]
    damaged = log.changed(**{channel: factor * log[channel]})
    if k % 4 == 3:
        channel, damaged = "idc", replace(log.changed(idc=log["vdc"] / load), load=load)
    return Trial(
        f"gain or load of {channel} times {factor:.4g}", log, damaged, frozenset({channel, "load"})
    )


def late(log: Log, channel: str, lag: float | Signal) -> Signal:
    """A channel read late; beyond the ends it goes on mirrored. [s]"""
    low, high = log.t[0], log.t[-1]
    t = log.t - lag
    return np.interp(
        np.where(t < low, 2 * low - t, np.where(t > high, 2 * high - t, t)), log.t, log[channel]
    )


LAGS = (
    (0.1, ("velocity",)), (0.1, ("idc",)), (0.25, ("torque",)), (0.25, ("force",)), (0.25, ("torque", *ELECTRICAL)),
)  # fmt: skip
"""Smallest lag that is to be reported, where one sample is less [s], and the channels that are
late together.
"""


@fault("lag", 30)
def lag(rng: Rng, k: int, log: Log) -> Trial:
    """Channels late or early by the smallest lag that is to be reported to 2 s; in some trials
    from a place on.
    """
    smallest, channels = LAGS[k % 5]
    size = either(rng, 1.05 * max(smallest, log.step), 2.0)
    begin = spot(rng, log, 0.1)[0] if k % 4 == 3 else 0
    columns = {c: np.concatenate((log[c][:begin], late(log, c, size)[begin:])) for c in channels}
    return whole(log, f"{size:+.3f} s late from row {begin} on", **columns)


@fault("second clock", 12)
def second_clock(rng: Rng, k: int, log: Log) -> Trial:
    """A channel on a clock of its own that runs 0.3 to 3 % fast or slow."""
    channel = ("velocity", "torque", "vdc", "idc")[k % 4]
    change = either(rng, 0.003, 0.03)
    return whole(log, f"clock off by {change:.4f}", **{channel: late(log, channel, change * log.t)})


@fault("low-pass filter", 12)
def filtered(rng: Rng, k: int, log: Log) -> Trial:
    """A filter of first order with a time constant of 0.1 s (or one sample) to 1.5 s in one
    amplifier.
    """
    channel = ("velocity", "torque", "vdc", "idc")[k % 4]
    tau = log_uniform(rng, 1.05 * max(0.25 if channel == "torque" else 0.1, log.step), 1.5)
    return whole(log, f"filter of {tau:.3f} s", **{channel: low_pass(log, log[channel], tau)})


def low_pass(log: Log, x: Signal, tau: float) -> Signal:
    """Filter by a first order with a time constant. [s]"""
    keep = np.exp(-log.step / tau)
    return np.asarray(lfilter([1 - keep], [1, -keep], x, zi=[keep * x[0]])[0])


@fault("clipped", 12, RATES)
def clipped(rng: Rng, k: int, log: Log) -> Trial:
    """An amplifier that saturates at 70 to 97 % of the largest value."""
    share, channel = rng.uniform(0.70, 0.97), POWERS[k % 4]
    return whole(
        log,
        f"clipped at {share:.3f}",
        **{channel: np.minimum(log[channel], share * log[channel].max())},
    )


ZEROS = {
    "torque": (1.5, 30.0),
    "idc": (0.025, 1.0),
    "vdc": (1.5, 20.0),
    "force": (85.0, 800.0),
    "velocity": (0.005, 0.028),
}
"""Offsets from five standard uncertainties of a zero on; force from where its band at rest may
end. In the file's unit.
"""


@fault("zero", 30)
def zero(rng: Rng, k: int, log: Log) -> Trial:
    """A zero that is off all over the log; that of torque, Idc or Vdc in some trials drifts or
    steps at a place.
    """
    channel = list(ZEROS)[k % 5]
    size = either(rng, *ZEROS[channel])
    begin = spot(rng, log, 0.1)[0]
    rows = np.arange(len(log.t), dtype=np.float64)
    how, shape = [
        ("all over", 1.0),
        ("drifting", rows / len(rows)),
        (f"from row {begin} on", rows >= begin),
    ][k // 5 % 3 if channel in ("torque", "idc", "vdc") else 0]
    return whole(
        log,
        f"zero {size:+.4g} {how}",
        **{channel: log[channel] + size * np.asarray(shape, np.float64)},
    )


@fault("gain that changes", 24)
def changing_gain(rng: Rng, k: int, log: Log) -> Trial:
    """A gain that changes by 3 to 30 % between two cycles, in one cycle, or drifts over the log."""
    channel = POWERS[rng.integers(4)]
    change = either(rng, 0.03, 0.3)
    starts = [*(max(0, a - round(log.rate)) for a, _ in payouts(log)), len(log.t)]
    cycle = int(rng.integers(1, len(starts) - 1))
    rows = np.arange(len(log.t), dtype=np.float64)
    later, one_cycle = rows >= starts[cycle], (rows >= starts[cycle]) & (rows < starts[cycle + 1])
    how = ("from a cycle on", "in a cycle", "drifting")[k % 3]
    shape = np.asarray((later, one_cycle, rows / len(rows))[k % 3], np.float64)
    return whole(
        log, f"gain {100 * change:+.1f} % {how}", **{channel: log[channel] * (1 + change * shape)}
    )
