"""Tables state what the reduction found, with the digits that its uncertainty allows."""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec
import numpy as np
import pytest

from winchcascade.core.cascade import PAPER
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import Finding
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import ALL_METRICS, METRICS, NET_METRICS, Metrics
from winchcascade.reduction.energies import NetSpan
from winchcascade.reduction.montecarlo import Uncertainty, uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report import tables
from winchcascade.report.digits import MINUS
from winchcascade.report.sheet import Table
from winchcascade.report.wording import metrics_note

ROUNDING = 0.17
"""Half of the last digit that an uncertainty allows, in units of it, at most (0.5 / 2.95)."""

WITHOUT = {"eta": 0.0005, "power": 0.5, "energy": 0.5}
"""Half of the last decimal of what has no uncertainty."""

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
SYMBOLS = dict(zip(METRICS, "E_line E_mech E_gen P_line P_mech P_gen η_trans η_gen η_pto".split(), strict=True))
NET_SYMBOLS = dict(zip(NET_METRICS, ("E_payout", "E_returned", "E_net", "E_gen, cycle", "η_net"), strict=True))

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


@pytest.fixture(scope="module")
def many(clean: Result) -> Result:
    """Seventy-three cycles: those of a log, again and again."""
    reduction, _ = clean
    cycles = tuple(msgspec.structs.replace(reduction.cycles[k % 3], cycle=k + 1) for k in range(73))
    longer = msgspec.structs.replace(reduction, cycles=cycles)
    return longer, uncertainty(longer)


def read(text: str) -> float:
    assert "-" not in text
    return float(text.replace(MINUS, "-"))


def columns(table: Table) -> dict[str, list[str]]:
    """Columns by name; a name that stands twice has the last of them."""
    return {name: [row[k] for row in table.rows] for k, name in enumerate(table.head)}


def agree(text: str, value: float | None, u: float | None, metric: str) -> None:
    """Whether a cell states a value with the digits that it may have."""
    if value is None:
        assert text == "–"
    else:
        tolerance = ROUNDING * u if u else WITHOUT[metric.split("_")[0]]
        assert abs(read(text) - value) <= tolerance * (1 + 1e-9)


def all_tables(result: Result) -> Iterator[Table]:
    reduction, found = result
    yield tables.cycles_table(reduction, found)
    yield tables.payouts_table(reduction)
    yield tables.holds_table(reduction)
    for table in (
        tables.uncertainty_table(reduction, found),
        tables.repeatability_table(reduction, found), tables.budget_table(found, reduction.rig),
        tables.bins_table(reduction),
        tables.findings_table(reduction), tables.sensors_table(reduction),
    ):  # fmt: skip
        if table is not None:
            yield table


@pytest.mark.parametrize("log", LOGS)
def test_every_row_has_a_cell_for_every_name_and_unit(results: dict[str, Result], log: str) -> None:
    for table in all_tables(results[log]):
        assert len(table.head) == len(table.units)
        assert {len(row) for row in table.rows} <= {len(table.head)}, table.id
        assert all(0 <= k < len(table.head) for k in table.text_columns)
        assert table.summary <= len(table.rows)


@pytest.mark.parametrize("log", LOGS)
def test_every_column_that_is_no_text_holds_numbers_or_dashes(results: dict[str, Result], log: str) -> None:
    for table in all_tables(results[log]):
        for k, name in enumerate(table.head):
            if k not in table.text_columns and name not in ("95 % interval", "these cycles alone", "Samples"):
                texts = [row[k].lstrip("<") for row in table.rows if row[k] not in ("–", "", "∞")]
                assert all(np.isfinite(read(text)) for text in texts), (table.id, name)


