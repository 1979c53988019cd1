import math
from pathlib import Path

import pytest
from loops import rejections

from winchcascade.core.published_table import (
    BUILT_IN,
    DIMENSIONS,
    PublishedTable,
    Span,
    TableError,
    load_table,
    parse_table,
)
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
    value, share, largest = parse_table(text, "t.toml").claims
    assert [claim.kind for claim in (value, share, largest)] == ["value", "part", "loads"]
    assert value.column.span(value.number) == Span(1950.0, 2050.0)
    assert (share.part, share.of) == ("energy_gen", "energy_line")
    assert largest.loads == (18.0, math.inf)


def test_a_row_of_sums_stands_apart() -> None:
    table = parse_table(HEAD + ROW + "[[row]]\ntotal = true\nenergy_line = 11.74\n", "t.toml")
    assert len(table.rows) == 1
    assert table.total is not None
    assert table.total.cells == {"energy_line": 11.74}


WRONG = """
[columns] -> [columns @ TOML
title = "A table" -> @ title missing
title = "A table" -> title = "A table"; colour = 1 @ colour columns
title = "A table" -> title = "A table"; cycles = 3.0 @ cycles 3.0 whole
energy_line = { unit = "kJ", decimals = 2 } -> @ row 1 energy_line [columns]
power_line = { -> power_drum = { @ [columns] power_drum power_line
unit = "W" -> unit = "J" @ [columns] power_line 'J' power
unit = "kJ" -> unit = "BTU" @ [columns] energy_line 'BTU'
{ unit = "%", decimals = 1 } -> "%" @ columns eta_trans '%' table
[columns] -> [columns]; load_ohm = { unit = "mohm", decimals = 0 } @ [columns] load_ohm 'mohm' resistance
11.74 -> "11,74" @ row 1 energy_line '11,74'
11.74 -> 11.738 @ row 1 energy_line 11.738 2
load_ohm = 18.0 -> @ row 1 load_ohm
eta_trans = 94.4 -> eta = 94.4 @ row 1 eta eta_gen
"""
"""Changes of a table that make it unusable, and words of the sentence."""


def test_a_wrong_entry_is_one_sentence_with_its_place() -> None:
    def read(change: str, where: str) -> object:
        old, _, new = change.partition(" ->")
        assert (HEAD + ROW).count(old) == 1
        return parse_table((HEAD + ROW).replace(old, new.strip()), where)

    assert rejections(read, TableError, WRONG) == []


NOT_TOGETHER = """
HEAD @ row missing
title = "a";source = "b"; ROW @ columns missing
HEAD ROW ROW @ 18 two rows
HEAD [[row]];load_ohm = 1 @ row 1 cells
HEAD ROW [[row]];total = 1;energy_line = 1.0 @ row 2 total 1
HEAD ROW [[row]];total = true;energy_line = 1.0;eta_trans = 1.0 @ row 2 energies
HEAD ROW SUMS SUMS @ one sums
HEAD ROW CLAIM @ claim 1 part value
HEAD ROW CLAIM value = 1; VALUE @ claim 1 metrics
HEAD ROW CLAIM value = 1;metric = "eta_pto";unit = "W";decimals = 0 @ claim 1 'W' number
HEAD ROW CLAIM value = 1;load_ohm = 1;part = "energy_line";of = "energy_gen"; VALUE @ claim 1 energy_line energy_gen
HEAD ROW CLAIM at_most = 1;at_least = 1; VALUE @ claim 1 at_least
HEAD ROW CLAIM metric = "eta_pto";largest_at_ohm = "18" @ claim 1 largest_at_ohm '18'
HEAD ROW CLAIM metric = "eta_pto";rises_from_ohm = 1;to_ohm = 1 @ claim 1 rises_from_ohm to_ohm
"""


def test_a_table_that_does_not_hold_together_is_one_sentence() -> None:
    parts = {"HEAD": HEAD, "ROW": ROW, "CLAIM": CLAIM, "VALUE": 'unit = "1"\ndecimals = 0\n'}
    parts["SUMS"] = "[[row]]\ntotal = true\nenergy_line = 1.0\n"

    def read(text: str, where: str) -> object:
        for name, part in parts.items():
            text = text.replace(f"{name} ", part).removesuffix(name) + (part if text.endswith(name) else "")
        return parse_table(text, where)

    assert rejections(read, TableError, NOT_TOGETHER) == []


def test_a_table_that_is_not_there_is_reported() -> None:
    with pytest.raises(TableError, match=r"'no.toml': .* hsu2026-table2"):
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
