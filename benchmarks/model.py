"""Print how fast the model of the rig is, measured in this one run: a campaign, the first call, and ngspice beside it.

python benchmarks/model.py [--rounds 5]
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))  # the circuit is the one that the tests hold the bridge against

from circuit import NGSPICE, seconds_of, solved_by_ngspice  # noqa: E402

from winchcascade.campaign import load_campaign  # noqa: E402
from winchcascade.ingest.read import read_run  # noqa: E402
from winchcascade.rig.model import baseline  # noqa: E402
from winchcascade.rig.simulate import simulate  # noqa: E402
from winchcascade.rigtoml import built_in  # noqa: E402

RPM, LOAD = 2000.0, 18.0
"""Operating point of the comparison with ngspice: rated speed, the paper's best load."""

FIRST_CALL = """
import sys, time
from winchcascade.ingest.read import read_run
from winchcascade.rig.model import baseline
from winchcascade.rig.simulate import simulate
from winchcascade.rigtoml import built_in
run, model = read_run(sys.argv[1], load=18.0), baseline(built_in())
start = time.perf_counter()
simulate(run, model)
print(time.perf_counter() - start)
"""


def median_seconds(work: Callable[[], object], rounds: int) -> float:
    """Median time of some calls. [s]"""
    took = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return statistics.median(took)


def first_calls(log: Path) -> tuple[float, float]:
    """Time of the first simulation of a process, the machine code not yet there, and there. [s]"""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST_CALL, str(log)]
        cold, warm = (
            float(subprocess.run(command, env=environment, cwd=ROOT, check=True, capture_output=True).stdout)
            for _ in range(2)
        )
    return cold, warm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5, help="repetitions, of which the median counts")
    rounds = parser.parse_args().rounds
    campaign = load_campaign(ROOT / "fixtures" / "campaign")
    model = baseline(built_in())
    runs = [read_run(entry.file, load=entry.load) for entry in campaign.runs]
    simulate(runs[0], model)
    simulated = sum(float(run.t[-1] - run.t[0]) for run in runs)
    took = median_seconds(lambda: [simulate(run, model) for run in runs], rounds)
    cold, warm = first_calls(campaign.runs[0].file)
    print(f"{f'campaign of {len(runs)} runs, {simulated:.0f} s of the rig':<46} {took:8.3f} s")
    print(f"{'simulated seconds a second':<46} {simulated / took:8.0f}")
    print(f"{'first simulation, machine code to be made':<46} {cold:8.2f} s")
    print(f"{'first simulation, machine code kept':<46} {warm:8.2f} s")
    if NGSPICE is None:
        print("ngspice: skipped, as it is not on the path (apt-get install ngspice)")
        return
    span = seconds_of(RPM, LOAD)
    slow = median_seconds(lambda: solved_by_ngspice(RPM, LOAD), rounds)
    print(f"{f'ngspice at {RPM:g} rpm and {LOAD:g} ohm, {span:.2f} s of the rig':<46} {slow:8.3f} s")
    print(f"{'the same time of the rig by the model':<46} {took / simulated * span:8.5f} s")
    print(f"{'ngspice / model':<46} {slow / (took / simulated * span):8.0f}")


if __name__ == "__main__":
    main()
