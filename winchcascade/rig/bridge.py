"""The three-phase diode bridge on a stiff DC link, from open circuit to heavy overlap: exact, by a
table of its steady states.

A textbook average deviates by 3 % near open circuit, where the capacitor charges to the peak, and
by 7 % at 4.5 ohm at speed, where commutation takes 60 degrees. So `benchmarks/switched_bridge.py`
solved the switched circuit over a grid once; here the table is interpolated by cubic convolution
(Keys 1981). On a stiff DC side the state follows speed and voltage within a period.

The inverse gives the voltage, or the back-EMF, at which the bridge carries a given current. Both
are monotonic in the current, so there is one root: Newton steps by the slopes of the bridge start
at the previous sample and stay in a bracket.
"""

import math
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numba import njit

from winchcascade.core.run import Signal
from winchcascade.rig.parts import NO_ROLLOFF, ROLLOFF_KNOTS, GeneratorModel, rolloff_curve
from winchcascade.rig.physics import FASTMATH, RPM, reactance

_SQRT2 = math.sqrt(2.0)

TABLE = Path(__file__).with_name("bridge_table.npy")
"""The solved grid, (s, phi, 2): mean DC current and rms phase current, times Z / V_LL with Z =
sqrt(R^2 + (w_e L)^2).
"""

S_POINTS, PHI_POINTS = 257, 65
"""Points of the grid, even in s = sqrt(1 - u) and in phi = atan(rho), with u = (Vdc + 2 Vd) /
(sqrt(2) V_LL) and rho = R / (w_e L): both currents are closest to straight over these."""

PHI_LOW, PHI_HIGH = 0.03, 1.56
"""Ends of the grid: R 3 % of the reactance, as of a short circuit at speed, and the reactance 1
% of R, as at a crawl.
"""


@cache
def bridge_table() -> Signal:
    """The solved grid with its border, (s + 2, phi + 2, 2)."""
    return with_border(np.load(TABLE).astype(np.float64))


def with_border(grid: Signal) -> Signal:
    """A grid (s, phi, 2) with a border that lets the interpolation reach the edges, (s + 2, phi
    + 2, 2).
    """
    wide = grid
    for _ in range(2):
        ends = [3 * a - 3 * b + c for a, b, c in (wide[:3], wide[:-4:-1])]
        wide = np.concatenate((ends[:1], wide, ends[1:])).swapaxes(0, 1)
    return np.ascontiguousarray(wide)


@lru_cache(maxsize=64)
def blended_table(averaged: float, uncommutated: float) -> Signal:
    """The table of `bridge_table` with a share of the textbook average in place of the switched
    circuit, (s + 2, phi + 2, 2).

    The average is v_total = (3 sqrt(2)/pi) v_ll - (3/pi) x i_dc - 2 r_s i_dc, no current above the
    first term, with currents of the phases in blocks (Mohan, Undeland and Robbins 2003, chapter 5).

    Parameters
    ----------
    averaged : share of the average [1]
    uncommutated : share of the average without the term with the reactance x, the voltage that
        commutation takes [1]
    """
    if averaged == uncommutated == 0.0:
        return bridge_table()
    s = np.linspace(0.0, 1.0, S_POINTS)[:, None]
    phi = np.linspace(PHI_LOW, PHI_HIGH, PHI_POINTS)
    driving = np.maximum(3.0 * _SQRT2 / math.pi - _SQRT2 * (1.0 - s * s), 0.0)
    blended = (1.0 - averaged - uncommutated) * bridge_table()
    for share, commutation in ((averaged, 3.0 / math.pi * np.cos(phi)), (uncommutated, 0.0)):
        i_dc = driving / (commutation + 2.0 * np.sin(phi))
        blended += share * with_border(np.stack([i_dc, math.sqrt(2.0 / 3.0) * i_dc], axis=-1))
    return blended


# inline, as all of the table: a call takes longer than what it does
@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def _weights(x: float) -> tuple[float, float, float, float]:
    """Weights of four points in a row for a place between the middle two, 0 to 1 (Keys 1981, a =
    -1/2).
    """
    return (
        ((-0.5 * x + 1.0) * x - 0.5) * x,
        (1.5 * x - 2.5) * x * x + 1.0,
        ((-1.5 * x + 2.0) * x + 0.5) * x,
        (0.5 * x - 0.5) * x * x,
    )


@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def _slopes(x: float) -> tuple[float, float, float, float]:
    """Derivatives of `_weights`."""
    return (
        (-1.5 * x + 2.0) * x - 0.5,
        (4.5 * x - 5.0) * x,
        (-4.5 * x + 4.0) * x + 0.5,
        (1.5 * x - 1.0) * x,
    )


