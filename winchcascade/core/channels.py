"""Channels: the quantities that a log may hold, with the units of a log that names none."""

from __future__ import annotations

import msgspec


class Channel(msgspec.Struct, frozen=True):
    """One measured quantity; `unit` is what a log without units is taken to mean, `header` what
    `simulate` writes.
    """

    name: str
    symbol: str
    dimension: str
    unit: str
    header: str


CHANNELS: dict[str, Channel] = {
    channel.name: channel
    for channel in (
        Channel("displacement", "δ", "length", "m", "Displacement (m)"),
        Channel("velocity", "v_line", "velocity", "m/s", "Velocity (m/s)"),
        Channel("pressure", "p_acc", "pressure", "kg/cm2", "Pressure (kg/cm2)"),
        Channel("force", "f_line", "force", "N", "Force (N)"),
        Channel("torque", "tau_pto", "torque", "N.m", "Torque (N.m)"),
        Channel("power_mech", "P_mech", "power", "W", "Mechanical power (W)"),
        Channel("vdc", "v_dc", "voltage", "V", "Vdc (V)"),
        Channel("idc", "i_dc", "current", "A", "Idc (A)"),
        Channel("speed", "omega_pto", "rotation", "rpm", "Shaft speed (rpm)"),
        Channel("flow", "q_flow", "flow", "m3/s", "Flow (m3/s)"),
        Channel("power_ac", "P_ac", "power", "W", "AC power (W)"),
    )
}
