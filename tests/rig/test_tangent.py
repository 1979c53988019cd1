"""Derivatives of the shaft's solution against differences of solutions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest
from daily import daily

from winchcascade import read_run
from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.rig.bridge import bridge_slopes, bridge_state, bridge_table
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.kernel import SHAFT, STATE, Constants, LineMotion, constants, solve_shaft
from winchcascade.rig.parts import Model, changed
from winchcascade.rig.simulate import motion_of
from winchcascade.rig.tangent import MAX_WAYS, NUMBERS, Direction, Tangent, direction, tangent_of

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

CAMPAIGN = Path(__file__).parent.parent.parent / "fixtures" / "campaign"
STEP, EVERY = 1e-3, 10
AT_REST = 5.0
"""Below this speed friction alone decides. [rad/s]"""

ROLLOFF = [field.name for field in EFFECTS["ke_rolloff"].fields]
NOMINAL = baseline(built_in())


def bent(model: Model, **fields: dict[str, float]) -> Model:
    for name, values in fields.items():
        model = make_effect(name, values).apply(model)
    return model


WORN = bent(
    NOMINAL,
    ke_rolloff={"lost_to_5_a": 0.03, "lost_to_7_a": 0.05, "lost_to_11_a": 0.06, "lost_to_20_a": 0.1},
    rotor_friction={"torque": 0.05},
    rotor_windage={"c_extra": 1e-6},
)


def motion(name: str, load: float) -> LineMotion:
    run = read_run(CAMPAIGN / name, load=load)
    first = run.t < run.t[0] + 60.0
    cut = {key: x[first] for key, x in run.channels.items()}
    return motion_of(msgspec.structs.replace(run, t=run.t[first], channels=cut, samples=int(first.sum())), STEP)


def solve(v: Signal, numbers: Constants) -> Signal:
    return solve_shaft(v, STEP, numbers, EVERY)


def derivatives(v: Signal, numbers: Constants, ways: list[Direction]) -> Tangent:
    state = np.empty((v.size, len(STATE)))
    solve_shaft(v, STEP, numbers, EVERY, state)
    return tangent_of(v, STEP, numbers, state, EVERY, ways)


def seen(out: Signal) -> Signal:
    """Torque of the clutch and DC voltage where derivatives are kept, (2, n)."""
    return np.ascontiguousarray(out[:, [SHAFT.index("clutch"), SHAFT.index("vdc")]].T)


def change(tangent: Tangent, numbers: Constants) -> Signal:
    """Change of torque of the clutch and DC voltage to other numbers, to first order, (2, n)."""
    return np.tensordot(tangent.moves(numbers), tangent.slopes, axes=(0, 1))


EASY = changed(NOMINAL, "drivetrain.friction", "add", -0.005)
"""A deviation of the model that a fit may try: the shaft loses less than stated."""


LOADED = [("r4p5ohm.csv", 4.5), ("r36ohm.csv", 36.0)]
CASES = [(model, *log) for model in (NOMINAL, WORN, EASY) for log in (*LOADED, ("open_circuit.csv", math.inf))]


@pytest.mark.parametrize(("model", "name", "load"), daily(CASES, CASES[:6], spread=True))
def test_derivatives_are_the_limit_of_differences(model: Model, name: str, load: float) -> None:
    course = motion(name, load)
    numbers = constants(model, load)
    solution = solve(course.v, numbers)
    ways = {field: direction(numbers, constants(bent(model, ke_rolloff={field: 1e-4}), load)) for field in ROLLOFF}
    tangent = derivatives(course.v, numbers, list(ways.values()))
    turning = solution[:, SHAFT.index("omega_gen")] > AT_REST
    for what in (*NUMBERS, *ways):
        if what in ways:
            there = constants(bent(model, ke_rolloff={what: 1e-4}), load)
            moved = seen(solve(course.v, there)) - seen(solution)
        else:
            value = getattr(numbers, what)
            step = 1e-4 * value or 1e-7
            there, back = (numbers._replace(**{what: value + side * step}) for side in (1.0, -1.0))
            moved = 0.5 * (seen(solve(course.v, there)) - seen(solve(course.v, back)))
        slopes = change(tangent, there)[:, turning]
        moved = moved[:, turning]
        for k in range(2):
            size = float(np.sqrt(np.mean(moved[k] ** 2)))
            wrong = float(np.sqrt(np.mean((slopes[k] - moved[k]) ** 2)))
            assert wrong <= 0.01 * size + 1e-6, (
                f"{what}: {('clutch', 'vdc')[k]} moves by {size:.3g}, off by {wrong:.3g}"
            )


def test_currents_follow_the_angle_of_the_impedance() -> None:
    table = bridge_table()
    for v_total in (20.0, 60.0, 110.0):
        for angle in (0.3, 0.7, 1.2):
            at = [
                bridge_state(v_total, 100.0, math.sin(angle + d), math.cos(angle + d), table)[:2] for d in (1e-6, -1e-6)
            ]
            slopes = [(a - b) / 2e-6 for a, b in zip(*at, strict=True)]
            turned = bridge_slopes(v_total, 100.0, math.sin(angle), math.cos(angle), table)[4:]
            assert turned == pytest.approx(slopes, rel=1e-4, abs=1e-6)


def test_nothing_changes_where_no_number_does() -> None:
    course = motion("r36ohm.csv", 36.0)
    numbers = constants(NOMINAL, 36.0)
    tangent = derivatives(course.v, numbers, [])
    assert not change(tangent, numbers).any()


def test_no_number_becomes_subnormal_at_rest() -> None:
    numbers = constants(WORN, 4.5)
    v = np.concatenate([motion("r4p5ohm.csv", 4.5).v, np.zeros(round(60.0 / STEP))])  # and a rest of a minute
    state = np.empty((v.size, len(STATE)))
    out = solve_shaft(v, STEP, numbers, EVERY, state)
    slopes = tangent_of(v, STEP, numbers, state, EVERY, [direction(constants(NOMINAL, 4.5), numbers)]).slopes
    for found in (out, state, slopes):
        assert np.abs(found[found != 0.0]).min() > 1e-250
    assert not state[-1, [STATE.index("omega_gen"), STATE.index("vdc")]].any()


def test_a_direction_that_was_not_carried_is_rejected() -> None:
    course = motion("r36ohm.csv", 36.0)
    numbers = constants(NOMINAL, 36.0)
    tangent = derivatives(course.v, numbers, [])
    with pytest.raises(ValueError, match="not in tuple"):
        tangent.moves(constants(WORN, 36.0))
    way = direction(numbers, constants(WORN, 36.0))
    with pytest.raises(ValueError, match="directions of the roll-off"):
        derivatives(course.v, numbers, [way] * (MAX_WAYS + 1))
