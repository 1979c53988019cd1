"""The channels of a log: name, symbol, dimension, unit and header in the files this tool writes."""

from __future__ import annotations

import msgspec


class Channel(msgspec.Struct, frozen=True):
    """One measured quantity; `unit` is what a log without units is taken to mean, `header` what `simulate` writes."""

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
    )
}

SIMULATED_HEADERS = ("Generator speed (rpm)", "Stator current (A rms)", "Air-gap torque (N.m)")
"""Columns that all together mark a log as simulated: a rig may measure one of them, as the speed of its generator."""
