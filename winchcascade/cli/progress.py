"""Progress of a command on the error stream: a changing line or a bar in a terminal, a line each
ten seconds in a pipe.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Any

from winchcascade.core.plain_text import lines, one_line
from winchcascade.core.process_end import keep_in_mind
from winchcascade.report.render.terminal import QUIET

EVERY = 10.0
"""Interval of the lines in a pipe, and time before the first. [s]"""

MINUTES = 120.0
"""Time from which minutes are stated instead of seconds. [s]"""


@contextmanager
def status_line(title: str) -> Iterator[Callable[[str], None]]:
    """Show the present step and the time until now; the context gives what reports a step."""
    if QUIET.get():
        yield lambda _: None
        return
    if not sys.stderr.isatty():
        present = [title]
        with _lines_in_a_pipe(lambda: present[-1]):
            yield lambda text: present.append(text)
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as Bar
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.table import Column

    step = TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis"))
    with Bar(
        SpinnerColumn(), TimeElapsedColumn(), step, console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task(escape(one_line(title)))
        yield lambda text: bar.update(task, description=escape(one_line(text)))


@contextmanager
def _lines_in_a_pipe(present: Callable[[], str]) -> Iterator[None]:
    """Print the time until now and the present step each ten seconds, until the context ends."""
    began, ended = time.monotonic(), Event()

    def report() -> None:
        while not ended.wait(EVERY):
            _print(f"[{time.monotonic() - began:.0f} s] {present()}")

    thread = Thread(target=report, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _print(text: str) -> None:
    """Print one line on the error stream."""
    sys.stderr.write(f"{lines(one_line(text))}\n")
    sys.stderr.flush()


class Progress:
    """Counts the parts of a piece of work while it is a context, and reports faults as they come.

    Parameters
    ----------
    title : of the work
    keeps : the folder in which each part is kept as soon as it is done; None where all are written
        together
    """

    def __init__(self, title: str, *, keeps: Path | None = None) -> None:
        self._title, self._keeps = title, keeps
        self._bar: Any = None
        self._open = ExitStack()
        self._kept = self._all = self._todo = self._done = 0
        self._began = 0.0

    def __enter__(self) -> Progress:
        """Start with nothing shown: a batch that has nothing to do shows nothing."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        fault: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the bar as it is."""
        self._open.close()

    def begin(self, kept: int, todo: int) -> None:
        """Show the bar, if there is something to do."""
        self._kept, self._all, self._todo = kept, kept + todo, todo
        self._began = time.monotonic()
        self._remember()
        if not todo or QUIET.get():
            return
        if not sys.stderr.isatty():
            self._open.enter_context(_lines_in_a_pipe(self._present))
            return
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        self._bar = self._open.enter_context(Bar(*columns, console=Console(stderr=True)))
        self._bar.add_task(escape(self._title), total=kept + todo, completed=kept)

    def waiting(self, folder: Path) -> None:
        """Report that another call works in the folder of the results, so that the wait does not
        look like a fault.
        """
        if not QUIET.get():
            _print(f"waiting for another call that works in {folder}")

    def done(self, name: str, fault: str | None) -> None:
        """Count one more as done; of one that failed show the name at once, the reason comes
        with the others at the end.
        """
        self._done += 1
        self._kept += fault is None
        self._remember()
        if self._bar is not None:
            self._bar.advance(self._bar.task_ids[0])
        if fault is None or QUIET.get():
            return
        if self._bar is not None:
            line = lines(one_line(f"failed: {name}"))
            self._bar.console.print(line, markup=False, highlight=False)
        else:
            _print(f"failed: {name}")

    def _present(self) -> str:
        """How much is done, and how long the rest takes."""
        text = f"{self._title}: {self._done} of {self._todo}"
        if self._done == 0:
            return text
        rest = (time.monotonic() - self._began) * (self._todo / self._done - 1.0)
        return f"{text}, {f'{rest:.0f} s' if rest < MINUTES else f'{rest / 60.0:.0f} min'} remain"

    def _remember(self) -> None:
        """Keep in mind what an interrupt leaves in the folder."""
        if self._keeps is not None:
            keep_in_mind(f"{self._kept} of {self._all} are finished and kept in {self._keeps}")
