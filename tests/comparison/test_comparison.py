"""Comparison of two sides: what they may be, how runs are matched, what is noted, and the limit
of a drop.
"""

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from test_cli import one_sentence, winchcascade
from undrawn import undrawn

from winchcascade import (
    Comparison,
    OptionError,
    compare,
    open_campaign,
    read_run,
    reduce,
    write_report,
)
from winchcascade.comparison.compared_run import CompareError
from winchcascade.comparison.differences import Difference
from winchcascade.comparison.gate import Gate, drop_gate
from winchcascade.core.files import json_bytes
from winchcascade.core.rig_toml import read_rig
from winchcascade.reduction.uncertainty import budget
from winchcascade.report.content import Picture, Table
from winchcascade.report.results.comparison import comparison_record, comparison_report
from winchcascade.rig.baseline import load_rig

LOGS = Path(__file__).parents[2] / "fixtures" / "campaign"
LOADS = {"r36ohm.csv": 36.0, "r9ohm.csv": 9.0, "open_circuit.csv": math.inf}
FACTOR = 0.96
"""Current of the side after, as a share of that before."""


def with_current(log: Path, target: Path, factor: float) -> None:
    """Copy a log with another current."""
    head, *rows = (line.split(",") for line in log.read_text().splitlines())
    column = next(k for k, name in enumerate(head) if name.startswith("Idc"))
    for row in rows:
        row[column] = f"{factor * float(row[column]):.5f}"
    target.write_text("\n".join(",".join(row) for row in (head, *rows)) + "\n")


def campaign(folder: Path, factor: float, extra: str = "", names: dict[str, float] = LOADS) -> Path:
    """Make a campaign of some of the shipped logs with another current."""
    folder.mkdir()
    text = f"{extra}\n"
    for name, load in names.items():
        with_current(LOGS / name, folder / name, factor)
        window = "" if math.isinf(load) else "window_s = 5.48\n"
        text += f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n{window}'
    (folder / "campaign.toml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sides")
    campaign(folder / "before", 1.0)
    campaign(folder / "after", FACTOR, "measured = true")
    return folder


@pytest.fixture(scope="module")
def found(place: Path) -> Comparison:
    return compare(place / "before", place / "after")


def of(comparison: Comparison, label: str, metric: str) -> Difference:
    one = next(runs for runs in comparison.runs if runs.label == label).of(metric)
    assert one is not None
    return one


def messages(comparison: Comparison, kind: str) -> str:
    return " ".join(note.message for note in comparison.notes if note.kind == kind)


# ------------------------------------------------------------------------------------ differences
def test_runs_are_matched_by_load_and_subtracted(found: Comparison) -> None:
    assert [runs.label for runs in found.runs] == ["open circuit", "36 ohm", "9 ohm"]
    assert (found.matched_by, found.overall) == ("load", "eta_pto")
    for label in ("36 ohm", "9 ohm"):
        one = of(found, label, "eta_pto")
        assert one.b / one.a == pytest.approx(FACTOR, abs=1e-4)
        assert one.value == pytest.approx((FACTOR - 1.0) * one.a, rel=1e-2)
        assert one.excludes_zero is True
        assert of(found, label, "eta_trans").value == 0.0
        assert of(found, label, "energy_line").excludes_zero is False
    assert found.runs[0].of("eta_pto") is None


def test_the_parts_are_those_of_the_budgets(found: Comparison) -> None:
    known = budget(
        reduce(
            read_run(LOGS / "r36ohm.csv", rig=load_rig("hsu2026"), load=36.0, campaign=False),
            window=5.48,
        )
    )
    one = of(found, "36 ohm", "eta_trans")  # does not depend on the current
    assert one.sensors == pytest.approx(math.sqrt(2.0) * known.sensors.value("eta_trans"), rel=1e-5)
    assert one.repeatability == pytest.approx(
        math.sqrt(2.0) * known.repeatability.value("eta_trans"), rel=1e-6
    )


