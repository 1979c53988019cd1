import math
from pathlib import Path

import pytest

from winchcascade.core.published_table import (
    DIMENSIONS,
    LargestClaim,
    PublishedTable,
    ShareClaim,
    Span,
    TableError,
    ValueClaim,
)
from winchcascade.core.table_toml import BUILT_IN, load_table, parse_table
from winchcascade.reduction.efficiency import METRICS

HEAD = """
title = "A table"
source = "Somebody 2026"
[columns]
energy_line = { unit = "kJ", decimals = 2 }
power_line = { unit = "W", decimals = -1 }
eta_trans = { unit = "%", decimals = 1 }
"""
ROW = """
[[row]]
load_ohm = 18.0
energy_line = 11.74
power_line = 1970
eta_trans = 94.4
"""
CLAIM = """
[[claim]]
says = "so"
where = "there"
"""


def test_the_metrics_of_a_table_are_those_of_a_reduction() -> None:
    assert tuple(DIMENSIONS) == METRICS


def test_a_printed_cell_stands_for_every_value_that_rounds_to_it() -> None:
    table = parse_table(HEAD + ROW, "t.toml")
    spans = table.spans(table.rows[0])
    for metric, low, high in (
        ("energy_line", 11735.0, 11745.0),
        ("power_line", 1965.0, 1975.0),
        ("eta_trans", 0.9435, 0.9445),
    ):
        assert (spans[metric].low, spans[metric].high) == pytest.approx((low, high), rel=1e-12)


