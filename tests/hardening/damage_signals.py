"""Corruptions of clocks and signals: classes 1, 2, 3, 8, 9 and 10. Sizes are drawn from the range beside each."""

from collections.abc import Callable, Sequence

import numpy as np
from base_logs import DECIMALS, HEADERS, NOISE, STEPS, TIME, Log, Signal, base
from judge import Damage, csv, truth
from reasons import force_reason, gain_reason, lag_reason, zero_reason
from scipy.signal import lfilter

Rng = np.random.Generator

ELECTRICAL = ("vdc", "idc")
POWERS = ("force", "torque", "vdc", "idc")
CODES = (-999.0, -9999.0, 999.0, 9999.0, 99999.0, 32767.0, -32768.0, 65535.0, 1e6, -1e6, 1e10)
"""Constants that loggers and instruments write where they have no reading."""


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Draw a size of which every decade is as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: Rng, size: float) -> float:
    """Give a size either sign."""
    return size if rng.random() < 0.5 else -size


def spot(rng: Rng, log: Log, seconds: float) -> tuple[int, int]:
    """Draw a span of rows: mostly within an integration window, sometimes elsewhere in a payout or anywhere."""
    cycles = truth(log).complete
    cycle = cycles[rng.integers(len(cycles))]
    chance = rng.random()
    low, high = cycle.window.onset, cycle.window.cutoff
    if chance > 0.8:
        high = cycle.phases.payout_end
    if chance > 0.92:
        low, high = float(log.t[0]), float(log.t[-1])
    start = rng.uniform(low, max(low, high - min(seconds, 0.5 * (high - low))))
    first = int(np.searchsorted(log.t, start))
    count = max(1, round(seconds * log.rate))
    return first, min(first + count, len(log.t))


def spans(log: Log, places: Sequence[tuple[int, int]]) -> list[tuple[float, float]]:
    """Give the times of rows. [s]"""
    return [(float(log.t[a]), float(log.t[min(b, len(log.t)) - 1])) for a, b in places if a < len(log.t)]


def rounded(name: str, x: Signal) -> Signal:
    """Round a channel as the logger does."""
    return np.round(np.round(x / STEPS[name]) * STEPS[name], DECIMALS[name])


# --- 1: time axis


def wrong_unit(log: Log, rng: Rng) -> Damage:
    """Header and stamps differ: milliseconds, minutes, microseconds, hours, or row numbers under "Time (s)" and vice versa."""
    unit, factor = [
        ("s", 1e3), ("s", log.rate), ("ms", 1.0), ("s", 1 / 60), ("min", 1.0), ("s", 1e6), ("us", 1e3),
        ("s", 1 / 3600), ("ms", log.rate),
        ("s", 10.0), ("s", 0.1), ("s", 100.0),
    ][rng.integers(12)]  # fmt: skip
    stamps = np.round(log.t * factor, 9)
    headers = {**HEADERS, TIME: f"Time ({unit})"}
    damaged = Log(log.name, log.rate, log.load, log.window, {**log.columns, TIME: stamps}, headers)
    return Damage(log, f"stamps in seconds times {factor:g} under Time ({unit})", frozenset({TIME}), csv(damaged))


def nominal_rate(log: Log, rng: Rng) -> Damage:
    """The clock counts rows with a nominal rate that is wrong by a factor: 1.01 to 1.5, or 2 to 50."""
    factor = log_uniform(rng, 1.01, 1.5) if rng.random() < 0.6 else log_uniform(rng, 2.0, 50.0)
    factor = factor if rng.random() < 0.5 else 1.0 / factor
    stamps = np.round(log.t * factor, 6)
    return Damage(
        log, f"clock runs at {factor:.4g} of its rate", frozenset({TIME}), csv(log.changed(time=stamps)),
        true_stamps=(stamps, log.t),
    )  # fmt: skip


