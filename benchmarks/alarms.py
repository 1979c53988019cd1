"""How often each sign of a diagnosis rings on rigs of all sizes where the right model is known:
python benchmarks/alarms.py --out FILE

In every second campaign nothing is injected, in the others one effect. The injected effect alone is
suspected, so that what remains is noise, tolerances, and the law of the effect in another form. A
line of JSON for each campaign is added to FILE, so that the run can be interrupted; --score prints
the table of what is there.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from families import plan_case
from trials import make_case

from winchcascade.batch.campaign_diagnosis import diagnose_listed
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.jobs import one_thread_each
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.judge.alarms import SIGNS
from winchcascade.rig.effects.catalogue import EFFECTS

FAMILIES = ("machines_nothing", "machines")
"""Families of the campaigns, in turn."""


def sizes_of(number: int) -> dict[str, list[list[float]]]:
    """Size and limit of every comparison in one campaign, by kind of sign."""
    with tempfile.TemporaryDirectory() as folder:
        case = plan_case(FAMILIES[number % 2], number)
        make_case(case, Path(folder))
        campaign = load_campaign(Path(folder) / case.family / case.name / "campaign.toml")
        found = diagnose_listed(campaign, {name: EFFECTS[name] for name in case.effects})
    if not isinstance(found, ModelDiagnosis):
        raise TypeError(f"{case.name}: expected a rig with a machine")
    return {
        sign.kind: [
            [float(f"{one.size:.4g}"), float(f"{one.limit:.4g}")] for one in sign.of(found.judged)
        ]
        for group in SIGNS
        for sign in group
    }


def table(lines: list[dict[str, float]]) -> str:
    """Share of the campaigns in which each sign rings, and quantiles of its largest comparison
    over the limit.
    """
    rows = [
        f"{'sign':<12}{'rings':>8}{'median':>8}{'95 %':>8}{'99 %':>8}{'most':>8}   of the limit, "
        f"{len(lines)} campaigns"
    ]
    for sign in (sign for group in SIGNS for sign in group):
        x = np.array([line[sign.kind] for line in lines])
        quantiles = "".join(f"{q:8.2f}" for q in np.quantile(x, (0.5, 0.95, 0.99, 1.0)))
        rows.append(f"{sign.kind:<12}{np.mean(x > 1.0):8.1%}{quantiles}   {sign.compares}")
    any_rings = np.mean([max(line.values()) > 1.0 for line in lines])
    return "\n".join([*rows, f"{'any':<12}{any_rings:8.1%}"])


def main() -> None:
    """Judge campaigns that are not in the file yet, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--last", type=int, default=400)
    parser.add_argument("--score", action="store_true")
    options = parser.parse_args()
    known = options.out.read_text(encoding="utf-8").splitlines() if options.out.exists() else []
    lines = {entry["number"]: entry["sizes"] for entry in map(json.loads, known)}
    if options.score:
        print(table([*lines.values()]))
        return
    one_thread_each()
    for number in range(options.first, options.last + 1):
        if number not in lines:
            entry = {"number": number, "sizes": sizes_of(number)}
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(entry) + "\n")


if __name__ == "__main__":
    main()
