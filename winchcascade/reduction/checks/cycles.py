"""Whether the cycles of a log are cycles of their own and alike, and their powers and efficiencies possible."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import ENOUGH, GAUSS, median, smallest_step, white_noise
from winchcascade.core.run import Signal
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, Fault, PhasedLog
from winchcascade.reduction.efficiency import NOTHING, ratio
from winchcascade.reduction.phased_run import travel_in

IMPLAUSIBLE = 0.01
"""Below this efficiency of all cycles together a unit is more probable than a loss: a prefix changes it by a thousand. [1]"""

OPPOSED = 0.5
"""Smallest correlation of two powers, taken negative, that shows a wrong sign: what a spring or a mass between two stages
exchanges is out of phase by a quarter of a period. [1]"""

STROKE = 0.01
"""Repeatability of a stroke: standard deviation of travel, and of travel over speed in a window, by a crane. [1]"""

REVERSED = 0.5
"""Share of the fourth differences that reverse the one before, from which a channel has noise: smooth ones hardly do. [1]"""


def opposed_powers(log: PhasedLog) -> Iterator[Fault]:
    """Neighbouring stages whose powers anticorrelate over the log: the one is positive while the other is negative.

    The scatter of the inverse hyperbolic tangent of a correlation is normal (Fisher).
    """
    run, rig = log.phased.run, log.phased.rig
    some = slice(None, None, max(1, run.t.size // ENOUGH))
    stages = [stage for stage in rig.cascade.stages if stage.power(run.channels, rig.r_drum) is not None]
    powers = [(stage, watts(some)) for stage in stages if (watts := stage.stream(run.channels, rig.r_drum)) is not None]
    for (one, x), (other, y) in pairwise(powers):
        size = float(np.linalg.norm(x) * np.linalg.norm(y))
        together = float(x @ y) / size if size > 0.0 else 0.0
        if together <= -OPPOSED and math.atanh(max(together, -0.999999)) * math.sqrt(x.size) <= -CERTAIN:
            made = [stage.power(run.channels, rig.r_drum) for stage in (one, other)]
            texts = dict(zip(("first", "second"), [power.text if power else "" for power in made], strict=True))
            yield Fault("opposed", None, {"one": one.name, "other": other.name, "share": together, **texts})


def odd_ratios(log: PhasedLog) -> Iterator[Fault]:
    """Efficiencies outside 0 to 1, of power that flows against the cascade, or as small as by a wrong unit.

    Of waves all together count: a single wave may take energy from the gas, or leave energy in it.
    """
    run, rig, results = log.phased.run, log.phased.rig, log.results
    cascade, whole, waves = rig.cascade, [c for c in results if c.complete], rig.phases.source == "waves"
    for name, (out, into) in cascade.ratios.items():
        if run.open_circuit and cascade.undelivered(name):
            continue
        sums = [sum(c.metrics[energy] or 0.0 for c in whole) for energy in (out, into)]
        given = [(1, sums[0], sums[1])] if waves else [(c.cycle, c.metrics[out], c.metrics[into]) for c in results]
        ratios = [(cycle, value) for cycle, got, put in given if got != 0.0 and (value := ratio(got, put)) is not None]
        for fault, odd in (
            ("above_one", [r for r in ratios if r[1] > 1.0]),
            ("below_zero", [r for r in ratios if r[1] < 0.0]),
        ):
            if odd:
                yield _of_cycles(fault, name, odd, waves=waves)
        if name == cascade.overall and len(cascade.stages) > 2:
            continue
        if not waves:
            given = [(c.cycle, c.metrics[out] or 0.0, c.metrics[into] or 0.0) for c in whole]
        against = [(n, put) for n, got, put in given if put is not None and got and put < -NOTHING < abs(got)]
        if against:
            first = next(stage for stage in cascade.stages if stage.name == cascade.pairs[name][0])
            product = first.power(run.channels, rig.r_drum) or first.powers[0]
            yield _of_cycles(
                "against", name, against, waves=waves, stage=first.name, channels=" and ".join(product.channels)
            )
        together = ratio(*sums)
        if together is not None and 0.0 < together < IMPLAUSIBLE:
            yield Fault("too_small", None, {"name": name, "value": together})
    net = [(c.cycle, value) for c in results if (value := c.metrics["eta_net"] or 0.0) > 1.0]
    if net and not waves:
        yield _of_cycles("above_one", "eta_net", net, waves=False)


def _of_cycles(fault: str, name: str, odd: list[tuple[int, float]], *, waves: bool, **values: str) -> Fault:
    """A fault of some cycles, with the value that is farthest off."""
    cycle, value = max(odd, key=lambda place: abs(place[1]))
    where = "of all waves together" if waves else f"in {len(odd)} cycle{'s' if len(odd) > 1 else ''}"
    place = "" if waves else f" in cycle {cycle}"
    return Fault(fault, None, {"name": name, "where": where, "value": value, "place": place, **values}, places=len(odd))


def copied_cycles(log: PhasedLog) -> Iterator[Fault]:
    """Cycles whose samples equal those of an earlier one in every channel but the displacement: rows that were pasted again.

    Without noise, equal cycles are equal in every digit; only a log with a noisy channel shows a copy.
    """
    phased, results = log.phased, [c for c in log.results if c.complete]
    channels = {name: x for name, x in phased.run.channels.items() if name != "displacement"}
    if len(results) < 2 or any(f.kind == "repeated_rows" for f in phased.run.findings):
        return
    weights = np.random.default_rng(0).uniform(
        1.0, 2.0, len(channels)
    )  # rows that differ have other sums, but for chance
    seen: list[Signal] = []
    copies = []
    for cycle in results:
        rows = phased.rows(cycle.window.onset, cycle.window.cutoff)
        parts = np.array([x[rows] for x in channels.values()])
        noisy = parts.shape[1] > MIN_COMPARED and any(has_noise(x) for x in parts)
        sums = weights @ parts
        if noisy and any(np.count_nonzero(np.isin(sums, other)) > 0.5 * sums.size for other in seen):
            copies.append(cycle)
        seen.append(sums)
    if copies:
        numbers, spans = ", ".join(str(c.cycle) for c in copies), [(c.window.onset, c.window.cutoff) for c in copies]
        yield Fault("copied", None, {"cycles": numbers, "some": len(copies), "all": len(results)}, spans=spans)


def has_noise(x: Signal) -> bool:
    """Whether a channel has noise beyond its resolution, which reverses nearly every difference of the fourth order."""
    change = np.diff(x, 4)
    return white_noise(x) > smallest_step(x) and float(np.mean(change[1:] * change[:-1] < 0.0)) > REVERSED


def uneven_strokes(log: PhasedLog) -> Iterator[Fault]:
    """Payouts with a stop in their windows that the others do not have; with the window payout those of another travel.

    A stop costs a share of the travel that the line would have had, had it kept the speed that it had reached. The others
    deviate by no more than their repeatability, of a crane or in the log itself.
    """
    phased, results = log.phased, [c for c in log.results if c.complete]
    windows, travel = [(c.window.onset, c.window.cutoff) for c in results], np.array(phased.travel)
    if len(results) < 2 or (travel.size > 3 and GAUSS * median(np.abs(travel / median(travel) - 1.0)) > 10.0 * STROKE):
        return  # strokes that never repeat, as of waves
    if phased.rule == "payout":
        fault, x = "other_stroke", np.array(travel_in(phased.run, np.reshape(windows, (-1, 2))))
    else:
        speeds = [phased.v_smooth[phased.rows(*window)] for window in windows]
        fault, x = (
            "stopped",
            np.array([float(v.sum()) / max(float(np.maximum.accumulate(v).sum()), 1e-9) for v in speeds]),
        )
    usual = np.array([median(np.delete(x, k)) for k in range(x.size)])
    scatter = np.array([GAUSS * median(np.abs(np.delete(x, k) - middle)) for k, middle in enumerate(usual)])
    odd = np.flatnonzero(np.abs(x - usual) > CERTAIN * np.maximum(scatter, STROKE * usual))
    if odd.size:
        worst = odd[np.argmax(np.abs(x - usual)[odd])]
        values = {"all": x.size, "cycle": results[worst].cycle, "value": x[worst], "usual": usual[worst]}
        yield Fault(fault, None, values, spans=[windows[k] for k in odd])
