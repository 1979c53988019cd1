"""The drive of the twin in time: clutch, shaft, gear, rotor, generator, bridge and DC link along a
given speed of the drum.

Each of the three phases is a back-EMF behind R and L, the star point floats, a diode is a switch
with a drop. Within a step the currents follow the trapezoidal rule at the back-EMFs half-way. Where
a diode opens or closes inside the step, the instant is found by a straight line, and the step
continues from there in the new state.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from winchcascade.blind.twin_numbers import BELL, KNEE, LINE, Fixed, Numbers
from winchcascade.core.run import Signal

Switches = NDArray[np.int64]

PEAK = math.sqrt(2.0 / 3.0)
"""Peak of a phase over the line-to-line rms of a sine."""

_THIRD = 0.5 * math.sqrt(3.0)

_EVENTS = 12
"""Maximum number of openings and closings in one step."""

GRID = 1e-3
"""Interval over which what the drive does is averaged. [s]"""

FINE, COARSE = 20, 4
"""Steps of an interval while a diode may conduct, and while none can: half of 50 us changes no
channel by more than 0.05 %.
"""

_QUIET = 0.97
"""Below this share of the voltage that a diode would need, none is looked for. [1]"""

_EMPTY, _NO_CURRENT = 1e-9, 1e-3
"""A DC link below this is empty [V]; current at which the logarithmic law of a silicon diode
ends [A].
"""

_FADE, _COOLING = 5e-3, 60.0
"""Averaging time of the stator current that weakens the magnets, and time in which a load gives
its heat away. [s]
"""

_TURN, _SLIP = 1.0, 0.02
"""Speeds within which friction of the high-speed shaft changes its sign, and in which the drag of a
clutch is reached. [rad/s]
"""

_LEAK_VOLT, _LEAK_POWER = 300.0, 4.0
"""Leakage across the DC link: `leaking_link` (v / 300 V)^4. [V, 1]"""


class Drive(NamedTuple):
    """Numbers of the drive, SI units; an effect or an outsider that has a field here is absent at
    its default.

    Parameters
    ----------
    load : resistance at the DC link [ohm]
    speeds, shares : speeds of the rotor that rise, and the share of the load that a controller sets
        at each, by straight lines between them [rad/s, 1]
    rotor_windage, rotor_friction : further drag on the high-speed shaft [N m s2/rad2, N m]
    law, knee, width, power : of the roll-off [one of `KNEE`, `LINE`, `BELL`; A, A or 1/A, 1]
    warming : rise of the load with the heat in it [1/J]
    leaking_link : current across the DC link before the sensor at 300 V [A]
    gear_slope, gear_curve : fall of the mesh efficiency with the torque of the slow shaft and with
        its square [1/N m, 1/(N m)2]
    dead_phase : number of the phase whose upper diode never conducts, -1 where all conduct
    diode_slope : slope of a diode [ohm]
    diode_scale : rise of the voltage of a diode per factor e of its current, `Fixed.v_diode` at 1 A
        [V]
    cable : resistance between the DC link and the sensor of Vdc [ohm]
    overrunning_drag : torque of the clutch at the slow shaft while the rotor is faster than the
        drum [N m]
    """

    fixed: Fixed
    numbers: Numbers
    load: float
    speeds: tuple[float, ...] = (0.0,)
    shares: tuple[float, ...] = (1.0,)
    rotor_windage: float = 0.0
    rotor_friction: float = 0.0
    law: float = KNEE
    knee: float = 1e3
    width: float = 1.0
    power: float = 1.0
    warming: float = 0.0
    leaking_link: float = 0.0
    gear_slope: float = 0.0
    gear_curve: float = 0.0
    dead_phase: int = -1
    diode_slope: float = 0.0
    diode_scale: float = 0.0
    cable: float = 0.0
    overrunning_drag: float = 0.0


COLUMNS = ("torque", "vdc", "idc", "omega")
"""Output of the drive, means over each interval: torque at the sensor [N m], Vdc [V], Idc [A],
speed of the rotor [rad/s].
"""

LEDGER = (
    "shaft", "mesh", "damper", "rotor_drag", "copper", "diodes", "leak", "load", "cable", "clutch", "spring", "rotor", "field",
    "link",
)  # fmt: skip
"""Energy until the end: in at the shaft, then lost, delivered and stored; all but the first add
up to it. [J]
"""


class BridgeSource(NamedTuple):
    """The phases behind the bridge and the voltage that they feed, at the start of a step.

    Parameters
    ----------
    angle, turn : electrical angle, and its speed [rad, rad/s]
    amplitude : peak of the back-EMF of a phase [V]
    v_total : voltage of the DC link and of two diodes [V]
    r_s, l_s : of a phase, r_s with the slope of a diode [ohm, H]
    dead_phase : phase whose upper diode never conducts, -1 where all conduct
    """

    angle: float
    turn: float
    amplitude: float
    v_total: float
    r_s: float
    l_s: float
    dead_phase: int


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
def _advance(
    i: Signal, on: Switches, emf: Signal, source: BridgeSource, h: float, out: Signal
) -> None:
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
    """Phase whose diode opens first as its current turns, and at which share of the step; -1 if
    none does.
    """
    phase, share = -1, 1.0
    for k in range(3):
        if on[k] * then[k] < 0.0:
            here = i[k] / (i[k] - then[k]) if on[k] * i[k] > 0.0 else 0.0
            if here < share or phase < 0:
                phase, share = k, here
    return phase, share


@njit(cache=True)
def _closing(
    before: Signal, after: Signal, on: Switches, source: BridgeSource, phase: int, share: float
) -> tuple[int, int, float]:
    """Phase whose diode closes first as its terminal passes a rail, to which rail, and at which
    share; unless another one opens before, which is given as `_opening` returns it.
    """
    rail, v_total = 0, source.v_total
    low, high = _star(before, on, v_total), _star(after, on, v_total)
    for k in range(3):
        if on[k] != 0 or (k == source.dead_phase and after[k] + high > v_total):
            continue
        first, last = before[k] + low, after[k] + high
        to, past, end = (
            (1, first - v_total, last - v_total) if last > v_total else (-1, -first, -last)
        )
        here = 0.0 if past >= 0.0 else past / (past - end)
        if end > 0.0 and (here < share or phase < 0):
            phase, rail, share = k, to, here
    return phase, rail, share


@njit(cache=True)
def _wake(before: Signal, after: Signal, v_total: float, dead_phase: int) -> tuple[int, int, float]:
    """Upper and lower phase that begin to conduct from rest within a step, and at which share;
    -1 if none do.
    """
    high, low = int(np.argmax(after)), int(np.argmin(after))
    if high == dead_phase:
        high = 3 - high - low  # the phase between the other two
    end = after[high] - after[low] - v_total
    if end <= 0.0:
        return -1, -1, 1.0
    start = before[high] - before[low] - v_total
    return high, low, 0.0 if start >= 0.0 else start / (start - end)


@njit(cache=True)
def _switch(i: Signal, on: Switches, phase: int, rail: int) -> None:
    """Connect a phase to a rail, or let its diode open: the other two carry one current, or none
    if it was one of two.
    """
    on[phase] = rail
    if rail == 0:
        a, b = (phase + 1) % 3, (phase + 2) % 3
        loop = 0.5 * (i[a] - i[b])
        i[phase], i[a], i[b] = 0.0, loop, -loop
        if on[a] == 0 or on[b] == 0:
            on[:] = 0
            i[:] = 0.0


@njit(cache=True)
def bridge_step(
    i: Signal, on: Switches, source: BridgeSource, dt: float, work: Signal
) -> tuple[float, float, float]:
    """Step the phases and the bridge by a time dt; `i` and `on` are changed in place.

    Parameters
    ----------
    i : (3,) currents out of the phases [A]
    on : (3,) 1 at the upper rail, -1 at the lower, 0 where no diode conducts
    work : (4, 3) scratch

    Returns
    -------
    charge into the DC link [C], energy out of the back-EMFs [J], integral of the sum of squared
    currents [A2 s]
    """
    before, half, after, then = work[0], work[1], work[2], work[3]
    angle, turn, amplitude, v_total = source.angle, source.turn, source.amplitude, source.v_total
    charge = energy = square = 0.0
    left = dt
    for _ in range(_EVENTS):
        if left <= 0.0:
            break
        _emf(amplitude, angle + turn * left, after)
        idle = not np.all(on)
        if idle:
            _emf(amplitude, angle, before)
        if not np.any(on):
            high, low, share = _wake(before, after, v_total, source.dead_phase)
            angle += turn * share * left
            left -= share * left
            if high < 0:
                break
            on[high], on[low] = 1, -1
            continue
        _emf(amplitude, angle + 0.5 * turn * left, half)
        _advance(i, on, half, source, left, then)
        phase, share = _opening(i, then, on)
        rail = 0
        if idle:
            phase, rail, share = _closing(before, after, on, source, phase, share)
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
        if phase >= 0:
            _switch(i, on, phase, rail)
    return charge, energy, square


@njit(cache=True)
def weakened(i_s: float, law: float, knee: float, width: float, power: float) -> float:
    """Share of the back-EMF that remains at a stator current, rms. [1]"""
    if law == BELL:
        return float(math.exp(-((i_s / width) ** power)))
    past = max(i_s - knee, 0.0)
    return max(1.0 - width * past, 0.3) if law == LINE else 1.0 / (1.0 + (past / width) ** power)


@njit(cache=True)
def _clutch(twist: float, slip: float, f: Fixed) -> tuple[float, float]:
    """Torque of the slow shaft [N m], and twisting of its spring [rad/s]; it lets go where both
    would pull.
    """
    torque = f.k_shaft * twist + f.c_shaft * slip
    if torque > 0.0:
        return torque, slip
    return 0.0, -f.k_shaft * twist / f.c_shaft


@njit(cache=True)
def _link(v_dc: float, charge: float, load: float, dt: float, d: Drive) -> tuple[float, float]:
    """Voltage of the DC link after a step that brings it a charge [V], and the current that
    leaks past the load [A].
    """
    leaking = (
        d.leaking_link * (v_dc / _LEAK_VOLT) ** _LEAK_POWER
        if d.leaking_link > 0.0 and v_dc > 0.0
        else 0.0
    )
    fade = 0.5 * dt / (load * d.numbers.c_dc)
    then = (v_dc * (1.0 - fade) + (charge - leaking * dt) / d.numbers.c_dc) / (1.0 + fade)
    return (then if then > _EMPTY else 0.0), leaking


@njit(cache=True)
def _diode(current: float, d: Drive) -> float:
    """Threshold of a diode at the mean current of the bridge: v = v_1 + n V_t ln(i / 1 A), its
    slope apart. [V]
    """
    if d.diode_scale == 0.0:
        return d.fixed.v_diode
    return d.fixed.v_diode + d.diode_scale * math.log(max(current, _NO_CURRENT))


@njit(cache=True)
def _share_of_load(omega: float, d: Drive) -> float:
    """Share of the load that a controller sets at a speed of the rotor. [1]"""
    k, last = 0, len(d.speeds) - 1
    while k < last and omega > d.speeds[k + 1]:
        k += 1
    if k == last or omega <= d.speeds[k]:
        return d.shares[k]
    way = (omega - d.speeds[k]) / (d.speeds[k + 1] - d.speeds[k])
    return d.shares[k] + (d.shares[k + 1] - d.shares[k]) * way


@njit(cache=True)
def run_drive(omega_drum: Signal, mesh: Signal, d: Drive, fine: int) -> tuple[Signal, Signal]:
    """Step the drive from rest.

    Parameters
    ----------
    omega_drum : (n + 1,) speed of the drum at the ends of the intervals, payout positive [rad/s]
    mesh : (n,) factor on the torque that the gear needs, 1 where it meshes evenly
    fine : steps of an interval while a diode may conduct

    Returns
    -------
    (n, 14), `COLUMNS` and the first ten of `LEDGER` for each interval, and (4,), the last of
    `LEDGER` at the end
    """
    f, c = d.fixed, d.numbers
    out = np.zeros((len(mesh), 14))
    i, on, work = np.zeros(3), np.zeros(3, dtype=np.int64), np.zeros((4, 3))
    twist = omega = v_dc = angle = heat = mean_square = mean_dc = 0.0
    emf, share = c.k_e * 30.0 / math.pi, c.eta_mesh / f.gear
    for n in range(len(mesh)):
        awake = np.any(on) or emf * omega * math.sqrt(2.0) > _QUIET * (
            v_dc + 2.0 * _diode(mean_dc, d)
        )
        steps = fine if awake else COARSE
        dt = GRID / steps
        for m in range(steps):
            drum = omega_drum[n] + (omega_drum[n + 1] - omega_drum[n]) * (m + 0.5) / steps
            slip = drum - omega / f.gear
            torque, rate = _clutch(twist, slip, f)
            overruns = torque == 0.0 and slip < 0.0
            dragging = (
                d.overrunning_drag * slip / math.sqrt(slip * slip + _SLIP**2) if overruns else 0.0
            )
            # generator and bridge
            turn = f.pole_pairs * omega
            charge = energy = square = 0.0
            v_diode = _diode(mean_dc, d)
            if awake and omega > 0.0:
                amplitude = (
                    PEAK
                    * emf
                    * omega
                    * weakened(math.sqrt(mean_square), d.law, d.knee, d.width, d.power)
                )
                v_total, r_s = v_dc + 2.0 * v_diode, c.r_s + d.diode_slope
                source = BridgeSource(angle, turn, amplitude, v_total, r_s, c.l_s, d.dead_phase)
                charge, energy, square = bridge_step(i, on, source, dt, work)
            mean_square += (square / 3.0 - dt * mean_square) / _FADE
            mean_dc += (charge - dt * mean_dc) / _FADE
            angle = (angle + turn * dt) % (2.0 * math.pi)
            brake = energy / (omega * dt) if omega > 1e-6 else 0.0
            # high-speed shaft
            dry = d.rotor_friction * omega / math.sqrt(omega**2 + _TURN**2)
            drag = omega * (c.b_rotor + d.rotor_windage * abs(omega)) + dry
            loaded = (
                share - (d.gear_slope + d.gear_curve * torque) * torque / f.gear
            )  # efficiency falls under load
            driving = torque * loaded / mesh[n]
            then = max(omega + dt * (driving + dragging / f.gear - brake - drag) / f.j_rotor, 0.0)
            # DC link and load
            load = d.load * _share_of_load(omega, d) * (1.0 + d.warming * heat)
            v_then, leaking = _link(v_dc, charge, load + d.cable, dt, d)
            middle, mean_omega = 0.5 * (v_dc + v_then), 0.5 * (omega + then)
            seen_v = middle * (load / (load + d.cable))
            heat += dt * (seen_v * seen_v / load - heat / _COOLING)
            row = (
                (torque + dragging) / steps, seen_v / steps, seen_v / load / steps, omega / steps,
                dt * (torque + dragging) * drum, dt * (torque * omega / f.gear - driving * omega),
                dt * f.c_shaft * rate * rate, dt * drag * mean_omega, c.r_s * square,
                2.0 * v_diode * charge + d.diode_slope * square, dt * leaking * middle, dt * seen_v * seen_v / load,
                dt * seen_v * (middle - seen_v) / load, dt * dragging * (drum - mean_omega / f.gear),
            )  # fmt: skip
            for k in range(14):
                out[n, k] += row[k]
            twist, omega, v_dc = twist + dt * rate, then, v_then
    stored = np.array(
        (f.k_shaft * twist**2, f.j_rotor * omega**2, c.l_s * np.sum(i**2), c.c_dc * v_dc**2)
    )
    return out, 0.5 * stored
