"""The gate of the checks: injected faults and undamaged logs, beside the recorded figures.

`python tests/faults/gate.py` prints the table of all faults and the false findings; `--only PART`
does the faults whose name contains a part, `--list` adds each trial, `--worse` those that became
worse; `--record` stores what is found.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1])]

import contradictions  # noqa: E402, F401  registers its faults
import injected_files  # noqa: E402, F401  registers its faults
import whole_channels  # noqa: E402, F401  registers its faults
from clean import SOURCES, false_findings  # noqa: E402
from injected import FAULTS, trial  # noqa: E402
from verdicts import counts, judged, letters, names, table  # noqa: E402

RECORDED = Path(__file__).parent / "recorded.json"


def recorded() -> tuple[dict[str, str], dict[str, int]]:
    """The recorded letters by fault, and the number of logs with false findings by source of
    undamaged logs.
    """
    stored = json.loads(RECORDED.read_text(encoding="utf-8"))
    return stored["faults"], stored["clean"]


def whole(name: str) -> str:
    """All letters of a fault."""
    return letters(name, range(FAULTS[name][1]))


def main() -> int:
    """Run the program; 1 if a fault or a source of undamaged logs is worse than recorded."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only", default="", metavar="PART", help="faults whose name contains this"
    )
    parser.add_argument("--list", action="store_true", help="print every trial")
    parser.add_argument(
        "--worse", action="store_true", help="print the trials that are worse than recorded"
    )
    parser.add_argument(
        "--clean", action="store_true", help="undamaged logs alone, each false finding printed"
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--record", action="store_true", help="store what is found in recorded.json"
    )
    given = parser.parse_args()
    begun = time.perf_counter()
    before, clean_before = recorded()
    chosen = [] if given.clean else names(given.only)
    with ProcessPoolExecutor(given.jobs) as pool:
        found = dict(zip(chosen, pool.map(whole, chosen), strict=True))
        sources = [] if given.only else list(SOURCES)
        clean = dict(zip(sources, pool.map(false_findings, sources), strict=True))
    for name, row in found.items():
        print_trials(name, row, before.get(name, row), every=given.list, worse=given.worse)
    if found:
        print(table(found, before))
    for source, (logs, words) in clean.items():
        old = clean_before.get(source, len(words))
        print(
            f"{source:40}{logs:5} logs{len(words):5} with false findings"
            + (f", were {old}" if old != len(words) else "")
        )
        for text in words if given.clean else []:
            print(f"    {text}")
    worse = [name for name, row in found.items() if is_worse(row, before.get(name, row))]
    worse += [
        source
        for source, (_, words) in clean.items()
        if len(words) > clean_before.get(source, len(words))
    ]
    print(f"worse than recorded: {', '.join(worse) or 'none'}; {time.perf_counter() - begun:.0f} s")
    if given.record:
        counted = {source: len(words) for source, (_, words) in clean.items()}
        stored = {"faults": before | found, "clean": clean_before | counted}
        RECORDED.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    return 1 if worse else 0


def print_trials(name: str, found: str, before: str, *, every: bool, worse: bool) -> None:
    """Print every trial of a fault, or those that are worse than recorded: no longer found, or
    newly silent.
    """
    for k, (new, old) in enumerate(zip(found, before, strict=True)):
        if every or (worse and is_worse(new, old)):
            made = trial(name, k)
            words = f"{made.true.name} {made.true.rate:g} Hz: {made.what}: {judged(made)[1]}"
            print(f"{name} {k}: {old} {new} {words}")


SLACK = 0.05
"""Share of the trials, one at least, that may lose a finding, as those at a limit fall on either
side; none may be silent.
"""


def is_worse(found: str, before: str) -> bool:
    """Whether more trials are silent than recorded, or fewer are found by more than the slack,
    of the same trials.
    """
    new, old = counts(found), counts(before[: len(found)])
    slack = max(1.0, SLACK * len(found)) if len(found) > 1 else 0.0
    return new[4] > old[4] or old[1] - new[1] > slack


if __name__ == "__main__":
    sys.exit(main())