def short_window(log: Log, rng: Rng) -> Damage:
    """A window of 0.02 to 1.9 sampling intervals."""
    window = log_uniform(rng, 0.02, 1.9) * log.step
    return Damage(
        log, f"window of {window:.4g} s at {log.rate:g} Hz", frozenset({TIME}), csv(log), window=window,
        truth=truth(log), always="window shorter than two samples",
    )  # fmt: skip


def lost_rows(log: Log, rng: Rng) -> Damage:
    """Rows lost for 0.06 to 10 s, one to three times, and the clock renumbered as if nothing were missing."""
    gone = np.zeros(len(log.t), bool)
    lost = []
    for _ in range(rng.integers(1, 4)):
        a, b = spot(rng, log, log_uniform(rng, 0.06, 10.0))
        gone[a:b] = True
        lost.append((a, b))
    kept = log.rows(np.flatnonzero(~gone))
    return _renumbered(log, kept, f"rows {lost} lost, clock renumbered")


def repeated_block(log: Log, rng: Rng) -> Damage:
    """A buffer of 0.1 to 5 s written twice, or two of them in the wrong order, under a clock of row numbers."""
    a, b = spot(rng, log, log_uniform(rng, 0.1, 5.0))
    rows = np.arange(len(log.t))
    if rng.random() < 0.5:
        return _renumbered(log, log.rows(np.concatenate((rows[:b], rows[a:]))), f"rows {a} to {b} written twice")
    end = min(2 * b - a, len(rows))
    order = np.concatenate((rows[:a], rows[b:end], rows[a:b], rows[end:]))
    return _renumbered(log, log.rows(order), f"rows {a} to {b} written after those that follow")


def _renumbered(log: Log, damaged: Log, what: str) -> Damage:
    true_instants = damaged.t
    stamps = np.round(log.t[0] + np.arange(len(true_instants)) * log.step, 6)
    damaged = damaged.changed(time=stamps)
    jumps = stamps[1:][np.abs(np.diff(true_instants) - log.step) > 0.01 * log.step]
    return Damage(
        log, what, frozenset({TIME, "displacement"}), csv(damaged), spans=[(t, t) for t in jumps.tolist()],
        true_stamps=(stamps, np.maximum.accumulate(true_instants)),
    )  # fmt: skip


def reset(log: Log, rng: Rng) -> Damage:
    """The clock starts again at zero within a payout or anywhere, or wraps at 32.768 or 65.536 s."""
    a, _ = spot(rng, log, 0.1)
    stamps = log.t.copy()
    if rng.random() < 0.3:
        period = (32.768, 65.536)[rng.integers(2)]
        stamps, what = np.round(stamps % period, 6), f"clock wraps at {period} s"
    else:
        stamps[a:] -= stamps[a]
        stamps, what = np.round(stamps, 6), f"clock starts again at row {a}"
    return Damage(log, what, frozenset({TIME}), csv(log.changed(time=stamps)))


def counter_reset(log: Log, rng: Rng) -> Damage:
    """The encoder's counter returns to zero within a payout, in a log with or without a velocity column."""
    a, _ = spot(rng, log, 0.1)
    x = log.columns["displacement"].copy()
    x[a:] = np.round(x[a:] - x[a], 4)
    damaged = log.changed(displacement=x)
    only = rng.random() < 0.6
    return Damage(
        log, f"displacement starts again at row {a}{', no velocity column' if only else ''}",
        frozenset({"displacement", "velocity"}), csv(damaged.without("velocity") if only else damaged),
        spans=spans(log, [(a, a + 1)]), truth=truth(log.without("velocity")) if only else None,
    )  # fmt: skip


def coarse_stamps(log: Log, rng: Rng) -> Damage:
    """Stamps cut to 2 to 50 sampling intervals, or rows that arrive in bursts of 2 to 50 a millisecond apart."""
    size = round(log_uniform(rng, 2, 50))
    late = np.arange(len(log.t)) // size * size
    if rng.random() < 0.5:
        stamps, what = log.t[late], f"stamps cut to {size * log.step:g} s"
    else:
        arrival = np.asarray(log.t[np.minimum(late + size - 1, len(log.t) - 1)], dtype=np.float64)
        place = (np.arange(len(log.t)) % size).astype(np.float64)
        stamps = np.round(arrival + min(0.001, 0.5 * log.step) * place, 6)
        what = f"stamps of arrival in bursts of {size} rows"
    return Damage(log, what, frozenset({TIME}), csv(log.changed(time=stamps)), true_stamps=None)


