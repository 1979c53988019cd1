"""Numbers of the twin of the rig: values, tolerances, and noise of its sensors.

The twin holds a table of its own and reads none of the rig's, so that a slip in one of them shows
as a gap in a trial.
"""

import math
from typing import NamedTuple

import msgspec

KG_CM2 = 98066.5
"""One kg/cm2. [Pa]"""

AIR = 101325.0
"""Air pressure around the rig, between gauge and absolute. [Pa]"""

LOADS = {
    "open_circuit": 4500.0, "r45ohm": 45.0, "r36ohm": 36.0, "r27ohm": 27.0, "r18ohm": 18.0, "r9ohm": 9.0,
    "r4p5ohm": 4.5,
}  # fmt: skip
"""Logs of a campaign and the resistance at their DC link; the open circuit's is that of Sec.
4.2. [ohm]
"""


class Numbers(NamedTuple):
    """Numbers of the rig that a campaign draws, SI units; Tables 3 and 4 of Hsu et al. 2026 unless
    another place is named.

    Parameters
    ----------
    k_e : line to line, rms, over the speed; Sec. 4.2 [V/rpm]
    r_s, l_s : of a phase [ohm, H]
    b_rotor : viscous loss of the high-speed shaft, Sec. 4.2 [N m s/rad]
    p_gas : absolute pressure at zero payout; Sec. 3.1 has 20.5 kg/cm2 gauge [Pa]
    area : of the piston [m2]
    v_gas : at zero payout [m3]
    c_dc : at the DC link, not published, assumed [F]
    eta_mesh : of the gear; Sec. 4.2 and Table 4, where Sec. 4.1.3 prints 0.9 [1]
    mu : friction of the screw [1]
    """

    k_e: float = 0.0620
    r_s: float = 0.61
    l_s: float = 3.35e-3
    b_rotor: float = 7.5e-4
    p_gas: float = 20.5 * KG_CM2 + AIR
    area: float = 7850e-6
    v_gas: float = 4.0e-3
    c_dc: float = 2.2e-3
    eta_mesh: float = 0.95
    mu: float = 0.04


SCATTER = Numbers(
    k_e=1e-3 * 0.0620,
    r_s=5e-3 * 0.61,
    l_s=7e-3 * 3.35e-3,
    b_rotor=1e-2 * 7.5e-4,
    p_gas=1e-3 * (20.5 * KG_CM2 + AIR),
    area=2e-3 * 7850e-6,
    v_gas=3e-3 * 4.0e-3,
    c_dc=0.1 * 2.2e-3,
    eta_mesh=0.002,
    mu=0.0005,
)
"""How well a rig that was calibrated in place is known: one standard uncertainty of each number,
assumed.
"""

LOAD_SCATTER = 1e-3
"""Of each load, and of the sensors' gains. [1]"""


class Fixed(NamedTuple):
    """Numbers that every campaign shares, SI units: Sec. 2.1.1 and Tables 3 and 4; the shaft's
    damping is assumed.
    """

    r_drum: float = 0.13
    j_drum: float = 0.3
    lead: float = 0.010
    lead_angle: float = 5.0
    thread_angle: float = 4.5
    gear: float = 50.0
    k_shaft: float = 2000.0
    c_shaft: float = 6.0
    j_rotor: float = 6260e-7
    pole_pairs: float = 2.0
    v_diode: float = 0.7


class Restoring(NamedTuple):
    """What keeps the line taut in the place of screw and gas, SI units; by default it is the gas.

    Parameters
    ----------
    kind : gas_screw, spring, counterweight or none
    force, stiffness : of a spring at zero payout, at the line [N, N/m]
    weight : of a counterweight [N]
    friction : of spring or counterweight against the motion [N]
    gravity : by which a weight has its mass [m/s2]
    """

    kind: str = "gas_screw"
    force: float = 0.0
    stiffness: float = 0.0
    weight: float = 0.0
    friction: float = 0.0
    gravity: float = 9.80665

    @property
    def has_gas(self) -> bool:
        """Whether screw, piston and gas are there, and a pressure."""
        return self.kind == "gas_screw"


RESTORING_SHARES = {"force": 2e-3, "stiffness": 5e-3, "weight": 2e-3, "friction": 2e-2}
"""One standard uncertainty of each number of a spring or a counterweight as a share of it,
assumed. [1]
"""


class Crane(NamedTuple):
    """Motion of the crane over that of the paper's, each a factor; its speed stays. [1]

    Parameters
    ----------
    stroke : length of a payout, and with it the ramps of the haul-in
    ramp : time in which a payout speeds up and brakes
    back : speed of the haul-in
    wait : rest between the motions
    """

    stroke: float = 1.0
    ramp: float = 1.0
    back: float = 1.0
    wait: float = 1.0


CRANE = Crane()
"""The crane of the paper."""


class Logger(msgspec.Struct, frozen=True):
    """The logger of a campaign: time between two rows [s], and a factor on the noise of all sensors
    and on that of the tether; zero errors keep their size [1]. Sensors that scatter less than usual
    have a finer step, which does not hide it.
    """

    interval: float = 0.04
    noise: float = 1.0

    @property
    def decimals_time(self) -> int:
        """Number of decimals of the stamps: those of an interval in the units of another rig
        have no end.
        """
        return 4 if round(self.interval, 4) == self.interval else 9

    def step(self, usual: float) -> float:
        """Step of a column."""
        return usual * min(self.noise, 1.0)

    def decimals(self, usual: int) -> int:
        """Number of decimals of a column.

        >>> Logger().decimals(2), Logger(noise=0.5).decimals(2), Logger(noise=5.0).decimals(2)
        (2, 3, 2)
        """
        return usual + max(math.ceil(-math.log10(self.noise)), 0)


CRANE_LOGGER = Logger()
"""The logger of the crane trials: 25 Hz, and sensors that scatter as in crane logs."""


class SensorScatter(msgspec.Struct, frozen=True):
    """How a sensor scatters: zero error per log, white noise and resolution, in the unit of the
    logs.
    """

    unit: float
    zero: float
    noise: float
    step: float
    decimals: int


SENSORS = {
    "pressure": SensorScatter(KG_CM2, 0.03, 0.010, 0.001, 3),
    "force": SensorScatter(1.0, 2.0, 4.0, 0.2 * 9.80665, 1),
    "torque": SensorScatter(1.0, 0.3, 0.40, 0.01, 2),
    "vdc": SensorScatter(1.0, 0.0, 0.25, 0.01, 2),
    "idc": SensorScatter(1.0, 0.005, 0.015, 0.001, 3),
}
"""Sensors in the order of the gains: zeros as assumed for a rig calibrated in place, noise and
resolution as in crane logs.
"""

VELOCITY_NOISE, VELOCITY_STEP = 0.003, 0.002
"""Of the logged velocity. [m/s]"""

KNEE, LINE, BELL = 0.0, 1.0, 2.0
"""Laws of the back-EMF's roll-off: a smooth knee, a straight line beyond one, and a bell curve
from zero current on.
"""
