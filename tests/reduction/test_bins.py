"""Bins of generator speed: which samples drive the generator, what is averaged of them, and what
is stored meanwhile.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray
from test_cli import winchcascade

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Run
from winchcascade.reduction.bins import STORES, bin_powers, engaged, stored_powers
from winchcascade.reduction.phases import Cycle, Plateau

Signal = NDArray[np.float64]

T = np.arange(10.0)
CYCLE = Cycle(2.0, 7.0, None, None, False, False)
PLATEAU = Plateau(0.8, 4.0, 5.0)
RISING = np.array([0.0, 9.0, 0.0, 1.0, 5.0, 5.0, 1.0, 3.0, 9.0, 0.0])
"""A torque that is above 2 N m in samples 1, 4, 5, 7 and 8."""

GAP = np.array([[2.0, 4.0]])
"""A sample that was bridged between two good ones."""


@pytest.mark.parametrize(
    ("channels", "gaps", "plateau", "clutch", "rows"),
    [
        (
            {"torque": RISING},
            {},
            PLATEAU,
            True,
            [2, 3, 4, 5, 7],
        ),  # until it has risen, and then where there is torque
        ({"torque": np.zeros(10)}, {}, PLATEAU, True, []),
        ({}, {}, PLATEAU, True, [2, 3, 4, 5]),  # until braking
        ({}, {}, None, True, [2, 3, 4, 5, 6, 7]),
        ({"torque": RISING}, {}, PLATEAU, False, [2, 3, 4, 5, 6, 7]),
        ({}, {"pressure": GAP}, PLATEAU, True, [2, 3, 4, 5]),  # concerns no power
        *(
            ({}, {name: GAP}, PLATEAU, True, [2, 4, 5])
            for name in (CLOCK, "velocity", "torque", "power_mech", "idc")
        ),
    ],
)
def test_the_generator_is_driven_where_the_clutch_is_engaged(
    channels: Mapping[str, Signal],
    gaps: Mapping[str, Signal],
    plateau: Plateau | None,
    clutch: bool,
    rows: list[int],
) -> None:
    rig = replace(built_in(), drivetrain=replace(built_in().drivetrain, one_way_clutch=clutch))
    run = Run("a.csv", T, {"displacement": T, **channels}, 1.0, T.size, gaps=gaps)
    assert np.flatnonzero(engaged(run, [CYCLE], [plateau], rig)).tolist() == rows


def test_a_bin_holds_the_mean_and_the_standard_error_of_its_samples() -> None:
    rng = np.random.default_rng(5)
    v = np.append(rng.uniform(0.0, 1.0, 5000), 1.55)
    watts = 1000.0 * v + rng.normal(0, 50, v.size)
    *bins, last = bin_powers(v, 3000.0, v > 0.2, lambda rows: {"line": watts[rows]}, 100.0)
    assert [b.rpm_low for b in bins] == [100.0 * k for k in range(6, 30)]
    for b in bins:
        inside = (v > 0.2) & (v * 3000.0 >= b.rpm_low) & (v * 3000.0 < b.rpm_high)
        assert b.count == inside.sum()
        assert b.mean == {"line": pytest.approx(watts[inside].mean())}
        assert b.standard_error["line"] == pytest.approx(
            watts[inside].std(ddof=1) / np.sqrt(b.count), rel=1e-6
        )
    assert (last.rpm_low, last.count, last.standard_error) == (4600.0, 1, {})


# ---------------------------------------------------------------------------------- stored energy
TOP = 0.62
"""Line speed at the end of the ramp: 2277 rpm. [m/s]"""

APART = 0.006
"""Largest difference of an efficiency over speed from that of a steady run: the mesh loses its
share of what the rotor stores, and a bin of a braking has few samples."""

UNCORRECTED = 0.05
"""Without the correction the efficiency at 550 rpm lies below that of a steady run by more than
this.
"""


def reduced(folder: Path, speed: float, rise: float, *rig: str) -> dict[str, Any]:
    """The JSON of a simulated log whose line speeds up to a speed [m/s] within some seconds."""
    profile, log = folder / f"{speed}-profile.csv", folder / f"{speed}.csv"
    stamps = np.arange(0.0, 30.0, 0.04)
    v = np.interp(
        stamps, [0, 2, 2 + rise, 9, 9.5, 12, 13, 25, 26], [0, 0, speed, speed, 0, 0, -0.4, -0.4, 0]
    )
    rows = [f"{x:.2f},{y:.6f}" for x, y in zip(stamps, v, strict=True)]
    profile.write_text("\n".join(["time_s,velocity_mps", *rows]), encoding="utf-8")
    assert (
        winchcascade("simulate", "--profile", profile, "--load-ohm", "18", "--out", log).returncode
        == 0
    )
    found: dict[str, Any] = json.loads(
        winchcascade("reduce", log, "--window", "payout", *rig, "--json", "-").stdout
    )
    return found


def test_over_speed_a_ramp_has_the_efficiency_of_steady_points(tmp_path: Path) -> None:
    bins = {0.5 * (b["rpm_low"] + b["rpm_high"]): b for b in reduced(tmp_path, TOP, 4.0)["bins"]}
    for rpm in (550.0, 1050.0, 2050.0):
        steady = reduced(tmp_path, rpm / (built_in().rpm_per_velocity or math.nan), 1.0)
        point, of = steady["cycles"][0]["phase_summary"]["payout"]["plateau"], bins[rpm]
        eta, (rotor, spring, capacitor) = (
            point["power_gen_w"] / point["power_mech_w"],
            (of[f"power_{s}_w"] for s in STORES),
        )
        corrected = (of["power_gen_w"] + capacitor) / (of["power_mech_w"] - rotor - spring)
        assert corrected == pytest.approx(eta, abs=APART), rpm
        assert rpm > 600.0 or of["power_gen_w"] / of["power_mech_w"] < eta - UNCORRECTED


def test_what_the_rig_file_does_not_state_is_null(tmp_path: Path) -> None:
    rig, lines = tmp_path / "rig.toml", winchcascade("rig", "hsu2026").stdout.splitlines()
    gone = ("inertia_rotor =", "k_shaft =", "c_dc =")
    rig.write_text("\n".join(line for line in lines if not line.startswith(gone)), encoding="utf-8")
    bins = reduced(tmp_path, TOP, 4.0, "--rig", str(rig))["bins"]
    assert {b[f"power_{store}_w"] for b in bins for store in STORES} == {None}


def test_a_speed_that_is_logged_stores_as_one_of_the_line() -> None:
    rig, t = built_in(), np.arange(0.0, 4.0, 0.04)
    v = 0.1 + 0.2 * t
    every = np.arange(t.size)
    by_line = stored_powers(Run("a", t, {"velocity": v}, 25.0, t.size), rig, every)["rotor"]
    no_drum = replace(rig, winch=replace(rig.winch, r_drum=None))
    by_shaft = Run("a", t, {"speed": v / 0.13}, 25.0, t.size)
    by_speed = stored_powers(by_shaft, no_drum, every)["rotor"]
    assert by_speed == pytest.approx(by_line)
    middle = t.size // 2
    assert by_line[middle] == pytest.approx(
        6260e-7 * (50.0 / 0.13) ** 2 * v[middle] * 0.2, rel=1e-6
    )
