"""Faults of a channel over the whole log, and rows that were written twice; on a line and on a
bench without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from fault_logs import Log, bench
from injected import POWERS, Rng, Trial, either, fault, payouts, spot, times, whole

TRIALS = 12
ON_BENCH = ("torque", "vdc", "idc")


@fault("whole: dead channel", TRIALS)
def dead(_rng: Rng, k: int, log: Log) -> Trial:
    """A channel of zeros: of a line, or of a bench."""
    channel = (POWERS, ON_BENCH)[k % 2][k // 2 % 3]
    log = bench(log.rate) if k % 2 else log
    return whole(log, "zero", **{channel: np.zeros(len(log.t))})


@fault("whole: constant channel", TRIALS)
def constant(rng: Rng, k: int, log: Log) -> Trial:
    """A channel that holds one of its values throughout."""
    channel = (POWERS, (*ON_BENCH, "speed"))[k % 2][k // 2 % 4]
    log = bench(log.rate) if k % 2 else log
    value = float(log[channel][rng.integers(len(log.t))])
    return whole(log, f"{value:g} throughout", **{channel: np.full(len(log.t), value)})


@fault("whole: speed without sign", TRIALS)
def without_sign(_rng: Rng, k: int, log: Log) -> Trial:
    """A velocity or a speed of a shaft that is a magnitude."""
    return whole(log, "magnitude", velocity=np.abs(log["velocity"]))


@fault("whole: opposed powers", TRIALS)
def opposed(_rng: Rng, k: int, log: Log) -> Trial:
    """A channel of a power with the opposite sign: of a bench, and of a line without a velocity
    that shows the direction."""
    channel = (*ON_BENCH, "force")[k % 4]
    log = bench(log.rate) if channel != "force" else log
    return whole(log, "opposite sign", **{channel: -log[channel]})


@fault("whole: zero of a bench", TRIALS)
def zero_of_bench(rng: Rng, k: int, log: Log) -> Trial:
    """A zero of 1 to 10 % of the range of a channel of a bench, which rests before and after the
    test."""
    log, channel = bench(log.rate), ON_BENCH[k % 3]
    size = either(rng, 0.01, 0.1) * float(np.max(log[channel]))
    return whole(log, f"zero {size:+.4g}", **{channel: log[channel] + size})


@fault("whole: rows written twice", TRIALS)
def written_twice(rng: Rng, _k: int, log: Log) -> Trial:
    """Rows of 0.5 to 3 s that follow again, under a clock of row numbers, in a log without a
    displacement."""
    log = replace(log, table=log.table.drop(columns="displacement"))
    a, b = spot(rng, log, float(rng.uniform(0.5, 3.0)))
    damaged = log.rows(np.concatenate((np.arange(b), np.arange(a, len(log.t)))))
    stamps = np.round(log.t[0] + np.arange(len(damaged.t)) * log.step, 6)
    touched, spans = frozenset({"rows", *POWERS}), times(damaged, [(a, b)])
    return Trial(f"rows {a}:{b} twice", log, damaged.changed(time=stamps), touched, spans)


@fault("clock: set forward", TRIALS)
def set_forward(rng: Rng, k: int, log: Log) -> Trial:
    """A clock that is set forward by 1 s to a day within a payout."""
    first, last = payouts(log)[int(rng.integers(1, len(payouts(log))))]
    row = int(rng.integers(first + round(log.rate), last - round(log.rate)))
    seconds = (1.0, 60.0, 3600.0, 86400.0)[k % 4]
    stamps = log.t + seconds * (np.arange(len(log.t)) >= row)
    what = f"{seconds:g} s from row {row}"
    return Trial(what, log, log.changed(time=stamps), frozenset({"time"}))