def test_common_sensors_narrow_the_interval(found: Comparison, place: Path) -> None:
    same = compare(place / "before", place / "after", same_sensors=True)
    assert same.shared == (
        "idc",
        "timing",
        "vdc",
    )  # the limits of the others are of their range, not of the reading
    for metric in ("eta_gen", "eta_pto"):
        wide, narrow = (of(one, "36 ohm", metric) for one in (found, same))
        assert narrow.value == wide.value
        assert (narrow.sensors or 0.0) < 0.95 * (wide.sensors or 0.0)
    assert (of(same, "36 ohm", "energy_gen").sensors or 0.0) < 0.6 * (
        of(found, "36 ohm", "energy_gen").sensors or 0.0
    )


def test_a_zero_that_only_limits_bound_does_not_average_out_over_the_logs_of_a_side(
    tmp_path: Path, fixtures: Path
) -> None:
    """Of three repeats on a side, the zero of the force cell acts as on one, unless it is set
    anew in each log.
    """
    sensor = '[sensors.force]\nunit = "N"\nhigh = 20000\naccuracy_full_scale = 0.002\nu_lag = 0\n'
    ratio = {}
    for basis, more in (("limits", ""), ("in place", "u_zero = 23\nu_gain = 0\n")):
        found = []
        for logs in (1, 3):
            side = tmp_path / f"{basis} {logs}"
            side.mkdir()
            (side / "rig.toml").write_text(f'based_on = "hsu2026"\nname = "ours"\n{sensor}{more}')
            runs = ""
            for k in range(logs):
                shutil.copy(fixtures / "campaign" / "r36ohm.csv", side / f"run{k}.csv")
                runs += f'[[run]]\nfile = "run{k}.csv"\nload_ohm = 36\nwindow_s = 5.48\n'
            (side / "campaign.toml").write_text(f'title = "{basis}"\nrig = "rig.toml"\n{runs}')
            found.append(side)
        one, three = (
            of(compare(side, side), "36 ohm", "energy_line").sensors or 0.0 for side in found
        )
        ratio[basis] = three / one
    assert ratio["limits"] == pytest.approx(1.0, rel=0.01)
    assert ratio["in place"] == pytest.approx(1.0 / math.sqrt(3.0), rel=0.01)


def test_swapped_sides_change_the_sign_alone(found: Comparison, place: Path) -> None:
    back = compare(place / "after", place / "before")
    one, other = of(found, "9 ohm", "eta_gen"), of(back, "9 ohm", "eta_gen")
    assert other.value == -one.value
    assert other.interval == pytest.approx(tuple(-end for end in reversed(one.interval or ())))


# ----------------------------------------------------------------------------- what a side may be
def test_a_side_may_be_a_campaign_a_batch_a_json_a_log_or_a_result(
    found: Comparison, place: Path, tmp_path: Path
) -> None:
    before = place / "before"
    assert (
        winchcascade("batch", before, "--out", tmp_path / "out", "--reports", "none").returncode
        == 0
    )
    opened = open_campaign(before).reduce()
    sides: list[Any] = [
        before / "campaign.toml",
        tmp_path / "out",
        tmp_path / "out" / "campaign.json",
        opened,
    ]
    for side in sides:
        whole = compare(side, place / "after")
        assert len(whole.runs) == 3
        assert of(whole, "36 ohm", "eta_pto").value == of(found, "36 ohm", "eta_pto").value
    log = before / "r36ohm.csv"
    single = reduce(read_run(log, load=36.0), window=5.48)
    values = set()
    for side in (tmp_path / "out" / "runs" / "r36ohm.csv.json", log, single):
        one = compare(side, place / "after")
        assert [runs.label for runs in one.runs] == ["36 ohm"]
        assert [run.name for run in one.alone_b] == ["r9ohm.csv", "open_circuit.csv"]
        values.add(of(one, "36 ohm", "eta_pto").value)
    assert len(values) == 1


def test_results_of_an_earlier_version_can_be_compared(place: Path, tmp_path: Path) -> None:
    archive = Path(__file__).parents[1] / "reference" / "versions" / "0.1.0" / "results.tar.xz"
    shutil.unpack_archive(archive, tmp_path, filter="data")
    old = compare(tmp_path / "results", place / "after", same_sensors=True)
    assert [runs.label for runs in old.runs] == ["open circuit", "36 ohm"]
    assert {"idc", "vdc"} <= set(old.shared)


