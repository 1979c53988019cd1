"""A fault is what no other channel shows: what the machine did, and what a coarse channel cannot
show, is kept as logged.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from daily import daily
from shipped_log import column, row_after_onset, table, written

from winchcascade import Run, load_rig, read_run, reduce

REPAIRS = {"spike", "stuck", "dropped_samples"}
"""Kinds of findings that take samples out of channels."""

KITE = ("ground_tether_reelout_speed", "ground_tether_force", "ground_mech_power")
"""Columns of the field winch: velocity, tension and power."""


def repaired(run: Run) -> list[tuple[str, str | None]]:
    """Kinds and channels of the findings that take samples out."""
    return [(finding.kind, finding.channel) for finding in run.findings if finding.kind in REPAIRS]


def field_winch(shared: Path, name: str) -> pd.DataFrame:
    """A log of the field winch, each stamp once."""
    log = pd.read_csv(shared / "kitepower-2019-10-08" / f"{name}.csv", usecols=["time", *KITE])
    return log[~log.time.duplicated()]


@pytest.mark.parametrize("step", daily([1, 50, 500, 1000, 5000], [1, 500]))
@pytest.mark.parametrize("name", ["ground_station_cycles_01_43", "20191008_0004"])
def test_no_power_of_a_field_winch_is_repaired_however_coarse_it_is(
    shared: Path, name: str, step: int
) -> None:
    rig, log = load_rig("kitepower"), field_winch(shared, name)
    for coarse in (np.round, np.trunc):
        run = read_run(
            log.assign(ground_mech_power=step * coarse(log.ground_mech_power / step)), rig=rig
        )
        assert repaired(run) == []
        assert all(cycle.complete for cycle in reduce(run, rig=rig).cycles)


@pytest.mark.parametrize("samples", [1, 3, 5, 10, 25, 50])
@pytest.mark.parametrize("current", [-1.0, 0.0, 0.5, 1.5])
def test_a_torque_reversal_that_the_current_shows_is_kept(
    tmp_path: Path, current: float, samples: int
) -> None:
    rows, k = table().copy(), row_after_onset(3.0)
    there = slice(k, k + samples)
    rows[there, column("torque")] *= -1.0
    rows[there, column("idc")] *= current
    run = written(tmp_path, rows, load=36.0)
    assert repaired(run) == []
    torque = run.channels["torque"]
    assert np.array_equal(torque, rows[:, column("torque")])


def slow_payouts(step: float, law: str, slow: float) -> pd.DataFrame:
    """A log at 25 Hz of payouts at 0.9 m/s and slower ones, whose power is coarse and as noisy
    as it is large.
    """
    rng, rate = np.random.default_rng(2), 25
    parts = []
    for top in (0.9, slow, 0.9, 1.5 * slow, 0.9):
        ramp = np.linspace(0.0, top, 2 * rate)
        out = np.concatenate(
            (np.zeros(4 * rate), ramp, np.full(int(rate * min(8.0 / top, 25.0)), top), ramp[::-1])
        )
        parts += [out, np.zeros(3 * rate), np.full(int(out.sum() / 0.8), -0.8)]
    v = np.concatenate(parts)
    out = np.clip(v, 0.0, None)
    force = 300.0 + 2500.0 * out
    power = {
        "proportional": 0.8 * force * out,
        "cubic": 3000.0 * out**3,
        "cut_in": np.where(out > 0.5, 2500.0 * (out - 0.5) / 0.4, np.where(out > 0.02, 60.0, 0.0)),
    }[law]
    power = np.where(v < 0.0, -240.0, power * (1.0 + 0.02 * rng.standard_normal(v.size)))
    return pd.DataFrame(
        {
            "Time (s)": np.arange(v.size) / rate,
            "Velocity (m/s)": np.round(v + 0.003 * rng.standard_normal(v.size), 3),
            "Force (N)": np.round(force + 5.0 * rng.standard_normal(v.size), 1),
            "Mechanical power (W)": step * np.round(power / step),
        }
    )


@pytest.mark.parametrize("law", ["proportional", "cubic", "cut_in"])
@pytest.mark.parametrize("slow", [0.05, 0.1, 0.25, 0.4])
@pytest.mark.parametrize("step", [10.0, 100.0, 200.0])
def test_a_coarse_power_that_holds_a_value_in_a_slow_payout_is_not_stuck(
    step: float, slow: float, law: str
) -> None:
    run = read_run(slow_payouts(step, law, slow))
    assert repaired(run) == []
    assert sum(cycle.complete for cycle in reduce(run, window="payout").cycles) == 5


@pytest.mark.parametrize("names", [("vdc", "idc"), ("torque", "vdc", "idc")])
def test_a_zero_of_several_channels_at_once_is_a_fault_of_the_logger(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    rows, k = table().copy(), row_after_onset(3.0)
    for name in names:
        rows[k : k + 12, column(name)] = 0.0
    assert {channel for _, channel in repaired(written(tmp_path, rows, load=36.0))} >= {
        "vdc",
        "idc",
    }