# --- 2: zeros and codes


def _changed(
    log: Log, rng: Rng, names: Sequence[str], places: Sequence[tuple[int, int]], what: str,
    new: Callable[[str, Signal, int, int], Signal | float],
) -> Damage:  # fmt: skip
    columns = {}
    for name in names:
        x = log.columns[name].copy()
        for a, b in places:
            if a < b:
                x[a:b] = new(name, x, a, b)
        columns[name] = x
    where = ", ".join(f"{a}:{b}" for a, b in places)
    return Damage(
        log, f"{what} in {', '.join(names)} at rows {where}", frozenset(names), csv(log.changed(**columns)),
        spans=spans(log, places),
    )  # fmt: skip


def _some(rng: Rng) -> tuple[str, ...]:
    """One channel, the two electrical ones, or all that come from one amplifier."""
    chance = rng.random()
    if chance < 0.7:
        return (POWERS[rng.integers(4)],)
    return ELECTRICAL if chance < 0.85 else (("torque", "vdc", "idc"), POWERS)[rng.integers(2)]


def zeros(log: Log, rng: Rng) -> Damage:
    """Exact zeros for 0.2 to 10 s, at one to three places, in one or several channels."""
    places = [spot(rng, log, log_uniform(rng, 0.2, 10.0)) for _ in range(rng.integers(1, 4))]
    return _changed(log, rng, _some(rng), places, "exact zeros", lambda *_: 0.0)


def codes(log: Log, rng: Rng) -> Damage:
    """A code of an instrument from one sample to 5 s, at one to six places, in any channel but the pressure."""
    code = CODES[rng.integers(len(CODES))]
    names = (("velocity", "displacement", *POWERS)[rng.integers(6)],)
    places = [spot(rng, log, log_uniform(rng, log.step, 5.0)) for _ in range(rng.integers(1, 7))]
    return _changed(log, rng, names, places, f"code {code:g}", lambda *_: code)


def small_codes(log: Log, rng: Rng) -> Damage:
    """A constant within the range of a channel for 0.2 to 5 s: -1, or an end of the range of its sensor."""
    names = (POWERS[rng.integers(4)],)
    ends = {"force": (19613.3, -1.0), "torque": (500.0, -500.0), "vdc": (1000.0, -1.0), "idc": (50.0, -1.0)}[names[0]]
    code = ends[rng.integers(2)]
    places = [spot(rng, log, log_uniform(rng, 0.2, 5.0)) for _ in range(rng.integers(1, 4))]
    return _changed(log, rng, names, places, f"constant {code:g}", lambda *_: code)


def last_value(log: Log, rng: Rng) -> Damage:
    """The last value held for 0.3 to 8 s."""
    places = [spot(rng, log, log_uniform(rng, 0.3, 8.0))]
    return _changed(log, rng, _some(rng), places, "last value held", lambda _n, x, a, _b: float(x[a]))


def unplugged(log: Log, rng: Rng) -> Damage:
    """A plug out for 0.3 to 10 s: noise about zero instead of the signal."""
    places = [spot(rng, log, log_uniform(rng, 0.3, 10.0))]
    return _changed(
        log, rng, _some(rng), places, "noise about zero",
        lambda name, _x, a, b: rounded(name, NOISE[name] * rng.standard_normal(b - a)),
    )  # fmt: skip


