"""Run many small jobs: on threads, on processes of this machine or on an existing Dask scheduler.

A job that fails is a value: its outcome carries the fault as a sentence, and the others go on.
Threads help because numpy, scipy and the compiled steps release the interpreter while they work.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, TypeVar

import msgspec

from winchcascade.core.outcome import Done, Job, Outcome, attempt

A = TypeVar("A")
B = TypeVar("B")

LONG = 1_000_000
"""Below this many samples a second thread costs more than it brings."""

_threads = 2
"""Threads of `all_at_once`; `use_threads` changes the number."""


def one_thread_each() -> None:
    """Keep linear algebra on one thread, before it is imported: its matrices are small, and
    threads make each solve slower.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def use_threads(count: int | None) -> None:
    """Set the number of threads of `all_at_once` in this process, by default one for each
    processor, and keep linear algebra on one.
    """
    global _threads
    one_thread_each()
    _threads = count or processes()


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
    from concurrent.futures import ThreadPoolExecutor

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
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(_threads) as pool:
        order = (
            range(len(jobs)) if sizes is None else sorted(range(len(jobs)), key=lambda k: -sizes[k])
        )
        running = {k: pool.submit(jobs[k]) for k in order}
        return [running[k].result() for k in range(len(jobs))]


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
        """Carry out orders by their names, and report each one that is done.

        OptionError if no process can be started, or the scheduler cannot be reached.
        """
        names, jobs = list(orders), list(orders.values())
        for outcome in self.outcomes(work, jobs):
            yield names[outcome.place], outcome
            watch.done(names[outcome.place], outcome.fault)

    def outcomes(self, work: Callable[[Job], Done], jobs: Sequence[Job]) -> Iterator[Outcome[Done]]:
        """Outcomes of jobs, in any order; a single worker is this process. Raises as `run`."""
        if self.scheduler is None and min(self.processes, len(jobs)) <= 1:
            return (attempt(work, place, job) for place, job in enumerate(jobs))
        from winchcascade.core.worker_pool import run_here, run_there

        if self.scheduler is None:
            return run_here(work, jobs, workers=self.processes)
        return run_there(work, jobs, self.scheduler)
