"""The end of a process at a signal: at once, without its scratch, with one sentence on what
remains.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Mapping
from contextlib import suppress
from types import FrameType

from winchcascade.core.files import clear_own

ENDING = (signal.SIGINT, signal.SIGTERM)
"""An interrupt from the keyboard, and the usual request of a system that a process ends."""

_CURSOR = "\r\x1b[?25h"
"""Shows the cursor of a terminal again, which a bar of progress hides."""

_UNTIDY = "ignore:resource_tracker"
"""Option of Python by which the helper process of a pool removes its semaphores without a
warning.
"""

_kept = ""
"""What a process that is ended now leaves behind; `keep_in_mind` changes it."""


def keep_in_mind(kept: str) -> None:
    """Set what exists if the process is ended from now on, as a clause without its full stop."""
    global _kept
    _kept = kept


def remains() -> str:
    """What remains of a command that is ended now, as the end of a sentence."""
    return f"{_kept}{', ' if _kept else ''}no file was left half-written."


def end_on_signals(sentences: Mapping[signal.Signals, str]) -> None:
    """End this process at a signal, without its scratch, on standard error with the beginning of a
    sentence that is given for it, if any, and what remains.

    The process ends past Python: an exception that is raised at any place may be dropped, wrapped
    or printed by whatever runs there, such as an import, a callback or the collection of garbage.
    """

    def end(number: int, _frame: FrameType | None) -> None:
        clear_own()
        sentence = sentences.get(signal.Signals(number))
        if sentence is not None:
            with suppress(OSError):
                cursor = _CURSOR if os.isatty(2) else ""
                os.write(2, f"{cursor}{sentence}; {remains()}\n".encode())
        os._exit(128 + number)

    keep_in_mind("")
    if _UNTIDY not in sys.warnoptions:
        sys.warnoptions.append(_UNTIDY)
    for number in ENDING:
        if (
            signal.getsignal(number) is not signal.SIG_IGN
        ):  # whoever started this process wants it to go on
            signal.signal(number, end)
