"""Faults that a log shows by contradicting itself, copies, and strokes that differ; three logs, 10 to 100 Hz."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from injected import POWERS, Rng, Trial, either, fault, log_uniform, payouts, pick, spot, whole
from logs import HEADERS, Log, Signal, noisy, stroke_velocity, twin
from scipy.signal import lfilter

TRIALS = 25
MIDDLE = (10.0, 25.0, 50.0, 100.0)


def loaded(x: Signal) -> Signal:
    """Where a channel is above a fifth of its largest value, as 0 and 1."""
    return (x > 0.2 * np.quantile(x, 0.995)).astype(float)


@fault("contradiction: gain of a range", TRIALS)
def gain_of_range(rng: Rng, k: int) -> Trial:
    """A range switch at half scale: above it the gain differs by 1 to 15 %."""
    log = pick(rng, k, MIDDLE)
    channel = POWERS[rng.integers(4)]
    x = log[channel]
    half = 0.5 * np.quantile(x, 0.995)
    change = either(rng, log_uniform(rng, 0.01, 0.15))
    return whole(log, f"{channel} {100 * change:+.1f} % above {half:.4g}", **{channel: x * (1 + change * (x > half))})


@fault("contradiction: offset under load", TRIALS)
def offset_under_load(rng: Rng, k: int) -> Trial:
    """Idc or torque reads 1 to 15 % of its plateau too much or too little under load alone."""
    log = pick(rng, k, MIDDLE)
    channel = ("idc", "torque")[k % 2]
    x = log[channel]
    offset = either(rng, log_uniform(rng, 0.01, 0.15)) * np.quantile(x, 0.995)
    return whole(log, f"{channel} {offset:+.3g} under load", **{channel: x + offset * loaded(x)})


@fault("contradiction: drifting force zero", TRIALS)
def drifting_force(rng: Rng, k: int) -> Trial:
    """The zero of the force drifts by 30 to 600 N over the log, steadily or by a step between two cycles."""
    log = pick(rng, k, MIDDLE)
    drift = either(rng, log_uniform(rng, 30.0, 600.0))
    rows = np.arange(len(log.t))
    starts = [a - round(log.rate) for a, _ in payouts(log)]
    shape = rows / len(rows) if k % 4 else rows >= starts[int(rng.integers(1, len(starts)))]
    return whole(
        log, f"zero of force by {drift:+.0f} N, {'drifting' if k % 4 else 'a step'}", force=log["force"] + drift * shape
    )


@fault("contradiction: smoothed velocity", TRIALS)
def smoothed_velocity(rng: Rng, k: int) -> Trial:
    """The velocity is smoothed over 0.5 to 2 s, centred or trailing, though the displacement is logged as it is."""
    log = pick(rng, k, MIDDLE)
    seconds = log_uniform(rng, 0.5, 2.0)
    count = max(3, round(seconds * log.rate) // 2 * 2 + 1)
    x = np.pad(log["velocity"], count, "edge")
    if k % 3 == 2:
        keep = np.exp(-log.step / (0.5 * seconds))
        smooth, how = lfilter([1 - keep], [1, -keep], x, zi=[keep * x[0]])[0], "first order"
    else:
        shift = count // 2 if k % 3 else 0
        smooth, how = np.roll(np.convolve(x, np.ones(count) / count, "same"), shift), ("centred", "trailing")[k % 3]
    return whole(log, f"velocity smoothed over {seconds:.2f} s, {how}", velocity=smooth[count:-count])


@fault("contradiction: unipolar bursts", TRIALS)
def bursts(rng: Rng, k: int) -> Trial:
    """Noise of one sign for 0.3 to 5 s at one to six places: 2 to 50 % of the range of the channel."""
    log = pick(rng, k, MIDDLE)
    channel = POWERS[rng.integers(4)]
    x = log[channel].copy()
    size = either(rng, log_uniform(rng, 0.02, 0.5)) * float(np.quantile(x, 0.995) - np.quantile(x, 0.005))
    places = [spot(rng, log, log_uniform(rng, 0.3, 5.0)) for _ in range(rng.integers(1, 7))]
    for a, b in places:
        x[a:b] += size * np.abs(rng.standard_normal(b - a))
    found = whole(log, f"bursts of {size:+.3g} in {channel} at {places}", **{channel: x})
    return replace(found, spans=[(float(log.t[a]), float(log.t[b - 1])) for a, b in places])


@fault("contradiction: yards", TRIALS)
def yards(rng: Rng, k: int) -> Trial:
    """Headers in yards over values in metres, or values in yards under headers in metres; displacement, velocity or both."""
    log = pick(rng, k, MIDDLE)
    channels = (("displacement",), ("velocity",), ("displacement", "velocity"))[k % 3]
    if k % 2:
        return whole(log, f"{', '.join(channels)} in yards", **{c: log[c] / 0.9144 for c in channels})
    headers = {**HEADERS, **{c: HEADERS[c].replace("(m", "(yd") for c in channels}}
    return Trial(f"{', '.join(channels)} headed in yards", log, replace(log, headers=headers), frozenset(channels))


@fault("copies: one cycle pasted", TRIALS)
def pasted(rng: Rng, k: int) -> Trial:
    """One cycle two to four times under a clock of row numbers, exactly or with a new rounding of the stamps."""
    log = pick(rng, k, MIDDLE)
    starts = [*(max(0, a - round(2.0 * log.rate)) for a, _ in payouts(log)), len(log.t)]
    cycle = int(rng.integers(len(starts) - 2)) if len(starts) > 2 else 0
    times = int(rng.integers(2, 5))
    block = np.arange(starts[cycle], starts[cycle + 1])
    rows = np.concatenate([block] * times) if k % 3 else np.concatenate((np.arange(starts[-1]), block))
    damaged = log.rows(rows)
    stamps = np.round(log.t[0] + np.arange(len(rows)) * log.step, 6)
    what = f"cycle {cycle + 1} pasted {times} times" if k % 3 else f"cycle {cycle + 1} once more at the end"
    return Trial(what, log, damaged.changed(time=stamps), frozenset({"time", "cycle"}), always=True)


LOADS = {4.5: 0.33, 18.0: 0.83, 36.0: 0.85}
"""Load [ohm] and speed of the payouts [m/s] of the logs with other strokes."""


def strokes(
    rng: Rng, k: int, length: Sequence[float], speed: Sequence[float], stop: Sequence[float], window: float | str
) -> Log:
    """A log of the twin with its noise, from one length, speed and stop in the middle of each payout."""
    load = list(LOADS)[k % 3]
    rate = MIDDLE[rng.integers(4)]
    cycles = [(x, LOADS[load] * v, 0.3, s) for x, v, s in zip(length, speed, stop, strict=True)]
    t, velocity = stroke_velocity(cycles, 100.0)
    table = twin(t, velocity, load).iloc[:: round(100.0 / rate)]
    return Log(f"twin at {load:g} ohm", rate, noisy({c: table[c].to_numpy() for c in table}, rng), load, window)


@fault("strokes: a stop in a fixed window", TRIALS)
def stopped(rng: Rng, k: int) -> Trial:
    """A stop of 0.5 to 2 s inside one payout, within a fixed window."""
    seed, number = int(rng.integers(2**31)), int(rng.integers(3))
    seconds = log_uniform(rng, 0.5, 2.0)
    stop = [seconds if cycle == number else 0.0 for cycle in range(3)]
    length = [4.0 if k % 3 == 0 else 8.0] * 3
    window = round(0.7 * length[0] / list(LOADS.values())[k % 3], 2)
    true, damaged = (strokes(np.random.default_rng(seed), k, length, [1.0] * 3, s, window) for s in ([0.0] * 3, stop))
    return Trial(f"stop of {seconds:.2f} s in payout {number + 1}", true, damaged, frozenset({"velocity", "cycle"}))


@fault("strokes: half strokes", TRIALS)
def half_strokes(rng: Rng, k: int) -> Trial:
    """One payout of 35 to 75 % of the travel of the others, under the window rule `payout`."""
    seed, number, share = int(rng.integers(2**31)), int(rng.integers(3)), rng.uniform(0.35, 0.75)
    lengths = [8.0 * (share if cycle == number else 1.0) for cycle in range(3)]
    true, damaged = (
        strokes(np.random.default_rng(seed), k, x, [1.0] * 3, [0.0] * 3, "payout") for x in ([8.0] * 3, lengths)
    )
    return Trial(
        f"payout {number + 1} of {share:.0%} travel", true, damaged, frozenset({"displacement", "velocity", "cycle"})
    )


@fault("strokes: jogs", TRIALS)
def jogs(rng: Rng, k: int) -> Trial:
    """One or two jogs of 0.2 to 1.2 m at 15 to 60 % of the speed beside the payouts, under the window rule `payout`."""
    seed = int(rng.integers(2**31))
    extra = [(rng.uniform(0.2, 1.2), rng.uniform(0.15, 0.6)) for _ in range(1 + k % 2)]
    place = int(rng.integers(4))
    length, speed = [8.0] * 3, [1.0] * 3
    length[place:place], speed[place:place] = [x for x, _ in extra], [v for _, v in extra]
    true = strokes(np.random.default_rng(seed), k, [8.0] * 3, [1.0] * 3, [0.0] * 3, "payout")
    damaged = strokes(np.random.default_rng(seed), k, length, speed, [0.0] * len(length), "payout")
    what = f"jogs of {', '.join(f'{x:.2f} m' for x, _ in extra)} before payout {place + 1}"
    return Trial(what, true, damaged, frozenset({"displacement", "velocity", "cycle"}))
