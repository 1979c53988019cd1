"""Whole reductions: the published table, made logs with a known truth, measured field data."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import pytest
from daily import daily
from synthetic import SCENARIOS, Scenario, make_log, truth, write_csv

from winchcascade import Run, load_rig, read_run, reduce
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import OptionError
from winchcascade.reduction.efficiency import FIELDS, METRICS
from winchcascade.reduction.reduce import window_rule
from winchcascade.reduction.uncertainty import uncertainty

TABLE_2 = {
    45.0: (5937, 5222, 3988, 0.879, 0.763, 0.671),
    36.0: (7123, 6407, 4947, 0.898, 0.771, 0.693),
    27.0: (8616, 7898, 6119, 0.915, 0.773, 0.707),
    18.0: (11738, 11080, 8576, 0.944, 0.774, 0.730),
    9.0: (7621, 7275, 5311, 0.955, 0.730, 0.697),
    4.5: (4820, 4618, 2898, 0.958, 0.627, 0.600),
}
"""Published energies [J] and efficiencies by load [ohm] (Hsu et al. 2026, Table 2)."""

REBUILT_ENERGY, REBUILT_ETA = 0.015, 0.011
"""How closely the shipped logs were rebuilt from the table; the reduction cannot be closer."""


@pytest.mark.parametrize("load", TABLE_2)
def test_a_rebuilt_log_reduces_to_the_published_row(fixtures: Path, load: float) -> None:
    run = next(r for r in load_campaign(fixtures / "campaign").runs if r.load == load)
    reduction = reduce(read_run(run.file, load=run.load), window=run.window)
    m, row = reduction.mean, TABLE_2[load]
    assert (len(reduction.complete), reduction.quality) == (3, ())
    assert (m.energy_line, m.energy_mech, m.energy_gen) == pytest.approx(
        row[:3], rel=REBUILT_ENERGY
    )
    assert (m.eta_trans, m.eta_gen, m.eta_pto) == pytest.approx(row[3:], abs=REBUILT_ETA)


FIXED_ENERGY, FIXED_ETA = 0.007, 0.003
AUTO_ONSET, AUTO_CUTOFF, AUTO_ENERGY, AUTO_ETA = 0.05, 0.15, 0.03, 0.004
"""What a reduction of a log with sensor noise must reach against the noise-free truth, means
over the cycles.
"""

FLAT_ONSET = {"slow_ramp", "everything"}
"""A ramp so slow that noise of 4 mm/s moves the onset, and with it a window of fixed length, by
more than that allows.
"""

ILL_CONDITIONED = {"lag_ramp", "open_circuit"}
"""A speed that creeps through 98 % of its plateau for a second; an open circuit, whose torque is
as small as its zero.
"""

KNOWN = sorted(
    set(SCENARIOS) - ILL_CONDITIONED - {"aborted_payout", "steep_linear", "noisy", "ten_hertz"}
)


@cache
def logged(name: str) -> tuple[Scenario, Run]:
    """A made log whose sensors have noise but no zero error."""
    scenario = replace(SCENARIOS[name], zeros=0.0)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.csv"
        write_csv(make_log(scenario, np.random.default_rng(11)), path)
        return scenario, read_run(path, load=scenario.load)


def made(name: str, rule: str | float):  # type: ignore[no-untyped-def]
    """A reduction of a made log, and the truth of its motion."""
    scenario, run = logged(name)
    reduction = reduce(run, rig=load_rig("hsu2026"), window=rule)
    return reduction, truth(scenario, rule=rule, smoothed=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("rule", [5.0, "auto"])
@pytest.mark.parametrize("name", daily(KNOWN, KNOWN[::3]))
def test_a_reduction_meets_the_truth(name: str, rule: str | float) -> None:
    reduction, true = made(name, rule)
    assert [c.complete for c in reduction.cycles] == [c.complete for c in true.cycles]
    fixed = FIXED_ENERGY * (2 if name in FLAT_ONSET else 1)
    energy, eta = (AUTO_ENERGY, AUTO_ETA) if rule == "auto" else (fixed, FIXED_ETA)
    for metric in METRICS:
        expected = true.mean[FIELDS[metric]]
        if metric.startswith("eta"):
            assert reduction.mean[metric] == pytest.approx(expected, abs=eta), metric
        elif metric.startswith("energy"):
            assert reduction.mean[metric] == pytest.approx(expected, rel=energy), metric
    for cycle, expected in zip(
        reduction.complete, (c for c in true.cycles if c.complete), strict=True
    ):
        assert rule != "auto" or cycle.window.onset == pytest.approx(expected.onset, abs=AUTO_ONSET)
        assert rule != "auto" or cycle.window.cutoff == pytest.approx(
            expected.cutoff, abs=AUTO_CUTOFF
        )
        assert cycle.phases.payout_end == pytest.approx(expected.payout[1], abs=AUTO_ONSET)
        assert (cycle.phases.haul_in is None) == (expected.haul_in is None)


def test_without_noise_the_truth_is_met_exactly() -> None:
    reduction, true = made("exact", "auto")
    for metric in ("energy_line", "energy_mech", "energy_gen"):
        assert reduction.mean[metric] == pytest.approx(
            true.mean[FIELDS[metric]], rel=5e-4
        )  # 25 samples a second


def test_an_aborted_payout_is_listed_and_left_out() -> None:
    reduction, _ = made("aborted_payout", 5.0)
    assert [c.complete for c in reduction.cycles] == [True, False, True]
    (finding,) = reduction.quality
    assert finding.kind == "incomplete_cycle"
    assert "the payout is aborted after" in finding.message
    window = reduction.cycles[1].window
    assert (finding.start, finding.end) == (window.onset, window.cutoff)


def test_forty_three_cycles_of_the_measured_field_winch(shared: Path) -> None:
    rig = load_rig("kitepower")
    reduction = reduce(
        read_run(shared / "kitepower-2019-10-08" / "ground_station_cycles_01_43.csv", rig=rig),
        rig=rig,
    )
    assert len(reduction.complete) == 43
    assert reduction.total.energy_line == pytest.approx(12.88e6, rel=0.01)
    assert reduction.total.energy_mech == pytest.approx(11.22e6, rel=0.01)
    assert reduction.total.eta_trans == pytest.approx(0.871, rel=0.01)
    assert reduction.bins == ()  # the rig has no gear ratio
    assert all(
        c.summary.haul_in is None or (c.summary.haul_in.energy_line or 0.0) <= 0.0
        for c in reduction.cycles
    )


DAMAGED = {
    "semicolon_comma.csv": set(),
    "units_row.csv": set(),
    "labview.tdms": set(),
    "dropouts.csv": {"dropped_samples", "not_a_number"},
    "truncated.csv": {"truncated"},
    "aborted.csv": {"incomplete_cycle"},
    "no_torque.csv": {"missing_channel"},
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_log_reduces_to_the_clean_runs_efficiencies(fixtures: Path, name: str) -> None:
    clean = reduce(read_run(fixtures / "campaign" / "r36ohm.csv"), window=5.48).mean
    reduction = reduce(
        read_run(fixtures / "damaged_logs" / name, rig=load_rig("hsu2026")), window=5.48
    )
    assert {f.kind for f in reduction.quality} == DAMAGED[name]
    for metric in ("eta_trans", "eta_gen", "eta_pto"):
        given = name != "no_torque.csv" or metric == "eta_pto"
        assert reduction.mean[metric] == (
            pytest.approx(clean[metric], abs=0.005) if given else None
        )


@pytest.mark.parametrize("word", ["soon", "0", "-3", "nan", "inf", ""])
def test_a_window_that_is_none_is_reported(word: str) -> None:
    with pytest.raises(OptionError, match="expected auto, payout or a length in seconds"):
        window_rule(word)


def test_only_the_cycles_that_are_asked_for_count_and_keep_their_numbers(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "r36ohm.csv")
    whole, part, short = (
        reduce(run, window=5.48, cycles=cycles) for cycles in (None, (2, 3), (2, 9))
    )
    assert [[c.cycle for c in found.cycles] for found in (whole, part, short)] == [
        [1, 2, 3],
        [2, 3],
        [2, 3],
    ]
    energies = [[c.metrics.energy_gen for c in found] for found in (part.cycles, whole.cycles[1:])]
    assert energies[0] == pytest.approx(energies[1])
    assert part.mean.energy_line == pytest.approx(
        np.mean([c.metrics.energy_line for c in part.cycles])
    )
    assert [f.kind for f in short.quality] == ["incomplete_cycle"]
    with pytest.raises(OptionError, match=r"r36ohm.csv: cycles 4 to 9 were chosen, but it has 3"):
        reduce(run, cycles=(4, 9))


def test_a_gap_of_the_current_costs_no_cycle_in_open_circuit(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "open_circuit.csv", load=math.inf)
    holed = msgspec.structs.replace(run, gaps={"idc": np.array([(9.0, 9.08)])})
    assert len(reduce(holed).complete) == len(reduce(run).complete) == 3


def test_an_efficiency_above_1_is_given_with_its_mean_and_names_its_cycle(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "r36ohm.csv")
    torque = np.where((run.t > 38.0) & (run.t < 60.0), 3.0, 1.0) * run.channels["torque"]
    bent = msgspec.structs.replace(run, channels={**run.channels, "torque": torque})
    found = reduce(bent, cycles=(2, 3))
    (finding,) = (f for f in found.quality if f.kind == "efficiency_above_one")
    above, below = (cycle.metrics.value("eta_trans") for cycle in found.cycles)
    assert above > 1.0 > below
    assert found.mean.eta_trans == pytest.approx(0.5 * (above + below))
    assert uncertainty(found).standard.eta_trans
    assert (finding.count, f"{above:.4f} in cycle 2" in finding.message) == (1, True)
