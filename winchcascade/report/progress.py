"""How a batch goes on, on the error stream: a bar where a person looks, a line for each fault elsewhere."""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType
from typing import Any

from winchcascade.core.plain_text import lines, one_line


class Telling:
    """Says in one changing line what is being done, where a person looks, and nothing elsewhere."""

    def __init__(self, title: str) -> None:
        self._title = one_line(title)
        self._status: Any = None

    def __enter__(self) -> Telling:
        """Show the line if somebody can see it."""
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.markup import escape

            self._status = Console(stderr=True).status(escape(self._title))
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the line away."""
        if self._status is not None:
            self._status.stop()

    def __call__(self, text: str) -> None:
        """Tell what is being done now."""
        if self._status is not None:
            from rich.markup import escape

            self._status.update(escape(f"{self._title}: {one_line(text)}"))


class Progress:
    """Shows a bar while it is a context; tells faults as they come."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        """Start with nothing shown: a batch that has nothing to do says nothing."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.stop()

    def begin(self, kept: int, todo: int) -> None:
        """Show the bar if somebody can see it and there is something to do."""
        if not todo or not sys.stderr.isatty():
            return
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        self._bar = Bar(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
            console=Console(stderr=True),
        )  # fmt: skip
        self._task = self._bar.add_task(escape(self._title), total=kept + todo, completed=kept)
        self._bar.start()

    def waiting(self, folder: Path) -> None:
        """Report that another call works in the folder of the results, so that nobody takes the wait for a fault."""
        sys.stderr.write(lines(f"waiting for another call that works in {one_line(str(folder))}\n"))
        sys.stderr.flush()

    def done(self, name: str, fault: str | None) -> None:
        """One more is done, or failed: its name is then told at once, the reason with the others at the end."""
        if self._bar is not None:
            self._bar.advance(self._task)
        if fault is None:
            return
        line = lines(one_line(f"failed: {name}"))
        if self._bar is not None:
            self._bar.console.print(line, markup=False, highlight=False)
        else:
            sys.stderr.write(f"{line}\n")
