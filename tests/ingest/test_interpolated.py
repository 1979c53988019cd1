"""A gap that was filled in before the log was read shows by the noise that its samples lack."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shipped_log import HEADERS, NAMES, Signal, channels, clean, column, row_after_onset, table
from synthetic import SCENARIOS, SENSORS, make_log

from winchcascade import Finding, load_rig, read_run, reduce
from winchcascade.ingest.checks.interpolated import find_interpolated
from winchcascade.ingest.checks.quality import check
from winchcascade.ingest.checks.spikes import find_bends

RIG = load_rig("hsu2026")
ELECTRICAL = ("vdc", "idc")


def filled(
    places: Sequence[tuple[float, float]], names: Sequence[str] = NAMES, *, rounded: bool = False
) -> tuple[Signal, list[int]]:
    """The shipped log with straight lines at some times after the second onset, of some length [s], and the rows of these."""
    rows = table().copy()
    lost: list[int] = []
    for begin, seconds in places:
        first = row_after_onset(begin)
        lost += range(first, first + round(25 * seconds))
    kept = np.setdiff1d(np.arange(len(rows)), lost)
    for name in names:
        x = rows[:, column(name)]
        line = np.interp(lost, kept, x[kept])
        x[lost] = np.round(line, SENSORS[name].decimals) if rounded else line
    return rows, lost


def findings(rows: Signal) -> list[Finding]:
    found = check(rows[:, 0].copy(), channels(rows), RIG, simulated=False, open_circuit=False)
    return [f for f in found.findings if f.kind == "dropped_samples"]


@pytest.mark.parametrize("rounded", [False, True])
@pytest.mark.parametrize("begin", [-0.5, 0.6, 3.0, 12.5])
def test_a_gap_that_was_filled_in_all_channels_is_one_finding(begin: float, rounded: bool) -> None:
    rows, lost = filled([(begin, 1.6)], rounded=rounded)
    (finding,) = findings(rows)
    assert finding.channel is None
    assert finding.message.endswith(
        "run between their neighbours without noise, in 1 place, as if a gap had been filled in"
    )
    assert {"force", "vdc"} <= {name for name in NAMES if name in finding.message}
    assert finding.start == pytest.approx(rows[lost[0], 0], abs=0.13)
    assert finding.end == pytest.approx(rows[lost[-1], 0], abs=0.13)


@pytest.mark.parametrize("name", ["force", "vdc", "idc"])
def test_a_gap_that_was_filled_in_one_channel_is_a_finding_of_that_channel(name: str) -> None:
    rows, lost = filled([(0.8, 1.6)], [name])
    (finding,) = findings(rows)
    assert finding.channel == name
    assert finding.removed == pytest.approx(len(lost), abs=3)


def test_a_filled_gap_is_found_beside_spikes_and_empty_cells() -> None:
    rows, lost = filled([(0.8, 1.6)], ["force", "idc"])
    rows[[lost[0] - 100, lost[-1] + 150], column("force")] = 5000.0
    rows[lost[-1] + 200 : lost[-1] + 205, column("idc")] = np.nan
    (finding,) = [f for f in findings(rows) if "noise" in f.message]
    assert "samples of force and idc run" in finding.message
    assert finding.count == pytest.approx(len(lost), abs=3)


def test_gaps_of_several_channels_are_one_finding() -> None:
    both, alone = filled([(0.8, 1.6), (3.0, 1.0)], ELECTRICAL), filled([(6.0, 1.6)], ["force"])
    rows = both[0].copy()
    (same,) = findings(rows)
    assert same.message.startswith(
        f"{same.count} samples of vdc and idc run between their neighbours without noise, in 2 places"
    )
    rows[:, column("force")] = alone[0][:, column("force")]
    (any_of_them,) = findings(rows)
    assert any_of_them.message.startswith(f"{any_of_them.count} samples of force, vdc or idc run")
    assert any_of_them.count == pytest.approx(len(both[1]) + len(alone[1]), abs=6)


def test_two_gaps_with_two_samples_between_them_are_found() -> None:
    rows, lost = filled([(0.8, 1.6), (0.8 + 1.6 + 0.08, 1.6)])
    assert sum(f.count for f in findings(rows)) == pytest.approx(len(lost), abs=6)


def test_a_cycle_whose_filled_gap_moves_an_energy_does_not_count(tmp_path: Path) -> None:
    rows, _ = filled([(0.6, 2.0)])
    path = tmp_path / "filled.csv"
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    path.write_text("\n".join([",".join(HEADERS), *lines, ""]), encoding="utf-8")
    found, true = reduce(read_run(path), window=5.48), clean()
    assert [cycle.complete for cycle in found.cycles] == [True, False, True]
    second = found.cycles[1].metrics.value("energy_line"), true.cycles[1].metrics.value("energy_line")
    assert abs(second[0] / second[1] - 1.0) > 0.01
    assert found.cycles[0].metrics.value("energy_line") == true.cycles[0].metrics.value("energy_line")


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1, 1.0, 3.0])
@pytest.mark.parametrize("name", list(SCENARIOS))
def test_a_log_whose_channels_are_calm_by_nature_has_no_finding(name: str, noise: float) -> None:
    made = make_log(replace(SCENARIOS[name], noise=noise), np.random.default_rng(1))
    assert findings(np.column_stack((made.t, *made.columns.values()))) == []


def test_a_channel_that_is_quiet_at_rest_and_noisy_in_motion_has_no_finding() -> None:
    rows = table().copy()
    rest = np.abs(rows[:, column("velocity")]) < 0.02
    for name in ELECTRICAL:
        rows[rest, column(name)] = 0.0
    assert findings(rows) == []


def rows_of(x: Signal) -> list[int]:
    """Rows of a channel that were filled in, of a log that moves all the time."""
    found = find_interpolated(
        np.arange(x.size) / 25.0, {"force": x}, {"force": find_bends(x)}, np.ones(x.size, dtype=bool)
    )
    return found["force"].tolist() if found else []


def test_a_gap_is_found_whole_where_two_blocks_of_the_search_meet() -> None:
    x = 100.0 + np.random.default_rng(1).standard_normal(70_000)
    lost = np.arange(65_531, 65_542)
    x[lost] = np.interp(lost, (lost[0] - 1, lost[-1] + 1), (98.0, 101.0))
    x[[lost[0] - 1, lost[-1] + 1]] = 98.0, 101.0
    assert {*lost.tolist()} <= {*rows_of(x)} <= {*range(lost[0] - 2, lost[-1] + 3)}


def test_a_noise_that_fades_and_comes_back_is_no_gap() -> None:
    k = np.arange(2000)
    loud = np.clip(np.abs(k - 1000) / 400.0, 0.001, 1.0)
    assert rows_of(100.0 + loud * np.random.default_rng(2).standard_normal(k.size)) == []


def test_an_output_that_switches_to_zero_and_back_is_no_gap() -> None:
    x = 100.0 + np.random.default_rng(3).standard_normal(2000)
    x[900:1000] = 0.01 * np.random.default_rng(4).standard_normal(100)
    assert rows_of(x) == []


@pytest.mark.parametrize("step", [0.0, 0.003])
@pytest.mark.parametrize("rest", [slice(900, 1000), slice(1940, 2000), slice(0, 60)], ids=["between", "last", "first"])
def test_a_machine_at_rest_whose_sensor_has_an_offset_is_no_gap(rest: slice, step: float) -> None:
    rng = np.random.default_rng(5)
    x = 1.0 + 0.3 * rng.standard_normal(2000)
    x[rest] = 0.06 + 0.004 * rng.standard_normal(x[rest].size)
    assert rows_of(np.round(x / step) * step if step else x) == []


def test_the_course_of_a_wave_is_straight_where_it_turns_and_no_line() -> None:
    t = np.arange(3000) / 25.0
    rng = np.random.default_rng(4)
    x = np.round(0.4 * np.sin(2.0 * math.pi * t / 6.0) + 3e-5 * rng.standard_normal(t.size), 5)
    v = np.gradient(0.4 * np.sin(2.0 * math.pi * t / 6.0), t) + 0.003 * rng.standard_normal(t.size)
    force = 800.0 + 300.0 * np.tanh(v / 0.05) + 5.0 * rng.standard_normal(t.size)
    found = check(t, {"displacement": x, "velocity": v, "force": force}, RIG, simulated=False, open_circuit=False)
    assert [f for f in found.findings if f.kind == "dropped_samples"] == []
