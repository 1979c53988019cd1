"""Damaged files by the thousand: each is read or rejected in one sentence; anything else is a fault that can be made again.

`python tests/hardening/fuzz.py --inputs 50000 --jobs 2` prints a table of counts by format and returns 1 on faults;
`python tests/hardening/fuzz.py --show tdms 1234` does one again, with its traceback.
"""

import argparse
import json
import os
import resource
import selectors
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mutate import mutated
from seeds import LOG, SEEDS

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import load_results
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.rig_file import Rig
from winchcascade.core.table_toml import load_table
from winchcascade.ingest.limits import SECONDS_SETTING
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce, require_payouts
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.records import reduction_json, reduction_record
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.audits import audit_report
from winchcascade.report.results.checks import check_report
from winchcascade.report.results.reduction import reduction_report
from winchcascade.rig.open_rig import load_rig
from winchcascade.tables.audit import audit_by_load as audit
from winchcascade.tables.check import check, measured_from_record

LONGEST = 5.0
"""A file that takes more of the processor is a hang, on a busy machine too. [s]"""

READ_MEMORY, READ_SECONDS = 2 << 30, 6 * LONGEST
"""What the process that reads a file may hold [bytes], and how long it may take [s], on a busy machine too; one that takes
longer hangs."""

PATIENCE = 15.0
"""A worker that has said nothing for so long waits for something, or is stuck in compiled code, and is killed. [s]"""

MEMORY = 1 << 30
"""What a file of less than a megabyte may take beyond what the readers themselves take. [bytes]"""

ROOM = 8
"""Of so many times `MEMORY` addresses may be reserved where what is really taken is measured."""

SHARES = {
    "text": 6, "lvm": 2, "toa5": 2, "tdms": 4, "mat": 4, "mat73": 1, "parquet": 4, "excel": 2, "xls": 1, "rig": 4,
    "campaign": 3, "table": 3, "result": 2,
}  # fmt: skip
"""Of so many inputs, how many are of each kind."""

NAMES = {"rig": "rig.toml", "campaign": "campaign.toml", "table": "table.toml", "result": "result.json"}


class TooSlow(BaseException):
    """The alarm of one input; no reader takes it for damage of its file."""


class Judged(NamedTuple):
    """What became of one input: read, rejected (in a sentence), starved (not judged yet) or a fault (and what it is)."""

    form: str
    seed: int
    outcome: str
    message: str = ""


def read_log(path: Path) -> None:
    """Read a log and reduce it, as `reduce` does, and look whether what comes out is sound."""
    run = read_run(path)
    assert bool(np.all(np.diff(run.t) > 0)), "stamps that do not rise"
    assert all(np.isfinite(x).all() and len(x) == len(run.t) for x in run.channels.values()), "a channel not finite"
    _reduced(reduce(run))


def _reduced(reduction: Reduction) -> None:
    require_payouts(reduction)
    found = uncertainty(reduction)
    content = reduction_json(reduction, found)
    json.loads(content, parse_constant=_no_number)
    assert terminal_text(reduction_report(reduction, found))


def _no_number(word: str) -> None:
    raise AssertionError(f"{word} in JSON")


def read_rig(path: Path) -> None:
    """Read a rig file and reduce a sound log with it."""
    rig: Rig = load_rig(path)
    _reduced(reduce(read_run(LOG, rig=rig, load=36.0), rig=rig))


def read_campaign(path: Path) -> None:
    """Plan a campaign, without its logs."""
    assert make_plan([str(path)]).work


@cache
def _measured() -> Any:
    reduction = reduce(read_run(LOG, load=36.0))
    return measured_from_record(reduction_record(reduction, uncertainty(reduction)), LOG.name)


def read_table(path: Path) -> None:
    """Hold a published table against itself and against a sound log."""
    table = load_table(path)
    assert terminal_text(audit_report(audit(table)))
    assert terminal_text(check_report(check([_measured()], table)))


def read_result(path: Path) -> None:
    """Hold the results of a JSON file against the built-in table."""
    found = load_results(path)
    measured = [measured_from_record(record, name) for name, record in found.records]
    found_cells = check(measured, load_table("hsu2026-table2"), whole_campaign=found.whole)
    assert terminal_text(check_report(found_cells))


READERS: dict[str, Callable[[Path], None]] = {
    "rig": read_rig, "campaign": read_campaign, "table": read_table, "result": read_result,
}  # fmt: skip


