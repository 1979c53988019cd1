"""The outcome of one of many jobs, as a value: one that fails leaves the others alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import msgspec

from winchcascade.core.errors import OutputError, WinchcascadeError

Job = TypeVar("Job")
Done = TypeVar("Done")


class Outcome(msgspec.Struct, Generic[Done], frozen=True):
    """Outcome of one job: its place in the sequence, and its value or the sentence on why there is
    none.

    `rejected` distinguishes an input that cannot be used from a lack of space or memory, after
    which the same job may work.
    """

    place: int
    value: Done | None = None
    fault: str | None = None
    rejected: bool = False


def attempt(work: Callable[[Job], Done], place: int, job: Job) -> Outcome[Done]:
    """Do one job here; what goes wrong becomes its sentence."""
    try:
        return Outcome(place, work(job))
    except WinchcascadeError as fault:
        return Outcome(place, fault=str(fault), rejected=not isinstance(fault, OutputError))
    except OSError as fault:
        return Outcome(
            place,
            fault=f"{fault.filename or 'a file'}: cannot be used ({fault.strerror or fault}).",
        )
    except Exception as fault:
        return Outcome(
            place,
            fault=f"a fault of this program: {type(fault).__name__}: {fault}. Please report it.",
        )
