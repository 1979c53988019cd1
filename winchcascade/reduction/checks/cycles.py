"""Whether the cycles of a log are cycles of their own and alike, and their powers and
efficiencies possible.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import (
    ENOUGH,
    GAUSS,
    distinct,
    median,
    medians_of_others,
)
from winchcascade.core.plain_text import numbers_text
from winchcascade.ingest.checks.sensors import is_noisy, row_keys
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.efficiency import SMALLEST, ratio
from winchcascade.reduction.phased_run import travel_in

IMPLAUSIBLE = 0.01
"""Below this efficiency of all cycles together a unit is more probable than a loss: a prefix
changes it by a thousand. [1]
"""

OPPOSED = 0.5
"""Smallest correlation of two powers, taken negative, that shows a wrong sign: what a spring or a
mass between two stages exchanges is out of phase by a quarter of a period. [1]"""

STROKE = 0.01
"""Repeatability of a stroke: standard deviation of travel, and of travel over speed in a window,
by a crane. [1]
"""


def opposed_powers(log: PhasedLog) -> Iterator[Fault]:
    """Neighbouring stages whose powers anticorrelate over the log: the one is positive while the
    other is negative.

    The scatter of the inverse hyperbolic tangent of a correlation is normal (Fisher).
    """
    some, channels, radius = (
        slice(None, None, max(1, log.run.t.size // ENOUGH)),
        log.run.channels,
        log.rig.r_drum,
    )
    known = log.rig.cascade.powers(channels, radius)
    watts = [(name, power, power.stream(channels, radius)(some)) for name, power in known.items()]
    for (one, first, x), (other, second, y) in pairwise(watts):
        size = float(np.linalg.norm(x) * np.linalg.norm(y))
        share = float(x @ y) / size if size > 0.0 else 0.0
        if share <= -OPPOSED and math.atanh(max(share, -0.999999)) * math.sqrt(x.size) <= -CERTAIN:
            values = {
                "one": one,
                "other": other,
                "first": first.text,
                "second": second.text,
                "share": share,
            }
            yield Fault("opposed", None, (), values)


def odd_ratios(log: PhasedLog) -> Iterator[Fault]:
    """Efficiencies outside 0 to 1, of power that flows against the cascade, or as small as by a
    wrong unit.

    Of waves all together count: a single wave may take energy from the gas, or leave energy in it.
    """
    cascade, waves = log.rig.cascade, log.rig.phases.source == "waves"
    for name, (out, into) in cascade.ratios.items():
        if log.run.open_circuit and cascade.undelivered(name):
            continue
        stage = next(s for s in cascade.stages if s.name == cascade.pairs[name][0])
        power = stage.power(log.run.channels, log.rig.r_drum) or stage.powers[0]
        got, put = (sum(c.metrics[energy] or 0.0 for c in log.complete) for energy in (out, into))
        each = [
            (f"cycle {c.cycle}", c.metrics[out] or 0.0, c.metrics[into] or 0.0) for c in log.results
        ]
        tested = [("all waves together", got, put)] if waves else each
        known = [of for of in tested if of[1] and abs(of[2]) > log.energies.nothing]
        across = name == cascade.overall and len(cascade.stages) > 2
        for fault, odd in (
            ("above_one", [of for of in known if of[1] > of[2] > 0.0]),
            ("below_zero", [of for of in known if of[1] < 0.0 < of[2]]),
            ("against", [of for of in known if of[2] < 0.0 and not across]),
        ):
            if odd:
                place, joules, given = max(odd, key=lambda of: abs(of[1] / of[2]))
                values = {
                    "name": name,
                    "place": place,
                    "value": joules / given,
                    "put": given,
                    "stage": stage.name,
                }
                yield Fault(
                    fault, None, (), {**values, "channels": " and ".join(power.channels)}, len(odd)
                )
        if 0.0 < (ratio(got, put) or 0.0) < IMPLAUSIBLE:
            yield Fault("too_small", None, (), {"name": name, "value": got / put})
    net = [
        (value, f"cycle {c.cycle}")
        for c in log.results
        if (value := c.metrics["eta_net"] or 0.0) > 1.0
    ]
    if net and not waves:
        yield Fault(
            "above_one",
            None,
            (),
            {"name": "eta_net", "value": max(net)[0], "place": max(net)[1]},
            len(net),
        )


def copied_cycles(log: PhasedLog) -> Iterator[Fault]:
    """Cycles whose samples equal those of an earlier one in every channel but the displacement:
    rows that were pasted again.

    Without noise, equal cycles are equal in every digit; only a log with a noisy channel shows a
    copy.
    """
    channels = {name: x for name, x in log.run.channels.items() if name != "displacement"}
    if len(log.complete) < 2 or any(f.kind == "repeated_rows" for f in log.run.findings):
        return
    if not any(is_noisy(np.diff(x[:ENOUGH])) for x in channels.values()):
        return
    windows = [(c.window.onset, c.window.cutoff) for c in log.complete]
    rows = [log.phased.rows(*window) for window in windows]
    every = np.concatenate([row_keys(x[part] for x in channels.values()) for part in rows])
    sizes = [part.stop - part.start for part in rows]
    of_cycle = np.repeat(np.arange(len(rows), dtype=np.int32), sizes)
    order = np.argsort(every, kind="stable")
    every = every[order]
    begins = np.append(0, np.flatnonzero(every[1:] != every[:-1]) + 1)
    if begins.size >= every.size:
        return
    first = np.empty_like(of_cycle)  # of the cycles that hold an equal row
    first[order] = np.repeat(of_cycle[order[begins]], np.diff(begins, append=every.size))
    copies = []
    for k, seen_in in enumerate(np.split(first, np.cumsum(sizes[:-1]))):
        # A cycle that holds more than half of the samples is in the middle of their order.
        original = int(np.sort(seen_in)[seen_in.size // 2]) if seen_in.size else k
        equal = np.count_nonzero(seen_in == original)
        if original < k and 2 * equal > seen_in.size:
            copies.append(k)
    if copies:
        numbers = numbers_text(log.complete[k].cycle for k in copies)
        values = {"cycles": numbers, "all": len(windows)}
        yield Fault("copied", None, [windows[k] for k in copies], values)


def uneven_strokes(log: PhasedLog) -> Iterator[Fault]:
    """Payouts with a stop in their windows that the others do not have; with the window payout
    those of another travel.

    A stop costs a share of the travel that the line would have had, had it kept the speed that it
    had reached. The others deviate by no more than their repeatability, of a crane or in the log
    itself, and than a ripple of their speed explains, of which a window holds any part.
    """
    windows, travel = (
        [(c.window.onset, c.window.cutoff) for c in log.complete],
        np.array(log.phased.travel),
    )
    if len(windows) < 2 or (
        travel.size > 3 and GAUSS * median(np.abs(travel / median(travel) - 1.0)) > 10.0 * STROKE
    ):
        return  # strokes that never repeat, as of waves
    fault, x = "other_stroke", np.array(travel_in(log.run, np.reshape(windows, (-1, 2))))
    repeats = STROKE
    if log.phased.rule != "payout":
        plateaus = [(p.begin, p.braking) for p in log.phased.plateaus if p is not None]
        steady = [log.phased.v_smooth[log.phased.rows(*plateau)] for plateau in plateaus]
        ripples = [float(np.std(v) / np.mean(v)) for v in steady if v.size]
        repeats = max(STROKE, min(ripples, default=0.0))
        speeds = [log.phased.v_smooth[log.phased.rows(*window)] for window in windows]
        kept = [
            float(v.sum()) / max(float(np.maximum.accumulate(v).sum()), SMALLEST) for v in speeds
        ]
        fault, x = "stopped", np.array(kept)
    usual, scatter = medians_of_others(x), np.empty(x.size)
    for middle in distinct(usual):
        same = usual == middle
        scatter[same] = GAUSS * medians_of_others(np.abs(x - middle))[same]
    odd = np.flatnonzero(np.abs(x - usual) > CERTAIN * np.maximum(scatter, repeats * usual))
    if odd.size:
        worst = odd[np.argmax(np.abs(x - usual)[odd])]
        values = {
            "all": x.size,
            "cycle": log.complete[worst].cycle,
            "value": x[worst],
            "usual": usual[worst],
        }
        yield Fault(fault, None, [windows[k] for k in odd], values)
