"""Independent pieces of work side by side: numpy, scipy and the compiled steps leave the interpreter free while they work."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")

LONG = 1_000_000
"""Below this many samples a second thread costs more than it brings."""

_threads = 2
"""Threads of `all_at_once`, until `set_threads` says otherwise."""


def set_threads(count: int) -> None:
    """Let `all_at_once` work on so many threads in this process; for commands, whose users say how many."""
    global _threads
    _threads = count


def one_thread_each() -> None:
    """Keep linear algebra on one thread, before it is imported: its matrices are small, and threads make each solve slower."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def side_by_side(one: Callable[[], A], other: Callable[[], B], *, samples: int) -> tuple[A, B]:
    """Run two jobs and give both results, on a thread each where the arrays are long enough to gain by it.

    >>> side_by_side(lambda: 1, lambda: "a", samples=10)
    (1, 'a')
    """
    if samples < LONG:
        return one(), other()
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(one)
        behind = other()
        return ahead.result(), behind


def all_at_once(jobs: Sequence[Callable[[], A]]) -> list[A]:
    """Run jobs on some threads, and give their results in the jobs' order.

    >>> all_at_once([lambda: 1, lambda: 2, lambda: 3])
    [1, 2, 3]
    """
    if len(jobs) < 2 or _threads < 2:
        return [job() for job in jobs]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(_threads) as pool:
        return list(pool.map(lambda job: job(), jobs))
