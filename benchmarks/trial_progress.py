"""Print each case of a trial as it is done."""

from __future__ import annotations

import time

from winchcascade.core.jobs import Nobody


class Printed(Nobody):
    """Prints each case as it is done."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()

    def done(self, name: str, fault: str | None) -> None:
        """Print a case."""
        print(f"{time.perf_counter() - self._begin:7.0f} s  {name}{': ' + fault if fault else ''}", flush=True)
