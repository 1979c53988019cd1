"""Files of published tables: what a cell stands for, both shapes of rows, and what is rejected
with one sentence.
"""

import math
from pathlib import Path

import pytest
from loops import rejections

from winchcascade.reduction.efficiency import METRICS
from winchcascade.tables.published_table import Span, TableError
from winchcascade.tables.table_file import BUILT_IN, load_table, parse_table

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
POINTS = """
title = "Points"
source = "Somebody 2026"
key = ["torque", "run"]
[columns]
torque = { unit = "gf.cm", digits = 3 }
run = { measured = "file" }
force = { unit = "gf" }
pull = { unit = "g" }
[[point]]
torque = 33
run = "run_7.csv"
force = "10.0"
pull = 10
"""
PRINTED = {
    45.0: (5937, 5222, 3988, 1083, 953, 728, 0.879, 0.763, 0.671),
    36.0: (7123, 6407, 4947, 1300, 1169, 903, 0.898, 0.771, 0.693),
    27.0: (8616, 7898, 6119, 1446, 1325, 1027, 0.915, 0.773, 0.707),
    18.0: (11738, 11080, 8576, 1969, 1859, 1439, 0.944, 0.774, 0.730),
    9.0: (7621, 7275, 5311, 1279, 1221, 891, 0.955, 0.730, 0.697),
    4.5: (4820, 4618, 2898, 809, 775, 486, 0.958, 0.627, 0.600),
}
"""Table 2 of the paper, by load."""


def test_the_built_in_table_is_as_printed_and_knows_its_lines() -> None:
    assert BUILT_IN == ("hsu2026-table2",)
    table = load_table("hsu2026-table2")
    lines = Path(table.path).read_text().splitlines()
    assert {row.load: tuple(row.cells[m].value for m in METRICS) for row in table.rows} == PRINTED
    assert (table.cycles, {n: d.words for n, d in table.deviations.items()}) == (
        3, {"deviation_energy": "18 %", "deviation_eta": "2.5 %"},
    )  # fmt: skip
    for row in table.rows:
        assert lines[(row.line or 0) - 1] == "[[row]]"
        for name, cell in row.cells.items():
            assert lines[(cell.line or 0) - 1].startswith(f"{name} = ")
    assert all(lines[(claim.line or 0) - 1] == "[[claim]]" for claim in table.claims)
    assert (table.row(18), table.row(17.9)) == (table.rows[3], None)


def test_a_printed_cell_stands_for_every_value_that_rounds_to_it() -> None:
    (row,) = parse_table(HEAD + ROW, "t.toml").rows
    for metric, low, high in (
        ("energy_line", 11735.0, 11745.0),
        ("power_line", 1965.0, 1975.0),
        ("eta_trans", 0.9435, 0.9445),
    ):
        assert (row.spans[metric].low, row.spans[metric].high) == pytest.approx(
            (low, high), rel=1e-12
        )


def test_points_are_read_with_units_of_grams_and_the_digits_of_each_cell(tmp_path: Path) -> None:
    (row,) = parse_table(POINTS, "t.toml").rows
    assert (row.load, row.line, row.cells["run"].text) == (None, 10, "run_7.csv")
    assert [row.cells[name].rounding for name in ("torque", "force", "pull")] == [0.05, 0.05, 0.5]
    assert row.cells["force"].span.high == pytest.approx(10.05 * 9.80665e-3)
    assert row.cells["pull"].factor == row.cells["force"].factor
    assert row.name == "torque 33 gf.cm, run run_7.csv"
    heads = POINTS.partition("[[point]]")[0].replace('key = ["torque", "run"]', 'csv = "t.csv"')
    (tmp_path / "t.csv").write_bytes(
        "torque;run;force;pull\n33,0;7;1e3;n/a\n\n5;8;x;2\n".encode("utf-16")
    )
    (tmp_path / "t.toml").write_text(heads)
    table = load_table(tmp_path / "t.toml")
    first, second = table.rows
    assert (first.cells["torque"].text, first.cells["torque"].value, "pull" in first.cells) == (
        "33,0",
        33.0,
        False,
    )
    assert first.cells["force"].rounding == 500.0
    assert (second.name, table.unread) == ("row 2", ("row 2 force 'x'",))


