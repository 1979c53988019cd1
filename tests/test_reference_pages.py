"""The pages of reference list what the code declares: each kind of finding, table and key once."""

import re
from typing import get_args

from pages import DOCS

from winchcascade.core.run import FindingKind


def first_cells(page: str) -> list[str]:
    """Names in the first column of the tables of a page, where it holds code."""
    return re.findall(r"^\| ?`([^`]+)`", (DOCS / page).read_text(encoding="utf-8"), re.MULTILINE)


def test_the_page_of_findings_lists_each_kind_once() -> None:
    assert sorted(first_cells("findings.md")) == sorted(get_args(FindingKind))
