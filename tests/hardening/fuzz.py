"""Damaged files: each is read or rejected in one sentence; anything else is a fault that its number
makes again.

`python tests/hardening/fuzz.py --inputs 5000 --first 0` prints counts and returns 1 on a fault;
`--only tdms` does one kind. Memory is limited by the system: an input that takes more than a file
of its size may ends the program, and is its last line.
"""

from __future__ import annotations

import argparse
import collections
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mutate import mutated
from seeds import LOG, SEEDS

from winchcascade import WinchcascadeError, audit, load_rig, open_campaign, read_run, reduce

SECONDS = 60
"""A file that takes longer hangs."""

MEMORY = 3 << 30
"""Addresses that the process may reserve beside what it has at its start; a reader reserves more
than it takes. [bytes]
"""


def read_log(path: Path) -> None:
    """Read and reduce a log, and look whether what comes out is sound."""
    run = read_run(path)
    assert bool(np.all(np.diff(run.t) > 0)), "stamps that do not rise"
    assert all(np.isfinite(x).all() and x.size == run.t.size for x in run.channels.values()), (
        "a channel not finite"
    )
    reduce(run)


def read_rig(path: Path) -> None:
    """Reduce a sound log with a rig file."""
    reduce(read_run(LOG, rig=load_rig(path), load=36.0))


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "rig": ("rig.toml", read_rig), "campaign": ("campaign.toml", open_campaign), "table": ("table.toml", audit),
}  # fmt: skip
"""Name of the file and how it is read, of the kinds that are no log."""


def judged(form: str, number: int, folder: Path) -> str:
    """Read one input: `read`, `rejected`, or what is wrong."""
    name, read = READERS.get(form, ("log.dat", read_log))
    path = (
        folder / form / name
    )  # a folder of its own: a campaign.toml beside a log would be read with it
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(mutated(form, number))
    signal.alarm(SECONDS)
    try:
        read(path)
    except WinchcascadeError as fault:
        said = str(fault)
        sound = said.isprintable() and len(said) <= 2000 and said.rstrip().endswith((".", ")"))
        return "rejected" if sound else f"no sentence of a length to be read: {said[:300]!r}"
    except Exception as fault:
        frame = traceback.extract_tb(fault.__traceback__)[-1]
        return f"{type(fault).__name__}: {fault} at {frame.filename}:{frame.lineno}"
    finally:
        signal.alarm(0)
    return "read"


def main() -> int:
    """Run the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--only", choices=list(SEEDS), help="inputs of this kind alone")
    given = parser.parse_args()
    warnings.simplefilter("error")
    kinds = [given.only] if given.only else list(SEEDS)
    counts: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY,) * 2)
        for number in range(given.first, given.first + given.inputs):
            form = kinds[number % len(kinds)]
            print(f"{form} {number}", end="\r", file=sys.stderr, flush=True)
            outcome = judged(form, number, Path(folder))
            counts[outcome if outcome in ("read", "rejected") else "fault"] += 1
            if outcome not in ("read", "rejected"):
                print(f"{form} {number}: {outcome}")
    print(*(f"{count} {outcome}" for outcome, count in counts.items()), sep=", ")
    return 1 if counts["fault"] else 0


if __name__ == "__main__":
    sys.exit(main())