@pytest.mark.parametrize("log", LOGS)
def test_the_cycles_table_states_every_cycle_of_the_reduction(results: dict[str, Result], log: str) -> None:
    reduction, found = results[log]
    table = tables.cycles_table(reduction, found)
    rows = table.rows[: len(table.rows) - table.summary]
    assert len(rows) == len(reduction.cycles)
    for row, cycle, u in zip(rows, reduction.cycles, found.budget.cycles, strict=True):
        assert row[0] == (f"{cycle.cycle}" if cycle.complete else f"({cycle.cycle})")
        assert read(row[1]) == pytest.approx(cycle.window.cutoff - cycle.window.onset, abs=0.005 + 1e-9)
        cells = dict(zip(table.head, row, strict=True))
        for metric, symbol in SYMBOLS.items():
            value = getattr(cycle.metrics, metric)
            if symbol in cells:
                agree(cells[symbol], value, getattr(u, metric), metric)
            else:
                assert value is None


@pytest.mark.parametrize("log", LOGS)
def test_the_last_rows_state_the_mean_its_uncertainty_and_the_largest_deviation(
    results: dict[str, Result], log: str
) -> None:
    reduction, found = results[log]
    table = tables.cycles_table(reduction, found)
    below = {row[0]: dict(zip(table.head, row, strict=True)) for row in table.rows[len(table.rows) - table.summary :]}
    assert len(below) == table.summary
    n = len(reduction.complete)
    if n == 0:
        assert below == {}
        return
    for metric, symbol in SYMBOLS.items():
        if symbol not in table.head:
            continue
        u = getattr(found.standard, metric)
        agree(below[f"mean of {n}"][symbol], getattr(reduction.mean, metric), u, metric)
        agree(below["standard uncertainty"][symbol], u, u, metric)
        interval = found.interval_95.get(metric)
        agree(below["95 % interval, from"][symbol], None if interval is None else interval.low, u, metric)
        agree(below["to"][symbol], None if interval is None else interval.high, u, metric)
        deviation = getattr(reduction.max_deviation_percent, metric)
        if n > 1 and deviation is not None:
            assert read(below["largest deviation (%)"][symbol]) == pytest.approx(deviation, abs=0.005 + 1e-9)


def test_the_mean_lies_within_its_interval_as_it_is_printed(clean: Result) -> None:
    table = tables.cycles_table(*clean)
    mean, u, low, high, _ = table.rows[-table.summary :]
    for k in range(2, len(table.head)):
        assert read(low[k]) < read(mean[k]) < read(high[k])
        assert read(u[k]) < read(high[k]) - read(low[k])


def test_cycles_in_brackets_are_those_that_the_mean_leaves_out(results: dict[str, Result]) -> None:
    reduction, found = results["aborted"]
    incomplete = {f"({c.cycle})" for c in reduction.cycles if not c.complete}
    assert incomplete
    for table in (
        tables.cycles_table(reduction, found),
        tables.payouts_table(reduction),
        tables.holds_table(reduction),
    ):
        assert {row[0] for row in table.rows if row[0].startswith("(")} == incomplete
    assert "in brackets is incomplete" in tables.cycles_table(reduction, found).caption
    repeated = tables.repeatability_table(reduction, found)
    assert repeated is not None
    assert not {cell.strip("()") for cell in columns(repeated)["in cycle"]} & {c.strip("()") for c in incomplete}


def test_a_table_of_complete_cycles_has_no_word_of_brackets(clean: Result) -> None:
    table = tables.cycles_table(*clean)
    assert "bracket" not in table.caption
    assert not any("(" in row[0] for row in table.rows[: len(table.rows) - table.summary])


def test_of_many_cycles_the_first_and_the_last_are_listed_and_the_rest_counted(many: Result) -> None:
    reduction, found = many
    for table in (
        tables.cycles_table(reduction, found),
        tables.payouts_table(reduction),
        tables.holds_table(reduction),
    ):
        first = [row[0] for row in table.rows[: len(table.rows) - table.summary]]
        assert first == [*map(str, range(1, 31)), "… 13 more", *map(str, range(44, 74))]


