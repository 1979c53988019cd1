"""The bridge the other way round: the voltage, or the back-EMF, at which it carries a given current.

Both fall or rise with the current alone, so there is one root: Newton's steps by the slopes of the bridge, begun at the sample
before and kept in a bracket.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from winchcascade.rig.bridge import bridge_state

if TYPE_CHECKING:
    from winchcascade.run import Signal

CLOSE = 1e-9
"""The last of Newton's steps is shorter than this share of the voltage; its error is about the square of that."""

MOST_STEPS = 60
"""Steps at most: where the bridge can carry no such current the bracket is halved until it is as short."""

_SQRT2 = math.sqrt(2.0)


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
