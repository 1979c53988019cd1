"""Motions of runs that are planned: a cycle of one payout at a load and speed, as those of a
campaign.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.fit.block_means import PAYOUT
from winchcascade.diagnosis.fit.misfit import Fitted

if TYPE_CHECKING:
    pass


RAMP, HOLD, REST, BACK, SHORTEST = 0.15, 0.4, 0.2, 0.6, 0.01
"""Ramps of a planned run, hold after its payout, rests before and after, over the time of a stroke;
its haul-in as a share of the payout speed, and the shortest plateau or ramp over that time. [1]"""

PLATEAU, WITHIN_RAMP = 0.97, (0.05, 0.95)
"""Quantile of the velocity of a payout that is the speed of its plateau, and shares of that
between which its ramp is timed.
"""


class Usual(NamedTuple):
    """Payouts of a campaign: fastest plateau at each load [ohm: m/s], median travel [m] and
    median time of a ramp [s].
    """

    fastest: dict[float, float]
    length: float
    ramp: float

    def fastest_at(self, load: float) -> float:
        """Fastest plateau of the logs at a load; at one that was not run, within the speed and
        the current of all. [m/s]
        """
        top, current = (
            max(self.fastest.values()),
            max(v / other for other, v in self.fastest.items()),
        )
        within = min(top, current * load) if current > 0.0 and load < math.inf else top
        return self.fastest.get(load, within)


def usual(data: Fitted) -> Usual | None:
    """The usual payout of a campaign; None where no log has one."""
    fastest: dict[float, float] = {}
    lengths, ramps = [], []
    for log in [log for k, log in enumerate(data.logs) if k not in data.withheld]:
        blocks, velocity = log.course.blocks, log.run.channels["velocity"]
        for cycle in np.unique(blocks.cycle[blocks.phase == PAYOUT]):
            own = np.flatnonzero((blocks.cycle == cycle) & (blocks.phase == PAYOUT))
            span = slice(blocks.start[own[0]], blocks.stop[own[-1]])
            v, x, t = velocity[span], log.course.displacement[span], log.run.t[span]
            top = float(np.quantile(v, PLATEAU))
            begins, reached = (int(np.argmax(v >= share * top)) for share in WITHIN_RAMP)
            fastest[log.load] = max(fastest.get(log.load, 0.0), top)
            lengths.append(float(x[-1] - x[0]))
            ramps.append(float(t[reached] - t[begins]) / (WITHIN_RAMP[1] - WITHIN_RAMP[0]))
    if not fastest:
        return None
    shortest = SHORTEST * data.scales.motion.time
    return Usual(fastest, float(np.median(lengths)), max(float(np.median(ramps)), shortest))


def cycle_of(speed: float, length: float, time: float) -> tuple[Signal, Signal]:
    """Corners of one trapezoid out and one back, (10,): stamps [s] and velocities [m/s].

    Parameters
    ----------
    speed : of the plateau [m/s]
    length : of the payout [m]; one shorter than its ramps need reaches the speed for an instant
    time : of a stroke at the top speed of the campaign [s]
    """
    back, ramp, rest = BACK * speed, RAMP * time, REST * time
    out, home = (max(length / v - ramp, SHORTEST * time) for v in (speed, back))
    t = np.cumsum([0.0, rest, ramp, out, ramp, HOLD * time, ramp, home, ramp, rest])
    return t, np.array([0.0, 0.0, speed, speed, 0.0, 0.0, -back, -back, 0.0, 0.0])


def planned(load: float, speed: float, length: float, time: float, rate: float) -> Run:
    """A run of one such cycle, without noise.

    Parameters
    ----------
    time, rate : of a stroke at the top speed of the campaign [s], and samples a second [Hz]
    """
    corners = cycle_of(speed, length, time)
    t = np.arange(0.0, corners[0][-1], 1.0 / rate)
    return Run(
        name="planned",
        t=t,
        channels={"velocity": np.interp(t, *corners)},
        fs=rate,
        samples=t.size,
        load=load,
    )
