"""What the benchmarks share: their sizes, the clock, and the one table that all of them print."""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
CAMPAIGN = ROOT / "fixtures" / "campaign"
LOG = CAMPAIGN / "r36ohm.csv"


class Sizes(NamedTuple):
    """How much is measured: rows of the long log, logs of the batch, cases of a trial, loads of a diagnosed campaign.

    Medians are taken over so many `starts` of what lasts less than a second, and over so many `pairs` of the rest.
    """

    starts: int
    pairs: int
    rows: int
    logs: int
    loads: int
    cases: int


FULL = Sizes(starts=15, pairs=3, rows=14_000_000, logs=1000, loads=7, cases=8)
QUICK = Sizes(starts=1, pairs=1, rows=200_000, logs=20, loads=2, cases=1)


class Row(NamedTuple):
    """One line of the table: a measurement, what is used instead, and the ratio of ours to that."""

    what: str
    ours: float
    other: float | None
    unit: str
    beside: str
    ratio: float | None = None
    """Median over pairs of runs; the ratio of the two numbers where none is given."""


class Used(NamedTuple):
    """What a process took: time [s], and the most memory it held [MB]."""

    seconds: float
    memory: float


def winchcascade(*arguments: str | Path) -> list[str]:
    """Give the command line of this tool."""
    return [sys.executable, "-m", "winchcascade", *map(str, arguments)]


def script(name: str, *arguments: str | Path) -> list[str]:
    """Give the command line of a file beside this one."""
    return [sys.executable, str(ROOT / "benchmarks" / name), *map(str, arguments)]


def python(code: str, *arguments: str | Path) -> list[str]:
    """Give the command line of a line of Python."""
    return [sys.executable, "-c", code, *map(str, arguments)]


def timed(command: Sequence[str]) -> Used:
    """Run a process to its end; the benchmark ends if it fails."""
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return Used(time.perf_counter() - begin, usage.ru_maxrss / 1024)


class Pairs(NamedTuple):
    """Runs of ours and of the other, in turn."""

    ours: tuple[Used, ...]
    other: tuple[Used, ...]

    def row(self, what: str, beside: str) -> Row:
        """Give the median times [s], and the median of the pairs' ratios."""
        ratio = statistics.median(a.seconds / b.seconds for a, b in zip(self.ours, self.other, strict=True))
        return Row(what, _middle(self.ours), _middle(self.other), "s", beside, ratio)

    def memory(self, what: str, beside: str) -> Row:
        """Give the most memory that any run of each held. [MB]"""
        return Row(what, max(u.memory for u in self.ours), max(u.memory for u in self.other), "MB", beside)


def _middle(runs: Sequence[Used]) -> float:
    return statistics.median(run.seconds for run in runs)


def in_turn(ours: Sequence[str], other: Sequence[str], count: int) -> Pairs:
    """Run two commands A B A B ..., after one pair that fills the caches unless a single pair is wanted."""
    if count > 1:
        timed(other), timed(ours)
    runs = [(timed(other), timed(ours)) for _ in range(count)]
    return Pairs(tuple(b for _, b in runs), tuple(a for a, _ in runs))


def median_seconds(work: Callable[[], object], rounds: int) -> float:
    """Median time of some calls. [s]"""
    took = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return statistics.median(took)


def line(row: Row) -> str:
    """Write a row of the table."""
    ratio = row.ratio if row.ratio is not None or row.other is None else row.ours / row.other
    return f"{row.what:<46} {number(row.ours):>9} {number(row.other):>9} {number(ratio):>8}  {row.unit:<9} {row.beside}"


def number(value: float | None) -> str:
    """Write a number to three digits, without an exponent.

    >>> number(1234.5), number(0.01234), number(None)
    ('1234', '0.0123', '-')
    """
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


HEAD = f"{'what':<46} {'ours':>9} {'other':>9} {'ratio':>8}  {'unit':<9} other is"


def main(purpose: str, *parts: Callable[[Sizes], Iterator[Row]]) -> None:
    """Measure some parts and print their rows as they come."""
    parser = argparse.ArgumentParser(description=purpose)
    parser.add_argument("--quick", action="store_true", help="small sizes: about a minute, and rough")
    for name, size in FULL._asdict().items():
        parser.add_argument(f"--{name}", type=int, help=f"{size} by default, {getattr(QUICK, name)} with --quick")
    asked = vars(parser.parse_args())
    sizes = QUICK if asked.pop("quick") else FULL
    sizes = sizes._replace(**{name: size for name, size in asked.items() if size is not None})
    subprocess.run([sys.executable, "-m", "compileall", "-q", str(ROOT / "winchcascade")], check=True)
    begin = time.perf_counter()
    print("sizes: " + ", ".join(f"{name} {size}" for name, size in sizes._asdict().items()))
    if sizes != FULL:
        print("these are not the full sizes: start-up weighs more and single runs scatter")
    print(f"ratio = ours / other\n\n{HEAD}", flush=True)
    for part in parts:
        for row in part(sizes):
            print(line(row), flush=True)
    print(f"\nall in one run of {time.perf_counter() - begin:.0f} s")
