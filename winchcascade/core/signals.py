"""End a process by a signal: at once, without its scratch files, and with one sentence or none."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from winchcascade.core.scratch import clear_own

ENDING = (signal.SIGINT, signal.SIGTERM)
"""An interrupt from the keyboard, and the usual request of a system that a process ends."""


_CURSOR = "\r\x1b[?25h"
"""Shows the cursor of a terminal again, which a bar of progress hides."""


def end_on_signals(sentences: Mapping[signal.Signals, str]) -> None:
    """End this process at a signal, with the sentence given for it, if any, on standard error.

    The process ends past Python: an exception that is raised at any place may be dropped, wrapped or printed by whatever runs
    there, such as an import, a callback or the collection of garbage.
    """

    def end(number: int, _frame: FrameType | None) -> None:
        clear_own()
        sentence = sentences.get(signal.Signals(number))
        if sentence is not None:
            with suppress(OSError):
                os.write(2, f"{_CURSOR if os.isatty(2) else ''}{sentence}\n".encode())
        os._exit(128 + number)

    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # whoever started this process wants it to go on
            signal.signal(number, end)


@contextmanager
def signals_held() -> Generator[Callable[[], bool], None, None]:
    """Hold signals that end the process until the context ends; gives what answers whether one came.

    Outside the main thread, and for signals without a handler of Python, nothing is held.
    """
    came: list[int] = []
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: known for number in ENDING if callable(known := signal.getsignal(number))}
    for number in before:
        signal.signal(number, lambda number, _frame: came.append(number))
    try:
        yield lambda: bool(came)
    finally:
        for number, known in before.items():
            signal.signal(number, known)
        if came:
            signal.raise_signal(came[0])


@contextmanager
def interrupts_blocked() -> Generator[None, None, None]:
    """Keep interrupts from processes that are started now, for as long as they run: the one that starts them handles it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
