"""Tables state what the reduction found, with the digits that its uncertainty allows."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import Finding
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import ALL_METRICS
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
from winchcascade.report.content import Cell, Measured, Span, Table
from winchcascade.report.glossary import short
from winchcascade.report.results import reduction_tables as tables
from winchcascade.report.results.reduction import reduction_report
from winchcascade.report.wording import mean_text

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOGS: Mapping[str, tuple[str, float | None, str | float]] = {
    "clean": ("campaign/r36ohm.csv", 36.0, 5.48),
    "dropouts": ("damaged_logs/dropouts.csv", None, 5.48),
    "aborted": ("damaged_logs/aborted.csv", None, "auto"),
    "truncated": ("damaged_logs/truncated.csv", None, "auto"),
    "no torque": ("damaged_logs/no_torque.csv", None, "auto"),
    "open circuit": ("campaign/open_circuit.csv", float("inf"), "auto"),
    "none complete": ("campaign/r36ohm.csv", None, 0.05),
}
BARE = 'name = "bare"\n[winch]\nr_drum = { value = 0.13, unit = "m" }\n'

Result = tuple[Reduction, Uncertainty]


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    found = {}
    for name, (log, load, window) in LOGS.items():
        reduction = reduce(read_run(FIXTURES / log, load=load), window=window)
        found[name] = (reduction, uncertainty(reduction))
    return found


@pytest.fixture(scope="module")
def clean(results: dict[str, Result]) -> Result:
    return results["clean"]


def columns(table: Table[Any]) -> dict[str, list[Cell]]:
    """Cells by the name of their column, without the rows that summarise."""
    rows = table.cells[: len(table.items)]
    return {column.name: [row[k] for row in rows] for k, column in enumerate(table.columns)}


def value(cell: Cell) -> float | None:
    found = cell.value if isinstance(cell, Measured) else cell
    assert not isinstance(found, str | Span)
    return found


def tables_of(result: Result) -> dict[str, Table[Any]]:
    return {
        block.id: block for block in reduction_report(*result).blocks if isinstance(block, Table)
    }


@pytest.mark.parametrize("log", LOGS)
def test_the_cycles_table_states_every_cycle_and_the_means(
    results: dict[str, Result], log: str
) -> None:
    reduction, found = results[log]
    table = tables.cycles_table(reduction, found)
    cells, names = columns(table), [c.name for c in table.columns]
    assert cells["cycle"] == [
        f"{c.cycle}" if c.complete else f"({c.cycle})" for c in reduction.cycles
    ]
    assert cells["window"] == [c.window.cutoff - c.window.onset for c in reduction.cycles]
    below = {row[0]: dict(zip(names, row, strict=True)) for row in table.below}
    n = len(reduction.complete)
    assert (f"mean of {n}" in below) == (n > 0)
    for name in (*reduction.rig.cascade.energies, *reduction.rig.cascade.ratios):
        values = [c.metrics[name] for c in reduction.cycles]
        if short(name) not in cells:
            assert set(values) <= {None}
            continue
        assert [value(cell) for cell in cells[short(name)]] == values
        if n:
            assert value(below[f"mean of {n}"][short(name)]) == reduction.mean[name]
            assert value(below["std. uncertainty"][short(name)]) == found.standard[name]
        if n > 1:
            assert float(str(below["max. deviation, %"][short(name)] or "nan")) == pytest.approx(
                reduction.max_deviation_percent[name] or np.nan, abs=0.005, nan_ok=True
            )


@pytest.mark.parametrize("log", LOGS)
def test_shares_of_the_budget_add_up_to_the_whole(results: dict[str, Result], log: str) -> None:
    table = tables.budget_table(*results[log])
    if not results[log][0].complete:
        assert table.is_empty
        return
    for column, cells in columns(table).items():
        if re.match(r"E_|eta_", column):
            assert sum(value(cell) or 0.0 for cell in cells) == pytest.approx(100.0)
    known = {
        "limits",
        "calibration in place",
        "standard uncertainty",
        "expanded uncertainty",
        "resampling",
        "relation",
    }
    assert {str(cell) for cell in columns(table)["known by"] if cell} <= known


def test_the_uncertainty_table_states_scatter_sensors_and_both_intervals(clean: Result) -> None:
    reduction, found = clean
    cells = columns(tables_of(clean)["uncertainty"])
    assert cells["metric"] == [short(m) for m in ALL_METRICS]
    for k, metric in enumerate(ALL_METRICS):
        values = np.array([c.metrics.value(metric) for c in reduction.complete])
        assert value(cells["u, sensors"][k]) == found.budget.sensors[metric]
        assert value(cells["u, cycles"][k]) == pytest.approx(
            np.std(values, ddof=1) / np.sqrt(values.size)
        )
        for name, interval in (
            ("95 % interval", found.interval_95[metric]),
            ("these cycles alone", found.interval_95_sensors[metric]),
        ):
            ends = cells[name][k]
            assert isinstance(ends, Span)
            assert ends[:2] == (interval.low, interval.high)


def test_without_accuracies_only_the_repeatability_is_stated() -> None:
    rig = parse_rig(BARE, "bare.toml")
    reduction = reduce(
        read_run(FIXTURES / "campaign" / "r36ohm.csv", rig=rig), rig=rig, window=5.48
    )
    found = tables_of((reduction, uncertainty(reduction)))
    cells = columns(found["uncertainty"])
    assert not [cell for cell in cells["u, sensors"] if value(cell) is not None]
    assert all(value(cell) for cell in cells["u, cycles"])
    assert not {"budget", "sensors"} & set(found)


def test_what_a_log_does_not_measure_has_no_column(results: dict[str, Result]) -> None:
    heads = {
        column.name
        for table in tables_of(results["no torque"]).values()
        for column in table.used().columns
    }
    assert not heads & {"E_mech", "P_mech", "eta_trans", "eta_gen", "torque", "τ", "τ_hold"}
    assert {"E_line", "E_gen", "eta_pto"} <= heads


def test_bins_state_their_means_and_all_their_samples(clean: Result) -> None:
    reduction, _ = clean
    table = tables.bins_table(reduction)
    assert not table.is_empty
    cells = columns(table)
    assert cells["generator speed"] == [Span(b.rpm_low, b.rpm_high) for b in reduction.bins]
    assert cells["samples"] == [b.count for b in reduction.bins]
    for stage in ("line", "mech", "gen"):
        assert cells[f"P_{stage}"] == [
            Measured(b.mean[stage], b.standard_error.get(stage), True) for b in reduction.bins
        ]
    for store in ("rotor", "spring", "capacitor"):
        assert cells[f"into {store}"] == [b.mean.get(store) for b in reduction.bins]


def test_times_are_counted_from_the_first_stamp_of_an_epoch(clean: Result) -> None:
    reduction, epoch = clean[0], 1_776_506_400.0
    finding = Finding(
        "spike", "one sample", "bridged", channel="force", start=epoch + 12.0, end=epoch + 12.5
    )
    run = msgspec.structs.replace(reduction.run, t=reduction.run.t + epoch)
    late = msgspec.structs.replace(reduce(run, window=5.48), quality=(finding,))
    found = tables_of((late, uncertainty(late)))
    assert columns(found["phases"])["onset"] == pytest.approx(
        [c.phases.onset for c in reduction.cycles], abs=0.011
    )
    assert columns(found["findings"])["when"] == [Span(12.0, 12.5)]
    assert f"{epoch:.2f}" in found["findings"].note
    assert f"{epoch:.2f}" in found["phases"].caption


@pytest.mark.parametrize(
    ("energy", "text"),
    [(301855.2, "301900"), (7114.9, "7115"), (114.93, "114.9"), (0.012341, "0.01234")],
)
def test_an_energy_of_unknown_uncertainty_has_four_digits(energy: float, text: str) -> None:
    assert mean_text("energy_line", energy, None) == text