@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def bridge_state(
    v_total: float, v_ll: float, r_s: float, reactance: float, table: Signal
) -> tuple[float, float, float, float]:
    """Mean DC current, stator rms current, and how both change with the DC voltage.

    Parameters
    ----------
    v_total : voltage of the DC link and of the two conducting diodes [V]
    v_ll : back-EMF, line to line, rms [V]
    r_s, reactance : of a phase [ohm]
    table : as `bridge_table` gives it

    Returns
    -------
    i_dc, i_s, di_dc, di_s : currents [A] and their slopes over `v_total` [A/V], 0 where the
        back-EMF does not reach the DC link. Currents are proportional to the voltages at a given
        ratio of these, so the slope over `v_ll` is (i - v_total di) / v_ll.
    """
    if v_ll <= 0.0 or v_total >= _SQRT2 * v_ll:
        return 0.0, 0.0, 0.0, 0.0
    rows, columns = table.shape[0] - 3, table.shape[1] - 3
    root = math.sqrt(1.0 - max(v_total, 0.0) / (_SQRT2 * v_ll))
    s, phi = root * rows, (math.atan(r_s / reactance) - PHI_LOW) * columns / (PHI_HIGH - PHI_LOW)
    i, j = min(int(s), rows - 1), min(max(int(phi), 0), columns - 1)
    across, rise, along = _weights(s - i), _slopes(s - i), _weights(min(max(phi - j, 0.0), 1.0))
    i_dc = i_s = up_dc = up_s = 0.0
    for a in range(4):
        row_dc = row_s = 0.0
        for b in range(4):
            row_dc += along[b] * table[i + a, j + b, 0]
            row_s += along[b] * table[i + a, j + b, 1]
        i_dc += across[a] * row_dc
        i_s += across[a] * row_s
        up_dc += rise[a] * row_dc
        up_s += rise[a] * row_s
    # not math.hypot, which takes longer and guards against values that no impedance has
    scale = v_ll / math.sqrt(r_s * r_s + reactance * reactance)
    falling = -scale * rows / (2.0 * max(root, 1e-6) * _SQRT2 * v_ll)
    return (
        max(i_dc, 0.0) * scale,
        max(i_s, 0.0) * scale,
        min(up_dc * falling, 0.0),
        min(up_s * falling, 0.0),
    )


CLOSE = 1e-9
"""The last Newton step is shorter than this share of the voltage; its error is about the square
of that.
"""

MAX_STEPS = 60
"""Maximum number of steps. Where the bridge cannot carry the current, the bracket is halved at
each step.
"""


@njit(cache=True, error_model="numpy", fastmath=FASTMATH)
def _inverse(
    known: Signal,
    taken: Signal,
    conductance: float,
    r_s: float,
    reactance: Signal,
    table: Signal,
    of_voltage: bool,
) -> tuple[Signal, Signal]:
    """Find the voltage at a known back-EMF, or else the back-EMF at a known voltage, at which the
    bridge carries a current.

    The current is `taken` [A] and what a `conductance` takes at the voltage [S]. More voltage gives
    less current and more back-EMF gives more, so there is one root. The search starts at the ratio
    of the previous sample. Without a current the voltage is the peak of the back-EMF.
    """
    found: Signal = np.maximum(known * _SQRT2, 0.0) if of_voltage else known / _SQRT2
    i_s, ratio = np.zeros_like(known), 1.27 if of_voltage else 1.0
    for n in range(known.size):
        if taken[n] + conductance * (found[n] if of_voltage else known[n]) <= 0.0 or found[n] < 0.0:
            continue
        low, high = (
            (0.0, found[n])
            if of_voltage
            else (found[n], 3.0 * known[n] + 10.0 * taken[n] * (r_s + reactance[n]))
        )
        now = min(max(ratio * known[n], low), high)
        for _ in range(MAX_STEPS):
            v_total, v_ll = (now, known[n]) if of_voltage else (known[n], now)
            i_b, i_s[n], by_v, _ = bridge_state(v_total, v_ll, r_s, reactance[n], table)
            missing = taken[n] + conductance * v_total - i_b
            if (missing < 0.0) == of_voltage:
                low = now
            else:
                high = now
            slope = 0.0  # without a back-EMF: the bracket is halved
            if v_ll > 0.0:
                slope = by_v - conductance if of_voltage else (i_b - v_total * by_v) / v_ll
            step = missing / slope if slope != 0.0 else math.inf
            if abs(step) >= CLOSE * max(known[n], now) and not low < now + step < high:
                step = 0.5 * (low + high) - now
            now += step
            if abs(step) < CLOSE * max(known[n], now):
                break
        found[n] = now
        if known[n] > 0.0:
            ratio = now / known[n]
    return found, i_s


ROUNDS = 8
"""Rounds in which stator current and roll-off settle: the current follows almost alone from that
of the bridge.
"""


def dc_voltages(
    machine: GeneratorModel, omega: Signal, taken: Signal, table: Signal, conductance: float = 0.0
) -> tuple[Signal, Signal]:
    """Voltage of DC link and diodes in the steady state of a machine, and its stator current, (n,)
    [V, A].

    Parameters
    ----------
    omega : (n,) speed of the high-speed shaft [rad/s]
    taken : (n,) current that is taken of the bridge; without one the voltage is the peak of the
        back-EMF [A]
    table : as `bridge_table` gives it
    conductance : of a load, which takes a current in proportion to the voltage of the DC link [S]
    """
    share, ohm, drop = (
        np.ones(omega.size),
        reactance(omega, machine),
        2.0 * machine.v_diode * conductance,
    )
    v_total = i_s = share
    for _ in range(1 if machine.rolloff == NO_ROLLOFF else ROUNDS):
        v_ll = machine.k_e * omega * RPM * share
        v_total, i_s = _inverse(v_ll, taken - drop, conductance, machine.r_phase, ohm, table, True)
        share = rolloff_curve(machine.rolloff)(np.minimum(i_s / machine.i_rated, ROLLOFF_KNOTS[-1]))
    return v_total, i_s


def back_emfs(
    machine: GeneratorModel, omega: Signal, vdc: Signal, current: Signal
) -> tuple[Signal, Signal]:
    """Back-EMF, line to line, rms [V], and stator current [A] at which the bridge carries a current
    into a voltage, (n,).

    Parameters
    ----------
    omega : (n,) speed of the high-speed shaft [rad/s]
    current : (n,) of the bridge; without one the peak of the back-EMF is the voltage of DC link and
        diodes [A]
    """
    v_total, taken = np.maximum(vdc, 0.0) + 2.0 * machine.v_diode, np.maximum(current, 0.0)
    return _inverse(
        v_total, taken, 0.0, machine.r_phase, reactance(omega, machine), bridge_table(), False
    )
