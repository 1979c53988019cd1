import json
import math
import re
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest

from winchcascade.core.table_toml import load_table
from winchcascade.report.audit_text import audit_record, audit_text
from winchcascade.report.check_report import check_record, check_text, github_annotations, junit_xml
from winchcascade.tables.audit import audit_by_load as audit
from winchcascade.tables.check import Check, Factors, Measured, check

TABLE = load_table("hsu2026-table2")
NASTY = 'a<b>&"c"\x1b[31m,50%:\n].csv'


def measured(load: float, name: str, factor: float = 1.0) -> Measured:
    row = TABLE.row(load)
    assert row is not None
    mean: dict[str, float | None] = {metric: factor * value for metric, value in row.cells.items()}
    return Measured(name, load, mean, dict.fromkeys(mean, 1.0), {m: 0.001 * (v or 0.0) for m, v in mean.items()})


@pytest.fixture
def found() -> Check:
    """One log that agrees, one that is 10 % off, one that measured nothing at the shaft, and rows without a run."""
    blind = measured(27.0, "blind.csv")
    mean = {metric: None if "mech" in metric else value for metric, value in blind.mean.items()}
    return check(
        [measured(45.0, "good.csv"), measured(36.0, NASTY, 1.1), Measured("blind.csv", 27.0, mean, {}, {})], TABLE
    )


def test_every_cell_shows_its_tolerance_as_the_sum_of_its_parts(found: Check) -> None:
    rows = re.findall(
        r"^ {2}\w+ +[\d.]+(?: \w)? .* ([\d.]+) += ([\d.]+) +\+ ([\d.]+) +\+ ([\d.]+)  ", check_text(found), re.M
    )
    assert len(rows) == 25
    for total, *parts in rows:
        assert float(total) == pytest.approx(sum(map(float, parts)), rel=0.02, abs=0.06)


def test_the_text_of_a_check_says_what_misses_and_sums_up(found: Check) -> None:
    text = check_text(found)
    assert text.count("MISS by") == 9
    assert len(re.findall(r"_mech .* none +MISS$", text, re.M)) == 2
    assert "18 ohm: no run" in text
    assert "16 of 54 cells agree; 9 differ, 2 not measured, 27 without a run" in text
    assert "note: blind.csv: the standard uncertainty is not known; it counts as 0." in text
    assert "\x1b" not in text


def test_no_line_is_longer_than_100_columns(found: Check) -> None:
    for text in (check_text(found), audit_text(audit(TABLE))):
        assert max(map(len, text.splitlines())) <= 100


def test_factors_other_than_one_are_shown() -> None:
    text = check_text(check([measured(45.0, "a")], TABLE, Factors(deviation=0.5), whole_campaign=False))
    assert "0.5 x largest deviation of the cycles" in text
    assert "all 9 cells agree" in text


def test_the_text_of_an_audit_holds_findings_claims_and_windows() -> None:
    text = " ".join(audit_text(audit(TABLE)).split())
    for words in (
        "27 ohm, eta_pto: 0.707 is printed",
        "A change of one cell makes the row consistent: eta_pto 0.708, or energy_line 8621 to 8623 J.",
        "the text states 982 W, but the table prints 903 W",
        "69 % is eta_pto, gen out of line",
        "45 ohm, 36 ohm can share one window: 5.4790 to 5.4817 s, such as 5.48 s",
        "found: 1 contradiction between cells, 2 contradicted claims",
    ):
        assert words in text


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
    errors = [line for line in github_annotations(found, TABLE.path).splitlines() if line.startswith("::error")]
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
    found = check([good, msgspec.structs.replace(bad, findings=tuple(words))], TABLE, whole_campaign=False)
    head, _, tail = check_text(found).partition("\n36 ohm: bad.csv\n")
    assert "findings in this log" not in head
    assert "  findings in this log: 7\n  ! stuck: torque holds 0 N.m, 100% of::it \n" in tail.replace("it\n", "it \n")
    assert tail.count("  ! stuck") == 5
    assert "... 2 more, all in --json" in tail
    root = ElementTree.fromstring(junit_xml(found))
    with_output = [case.get("classname") for case in root.iter("testcase") if case.find("system-out") is not None]
    assert set(with_output) == {"hsu2026-table2.36_ohm"}
    assert len(with_output) == 9
    (warning,) = [line for line in github_annotations(found, TABLE.path).splitlines() if line.startswith("::warning")]
    match = re.fullmatch(r"::warning file=.*,line=(\d+),title=36 ohm findings::findings in this log: 7%0A(.*)", warning)
    assert match is not None
    assert "load_ohm = 36" in "".join(Path(TABLE.path).read_text().splitlines()[int(match[1]) - 1 : int(match[1]) + 1])
    assert "100%25 of" in match[2]
    assert check_record(found)["findings"] == [{"load_ohm": 36.0, "open_circuit": False, "findings": words}]


def test_the_record_of_a_check_is_plain_json(found: Check) -> None:
    record = json.loads(json.dumps(check_record(found), allow_nan=False))
    assert record["schema"] == "winchcascade/check/1"
    assert record["ok"] is False
    assert record["misses"] == 38
    cell = record["cells"][0]
    assert cell["tolerance"]["total"] == sum(cell["tolerance"][p] for p in ("rounding", "deviation", "uncertainty"))


def test_the_record_of_an_audit_is_plain_json() -> None:
    record = json.loads(json.dumps(audit_record(audit(TABLE)), allow_nan=False))
    assert record["schema"] == "winchcascade/audit/1"
    assert record["ok"] is False
    (item,) = record["contradictions"]
    assert (item["load_ohm"], item["metric"], item["cells"]) == (
        27.0,
        "eta_pto",
        ["energy_line", "energy_gen", "eta_pto"],
    )
    assert [claim["verdict"] for claim in record["claims"]].count("contradicted") == 2
    assert [group["shortest_s"] for group in record["shared_windows"]] == [5.48, 5.96]
    assert all(math.isfinite(w["window_s"][0]) for w in record["windows"])