def judge(form: str, seed: int, folder: Path) -> Judged:
    """Make one input, read it, and say what became of it."""
    path = folder / NAMES.get(form, "log.dat")
    path.write_bytes(mutated(form, seed))
    try:
        READERS.get(form, read_log)(path)
    except WinchcascadeError as fault:
        return Judged(form, seed, *_rejection(fault))
    except MemoryError:
        return Judged(form, seed, "starved", "memory ran out")
    except TooSlow:
        return Judged(form, seed, "fault", f"took more than {LONGEST:g} s at {_place_of(sys.exc_info()[2])}")
    except Exception as fault:
        return Judged(form, seed, "fault", f"{type(fault).__name__}: {fault} at {_place_of(fault.__traceback__)}")
    return Judged(form, seed, "read")


def _rejection(fault: WinchcascadeError) -> tuple[str, str]:
    """A rejection that is one line for people, and not memory that ran out, is as it should be."""
    said = str(fault)
    cause = fault.__cause__
    if isinstance(cause, MemoryError):
        return "starved", said
    if SECONDS_SETTING in said:
        return "fault", f"its reader hangs: {said}"
    if any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in said):
        return "fault", f"not one line for people: {said!r}"
    if len(said) > 2000 or not said.rstrip().endswith((".", ")")):
        return "fault", f"no sentence of a length to be read: {said[:300]!r}"
    if isinstance(cause, Warning | AssertionError):
        return "fault", f"{type(cause).__name__}: {cause} behind {said}"
    return "rejected", said


def _place_of(trace: Any) -> str:
    """The last line of this project's code in a traceback."""
    ours = [f for f in traceback.extract_tb(trace) if "winchcascade/" in f.filename.replace(os.sep, "/")]
    return f"{Path(ours[-1].filename).name}:{ours[-1].lineno}" if ours else "this script"


def kinds(inputs: int, first: int) -> Iterator[tuple[str, int]]:
    """The kind and the number of each input, in turn."""
    wheel = [form for form in SEEDS for _ in range(SHARES[form])]
    return ((wheel[k % len(wheel)], k) for k in range(first, first + inputs))


def work(orders: Sequence[tuple[str, int]], *, weighed: bool) -> None:
    """Judge inputs one by one, saying on standard output which is begun and what became of it.

    A limit of addresses is what stops a bomb, but a reader may reserve addresses that it never touches (Arrow does so
    for the size that a damaged page claims): inputs that met the limit are weighed, with more room, by what they take.
    """
    warnings.simplefilter("error")
    os.environ[SECONDS_SETTING] = str(READ_SECONDS)
    signal.signal(signal.SIGPROF, _alarm)
    with tempfile.TemporaryDirectory() as folder:
        _warm_up(Path(folder))
        _limit_memory(ROOM * MEMORY if weighed else MEMORY)
        for form, seed in orders:
            _say(form, seed)
            signal.setitimer(signal.ITIMER_PROF, LONGEST)
            held = _held_by_readers()
            try:
                with memory_taken() as taken:
                    judged = judge(form, seed, Path(folder))
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
            if _held_by_readers() > max(held, READ_MEMORY):
                judged = judged._replace(outcome="fault", message=f"its reader held {_held_by_readers() >> 20} MiB")
            _say(*(by_weight(judged, taken()) if weighed else judged))


def _held_by_readers() -> int:
    """Most memory that a process held which read a file for this one. [bytes]"""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10


def _say(*words: object) -> None:
    print(json.dumps(words), flush=True)


def _alarm(_number: int, _frame: object) -> None:
    raise TooSlow


def _warm_up(folder: Path) -> None:
    """Read a sound file of each kind, so that imports and threads count neither as memory nor as time."""
    for form in SEEDS:
        for content in SEEDS[form]():
            path = folder / NAMES.get(form, "log.dat")
            path.write_bytes(content)
            try:
                READERS.get(form, read_log)(path)
            except WinchcascadeError:
                continue


def _limit_memory(room: int) -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + room
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))  # readers have a limit of their own


@contextmanager
def memory_taken() -> Iterator[Callable[[], int]]:
    """Yield what tells, afterwards, the most memory that was taken meanwhile beyond what was taken before. [bytes]"""
    Path("/proc/self/clear_refs").write_text("5")
    before, maximum = _resident("VmRSS"), [0]
    try:
        yield lambda: maximum[0]
    finally:
        maximum[0] = _resident("VmHWM") - before


def _resident(which: str) -> int:
    """Memory that is really taken, now (`VmRSS`) or at most (`VmHWM`). [bytes]"""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith(which))


def by_weight(judged: Judged, taken: int) -> Judged:
    """Judge an input by the memory that it took. [bytes]"""
    if judged.outcome == "starved" or taken > MEMORY:
        return judged._replace(outcome="fault", message=f"took {taken >> 20} MiB: {judged.message}")
    return judged


