"""Steady states of a three-phase diode bridge, fed by sinusoidal back-EMFs behind R and L, on a stiff DC voltage.

The circuit is solved switch by switch and exactly: between two commutations the current of every conducting phase is a
sinusoid, a constant and an exponential, so only the instants of commutation are searched for. In units of the line-to-line
voltage V_LL (rms) and of the reactance w_e L a steady state depends on two numbers alone: u = (Vdc + 2 Vd) / (sqrt(2) V_LL)
and rho = R / (w_e L). `solve_grid` solves a grid of them; the grid that ships beside this file was written by

    python -m winchcascade.rig.switched

and is what `bridge.py` interpolates.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal

TABLE = Path(__file__).with_name("bridge_table.npy")
"""The solved grid, (s, phi, 2): mean DC current and rms phase current, times Z / V_LL with Z = sqrt(R^2 + (w_e L)^2)."""

S_POINTS, PHI_POINTS = 257, 65
"""Points of the grid, even in s = sqrt(1 - u) and in phi = atan(rho): both currents bend least over these."""

PHI_LOW, PHI_HIGH = 0.03, 1.56
"""Ends of the grid: R 3 % of the reactance, as of a short circuit at speed, and the reactance 1 % of R, as at a crawl."""

_STEPS = 720
"""Looks for a commutation in one period; its instant is then found by bisection."""

_PERIODS = 400
"""A steady state that is not reached after this many periods is no steady state."""

_SETTLED = 1e-9
"""Steady: currents repeat after a sixth of a period, the phases' roles exchanged, to this share of V_LL / Z."""


@njit(cache=True)
def _forced(rho: float, theta: float, phase: int, level: float, conducting: NDArray[np.bool_]) -> float:
    """Current that the back-EMFs and the rails alone would drive through a conducting phase. [V_LL / (w_e L)]"""
    amplitude = math.sqrt(2.0 / 3.0)
    lag = math.atan2(1.0, rho)
    impedance = math.sqrt(1.0 + rho * rho)
    count = 0
    mean = 0.0
    for k in range(3):
        if conducting[k]:
            count += 1
            mean += amplitude * math.cos(theta - 2.0 * math.pi * k / 3.0 - lag) / impedance
    own = amplitude * math.cos(theta - 2.0 * math.pi * phase / 3.0 - lag) / impedance
    return own - mean / count - level / rho


@njit(cache=True)
def _floating(theta: float, phase: int, rail: Signal, conducting: NDArray[np.bool_]) -> float:
    """Potential of the terminal of a phase that does not conduct, over the negative rail. [V_LL]"""
    amplitude = math.sqrt(2.0 / 3.0)
    star, count = 0.0, 0
    for k in range(3):
        if conducting[k]:
            star += rail[k] - amplitude * math.cos(theta - 2.0 * math.pi * k / 3.0)
            count += 1
    return amplitude * math.cos(theta - 2.0 * math.pi * phase / 3.0) + star / count


@njit(cache=True)
def _levels(rail: Signal, conducting: NDArray[np.bool_]) -> Signal:
    """Rail potential of each conducting phase over their mean. [V_LL]"""
    mean, count = 0.0, 0
    for k in range(3):
        if conducting[k]:
            mean += rail[k]
            count += 1
    return rail - mean / count if count else rail * 0.0


@njit(cache=True)
def _currents(
    rho: float, start: float, theta: float, initial: Signal, levels: Signal, conducting: NDArray[np.bool_]
) -> Signal:
    """Currents at an angle, from those at the start of the present mode of conduction."""
    now = np.zeros(3)
    decay = math.exp(-rho * (theta - start))
    for k in range(3):
        if conducting[k]:
            free = initial[k] - _forced(rho, start, k, levels[k], conducting)
            now[k] = _forced(rho, theta, k, levels[k], conducting) + free * decay
    return now


@njit(cache=True)
def _fault(
    rho: float, start: float, theta: float, initial: Signal, levels: Signal, rail: Signal, upper: NDArray[np.bool_],
    conducting: NDArray[np.bool_], voltage: float,
) -> int:  # fmt: skip
    """Number of the phase whose diodes contradict the present mode at an angle, plus 3 if it wants the upper rail; -1: none."""
    amplitude = math.sqrt(2.0 / 3.0)
    count = 0
    for k in range(3):
        count += conducting[k]
    if count == 0:
        high, low = 0, 0
        for k in range(1, 3):
            if math.cos(theta - 2.0 * math.pi * k / 3.0) > math.cos(theta - 2.0 * math.pi * high / 3.0):
                high = k
            if math.cos(theta - 2.0 * math.pi * k / 3.0) < math.cos(theta - 2.0 * math.pi * low / 3.0):
                low = k
        difference = math.cos(theta - 2.0 * math.pi * high / 3.0) - math.cos(theta - 2.0 * math.pi * low / 3.0)
        return 3 + high if amplitude * difference > voltage else -1
    now = _currents(rho, start, theta, initial, levels, conducting)
    for k in range(3):
        if conducting[k]:
            if (now[k] < 0.0) if upper[k] else (now[k] > 0.0):
                return k
        else:
            potential = _floating(theta, k, rail, conducting)
            if potential > voltage:
                return 3 + k
            if potential < 0.0:
                return k
    return -1