def filled_in(log: Log, rng: Rng) -> Damage:
    """Rows lost for 0.3 to 6 s at one or two places, then filled in by straight lines, in one, some or all channels."""
    places = [spot(rng, log, log_uniform(rng, 0.3, 6.0)) for _ in range(rng.integers(1, 3))]
    names = ("displacement", "velocity", "pressure", *POWERS) if rng.random() < 0.5 else _some(rng)
    return _changed(
        log, rng, names, places, "filled in by straight lines",
        lambda name, x, a, b: rounded(name, np.interp(np.arange(a, b), (a - 1, b), x[[max(a - 1, 0), min(b, len(x) - 1)]])),
    )  # fmt: skip


def slow_channel(log: Log, rng: Rng) -> Damage:
    """A channel that is updated every 2 samples to 1 s, and written as zero or empty in between."""
    size = max(2, round(log_uniform(rng, 2.0 * log.step, 1.0) * log.rate))
    names = (POWERS[rng.integers(4)],) if rng.random() < 0.7 else ELECTRICAL
    fill, word = ((0.0, "zero"), (np.nan, "empty"))[rng.integers(2)]
    columns = {}
    for name in names:
        x = np.full(len(log.t), fill)
        x[::size] = log.columns[name][::size]
        columns[name] = x
    what = f"{', '.join(names)} updated every {size} rows, {word} in between"
    return Damage(log, what, frozenset(names), csv(log.changed(**columns)))


def scattered(log: Log, rng: Rng) -> Damage:
    """Single samples lost all over the log, 0.5 to 30 % of them, written as zero, as a code or as the sample before."""
    share = log_uniform(rng, 0.005, 0.3)
    names = (POWERS[rng.integers(4)],) if rng.random() < 0.7 else ELECTRICAL
    lost = rng.random(len(log.t)) < share
    kind = rng.integers(3)
    fill = (0.0, CODES[rng.integers(len(CODES))], np.nan)[kind]
    columns = {}
    for name in names:
        x = log.columns[name]
        columns[name] = np.where(lost, np.concatenate((x[:1], x[:-1])) if kind == 2 else fill, x)
    instead = ("zero", f"code {fill:g}", "the sample before")[kind]
    what = f"{100 * share:.1f} % of {', '.join(names)} lost at random, {instead} instead"
    return Damage(log, what, frozenset(names), csv(log.changed(**columns)))


def clipped(log: Log, rng: Rng) -> Damage:
    """An amplifier that saturates at 70 to 97 % of the largest value."""
    name = POWERS[rng.integers(4)]
    x = log.columns[name]
    level = float(rounded(name, np.array([rng.uniform(0.70, 0.97) * x.max()]))[0])
    share = level / x.max()
    return Damage(
        log, f"{name} clipped at {level:g} ({100 * share:.1f} % of its largest)", frozenset({name}),
        csv(log.changed(**{name: np.minimum(x, level)})),
    )  # fmt: skip


def other_range(log: Log, rng: Rng) -> Damage:
    """A meter that changes its range for 0.3 to 10 s: values are 10 or 1000 times too large or small."""
    factor = (10.0, 0.1, 1000.0, 0.001)[rng.integers(4)]
    places = [spot(rng, log, log_uniform(rng, 0.3, 10.0))]
    return _changed(
        log, rng, (POWERS[rng.integers(4)],), places, f"values times {factor:g}",
        lambda _n, x, a, b: np.round(factor * x[a:b], 6),
    )  # fmt: skip


# --- 3: coarse sampling


def picked(log: Log, rng: Rng) -> Damage:
    """Single samples at 0.2 to 5 Hz."""
    log = base(log.name, 100)
    every = round(100.0 / log_uniform(rng, 0.2, 5.0))
    first = int(rng.integers(every))
    damaged = log.rows(np.arange(first, len(log.t), every))
    return Damage(log, f"every {every}th sample of 100 Hz from {first} on", frozenset({TIME, "rate"}), csv(damaged))


