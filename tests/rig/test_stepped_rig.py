"""A rig that another solver drives, as a value and as a unit of FMI: what `simulate` gives, step
by step.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import call
from own_rigs import RESTORING, own_rig

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Signal
from winchcascade.rig.baseline import baseline
from winchcascade.rig.kernel import COLUMNS, LineMotion
from winchcascade.rig.ledger import integral
from winchcascade.rig.parts import Model, with_part
from winchcascade.rig.simulate import solve
from winchcascade.rig.stepped_rig import SteppedRig

STEP, REST, LOAD = 0.0024, 0.005, 20.0


def motion(count: int) -> LineMotion:
    """A line that is paid out and hauled in, with the acceleration that follows from three
    velocities.
    """
    t: Signal = STEP * np.arange(float(count))
    v: Signal = 0.6 * np.sin(2.0 * np.pi * t / 6.0) * np.minimum(1.0, t)
    return LineMotion(t, integral(v, STEP), v, np.gradient(v, STEP), STEP, REST)


@pytest.mark.parametrize("kind", RESTORING)
def test_stepped_one_by_one_a_rig_does_what_it_does_along_a_motion(kind: str) -> None:
    model = baseline(own_rig(kind)).physics
    if kind == "gas_screw":
        model = with_part(model, "restoring", exponent=1.3)
    given = motion(3000)
    whole = solve(model, given, LOAD)
    assert np.allclose(
        stepped(model, given), whole[:-1], rtol=1e-12, atol=1e-12 * np.max(np.abs(whole))
    )


def stepped(model: Model, given: LineMotion) -> Signal:
    """What a rig gives at every step but the last, (n - 1, 12)."""
    rig = SteppedRig(model, STEP, REST)
    rig.begin(float(given.v[0]))
    return np.array([list(rig.advance(v, STEP, LOAD).values()) for v in given.v[1:].tolist()])


def test_a_rig_goes_on_from_what_was_kept() -> None:
    given, rig = motion(400), SteppedRig(baseline(built_in()).physics, STEP, REST)
    speeds = given.v.tolist()
    for v in speeds[:200]:
        rig.advance(v, STEP, LOAD)
    kept = rig.kept.copy()
    first = [rig.advance(v, STEP, LOAD) for v in speeds[200:]]
    rig.kept[:] = kept
    assert [rig.advance(v, STEP, LOAD) for v in speeds[200:]] == first


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("pythonfmu")
    path = tmp_path_factory.mktemp("fmu") / "rig.fmu"
    assert call("rig", "hsu2026", "--export", path).code == 0
    return path


def test_a_unit_of_fmi_gives_what_simulate_gives(unit: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    description = fmpy.read_model_description(str(unit))
    units = {variable.name: variable.unit for variable in description.modelVariables}
    assert (units["line_tension"], units["generator.k_e"], units["load_resistance"]) == (
        "N",
        "V/rpm",
        "ohm",
    )
    given = motion(2000)
    columns = [("time", float), ("line_velocity", float), ("load_resistance", float)]
    inputs = np.zeros(given.t.size - 1, dtype=columns)
    inputs["time"], inputs["line_velocity"], inputs["load_resistance"] = (
        given.t[:-1],
        given.v[1:],
        LOAD,
    )
    outputs = {
        "line_tension": "force",
        "torque_pto": "torque",
        "vdc": "vdc",
        "idc": "idc",
        "generator_speed": "omega_gen",
    }
    found: Any = fmpy.simulate_fmu(
        str(unit), input=inputs, step_size=STEP, output_interval=STEP, stop_time=float(given.t[-2]), output=list(outputs),
        start_values={"rest_speed": REST, "step": STEP, "start_velocity": float(given.v[0])},
    )  # fmt: skip
    whole = solve(baseline(built_in()).physics, given, LOAD)
    for name, column in outputs.items():
        expected = whole[: len(found) - 1, COLUMNS.index(column)]
        assert np.max(np.abs(found[name][1:] - expected)) < 1e-6 * np.max(np.abs(expected)), name


def test_at_the_voltage_that_a_load_makes_a_bus_takes_its_current() -> None:
    """A DC bus in place of a load: at the voltage of the load it takes the same current, at a
    high one it takes none.
    """
    model, speeds = baseline(built_in()).physics, np.full(4000, 0.5)
    by_load, by_bus, high = (SteppedRig(model, STEP, REST) for _ in range(3))
    for v in speeds.tolist():
        given = by_load.advance(v, STEP, LOAD)
    for v in speeds.tolist():
        held, off = (
            by_bus.advance(v, STEP, LOAD, given["vdc"]),
            high.advance(v, STEP, LOAD, 2.0 * given["vdc"]),
        )
    assert held["vdc"] == given["vdc"]
    bleed = given["vdc"] / model.dc_link.r_bleed
    assert held["idc"] + bleed == pytest.approx(given["idc"], rel=1e-6)
    assert held["force"] == pytest.approx(given["force"], rel=1e-6)
    assert off["i_bridge"] == 0.0


def test_a_unit_of_fmi_takes_the_voltage_of_a_bus(unit: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    inputs = np.array(
        [(0.0, 0.6, 80.0)], dtype=[("time", float), ("line_velocity", float), ("dc_voltage", float)]
    )
    found: Any = fmpy.simulate_fmu(
        str(unit), input=inputs, step_size=STEP, output_interval=STEP, stop_time=2.0, output=["vdc", "idc"],
        start_values={"rest_speed": REST, "step": STEP},
    )  # fmt: skip
    assert found["vdc"][-1] == 80.0
    assert found["idc"][-1] > 1.0