def changed(place: Path, target: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    """Change the JSON of a reduction."""
    record = json.loads(json.dumps(comparison_source(place)))
    change(record)
    target.write_text(json.dumps(record))
    return target


def comparison_source(place: Path) -> dict[str, Any]:
    done = winchcascade("reduce", place / "before" / "r36ohm.csv", "--json", "-")
    record: dict[str, Any] = json.loads(done.stdout)
    return record


def test_a_json_without_a_split_counts_its_gains_as_independent(
    place: Path, tmp_path: Path
) -> None:
    path = changed(place, tmp_path / "old.json", lambda record: record["uncertainty"].pop("budget"))
    old = compare(path, place / "after", same_sensors=True)
    assert "does not split" in messages(old, "shared_gains")
    assert of(old, "36 ohm", "eta_pto").interval is not None


def test_what_is_no_reduction_is_reported(place: Path, tmp_path: Path) -> None:
    for change, words in (
        (lambda record: record.update(schema="other/1"), "'other/1'"),
        (lambda record: record.update(cycles=3), "is no JSON of a reduction"),
        (lambda record: record["cycles"][0].pop("window"), "is no JSON of a reduction"),
    ):
        path = changed(place, tmp_path / "wrong.json", change)
        with pytest.raises(OptionError, match=words):
            compare(path, place / "after")


# --------------------------------------------------------------------------------------- matching
def test_repeats_of_a_load_are_pooled(place: Path, tmp_path: Path) -> None:
    folder = tmp_path / "repeats"
    shutil.copytree(place / "before", folder)
    shutil.copy(folder / "r36ohm.csv", folder / "again.csv")
    with (folder / "campaign.toml").open("a") as file:
        file.write('[[run]]\nfile = "again.csv"\nload_ohm = 36\nwindow_s = 5.48\n')
    pooled = compare(folder, place / "after")
    one = of(pooled, "36 ohm", "eta_pto")
    assert one.cycles == (6, 3)
    assert "2 logs of A are pooled" in messages(pooled, "pooled")


def without_loads(folder: Path, target: Path) -> Path:
    """Copy the logs of a campaign without its campaign file, so that their loads are unknown."""
    shutil.copytree(folder, target, ignore=shutil.ignore_patterns("campaign.toml"))
    return target


def test_logs_without_loads_are_matched_by_file_name(place: Path, tmp_path: Path) -> None:
    a, b = (without_loads(place / name, tmp_path / name) for name in ("before", "after"))
    (b / "r9ohm.csv").rename(b / "other.csv")
    by_name = compare(a, b)
    assert by_name.matched_by == "file"
    assert [runs.label for runs in by_name.runs] == ["open_circuit", "r36ohm"]
    assert [run.name for run in by_name.alone_a] == ["r9ohm.csv"]
    assert [run.name for run in by_name.alone_b] == ["other.csv"]


def test_two_single_logs_without_loads_belong_together(place: Path, tmp_path: Path) -> None:
    for side in ("before", "after"):
        shutil.copy(place / side / "r36ohm.csv", tmp_path / f"{side}.csv")
    only = compare(tmp_path / "before.csv", tmp_path / "after.csv")
    assert (only.matched_by, only.runs[0].label) == ("only_log", "before and after")


def test_nothing_in_common_is_one_sentence(place: Path, tmp_path: Path) -> None:
    done = winchcascade("compare", place / "before" / "r36ohm.csv", place / "before" / "r9ohm.csv")
    assert done.returncode == 2
    sentence = one_sentence(done.stderr)
    assert "r36ohm.csv has 36 ohm" in sentence
    assert "r9ohm.csv has 9 ohm" in sentence
    loose = without_loads(place / "before", tmp_path / "loose")
    with pytest.raises(CompareError, match=r"open_circuit \(no load\).*--load-ohm of reduce"):
        compare(loose, place / "after")


# ------------------------------------------------------------------------------------------ notes
def test_windows_that_differ_are_noted(place: Path, found: Comparison) -> None:
    plain = reduce(read_run(place / "after" / "r36ohm.csv"), window="auto")
    other = compare(place / "before", plain)
    assert "the windows of A are 5.48 s, those of B auto" in messages(other, "windows")
    assert messages(found, "windows") == ""


def test_cycles_of_other_sources_are_noted(place: Path, tmp_path: Path) -> None:
    path = changed(
        place, tmp_path / "waves.json", lambda record: record.update(cycles_from="waves")
    )
    waves = compare(path, place / "after")
    assert "the cycles of A come from waves, those of B from velocity" in messages(waves, "windows")
    assert "waves count as independent" in messages(waves, "repeatability")


def test_kinds_of_data_that_differ_are_noted(found: Comparison) -> None:
    assert "the logs of A are not stated, those of B measured" in messages(found, "data")


def test_a_simulated_log_has_no_errors_of_sensors(place: Path, tmp_path: Path) -> None:
    log = place / "before" / "r36ohm.csv"
    assert (
        winchcascade(
            "simulate", log, "--out", tmp_path / "simulated.csv", "--load-ohm", "36"
        ).returncode
        == 0
    )
    twin = reduce(read_run(tmp_path / "simulated.csv", load=36.0), window=5.48)
    both = compare(log, twin)
    one = of(both, "36 ohm", "eta_pto")
    measured = compare(log, log)
    assert one.sensors == pytest.approx(
        (of(measured, "36 ohm", "eta_pto").sensors or 0.0) / math.sqrt(2.0)
    )
    assert "a simulated log has no errors of sensors" in messages(both, "data")


def test_one_log_on_both_sides_is_noted(place: Path) -> None:
    log = place / "before" / "r36ohm.csv"
    assert "a log in common" in messages(compare(log, log), "same_log")


def test_motions_that_differ_are_noted(place: Path, tmp_path: Path) -> None:
    head, *rows = ((place / "before" / "r36ohm.csv").read_text()).splitlines()
    column = next(k for k, name in enumerate(head.split(",")) if "velocity" in name.lower())
    travel = next(k for k, name in enumerate(head.split(",")) if "displacement" in name.lower())
    cells = [row.split(",") for row in rows]
    for row in cells:
        for k in (column, travel):
            row[k] = f"{0.9 * float(row[k]):.5f}"
    (tmp_path / "slow.csv").write_text("\n".join([head, *map(",".join, cells)]) + "\n")
    slow = reduce(read_run(tmp_path / "slow.csv", load=36.0), window=5.48)
    assert "depend on the speed" in messages(compare(place / "before", slow), "motion")


def test_unknown_accuracies_leave_no_interval(place: Path, tmp_path: Path) -> None:
    (tmp_path / "bare.toml").write_text(
        'name = "bare"\n[winch]\nr_drum = { value = 0.13, unit = "m" }\n'
    )
    rig = read_rig(tmp_path / "bare.toml")
    bare = reduce(
        read_run(place / "after" / "r36ohm.csv", load=36.0, rig=rig), rig=rig, window=5.48
    )
    both = compare(place / "before", bare)
    assert of(both, "36 ohm", "eta_pto").interval is None
    assert "no interval of any metric for lack of an accuracy" in messages(both, "accuracy")
    assert "hsu2026" in messages(both, "rigs")
    assert drop_gate(both, 0.01).drops[0].verdict == "no_interval_beyond"


STAGES = """[cascade]
stages = ["line", "ours"]
[stage.ours]
power = "vdc * idc"
"""


def test_stages_of_another_bench_are_compared_too(place: Path, tmp_path: Path) -> None:
    text = Path("winchcascade/rigfiles/hsu2026.toml").read_text()
    (tmp_path / "own.toml").write_text(text + STAGES)
    rig = read_rig(tmp_path / "own.toml")
    a, b = (
        reduce(read_run(place / side / "r36ohm.csv", load=36.0, rig=rig), rig=rig, window=5.48)
        for side in ("before", "after")
    )
    own = compare(a, b, same_sensors=True)
    assert own.overall == "eta_line_ours"
    one = of(own, "36 ohm", "eta_line_ours")
    assert one.b / one.a == pytest.approx(FACTOR, abs=1e-4)
    assert one.sensors == pytest.approx(of(compare(place / "before" / "r36ohm.csv", place / "after" / "r36ohm.csv",
                                                   same_sensors=True), "36 ohm", "eta_pto").sensors)  # fmt: skip
    mixed = compare(a, place / "after")
    assert "the stages of A are line, ours, those of B line, mech, gen" in messages(mixed, "stages")
    assert mixed.runs[0].of("energy_line") is not None
    with pytest.raises(CompareError, match="efficiency of the whole cascade"):
        drop_gate(mixed, 0.01)


# -------------------------------------------------------------------------------------- the limit
def test_the_estimate_decides_and_the_interval_is_stated(found: Comparison) -> None:
    strict, loose = drop_gate(found, 0.01), drop_gate(found, 0.1)
    assert [drop.label for drop in strict.failed] == ["36 ohm", "9 ohm"]
    assert (strict.ok, loose.ok, strict.without) == (False, True, ("open circuit",))
    (one, _) = strict.drops
    assert one.value == pytest.approx(-of(found, "36 ohm", "eta_pto").value)
    near = drop_gate(found, one.value - 1e-4)
    assert near.drops[0].verdict == "beyond_uncertain"
    assert drop_gate(found, one.value).ok
    assert drop_gate(found, one.value + 1e-4).drops[0].verdict == "within_uncertain"
    assert drop_gate(found, 0.0).drops[0].verdict == "beyond"


def test_an_improvement_passes_any_limit(place: Path) -> None:
    back = drop_gate(compare(place / "after", place / "before"), 0.0)
    assert back.ok
    assert all(drop.value < 0.0 for drop in back.drops)


@pytest.mark.parametrize("limit", [-0.1, 1.0, math.nan, math.inf])
def test_a_limit_that_is_no_difference_of_efficiencies_is_rejected(
    found: Comparison, limit: float
) -> None:
    with pytest.raises(OptionError, match="one percentage point"):
        drop_gate(found, limit)


def test_the_command_exits_with_1_beyond_the_limit(place: Path, tmp_path: Path) -> None:
    sides = (place / "before", place / "after")
    done = winchcascade("compare", *sides, "--max-drop", "0.01", "--json", tmp_path / "c.json")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].split()[:2] == ["limit", "failed:"]
    quiet = winchcascade("compare", *sides, "--max-drop", "0.0276", "--quiet")
    rows = [line for line in quiet.stdout.splitlines() if line.startswith(("36 ohm", "9 ohm"))]
    assert (quiet.returncode, [row[:6] for row in rows]) == (1, ["36 ohm"])  # only what fails
    record = json.loads((tmp_path / "c.json").read_text())
    assert record["schema"] == "winchcascade/comparison/1"
    assert record["gate"]["ok"] is False
    assert winchcascade("compare", *sides, "--max-drop", "0.1").returncode == 0
    assert winchcascade("compare", *sides).returncode == 0
    done = winchcascade("compare", *sides, "--max-drop", "1")
    assert (done.returncode, "one percentage point" in one_sentence(done.stderr)) == (2, True)
    done = winchcascade("compare", *sides, "--json", place / "before" / "r36ohm.csv", "--force")
    assert (done.returncode, "is an input" in one_sentence(done.stderr)) == (2, True)


