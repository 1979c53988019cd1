"""Findings: faults injected into clean logs are reported by kind, place and number; clean logs
give none.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from loops import all_pairs, failures
from shipped_log import (
    CAMPAIGN,
    ENERGY,
    NAMES,
    WINDOW,
    Signal,
    channels,
    clean,
    column,
    row_after_onset,
    table,
    written,
)
from synthetic import KGCM2, SCENARIOS, make_log

from winchcascade import Finding, Reduction, Run, load_rig, read_run, reduce
from winchcascade.core.campaign_file import campaign_beside
from winchcascade.core.rig_toml import parse_rig
from winchcascade.ingest.checks.quality import Checked, check

RIG = load_rig("hsu2026")
POWERS = ("force", "velocity", "torque", "vdc", "idc")
EFFICIENCY = 0.005
"""A velocity from the displacement is smoothed, which moves an efficiency by less than the
paper's last digit.
"""

STATED = 0.01
"""The measured campaign's energies as its owners sum them."""


def checked(t: Signal, signals: Mapping[str, Signal], *, open_circuit: bool = False) -> Checked:
    copies = {name: np.array(x) for name, x in signals.items()}
    return check(t, copies, RIG, simulated=False, open_circuit=open_circuit)


def unexpected(found: Checked, torque: Signal) -> list[Finding]:
    over = bool(np.abs(torque).max() > 500)
    return [
        f
        for f in found.findings
        if not (over and (f.kind, f.channel) == ("out_of_range", "torque"))
    ]


def only(run: Run, kind: str) -> Finding:
    (finding,) = run.findings
    assert finding.kind == kind
    return finding


def energies(result: Reduction, cycle: int) -> list[float]:
    m = result.cycles[cycle].metrics
    return [e for e in (m.energy_line, m.energy_mech, m.energy_gen) if e is not None]


# ------------------------------------------------------------------------------------- clean logs
@pytest.mark.parametrize("path", sorted(CAMPAIGN.glob("*.csv")), ids=lambda p: p.stem)
def test_a_log_of_the_campaign_gives_no_finding(path: Path) -> None:
    _, entry = campaign_beside(path) or (None, None)
    assert entry is not None
    assert reduce(read_run(path, load=entry.load), window=entry.window).quality == ()


def has_no_finding(name: str, noise: float, rate: float) -> None:
    scenario = replace(SCENARIOS[name], noise=noise, rate=rate)
    log = make_log(scenario, np.random.default_rng(7))
    written = [np.round(x, d) for x, d in zip(log.columns.values(), log.decimals[1:], strict=True)]
    signals = channels(np.column_stack((log.t, *written)))
    assert (
        unexpected(checked(log.t, signals, open_circuit=np.isinf(scenario.load)), signals["torque"])
        == []
    )


NOISES = (0.0, 0.05, 0.25, 1.0, 4.0)


@pytest.mark.parametrize(
    "few", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["some", "all"]
)
def test_a_clean_log_gives_no_finding_whatever_its_motion_and_noise(few: bool) -> None:
    """Each scenario with the noise of real sensors or one other in turn, or with all noises."""
    cases = []
    for k, (name, scenario) in enumerate(SCENARIOS.items()):
        one = (1.0, 0.0, 1.0, 0.05, 1.0, 0.25, 1.0, 4.0)[k % 8]
        for noise in (one,) if few else NOISES:
            cases += [
                (name, noise, rate)
                for rate in ({scenario.rate, 5.0} if noise < 1 else {scenario.rate})
            ]
    assert failures(has_no_finding, cases) == []


def test_a_logger_that_is_faster_than_its_sensors_is_neither_stuck_nor_spiky() -> None:
    def check(name: str, noise: float, repeats: int) -> None:
        log = make_log(replace(SCENARIOS[name], noise=noise), np.random.default_rng(3))
        row = np.arange(log.t.size) // repeats * repeats
        signals = channels(np.column_stack((log.t, *log.columns.values()))[row])
        assert unexpected(checked(log.t, signals), signals["torque"]) == []

    names = ["smooth", "steep_linear", "heavy_load", "reversal", "ten_hertz", "hundred_hertz"]
    assert failures(check, all_pairs(names, [0.0, 0.1, 1.0, 2.0], [2, 3, 4])) == []


