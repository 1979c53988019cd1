"""Independent pieces of work on the same arrays, side by side where the arrays are long enough to gain by it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")

LONG = 1_000_000
"""Below this many samples a second thread costs more than it brings."""


def side_by_side(one: Callable[[], A], other: Callable[[], B], *, samples: int) -> tuple[A, B]:
    """Run two jobs and give both results; numpy leaves the interpreter free while it works on long arrays.

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
