"""Progress of a command on the error stream: a line or a bar in a terminal, elsewhere a line for each fault."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

from winchcascade.core.plain_text import lines, one_line
from winchcascade.report.screen import QUIET


@contextmanager
def status_line(title: str) -> Iterator[Callable[[str], None]]:
    """Show in one changing line of a terminal what is being done; elsewhere show nothing."""
    if QUIET.get() or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.markup import escape

    with Console(stderr=True).status(escape(one_line(title))) as line:
        yield lambda text: line.update(escape(f"{one_line(title)}: {one_line(text)}"))


class Progress:
    """Shows a bar while it is a context, and reports faults as they come."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._bar: Any = None

    def __enter__(self) -> Progress:
        """Start with nothing shown: a batch that has nothing to do shows nothing."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.stop()

    def begin(self, kept: int, todo: int) -> None:
        """Show the bar in a terminal, if there is something to do."""
        if not todo or QUIET.get() or not sys.stderr.isatty():
            return
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        self._bar = Bar(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
            console=Console(stderr=True),
        )  # fmt: skip
        self._bar.add_task(escape(self._title), total=kept + todo, completed=kept)
        self._bar.start()

    def waiting(self, folder: Path) -> None:
        """Report that another call works in the folder of the results, so that the wait does not look like a fault."""
        if QUIET.get():
            return
        sys.stderr.write(lines(f"waiting for another call that works in {one_line(str(folder))}\n"))
        sys.stderr.flush()

    def done(self, name: str, fault: str | None) -> None:
        """Count one more as done; of one that failed show the name at once, the reason comes with the others at the end."""
        if self._bar is not None:
            self._bar.advance(self._bar.task_ids[0])
        if fault is None or QUIET.get():
            return
        line = lines(one_line(f"failed: {name}"))
        if self._bar is not None:
            self._bar.console.print(line, markup=False, highlight=False)
        else:
            sys.stderr.write(f"{line}\n")
