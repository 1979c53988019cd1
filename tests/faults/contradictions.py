"""Faults that a log shows by contradicting itself, copies, and strokes that differ; three logs,
10 to 100 Hz.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from fault_logs import HEADERS, Log, noisy, stroke_velocity, twin
from injected import (
    POWERS,
    Rng,
    Trial,
    either,
    fault,
    log_uniform,
    low_pass,
    numbered,
    payouts,
    spot,
    times,
    whole,
)

TRIALS = 25
MIDDLE = (10.0, 25.0, 50.0, 100.0)


@fault("contradiction: gain of a range", TRIALS, MIDDLE)
def gain_of_range(rng: Rng, _k: int, log: Log) -> Trial:
    """A range switch at half scale: above it the gain differs by 1 to 15 %."""
    channel = POWERS[rng.integers(4)]
    above = log[channel] > 0.5 * np.quantile(log[channel], 0.995)
    change = either(rng, 0.01, 0.15)
    return whole(
        log,
        f"{100 * change:+.1f} % above half scale",
        **{channel: log[channel] * (1 + change * above)},
    )


@fault("contradiction: offset under load", TRIALS, MIDDLE)
def offset_under_load(rng: Rng, k: int, log: Log) -> Trial:
    """Idc or torque reads 1 to 15 % of its plateau too much or too little under load alone."""
    channel = ("idc", "torque")[k % 2]
    top = np.quantile(log[channel], 0.995)
    offset = either(rng, 0.01, 0.15) * top
    return whole(
        log,
        f"{offset:+.3g} under load",
        **{channel: log[channel] + offset * (log[channel] > 0.2 * top)},
    )


@fault("contradiction: drifting force zero", TRIALS, MIDDLE)
def drifting_force(rng: Rng, k: int, log: Log) -> Trial:
    """The zero of the force drifts by 30 to 600 N over the log, steadily or by a step between
    two cycles.
    """
    drift = either(rng, 30.0, 600.0)
    rows = np.arange(len(log.t), dtype=np.float64)
    start = payouts(log)[int(rng.integers(1, len(payouts(log))))][0] - round(log.rate)
    shape = rows / len(rows) if k % 4 else np.asarray(rows >= start, np.float64)
    return whole(
        log,
        f"zero by {drift:+.0f} N, {'drifting' if k % 4 else 'a step'}",
        force=log["force"] + drift * shape,
    )


@fault("contradiction: smoothed velocity", TRIALS, MIDDLE)
def smoothed_velocity(rng: Rng, k: int, log: Log) -> Trial:
    """The velocity is smoothed over 0.5 to 2 s, centred, trailing or by a first order, though
    the displacement is not.
    """
    seconds = log_uniform(rng, 0.5, 2.0)
    count = max(3, round(seconds * log.rate) // 2 * 2 + 1)
    padded = np.pad(log["velocity"], count, "edge")
    centred = np.convolve(padded, np.ones(count) / count, "same")
    smooth = (centred, np.roll(centred, count // 2), low_pass(log, padded, 0.5 * seconds))[k % 3]
    return whole(log, f"smoothed over {seconds:.2f} s, form {k % 3}", velocity=smooth[count:-count])


@fault("contradiction: unipolar bursts", TRIALS, MIDDLE)
def bursts(rng: Rng, _k: int, log: Log) -> Trial:
    """Noise of one sign for 0.3 to 5 s at one to six places: 2 to 50 % of the range of the
    channel.
    """
    channel = POWERS[rng.integers(4)]
    x = log[channel].copy()
    size = either(rng, 0.02, 0.5) * float(np.subtract(*np.quantile(x, (0.995, 0.005))))
    places = [spot(rng, log, log_uniform(rng, 0.3, 5.0)) for _ in range(rng.integers(1, 7))]
    for a, b in places:
        x[a:b] += size * np.abs(rng.standard_normal(b - a))
    return replace(
        whole(log, f"bursts of {size:+.3g} at {places}", **{channel: x}), spans=times(log, places)
    )


@fault("contradiction: yards", TRIALS, MIDDLE)
def yards(_rng: Rng, k: int, log: Log) -> Trial:
    """Headers in yards over values in metres, or values in yards under headers in metres;
    displacement, velocity or both.
    """
    channels = (("displacement",), ("velocity",), ("displacement", "velocity"))[k % 3]
    if k % 2:
        return whole(log, "values in yards", **{c: log[c] / 0.9144 for c in channels})
    headers = {**HEADERS, **{c: HEADERS[c].replace("(m", "(yd") for c in channels}}
    return Trial(
        f"{', '.join(channels)} headed in yards",
        log,
        replace(log, headers=headers),
        frozenset(channels),
    )


@fault("copies: one cycle pasted", TRIALS, MIDDLE)
def pasted(rng: Rng, k: int, log: Log) -> Trial:
    """A log of one cycle two to four times, or one with a cycle once more at its end, under a
    clock of row numbers.
    """
    starts = [*(max(0, a - round(2.0 * log.rate)) for a, _ in payouts(log)), len(log.t)]
    cycle, copies = int(rng.integers(len(starts) - 2)), int(rng.integers(2, 5))
    block = np.arange(starts[cycle], starts[cycle + 1])
    rows = np.concatenate([block] * copies if k % 3 else [np.arange(starts[-1]), block])
    what = (
        f"cycle {cycle + 1} pasted {copies} times"
        if k % 3
        else f"cycle {cycle + 1} once more at the end"
    )
    return numbered(log, rows, what, "cycle", always=True)


SPEEDS = {4.5: 0.33, 18.0: 0.83, 36.0: 0.85}
"""Speed of the payouts of the logs with other strokes [m/s], by load. [ohm]"""

Stroke = tuple[float, float, float]
"""Length [m], share of the usual speed, and stop in the middle of the payout. [s]"""


def strokes(
    rng: Rng, log: Log, usual: list[Stroke], other: list[Stroke], window: float | str, what: str
) -> Trial:
    """A trial of two logs of the twin at the load and the rate of a log, with the same noise."""
    load, seed = log.load or np.inf, int(rng.integers(2**31))

    def made(cycles: list[Stroke]) -> Log:
        moves = [(length, SPEEDS[load] * share, 0.3, stop) for length, share, stop in cycles]
        table = twin(*stroke_velocity(moves, 100.0), load).iloc[:: round(100.0 / log.rate)]
        return Log("twin", log.rate, noisy(table, np.random.default_rng(seed)), load, window)

    return Trial(what, made(usual), made(other), frozenset({"displacement", "velocity", "cycle"}))


@fault("strokes: a stop in a fixed window", TRIALS, MIDDLE)
def stopped(rng: Rng, k: int, log: Log) -> Trial:
    """A stop of 0.5 to 2 s inside one payout, within a fixed window."""
    number, seconds, length = (
        int(rng.integers(3)),
        log_uniform(rng, 0.5, 2.0),
        4.0 if k % 2 else 8.0,
    )
    other = [(length, 1.0, seconds if cycle == number else 0.0) for cycle in range(3)]
    window = round(0.7 * length / SPEEDS[log.load or np.inf], 2)
    return strokes(
        rng,
        log,
        [(length, 1.0, 0.0)] * 3,
        other,
        window,
        f"stop of {seconds:.2f} s in payout {number + 1}",
    )


@fault("strokes: half strokes", TRIALS, MIDDLE)
def half_strokes(rng: Rng, _k: int, log: Log) -> Trial:
    """One payout of 35 to 75 % of the travel of the others, under the window rule `payout`."""
    number, share = int(rng.integers(3)), rng.uniform(0.35, 0.75)
    other = [(8.0 * (share if cycle == number else 1.0), 1.0, 0.0) for cycle in range(3)]
    return strokes(
        rng,
        log,
        [(8.0, 1.0, 0.0)] * 3,
        other,
        "payout",
        f"payout {number + 1} of {share:.0%} travel",
    )


@fault("strokes: jogs", TRIALS, MIDDLE)
def jogs(rng: Rng, k: int, log: Log) -> Trial:
    """One or two jogs of 0.2 to 1.2 m at 15 to 60 % of the speed beside the payouts, under the
    window rule `payout`.
    """
    extra = [(rng.uniform(0.2, 1.2), rng.uniform(0.15, 0.6), 0.0) for _ in range(1 + k % 2)]
    place, usual = int(rng.integers(4)), [(8.0, 1.0, 0.0)] * 3
    what = (
        f"jogs of {', '.join(f'{length:.2f} m' for length, *_ in extra)} before payout {place + 1}"
    )
    return strokes(rng, log, usual, [*usual[:place], *extra, *usual[place:]], "payout", what)
