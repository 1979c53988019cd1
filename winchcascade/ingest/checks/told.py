"""Findings about samples of one channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.run import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import FindingKind, Signal

    Mask = NDArray[np.bool_]


def at(t: Signal, bad: Mask, kind: FindingKind, channel: str, what: str, *, removed: bool = False) -> Finding:
    """A finding about the samples of one channel where `bad` is set."""
    index = np.flatnonzero(bad)
    return Finding(
        kind,
        f"{index.size} {channel} {what}",
        "bridged by straight lines" if removed else "reported and kept",
        channel,
        float(t[index[0]]),
        float(t[index[-1]]),
        int(index.size),
        int(index.size) if removed else 0,
    )


def dead(t: Signal, name: str, action: str) -> Finding:
    """A finding about a channel that tells nothing throughout."""
    return Finding(
        "stuck",
        f"{name} holds one value through the whole log while the line moves",
        action,
        name,
        float(t[0]),
        float(t[-1]),
        t.size,
        t.size,
    )