def test_sixty_cycles_are_all_listed(many: Result) -> None:
    reduction, _ = many
    sixty = msgspec.structs.replace(reduction, cycles=reduction.cycles[:60])
    assert [row[0] for row in tables.payouts_table(sixty).rows] == [*map(str, range(1, 61))]


@pytest.mark.parametrize("log", LOGS)
def test_shares_of_the_budget_add_up_to_the_whole(results: dict[str, Result], log: str) -> None:
    table = tables.budget_table(results[log][1], results[log][0].rig)
    if not results[log][0].complete:
        assert table is None
        return
    assert table is not None
    for name, column in columns(table).items():
        if name not in SYMBOLS.values():
            continue
        stated = [text for text in column if text != "–"]
        total = sum(0.25 if text.startswith("<") else read(text) for text in stated)
        assert total == pytest.approx(100.0, abs=0.5 * len(stated))  # each is rounded to a percent


def test_the_repeatability_states_the_scatter_of_the_complete_cycles(clean: Result) -> None:
    reduction, found = clean
    table = tables.repeatability_table(reduction, found)
    assert table is not None
    named = columns(table)
    assert named["Metric"] == [*SYMBOLS.values(), *NET_SYMBOLS.values()]
    for k, metric in enumerate(ALL_METRICS):
        values = np.array([getattr(c.metrics, metric) for c in reduction.complete])
        s = float(np.std(values, ddof=1))
        u = s / np.sqrt(values.size)
        agree(named["Minimum"][k], values.min(), u, metric)
        agree(named["Maximum"][k], values.max(), u, metric)
        agree(named["s"][k], s, s, metric)
        agree(named["s/√N"][k], u, u, metric)
        far = int(np.argmax(np.abs(values - values.mean())))
        assert named["in cycle"][k] == f"{reduction.complete[far].cycle}"
        deviation = 100.0 * abs(values[far] / values.mean() - 1.0)
        assert read(named["Largest deviation"][k]) == pytest.approx(deviation, abs=0.005 + 1e-9)


def test_the_table_of_whole_cycles_states_net_energies_and_why_they_are_missing(clean: Result) -> None:
    reduction, found = clean
    table = tables.net_table(reduction, found)
    assert table is not None
    assert table.head[2:] == tuple(NET_SYMBOLS.values())
    named = columns(table)
    for metric, symbol in NET_SYMBOLS.items():
        column = named[symbol][: len(reduction.cycles)]
        for text, c, u in zip(column, reduction.cycles, found.budget.cycles, strict=True):
            agree(text, getattr(c.metrics, metric), getattr(u, metric), metric)
    assert "Without net energies" not in table.note
    last = msgspec.structs.replace(
        reduction.cycles[-1], metrics=Metrics(), net=NetSpan(0.0, 1.0, 0.0, "no haul-in follows")
    )
    less = tables.net_table(msgspec.structs.replace(reduction, cycles=(*reduction.cycles[:-1], last)), found)
    assert less is not None
    assert f"Without net energies: cycle {last.cycle}: no haul-in follows." in less.note
    assert tables.net_table(msgspec.structs.replace(reduction, cycles=(last,)), found) is None


def test_a_single_complete_cycle_has_no_repeatability(clean: Result) -> None:
    reduction, _ = clean
    one = msgspec.structs.replace(reduction, cycles=reduction.cycles[:1])
    assert tables.repeatability_table(one, uncertainty(one)) is None


def test_the_uncertainty_table_states_both_parts_and_both_intervals(clean: Result) -> None:
    reduction, found = clean
    table = tables.uncertainty_table(reduction, found)
    assert table is not None
    named = columns(table)
    for k, metric in enumerate(ALL_METRICS):
        sensors, scatter = getattr(found.budget.sensors, metric), getattr(found.budget.repeatability, metric)
        agree(named["u, sensors"][k], sensors, sensors, metric)
        agree(named["u, cycles"][k], scatter, scatter, metric)
        agree(named["u"][k], getattr(found.standard, metric), getattr(found.standard, metric), metric)
        for column, interval, u in (
            ("95 % interval", found.interval_95[metric], getattr(found.standard, metric)),
            ("these cycles alone", found.interval_95_sensors[metric], sensors),
        ):
            low, high = named[column][k].split(" to ")
            agree(low, interval.low, u, metric)
            agree(high, interval.high, u, metric)


