"""The three-phase diode bridge on a stiff DC link, from open circuit to heavy overlap: exact, by a table of its steady states.

A textbook average is off by 3 % near open circuit, where the capacitor charges to the peak, and by 7 % at 4.5 ohm at speed,
where commutation takes 60 degrees. So the switched circuit was solved over a grid once (`switched.py`); here the table is
interpolated by cubic convolution (Keys 1981). On a stiff DC side the state follows the speed and the voltage within a period.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from winchcascade.rig.switched import PHI_HIGH, PHI_LOW, TABLE

if TYPE_CHECKING:
    from winchcascade.core.run import Signal


_SQRT2 = math.sqrt(2.0)


@cache
def bridge_table() -> Signal:
    """The solved grid, (s, phi, 2), with a border that lets the interpolation reach the edges, (s + 2, phi + 2, 2)."""
    grid = np.load(TABLE).astype(np.float64)
    wide = np.empty((grid.shape[0] + 2, grid.shape[1] + 2, 2))
    wide[1:-1, 1:-1] = grid
    wide[0, 1:-1], wide[-1, 1:-1] = 3 * grid[0] - 3 * grid[1] + grid[2], 3 * grid[-1] - 3 * grid[-2] + grid[-3]
    wide[:, 0] = 3 * wide[:, 1] - 3 * wide[:, 2] + wide[:, 3]
    wide[:, -1] = 3 * wide[:, -2] - 3 * wide[:, -3] + wide[:, -4]
    return wide


@njit(cache=True, error_model="numpy")
def _weights(x: float) -> tuple[float, float, float, float]:
    """Weights of four points in a row for a place between the middle two, 0 to 1 (Keys 1981, a = -1/2)."""
    return (
        ((-0.5 * x + 1.0) * x - 0.5) * x,
        (1.5 * x - 2.5) * x * x + 1.0,
        ((-1.5 * x + 2.0) * x + 0.5) * x,
        (0.5 * x - 0.5) * x * x,
    )


@njit(cache=True, error_model="numpy")
def _slopes(x: float) -> tuple[float, float, float, float]:
    """Derivatives of `_weights`."""
    return (
        (-1.5 * x + 2.0) * x - 0.5,
        (4.5 * x - 5.0) * x,
        (-4.5 * x + 4.0) * x + 0.5,
        (1.5 * x - 1.0) * x,
    )


@njit(cache=True, error_model="numpy")
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
    i_dc, i_s, di_dc, di_s : currents [A] and their slopes over `v_total` [A/V], 0 where the back-EMF does not reach the DC
        link. Currents are proportional to the voltages at a given ratio of these, so the slope over `v_ll` is
        (i - v_total di) / v_ll. The generator's air-gap power is v_total i_dc + 3 r_s i_s^2 [W].
    """
    if v_ll <= 0.0 or v_total >= _SQRT2 * v_ll:
        return 0.0, 0.0, 0.0, 0.0
    rows, columns = table.shape[0] - 3, table.shape[1] - 3
    root = math.sqrt(1.0 - max(v_total, 0.0) / (_SQRT2 * v_ll))
    s = root * rows
    phi = (math.atan2(r_s, reactance) - PHI_LOW) / (PHI_HIGH - PHI_LOW) * columns
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
    scale = v_ll / math.hypot(r_s, reactance)
    falling = -scale * rows / (2.0 * max(root, 1e-6) * _SQRT2 * v_ll)
    return max(i_dc, 0.0) * scale, max(i_s, 0.0) * scale, min(up_dc * falling, 0.0), min(up_s * falling, 0.0)


