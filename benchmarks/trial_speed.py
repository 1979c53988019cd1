"""Time and memory of a diagnosis of 7, 70 and 140 logs with nothing injected."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
from measure import Used, timed, winchcascade
from trial_cases import commit, write_campaign
from trial_plans import Plan

LOADS = 7
REPEATS = (1, 10, 20)
MAX_TIMES, MAX_MEMORY = 20.0, 1500.0
"""Bars of 140 logs: time over that of seven logs, and memory. [1, MB]"""


class Speed(msgspec.Struct, frozen=True):
    """Time [s] and memory [MB] by the number of logs."""

    commit: str
    used: dict[int, Used]


def measured(path: Path) -> Speed:
    """Measure the diagnoses, in processes of their own, and write the result."""
    used = {}
    with tempfile.TemporaryDirectory() as scratch:
        for repeats in REPEATS:
            folder = Path(scratch) / str(repeats)
            folder.mkdir()
            write_campaign(Plan("nothing", 1, repeats=repeats), folder)
            command = winchcascade("diagnose", folder, "--json", folder / "diagnosis.json")
            if repeats == 1:
                timed([*command, "--force"])  # fills the caches
            used[LOADS * repeats] = timed([*command, "--force"])
    found = Speed(commit(), used)
    path.write_bytes(msgspec.json.encode(found))
    return found


def speed_lines(path: Path, *, measure: bool) -> Iterator[str]:
    """Lines of the table; without a measurement those of the last one."""
    if not measure and not path.is_file():
        return
    found = measured(path) if measure else msgspec.json.decode(path.read_bytes(), type=Speed)
    yield f"speed: diagnosis of logs with nothing injected, checkout {found.commit}"
    seven = found.used[LOADS].seconds
    for logs, used in found.used.items():
        yield f"  {logs:>4} logs {used.seconds:>8.1f} s {used.seconds / seven:>6.1f} times seven logs {used.memory:>7.0f} MB"
    last = found.used[LOADS * REPEATS[-1]]
    for what, value, bar in (("time", last.seconds / seven, MAX_TIMES), ("memory", last.memory, MAX_MEMORY)):
        yield f"  bar of {what}: {bar:g}, {'reached' if value <= bar else 'NOT reached'}"
