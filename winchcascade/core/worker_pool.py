"""Processes that work on jobs: spawned ones of this machine, and the workers of a Dask scheduler."""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process

from winchcascade.core.errors import OptionError, first_line
from winchcascade.core.extras import require
from winchcascade.core.files import clear_own
from winchcascade.core.outcome import Done, Job, Outcome, attempt
from winchcascade.core.process_end import end_on_signals

MAX_WORKERS = 61
"""Windows cannot wait for more processes than this."""

CONNECT = 10.0
"""A scheduler that has not answered after this time counts as unreachable. [s]"""

PARCELS = 32
"""Parcels of jobs that a worker gets one after the other: it is idle at most for the last one."""

MAX_PARCEL = 8
"""Jobs that are sent together, with what they share once: sending them one by one costs a tenth
of the time of short ones, and more than this do not gain by it."""

Parcel = list[tuple[int, Job]]
"""Jobs that are sent together, each with its place in the sequence."""


def _parcels(jobs: Sequence[Job], workers: int) -> list[Parcel[Job]]:
    """Jobs with their places, some together where there are many for each worker."""
    size = max(1, min(len(jobs) // (PARCELS * workers), MAX_PARCEL))
    numbered = list(enumerate(jobs))
    return [numbered[start : start + size] for start in range(0, len(numbered), size)]


def _attempts(work: Callable[[Job], Done], parcel: Parcel[Job]) -> list[Outcome[Done]]:
    """Outcomes of the jobs that were sent together."""
    return [attempt(work, place, job) for place, job in parcel]


def run_here(
    work: Callable[[Job], Done], jobs: Sequence[Job], *, workers: int
) -> Iterator[Outcome[Done]]:
    """Run jobs on processes of this machine; outcomes come in any order.

    `work` is a function of a module: processes are spawned, never forked, so it works alike on
    every system. Where one dies (without memory, for example), what is not done yet is tried once
    more, each job in a process of its own. OptionError if no process can be started.
    """
    workers = min(workers, len(jobs), MAX_WORKERS)
    left = dict(enumerate(jobs))
    with _pool(workers) as pool, suppress(BrokenProcessPool):
        with _interrupts_blocked():
            done = as_completed(
                [pool.submit(_attempts, work, parcel) for parcel in _parcels(jobs, workers)]
            )
        # Nothing else holds a future, so that an outcome that was used takes no memory.
        for future in done:
            for outcome in future.result():
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
            return pool.submit(attempt, work, place, job).result()
        except BrokenProcessPool:
            return Outcome(
                place,
                fault="the process that worked on it was killed twice; is there enough memory?",
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
        parcels = _parcels(jobs, max(1, sum(client.nthreads().values())))  # type: ignore[no-untyped-call]
        futures = {
            client.submit(_attempts, work, parcel, pure=False): [place for place, _ in parcel]
            for parcel in parcels
        }
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]
            if future.status == "finished":
                yield from future.result()
            else:
                said = f"the worker that had it failed ({first_line(future.exception())})."
                yield from (Outcome(place, fault=said) for place in futures[future])
            future.release()