def averaged(log: Log, rng: Rng) -> Damage:
    """Averages over the whole interval at 0.2 to 5 Hz, stamped in its middle or at its end."""
    log = base(log.name, 100)
    every = round(100.0 / log_uniform(rng, 0.2, 5.0))
    count = len(log.t) // every
    columns = {
        name: np.round(x[: count * every].reshape(count, every).mean(axis=1), 6) for name, x in log.columns.items()
    }
    late = 0.5 * every * log.step * rng.integers(2)
    columns[TIME] = np.round(columns[TIME] + late, 6)
    damaged = log.changed(**columns)
    return Damage(log, f"averages of {every} samples at 100 Hz", frozenset({TIME, "rate"}), csv(damaged))


def held(log: Log, rng: Rng) -> Damage:
    """One or two channels updated every 0.3 to 3 s and held in between."""
    size = max(2, round(log_uniform(rng, 0.3, 3.0) * log.rate))
    names = ELECTRICAL if rng.random() < 0.3 else (POWERS[rng.integers(4)],)
    last = np.arange(len(log.t)) // size * size
    columns = {name: log.columns[name][last] for name in names}
    what = f"{', '.join(names)} updated every {size} rows and held"
    return Damage(log, what, frozenset({*names, "rate"}), csv(log.changed(**columns)))


def coarse_steps(log: Log, rng: Rng) -> Damage:
    """One channel recorded in steps of 0.3 to 30 % of its largest value, rounded or truncated."""
    name = ("velocity", *POWERS)[rng.integers(5)]
    x = log.columns[name]
    step = float(f"{log_uniform(rng, 0.003, 0.3) * np.max(np.abs(x)):.1g}")
    how = (np.round, np.trunc, np.floor)[rng.integers(3)]
    damaged = log.changed(**{name: np.round(how(x / step) * step, 6)})
    return Damage(log, f"{name} in steps of {step:g} by {how.__name__}", frozenset({name}), csv(damaged))


# --- 8: lag

THRESHOLD = 0.1
"""Smallest lag that is to be reported, where one sample is less. [s]"""

PHYSICS = 0.25
"""Lag of torque against electrical power that rotor and capacitor may make. [s]"""

BELOW = 0.1
"""Share of the draws with a size below the threshold that the task sets: these one log need not show."""


def _lag(log: Log, rng: Rng, threshold: float, maximum: float) -> float:
    minimum = max(threshold, log.step)
    if rng.random() < BELOW:
        return either(rng, log_uniform(rng, 0.3 * minimum, minimum))
    return either(rng, log_uniform(rng, 1.05 * minimum, maximum))


def _at(log: Log, name: str, t: Signal) -> Signal:
    """Give a channel at other instants; beyond the ends it goes on as it came, mirrored, so that its noise goes on."""
    low, high = log.t[0], log.t[-1]
    inside = np.where(t < low, 2 * low - t, np.where(t > high, 2 * high - t, t))
    return np.asarray(np.interp(inside, log.t, log.columns[name]), dtype=np.float64)


def _late(log: Log, name: str, lag: float, begin: int = 0) -> Signal:
    late = _at(log, name, log.t - lag)
    x = log.columns[name]
    return rounded(name, np.concatenate((x[:begin], late[begin:])))


def _lagged(log: Log, names: Sequence[str], lag: float, begin: int = 0) -> Damage:
    columns = {name: _late(log, name, lag, begin) for name in names}
    since = f" from row {begin} on" if begin else ""
    return Damage(
        log,
        f"{', '.join(names)} {lag:+.3f} s late{since}",
        frozenset(names),
        csv(log.changed(**columns)),
        unseen=lag_reason(names, lag),
    )


def motion_lag(log: Log, rng: Rng) -> Damage:
    """Velocity 0.1 s (or one sample) to 2 s off the displacement, either sign."""
    lag = _lag(log, rng, THRESHOLD, 2.0)
    return _lagged(log, ("velocity",), lag)


def current_lag(log: Log, rng: Rng) -> Damage:
    """Idc or Vdc 0.1 s (or one sample) to 2 s off the other, either sign."""
    lag = _lag(log, rng, THRESHOLD, 2.0)
    return _lagged(log, (ELECTRICAL[rng.integers(2)],), lag)


