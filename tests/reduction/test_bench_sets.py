"""Measured benches of other people: the figures that their owners logged, or that a plain script
gives.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from winchcascade import load_rig, reduce
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import Signal
from winchcascade.reduction.reduction_result import Reduction

RPM = 30.0 / math.pi

STAND = """
name = "propeller stand"
[cascade]
stages = ["gen", "mech"]
[stage.mech]
power = "torque * speed"
[columns]
speed = { name = "Motor SENSOR Speed (RPM)", side = "shaft" }
vdc = "Voltage (V)"
idc = "Current (A)"
[phases]
from = "SOURCE"
"""

DYNO = """
name = "vdyno"
[log]
sample_rate_hz = 10
[cascade]
stages = ["gen", "mech"]
[columns]
speed = { name = "Status_RPM_V2", unit = "rpm", side = "shaft" }
torque = { name = "TorqueValue", unit = "N.m" }
[phases]
from = "steps"
"""

WAVES = """
name = "siweed"
[cascade]
stages = ["mech"]
[columns]
time = { name = "timeStamp", unit = "ms" }
speed = { name = "wecVel", unit = "rad/s", side = "shaft" }
torque = { name = "wecTau", unit = "N.m" }
power_mech = { name = "wecPower", unit = "W" }
[thresholds]
gap_max = 2.0
gap_energy_max = 0.2
[phases]
from = "SOURCE"
"""


def reduced(path: Path, rig: str) -> Reduction:
    return reduce(path, rig=parse_rig(rig, "rig.toml"))


def column(path: Path, number: int) -> Signal:
    found: Signal = np.genfromtxt(
        path, delimiter=",", skip_header=1, usecols=[number], encoding="utf-8-sig"
    )
    return found


def test_the_motor_efficiency_of_each_row_is_that_of_the_stand(shared: Path) -> None:
    path = shared / "benches" / "rcbenchmark-1580" / "StepsTest_2020-05-22_102946.csv"
    found = reduced(path, STAND.replace("SENSOR", "Electrical").replace("SOURCE", "rows"))
    eta = [c.metrics.eta_gen_mech for c in found.cycles]
    assert eta == pytest.approx((column(path, 16) / 100.0).tolist(), abs=1e-3)


@pytest.mark.parametrize("day", ["20230615_2023-06-15_174003", "20230624_2023-06-24_190243"])
def test_a_motor_at_rest_has_its_electrical_energy_no_speed_and_no_efficiency(
    day: str, shared: Path
) -> None:
    path = shared / "benches" / "rcbenchmark-1580" / f"StepsTest{day}.csv"
    found = reduced(path, STAND.replace("SENSOR", "Optical").replace("SOURCE", "whole"))
    (cycle,) = found.cycles
    script = float(np.trapezoid(column(path, 14), column(path, 0)))
    assert cycle.metrics.energy_gen == pytest.approx(script, rel=2e-3)
    assert cycle.metrics.eta_gen_mech is None
    assert cycle.summary.point
    assert cycle.summary.point.rpm_shaft == 0.0


@pytest.mark.parametrize("start", ["13-48-06", "14-54-05"])
def test_the_shaft_energy_of_each_step_of_a_dyno_is_that_of_a_script(
    start: str, shared: Path
) -> None:
    path = shared / "benches" / "vdyno" / f"2025-04-16_{start}.csv"
    found = reduced(path, DYNO)
    omega, torque = column(path, 3) / RPM, column(path, 6)
    assert found.cycles
    for cycle in found.cycles:
        first, last = round(10.0 * cycle.window.onset), round(10.0 * cycle.window.cutoff)
        script = float(np.trapezoid((omega * torque)[first : last + 1], dx=0.1))
        assert cycle.metrics.energy_mech == pytest.approx(script, rel=1e-3)
        assert cycle.metrics.energy_gen is None


def test_a_wave_maker_at_rest_has_no_wave_and_its_power_contradicts_torque_and_speed(
    shared: Path,
) -> None:
    path = next((shared / "benches" / "siweed").glob("*.csv"))
    assert reduced(path, WAVES.replace("SOURCE", "waves")).cycles == ()
    found = reduced(path, WAVES.replace("SOURCE", "whole"))
    (cycle,) = found.cycles
    assert cycle.complete
    script = float(np.trapezoid(column(path, 21), column(path, 0) / 1e3))
    assert cycle.metrics.energy_mech == pytest.approx(script, rel=0.03)
    flow = dict(cycle.summary.both_ways or {})["mech"]
    magnitude = float(np.trapezoid(np.abs(column(path, 21)), column(path, 0) / 1e3))
    assert flow.positive - flow.negative == pytest.approx(magnitude, rel=0.03)
    assert any("power_mech is -0.98" in finding.message for finding in found.quality)


def test_battery_and_load_dump_of_the_vented_buoy_take_0_631_of_what_the_rod_gives(
    shared: Path,
) -> None:
    found = reduce(
        shared / "benches" / "mbari-wec-pto" / "2022.12.21T15.44.24_VentedSpring.exp",
        rig=load_rig("fixtures/measured/mbari/rig.toml"),
    )
    assert found.mean.value("eta_line_dc") == pytest.approx(0.631, abs=5e-4)
