"""The model in blocks: as the simulation says, and as cheap as the numbers allow."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rigs import calibrated_rig, course_of

from winchcascade import read_run, simulate
from winchcascade.core.run import Run
from winchcascade.diagnosis.fit.predict import CHANNELS, MAX_KEPT, Course
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import PARTS, number_of, numbers_of, with_part
from winchcascade.rig.state import Constants, constants

RIG = calibrated_rig()
MODEL = baseline(RIG)

OF_THE_LINE = {
    *(f"winch.{name}" for name in numbers_of("winch") if name != "r_drum"),
    *(f"restoring.{name}" for name in numbers_of("restoring")),
    "drivetrain.clutch_drag",
    "dc_link.r_bleed",
}
"""Numbers on which the solution of the shaft does not depend, at a load."""

COARSELY = 2e-3
"""A step of 1 ms and solutions kept every 10 ms move a block by less than this share of the
channel's plateau.
"""


@pytest.fixture(scope="module")
def run() -> Run:
    path = Path(__file__).parent.parent.parent / "fixtures" / "campaign" / "r18ohm.csv"
    return read_run(path, load=18.0)


@pytest.fixture(scope="module")
def course(run: Run) -> Course:
    return course_of(run, RIG)


def other(course: Course, path: str, share: float = 0.1) -> Constants:
    """Numbers of a model of which one is another."""
    part, name = path.split(".")
    value = (1.0 + share) * number_of(MODEL, path) + 1e-4
    return constants(with_part(MODEL, part, **{name: value}), 18.0, course.coarse.rest)


def numbers(course: Course) -> Constants:
    """Numbers of the model of the rig file."""
    return constants(MODEL, 18.0, course.coarse.rest)


@pytest.mark.parametrize("path", [f"{part}.{name}" for part in PARTS for name in numbers_of(part)])
def test_a_change_at_the_line_keeps_the_solution_of_the_shaft_and_any_other_solves_it_anew(
    course: Course, path: str
) -> None:
    assert (course.shaft(other(course, path)) is course.shaft(numbers(course))) == (
        path in OF_THE_LINE
    )


def test_the_solution_that_was_used_longest_ago_goes_first(run: Run) -> None:
    course = course_of(run, RIG, (1, 1))
    first, second = course.shaft(numbers(course)), course.shaft(other(course, "drivetrain.gear"))
    for k in range(MAX_KEPT - 1):
        course.shaft(other(course, "drivetrain.b_rotor", 0.1 * (k + 1)))
        assert course.shaft(numbers(course)) is first
    assert course.shaft(other(course, "drivetrain.gear")) is not second


@pytest.mark.parametrize("load", [math.inf, 45.0, 4.5])
def test_blocks_of_the_prediction_are_those_of_the_simulation(run: Run, load: float) -> None:
    loaded = msgspec.structs.replace(run, load=load)
    course = course_of(loaded, RIG)
    found, simulated = course.predict(MODEL), simulate(loaded, MODEL).run.channels
    for k, name in enumerate(CHANNELS):
        plateau = float(np.quantile(np.abs(simulated[name]), 0.95))
        off = found[:, k] - course.blocks.mean(simulated[name])
        assert np.max(np.abs(off)) < COARSELY * plateau, name


def test_sensors_errors_show_in_their_channel(course: Course) -> None:
    clean = course.predict(MODEL)
    sensors = msgspec.structs.replace(MODEL.sensors, gain={"force": 0.01})
    read = course.predict(msgspec.structs.replace(MODEL, sensors=sensors))
    assert read[:, 1] == pytest.approx(1.01 * clean[:, 1])
    assert np.array_equal(np.delete(read, 1, axis=1), np.delete(clean, 1, axis=1))


def test_a_channel_read_late_lags_behind(course: Course) -> None:
    clean = course.predict(MODEL)
    late = course.predict(MODEL, skew=np.array([0.0, 0.0, 0.0, 0.1, 0.0]))
    vdc = CHANNELS.index("vdc")
    rising = (course.blocks.phase == 0) & (np.gradient(clean[:, vdc]) > 5.0)
    assert np.all(late[rising, vdc] < clean[rising, vdc])
    assert np.array_equal(np.delete(late, vdc, axis=1), np.delete(clean, vdc, axis=1))


def test_more_speed_moves_the_shaft_and_not_the_gas(course: Course) -> None:
    clean, faster = course.predict(MODEL), course.predict(MODEL, 1.01)
    payout = course.blocks.mean(course.run.channels["velocity"]) > 0.5
    assert np.array_equal(faster[:, 0], clean[:, 0])
    assert np.all(faster[payout, CHANNELS.index("vdc")] > clean[payout, CHANNELS.index("vdc")])


def test_a_change_of_the_gas_changes_pressure_and_force_alone(course: Course) -> None:
    clean, other = (
        course.predict(MODEL),
        course.predict(with_part(MODEL, "restoring", volume=1.1 * MODEL.restoring.volume)),
    )
    assert np.any(other[:, 0] != clean[:, 0])
    assert np.any(other[:, 1] != clean[:, 1])
    assert np.array_equal(other[:, 2:], clean[:, 2:])
