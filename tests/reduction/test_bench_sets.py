"""Measured benches of other people: the figures that their owners logged, or that a plain script gives."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from winchcascade import read_run, reduce
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
    known = parse_rig(rig, "rig.toml")
    return reduce(read_run(path, rig=known), rig=known)


def column(path: Path, number: int) -> Signal:
    found: Signal = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=[number], encoding="utf-8-sig")
    return found


def test_the_motor_efficiency_of_each_row_is_that_of_the_stand(shared: Path) -> None:
    path = shared / "benches" / "rcbenchmark-1580" / "StepsTest_2020-05-22_102946.csv"
    found = reduced(path, STAND.replace("SENSOR", "Electrical").replace("SOURCE", "rows"))
    eta = [c.metrics.eta_gen_mech for c in found.cycles]
    assert eta == pytest.approx((column(path, 16) / 100.0).tolist(), abs=1e-3)


@pytest.mark.parametrize("day", ["20230615_2023-06-15_174003", "20230624_2023-06-24_190243"])
def test_a_motor_at_rest_has_its_electrical_energy_no_speed_and_no_efficiency(day: str, shared: Path) -> None:
    path = shared / "benches" / "rcbenchmark-1580" / f"StepsTest{day}.csv"
    found = reduced(path, STAND.replace("SENSOR", "Optical").replace("SOURCE", "whole"))
    (cycle,) = found.cycles
    script = float(np.trapezoid(column(path, 14), column(path, 0)))
    assert cycle.metrics.energy_gen == pytest.approx(script, rel=2e-3)
    assert cycle.metrics.eta_gen_mech is None
    assert cycle.summary.point
    assert cycle.summary.point.rpm_shaft == 0.0


@pytest.mark.parametrize("start", ["13-48-06", "14-54-05"])
def test_the_shaft_energy_of_each_step_of_a_dyno_is_that_of_a_script(start: str, shared: Path) -> None:
    path = shared / "benches" / "vdyno" / f"2025-04-16_{start}.csv"
    found = reduced(path, DYNO)
    omega, torque = column(path, 3) / RPM, column(path, 6)
    assert found.cycles
    for cycle in found.cycles:
        first, last = round(10.0 * cycle.window.onset), round(10.0 * cycle.window.cutoff)
        script = float(np.trapezoid((omega * torque)[first : last + 1], dx=0.1))
        assert cycle.metrics.energy_mech == pytest.approx(script, rel=1e-3)
        assert cycle.metrics.energy_gen is None


def test_a_wave_maker_at_rest_has_no_wave_and_its_power_contradicts_torque_and_speed(shared: Path) -> None:
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


def test_gaps_of_minutes_leave_a_compressed_air_bench_usable(shared: Path) -> None:
    path = shared / "benches" / "dexpand-ctu" / "MM_axial_PDLT_compressedair_05192023.csv"
    found = reduced(
        path,
        'name = "expander"\n[cascade]\nstages = ["mech"]\n[stage.mech]\npower = "torque * speed"\n'
        '[columns]\nspeed = { name = "rotation speed", side = "shaft" }\n'
        '[thresholds]\ngap_max = 5.0\n[phases]\nfrom = "whole"\n',
    )
    assert [c.complete for c in found.cycles].count(True) >= 3
    torque, rpm, power = (column(path, k)[1:] for k in (2, 1, 3))
    mean = float(np.nanmean(torque * rpm / RPM))
    assert mean == pytest.approx(float(np.nanmean(power)), rel=0.01)
    seconds = sum(c.window.cutoff - c.window.onset for c in found.cycles)
    watts = sum(c.metrics.value("energy_mech") for c in found.cycles) / seconds
    assert watts == pytest.approx(mean, rel=0.03)


@pytest.mark.parametrize(("log", "eta"), [("2021.07.26T10.51.44", 0.648), ("2022.12.21T15.44.24_VentedSpring", 0.631)])
def test_the_energies_of_battery_and_load_dump_add_up(log: str, eta: float, shared: Path) -> None:
    measured = shared / "benches" / "mbari-wec-pto" / f"{log}.exp"
    page = Path("docs/benches.md").read_text().partition("Save as `mbari.toml`:\n\n```toml\n")[2]
    rig = parse_rig(page.partition("```")[0], "mbari.toml")
    (cycle,) = reduce(read_run(measured, rig=rig)).cycles
    t, v, force, volts, battery, dump = np.genfromtxt(measured, usecols=[0, 2, 16, 6, 8, 9], unpack=True)
    line, dc = np.trapezoid([0.0254 * v * 4.4482216 * force, volts * (battery + dump)], t)
    assert cycle.metrics.value("eta_line_dc") == pytest.approx(eta, abs=5e-4)
    assert cycle.metrics.value("energy_line") == pytest.approx(line, rel=1e-6)
    assert cycle.metrics.value("energy_dc") == pytest.approx(dc, rel=1e-4)  # samples of vdc that repeat are bridged
