"""A simulation is brought to the stamps of its log, or rejected where it has another line motion."""

import msgspec
import numpy as np
import pytest
from planted import driven

from winchcascade.core.errors import LogError
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.own_simulation import SAME, onto_log
from winchcascade.rig.baseline import baseline
from winchcascade.rig.simulate import simulate

WHOLE = slice(None)

INTERPOLATED = 0.003
"""Share of the maximum of a channel by which straight lines between samples at 25 Hz may deviate."""


@pytest.fixture(scope="module")
def simulation() -> Run:
    """A simulation of the second log of the campaign."""
    return simulate(driven()[1], baseline(built_in())).run


def moved(run: Run, t: Signal, *, late: float = 0.0) -> Run:
    """A run at other stamps, on a clock that is ahead by so much."""
    channels = {name: np.interp(t, run.t, x) for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=t + late, channels=channels, samples=t.size, fs=1.0 / float(t[1] - t[0]))


def faster(run: Run, by: float) -> Run:
    return msgspec.structs.replace(run, channels={**run.channels, "velocity": (1.0 + by) * run.channels["velocity"]})


@pytest.mark.parametrize(("rate", "late"), [(None, 0.0), (10.0, 0.0), (25.0, 7.31), (200.0, -3.7), (60.0, 1e5)])
def test_any_rate_and_clock_are_brought_to_the_log(simulation: Run, rate: float | None, late: float) -> None:
    log = driven()[1]
    t = simulation.t if rate is None else np.arange(simulation.t[0], simulation.t[-1], 1.0 / rate)
    found = onto_log(moved(simulation, t, late=late), log, WHOLE)
    assert found.simulated
    assert np.array_equal(found.t, log.t)
    inside, allowed = log.t < t[-1], 0.0 if rate is None else INTERPOLATED
    for name in ("pressure", "torque", "vdc"):
        x = simulation.channels[name]
        assert np.sqrt(np.mean((found.channels[name] - x)[inside] ** 2)) <= allowed * np.max(np.abs(x))


def test_another_motion_is_rejected_with_its_difference(simulation: Run) -> None:
    with pytest.raises(LogError, match=r"differ by 3 % rms after a shift of 0 s; expected 1 % at most"):
        onto_log(faster(simulation, 0.03), driven()[1], WHOLE)
    assert onto_log(faster(simulation, 0.8 * SAME), driven()[1], WHOLE).samples


def test_a_simulation_that_ends_before_the_log_is_rejected_unless_those_cycles_do_not_count(simulation: Run) -> None:
    log, short = driven()[1], simulation.t[simulation.t < 12.0]
    with pytest.raises(LogError, match="another line motion"):
        onto_log(moved(simulation, short), log, WHOLE)
    assert onto_log(moved(simulation, short), log, slice(0, short.size - 10)).samples == log.samples


def test_a_channel_that_only_the_log_has_is_named(simulation: Run) -> None:
    fewer = {name: x for name, x in simulation.channels.items() if name != "torque"}
    with pytest.raises(LogError, match=r"no column for torque, which the log r36ohm.csv has"):
        onto_log(msgspec.structs.replace(simulation, channels=fewer), driven()[1], WHOLE)