def test_the_built_in_table_prints_six_rows_of_nine_cells() -> None:
    table = load_table("hsu2026-table2")
    assert [row.load for row in table.rows] == [45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    assert all(tuple(row.cells) == METRICS for row in table.rows)
    assert table.cycles == 3
    assert {name: value for name, (value, _) in table.deviations.items()} == {
        "deviation_energy": 18.0,
        "deviation_eta": 2.5,
    }


@pytest.mark.parametrize(
    ("load", "cells"),
    [
        (45.0, (5937, 5222, 3988, 1083, 953, 728, 0.879, 0.763, 0.671)),
        (36.0, (7123, 6407, 4947, 1300, 1169, 903, 0.898, 0.771, 0.693)),
        (27.0, (8616, 7898, 6119, 1446, 1325, 1027, 0.915, 0.773, 0.707)),
        (18.0, (11738, 11080, 8576, 1969, 1859, 1439, 0.944, 0.774, 0.730)),
        (9.0, (7621, 7275, 5311, 1279, 1221, 891, 0.955, 0.730, 0.697)),
        (4.5, (4820, 4618, 2898, 809, 775, 486, 0.958, 0.627, 0.600)),
    ],
)
def test_the_built_in_table_is_as_printed(load: float, cells: tuple[float, ...]) -> None:
    row = load_table("hsu2026-table2").row(load)
    assert row is not None
    assert tuple(row.cells.values()) == cells


def test_every_built_in_table_is_read() -> None:
    assert all(load_table(name).claims for name in BUILT_IN)


def test_a_cell_knows_its_line_in_the_file() -> None:
    table = load_table("hsu2026-table2")
    lines = Path(table.path).read_text().splitlines()
    for row in table.rows:
        assert lines[row.lines[""] - 1] == "[[row]]"
        for metric in row.cells:
            assert lines[row.lines[metric] - 1].startswith(f"{metric} = ")
    assert all(claim.line is not None and lines[claim.line - 1] == "[[claim]]" for claim in table.claims)


def test_a_file_is_taken_before_a_built_in_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hsu2026-table2").write_text(HEAD + ROW)
    assert load_table("hsu2026-table2").title == "A table"


def test_claims_are_read_by_the_key_that_shows_their_kind() -> None:
    text = HEAD + ROW
    text += CLAIM + 'metric = "power_line"\nload_ohm = 18\nvalue = 2.0\nunit = "kW"\ndecimals = 1\n'
    text += CLAIM + 'part = "energy_gen"\nof = "energy_line"\nload_ohm = 18\nvalue = 73\nunit = "%"\ndecimals = 0\n'
    text += CLAIM + 'metric = "eta_trans"\nlargest_at_ohm = [18, inf]\n'
    value, share, largest = (claim.statement for claim in parse_table(text, "t.toml").claims)
    assert isinstance(value, ValueClaim)
    assert value.column.span(value.value) == Span(1950.0, 2050.0)
    assert isinstance(share, ShareClaim)
    assert (share.part, share.of) == ("energy_gen", "energy_line")
    assert isinstance(largest, LargestClaim)
    assert largest.loads == (18.0, math.inf)


def test_a_row_of_sums_stands_apart() -> None:
    table = parse_table(HEAD + ROW + "[[row]]\ntotal = true\nenergy_line = 11.74\n", "t.toml")
    assert len(table.rows) == 1
    assert table.total is not None
    assert table.total.cells == {"energy_line": 11.74}


def says(text: str) -> str:
    with pytest.raises(TableError) as fault:
        parse_table(text, "t.toml")
    sentence = str(fault.value)
    assert sentence.startswith("t.toml")
    assert "\n" not in sentence
    return sentence


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[columns]", "[columns", "not a valid TOML file"),
        ('title = "A table"', "", "title is missing; expected a text"),
        (
            'title = "A table"',
            'title = "A table"\ncolour = 1',
            "colour is no entry here; expected claim, columns, cycles",
        ),
        ('title = "A table"', 'title = "A table"\ncycles = 0', "cycles is 0; expected the number of cycles"),
        ('title = "A table"', 'title = "A table"\ncycles = 3.0', "cycles is 3.0; expected the number of cycles"),
        ('title = "A table"', 'title = "A table"\ndeviation_eta_percent = 180', "is 180; expected percent of the mean"),
        (
            'title = "A table"',
            'title = "A table"\ndeviation_eta_percent = "2 %"',
            "deviation_eta_percent is '2 %'; expected a",
        ),
        ('energy_line = { unit = "kJ", decimals = 2 }', "", "row 1: energy_line has no entry under [columns]"),
        ("power_line = {", "power_drum = {", "[columns]: power_drum is no entry here; expected energy_gen"),
        (
            'unit = "W"',
            'unit = "J"',
            "[columns] power_line: the unit 'J' is none of power; expected one such as W or kW",
        ),
        ('unit = "kJ"', 'unit = "BTU"', "[columns] energy_line: the unit 'BTU' is none of energy"),
        ('unit = "%"', "unit = 1", "[columns] eta_trans: the unit 1 is none of number"),
        ('{ unit = "%", decimals = 1 }', '"%"', "[columns] eta_trans is '%'; expected {"),
        ("decimals = 1 }", "decimals = 1.5 }", "eta_trans: decimals is 1.5; expected how many are printed"),
        ("decimals = 1 }", "decimals = 1, digits = 3 }", "eta_trans: digits is no entry here; expected decimals, unit"),
        ("[columns]", '[columns]\nload_ohm = { unit = "mohm", decimals = 0 }', "the unit is 'mohm'; expected ohm"),
        ("11.74", '"11,74"', "row 1: energy_line is '11,74'; expected a number without quotes"),
        ("11.74", "nan", "row 1: energy_line is nan; expected a finite number"),
        ("11.74", "-11.74", "row 1: energy_line is -11.74; expected a finite number that is not negative"),
        ("11.74", "true", "row 1: energy_line is True; expected a number"),
        ("11.74", "1e17", "row 1: energy_line is 1e+17; expected less than"),
        ("11.74", "11.738", "row 1: energy_line is 11.738, but 2 decimals are said to be printed"),
        ("1970", "1969", "row 1: power_line is 1969, but -1 decimals are said to be printed"),
        ("load_ohm = 18.0", "", "row 1: load_ohm is missing; expected ohms above 0, or inf"),
        ("load_ohm = 18.0", "load_ohm = 0", "row 1: load_ohm is 0; expected ohms above 0"),
        ("load_ohm = 18.0", "load_ohm = nan", "row 1: load_ohm is nan; expected ohms above 0"),
        ("eta_trans = 94.4", "eta = 94.4", "row 1: eta is no entry here; expected energy_gen"),
        ("[[row]]", "[row]", "row is {"),
    ],
)
def test_a_wrong_entry_is_one_sentence_with_its_place(old: str, new: str, sentence: str) -> None:
    text = HEAD + ROW
    assert text.count(old) == 1
    assert sentence in says(text.replace(old, new))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (HEAD, "no rows; expected a [[row]] table"),
        ('title = "a"\nsource = "b"\n' + ROW, "no columns; expected [columns]"),
        (HEAD + ROW + ROW, "row 2: 18 ohm has a row already"),
        (HEAD + "[[row]]\nload_ohm = 1\n", "row 1: no cells; expected some of"),
        (HEAD + ROW + "[[row]]\ntotal = 1\nenergy_line = 1.0\n", "row 2: total = 1 in a row of sums"),
        (HEAD + ROW + "[[row]]\ntotal = true\nenergy_line = 1.0\neta_trans = 1.0\n", "row 2: eta_trans in a row of sums"),
        (HEAD + ROW + "[[row]]\ntotal = true\nenergy_line = 1.0\n" * 2, "row 3: a second row has total = true"),
        (HEAD + ROW + CLAIM, "claim 1: nothing claimed; expected one of part, value"),
        (HEAD + ROW + CLAIM + "value = 1\n", "claim 1: metric is missing; expected one of energy_line"),
        (HEAD + ROW + CLAIM + 'value = 1\nmetric = "eta_pto"\ncolour = 1\n', "claim 1: colour is no entry here"),
        (HEAD + ROW + CLAIM + 'value = 1\nmetric = "eta_pto"\nunit = "W"\n', "claim 1: the unit 'W' is none of number"),
        (HEAD + ROW + CLAIM + 'part = "energy_line"\nof = "energy_gen"\n', "claim 1: part is energy_line and of is energy_gen"),
        (HEAD + ROW + CLAIM + 'part = "energy_gen"\nof = "power_line"\n', "expected energies or powers, part behind of"),
        (HEAD + ROW + CLAIM + "at_most = 1\nat_least = 1\n", "claim 1: at_most and at_least together"),
        (HEAD + ROW + CLAIM + 'metric = "eta_pto"\nlargest_at_ohm = "18"\n', "claim 1: largest_at_ohm is '18'; expected ohms"),
        (HEAD + ROW + CLAIM + 'metric = "eta_pto"\nrises_from_ohm = 1\nto_ohm = 1\n', "rises_from_ohm and to_ohm are both"),
        ('claim = 1\n' + HEAD + ROW, "claim is 1; expected [[claim]] tables"),
    ],
)  # fmt: skip
def test_a_table_that_does_not_hold_together_is_one_sentence(text: str, sentence: str) -> None:
    assert sentence in says(text)


def test_a_table_that_is_not_there_is_reported() -> None:
    with pytest.raises(
        TableError, match=r"'no.toml': no such file and no built-in table of that name; give .* hsu2026-table2"
    ):
        load_table("no.toml")


def test_a_table_that_is_no_text_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "table.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(TableError, match="no UTF-8 text"):
        load_table(path)


def test_a_load_finds_its_row() -> None:
    table: PublishedTable = parse_table(HEAD + ROW, "t.toml")
    assert table.row(18) is table.rows[0]
    assert table.row(17.9) is None
