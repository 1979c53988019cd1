"""How a report is laid out for a terminal and for a pipe."""

import re

from winchcascade.core.plain_text import lines
from winchcascade.report.content import Column, Note, Report, Table, section, table
from winchcascade.report.glossary import typeset
from winchcascade.report.render.terminal import PIPE, Screen, painted, terminal_text, use_screen

COLOUR = re.compile(r"\x1b\[[\d;]*m")
WIDE = [Column[float](f"column {k:02d}", lambda row: row) for k in range(30)]


def report(*tables: Table[float] | None) -> Report:
    return Report(
        "Test", "A title", points=[Note("evil\x1b[31m\ufdd2", "Point", "warn")],
        sections=[section("wide", "Wide", *tables)], verdict=Note("As it should be.", tone="good"),
    )  # fmt: skip


def test_colours_reach_a_terminal_and_those_of_a_file_do_not() -> None:
    use_screen(Screen(100, colour=True))
    try:
        coloured = painted(
            terminal_text(report(table("wide", "A wide table.", WIDE, [1.25]))), lines
        )
    finally:
        use_screen(PIPE)
    assert {"\x1b[1m", "\x1b[32m", "\x1b[33m"} <= set(COLOUR.findall(coloured))
    assert "\x1b[31m" not in coloured
    assert "evil?[31m" in coloured


def test_a_pipe_gets_a_wide_table_whole_and_a_path_unbroken() -> None:
    path = "results/" + "a folder of a long name/" * 8 + "page.html"
    printed = terminal_text(report(table("wide", "A wide table.", WIDE, [1.25, 1000.0])), [path])
    head = next(line for line in printed.splitlines() if line.startswith("column 00"))
    assert head.endswith("column 29")
    assert printed.count("1000") == len(WIDE)
    assert f"files      {path}" in printed.splitlines()


def test_an_option_keeps_its_name_where_units_have_signs() -> None:
    assert (
        typeset("open circuit (--load-ohm), 9 ohm, in ohm")
        == "open circuit (--load-ohm), 9\u00a0Ω, in Ω"
    )
