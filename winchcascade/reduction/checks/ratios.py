"""Efficiencies above 1 or below 0, of power that flows against the cascade, or as small as by a wrong unit.

Powers of two stages of which one flows forth while the other flows back have a wrong sign.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.cascade import Cascade
from winchcascade.core.integrate import ENOUGH
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Run
from winchcascade.reduction.efficiency import NOTHING, ratio
from winchcascade.reduction.reduction_result import CycleResult

IMPLAUSIBLE = 0.01
"""Below this efficiency of all cycles together a unit is more probable than a loss: a prefix changes it by a thousand. [1]"""

OPPOSED = 0.5
"""Smallest correlation of two powers, taken negative, that shows a wrong sign: what a spring or a mass between two stages
exchanges is out of phase by a quarter of a period. [1]"""

LARGEST = 0.999999
"""Correlation whose inverse hyperbolic tangent, by which its scatter is normal (Fisher), is still finite. [1]"""

Place = tuple[int, float]
"""Number of a cycle, and a value there."""


def ratio_findings(
    results: Sequence[CycleResult], odd: Mapping[str, Sequence[Place]], run: Run, rig: Rig
) -> list[Finding]:
    """Report efficiencies above 1, and those that are none, with the reason of those without a value.

    Parameters
    ----------
    odd : ratios outside 0 to 1, by their name
    """
    cascade, open_circuit = rig.cascade, run.open_circuit
    if rig.phases.source == "waves":  # a single wave may take energy from the gas, or leave energy in it
        sums = {name: sum(c.metrics[name] or 0.0 for c in results if c.complete) for name in cascade.energies}
        findings = _odd_ratios_of_sums(sums, cascade, open_circuit=open_circuit)
        places = {name: [(1, joule)] for name, joule in sums.items()}
        of = "of all waves together"
    else:
        findings = [finding for name, found in odd.items() for finding in _outside(name, found)]
        places = {name: [(c.cycle, c.metrics[name] or 0.0) for c in results if c.complete] for name in cascade.energies}
        of = ""
    for name, (out, into) in cascade.ratios.items():
        if (name == cascade.overall and len(cascade.stages) > 2) or (open_circuit and cascade.undelivered(name)):
            continue
        findings += _against(name, places[into], places[out], _remedy(cascade.between(name)[0], run, rig), of)
        findings += _too_small(name, places[into], places[out])
    return findings


def sign_findings(run: Run, rig: Rig) -> list[Finding]:
    """Report neighbouring stages whose powers anticorrelate over the log: the one is positive while the other is negative."""
    some = slice(None, None, max(1, run.t.size // ENOUGH))
    logged = {stage.name: stage.power(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    streams = {stage.name: stage.stream(run.channels, rig.r_drum) for stage in rig.cascade.stages}
    powers = {name: stream(some) for name, stream in streams.items() if stream is not None}
    found = []
    for (one, x), (other, y) in pairwise(powers.items()):
        size = float(np.linalg.norm(x) * np.linalg.norm(y))
        together = float(x @ y) / size if size > 0.0 else 0.0
        if not (together <= -OPPOSED and math.atanh(max(together, -LARGEST)) * math.sqrt(x.size) <= -CERTAIN):
            continue
        names = [p.text for p in (logged[one], logged[other]) if p is not None]
        message = (
            f"the powers of {one} ({names[0]}) and {other} ({names[1]}) have opposite signs: their correlation over the log is "
            f"{together:.2f}"
        )
        action = (
            "reported and kept; check the signs of these channels, and state a minus sign under [stage] of the rig file"
        )
        found.append(Finding("sign_mismatch", message, action))
    return found


def _odd_ratios_of_sums(sums: Mapping[str, float], cascade: Cascade, *, open_circuit: bool) -> list[Finding]:
    """Report efficiencies of all complete waves together that lie outside 0 to 1."""
    found = []
    for name, (out, into) in cascade.ratios.items():
        value = ratio(sums[out], sums[into])
        if value is not None and not 0.0 <= value <= 1.0 and not (open_circuit and cascade.undelivered(name)):
            found.append(_odd(name, "of all waves together", value, "", 1))
    return found


def _outside(name: str, places: Sequence[Place]) -> Iterable[Finding]:
    """Report the cycles whose efficiency is above 1, and those whose ratio is below 0, each with the one farthest off."""
    for above in (True, False):
        chosen = [place for place in places if (place[1] > 1.0) == above]
        if chosen:
            number, value = max(chosen, key=lambda place: abs(place[1]))
            where = f"in {len(chosen)} cycle{'s' if len(chosen) > 1 else ''}"
            yield _odd(name, where, value, f" in cycle {number}", len(chosen))


def _odd(name: str, where: str, value: float, place: str, count: int) -> Finding:
    """The finding on a ratio outside 0 to 1: one above 1 is a result, one below 0 is no efficiency."""
    check = "check unit, gain and sign of what it is made of"
    if value > 1.0:
        message = f"{name} is above 1 {where} ({value:.4f}{place}); unless its uncertainty contains 1, {check}"
        return Finding("efficiency_above_one", message, "reported and kept", count=count)
    message = f"{name} lies below 0 {where} ({value:.3f}{place}); {check}"
    return Finding("out_of_range", message, "not reported", count=count)


def _against(name: str, into: Sequence[Place], out: Sequence[Place], remedy: str, of: str) -> Iterable[Finding]:
    """Report cycles without an efficiency because the stage that power comes from has a negative energy."""
    places = [place for place, (_, got) in zip(into, out, strict=True) if place[1] < -NOTHING and abs(got) > NOTHING]
    if not places:
        return
    number, joule = min(places, key=lambda place: place[1])
    where = of or f"in {len(places)} cycle{'s' if len(places) > 1 else ''}"
    size = f"{float(f'{joule:.4g}'):g} J" + ("" if of else f" in cycle {number}")
    yield Finding(
        "out_of_range",
        f"{name} has no value {where}, as the energy that comes in is negative ({size}): power flows against the cascade; "
        f"{remedy}",
        "not reported",
        count=len(places),
    )


def _too_small(name: str, into: Sequence[Place], out: Sequence[Place]) -> Iterable[Finding]:
    """Report an efficiency of all cycles together that no unit but a wrong one gives to a machine that runs loaded."""
    value = ratio(sum(joule for _, joule in out), sum(joule for _, joule in into))
    if value is not None and 0.0 < value < IMPLAUSIBLE:
        yield Finding(
            "out_of_range",
            f"{name} is {value:.2g} of all cycles together: check the units of what it is made of, unless the machine runs "
            "without a load",
            "reported and kept",
        )


def _remedy(name: str, run: Run, rig: Rig) -> str:
    """What to check of a stage whose power flows against the cascade."""
    stage = next(stage for stage in rig.cascade.stages if stage.name == name)
    product = stage.power(run.channels, rig.r_drum) or stage.powers[0]
    return (
        f"check the sign of {' and '.join(product.channels)} and the order of the stages, or state a power of the opposite "
        f"sign under [stage.{name}] of the rig file"
    )
