"""The clock of a log that names none: the index of a data frame, which stands in the one column without a name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.ingest.dialects import letters_of

if TYPE_CHECKING:
    from winchcascade.ingest.source import Header, Source, Table

_FEWEST = 3
"""Fewer stamps show no clock."""

_NO_NAME = re.compile(r"(?:index|indexlevel0|unnamed0|column\d+)?")
"""Letters of a column that has no name, or the one that a program gave it for want of a name."""


def nameless(header: Header) -> bool:
    """Whether nobody named a column.

    >>> from winchcascade.ingest.source import Header
    >>> [nameless(Header(name)) for name in ("", "Unnamed: 0", "__index_level_0__", "Force")]
    [True, True, True, False]
    """
    return _NO_NAME.fullmatch(letters_of(header.name)) is not None


def index_clock(source: Source, wanted: Sequence[int]) -> tuple[int, Table] | None:
    """Find the one column without a name that is a clock, and the wanted columns beside it; None for none or several."""
    columns = [k for k, header in enumerate(source.headers) if nameless(header) and k not in wanted]
    found = [(k, table) for k in columns if _is_clock(table := source.load(wanted, k))]
    return found[0] if len(found) == 1 else None


def _is_clock(table: Table) -> bool:
    """Whether a column holds stamps, or numbers that rise throughout; whole numbers are no clock, as they count rows."""
    stamps = table.stamps
    if stamps is None:
        return False
    if not isinstance(stamps, np.ndarray):
        from winchcascade.ingest.stamps import looks_like_a_stamp

        return 2 * sum(map(looks_like_a_stamp, stamps)) > len(stamps)
    good = stamps[np.isfinite(stamps)]
    if good.size < _FEWEST:
        return False
    if table.stamped:
        return bool(good[-1] > good[0])
    return bool(np.all(good[1:] > good[:-1]) and np.any(good != np.rint(good)))