# ---------------------------------------------------------------------------------------- outputs
def test_the_json_holds_every_difference(found: Comparison) -> None:
    gate: Gate = drop_gate(found, 0.01)
    record = json.loads(json_bytes(comparison_record(found, gate)))
    assert (record["sensors"], record["matched_by"]) == ("independent", "load")
    run = record["runs"][1]
    assert (run["label"], run["load_ohm"], run["open_circuit"]) == ("36 ohm", 36.0, False)
    assert len(run["differences"]) == 14
    one = run["differences"]["eta_pto"]
    assert one["difference"] == pytest.approx(one["b"] - one["a"])
    assert one["interval_95"][0] < one["difference"] < one["interval_95"][1]
    assert one["standard_uncertainty"] == pytest.approx(
        math.hypot(one["sensors"], one["repeatability"])
    )
    assert record["runs"][0]["differences"]["eta_pto"] is None
    assert (record["runs"][0]["load_ohm"], record["runs"][0]["a"][0]["load_ohm"]) == (None, None)
    assert set(record["gate"]["drops"][0]) == {
        "label",
        "load_ohm",
        "drop",
        "interval_95",
        "verdict",
    }
    assert all(set(note) == {"kind", "message", "runs", "details"} for note in record["notes"])
    assert record["gate"]["drops"][0]["drop"] == pytest.approx(-one["difference"])


