"""Progress in a pipe: how far the work is, how long the rest takes, and what an interrupt leaves."""

import io
import re
import sys
from pathlib import Path
from threading import Event

import pytest
from calls import PATIENCE

from winchcascade.cli import progress
from winchcascade.core.process_end import remains


class Pipe(io.StringIO):
    """A stream that is no terminal, with a line as soon as one may come."""

    def __init__(self) -> None:
        super().__init__()
        self._written = Event()

    def write(self, text: str) -> int:
        count = super().write(text)
        self._written.set()
        return count

    def wait_for(self, pattern: str) -> str:
        """The first line of a pattern."""
        while (found := re.search(f"(?m)^{pattern}$", self.getvalue())) is None:
            assert self._written.wait(PATIENCE), self.getvalue()
            self._written.clear()
        return found.group()


def pipe(monkeypatch: pytest.MonkeyPatch) -> Pipe:
    """The error stream, set within a test, as pytest sets its own before each."""
    stream = Pipe()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "EVERY", 1e-2)
    return stream


def test_a_pipe_gets_the_number_of_finished_parts_and_the_time_of_the_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    piped = pipe(monkeypatch)
    with progress.Progress("trial") as watch:
        watch.begin(kept=2, todo=4)
        watch.done("a", None)
        piped.wait_for(r"\[\d+ s\] trial: 1 of 4, \d+ s remain")
        watch.done("b", "no log")
        assert piped.wait_for(r"failed: .*") == "failed: b"


def test_a_pipe_gets_the_present_step(monkeypatch: pytest.MonkeyPatch) -> None:
    piped = pipe(monkeypatch)
    with progress.status_line("one") as on_progress:
        on_progress("two\nlines")
        piped.wait_for(r"\[\d+ s\] two.*lines")


def test_an_interrupt_states_what_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe(monkeypatch)
    with progress.Progress("trial", keeps=Path("results")) as watch:
        watch.begin(kept=2, todo=4)
        watch.done("a", None)
        watch.done("b", "no log")
    assert remains().startswith("3 of 6 are finished and kept in results")