def test_without_accuracies_only_the_repeatability_is_stated() -> None:
    rig = parse_rig('name = "bare"\n[winch]\nr_drum = { value = 0.13, unit = "m" }\n', "bare.toml")
    reduction = reduce(read_run(FIXTURES / "campaign" / "r36ohm.csv", rig=rig), rig=rig, window=5.48)
    found = uncertainty(reduction)
    assert tables.uncertainty_table(reduction, found) is None
    table = tables.repeatability_table(reduction, found)
    assert table is not None
    assert "–" not in columns(table)["s/√N"]
    assert "for lack of an accuracy of force, idc, torque, vdc" in tables.unknown_words(found)
    assert tables.budget_table(found, reduction.rig) is None
    assert tables.sensors_table(reduction) is None


@pytest.mark.parametrize("log", LOGS)
def test_no_column_of_the_phases_holds_nothing_but_dashes(results: dict[str, Result], log: str) -> None:
    reduction, _ = results[log]
    for table in (tables.payouts_table(reduction), tables.holds_table(reduction)):
        assert not [name for name, column in columns(table).items() if set(column) <= {"–", ""}]


def test_what_a_log_does_not_measure_has_no_column(results: dict[str, Result]) -> None:
    reduction, found = results["no torque"]
    heads = {name for table in all_tables((reduction, found)) for name in table.head}
    assert not heads & {"E_mech", "P_mech", "η_trans", "η_gen", "τ", "τ_hold"}
    assert {"E_line", "E_gen", "η_pto"} <= heads


def test_the_phases_are_stated_as_they_were_found(clean: Result) -> None:
    reduction, _ = clean
    payouts, holds = columns(tables.payouts_table(reduction)), columns(tables.holds_table(reduction))
    for k, c in enumerate(reduction.cycles):
        plateau, hold, haul = c.summary.payout.plateau, c.summary.hold, c.summary.haul_in
        assert plateau is not None
        assert hold is not None
        assert hold.pressure is not None
        assert haul is not None
        for text, value, half in (
            (payouts["Onset"][k], c.phases.onset, 0.005), (payouts["Travel"][k], c.summary.payout.travel, 0.005),
            (payouts["v_plateau"][k], plateau.speed, 0.0005), (payouts["F"][k], plateau.force, 0.5),
            (payouts["τ"][k], plateau.torque, 0.05), (payouts["P_gen"][k], plateau.power_gen, 0.5),
            (holds["F_hold"][k], hold.force, 0.5), (holds["p_hold"][k], hold.pressure / 98066.5, 0.005),
            (holds["Haul-in"][k], haul.duration, 0.005), (holds["F_min"][k], haul.force_min, 0.5),
            (holds["E_line"][k], haul.energy_line, 0.5),
        ):  # fmt: skip
            assert read(text) == pytest.approx(value, abs=half + 1e-9)


def test_bins_state_their_means_and_all_their_samples(clean: Result) -> None:
    reduction, _ = clean
    table = tables.bins_table(reduction)
    assert table is not None
    assert len(table.rows) == len(reduction.bins)
    for row, b in zip(table.rows, reduction.bins, strict=True):
        assert row[0] == f"{b.rpm_low:.0f} to {b.rpm_high:.0f}"
        assert row[1] == f"{b.count}"
        for k, stage in enumerate(("line", "mech", "gen")):
            error = b.standard_error[stage]
            agree(row[2 + 2 * k], b.power[stage], error, "power")
            agree(row[3 + 2 * k], error, error, "power")


