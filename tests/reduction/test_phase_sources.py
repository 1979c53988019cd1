"""Cycles by each source of [phases], and the source that is proposed for a log without payout."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from winchcascade import read_run, reduce
from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import Signal
from winchcascade.reduction.reduce import require_payouts
from winchcascade.reduction.reduction_result import Reduction

RPM = 30.0 / math.pi
T: Signal = np.arange(0.0, 40.0, 0.02, dtype=np.float64)
EXACT = 1e-9
"""Two ways to write one trapezoidal integral."""


def rig_of(more: str) -> Rig:
    return parse_rig(f'name = "bench"\n{more}', "bench.toml")


def write(folder: Path, columns: dict[str, Signal | list[str]]) -> Path:
    rows = zip(
        *(map(str, x if isinstance(x, list) else x.tolist()) for x in columns.values()), strict=True
    )
    path = folder / "log.csv"
    path.write_text("\n".join([",".join(columns), *map(",".join, rows)]) + "\n")
    return path


def reduced(folder: Path, rig: str, columns: dict[str, Signal | list[str]]) -> Reduction:
    known = rig_of(rig)
    return reduce(read_run(write(folder, columns), rig=known), rig=known)


def stairs(levels: list[float], seconds: float = 8.0) -> Signal:
    """Speeds [rad/s] that follow each level with a time constant of 0.1 s."""
    level = np.repeat(levels, round(seconds / 0.02))
    out = np.empty(level.size)
    x = level[0]
    for k, aim in enumerate(level.tolist()):
        x += (aim - x) * 0.2
        out[k] = x
    return out


def stamps(x: Signal) -> Signal:
    return np.arange(x.size, dtype=np.float64) * 0.02


def message(folder: Path, rig: str, columns: dict[str, Signal | list[str]]) -> str:
    with pytest.raises(LogError) as caught:
        require_payouts(reduced(folder, rig, columns))
    return str(caught.value)


# ------------------------------------------------------------------------------------------ waves
def test_the_energy_of_each_wave_is_that_between_its_zero_crossings(tmp_path: Path) -> None:
    omega, tau = 3.0 * np.sin(2.0 * np.pi * T / 8.0), 20.0 * np.sin(2.0 * np.pi * T / 8.0)
    found = reduced(
        tmp_path,
        '[phases]\nfrom = "waves"\n',
        {"t (s)": T, "n (rad/s)": omega, "Torque (N.m)": tau},
    )
    assert [c.phases.onset for c in found.cycles] == pytest.approx([0.0, 8.0, 16.0, 24.0], abs=2e-3)
    assert [c.window.cutoff - c.window.onset for c in found.cycles] == pytest.approx(
        [8.0] * 4, abs=4e-3
    )
    assert [c.metrics.energy_mech for c in found.cycles] == pytest.approx(
        [60.0 / 2.0 * 8.0] * 4, rel=1e-3
    )
    assert all(c.phases.haul_in is not None and c.complete for c in found.cycles)


# ------------------------------------------------------------------------------------------ steps
def test_steps_are_the_steady_stretches_without_their_settling(tmp_path: Path) -> None:
    omega = stairs([0.0, 50.0, 100.0, -80.0, 0.0])
    t, torque = (
        stamps(omega),
        0.1 * omega + 0.5 * np.random.default_rng(1).standard_normal(omega.size),
    )
    found = reduced(
        tmp_path,
        '[phases]\nfrom = "steps"\n',
        {"t (s)": t, "n (rad/s)": omega, "Torque (N.m)": torque},
    )
    assert len(found.cycles) == 3
    for cycle, (begin, level) in zip(
        found.cycles, [(8.0, 50.0), (16.0, 100.0), (24.0, -80.0)], strict=True
    ):
        assert begin + 0.5 < cycle.window.onset < begin + 1.6
        assert begin + 7.5 < cycle.window.cutoff <= begin + 8.0
        point = cycle.summary.point
        assert point
        assert point.rpm_shaft == pytest.approx(level * RPM, rel=2e-3)
        inside = (t >= cycle.window.onset) & (t <= cycle.window.cutoff)
        script = float(np.trapezoid((torque * omega)[inside], t[inside]))
        assert cycle.metrics.energy_mech == pytest.approx(script, rel=1e-6)


# ------------------------------------------------------------------------- rows, ranges and whole
def test_each_row_of_step_means_is_one_cycle_whatever_its_stamp(tmp_path: Path) -> None:
    speed, torque = np.arange(1000.0, 1012.0), np.linspace(1.0, 2.0, 12)
    t = np.array([3.0, 1.0, 7.0, 2.0, 9.0, 4.0, 11.0, 5.0, 6.0, 0.5, 8.0, 10.0])
    found = reduced(
        tmp_path,
        '[phases]\nfrom = "rows"\n',
        {"t (s)": t, "n (rpm)": speed, "Torque (N.m)": torque},
    )
    power = [c.metrics.power_mech for c in found.cycles]
    assert power == pytest.approx((speed / RPM * torque).tolist(), rel=EXACT)
    assert [c.complete for c in found.cycles] == [True] * 12


@pytest.mark.parametrize("gap", [0.0, 300.0])
def test_the_whole_record_is_one_window_unless_a_gap_of_minutes_cuts_it(
    gap: float, tmp_path: Path
) -> None:
    t, omega = np.where(T < 20.0, T, T + gap), np.linspace(0.0, 10.0, T.size)
    found = reduced(
        tmp_path,
        '[phases]\nfrom = "whole"\n',
        {"t (s)": t, "n (rad/s)": omega, "Torque (N.m)": omega},
    )
    parts = [slice(None)] if gap == 0.0 else [slice(0, T.size // 2), slice(T.size // 2, None)]
    true = [float(np.trapezoid(omega[part] ** 2, t[part])) for part in parts]
    assert [c.metrics.energy_mech for c in found.cycles] == pytest.approx(true, rel=1e-6)
    assert all(c.complete for c in found.cycles)
    assert found.window == "whole"


def test_cycles_by_ranges_of_time(tmp_path: Path) -> None:
    columns: dict[str, Signal | list[str]] = {"t (s)": T, "n (rad/s)": T, "Torque (N.m)": T}
    found = reduced(
        tmp_path, '[phases]\nfrom = "ranges"\nranges_s = [[2.0, 5.0], [10, 20]]\n', columns
    )
    assert [c.metrics.energy_mech for c in found.cycles] == pytest.approx(
        [39.0, 7000.0 / 3.0], rel=1e-5
    )
    for ranges, words in (
        ("[[30, 50]]", "30 to 50 s"),
        ("[[4, 8], [2, 5]]", "2 to 5 s, 4 to 8 s"),
        ("[]", "none is given"),
    ):
        with pytest.raises(OptionError, match=words):
            reduced(tmp_path, f'[phases]\nfrom = "ranges"\nranges_s = {ranges}\n', columns)
    assert (
        len(
            reduced(
                tmp_path, '[phases]\nfrom = "ranges"\nranges_s = [[5, 8], [2, 5]]\n', columns
            ).cycles
        )
        == 2
    )


# ----------------------------------------------------------------------------------------- labels
LABELS = (
    ["rest"] * 500 + ["RO"] * 500 + ["rest"] * 200 + ["ri-1"] * 400 + ["RO"] * 300 + ["rest"] * 100
)


@pytest.mark.parametrize("number", [False, True], ids=["texts", "numbers"])
def test_a_column_of_labels_gives_payout_hold_and_haul_in(number: bool, tmp_path: Path) -> None:
    codes = {"rest": "0", "RO": "1", "ri-1": "2"}
    values = [codes[label] for label in LABELS] if number else LABELS
    payout, haul_in = ("1", "2") if number else ('"ro "', '"ri-1"')
    rig = (
        f'[phases]\nfrom = "column"\ncolumn = "phase"\npayout = [{payout}]\nhaul_in = [{haul_in}]\n'
    )
    found = reduced(
        tmp_path, rig, {"t (s)": T, "Velocity (m/s)": T, "Force (N)": T, "phase": values}
    )
    first, second = (c.phases for c in found.cycles)
    assert (first.onset, first.payout_end) == pytest.approx((10.0, 20.0))
    assert first.haul_in == pytest.approx((24.0, 32.0))
    assert (second.onset, second.payout_end, second.haul_in) == pytest.approx((32.0, 38.0, None))
    assert found.cycles[0].metrics.energy_line == pytest.approx(7000.0 / 3.0, rel=1e-5)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('column = "stage"\npayout = ["RO"]', "no column 'stage', which [phases] of the rig names"),
        (
            'column = "phase"\npayout = ["out"]',
            "has a value of payout, ['out']; it holds 'RO', 'rest', 'ri-1'",
        ),
    ],
)
def test_a_wrong_column_of_labels_is_one_sentence(entry: str, words: str, tmp_path: Path) -> None:
    columns: dict[str, Signal | list[str]] = {
        "t (s)": T,
        "Velocity (m/s)": T,
        "Force (N)": T,
        "phase": LABELS,
    }
    with pytest.raises(LogError) as caught:
        reduced(tmp_path, f'[phases]\nfrom = "column"\n{entry}\n', columns)
    assert words in str(caught.value)


# ----------------------------------------------------------------------------- motions and faults
def test_payouts_by_the_speed_of_a_shaft_without_a_drum(tmp_path: Path) -> None:
    omega = stairs([0.0, 50.0, 0.0, -50.0, 0.0])
    t = stamps(omega)
    found = reduced(
        tmp_path,
        '[phases]\nfrom = "speed"\n',
        {"t (s)": t, "n (rad/s)": omega, "Torque (N.m)": 0.1 * omega},
    )
    (cycle,) = found.cycles
    assert cycle.phases.onset == pytest.approx(8.0, abs=0.3)
    assert cycle.phases.haul_in is not None
    assert cycle.summary.payout.speed_max is None
    assert cycle.summary.payout.travel is None
    assert cycle.metrics.energy_mech is not None


def test_payouts_by_the_displacement_alone(tmp_path: Path) -> None:
    x = np.interp(T, [0, 10, 20, 25, 35, 40], [0, 0, 8, 8, 0, 0])
    found = reduced(
        tmp_path, '[phases]\nfrom = "displacement"\n[thresholds]\nwindow = "payout"\n',
        {"t (s)": T, "Displacement (m)": x, "Force (N)": 100.0 + 2.0 * np.sin(9.0 * T)},
    )  # fmt: skip
    (cycle,) = found.cycles
    assert cycle.metrics.energy_line == pytest.approx(800.0, rel=0.01)


def test_a_window_belongs_to_payouts_in_a_motion(tmp_path: Path) -> None:
    known = rig_of('[phases]\nfrom = "whole"\n')
    run = read_run(write(tmp_path, {"t (s)": T, "n (rad/s)": T, "Torque (N.m)": T}), rig=known)
    with pytest.raises(OptionError, match=r'window 5\.48: cycles come from "whole"'):
        reduce(run, rig=known, window="5.48")


@pytest.mark.parametrize(
    ("columns", "source"),
    [
        ({"n (rad/s)": 0.0 * T}, "whole"),
        ({"Vdc (V)": 48.0 + 0.001 * T, "Idc (A)": T}, "whole"),
        ({"n (rad/s)": 5.0 * np.sin(T)}, "waves"),
        ({"n (rad/s)": stairs([20.0, 40.0, 60.0], 13.34)[: T.size]}, "steps"),
        (
            {"n (rad/s)": T, **{f"Remark {k}": T for k in range(20)}, "Mode": ["1"] * T.size},
            "column",
        ),
        ({"n (rad/s)": T, "Status_RPM_V1": T}, "whole"),
        ({"n (rad/s)": 20.0 + 20.5 * np.sin(T)}, "whole"),
    ],
)
def test_a_log_without_payout_gets_the_fitting_setting(
    columns: dict[str, Signal | list[str]], source: str, tmp_path: Path
) -> None:
    assert f'set from = "{source}"' in message(tmp_path, "", {"t (s)": T, **columns})


def test_rows_out_of_order_or_without_clock_are_proposed_as_step_means(tmp_path: Path) -> None:
    t = np.array([3.0, 1.0, 7.0, 2.0, 9.0, 4.0, 11.0, 5.0, 6.0, 0.5, 8.0, 10.0])
    rows: dict[str, Signal | list[str]] = {"n (rpm)": 100.0 * t, "Torque (N.m)": t}
    assert 'step means, set from = "rows"' in message(tmp_path, "", {"t (s)": t, **rows})
    with pytest.raises(LogError, match=r"no time column .* For rows that are step means, set from"):
        reduced(tmp_path, "", rows)


@pytest.mark.parametrize("source", ["speed", "displacement", "waves", "steps"])
def test_a_source_that_the_log_lacks_is_named(source: str, tmp_path: Path) -> None:
    with pytest.raises(
        LogError, match=r"\[phases\] of the rig finds cycles in .*, which the log has not"
    ):
        reduced(
            tmp_path, f'[phases]\nfrom = "{source}"\n', {"t (s)": T, "Vdc (V)": T, "Idc (A)": T}
        )
