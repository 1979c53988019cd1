"""Run many small jobs: on threads, on processes of this machine or on an existing Dask scheduler;
and the end of a process.

A job that fails is a value: its outcome carries the fault as a sentence, and the others go on.
Threads help because numpy, scipy and the compiled steps release the interpreter while they work.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from pathlib import Path
from types import FrameType
from typing import Generic, Protocol, TypeVar

import msgspec

from winchcascade.core.errors import OptionError, OutputError, WinchcascadeError, first_line
from winchcascade.core.extras import require
from winchcascade.core.files import clear_own

A = TypeVar("A")
B = TypeVar("B")
Job = TypeVar("Job")
Done = TypeVar("Done")

LONG = 1_000_000
"""Below this many samples a second thread costs more than it brings."""

MAX_WORKERS = 61
"""Windows cannot wait for more processes than this."""

CONNECT = 10.0
"""A scheduler that has not answered after this time counts as unreachable. [s]"""

ENDING = (signal.SIGINT, signal.SIGTERM)
"""An interrupt from the keyboard, and the usual request of a system that a process ends."""

_CURSOR = "\r\x1b[?25h"
"""Shows the cursor of a terminal again, which a bar of progress hides."""

_UNTIDY = "ignore:resource_tracker"
"""Option of Python by which the helper process of a pool removes its semaphores without a
warning.
"""

_threads = 2
"""Threads of `all_at_once`; `set_threads` changes the number."""


def set_threads(count: int) -> None:
    """Set the number of threads of `all_at_once` in this process; for commands with an option
    for it.
    """
    global _threads
    _threads = count


def one_thread_each() -> None:
    """Keep linear algebra on one thread, before it is imported: its matrices are small, and
    threads make each solve slower.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


