"""A rig that another solver drives step by step: velocity of the line and load in, tension and
all else out.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np
from numba import njit

from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.bridge import blended_table
from winchcascade.rig.kernel import COLUMNS, LineMotion
from winchcascade.rig.ledger import rates
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import FASTMATH
from winchcascade.rig.state import Constants, GasState, ShaftState, constants, step_line, step_shaft

KEPT = (
    "omega", "omega_before", "twist", "v_dc", "guess", "i_before", "heat", "log_volume",
    "torque_half", "i_s_half", "em_half", "i_bridge_half",
    "x", "v", "x_before", "v_before", "steps",
)  # fmt: skip
"""Numbers that a rig is kept and gone back to by: states of shaft and gas, what was half-way in the
last step, displacement of the line [m] and its velocity [m/s], now and a step before, and the
number of steps made."""


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def advance(
    kept: Signal,
    towards: tuple[float, int],
    dt: float,
    load: float,
    rest: float,
    c: Constants,
    table: Signal,
    out: Signal,
) -> None:
    """Step a rig to a velocity of the line, which changes evenly until then.

    Parameters
    ----------
    kept : (17,) `KEPT`, which are replaced
    towards : velocity of the line at the end [m/s] and number of steps
    dt, load : each step [s] and the load [ohm]
    rest : speed of the line within which friction changes its sign [m/s]
    table : of the bridge, as `blended_table` gives it
    out : (12,) is filled with `kernel.COLUMNS` at the begin of the last step
    """
    shaft = ShaftState(kept[0], kept[1], kept[2], kept[3], kept[4], kept[5])
    gas = GasState(kept[6], kept[7])
    before = (kept[8], kept[9], kept[10], kept[11])
    x, v, x_before, v_before, made = kept[12], kept[13], kept[14], kept[15], kept[16]
    change = (towards[0] - v) / towards[1]
    fades = c.winch.stribeck != 0.0 or c.restoring.stribeck != 0.0
    for _ in range(towards[1]):
        v_next = v + change
        out[4], out[5], out[6], out[7] = shaft.v_dc, shaft.v_dc / load, shaft.omega, shaft.twist
        shaft, middle = step_shaft(shaft, (v, v_next), dt, load, c.shaft, table)
        first = made == 0.0
        a = (v_next - v) / dt if first else 0.5 * (v_next - v_before) / dt
        if first:
            before = middle
        for k in range(4):
            out[k] = 0.5 * (middle[k] + before[k])
        sign = math.tanh(v / rest)
        slow = physics.near_rest(v, sign, c.winch) if fades else 0.0
        gas, line = step_line(gas, (x, v, a), (sign, slow), out[0], 0.0 if first else dt, c)
        out[8], out[9], out[10], out[11] = line
        x_before, v_before, before = x, v, middle
        x, v, made = x + 0.5 * dt * (v + v_next), v_next, made + 1.0
    kept[0], kept[1], kept[2], kept[3], kept[4], kept[5] = shaft
    kept[6], kept[7] = gas
    kept[8], kept[9], kept[10], kept[11] = before
    kept[12], kept[13], kept[14], kept[15], kept[16] = x, v, x_before, v_before, made


SOURCE = 1e9
"""Capacitor of a DC link whose voltage is held, over its own: the current of the bridge changes
it by less than 1e-9. [1]
"""


class SteppedRig:
    """A rig with a state, at rest at first.

    What it gives holds at the begin of the last step, one `step` before the last velocity: torque
    and currents are means over the step before and the one after. Along the same velocities at the
    same steps it is what `simulate` gives.

    Parameters
    ----------
    model : of the rig; its sensors are not read
    step : of the rig [s]
    rest : speed of the line within which friction changes its sign [m/s]
    """

    def __init__(self, model: Model, step: float, rest: float) -> None:
        self.model, self.step, self.rest = model, step, rest
        self.kept = np.zeros(len(KEPT))
        self.out = np.zeros(len(COLUMNS))
        self._table = blended_table(model.generator.averaged, model.generator.uncommutated)
        self._load, self._held, self._numbers = math.inf, False, constants(model, math.inf, rest)

    def begin(self, v: float, x: float = 0.0) -> None:
        """Begin at a velocity and a displacement of the line. [m/s, m]"""
        self.kept[:] = 0.0
        for name, value in {"x": x, "v": v, "x_before": x, "v_before": v}.items():
            self.kept[KEPT.index(name)] = value

    def before(self) -> tuple[float, float]:
        """Velocity and displacement of the line at the begin of the last step. [m/s, m]"""
        return float(self.kept[KEPT.index("v_before")]), float(self.kept[KEPT.index("x_before")])

    def advance(self, v: float, takes: float, load: float, vdc: float = 0.0) -> dict[str, float]:
        """Step to a velocity of the line, which changes evenly until then: `kernel.COLUMNS` by
        name.

        Parameters
        ----------
        v : at the end [m/s]
        takes : time until then, a whole number of steps [s]
        load : at the DC link, inf for an open circuit [ohm]
        vdc : at which a bus holds the DC link, in place of a load; 0 without one [V]
        """
        held = vdc > 0.0
        if (load, held) != (self._load, self._held):
            link = self.model.dc_link._replace(
                c_dc=self.model.dc_link.c_dc * (SOURCE if held else 1.0)
            )
            numbers = constants(
                msgspec.structs.replace(self.model, dc_link=link),
                math.inf if held else load,
                self.rest,
            )
            self._load, self._held, self._numbers = load, held, numbers
        if held:
            self.kept[KEPT.index("v_dc")] = vdc
        count, ohm = max(1, round(takes / self.step)), self._numbers.shaft.load
        advance(
            self.kept,
            (v, count),
            takes / count,
            ohm,
            self.rest,
            self._numbers,
            self._table,
            self.out,
        )
        given = dict(zip(COLUMNS, self.out.tolist(), strict=True))
        return given | {"idc": given["i_bridge"] - given["idc"]} if held else given

    def powers(self, v: float, x: float, load: float) -> dict[str, float]:
        """Power by the rates of the ledger at what was given last, where the line had a velocity
        and a displacement. [W]
        """
        motion = LineMotion(
            np.zeros(1), np.array([x]), np.array([v]), np.zeros(1), self.step, self.rest
        )
        found = rates(self.model, motion, load, self.out[None, :])
        return {name: float(watt[0]) for name, watt in found.items()}