def test_claims_are_read_by_the_key_that_shows_their_kind() -> None:
    text = HEAD + ROW
    text += CLAIM + 'metric = "power_line"\nload_ohm = 18\nvalue = 2.0\nunit = "kW"\ndecimals = 1\n'
    text += (
        CLAIM
        + 'part = "energy_gen"\nof = "energy_line"\nload_ohm = 18\nvalue = 73\nunit = "%"\ndecimals = 0\n'
    )
    text += CLAIM + 'metric = "eta_trans"\nlargest_at_ohm = [18, inf]\n'
    value, share, largest = parse_table(text, "t.toml").claims
    assert [claim.kind for claim in (value, share, largest)] == ["value", "part", "largest_at_ohm"]
    assert value.number.span == Span(1950.0, 2050.0)
    assert (share.metrics, largest.loads) == (("energy_gen", "energy_line"), (18.0, math.inf))


def test_a_file_is_taken_before_a_built_in_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hsu2026-table2").write_text(HEAD + ROW)
    assert load_table("hsu2026-table2").title == "A table"
    with pytest.raises(TableError, match=r"'no.toml': .* hsu2026-table2"):
        load_table("no.toml")


WRONG = """
HEAD @ row point csv
title = "a";source = "b"; ROW @ columns missing
HEAD ROW [[point]];load_ohm = 1 @ one of
HEAD ROW ROW @ 18 two rows
HEAD [[row]];load_ohm = 1 @ row 1 cells
HEAD [[row]];load_ohm = -1;eta_trans = 94.4 @ row 1 load_ohm 0
HEAD [[row]];load_ohm = 1;eta = 94.4 @ row 1 eta eta_trans [columns]
HEAD [[row]];load_ohm = 1;energy_line = "11,74" @ row 1 energy_line '11,74' number
HEAD [[row]];load_ohm = 1;energy_line = 11.738 @ row 1 energy_line 11.738 2
HEAD ROW CLAIM @ claim 1 part value
HEAD ROW CLAIM value = 1; VALUE @ claim 1 metric
HEAD ROW CLAIM value = 1;metric = "eta_pto";load_ohm = 1;unit = "W";decimals = 0 @ claim 1 'W' number
HEAD ROW CLAIM value = 1;load_ohm = 1;part = "energy_line";of = "energy_gen"; VALUE @ claim 1 energy_line energy_gen
HEAD ROW CLAIM at_most = 1;at_least = 1; VALUE @ claim 1 at_least
HEAD ROW CLAIM metric = "eta_pto";rises_from_ohm = 1;to_ohm = 1 @ claim 1 rises_from_ohm to_ohm
HEAD ROW CLAIM metric = "eta_pto";largest_at_ohm = "18" @ claim 1 largest_at_ohm '18'
[columns @ TOML
title = "A";colour = 1; @ colour columns
title = "A";source = "B";row = [];[columns];power_drum = { unit = "W", decimals = 0 } @ [columns] power_drum power_line
title = "A";source = "B";row = [];[columns];power_line = { unit = "J", decimals = 0 } @ [columns] power_line 'J' power
title = "A";source = "B";row = [];[columns];power_line = { unit = "BTU", decimals = 0 } @ [columns] power_line 'BTU'
title = "A";source = "B";row = [];[columns];power_line = { unit = "W" } @ [columns] power_line decimals
title = "A";source = "B";row = [];[columns];load_ohm = { unit = "mohm", decimals = 0 } @ [columns] load_ohm 'mohm' resistance
title = "A";source = "B";key = "x";point = [];[columns];p = { } @ key x p
title = "A";source = "B";point = [];[columns];speed = { unit = "V" } @ [columns] speed 'V' rotation rad/s
title = "A";source = "B";point = [];[columns];p = { is = "q * p" } @ [columns] p q
title = "A";source = "B";point = [];[columns];p = { is = "p ^ p" } @ [columns] p ^
title = "A";source = "B";csv = "no.csv";[columns];p = { } @ no.csv csv
"""
"""Files that cannot be used, and words of the sentence."""


def test_a_table_that_cannot_be_used_is_one_sentence_with_its_place() -> None:
    parts = {"HEAD": HEAD, "ROW": ROW, "CLAIM": CLAIM, "VALUE": 'unit = "1"\ndecimals = 0\n'}

    def read(text: str, where: str) -> object:
        for name, part in parts.items():
            text = text.replace(f"{name} ", part).removesuffix(name) + (
                part if text.endswith(name) else ""
            )
        try:
            return parse_table(text, where)
        except TableError as fault:  # a CSV is named instead of the table
            raise TableError(f"{where}: {str(fault).removeprefix(f'{where}: ')}") from None

    assert rejections(read, TableError, WRONG) == []
