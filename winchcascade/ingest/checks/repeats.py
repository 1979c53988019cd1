"""Rows that a logger or a spreadsheet wrote twice: a stretch of noisy channels that equals an earlier one in every digit."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.checks.stuck import repeats_of

FEWEST = 20
"""Smallest number of rows that equal earlier ones: noise of two channels repeats none by chance."""

MOST_ROWS = 1_000_000
"""Longer logs are not searched, as sorting their rows would take longer than all other checks."""

RARELY = 0.3
"""Chance that a sample repeats the one before, up to which a channel is noisy enough to distinguish rows. [1]"""


def repeated_rows(t: Signal, channels: Mapping[str, Signal]) -> list[Finding]:
    """Report stretches of rows that equal earlier ones in all channels; they are kept, as the log does not show which count.

    Only logs with a noisy channel are searched: without noise, equal cycles are equal in every digit. Where the displacement is
    logged, it jumps back, which the check of the clock reports.
    """
    if t.size > MOST_ROWS or not any(repeats_of(np.diff(x)) < RARELY for x in channels.values()):
        return []
    rng = np.random.default_rng(0)
    key = np.zeros(t.size)
    for x in channels.values():  # rows that are equal have equal sums, others almost never
        key += rng.uniform(1.0, 2.0) * x
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    later = np.zeros(t.size, dtype=np.intp)  # by how many rows the earlier one of a pair lies before
    later[order[same + 1]] = order[same + 1] - order[same]
    edges = np.flatnonzero(np.diff(later, prepend=0, append=0))
    found = [
        (a, b) for a, b in pairwise(edges.tolist()) if later[a] > 1 and b - a >= FEWEST and _changes(channels, a, b)
    ]
    if not found:
        return []
    rows, first = sum(b - a for a, b in found), found[0]
    places = f"{len(found)} stretch{'es' if len(found) > 1 else ''}"
    what = f"{rows} rows equal earlier ones in every channel, in {places}: they were written twice; check how the file was made"
    start, end = float(t[first[0]]), float(t[found[-1][1] - 1])
    return [Finding("repeated_rows", what, "reported and kept", start=start, end=end, count=rows)]


def _changes(channels: Mapping[str, Signal], first: int, last: int) -> bool:
    """Whether any channel changes in most rows of a stretch: rests may repeat."""
    return any(2 * np.count_nonzero(np.diff(x[first:last])) > last - first for x in channels.values())