@njit(cache=True, error_model="numpy")
def bridge_turned(v_total: float, v_ll: float, r_s: float, reactance: float, table: Signal) -> tuple[float, float]:
    """How mean DC current and stator rms current change with the angle atan2(r_s, reactance), at one impedance. [A/rad]"""
    if v_ll <= 0.0 or v_total >= _SQRT2 * v_ll:
        return 0.0, 0.0
    rows, columns = table.shape[0] - 3, table.shape[1] - 3
    s = math.sqrt(1.0 - max(v_total, 0.0) / (_SQRT2 * v_ll)) * rows
    phi = (math.atan2(r_s, reactance) - PHI_LOW) / (PHI_HIGH - PHI_LOW) * columns
    i, j = min(int(s), rows - 1), min(max(int(phi), 0), columns - 1)
    across, turn = _weights(s - i), _slopes(min(max(phi - j, 0.0), 1.0))
    by_dc = by_s = 0.0
    for a in range(4):
        row_dc = row_s = 0.0
        for b in range(4):
            row_dc += turn[b] * table[i + a, j + b, 0]
            row_s += turn[b] * table[i + a, j + b, 1]
        by_dc += across[a] * row_dc
        by_s += across[a] * row_s
    scale = v_ll / math.hypot(r_s, reactance) * columns / (PHI_HIGH - PHI_LOW)
    return by_dc * scale, by_s * scale


CLOSE = 1e-9
"""The last of Newton's steps is shorter than this share of the voltage; its error is about the square of that."""

MOST_STEPS = 60
"""Steps at most: where the bridge can carry no such current the bracket is halved until it is as short."""


@njit(cache=True, error_model="numpy")
def dc_voltages(v_ll: Signal, i_dc: Signal, r_s: float, reactance: Signal, table: Signal) -> tuple[Signal, Signal]:
    """Voltage behind the bridge, diodes included, at which a back-EMF gives a current, and the stator current, (n,) [V, A].

    Parameters
    ----------
    v_ll : (n,) back-EMF, line to line, rms [V]
    i_dc : (n,) mean current of the bridge; none leaves the peak of the back-EMF [A]
    r_s, reactance : of a phase, the latter (n,) [ohm]
    table : as `bridge.bridge_table` gives it
    """
    voltage, i_s = np.zeros_like(v_ll), np.zeros_like(v_ll)
    ratio = 0.9
    for n in range(v_ll.size):
        top = _SQRT2 * v_ll[n]
        if i_dc[n] <= 0.0 or top <= 0.0:
            voltage[n] = max(top, 0.0)
            continue
        low, high, now = 0.0, top, ratio * top
        for _ in range(MOST_STEPS):
            i_b, i_s[n], slope, _ = bridge_state(now, v_ll[n], r_s, reactance[n], table)
            if i_b > i_dc[n]:
                low = now
            else:
                high = now
            after = now - (i_b - i_dc[n]) / slope if slope < 0.0 else low
            if not low < after < high:
                after = 0.5 * (low + high)
            step, now = abs(after - now), after
            if step < CLOSE * top:
                break
        voltage[n] = now
        ratio = min(max(now / top, 0.01), 0.99)
    return voltage, i_s


@njit(cache=True, error_model="numpy")
def back_emfs(v_total: Signal, i_dc: Signal, r_s: float, reactance: Signal, table: Signal) -> tuple[Signal, Signal]:
    """Back-EMF at which a bridge carries a current into a voltage, line to line, rms, and the stator current, (n,) [V, A].

    Parameters
    ----------
    v_total : (n,) voltage of the DC link and of the two conducting diodes [V]
    i_dc : (n,) mean current of the bridge; none takes none of the stator, and a back-EMF whose peak is the voltage [A]
    r_s, reactance, table : as in `dc_voltages`
    """
    v_ll, i_s = v_total / _SQRT2, np.zeros_like(v_total)
    ratio = 1.0
    for n in range(v_total.size):
        if i_dc[n] <= 0.0:
            continue
        least = v_ll[n]
        low, high = least, 3.0 * v_total[n] + 10.0 * i_dc[n] * (r_s + reactance[n])
        now = min(max(ratio * v_total[n], low), high)
        for _ in range(MOST_STEPS):
            i_b, i_s[n], by_v, _ = bridge_state(v_total[n], now, r_s, reactance[n], table)
            if i_b < i_dc[n]:
                low = now
            else:
                high = now
            slope = (i_b - v_total[n] * by_v) / now if now > 0.0 else 0.0
            after = now + (i_dc[n] - i_b) / slope if slope > 0.0 else high
            if not low < after < high:
                after = 0.5 * (low + high)
            step, now = abs(after - now), after
            if step < CLOSE * now:
                break
        v_ll[n] = now
        if v_total[n] > 0.0:
            ratio = now / v_total[n]
    return v_ll, i_s
