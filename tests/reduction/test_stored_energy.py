"""Loss and efficiency over speed do not count as lost what rotor and capacitor store while the machine speeds up."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from test_cli import winchcascade

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.reduction.bins import STORES, stored_powers

TOP = 0.62
"""Line speed at the end of the ramp: 2277 rpm. [m/s]"""

APART = 0.006
"""Largest difference of an efficiency over speed from that of a steady run: the mesh loses its share of what the rotor stores,
and a bin of a braking has few samples."""

UNCORRECTED = 0.05
"""Without the correction the efficiency at 550 rpm lies below that of a steady run by more than this."""


def reduced(folder: Path, name: str, t: list[float], v: list[float], *rig: str) -> dict[str, Any]:
    """The JSON of a simulated log whose line moves along straight lines between some instants [s] and speeds [m/s]."""
    profile, log = folder / f"{name}-profile.csv", folder / f"{name}.csv"
    stamps = np.arange(0.0, t[-1], 0.04)
    rows = [f"{x:.2f},{y:.6f}" for x, y in zip(stamps, np.interp(stamps, t, v), strict=True)]
    profile.write_text("\n".join(["time_s,velocity_mps", *rows]), encoding="utf-8")
    done = winchcascade("simulate", "--profile", profile, "--load-ohm", "18", "--out", log)
    assert done.returncode == 0, done.stderr
    done = winchcascade("reduce", log, "--window", "payout", *rig, "--json", "-")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def ramp(folder: Path, *rig: str) -> dict[str, Any]:
    return reduced(
        folder, "ramp", [0, 2, 6, 9, 9.5, 12, 13, 25, 26, 30], [0, 0, TOP, TOP, 0, 0, -0.4, -0.4, 0, 0], *rig
    )


def efficiency(item: dict[str, Any], *, corrected: bool) -> float:
    rotor, spring, capacitor = (item[f"power_{store}_w"] if corrected else 0.0 for store in STORES)
    return float((item["power_gen_w"] + capacitor) / (item["power_mech_w"] - rotor - spring))


def test_over_speed_a_ramp_has_the_efficiency_of_steady_points(tmp_path: Path) -> None:
    bins = {0.5 * (b["rpm_low"] + b["rpm_high"]): b for b in ramp(tmp_path)["bins"]}
    for rpm in (550.0, 1050.0, 2050.0):
        ratio = built_in().rpm_per_velocity
        assert ratio is not None
        v = rpm / ratio
        steady = reduced(
            tmp_path, f"steady {rpm:.0f}", [0, 2, 3, 9, 9.5, 12, 13, 25, 26, 30], [0, 0, v, v, 0, 0, -0.4, -0.4, 0, 0]
        )
        point = steady["cycles"][0]["phase_summary"]["payout"]["plateau"]
        eta = point["power_gen_w"] / point["power_mech_w"]
        assert efficiency(bins[rpm], corrected=True) == pytest.approx(eta, abs=APART), rpm
        assert rpm > 600.0 or efficiency(bins[rpm], corrected=False) < eta - UNCORRECTED


@pytest.mark.parametrize(
    ("gone", "missing"),
    [("inertia_rotor", "power_rotor_w"), ("k_shaft", "power_spring_w"), ("c_dc", "power_capacitor_w")],
)
def test_what_the_rig_file_does_not_state_is_null(tmp_path: Path, gone: str, missing: str) -> None:
    rig = tmp_path / "rig.toml"
    text = winchcascade("rig", "hsu2026").stdout
    rig.write_text("\n".join(line for line in text.splitlines() if not line.startswith(f"{gone} =")), encoding="utf-8")
    bins = ramp(tmp_path, "--rig", str(rig))["bins"]
    stored = {f"power_{store}_w" for store in STORES}
    assert {b[missing] for b in bins} == {None}
    assert all(b[name] is not None for b in bins for name in stored - {missing})


def test_a_speed_that_is_logged_stores_as_one_of_the_line() -> None:
    rig, t = built_in(), np.arange(0.0, 4.0, 0.04)
    v = 0.1 + 0.2 * t
    by_line = stored_powers(Run("a", t, {"velocity": v}, 25.0, t.size), rig)["rotor"]
    no_drum = msgspec.structs.replace(rig, winch=msgspec.structs.replace(rig.winch, r_drum=None))
    by_speed = stored_powers(Run("a", t, {"speed": v / 0.13}, 25.0, t.size), no_drum)["rotor"]
    assert by_speed == pytest.approx(by_line)
    middle = t.size // 2
    assert by_line[middle] == pytest.approx(6260e-7 * (50.0 / 0.13) ** 2 * v[middle] * 0.2, rel=1e-6)