def torque_lag(log: Log, rng: Rng) -> Damage:
    """Torque, or Vdc and Idc together, 0.25 to 2 s off the other side, either sign."""
    lag = _lag(log, rng, PHYSICS, 2.0)
    return _lagged(log, ("torque",) if rng.random() < 0.5 else ELECTRICAL, lag)


def force_lag(log: Log, rng: Rng) -> Damage:
    """Force 0.25 to 2 s off all others, either sign."""
    lag = _lag(log, rng, PHYSICS, 2.0)
    return _lagged(log, ("force",), lag)


def two_loggers(log: Log, rng: Rng) -> Damage:
    """Two loggers joined with 0.25 to 2 s between them: one has the motion, or motion and force, the other one the rest."""
    lag = _lag(log, rng, PHYSICS, 2.0)
    return _lagged(log, POWERS if rng.random() < 0.5 else ("torque", *ELECTRICAL), lag)


def slipped(log: Log, rng: Rng) -> Damage:
    """A channel that loses step at a place: 0.25 to 2 s off from there on."""
    lag = _lag(log, rng, PHYSICS, 2.0)
    begin, _ = spot(rng, log, 0.1)
    return _lagged(log, (("velocity", "torque", "vdc", "idc")[rng.integers(4)],), lag, begin)


def second_clock(log: Log, rng: Rng) -> Damage:
    """A channel on a clock of its own that runs 0.3 to 3 % fast or slow."""
    name = ("velocity", "torque", "vdc", "idc")[rng.integers(4)]
    rate = 1.0 + either(rng, log_uniform(rng, 0.003, 0.03))
    x = rounded(name, _at(log, name, log.t * rate))
    what = f"{name} on a clock at {rate:.4f} of the rate"
    return Damage(log, what, frozenset({name}), csv(log.changed(**{name: x})))


def filtered(log: Log, rng: Rng) -> Damage:
    """A low-pass filter of first order with a time constant of 0.1 s (or one sample) to 1.5 s in one amplifier."""
    name = ("velocity", "torque", "vdc", "idc")[rng.integers(4)]
    minimum = max(PHYSICS if name == "torque" else THRESHOLD, log.step)
    tau = log_uniform(rng, 1.05 * minimum, 1.5)
    keep = np.exp(-log.step / tau)
    x = log.columns[name]
    smooth = lfilter([1 - keep], [1, -keep], x, zi=[keep * x[0]])[0]
    what = f"{name} behind a filter of {tau:.3f} s"
    return Damage(log, what, frozenset({name}), csv(log.changed(**{name: rounded(name, smooth)})))


# --- 9: zero offsets

ZEROS = {"torque": (1.5, 30.0), "idc": (0.025, 1.0), "vdc": (1.5, 20.0), "force": (85.0, 800.0)}
"""Offsets from five standard uncertainties of a zero on (torque 0.3 N m, Idc 5 mA, Vdc taken as 0.3 V), in the file's unit.
Force begins where its band at rest may end."""

FORCE_AT_REST = (0.54, 1 / 0.68)
"""Band of the force at rest that friction allows, as a share of the frictionless one."""


def _offset(rng: Rng, name: str) -> float:
    low, high = ZEROS[name]
    if rng.random() < BELOW:
        return either(rng, log_uniform(rng, 0.3 * low, low))
    return either(rng, log_uniform(rng, low, high))


def constant_offset(log: Log, rng: Rng, name: str) -> Damage:
    offset = _offset(rng, name)
    x = rounded(name, log.columns[name] + offset)
    unseen = force_reason(log, x, FORCE_AT_REST) if name == "force" else zero_reason(log, name, x)
    return Damage(log, f"zero of {name} {offset:+.4g}", frozenset({name}), csv(log.changed(**{name: x})), unseen=unseen)


def torque_zero(log: Log, rng: Rng) -> Damage:
    """Torque: 1.5 to 30 N m."""
    return constant_offset(log, rng, "torque")