@pytest.mark.parametrize("log", LOGS)
def test_every_finding_is_listed_with_what_was_done(results: dict[str, Result], log: str) -> None:
    reduction, _ = results[log]
    table = tables.findings_table(reduction)
    if not reduction.quality:
        assert table is None
        return
    assert table is not None
    listed = Counter((row[0].replace(" ", "_"), row[1], row[-2], row[-1]) for row in table.rows)
    assert listed == Counter((f.kind, f.channel or "", f.message, f.action) for f in reduction.quality)


def test_of_too_many_findings_the_table_says_how_many_it_leaves_out(clean: Result) -> None:
    reduction, _ = clean
    findings = tuple(Finding("spike", f"spike {k}", "bridged", "force", k, k + 1.0, removed=1) for k in range(100))
    table = tables.findings_table(msgspec.structs.replace(reduction, quality=findings))
    assert table is not None
    *listed, last = table.rows
    assert [row[5] for row in listed] == [f.message for f in findings[: len(listed)]]
    assert last[0] == f"… {100 - len(listed)} more"


def test_a_finding_states_its_share_of_the_samples(clean: Result) -> None:
    reduction, _ = clean
    finding = Finding("stuck", "stuck", "bridged", "force", 1.0, 2.0, count=10, removed=277)
    table = tables.findings_table(msgspec.structs.replace(reduction, quality=(finding,)))
    assert table is not None
    assert columns(table)["Data lost"] == ["10.01"]  # of 2767


def test_sensors_are_listed_as_the_rig_file_states_them(clean: Result) -> None:
    rig = parse_rig(
        'based_on = "hsu2026"\nname = "mine"\n[sensors.force]\nunit = "kN"\nlow = -5\nhigh = 20\naccuracy_full_scale = 0.002\n'
        'accuracy = 0.05\nsource = "sheet 3"\ninstrument = "cell"\n',
        "mine.toml",
    )
    table = tables.sensors_table(msgspec.structs.replace(clean[0], rig=rig))
    assert table is not None
    (force,) = (row for row in table.rows if row[0] == "force")
    assert force == ("force", "cell", f"{MINUS}5 to 20 kN", "0.2 % of full scale and 0.05 kN", "sheet 3")


def test_times_are_counted_from_the_first_stamp_of_an_epoch(clean: Result) -> None:
    reduction, epoch = clean[0], 1_776_506_400.0
    finding = Finding("spike", "one sample", "bridged", channel="force", start=epoch + 12.0, end=epoch + 12.5)
    run = msgspec.structs.replace(reduction.run, t=reduction.run.t + epoch)
    late = msgspec.structs.replace(reduce(run, window=5.48), quality=(finding,))
    onsets = columns(tables.payouts_table(late))["Onset"]
    assert [read(t) for t in onsets] == pytest.approx([c.phases.onset for c in reduction.cycles], abs=0.011)
    shown = tables.findings_table(late)
    assert shown is not None
    assert (shown.rows[0][2], shown.rows[0][3]) == ("12.00", "12.50")
    assert f"{epoch:.2f} s on the log's clock" in shown.note
    assert f"{epoch:.2f} s on the log's clock" in tables.payouts_table(late).note


def test_a_large_energy_of_unknown_uncertainty_has_four_digits(clean: Result) -> None:
    from winchcascade.report.tables import _four

    assert [_four(x, "energy_line") for x in (301855.2, 7114.9, None)] == ["301900", "7115", "–"]
    assert _four(0.8658, "eta_trans") == "0.866"


def test_every_symbol_of_the_cycles_is_reported_below_them(results: dict[str, Result]) -> None:
    note = tables.cycles_table(*results["clean"]).note
    assert note.startswith("Subscripts: line, the line (force times speed); mech, the shaft; gen, the DC link")
    assert "η_pto = E_gen / E_line" in note
    assert "gen" not in metrics_note(PAPER, ["energy_line", "energy_mech", "eta_trans"])