@contextmanager
def linear_algebra_on_one_thread() -> Iterator[None]:
    """Do so while the context or the decorated function lasts, also where linear algebra is
    imported already: the threads of `all_at_once` use the processors, and where other programs run,
    more threads make a solve a hundred times slower.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield


def side_by_side(one: Callable[[], A], other: Callable[[], B], *, samples: int) -> tuple[A, B]:
    """Run two jobs and give both results, on a thread each where the arrays are long enough to gain
    by it.

    >>> side_by_side(lambda: 1, lambda: "a", samples=10)
    (1, 'a')
    """
    if samples < LONG:
        return one(), other()
    with ThreadPoolExecutor(1) as pool:
        behind = pool.submit(other)
        return one(), behind.result()


def all_at_once(jobs: Sequence[Callable[[], A]], sizes: Sequence[float] | None = None) -> list[A]:
    """Run jobs on some threads, and give their results in the jobs' order.

    The job of the largest of `sizes` begins first, so that no thread works long after the others.

    >>> all_at_once([lambda: 1, lambda: 2, lambda: 3])
    [1, 2, 3]
    """
    if len(jobs) < 2 or _threads < 2:
        return [job() for job in jobs]
    with ThreadPoolExecutor(_threads) as pool:
        order = (
            range(len(jobs)) if sizes is None else sorted(range(len(jobs)), key=lambda k: -sizes[k])
        )
        running = {k: pool.submit(jobs[k]) for k in order}
        return [running[k].result() for k in range(len(jobs))]


class Outcome(msgspec.Struct, Generic[Done], frozen=True):
    """Outcome of one job: its place in the sequence, and its value or the sentence on why there is
    none.

    `rejected` distinguishes an input that cannot be used from a lack of space or memory, after
    which the same job may work.
    """

    place: int
    value: Done | None = None
    fault: str | None = None
    rejected: bool = False


class Watch(Protocol):
    """Callbacks that report the progress of a piece of work."""

    def begin(self, kept: int, todo: int) -> None:
        """Report how many parts are done already and how many remain."""

    def done(self, name: str, fault: str | None) -> None:
        """One more is done, or failed for a reason."""

    def waiting(self, folder: Path) -> None:
        """Another call works in the folder, and this one waits for its end."""


class Nobody:
    """Watches no work."""

    begin = done = waiting = staticmethod(lambda *_, **__: None)


def processes() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers(msgspec.Struct, frozen=True):
    """Where jobs run: on a number of processes of this machine, or on a Dask scheduler at an
    address.
    """

    processes: int = 1
    scheduler: str | None = None

    def run(
        self, work: Callable[[Job], Done], orders: Mapping[str, Job], watch: Watch
    ) -> Iterator[tuple[str, Outcome[Done]]]:
        """Carry out orders by their names, and report each one that is done. Raises as
        `run_there`.
        """
        names, jobs = list(orders), list(orders.values())
        here = self.scheduler is None
        outcomes = (
            run_here(work, jobs, workers=self.processes)
            if here
            else run_there(work, jobs, str(self.scheduler))
        )
        for outcome in outcomes:
            yield names[outcome.place], outcome
            watch.done(names[outcome.place], outcome.fault)


def run_here(
    work: Callable[[Job], Done], jobs: Sequence[Job], *, workers: int
) -> Iterator[Outcome[Done]]:
    """Run jobs on processes of this machine, in this one if a single worker is wanted; outcomes
    come in any order.

    `work` is a function of a module: processes are spawned, never forked, so it works alike on
    every system. Where one dies (without memory, for example), what is not done yet is tried once
    more, each job in a process of its own. OptionError if no process can be started.
    """
    workers = min(workers, len(jobs), MAX_WORKERS)
    if workers <= 1:
        yield from (_tried(work, place, job) for place, job in enumerate(jobs))
        return
    left = dict(enumerate(jobs))
    with _pool(workers) as pool, suppress(BrokenProcessPool):
        with _interrupts_blocked():
            done = as_completed(
                [pool.submit(_tried, work, place, job) for place, job in enumerate(jobs)]
            )
        for (
            future
        ) in done:  # nothing else holds a future, so that an outcome that was used takes no memory
            outcome = future.result()
            del left[outcome.place]
            yield outcome
    with ThreadPoolExecutor(workers) as threads:
        yield from threads.map(lambda place: _alone(work, place, left[place]), left)


def _alone(work: Callable[[Job], Done], place: int, job: Job) -> Outcome[Done]:
    """Outcome of a job in a process of its own; OptionError where no process starts, as of a
    script without a guard.
    """
    with _pool(1) as pool:
        try:
            pool.submit(os.getpid).result()
        except BrokenProcessPool:
            raise OptionError(
                "no further process can be started; work with one (jobs=1, or --jobs 1). A script "
                "that uses several is a "
                'file, and guards its start by if __name__ == "__main__".'
            ) from None
        try:
            return pool.submit(_tried, work, place, job).result()
        except BrokenProcessPool:
            return Outcome(
                place,
                fault="the process that worked on it was killed twice; is there enough memory?",
            )


def _tried(work: Callable[[Job], Done], place: int, job: Job) -> Outcome[Done]:
    """Do one job here; what goes wrong becomes its sentence."""
    try:
        return Outcome(place, work(job))
    except WinchcascadeError as fault:
        return Outcome(place, fault=str(fault), rejected=not isinstance(fault, OutputError))
    except OSError as fault:
        return Outcome(
            place,
            fault=f"{fault.filename or 'a file'}: cannot be used ({fault.strerror or fault}).",
        )
    except Exception as fault:
        return Outcome(
            place,
            fault=f"a fault of this program: {type(fault).__name__}: {fault}. Please report it.",
        )


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of spawned processes that end with this one; what has not begun when the context
    ends does not begin.
    """
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_quietly)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Keep interrupts from processes that are started now, for as long as they run: the one that
    starts them handles it.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _quietly() -> None:
    """Leave an interrupt to the process that gave the jobs, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_on_signals({})
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait for the end of the process that started this one."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        clear_own()
        os._exit(1)


def end_on_signals(sentences: Mapping[signal.Signals, str]) -> None:
    """End this process at a signal, without its scratch, with the sentence given for it, if any, on
    standard error.

    The process ends past Python: an exception that is raised at any place may be dropped, wrapped
    or printed by whatever runs there, such as an import, a callback or the collection of garbage.
    """

    def end(number: int, _frame: FrameType | None) -> None:
        clear_own()
        sentence = sentences.get(signal.Signals(number))
        if sentence is not None:
            with suppress(OSError):
                os.write(2, f"{_CURSOR if os.isatty(2) else ''}{sentence}\n".encode())
        os._exit(128 + number)

    if _UNTIDY not in sys.warnoptions:
        sys.warnoptions.append(_UNTIDY)
    for number in ENDING:
        if (
            signal.getsignal(number) is not signal.SIG_IGN
        ):  # whoever started this process wants it to go on
            signal.signal(number, end)


def run_there(
    work: Callable[[Job], Done], jobs: Sequence[Job], scheduler: str
) -> Iterator[Outcome[Done]]:
    """Run jobs on an existing Dask scheduler; outcomes come in any order.

    OptionError if Dask is not installed, or the scheduler cannot be reached.
    """
    such = "expected that of a running scheduler, such as tcp://10.0.0.1:8786."
    if not re.fullmatch(r"(tcp|tls|ws|wss|ucx)://[^/\s]+:[0-9]{1,5}", scheduler):
        raise OptionError(f"--scheduler {scheduler}: is no address; {such}")
    require("distributed", "--scheduler, here and on the workers,")
    from distributed import Client, as_completed

    try:
        client = Client(scheduler, timeout=CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as fault:
        raise OptionError(
            f"--scheduler {scheduler}: cannot be reached ({first_line(fault)}); {such}"
        ) from None
    with client:
        futures = [
            client.submit(_tried, work, place, job, pure=False) for place, job in enumerate(jobs)
        ]
        places = {future.key: place for place, future in enumerate(futures)}
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]
            if future.status == "finished":
                yield future.result()
            else:
                said = f"the worker that had it failed ({first_line(future.exception())})."
                yield Outcome(places[future.key], fault=said)
            future.release()
