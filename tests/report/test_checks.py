import re
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pandas as pd
import pytest

from winchcascade.report.content import Report, Table
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.checks import (
    check_record,
    check_report,
    github_annotations,
    junit_xml,
)
from winchcascade.tables.check import Check, check
from winchcascade.tables.measured import Measured
from winchcascade.tables.table_file import load_table

TABLE = load_table("hsu2026-table2")
NASTY = 'a<b>&"c"\x1b[31m,50%:\n].csv'


def measured(load: float, name: str, factor: float = 1.0) -> Measured:
    row = TABLE.row(load)
    assert row is not None
    mean = {
        metric: factor * cell.value for metric, cell in row.cells.items() if metric != "load_ohm"
    }
    values: dict[str, float | None] = {"load": load, **mean}
    return Measured(
        name, name, values, dict.fromkeys(mean, 1.0), {m: 0.001 * v for m, v in mean.items()}
    )


@pytest.fixture
def found() -> Check:
    """One log that agrees, one that is 10 % off, one that measured nothing at the shaft, and
    rows without a run.
    """
    blind = measured(27.0, "blind.csv")
    values = {metric: None if "mech" in metric else value for metric, value in blind.values.items()}
    results = [
        measured(45.0, "good.csv"),
        measured(36.0, NASTY, 1.1),
        Measured("blind.csv", "blind.csv", values),
    ]
    return check(results, TABLE)


def frames(report: Report) -> dict[str, pd.DataFrame]:
    return {block.id: block.frame() for block in report.blocks if isinstance(block, Table)}


def test_what_a_cell_allows_is_the_sum_of_its_parts(found: Check) -> None:
    tables = frames(check_report(found))
    cells = pd.concat([tables[name] for name in ("cells", "agreeing")]).dropna(subset=["found"])
    assert len(cells) == 25
    assert (
        cells[["rounding", "deviation", "2 u"]].sum(axis=1) - cells["allowed"]
    ).abs().max() < 1e-9


def test_a_report_folds_the_cells_that_agree_behind_those_that_do_not(found: Check) -> None:
    report = check_report(found)
    tables = frames(report)
    outcomes = list(tables["cells"]["outcome"])
    assert {one: outcomes.count(one) for one in set(outcomes)} == {
        "differs": 9, "not measured": 2, "no run": 27
    }  # fmt: skip
    assert len(tables["agreeing"]) == 16
    folded = {one.id: one.folded for one in report.sections}
    assert (folded["cells"], folded["agreeing"]) == (False, True)
    assert terminal_text(report).count("good.csv") == 0
    assert [tile.value for tile in check_report(found).tiles] == ["16", "9", "29"]


def test_junit_has_a_case_for_every_cell_and_a_failure_for_every_miss(found: Check) -> None:
    root = ElementTree.fromstring(junit_xml(found))
    cases = root.findall("./testsuite/testcase")
    assert len(cases) == len(found.cells) == int(root.get("tests", ""))
    assert len({(case.get("classname"), case.get("name")) for case in cases}) == len(cases)
    failures = root.findall("./testsuite/testcase/failure")
    assert len(failures) == len(found.misses) == int(root.get("failures", ""))
    assert {failure.get("type") for failure in failures} == {"miss", "not_measured", "no_run"}
    assert 'a<b>&"c"' in (failures[0].get("message") or "")


def test_annotations_point_at_the_cell_in_the_table_file(found: Check) -> None:
    lines = Path(TABLE.path).read_text().splitlines()
    errors = [
        line
        for line in github_annotations(found, TABLE.path).splitlines()
        if line.startswith("::error")
    ]
    assert len(errors) == len(found.misses)
    for line, cell in zip(errors, found.misses, strict=True):
        match = re.fullmatch(r"::error file=(.*),line=(\d+),title=([^,:]*)::(.*)", line)
        assert match is not None
        assert lines[int(match[2]) - 1].split(" = ")[0] == cell.metric
        assert match[3].endswith(cell.metric)


def test_an_annotation_escapes_what_would_end_it(found: Check) -> None:
    text = github_annotations(found, "odd,50%:name.toml")
    assert "file=odd%2C50%25%3Aname.toml,line=" in text
    assert "50%25" in text.partition("\n")[0].rpartition("::")[2]
    assert all(line.startswith("::") for line in text.splitlines())


def test_findings_of_a_log_are_beside_its_cells_wherever_a_check_is_shown() -> None:
    words = [f"stuck: torque holds {k} N.m, 100% of::it\n" for k in range(7)]
    good, bad = measured(45.0, "good.csv"), measured(36.0, "bad.csv")
    found = check(
        [good, msgspec.structs.replace(bad, findings=tuple(words))], TABLE, whole_campaign=False
    )
    listed = frames(check_report(found))["findings"]
    assert list(listed.iloc[:, 0]) == ["36 ohm"] * 7
    root = ElementTree.fromstring(junit_xml(found))
    with_output = [
        case.get("classname")
        for case in root.iter("testcase")
        if case.find("system-out") is not None
    ]
    assert set(with_output) == {"hsu2026-table2.36_ohm"}
    assert len(with_output) == 9
    (warning,) = [
        line
        for line in github_annotations(found, TABLE.path).splitlines()
        if line.startswith("::warning")
    ]
    match = re.fullmatch(
        r"::warning file=.*,line=(\d+),title=36 ohm findings::findings in this log: 7%0A(.*)",
        warning,
    )
    assert match is not None
    assert "load_ohm = 36" in "".join(
        Path(TABLE.path).read_text().splitlines()[int(match[1]) - 1 : int(match[1]) + 1]
    )
    assert "100%25 of" in match[2]
    assert check_record(found)["findings"] == [
        {"load_ohm": 36.0, "open_circuit": False, "findings": words}
    ]