def run_orders(orders: Sequence[tuple[str, int]]) -> Iterator[Judged]:
    """Have worker processes judge inputs; one that ends or falls silent is a fault of the input it had begun."""
    left = list(orders)
    while left:
        done = 0
        for judged in _worker(left):
            done += 1
            yield from _worker([judged[:2]], weighed=True) if judged.outcome == "starved" else [judged]
        left = left[done:]


def _worker(orders: Sequence[tuple[str, int]], *, weighed: bool = False) -> Iterator[Judged]:
    """What one worker process says of inputs, up to the one that it does not survive."""
    with tempfile.TemporaryFile() as errors:
        command = [sys.executable, __file__, "--work", *(["--weighed"] if weighed else [])]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors)
        assert process.stdin is not None
        assert process.stdout is not None
        with process.stdin as orders_in:
            orders_in.write(json.dumps(list(orders)).encode())
        begun: Sequence[Any] = ()
        with process:
            for line in _lines(process):
                said = json.loads(line)
                begun = said if len(said) == 2 else ()
                if len(said) > 2:
                    yield Judged(*said)
        if begun or process.returncode:
            errors.seek(0)
            last = " ".join(errors.read().decode("utf-8", "replace").split())[-600:]
            assert begun, f"a worker did not begin: {last}"
            yield Judged(begun[0], begun[1], "fault", f"the process ended ({process.returncode}): {last}")


def _lines(process: "subprocess.Popen[bytes]") -> Iterator[bytes]:
    """Lines of a process as they come; it is killed when none has come for a while."""
    assert process.stdout is not None
    with selectors.DefaultSelector() as ready:
        ready.register(process.stdout, selectors.EVENT_READ)
        patience, rest = 120.0, b""
        while True:
            if not ready.select(patience):
                process.kill()
                return
            data = os.read(process.stdout.fileno(), 1 << 16)
            if not data:
                return
            *whole, rest = (rest + data).split(b"\n")
            yield from whole
            patience = PATIENCE


def fuzz(inputs: int, *, first: int = 0, jobs: int = 1, only: str | None = None) -> list[Judged]:
    """Judge so many inputs, from a number on."""
    orders = [order for order in kinds(inputs, first) if only in (None, order[0])]
    parts = [orders[k::jobs] for k in range(jobs)]
    with ThreadPoolExecutor(jobs) as pool:
        return [
            judged for part in pool.map(lambda part: list(_faults_printed(run_orders(part))), parts) for judged in part
        ]


def _faults_printed(judged: Iterator[Judged]) -> Iterator[Judged]:
    """Say at once on standard error what is a fault: a run of all inputs takes half an hour."""
    for one in judged:
        if one.outcome == "fault":
            print(f"--show {one.form} {one.seed}: {one.message}", file=sys.stderr, flush=True)
        yield one


def table(judged: Sequence[Judged]) -> str:
    """Counts by kind, as lines."""
    lines = [f"{'format':10}{'inputs':>8}{'read':>8}{'rejected':>10}{'faults':>8}"]
    for form in [*SEEDS, "all"]:
        of = [j.outcome for j in judged if form in (j.form, "all")]
        if of:
            counts = [len(of), *(of.count(outcome) for outcome in ("read", "rejected", "fault"))]
            lines.append(f"{form:10}{counts[0]:8}{counts[1]:8}{counts[2]:10}{counts[3]:8}")
    return "\n".join(lines) + "\n"


def show(form: str, seed: int, keep: Path | None) -> int:
    """Do one input again, without limits, with whatever it raises."""
    warnings.simplefilter("error")
    if keep is not None:
        keep.write_bytes(mutated(form, seed))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / NAMES.get(form, "log.dat")
        path.write_bytes(mutated(form, seed))
        try:
            READERS.get(form, read_log)(path)
        except WinchcascadeError as fault:
            print(f"rejected: {fault}")
            if fault.__cause__ is not None:
                traceback.print_exception(fault.__cause__)
            return 0
    print("read")
    return 0


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", choices=list(SEEDS), help="inputs of this kind alone")
    parser.add_argument("--show", nargs=2, metavar=("FORM", "NUMBER"), help="do one input again")
    parser.add_argument("--keep", type=Path, help="with --show: write the input here")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--weighed", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work([(form, seed) for form, seed in json.load(sys.stdin)], weighed=given.weighed)
        return 0
    if given.show:
        return show(given.show[0], int(given.show[1]), given.keep)
    begun = time.perf_counter()
    judged = fuzz(given.inputs, first=given.first, jobs=given.jobs, only=given.only)
    print(table(judged), end="")
    print(f"inputs {given.first} to {given.first + given.inputs - 1}, {time.perf_counter() - begun:.0f} s")
    return 1 if any(j.outcome == "fault" for j in judged) else 0


if __name__ == "__main__":
    sys.exit(main())
