"""The generator's three phases and the diode bridge, switched diode by diode in small steps of time.

Each phase is a back-EMF behind R and L, the star point floats, a diode is a switch with a drop. Within a step the currents
follow the trapezoidal rule at the back-EMFs half-way; where a diode opens or closes inside the step, the instant is found by
a straight line and the step goes on from there in the new state.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal

    Switches = NDArray[np.int64]

PEAK = math.sqrt(2.0 / 3.0)
"""Peak of a phase over the line-to-line rms of a sine."""

_THIRD = 0.5 * math.sqrt(3.0)
_EVENTS = 12
"""Maximum number of openings and closings in one step."""


class BridgeSource(NamedTuple):
    """The phases behind the bridge, and what they feed into, as they are at the start of a step.

    Parameters
    ----------
    angle, turn : electrical angle, and its speed [rad, rad/s]
    amplitude : peak of the back-EMF of a phase [V]
    v_total : voltage of the DC link and of two diodes [V]
    r_s, l_s : of a phase [ohm, H]
    """

    angle: float
    turn: float
    amplitude: float
    v_total: float
    r_s: float
    l_s: float


@njit(cache=True)
def _emf(amplitude: float, angle: float, out: Signal) -> None:
    """Back-EMF of the three phases at an electrical angle. [V]"""
    c, s = amplitude * math.cos(angle), amplitude * math.sin(angle)
    out[0] = c
    out[1] = -0.5 * c + _THIRD * s
    out[2] = -0.5 * c - _THIRD * s


@njit(cache=True)
def _star(emf: Signal, on: Switches, v_total: float) -> float:
    """Potential of the star point over the negative rail. [V]"""
    total, count = 0.0, 0
    for k in range(3):
        if on[k] != 0:
            total += (v_total if on[k] > 0 else 0.0) - emf[k]
            count += 1
    return total / count


@njit(cache=True)
def _advance(i: Signal, on: Switches, emf: Signal, source: BridgeSource, h: float, out: Signal) -> None:
    """Currents after a time h in one state of the diodes."""
    star = _star(emf, on, source.v_total)
    fade = 0.5 * source.r_s * h / source.l_s
    for k in range(3):
        if on[k] == 0:
            out[k] = 0.0
        else:
            drive = emf[k] + star - (source.v_total if on[k] > 0 else 0.0)
            out[k] = (i[k] * (1.0 - fade) + h / source.l_s * drive) / (1.0 + fade)


@njit(cache=True)
def _opening(i: Signal, then: Signal, on: Switches) -> tuple[int, float]:
    """Phase whose diode opens first as its current turns, and at which share of the step; -1 if none does."""
    phase, share = -1, 1.0
    for k in range(3):
        if on[k] * then[k] < 0.0:
            here = i[k] / (i[k] - then[k]) if on[k] * i[k] > 0.0 else 0.0
            if here < share or phase < 0:
                phase, share = k, here
    return phase, share


@njit(cache=True)
def _closing(before: Signal, after: Signal, on: Switches, v_total: float) -> tuple[int, int, float]:
    """Phase whose diode closes first as its terminal passes a rail, to which rail, and at which share; -1 if none does."""
    phase, rail, share = -1, 0, 1.0
    low, high = _star(before, on, v_total), _star(after, on, v_total)
    for k in range(3):
        if on[k] != 0:
            continue
        first, last = before[k] + low, after[k] + high
        over, under = last - v_total, -last
        if over > 0.0 or under > 0.0:
            past = first - v_total if over > 0.0 else -first
            end = over if over > 0.0 else under
            here = 0.0 if past >= 0.0 else past / (past - end)
            if here < share or phase < 0:
                phase, rail, share = k, (1 if over > 0.0 else -1), here
    return phase, rail, share


@njit(cache=True)
def _wake(before: Signal, after: Signal, v_total: float) -> tuple[int, int, float]:
    """Upper and lower phase that begin to conduct from rest within a step, and at which share; -1 if none do."""
    high, low = 0, 0
    for k in range(1, 3):
        if after[k] > after[high]:
            high = k
        if after[k] < after[low]:
            low = k
    end = after[high] - after[low] - v_total
    if end <= 0.0:
        return -1, -1, 1.0
    start = before[high] - before[low] - v_total
    return high, low, 0.0 if start >= 0.0 else start / (start - end)


@njit(cache=True)
def _open(i: Signal, on: Switches, phase: int) -> None:
    """Let the diode of a phase open; the other two carry one current, or none if it was one of two."""
    on[phase] = 0
    i[phase] = 0.0
    a, b = (phase + 1) % 3, (phase + 2) % 3
    if on[a] == 0 or on[b] == 0:
        for k in range(3):
            on[k] = 0
            i[k] = 0.0
        return
    loop = 0.5 * (i[a] - i[b])
    i[a], i[b] = loop, -loop


@njit(cache=True)
def bridge_step(i: Signal, on: Switches, source: BridgeSource, dt: float, work: Signal) -> tuple[float, float, float]:
    """Step the phases and the bridge by a time dt; `i` and `on` are changed in place.

    Parameters
    ----------
    i : (3,) currents out of the phases [A]
    on : (3,) 1 at the upper rail, -1 at the lower, 0 where no diode conducts
    work : (4, 3) scratch

    Returns
    -------
    charge into the DC link [C], energy out of the back-EMFs [J], integral of the sum of squared currents [A2 s]
    """
    before, half, after, then = work[0], work[1], work[2], work[3]
    angle, turn, amplitude, v_total = source.angle, source.turn, source.amplitude, source.v_total
    charge = energy = square = 0.0
    left = dt
    for _ in range(_EVENTS):
        if left <= 0.0:
            break
        _emf(amplitude, angle + turn * left, after)
        idle = on[0] == 0 or on[1] == 0 or on[2] == 0
        if idle:
            _emf(amplitude, angle, before)
        if on[0] == 0 and on[1] == 0 and on[2] == 0:
            high, low, share = _wake(before, after, v_total)
            angle += turn * share * left
            left -= share * left
            if high < 0:
                break
            on[high], on[low] = 1, -1
            continue
        _emf(amplitude, angle + 0.5 * turn * left, half)
        _advance(i, on, half, source, left, then)
        opens, share = _opening(i, then, on)
        closes, rail, soon = _closing(before, after, on, v_total) if idle else (-1, 0, 1.0)
        if closes >= 0 and (opens < 0 or soon < share):
            opens, share = -1, soon
        else:
            closes = -1
        h = share * left
        if share < 1.0:
            _emf(amplitude, angle + 0.5 * turn * h, half)
            _advance(i, on, half, source, h, then)
        for k in range(3):
            middle = 0.5 * (i[k] + then[k])
            energy += h * half[k] * middle
            square += h * (i[k] * i[k] + i[k] * then[k] + then[k] * then[k]) / 3.0
            if on[k] > 0:
                charge += h * middle
            i[k] = then[k]
        angle += turn * h
        left -= h
        if opens >= 0:
            _open(i, on, opens)
        elif closes >= 0:
            on[closes] = rail
    return charge, energy, square