@njit(cache=True)
def _next_commutation(
    rho: float, start: float, theta: float, target: float, initial: Signal, levels: Signal, rail: Signal,
    upper: NDArray[np.bool_], conducting: NDArray[np.bool_], voltage: float,
) -> tuple[int, float]:  # fmt: skip
    """What `_fault` first finds after an angle and by a target, and the angle where; -1 and the target if nothing."""
    fault = _fault(rho, start, target, initial, levels, rail, upper, conducting, voltage)
    if fault < 0:
        return fault, target
    low, high = theta, target
    for _ in range(46):
        middle = 0.5 * (low + high)
        at = _fault(rho, start, middle, initial, levels, rail, upper, conducting, voltage)
        if at >= 0:
            high, fault = middle, at
        else:
            low = middle
    return fault, high


@njit(cache=True)
def _commutate(
    fault: int,
    now: Signal,
    theta: float,
    conducting: NDArray[np.bool_],
    upper: NDArray[np.bool_],
    rail: Signal,
    voltage: float,
) -> None:
    """Put the phase that contradicts its mode into the right one."""
    phase, wants_upper = fault % 3, fault >= 3
    count = 0
    for k in range(3):
        count += conducting[k]
    if conducting[phase]:
        conducting[phase] = False
        now[phase] = 0.0
        if count == 2:
            for k in range(3):
                conducting[k] = False
                now[k] = 0.0
        return
    conducting[phase], upper[phase] = True, wants_upper
    rail[phase] = voltage if wants_upper else 0.0
    if count == 0:  # the current needs a way back: through the phase of the lowest back-EMF
        low = 0
        for k in range(1, 3):
            if math.cos(theta - 2.0 * math.pi * k / 3.0) < math.cos(theta - 2.0 * math.pi * low / 3.0):
                low = k
        conducting[low], upper[low], rail[low] = True, False, 0.0


@njit(cache=True)
def steady_state(u: float, rho: float) -> tuple[float, float]:
    """Solve the bridge at one point: mean DC current and rms phase current, times Z / V_LL; zeros where nothing conducts.

    Parameters
    ----------
    u : DC voltage with two diode drops over the peak of the line-to-line voltage, 0 (short circuit) to 1 [1]
    rho : resistance over reactance of a phase, above 0 [1]
    """
    impedance = math.sqrt(1.0 + rho * rho)
    voltage = u * math.sqrt(2.0)
    conducting, upper = np.zeros(3, dtype=np.bool_), np.zeros(3, dtype=np.bool_)
    rail, initial = np.zeros(3), np.zeros(3)
    levels = _levels(rail, conducting)
    start = theta = 0.0
    step = 2.0 * math.pi / _STEPS
    sixth = _STEPS // 6
    before = np.zeros(3)
    charge = square = 0.0
    for period in range(6 * _PERIODS):
        charge = square = 0.0
        for _ in range(sixth):
            target = theta + step
            last = _currents(rho, start, theta, initial, levels, conducting)
            for _ in range(12):  # commutations within one step
                fault, end = _next_commutation(
                    rho, start, theta, target, initial, levels, rail, upper, conducting, voltage
                )
                middle_now = _currents(rho, start, 0.5 * (theta + end), initial, levels, conducting)
                now = _currents(rho, start, end, initial, levels, conducting)
                width = (end - theta) / 6.0  # Simpson's rule
                for k in range(3):
                    square += width * (last[k] ** 2 + 4.0 * middle_now[k] ** 2 + now[k] ** 2) / 3.0
                    if conducting[k] and upper[k]:
                        charge += width * (last[k] + 4.0 * middle_now[k] + now[k])
                theta = end
                last = now
                if fault < 0:
                    break
                _commutate(fault, now, theta, conducting, upper, rail, voltage)
                initial[:] = now
                for k in range(3):
                    if not conducting[k]:
                        initial[k] = 0.0
                last = initial.copy()
                levels = _levels(rail, conducting)
                start = theta
                if theta >= target:
                    break
            theta = target
        now = _currents(rho, start, theta, initial, levels, conducting)
        change = 0.0
        for k in range(3):  # after a sixth of a period phase k + 1 carries what phase k carried, with the other sign
            change = max(change, abs(now[k] + before[(k + 1) % 3]))
        before[:] = now
        if period > 12 and change * impedance < _SETTLED:
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
