"""Runs that are planned: cycles of one payout at a load and speed, as those of a campaign, made as
the rig would make them and laid out as logs of a fit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.fit.block_means import PAYOUT
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.rig.effects.run_order import RunOrder, RunPlace
from winchcascade.rig.simulate import Simulation, simulate

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.fit.nuisances import Nuisance
    from winchcascade.rig.parts import Model


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
    for log in [data.logs[k] for k in data.taking]:
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


SEED = 1
"""Seed of the noise of planned runs, and of random plans."""


Place = Literal["first", "any", "last"]
"""When a run is made: with a machine that is cold, at any time, or after all other runs."""


class PlannedRun(msgspec.Struct, frozen=True):
    """A run to be made: load [ohm], speed of the plateau [m/s], number of cycles, and its place
    among the runs.
    """

    load: float
    speed: float
    cycles: int = 1
    place: Place = "any"


class Setting(NamedTuple):
    """How runs are made on a rig.

    Parameters
    ----------
    rig, model : with the numbers of its file, and the model that best describes it
    length, time : travel of a payout [m], and time of a stroke at the top speed of the campaign [s]
    rate : samples a second [Hz]
    noise : of a sample of each channel that is logged, SI units; None for `SAMPLE_NOISE`
    data : logs so far, None before any
    """

    rig: Rig
    model: Model
    length: float
    time: float
    rate: float
    noise: Mapping[str, float] | None = None
    data: Fitted | None = None


SAMPLE_NOISE = 0.002
"""Noise of a sample before a campaign, as a share of the largest value of the channel in all
runs. Assumed. [1]
"""


class Prospect(NamedTuple):
    """Runs that may be made, as logs of a fit, and what they share with the logs so far.

    `carried` (q, n) are nuisances of the runs, in their units, over those of the logs so far; what
    concerns one log alone is none of these.
    """

    runs: Fitted
    carried: Signal

    def carried_beside(self, fields: int) -> Signal:
        """Fields of an explanation, and then nuisances of the runs, over those of the logs so
        far.
        """
        count, known = self.carried.shape
        carried = np.eye(fields + count, fields + known)
        carried[fields:, fields:] = self.carried
        return carried


def prospect_of(setting: Setting, options: Sequence[PlannedRun]) -> Prospect:
    """Lay out runs that may be made.

    Raises
    ------
    OptionError : in none of them the generator delivers anything
    """
    made = [one.run for one in simulated(setting, options)]
    noise = setting.noise or {
        name: SAMPLE_NOISE * max(float(np.max(np.abs(run.channels[name]))) for run in made)
        for name in made[0].channels
    }
    if noise.get("vdc", 1.0) == 0.0:
        raise OptionError(
            "no planned run is fast enough for a voltage at the DC link; expected faster ones."
        )
    data = setting.data
    noisy = [_with_noise(run, noise, setting.rig) for run in made]
    places = [_place(data, one) for one in options]
    scales = None if data is None else data.scales
    runs = Fitted(noisy, setting.rig, scales=scales, places=places)
    known = runs if data is None else data
    carried = np.zeros((len(runs.nuisances), len(known.nuisances)))
    own = {_key(n): i for i, n in enumerate(known.nuisances) if n.kind != "zero"}
    for j, n in enumerate(runs.nuisances):
        if (i := own.get(_key(n))) is not None:
            carried[j, i] = known.nuisances[i].sd / n.sd
    return Prospect(runs, carried)


def simulated(setting: Setting, options: Sequence[PlannedRun]) -> list[Simulation]:
    """Runs as the rig would make them, by sensors without errors."""
    motion, model = (setting.length, setting.time, setting.rate), setting.model.physics
    return all_at_once(
        [partial(simulate, planned(one.load, one.speed, *motion), model) for one in options]
    )


def _key(n: Nuisance) -> tuple[str, ...]:
    """What a nuisance is, whatever its tolerance."""
    return (n.kind, n.section, n.name, n.phase, n.course, f"{n.load:g}")


def _with_noise(run: Run, noise: Mapping[str, float], rig: Rig) -> Run:
    """A simulated run as it would be logged: with the channels whose noise of a sample is known."""
    rng = np.random.default_rng(SEED)
    channels = {
        name: x + rng.normal(0.0, noise[name], x.size)
        for name, x in run.channels.items()
        if name in noise
    }
    return msgspec.structs.replace(run, channels=channels, simulated=False, rig=rig)


def _place(data: Fitted | None, option: PlannedRun) -> RunPlace:
    """The place of a run among the others; before a campaign it is made cold, or as warm as the
    machine becomes.
    """
    if data is None:
        return RunPlace(RunOrder((0.0, 1.0), (1.0, 1.0)), int(option.place != "first"))
    order = data.order
    known = [
        heat for heat, log in zip(order.heat, data.logs, strict=True) if log.load == option.load
    ]
    return RunPlace(order.with_run(float(np.mean(known or order.heat))), len(order.heat))
