"""Findings about samples of one channel, and the unit in which they give its values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.quantity import find_unit
from winchcascade.core.run import CHANNELS, Finding

if TYPE_CHECKING:
    from winchcascade.core.run import FindingKind, Mask, Signal


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
    """A finding about a channel that holds one value throughout."""
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


def usual_unit(name: str) -> tuple[str, float]:
    """Unit in which the values of a channel are reported, and its factor to SI."""
    unit = find_unit(CHANNELS[name].unit)
    assert unit is not None
    return CHANNELS[name].unit, unit.factor
