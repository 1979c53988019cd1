"""Print how fast the model of the rig is: a campaign beside ngspice, and the first call.

python benchmarks/model.py [--quick] [--pairs 3]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from measure import CAMPAIGN, LOG, ROOT, Row, Sizes, main, median_seconds, python

sys.path.insert(0, str(ROOT / "tests"))  # the circuit is the one that the tests hold the bridge against

from circuit import NGSPICE, seconds_of, solved_by_ngspice

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.simulate import simulate

RPM, LOAD = 2000.0, 18.0
"""Operating point of the comparison with ngspice: rated speed, the paper's best load."""

FIRST_CALL = """
import sys, time
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.simulate import simulate
run, model = read_run(sys.argv[1], load=18.0), baseline(built_in())
start = time.perf_counter()
simulate(run, model)
print(time.perf_counter() - start)
"""


def first_calls() -> tuple[float, float]:
    """Time of the first simulation of a process, the machine code not yet there, and there. [s]"""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        cold, warm = (
            float(subprocess.run(python(FIRST_CALL, LOG), env=environment, check=True, capture_output=True).stdout)
            for _ in range(2)
        )
    return cold, warm


def campaign_seconds(campaign: Path, rounds: int) -> tuple[float, float]:
    """Time that simulating every log of a campaign once takes, and how long the rig itself runs in them. [s]"""
    model = baseline(built_in())
    runs = [read_run(entry.file, load=entry.load) for entry in load_campaign(campaign).runs]
    simulate(runs[0], model)
    took = median_seconds(lambda: [simulate(run, model) for run in runs], rounds)
    return took, sum(float(run.t[-1] - run.t[0]) for run in runs)


def ngspice_speed(rounds: int) -> float:
    """Seconds of the generator's circuit that ngspice simulates in one of ours, at one operating point."""
    return seconds_of(RPM, LOAD) / median_seconds(lambda: solved_by_ngspice(RPM, LOAD), rounds)


def rows(sizes: Sizes) -> Iterator[Row]:
    """Measure the shipped campaign, its speed beside that of ngspice, and, if asked for more than one pair, the first call."""
    took, simulated = campaign_seconds(CAMPAIGN, max(3, sizes.pairs))
    spice, beside = (None, "ngspice: not installed") if NGSPICE is None else (ngspice_speed(sizes.pairs), "ngspice")
    yield Row(
        f"simulate 7 logs, {simulated:.0f} s of the rig", simulated / took, spice, "s/s", f"{beside}, the circuit alone"
    )
    if sizes.pairs > 1:
        cold, warm = first_calls()
        yield Row("first simulation of an installation", cold, warm, "s", "first of a process")


if __name__ == "__main__":
    main("Print how fast the model of the rig is.", rows)
