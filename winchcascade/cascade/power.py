"""The three power streams: line, shaft, DC link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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


POWER_CHANNELS = ("velocity", "force", "torque", "power_mech", "vdc", "idc")
"""Channels that the powers are made of."""


def power(channels: Mapping[str, Signal], stage: str, r_drum: float | None) -> Signal | None:
    """Power stream of one stage, None where the log or the rig lacks what it needs. [W]

    A logged mechanical power is taken as it is; otherwise torque and drum radius give it.
    """
    if stage == "line" and "force" in channels:
        return power_line(channels["force"], channels["velocity"])
    if stage == "mech" and "power_mech" in channels:
        return channels["power_mech"]
    if stage == "mech" and "torque" in channels and r_drum is not None:
        return power_mech(channels["torque"], channels["velocity"], r_drum)
    if stage == "gen" and "vdc" in channels and "idc" in channels:
        return power_gen(channels["vdc"], channels["idc"])
    return None


def sources(channels: Mapping[str, Signal], stage: str) -> tuple[str, ...]:
    """Channels that a stage's power is made of."""
    if stage == "line":
        return ("force", "velocity")
    if stage == "mech":
        return ("power_mech",) if "power_mech" in channels else ("torque", "velocity")
    return ("vdc", "idc")
