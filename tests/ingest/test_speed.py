"""Speed of rotation and channels of one's own: how columns are found, and what a log without
line velocity gives.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from campaign_log import HEAD, ROWS, kinds, read, text

from winchcascade.core.errors import LogError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in, parse_rig

RPM = 30.0 / math.pi
BENCH = '\n[drivetrain]\ngear_ratio = { value = 8.0, unit = "1" }\n'


def rig_of(more: str) -> Rig:
    return parse_rig(f'name = "bench"\n{more}', "bench.toml")


def bench_log(header: str, rpm: float = 600.0, *, n: int = 50) -> str:
    rows = [[f"{0.1 * k:.1f}", f"{rpm * (1.0 + 1e-4 * k)}", f"{2.0 + 0.001 * k}"] for k in range(n)]
    return text(rows, ["Time (s)", header, "Torque (N.m)"])


def crane_log(ratio: float) -> str:
    """The crane log with the speed of the generator, that many times what line and gear give."""
    rig = built_in()
    per_velocity = ratio * (rig.rpm_per_velocity or 0.0)
    return text(
        [[*row, f"{float(row[2]) * per_velocity:.1f}"] for row in ROWS],
        [*HEAD, "Generator speed (rpm)"],
    )


SIDE = '[columns]\nspeed = { name = "Status_RPM_V1", unit = "rpm", side = "generator" }\n'


@pytest.mark.parametrize(
    ("header", "value", "omega", "columns"),
    [
        ("n (rpm)", 600.0, 600.0 / RPM, ""), ("n (Hz)", 10.0, 20.0 * math.pi, ""), ("n (deg/s)", 360.0, 2.0 * math.pi, ""),
        ("Drum speed (rpm)", 600.0, 600.0 / RPM, ""), ("Generator speed (rpm)", 600.0, 600.0 / RPM / 8.0, ""),
        ("Motor rpm", 600.0, 600.0 / RPM / 8.0, ""), ("Status_RPM_V1", 960.0, 120.0 / RPM, SIDE),
    ],
)  # fmt: skip
def test_a_speed_is_that_of_the_shaft_in_radians_per_second(
    header: str, value: float, omega: float, columns: str, tmp_path: Path
) -> None:
    run = read(tmp_path, bench_log(header, value), rig=rig_of(BENCH + columns))
    assert run.channels["speed"][0] == pytest.approx(omega)
    assert "velocity" not in run.channels
    assert kinds(run) == set()


def test_a_missing_gear_ratio_is_reported_and_a_drum_radius_gives_the_velocity(
    tmp_path: Path,
) -> None:
    run = read(tmp_path, bench_log("Generator speed (rpm)"), rig=rig_of(""))
    assert run.channels["speed"][0] == pytest.approx(600.0 / RPM)
    assert [(f.kind, f.channel) for f in run.findings] == [("unit_assumed", "speed")]
    run = read(
        tmp_path,
        bench_log("n (rpm)"),
        rig=rig_of('[winch]\nr_drum = { value = 0.1, unit = "m" }\n'),
    )
    assert run.channels["velocity"] == pytest.approx(0.1 * run.channels["speed"])
    assert kinds(run) == {"derived_channel", "thresholds_assumed"}


def test_a_speed_of_the_opposite_sign_follows_the_line(tmp_path: Path) -> None:
    run = read(tmp_path, crane_log(-1.0))
    assert kinds(run) == {"sign_flipped"}
    assert run.channels["speed"].max() == pytest.approx(
        run.channels["velocity"].max() / 0.13, rel=0.01
    )


def test_channels_of_a_rig_of_its_own_are_read_by_name_or_column(tmp_path: Path) -> None:
    rig = rig_of(
        '[channels.p_main]\nunit = "bar"\n[channels.pump]\nunit = "kW"\n[channels.valve]\nunit = '
        '"%"\n'
        '[columns]\npump = "Pumpe"\n'
    )
    rows = [[f"{0.1 * k:.1f}", "3", f"{k / 100}", "0.5"] for k in range(40)]
    run = read(tmp_path, text(rows, ["t (s)", "p_main", "Pumpe (W)", "x5"]), rig=rig)
    assert run.channels["p_main"][0] == pytest.approx(3e5)
    assert run.channels["pump"][30] == pytest.approx(0.3)
    assert {f.message for f in run.findings} == {
        "1 column that is no channel: x5",
        "the log has no valve channel",
    }
    assert list(rig.known_channels)[-3:] == ["p_main", "pump", "valve"]


def test_a_log_of_the_direct_current_alone_is_read_if_it_holds_numbers(tmp_path: Path) -> None:
    rows = [[f"{0.1 * k:.1f}", "48.1", f"{1 + k / 100}"] for k in range(50)]
    run = read(tmp_path, text(rows, ["t (s)", "Vdc (V)", "Idc (A)"]), rig=rig_of(""))
    assert set(run.channels) == {"vdc", "idc"}
    rows = [[f"{0.1 * k:.1f}", "-", "-"] for k in range(50)]
    with pytest.raises(LogError, match="the columns of motion and power hold no number"):
        read(tmp_path, text(rows, ["t (s)", "Vdc (V)", "Idc (A)"]), rig=rig_of(""))
