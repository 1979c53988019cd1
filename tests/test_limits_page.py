"""The tables of the page on limits are made from the code, and hold what it declares."""

import importlib.util
import re
from types import ModuleType

import pytest
from pages import DOCS, read

from winchcascade.diagnosis import verdict_limits
from winchcascade.diagnosis.fit import nuisances


def maker() -> ModuleType:
    about = importlib.util.spec_from_file_location("limits", DOCS / "limits.py")
    assert about is not None
    assert about.loader is not None
    module = importlib.util.module_from_spec(about)
    about.loader.exec_module(module)
    return module


LIMITS = maker()
MARKED = LIMITS.MARKER.findall(read(DOCS / "limits.md"))


def rows(table: str) -> list[list[str]]:
    """Cells of the rows below the head of a table."""
    return [re.split(r"(?<!\\)\|", line)[1:-1] for line in table.splitlines()[2:]]


@pytest.mark.parametrize(("kind", "place"), MARKED)
def test_a_marker_becomes_a_table_with_rows_of_equal_length(kind: str, place: str) -> None:
    table = LIMITS.TABLES[kind](place)
    (width,) = {len(row) for row in rows(table)}
    assert width == {"limits": 4, "modules": 2}[kind]
    assert all(cell.strip() for row in rows(table) for cell in row)


def test_a_page_on_the_site_has_no_marker_left() -> None:
    page = LIMITS.on_page_markdown(read(DOCS / "limits.md"))
    assert not LIMITS.MARKER.search(page)
    assert len(page.splitlines()) > len(read(DOCS / "limits.md").splitlines())


def test_every_limit_of_a_verdict_is_listed_with_its_value() -> None:
    declared = {name: value for name, value in vars(verdict_limits).items() if name.isupper()}
    listed = {
        row[0].strip(" `"): float(row[1])
        for row in rows(LIMITS.limits_table("diagnosis/verdict_limits.py"))
    }
    assert listed == declared


def test_shares_of_absent_laws_are_listed_one_by_one() -> None:
    table = LIMITS.limits_table("diagnosis/fit/nuisances.py")
    (shares,) = (row[1] for row in rows(table) if row[0].strip() == "`ABSENT`")
    assert shares.count(";") == len(nuisances.ABSENT) - 1
    for (part, name), (share, *_) in nuisances.ABSENT.items():
        assert f"{part} {name}: {share:g} " in shares


def test_a_table_has_no_cell_that_a_docstring_ends_early() -> None:
    assert LIMITS.plain("a | b\nand <c>") == "a \\| b and &lt;c>"
