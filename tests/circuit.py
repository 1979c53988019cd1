"""Generator, diode bridge, capacitor and resistor in steady state: by ngspice, and by the table
of the rig's model.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from typing import NamedTuple

from scipy.optimize import brentq

from winchcascade.rig.bridge import bridge_state, bridge_table

K_E, R_S, L_S, V_DIODE, POLE_PAIRS, C_DC = 0.0617, 0.61, 3.35e-3, 0.7, 2, 2.2e-3
"""Numbers of the circuit: V/rpm line to line, rms; ohm and henry a phase; volt a diode; pairs of
poles; farad.
"""

NGSPICE = shutil.which("ngspice")
"""The simulator, None where it is not installed."""

SETTLING = 7.0
"""Time constants of the DC link that ngspice is given before it is measured: they leave a
thousandth of the first error.
"""

MEASURED = 6
"""Periods over which ngspice takes means."""

CURRENT, THERMAL = 5.0, 0.025864
"""A diode drops `V_DIODE` at this current [A], and by its thermal voltage [V] more or less where
that is e times as large.
"""

STEPS = 600
"""Steps of a period, at least."""


class State(NamedTuple):
    """Steady state: voltage of the DC link [V], stator current, rms [A], air-gap power [W]."""

    v_dc: float
    i_s: float
    p_em: float


def solved(rpm: float, load: float) -> State:
    """Steady state by the bridge of the model at a speed and a load [ohm]."""
    v_ll, reactance = K_E * rpm, POLE_PAIRS * 2.0 * math.pi * rpm / 60.0 * L_S

    def surplus(v_dc: float) -> float:
        return (
            bridge_state(v_dc + 2.0 * V_DIODE, v_ll, R_S, reactance, bridge_table())[0]
            - v_dc / load
        )

    v_dc = float(brentq(surplus, 0.01, math.sqrt(2.0) * v_ll - 2.0 * V_DIODE))
    i_dc, i_s = bridge_state(v_dc + 2.0 * V_DIODE, v_ll, R_S, reactance, bridge_table())[:2]
    return State(v_dc, i_s, (v_dc + 2.0 * V_DIODE) * i_dc + 3.0 * R_S * i_s**2)


def seconds_of(rpm: float, load: float) -> float:
    """Simulated time that ngspice needs for a steady state. [s]"""
    return SETTLING * load * C_DC + MEASURED * _period(rpm)


def solved_by_ngspice(rpm: float, load: float) -> State:
    """Steady state by ngspice, switch by switch; the DC link begins at the textbook's average."""
    assert NGSPICE is not None
    done = subprocess.run(
        [NGSPICE, "-b"],
        input=netlist(rpm, load),
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    found = dict(re.findall(r"^(v_dc|i_s|p_em)\s*=\s*(\S+)", done.stdout, re.MULTILINE))
    if len(found) != len(State._fields):
        raise RuntimeError(f"ngspice gave no means:\n{done.stdout}\n{done.stderr}")
    return State(**{name: float(value) for name, value in found.items()})


def netlist(rpm: float, load: float) -> str:
    """The circuit as ngspice reads it: three sinusoidal EMFs behind R and L, six diodes, C and the
    load.

    The lower rail is earth; the star point, which floats, is tied to it so weakly that it does not
    matter.
    """
    period, end = _period(rpm), seconds_of(rpm, load)
    peak = K_E * rpm * math.sqrt(2.0 / 3.0)
    phases = [
        f"V{k} e{k} star SIN(0 {peak:.9g} {1.0 / period:.9g} 0 0 {-120 * n})\n"
        f"R{k} e{k} m{k} {R_S}\nL{k} m{k} {k} {L_S}\nDu{k} {k} dc real\nDl{k} 0 {k} real"
        for n, k in enumerate("abc")
    ]
    span = f"from={end - MEASURED * period:.9g} to={end:.9g}"
    return "\n".join(
        [
            "* generator, diode bridge, DC link, load",
            *phases,
            f".model real D(Is={CURRENT * math.exp(-V_DIODE / THERMAL):.6g} N=1)",
            f"C1 dc 0 {C_DC} IC={1.35 * K_E * rpm:.9g}\nRload dc 0 {load}\nRstar star 0 1e5",
            "Bem em 0 V=-(V(ea,star)*I(Va)+V(eb,star)*I(Vb)+V(ec,star)*I(Vc))",
            ".options method=gear reltol=1e-4",
            f".tran {period / STEPS:.9g} {end:.9g} {end - (MEASURED + 1) * period:.9g} "
            f"{period / STEPS:.9g} UIC",
            f".meas tran v_dc AVG V(dc) {span}",
            f".meas tran i_s RMS I(Va) {span}",
            f".meas tran p_em AVG V(em) {span}",
            ".end",
            "",
        ]
    )


def _period(rpm: float) -> float:
    """Period of the back-EMF. [s]"""
    return 60.0 / (POLE_PAIRS * rpm)