def test_coarse_resolution_is_neither_stuck_nor_spiky() -> None:
    steps = dict(zip(NAMES, (0.01, 0.02, 0.5 * KGCM2, 20.0, 5.0, 2.0, 0.1), strict=True))

    def check(name: str, noise: float, coarse: float) -> None:
        log = make_log(replace(SCENARIOS[name], noise=noise), np.random.default_rng(3))
        fine = channels(np.column_stack((log.t, *log.columns.values())))
        signals = {
            n: np.round(x / (coarse * steps[n])) * coarse * steps[n] for n, x in fine.items()
        }
        assert (
            unexpected(
                checked(log.t, signals, open_circuit=name == "open_circuit"), signals["torque"]
            )
            == []
        )

    names = ["smooth", "lag_ramp", "heavy_load", "open_circuit", "wavy_1_percent"]
    assert failures(check, all_pairs(names, [0.0, 0.25, 1.0], [0.3, 1.0, 3.0])) == []


# ----------------------------------------------------------------------------- holes and channels
@pytest.mark.parametrize("name", NAMES)
def test_empty_cells_are_counted_placed_and_bridged(tmp_path: Path, name: str) -> None:
    rows = table().copy()
    k = row_after_onset(8.0)
    rows[k : k + 5, column(name)] = np.nan
    run = written(tmp_path, rows)
    finding = only(run, "not_a_number")
    assert (finding.channel, finding.count, finding.removed) == (name, 5, 5)
    assert (finding.start, finding.end) == pytest.approx((rows[k, 0], rows[k + 4, 0]))
    assert np.isfinite(run.channels[name]).all()
    assert run.gaps[name] == pytest.approx(rows[[[k - 1, k + 5]], 0])


@pytest.mark.parametrize("name", [n for n in NAMES if n != "velocity"])
def test_metrics_that_need_a_missing_channel_are_null_and_cycles_stay_complete(
    tmp_path: Path, name: str
) -> None:
    result = reduce(written(tmp_path, table(), without=name), window=WINDOW["r36ohm"])
    assert [(f.kind, f.channel) for f in result.quality] == [
        ("rig_assumed", None),
        ("missing_channel", name),
    ]
    assert [c.complete for c in result.cycles] == [True, True, True]
    lost = {
        "force": ("energy_line", "eta_trans", "eta_pto"),
        "torque": ("energy_mech", "eta_trans", "eta_gen"),
    }
    lost |= dict.fromkeys(("vdc", "idc"), ("energy_gen", "eta_gen", "eta_pto"))
    for metric in ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen", "eta_pto"):
        assert (getattr(result.mean, metric) is None) == (metric in lost.get(name, ()))


@pytest.mark.parametrize(
    ("without", "value", "kinds"),
    [("velocity", 1.0, []), (None, np.nan, []), (None, 0.0, ["dead_channel"])],
    ids=["missing", "empty", "dead"],
)
def test_a_velocity_that_is_missing_empty_or_dead_is_derived_from_the_displacement(
    tmp_path: Path, without: str | None, value: float, kinds: list[str]
) -> None:
    rows = table().copy()
    rows[:, column("velocity")] = value
    run = written(tmp_path, rows, without=without)
    assert [(f.kind, f.channel) for f in run.findings] == [
        (kind, "velocity") for kind in (*kinds, "derived_channel")
    ]
    mean = reduce(run, window=WINDOW["r36ohm"]).mean
    for eta in ("eta_trans", "eta_gen", "eta_pto"):
        assert getattr(mean, eta) == pytest.approx(getattr(clean().mean, eta), abs=EFFICIENCY)


def test_a_hole_of_the_displacement_is_one_of_the_velocity_that_is_derived_from_it(
    tmp_path: Path,
) -> None:
    rows = table().copy()
    k = row_after_onset(2.0)
    rows[k : k + 40, 1] = np.nan
    result = reduce(written(tmp_path, rows, without="velocity"), window=WINDOW["r36ohm"])
    assert [c.complete for c in result.cycles] == [True, False, True]


