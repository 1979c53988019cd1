"""Which table of a file is the log, where it holds several that could be: named by the operator, never chosen silently."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from winchcascade.core.errors import LogError
from winchcascade.ingest.dialects import recognise
from winchcascade.ingest.source import Header

FEWEST_ROWS = 10
"""A table with fewer rows than this is a list of parameters or results, no log."""

MOST_NAMED = 12
"""Names that a message lists."""


def moves(headers: Iterable[Header]) -> bool:
    """Whether columns hold the motion of a line, as those of a log do."""
    return any(recognise(header) in ("velocity", "displacement") for header in headers)


def choose(candidates: Sequence[str], wanted: str | None, where: str, kind: str, *, names: Sequence[str] = ()) -> str:
    """Choose the table that is read: the one that is wanted, by name or by its number from 1 on, else the only candidate.

    Parameters
    ----------
    candidates : tables that could be the log, one at least
    kind : what the format calls a table
    names : of all tables of the file, which can be wanted; by default the candidates

    Raises
    ------
    LogError : there is no such table, or there are several candidates and none is wanted
    """
    names = names or candidates
    if wanted is not None:
        alike = [name for name in names if name == wanted] or [n for n in names if n.casefold() == wanted.casefold()]
        if not alike and wanted.isascii() and wanted.isdigit() and 1 <= int(wanted[:9]) <= len(names):
            alike = [names[int(wanted[:9]) - 1]]
        if alike:
            return alike[0]
        raise LogError(
            f"{where}: has no {kind} {wanted!r}; expected one of {_listed(names)}, or a number from 1 to {len(names)}; "
            "correct --sheet, or sheet in campaign.toml."
        )
    if len(candidates) == 1:
        return candidates[0]
    raise LogError(
        f"{where}: {len(candidates)} {kind}s could be the log: {_listed(candidates)}; expected one; name it with "
        '--sheet NAME, or with sheet = "NAME" in campaign.toml.'
    )


def refuse_sheet(wanted: str | None, where: str) -> None:
    """Reject the choice of a table in a file that holds one alone: LogError."""
    if wanted is not None:
        raise LogError(
            f"{where}: is one table, and --sheet {wanted} names another; expected a workbook, a MATLAB file or TDMS; leave "
            "--sheet out, or sheet in campaign.toml."
        )


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(map(repr, names[:MOST_NAMED])) + more
