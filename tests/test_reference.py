"""Every output is the one that is stored in `tests/reference/outputs`; CONTRIBUTING.md describes how to record them."""

import subprocess
import sys
from pathlib import Path

import pytest
from groups import GROUPS, SLOW

RECORD = Path(__file__).parent / "reference" / "record.py"


APART = ("reports", "blind", "demo")
"""Long groups in a file of their own (`test_reference_reports.py`), as a worker takes a whole file."""


QUICK = [group for group in GROUPS if group not in SLOW]


def require_stored(*groups: str) -> None:
    """The present outputs of some groups, made one after the other in one process, are the stored ones."""
    done = subprocess.run(
        [sys.executable, RECORD, "--check", "--only", *groups], capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, f"\n{done.stdout}{done.stderr}"


def test_every_output_of_the_quick_groups_is_the_stored_one() -> None:
    require_stored(*QUICK)


@pytest.mark.slow
@pytest.mark.parametrize("group", [group for group in SLOW if group not in APART])
def test_every_output_is_the_stored_one(group: str) -> None:
    require_stored(group)


def test_every_stored_output_belongs_to_a_group() -> None:
    assert sorted(path.name for path in (RECORD.parent / "outputs").iterdir()) == sorted(GROUPS)
