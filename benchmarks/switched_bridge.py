"""Steady states of a three-phase diode bridge, fed by sinusoidal back-EMFs behind R and L, on a
stiff DC voltage.

The circuit is solved switch by switch and exactly: between two commutations the current of every
conducting phase is a sinusoid, a constant and an exponential, so only the instants of commutation
are searched for. In units of the line-to-line voltage V_LL (rms) and of the reactance w_e L a
steady state depends on two numbers alone: u = (Vdc + 2 Vd) / (sqrt(2) V_LL) and rho = R / (w_e L).
The grid of them that `winchcascade/rig/bridge.py` interpolates was written by

    python benchmarks/switched_bridge.py
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from winchcascade.core.run import Signal
from winchcascade.rig.bridge import PHI_HIGH, PHI_LOW, PHI_POINTS, S_POINTS, TABLE

_STEPS = 720
"""Searches for a commutation in one period; its instant is then found by bisection."""

_PERIODS = 400
"""A state that is not steady after this many periods is taken as it is."""

_SETTLED = 1e-9
"""Steady: currents repeat after a sixth of a period, the roles of the phases exchanged, to this
share of V_LL / Z.
"""

_BACK_EMF = math.sqrt(2.0 / 3.0) * np.exp(-2j * math.pi * np.arange(3) / 3.0)
"""Back-EMFs of the phases, as amplitudes of exp(j theta). [V_LL]"""


class _Mode(NamedTuple):
    """What conducts from one commutation to the next, and the solution until then.

    `_state` gives the current of a conducting phase [V_LL / (w_e L)], and of another one the
    potential of its terminal [V_LL], over the negative rail or, where nothing conducts, over the
    star point: the real part of `wave` exp(j theta), plus `level`, plus `free` exp(-rho (theta -
    start)).
    """

    rho: float
    voltage: float
    conducting: NDArray[np.bool_]
    upper: NDArray[np.bool_]
    start: float
    wave: NDArray[np.complex128]
    level: Signal
    free: Signal


@njit(cache=True)
def _mode(
    rho: float,
    voltage: float,
    conducting: NDArray[np.bool_],
    upper: NDArray[np.bool_],
    start: float,
    currents: Signal,
) -> _Mode:
    """Begin a mode at an angle with the currents there."""
    wave, level, free = _BACK_EMF.copy(), np.zeros(3), np.zeros(3)
    if np.any(conducting):
        rail = upper * voltage
        wave -= np.mean(_BACK_EMF[conducting])
        level += np.mean(rail[conducting])
        for k in range(3):
            if conducting[k]:
                wave[k] /= rho + 1j
                level[k] = (level[k] - rail[k]) / rho
                free[k] = currents[k] - (wave[k] * np.exp(1j * start)).real - level[k]
    return _Mode(rho, voltage, conducting, upper, start, wave, level, free)


@njit(cache=True)
def _state(mode: _Mode, theta: float) -> Signal:
    """Currents of the conducting phases and potentials of the others at an angle, (3,)."""
    turn, decay, state = np.exp(1j * theta), math.exp(-mode.rho * (theta - mode.start)), np.empty(3)
    for k in range(3):
        state[k] = (mode.wave[k] * turn).real + mode.level[k] + mode.free[k] * decay
    return state


@njit(cache=True)
def _currents(mode: _Mode, theta: float) -> Signal:
    """Currents of the phases at an angle, (3,)."""
    return np.where(mode.conducting, _state(mode, theta), 0.0)


@njit(cache=True)
def _fault(mode: _Mode, theta: float) -> int:
    """Number of the phase whose diodes contradict the mode at an angle, plus 3 if it wants the
    upper rail; -1: none.
    """
    state = _state(mode, theta)
    if not np.any(mode.conducting):
        return 3 + int(np.argmax(state)) if np.max(state) - np.min(state) > mode.voltage else -1
    for k in range(3):
        if mode.conducting[k]:
            if (state[k] < 0.0) if mode.upper[k] else (state[k] > 0.0):
                return k
        elif state[k] > mode.voltage:
            return 3 + k
        elif state[k] < 0.0:
            return k
    return -1


@njit(cache=True)
def _next_commutation(mode: _Mode, theta: float, target: float) -> tuple[int, float]:
    """What `_fault` first finds after an angle and by a target, and the angle where; -1 and the
    target if nothing.
    """
    fault, low, high = _fault(mode, target), theta, target
    if fault >= 0:
        for _ in range(46):
            middle = 0.5 * (low + high)
            at = _fault(mode, middle)
            if at >= 0:
                high, fault = middle, at
            else:
                low = middle
    return fault, high


@njit(cache=True)
def _commutate(mode: _Mode, fault: int, theta: float) -> _Mode:
    """Begin the mode in which the phase that contradicts the present one conducts or not as it
    should.
    """
    conducting, upper, state = mode.conducting.copy(), mode.upper.copy(), _state(mode, theta)
    conducting[fault % 3], upper[fault % 3] = not conducting[fault % 3], fault >= 3
    if not np.any(mode.conducting):  # the current returns through the phase of the lowest back-EMF
        back = np.argmin(state)
        conducting[back], upper[back] = True, False
    elif np.sum(conducting) == 1:
        conducting[:] = False
    return _mode(
        mode.rho, mode.voltage, conducting, upper, theta, np.where(mode.conducting, state, 0.0)
    )


@njit(cache=True)
def steady_state(u: float, rho: float) -> tuple[float, float]:
    """Solve the bridge at one point: mean DC current and rms phase current, times Z / V_LL; zeros
    where nothing conducts.

    Parameters
    ----------
    u : DC voltage with two diode drops over the peak of the line-to-line voltage, 0 (short circuit)
        to 1 [1]
    rho : resistance over reactance of a phase, above 0 [1]
    """
    impedance = math.sqrt(1.0 + rho * rho)
    nothing = np.zeros(3, dtype=np.bool_)
    mode = _mode(rho, u * math.sqrt(2.0), nothing, nothing, 0.0, np.zeros(3))
    theta, before = 0.0, np.zeros(3)
    charge = square = 0.0
    for sixth in range(6 * _PERIODS):
        charge = square = 0.0
        for _ in range(_STEPS // 6):
            target = theta + 2.0 * math.pi / _STEPS
            for _ in range(12):  # commutations within one step
                fault, end = _next_commutation(mode, theta, target)
                first, middle, last = (
                    _currents(mode, theta),
                    _currents(mode, 0.5 * (theta + end)),
                    _currents(mode, end),
                )
                width = (end - theta) / 6.0  # Simpson's rule
                square += width * np.sum(first**2 + 4.0 * middle**2 + last**2) / 3.0
                charge += width * np.sum((first + 4.0 * middle + last)[mode.upper])
                theta = end
                if fault < 0:
                    break
                mode = _commutate(mode, fault, theta)
                if theta >= target:
                    break
            theta = target
        now = _currents(mode, theta)
        # after a sixth of a period phase k + 1 carries what phase k carried, with the other sign
        change = np.max(np.abs(now + np.roll(before, -1)))
        before = now
        if sixth > 12 and change * impedance < _SETTLED:
            break
    width = math.pi / 3.0
    return charge / width * impedance, math.sqrt(square / width) * impedance


def solve_grid() -> Signal:
    """Solve the grid, (S_POINTS, PHI_POINTS, 2)."""
    table = np.zeros((S_POINTS, PHI_POINTS, 2))
    for i, s in enumerate(np.linspace(0.0, 1.0, S_POINTS)):
        for j, phi in enumerate(np.linspace(PHI_LOW, PHI_HIGH, PHI_POINTS)):
            table[i, j] = steady_state(1.0 - s * s, math.tan(phi)) if s > 0 else (0.0, 0.0)
    return table


if __name__ == "__main__":
    np.save(TABLE, solve_grid().astype(np.float32))
