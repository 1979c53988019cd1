"""What changes from run to run of a campaign: a machine that warms, gas that escapes, and sensors
that drift.

Within a run none of it changes. The machine has one temperature above the cold state; resistance
and back-EMF follow it in proportion, as copper (0.39 %/K) and magnets do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import msgspec

from winchcascade.blind.crane_motion import SPEED
from winchcascade.blind.twin import FIXED, Twin
from winchcascade.blind.twin_numbers import LOADS, Numbers

COPPER = 0.0039
"""Rise of the resistance of copper. [1/K]"""


class History(msgspec.Struct, frozen=True):
    """Course of a campaign; all is absent by default.

    Parameters
    ----------
    heat : the same in every run, or that of the stator current at the load of the run
    time_constant : of the temperature of the machine, over the time between the starts of two runs
        [1]
    instant : share of a run after which its temperature counts: 0 where the first run is cold [1]
    k_e_fall, r_s_rise : at the hottest run [1]
    gas_leak : share of the absolute precharge that is lost between the first and the last run [1]
    gain_drifts, zero_drifts : of sensors between the first and the last run, by channel [1, unit of
        the log]
    """

    heat: Literal["constant", "load"] = "constant"
    time_constant: float = 1.0
    instant: float = 0.0
    k_e_fall: float = 0.0
    r_s_rise: float = 0.0
    gas_leak: float = 0.0
    gain_drifts: dict[str, float] = {}
    zero_drifts: dict[str, float] = {}


def stator_heat(log: str) -> float:
    """Square of the rms stator current at the plateau of a log, from the mean voltage of a diode
    bridge. [A2]

    Mohan, Undeland, Robbins, Power Electronics, Sec. 5-6: the bridge gives 1.35 times the
    line-to-line voltage, less the drops of two phases and of commutation; the rms current of a
    phase is 0.816 times the DC current.
    """
    n, rotor = Numbers(), SPEED[log] / FIXED.r_drum * FIXED.gear
    overlap = 3.0 / math.pi * FIXED.pole_pairs * rotor * n.l_s
    i_dc = 1.35 * n.k_e * rotor * 30.0 / math.pi / (LOADS[log] + 2.0 * n.r_s + overlap)
    return 2.0 / 3.0 * i_dc**2


def temperatures(history: History, logs: Sequence[str]) -> list[float]:
    """Temperature above the cold state in each run, over that of the hottest: dT/dt = (heat - T) /
    time constant. [1]

    Parameters
    ----------
    logs : in the order of the runs
    """
    rise, found = 0.0, []
    for log in logs:
        heat = stator_heat(log) if history.heat == "load" else 1.0
        found.append(heat + (rise - heat) * math.exp(-history.instant / history.time_constant))
        rise = heat + (rise - heat) * math.exp(-1.0 / history.time_constant)
    return [value / max(found) for value in found] if max(found) > 0.0 else found


def twin_by_run(twin: Twin, history: History, logs: Sequence[str]) -> list[Twin]:
    """The twin as it is in each run; gas and sensors drift evenly from the first run to the
    last.
    """
    found = []
    for k, warm in enumerate(temperatures(history, logs)):
        place, n = k / max(len(logs) - 1, 1), twin.numbers
        numbers = n._replace(
            k_e=n.k_e * (1.0 - history.k_e_fall * warm),
            r_s=n.r_s * (1.0 + history.r_s_rise * warm),
            p_gas=n.p_gas * (1.0 - history.gas_leak * place),
        )
        gains = {
            name: gain * (1.0 + history.gain_drifts.get(name, 0.0) * place)
            for name, gain in twin.gains.items()
        }
        zeros = twin.zeros | {name: drift * place for name, drift in history.zero_drifts.items()}
        found.append(msgspec.structs.replace(twin, numbers=numbers, gains=gains, zeros=zeros))
    return found
