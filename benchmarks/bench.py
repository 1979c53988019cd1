"""Print every ratio in one table, measured in one run: start-up, logs, reports, batches, the model,
diagnoses.

python benchmarks/bench.py [--part logs|batch|model|diagnose] [--quick]

Both sides of a ratio run in turn as processes of their own; medians are printed. The script with
pandas finds means alone.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
CAMPAIGN = ROOT / "fixtures" / "campaign"
LOG = CAMPAIGN / "r36ohm.csv"


class Sizes(NamedTuple):
    """How much is measured: runs of what lasts less than a second, runs of the rest, rows of the
    long log, logs of the batch, blind cases, and repeats of the seven loads in a long campaign.
    """

    starts: int
    runs: int
    rows: int
    logs: int
    cases: int
    repeats: tuple[int, ...]


FULL = Sizes(starts=15, runs=3, rows=14_000_000, logs=1000, cases=8, repeats=(10, 20))
QUICK = Sizes(starts=1, runs=1, rows=200_000, logs=20, cases=1, repeats=())


class Used(NamedTuple):
    """What a process took: time [s], and the most memory it held [MB]."""

    seconds: float
    memory: float


Rows = Iterator[tuple[str, float, float | None, str]]
"""What was measured, ours, the other, and what the other is."""


def winchcascade(*arguments: str | Path) -> list[str]:
    """The command line of this tool."""
    return [sys.executable, "-m", "winchcascade", *map(str, arguments)]


def script(name: str, *arguments: str | Path) -> list[str]:
    """The command line of a file beside this one."""
    return [sys.executable, str(ROOT / "benchmarks" / name), *map(str, arguments)]


def timed(command: Sequence[str]) -> Used:
    """Run a process to its end; the benchmark ends if it fails."""
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return Used(time.perf_counter() - begin, usage.ru_maxrss / 1024)


def pair(ours: Sequence[str], other: Sequence[str], count: int) -> tuple[Used, Used]:
    """Run two commands A B A B ..., after one pair that fills the caches; median times and the
    most memory of each.
    """
    if count > 1:
        timed(other), timed(ours)
    runs = [(timed(ours), timed(other)) for _ in range(count)]
    sides = [[run[k] for run in runs] for k in (0, 1)]
    mine, others = (
        Used(statistics.median(u.seconds for u in side), max(u.memory for u in side))
        for side in sides
    )
    return mine, others


def logs(sizes: Sizes, folder: Path) -> Rows:
    """Start-up, one log, its reports, and a log of many hours, beside a script with pandas."""
    imports = [sys.executable, "-c", "import typer, numpy, pyarrow.csv"]
    pandas = script("with_pandas.py", LOG, "--window", "5.48")
    for what, ours, other, beside, count in (
        (
            "--help",
            winchcascade("--help"),
            imports,
            "imports of typer, numpy, Arrow's CSV",
            sizes.starts,
        ),
        (
            "--help",
            winchcascade("--help"),
            script("with_pandas.py", "--help"),
            "pandas --help",
            sizes.starts,
        ),
        ("reduce one log", winchcascade("reduce", LOG), pandas, "pandas", sizes.starts),
        (
            "the same with JSON",
            winchcascade("reduce", LOG, "--json", "-"),
            pandas,
            "pandas",
            sizes.starts,
        ),
        *(
            (
                f"report of one log, {kind.upper()}",
                winchcascade("reduce", LOG, f"--{kind}", folder / f"report.{kind}"),
                [*pandas, "--plot", str(folder / f"figure.{figure}")],
                "pandas, matplotlib: one figure",
                sizes.runs,
            )
            for kind, figure in (("html", "svg"), ("pdf", "pdf"))
        ),
    ):
        mine, others = pair(ours, other, count)
        yield f"{what} [s]", mine.seconds, others.seconds, beside
    log = folder / "long.csv"
    subprocess.run(script("make_logs.py", log, "--rows", str(sizes.rows)), check=True)
    read = [
        sys.executable,
        "-c",
        "import sys, pyarrow.csv; pyarrow.csv.read_csv(sys.argv[1])",
        str(log),
    ]
    for other, beside in (
        (script("with_pandas.py", log), "pandas"),
        (read, "Arrow's read_csv alone"),
    ):
        mine, others = pair(winchcascade("reduce", log), other, sizes.runs)
        yield f"reduce {sizes.rows / 1e6:g} million rows [s]", mine.seconds, others.seconds, beside
        yield "the same, memory [MB]", mine.memory, others.memory, beside


def batch(sizes: Sizes, folder: Path) -> Rows:
    """A campaign of many short logs: processes, a second call, a Dask cluster on this machine, a
    tenth of it.
    """
    from distributed import Client, LocalCluster

    for name, count in (("campaign", sizes.logs), ("tenth", sizes.logs // 10)):
        subprocess.run(script("make_logs.py", folder / name, "--logs", str(count)), check=True)

    def ours(campaign: str, out: str, *options: str) -> Used:
        return timed(
            winchcascade(
                "batch", folder / campaign, "--out", folder / out, "--reports", "none", *options
            )
        )

    what = f"{sizes.logs} logs"
    pandas = [
        timed(
            script(
                "with_pandas.py", folder / "campaign", "--out", folder / "table.csv", "--jobs", jobs
            )
        ).seconds
        for jobs in ("1", "2")
    ]
    one, two = ours("campaign", "one", "--jobs", "1"), ours("campaign", "two", "--jobs", "2")
    yield f"{what}, one process [s]", one.seconds, pandas[0], "pandas, one process"
    yield f"{what}, two processes [s]", two.seconds, pandas[1], "pandas, two processes"
    yield f"{what}, two processes [s]", two.seconds, one.seconds, "ours, one process"
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:  # type: ignore[no-untyped-call]
        with Client(cluster, set_as_default=False) as client:  # type: ignore[no-untyped-call]
            client.run(
                exec, "import winchcascade.batch.run_batch"
            )  # as on a cluster that has been up for a while
        dask = ours("campaign", "dask", "--scheduler", cluster.scheduler_address)
    yield f"{what}, Dask with two workers [s]", dask.seconds, two.seconds, "ours, two processes"
    again = (
        ours("campaign", "two", "--jobs", "2").seconds
        - timed(winchcascade("batch", "--help")).seconds
    )
    yield "second call, beyond start-up [ms a log]", 1e3 * again / sizes.logs, None, "-"
    yield (
        f"memory of {what} [MB]",
        one.memory,
        ours("tenth", "small", "--jobs", "1").memory,
        "ours, a tenth of them",
    )


def model(sizes: Sizes, folder: Path) -> Rows:
    """The shipped campaign simulated once, beside ngspice at one operating point, and the first
    simulation of a machine.
    """
    sys.path.insert(
        0, str(ROOT / "tests")
    )  # the circuit is the one that the tests hold the bridge against
    from circuit import NGSPICE, seconds_of, solved_by_ngspice

    took, simulated = campaign_seconds(CAMPAIGN)
    rpm, load = 2000.0, 18.0  # rated speed, the paper's best load
    spice = (
        None
        if NGSPICE is None
        else seconds_of(rpm, load) / seconds(lambda: solved_by_ngspice(rpm, load))
    )
    yield (
        f"simulate {simulated:.0f} s of the rig [s/s]",
        simulated / took,
        spice,
        "ngspice, the circuit alone",
    )
    if sizes.runs > 1:
        command = winchcascade(
            "simulate", LOG, "--load-ohm", "36", "--force", "--out", folder / "simulated.csv"
        )
        cold = timed(["env", f"NUMBA_CACHE_DIR={folder / 'cache'}", *command])
        warm = timed(["env", f"NUMBA_CACHE_DIR={folder / 'cache'}", *command])
        yield "first simulation of an installation [s]", cold.seconds, warm.seconds, "the next one"


def seconds(work: Callable[[], object]) -> float:
    """Median time of three calls. [s]"""
    took = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return statistics.median(took)


def campaign_seconds(campaign: Path) -> tuple[float, float]:
    """Time that simulating every log of a campaign once takes, and how long the rig itself runs
    in them. [s]
    """
    from winchcascade.core.campaign_file import load_campaign
    from winchcascade.core.rig_toml import built_in
    from winchcascade.ingest.read import read_run
    from winchcascade.rig.baseline import baseline
    from winchcascade.rig.simulate import simulate

    rig = baseline(built_in())
    runs = [read_run(entry.file, load=entry.load) for entry in load_campaign(campaign).runs]
    simulate(runs[0], rig)  # compiles
    return seconds(lambda: [simulate(run, rig) for run in runs]), sum(
        float(run.t[-1] - run.t[0]) for run in runs
    )


def diagnose(sizes: Sizes, folder: Path) -> Rows:
    """Blind cases a minute, diagnoses of one effect and of seven, and of many logs with nothing
    injected.

    A diagnosis of 140 logs is to take at most 20 times that of seven, and 1.5 GB.
    """
    from campaigns import Case, write_campaign

    trial = folder / "trial"
    for verb, words in (
        ("deal", ("--cases", f"{sizes.cases}", "--seed", "1", "--out", trial)),
        ("diagnose", (trial,)),
    ):
        used = timed(winchcascade("blind", verb, *words))
        yield f"blind {verb} [cases a minute]", 60 * sizes.cases / used.seconds, None, "-"
    one = {repeats: folder / f"{repeats}" for repeats in (1, *sizes.repeats)}
    for repeats, campaign in one.items():
        campaign.mkdir()
        write_campaign(Case("nothing", 1, 18_001, repeats=repeats), campaign)
    (folder / "one").mkdir()
    write_campaign(Case("single", 1, 1, {"line_drag": 1.0}), folder / "one")
    for what, campaign in (("one effect", folder / "one"), ("seven effects", CAMPAIGN)):
        used = timed(winchcascade("diagnose", campaign, "--json", folder / f"{campaign.name}.json"))
        yield (
            f"diagnose {what} [s]",
            used.seconds,
            campaign_seconds(campaign)[0],
            "simulating the logs once",
        )
    found = {
        7 * n: timed(winchcascade("diagnose", place, "--json", folder / f"{n}.json"))
        for n, place in one.items()
    }
    for number in [number for number in found if number > 7]:
        yield (
            f"diagnose {number} logs, nothing injected [s]",
            found[number].seconds,
            found[7].seconds,
            "seven logs",
        )
        yield "the same, memory [MB]", found[number].memory, found[7].memory, "seven logs"


PARTS = {"logs": logs, "batch": batch, "model": model, "diagnose": diagnose}
"""Parts of the table by their names."""


def number(value: float | None) -> str:
    """A number to three digits, without an exponent."""
    return "-" if value is None else f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def main() -> None:
    """Measure the parts that are asked for, and print their rows as they come."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--part", action="append", choices=PARTS, help="a part; may be repeated; default all"
    )
    parser.add_argument(
        "--quick", action="store_true", help="small sizes: about a minute, and rough"
    )
    asked = parser.parse_args()
    sizes = QUICK if asked.quick else FULL
    subprocess.run(
        [sys.executable, "-m", "compileall", "-q", str(ROOT / "winchcascade")], check=True
    )
    print(f"{sizes}\n\n{'what':<46} {'ours':>9} {'other':>9} {'ratio':>8}  other is", flush=True)
    for name in asked.part or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            for what, ours, other, beside in PARTS[name](sizes, Path(folder)):
                ratio = None if other is None else ours / other
                print(
                    f"{what:<46} {number(ours):>9} {number(other):>9} {number(ratio):>8}  {beside}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