def tables(comparison: Comparison, gate: Gate | None = None) -> dict[str, Table[Any]]:
    """Tables of the report of a comparison by their names."""
    blocks = comparison_report(comparison, gate).blocks
    return {block.id: block for block in blocks if isinstance(block, Table)}


def test_the_report_states_each_difference_once_with_its_digits(place: Path) -> None:
    single = compare(place / "before" / "r36ohm.csv", place / "after")
    stated = tables(single, drop_gate(single, 0.01))
    frame = stated["efficiencies-differences"].frame().set_index("metric")
    one = of(single, "36 ohm", "eta_pto")
    assert (frame["B - A"]["eta_pto"], frame["95 % interval, low"]["eta_pto"]) == (
        one.value,
        (one.interval or (0.0,))[0],
    )
    assert frame["B/A - 1 (%)"]["eta_pto"] == pytest.approx(100.0 * (FACTOR - 1.0), abs=0.01)
    assert list(frame["excludes 0"]) == ["no", "yes", "yes", "yes"]
    assert stated["limit"].frame()["outcome"].tolist() == ["failed"]
    assert len(stated["logs"].items) == 4
    named = {m: len(stated[f"{m}-differences"].items) for m in ("energies", "whole-cycles")}
    assert named == {"energies": 3, "whole-cycles": 4}


