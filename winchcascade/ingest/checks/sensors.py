"""Channels that their sensors contradict: out of range, saturated, dead or held throughout; and
repeated rows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from winchcascade.core.integrate import ENOUGH, ends_of
from winchcascade.core.run import Finding, FindingKind, Mask, Repair, Signal
from winchcascade.ingest.checks.samples import Samples, limits_of, text_of

FOLLOW_LINE = frozenset({"displacement", "pressure", "force", "torque", "power_mech", "vdc", "idc"})
"""Channels that must change while the line pays out; a channel of your own may hold its value."""

MAY_HOLD = ("velocity", "speed")
"""Factors of a power whose largest value need not scatter: a line or a shaft may move at one speed.
A machine that is blocked takes a current and gives a torque."""

MIN_REPEATS = 20
"""Fewest samples at the largest value, or rows that equal earlier ones: noise repeats none by
chance. [1]
"""

MAX_ROWS = 1_000_000
"""Longer logs are not searched for repeated rows: sorting them would take longer than all other
checks. [1]
"""

NOISY = 0.3
"""Largest share of the samples of a noisy channel that repeat the one before. [1]"""

CLEAR = 5.0
"""A mean power that exceeds this many of its standard errors is more than noise. [1]"""


def out_of_range(log: Samples, name: str, sign: float) -> None:
    """Report values outside the range of a sensor; they are kept, as clipping or dropping them
    would hide what happened.

    Parameters
    ----------
    sign : factor by which the sign of the channel was corrected since values were taken out
    """
    low, high = limits_of(log.rig.sensors.get(name))
    x = log.channels[name]
    at, logged = log.logged.get(name, (np.empty(0, dtype=np.intp), np.empty(0)))
    bottom, top = ends_of(np.concatenate((ends_of(x), sign * logged)))
    if bottom >= low and top <= high:
        return
    bad = (x < low) | (x > high)
    spikes = at[(sign * logged < low) | (sign * logged > high)]
    bad[spikes] = True
    limit, worst = (high, top) if top > high else (low, bottom)
    channel = log.rig.known_channels[name]
    what = f"lie outside its range, up to {text_of(channel, worst)} {channel.unit} where it ends at {text_of(channel, limit)}"
    log.report("out_of_range", name, bad, what, removed=False, bridged=spikes.size)


def saturated(log: Samples, name: str) -> None:
    """Report a channel that holds its largest value in stretches while it scatters elsewhere."""
    x = log.channels[name]
    low, high = ends_of(x)
    top = high if high >= -low else low
    held = x == top
    again = int(np.count_nonzero(held[1:] & held[:-1]))
    if top == 0.0 or again < MIN_REPEATS or 2 * again < np.count_nonzero(held):
        return
    change = np.diff(x)[~(held[1:] | held[:-1])]
    if is_noisy(change[np.isfinite(change)]):
        channel = log.rig.known_channels[name]
        what = f"hold the largest value, {text_of(channel, top)} {channel.unit}, without noise: sensor or input is saturated"
        log.report("out_of_range", name, held, what, removed=False)


def is_noisy(change: Signal) -> bool:
    """Whether changes from sample to sample are those of a channel with noise above its
    resolution.
    """
    some = change[change != 0]
    if some.size < MIN_REPEATS or some.size < (1.0 - NOISY) * change.size:
        return False
    turn = some[1:] * some[:-1] < 0
    large = np.minimum(np.abs(some[1:]), np.abs(some[:-1]))[turn] > 1.5 * np.abs(some).min()
    return bool(np.mean(turn) > 0.5 * NOISY and large.size and np.mean(large) > NOISY)


def is_constant(x: Signal) -> bool:
    """Whether a channel is one value throughout; most show within a few samples that they are
    not.
    """
    return all(
        np.ptp(part[np.isfinite(part)]) == 0 for part in (x[:1000], x) if np.isfinite(part).any()
    )


def report_constant(log: Samples) -> None:
    """Report channels that hold one value throughout, and leave out those that must follow the line
    while it pays out.

    Without a line, others change; a channel of zeros is dead if its stage works.
    """
    v = log.channels.get("velocity")
    pays_out = v is not None and bool(np.any(v > log.rig.thresholds.v_onset))
    used = {name for name in (*FOLLOW_LINE, *log.rig.cascade.channels) if name in log.channels}
    constant = sorted(
        name
        for name in used
        if is_constant(log.channels[name]) and not (log.open_circuit and name == "idc")
    )
    for name in constant:
        value = float(np.nanmax(log.channels[name]))
        if pays_out and name in FOLLOW_LINE:
            leave_out(log, name, "channel left out, metrics that need it are null")
        elif value == 0.0 and _works(log, name):
            action = "reported and kept, so that its energies are zero; check the sensor, and which column is read"
            _report(
                log,
                "dead_channel",
                name,
                f"{name} is zero through the whole log while its stage works",
                action,
            )
        elif value != 0.0 and not log.by_line and len(constant) < len(used):
            channel = log.rig.known_channels[name]
            what = f"{name} holds one value, {text_of(channel, value)} {channel.unit}, through the log while others change"
            _report(log, "stuck", name, what, "reported and kept")


def leave_out(log: Samples, name: str, action: str) -> None:
    """Leave out a channel that holds one value throughout."""
    dead = not np.any(np.nan_to_num(log.channels.pop(name)))
    log.lost.pop(name, None)
    what = f"{name} {'is zero' if dead else 'holds one value'} through the whole log while the line moves"
    _report(log, "dead_channel" if dead else "stuck", name, what, action, removed=True)


def _report(
    log: Samples, kind: FindingKind, name: str, what: str, action: str, *, removed: bool = False
) -> None:
    """Report a whole channel."""
    ends, n = (float(log.t[0]), float(log.t[-1])), log.t.size
    repair = Repair(action, n, (ends,)) if removed else None
    log.findings.append(Finding(kind, what, action, name, *ends, n, n * removed, repair=repair))


def _works(log: Samples, name: str) -> bool:
    """Whether the stage of a channel of zeros works: the other channels of its power are there, and
    so is the power of another stage, where one is known. A motion is dead only if a stage
    downstream has a power.
    """
    stages = log.stages()
    own = [k for k, stage in enumerate(stages) if name in stage]
    if not own:
        return False
    if name in MAY_HOLD:
        return any(_delivers(log, stage) for stage in stages[own[-1] + 1 :])
    others, beside = (
        [stage for stage in stages if name not in stage],
        [other for other in stages[own[0]] if other != name],
    )
    works = all(
        log.motion().any() if other in MAY_HOLD else np.any(log.channels[other]) for other in beside
    )
    return works and (
        any(_delivers(log, stage) for stage in others) or (not others and bool(beside))
    )


def _delivers(log: Samples, stage: tuple[str, ...]) -> bool:
    """Whether the power of a stage contains more than noise about zero."""
    watts = np.prod([log.channels[name] for name in stage], axis=0)
    watts = watts[np.isfinite(watts)]
    error = (
        float(np.std(np.diff(watts))) / math.sqrt(2.0 * watts.size) if watts.size > 1 else math.inf
    )
    return abs(float(watts.mean())) > CLEAR * error if watts.size else False


def row_keys(channels: Iterable[Signal]) -> Signal:
    """A number for each row of some channels, (n,), which rows have in common that are equal, and
    others but for chance.
    """
    return np.asarray(sum(math.cos(k) * x for k, x in enumerate(channels, 1)))


def repeated_rows(log: Samples) -> None:
    """Report stretches of rows that equal earlier ones in all channels; they are kept, as the log
    does not show which count.

    Only logs with a noisy channel are searched: without noise, equal cycles are equal in every
    digit. Where the displacement is logged, it jumps back, which the check of the clock reports.
    """
    channels, n = [*log.channels.values()], log.t.size
    if n > MAX_ROWS or not any(is_noisy(np.diff(x[:ENOUGH])) for x in channels):
        return
    key = row_keys(channels)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    later = np.zeros(n, dtype=np.intp)  # by how many rows the earlier one of a pair lies before
    later[order[same + 1]] = order[same + 1] - order[same]
    twice: Mask = np.zeros(n, dtype=bool)
    for a, b in pairwise(np.flatnonzero(np.diff(later, prepend=0, append=0)).tolist()):
        changes = any(
            2 * np.count_nonzero(np.diff(x[a:b])) > b - a for x in channels
        )  # rests may repeat
        twice[a:b] = later[a] > 1 and b - a >= MIN_REPEATS and changes
    if twice.any():
        rows = np.flatnonzero(twice)
        what = f"{rows.size} rows equal earlier ones in every channel: they were written twice; check how the file was made"
        start, end = log.t[rows[[0, -1]]].tolist()
        log.findings.append(
            Finding(
                "repeated_rows", what, "reported and kept", start=start, end=end, count=rows.size
            )
        )