# -------------------------------------------------------------------------------- range and slack
def test_wild_values_outside_the_range_are_both_bridged_and_out_of_range(tmp_path: Path) -> None:
    def check(after_onset: float, value: float, samples: int) -> None:
        rows = table().copy()
        k = row_after_onset(after_onset)
        rows[k : k + samples, column("torque")] = value
        run = written(tmp_path, rows)
        assert {(f.kind, f.count) for f in run.findings} == {
            ("spike", samples),
            ("out_of_range", samples),
        }
        action = next(f.action for f in run.findings if f.kind == "out_of_range")
        assert f"but for {samples} bridged as spikes" in action
        assert run.channels["torque"].max() < 500

    assert (
        failures(check, all_pairs([-2.0, 2.0, 5.0, 9.0], [612.0, 5000.0], [1, 2, 5, 8, 50])) == []
    )


def test_the_force_of_a_rod_that_pushes_is_no_slack_line(tmp_path: Path) -> None:
    rig = parse_rig(
        'name = "buoy with a rod"\n[winch]\nline_can_push = true\n[phases]\nfrom = "waves"\n',
        "rod.toml",
    )
    t = np.arange(0.0, 60.0, 0.05)
    v = 0.8 * np.sin(2.0 * np.pi * t / 6.0)
    rows = "".join(f"{a:.2f},{b:.5f},{900.0 * b:.2f}\n" for a, b in zip(t, v, strict=True))
    path = tmp_path / "buoy.csv"
    path.write_text(f"Time (s),Velocity (m/s),Force (N)\n{rows}")
    assert [f.kind for f in read_run(path).findings if f.kind == "slack_line"] == ["slack_line"]
    run = read_run(path, rig=rig)
    assert [f.kind for f in run.findings] == ["thresholds_assumed"]
    assert run.channels["force"].min() == pytest.approx(-720.0, rel=1e-3)


# -------------------------------------------------------------------------- gaps and completeness
def with_gap(folder: Path, name: str, after_onset: float, samples: int) -> Reduction:
    """The log without some cells of a channel, or without some rows, in its second cycle."""
    rows = table().copy()
    k = row_after_onset(after_onset)
    if name == "row":
        rows = np.delete(rows, slice(k, k + samples), axis=0)
    else:
        rows[k : k + samples, column(name)] = np.nan
    return reduce(written(folder, rows), window=WINDOW["r36ohm"])


def test_a_cycle_that_counts_has_the_energies_of_the_clean_log(tmp_path: Path) -> None:
    def check(name: str, after_onset: float, samples: int) -> None:
        result = with_gap(tmp_path, name, after_onset, samples)
        assert result.cycles[0].complete
        assert result.cycles[2].complete
        if result.cycles[1].complete:
            assert energies(result, 1) == pytest.approx(energies(clean(), 1), rel=ENERGY)

    places = [-0.2, 0.0, 2.5, 5.2, 7.0]
    assert failures(check, all_pairs([*POWERS, "row"], places, [1, 12, 30, 100])) == []


def test_a_gap_of_more_than_a_second_in_the_window_makes_the_cycle_incomplete(
    tmp_path: Path,
) -> None:
    def check(name: str, after_onset: float) -> None:
        result = with_gap(tmp_path, name, after_onset, 30)
        assert [c.complete for c in result.cycles] == [True, False, True]
        assert "a gap of 1.24 s lies in its window" in result.quality[-1].message

    assert failures(check, product([*POWERS, "row"], [0.5, 1.5, 4.0])) == []


# --------------------------------------------------------------------------------------- measured
def test_the_kite_campaign_gives_its_owners_energies(shared: Path) -> None:
    rig = load_rig("kitepower")
    run = read_run(shared / "kitepower-2019-10-08" / "ground_station_cycles_01_43.csv", rig=rig)
    result = reduce(run, rig=rig)
    assert [c.complete for c in result.cycles] == [True] * 43
    assert result.total.energy_line == pytest.approx(12.88e6, rel=STATED)
    assert result.total.energy_mech == pytest.approx(11.22e6, rel=STATED)
    assert result.total.eta_trans == pytest.approx(0.871, rel=STATED)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("name", ["force", "torque", "vdc", "idc"])
def test_a_channel_that_is_cut_at_a_value_inside_its_range_is_saturated(
    tmp_path: Path, name: str, share: float
) -> None:
    rows = table().copy()
    cut = rows[:, column(name)]
    top = round(share * float(cut.max()), 2)
    np.minimum(cut, top, out=cut)
    found = [f for f in written(tmp_path, rows).findings if f.kind == "out_of_range"]
    assert [(f.channel, f.count) for f in found] == [(name, int(np.count_nonzero(cut == top)))]