def test_an_interval_beyond_zero_is_never_rounded_to_zero(found: Comparison) -> None:
    one = replace(of(found, "36 ohm", "eta_pto"), uncertainty=0.0052, interval=(-0.06, -0.00001))
    runs = tuple(replace(runs, differences=(one,)) for runs in found.runs if runs.label == "36 ohm")
    (row,) = tables(replace(found, runs=runs))["efficiencies-differences"].texts
    assert row[6] == "-0.06000 to -0.00001"


def test_every_run_without_a_partner_is_stated(place: Path, tmp_path: Path) -> None:
    done = winchcascade(
        "compare", place / "before" / "r36ohm.csv", place / "after", "--tables", tmp_path / "t"
    )
    assert all(name in done.stdout for name in ("r9ohm.csv", "open_circuit.csv"))
    assert max(map(len, done.stdout.splitlines())) <= 100
    assert len(list((tmp_path / "t").glob("comparison_*.csv"))) == 4


def test_frame_plot_and_table_of_a_notebook(found: Comparison) -> None:
    frame = found.to_pandas()
    assert len(frame) == sum(len(runs.differences) for runs in found.runs)
    row = frame[(frame["run"] == "36 ohm") & (frame["metric"] == "eta_pto")].iloc[0]
    one = of(found, "36 ohm", "eta_pto")
    assert (row["difference"], row["low_95"]) == (one.value, (one.interval or (0.0,))[0])
    assert len(found.plot("differences").figure.axes) == 3
    assert "after compared with before" in found._repr_html_()
    assert "Comparison(" in repr(found)


def test_page_and_pdf(found: Comparison, place: Path, tmp_path: Path) -> None:
    with undrawn():
        page = write_report(found, tmp_path / "c.html").read_text()
    assert page.count("<table") == len(tables(found))
    command = (
        "compare",
        place / "before",
        place / "after",
        "--max-drop",
        "0.01",
        "--html",
        tmp_path / "d.html",
    )
    with undrawn():
        done = winchcascade(*command, "--pdf", tmp_path / "d.pdf")
    assert done.returncode == 1
    assert 'id="table-limit"' in (tmp_path / "d.html").read_text()
    assert (tmp_path / "d.pdf").read_bytes().startswith(b"%PDF-")
    with undrawn():
        assert winchcascade(*command).returncode == 1  # over its own page


def test_names_from_files_are_escaped_on_a_page(place: Path, tmp_path: Path) -> None:
    folder = tmp_path / "<b>&amp;"
    shutil.copytree(place / "after", folder)
    page = write_report(compare(place / "before", folder), tmp_path / "c.html").read_text()
    assert "<b>&amp;" not in page.partition("<main>")[2].replace("<b>Figure", "").replace(
        "<b>Table", ""
    )


def test_a_dollar_in_a_name_is_drawn_as_it_is(found: Comparison) -> None:
    runs = tuple(replace(run, label=rf"a${k}\frac$", load=None) for k, run in enumerate(found.runs))
    (figure,) = [
        block.figure
        for block in comparison_report(replace(found, runs=runs)).blocks
        if isinstance(block, Picture)
    ]
    assert figure is not None
    figure.draw_without_rendering()
    assert [label.get_text() for label in figure.axes[-1].get_xticklabels()] == [
        run.label for run in reversed(runs)
    ]
