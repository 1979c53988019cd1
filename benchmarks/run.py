"""Print the ratios that users feel, each measured in this one run: start-up, and a log of many hours.

    python benchmarks/run.py [--rows 14000000] [--pairs 5]

Both sides of a ratio run in turn, A B A B ..., as processes of their own; the median of the pairs' ratios is printed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent
LOG = ROOT / "fixtures" / "campaign" / "r36ohm.csv"
IMPORTS = [sys.executable, "-c", "import typer, numpy, pyarrow.csv"]
READ_CSV = "import sys, pyarrow.csv; pyarrow.csv.read_csv(sys.argv[1])"


def winchcascade(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "winchcascade", *map(str, arguments)]


def timed(command: Sequence[str]) -> tuple[float, float]:
    """Seconds that a process takes, and the most memory it held [MB]."""
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return time.perf_counter() - begin, usage.ru_maxrss / 1024


def compare(name: str, command: Sequence[str], other: Sequence[str], pairs: int, goal: str) -> None:
    """Print the median ratio of two commands' times over pairs of runs."""
    timed(other), timed(command)
    runs = [(timed(other), timed(command)) for _ in range(pairs)]
    ratio = statistics.median(ours[0] / theirs[0] for theirs, ours in runs)
    ours = statistics.median(run[1][0] for run in runs)
    theirs = statistics.median(run[0][0] for run in runs)
    memory = max(run[1][1] for run in runs)
    print(f"{name:<44} {ours:8.3f} s {theirs:8.3f} s {ratio:6.2f} {memory:8.0f} MB   {goal}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=14_000_000, help="rows of the long log")
    parser.add_argument("--pairs", type=int, default=5, help="pairs of runs")
    options = parser.parse_args()
    pairs = options.pairs
    subprocess.run([sys.executable, "-m", "compileall", "-q", str(ROOT / "winchcascade")], check=True)
    print(f"{'':<44} {'this':>10} {'other':>10} {'ratio':>6} {'memory':>11}   goal")
    start = 3 * pairs
    compare("--help / imports of typer, numpy, arrow", winchcascade("--help"), IMPORTS, start, "at most 1.5")
    compare("reduce one log / those imports", winchcascade("reduce", LOG), IMPORTS, start, "at most 1.5")
    compare(
        "reduce --json - / those imports", winchcascade("reduce", LOG, "--json", "-"), IMPORTS, start, "at most 1.5"
    )
    with tempfile.TemporaryDirectory() as folder:
        long = Path(folder) / "long.csv"
        maker = [sys.executable, str(ROOT / "benchmarks" / "make_long_log.py"), str(long), "--rows", str(options.rows)]
        subprocess.run(maker, check=True, stdout=subprocess.DEVNULL)
        compare(
            "reduce --html --pdf / the figures' import",
            winchcascade("reduce", LOG, "--html", f"{folder}/r.html", "--pdf", f"{folder}/r.pdf"),
            [sys.executable, "-c", "import matplotlib.figure, matplotlib.backends.backend_svg"],
            pairs,
            "at most 4 s",
        )
        name = f"reduce {options.rows / 1e6:g} M rows, {long.stat().st_size / 1e9:.2f} GB / read_csv"
        compare(
            name, winchcascade("reduce", long), [sys.executable, "-c", READ_CSV, str(long)], pairs, "at most 2, 1600 MB"
        )


if __name__ == "__main__":
    main()
