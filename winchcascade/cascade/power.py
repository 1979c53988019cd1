"""The three power streams: line, shaft, DC link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from winchcascade.integrate import Stream
    from winchcascade.run import Signal

STAGES = ("line", "mech", "gen")
"""The stages of the cascade in the order of the power's way."""


def power_line(f_line: Signal, v_line: Signal) -> Signal:
    """Power that the tether brings in, P = F v (Eq. 2); forces in N, velocities in m/s, payout positive. [W]"""
    return f_line * v_line


def power_mech(tau_pto: Signal, v_line: Signal, r_drum: float) -> Signal:
    """Power of the shaft behind the clutch, P = tau v / r_drum (Eq. 3); torque in N m, radius in m. [W]"""
    return tau_pto * (v_line / r_drum)


def power_gen(v_dc: Signal, i_dc: Signal) -> Signal:
    """Power at the DC link, P = Vdc Idc (Eq. 4). [W]"""
    return v_dc * i_dc


def stream(channels: Mapping[str, Signal], stage: str, r_drum: float | None) -> Stream | None:
    """Power stream of one stage as a function of the rows of the log, None where log or rig lack what it needs. [W]

    A logged mechanical power is taken as it is; otherwise torque and drum radius give it.
    """
    if any(name not in channels for name in sources(channels, stage)):
        return None
    x, y = (channels[name] for name in (*sources(channels, stage), "velocity")[:2])
    if stage == "line":
        return lambda part: power_line(x[part], y[part])
    if stage == "gen":
        return lambda part: power_gen(x[part], y[part])
    if "power_mech" in channels:
        return x.__getitem__
    return None if r_drum is None else lambda part: power_mech(x[part], y[part], r_drum)


def power(channels: Mapping[str, Signal], stage: str, r_drum: float | None) -> Signal | None:
    """Power stream of one stage over the whole log, (n,), None where log or rig lack what it needs. [W]"""
    part = stream(channels, stage, r_drum)
    return None if part is None else part(slice(None))


def sources(channels: Mapping[str, Signal], stage: str) -> tuple[str, ...]:
    """Channels that a stage's power is made of."""
    if stage == "line":
        return ("force", "velocity")
    if stage == "mech":
        return ("power_mech",) if "power_mech" in channels else ("torque", "velocity")
    return ("vdc", "idc")
