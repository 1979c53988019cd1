"""What lags between the channels change of energies: a factor of a power that is recorded late
meets another motion.

Channels that share an amplifier or a logger are late together. A relation between a channel and the
motion therefore moves the channel and all that follow it; what a rig file states of a channel
(`u_lag`) moves that channel alone."""

from __future__ import annotations

from winchcascade.core.accuracy import ErrorSource
from winchcascade.reduction.reduction_result import Reduction

TIMING = "timing"
"""Source of uncertainty that is no channel: lags between channels and motion."""


def lag_sources(reduction: Reduction) -> list[tuple[ErrorSource, tuple[str, ...]]]:
    """Independent lags of a log, each with the channels that it moves against the velocity. [s]

    Every window follows the velocity, so that a lag of it moves all others.
    """
    channels, relations = reduction.run.channels, reduction.relations
    stated = {
        name: s
        for name, s in reduction.rig.sensors.items()
        if s.u_lag is not None and name in channels
    }
    found = []
    for name, sensor in stated.items():
        moved = (
            (name,) if name != "velocity" else tuple(other for other in channels if other != name)
        )
        source = ErrorSource(
            TIMING, "lag", sensor.u_lag or 0.0, None, f"u_lag of {name}", "standard_uncertainty"
        )
        found.append((source, moved))
    for relation in relations:
        if relation.y not in stated:
            follow = (r.y for r in relations if r.x == relation.y and r.y not in stated)
            moved = (relation.y, *follow)
            origin = f"{' and '.join(moved)} against {relation.x} in the log"
            found.append(
                (ErrorSource(TIMING, "lag", relation.u_remaining, None, origin, "relation"), moved)
            )
    return found