def current_zero(log: Log, rng: Rng) -> Damage:
    """Idc: 25 mA to 1 A."""
    return constant_offset(log, rng, "idc")


def voltage_zero(log: Log, rng: Rng) -> Damage:
    """Vdc: 1.5 to 20 V."""
    return constant_offset(log, rng, "vdc")


def force_zero(log: Log, rng: Rng) -> Damage:
    """Force: 85 to 800 N."""
    return constant_offset(log, rng, "force")


def drifting_zero(log: Log, rng: Rng) -> Damage:
    """A zero of torque, Idc or Vdc that drifts to such a size by the end, or steps at a place."""
    name = ("torque", "idc", "vdc")[rng.integers(3)]
    offset = _offset(rng, name)
    if rng.random() < 0.5:
        shape, how = (log.t - log.t[0]) / (log.t[-1] - log.t[0]), "drifts"
    else:
        begin, _ = spot(rng, log, 0.1)
        shape, how = (np.arange(len(log.t)) >= begin).astype(float), f"steps at row {begin}"
    x = rounded(name, log.columns[name] + offset * shape)
    return Damage(
        log, f"zero of {name} {how} by {offset:+.4g}", frozenset({name}), csv(log.changed(**{name: x})),
        unseen=zero_reason(log, name, x),
    )  # fmt: skip


def speed_zero(log: Log, rng: Rng) -> Damage:
    """Velocity of a tachometer: 5 to 28 mm/s, below the speed of an onset."""
    offset = either(rng, log_uniform(rng, 0.005, 0.028))
    x = rounded("velocity", log.columns["velocity"] + offset)
    return Damage(log, f"zero of velocity {offset:+.4g}", frozenset({"velocity"}), csv(log.changed(velocity=x)))


# --- 10: efficiencies that change

GAINS = ("force", "torque", "vdc", "idc")


def _gain(rng: Rng) -> tuple[str, float]:
    """A channel and the change of its gain, by 3 to 30 %."""
    return GAINS[rng.integers(4)], either(rng, log_uniform(rng, 0.03, 0.3))


def _gain_damage(log: Log, name: str, x: Signal, what: str) -> Damage:
    return Damage(log, what, frozenset({name}), csv(log.changed(**{name: x})), unseen=gain_reason)


def gain_step(log: Log, rng: Rng) -> Damage:
    """A gain that changes by 3 to 30 % between two cycles."""
    name, change = _gain(rng)
    cycles = truth(log).complete
    k = int(rng.integers(1, len(cycles)))
    begin = int(np.searchsorted(log.t, cycles[k].window.onset - 1.0))
    x = log.columns[name].copy()
    x[begin:] = rounded(name, (1 + change) * x[begin:])
    return _gain_damage(log, name, x, f"gain of {name} {100 * change:+.1f} % from cycle {cycles[k].cycle} on")


def one_cycle(log: Log, rng: Rng) -> Damage:
    """A gain that is 3 to 30 % off in one cycle."""
    name, change = _gain(rng)
    cycles = truth(log).complete
    k = int(rng.integers(len(cycles)))
    end = cycles[k + 1].window.onset - 1.0 if k + 1 < len(cycles) else log.t[-1] + 1.0
    inside = (log.t >= cycles[k].window.onset - 1.0) & (log.t < end)
    x = np.where(inside, rounded(name, (1 + change) * log.columns[name]), log.columns[name])
    return _gain_damage(log, name, x, f"gain of {name} {100 * change:+.1f} % in cycle {cycles[k].cycle}")


def drift(log: Log, rng: Rng) -> Damage:
    """A gain that drifts by 3 to 30 % over the log."""
    name, change = _gain(rng)
    x = rounded(name, log.columns[name] * (1 + change * (log.t - log.t[0]) / (log.t[-1] - log.t[0])))
    return _gain_damage(log, name, x, f"gain of {name} drifts by {100 * change:+.1f} %")
