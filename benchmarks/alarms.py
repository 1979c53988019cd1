"""How often each sign of a diagnosis rings where the right model is known, on rigs of all sizes
and at all rates and noises: python benchmarks/alarms.py --out FILE

In every second campaign nothing is injected, in the others one effect. The injected effect alone is
suspected, so that what remains is noise, tolerances, and the law of the effect in another form. A
line of JSON for each campaign is added to FILE, so that the run can be interrupted; --score prints
the table of what is there.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import msgspec
import numpy as np
from campaigns import Case
from families import plan_case
from scipy.stats import binomtest
from trials import make_case

from winchcascade.batch.campaign_diagnosis import diagnose_listed
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.jobs import one_thread_each
from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.judge.alarms import SIGNS
from winchcascade.diagnosis.verdict_limits import SELDOM
from winchcascade.rig.effects.catalogue import EFFECTS

FAMILIES = ("machines_nothing", "machines", "nothing", "single")
"""Families of the campaigns, in turn."""

REPEATS_MAX = 2
"""Most repeats of the loads in a campaign that is judged: further ones take hours. [1]"""

OF_NOISE = ("noise", "noise and model")
"""Units of signs whose sizes are ratios; the others are in standard uncertainties or shares."""

Sizes = dict[str, list[tuple[float, float]]]
"""Size and limit of every comparison, by kind of sign."""


class Line(msgspec.Struct, frozen=True):
    """One campaign and its comparisons."""

    family: str
    number: int
    sizes: Sizes


def sizes_of(case: Case) -> Sizes:
    """Comparisons in one campaign."""
    with tempfile.TemporaryDirectory() as folder:
        make_case(case, Path(folder))
        campaign = load_campaign(Path(folder) / case.family / case.name / "campaign.toml")
        found = diagnose_listed(campaign, {name: EFFECTS[name] for name in case.effects})
    if not isinstance(found, ModelDiagnosis):
        raise TypeError(f"{case.name}: expected a rig with a machine")
    return {
        sign.kind: [
            (float(f"{one.size:.4g}"), float(f"{one.limit:.4g}"))
            for one in sign.of(found.judged)
            if math.isfinite(one.limit)
        ]
        for group in SIGNS
        for sign in group
    }


def table(lines: Sequence[Line]) -> str:
    """For each sign the share of the campaigns in which it rings, with its 95 % interval, its
    comparisons in a campaign, the median and the most of the largest ones, and the limit that
    `SELDOM` of the campaigns would pass.
    """
    rows = [
        f"{'sign':<12}{'rings':>8}{'of each':>16}{'median':>8}{'most':>8}{'limit':>8}{'passed':>8}"
    ]
    rang = np.zeros(len(lines), dtype=bool)
    for sign in (sign for group in SIGNS for sign in group):
        each = [line.sizes[sign.kind] for line in lines]
        rings = np.array([any(size > limit for size, limit in own) for own in each])
        rang |= rings
        ends = binomtest(int(rings.sum()), rings.size).proportion_ci(method="wilson")
        largest = np.array([max((size for size, _ in own), default=0.0) for own in each])
        limit = max((limit for own in each for _, limit in own), default=math.nan)
        rows.append(
            f"{sign.kind:<12}{rings.mean():8.1%}{ends.low:8.1%} to {ends.high:5.1%}"
            f"{np.median(largest):8.2f}{largest.max():8.2f}{limit:8.2f}{passed(largest, ratio=sign.unit in OF_NOISE):8.2f}"
        )
    return "\n".join([*rows, f"any of {len(lines)} campaigns: {rang.mean():.1%}"])


def passed(largest: Signal, *, ratio: bool) -> float:
    """Size that the largest comparison of a campaign passes with the probability `SELDOM`, by the
    distribution of largest values (Gumbel 1958), by moments.

    Parameters
    ----------
    ratio : whether the sizes scatter by factors, so that their logarithm has this distribution
    """
    own = largest[largest > 0.0]
    x = np.log(own) if ratio else own
    if x.size < 2:
        return math.nan
    width = float(np.std(x, ddof=1)) * math.sqrt(6.0) / math.pi
    end = float(x.mean()) - width * (np.euler_gamma + math.log(-math.log1p(-SELDOM)))
    return math.exp(end) if ratio else end


def main() -> None:
    """Judge campaigns that are not in the file yet, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--last", type=int, default=100)
    parser.add_argument("--score", action="store_true")
    options = parser.parse_args()
    known = options.out.read_bytes().splitlines() if options.out.exists() else []
    lines = [msgspec.json.decode(line, type=Line) for line in known]
    if options.score:
        print(table(lines))
        return
    one_thread_each()
    done = {(line.family, line.number) for line in lines}
    for number, family in product(range(options.first, options.last + 1), FAMILIES):
        case = plan_case(family, number)
        if (family, number) not in done and case.repeats <= REPEATS_MAX:
            with options.out.open("ab") as file:
                file.write(msgspec.json.encode(Line(family, number, sizes_of(case))) + b"\n")


if __name__ == "__main__":
    main()
