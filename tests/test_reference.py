"""Every output is the one that is stored in `tests/reference/outputs`; CONTRIBUTING.md tells how to record them."""

import subprocess
import sys
from pathlib import Path

import pytest
from groups import GROUPS, SLOW

RECORD = Path(__file__).parent / "reference" / "record.py"


def marks(group: str) -> list[pytest.MarkDecorator]:
    """Each group on whichever worker is free, long ones with the slow tests."""
    alone = pytest.mark.xdist_group(f"reference {group}")
    return [alone, pytest.mark.slow] if group in SLOW else [alone]


@pytest.mark.parametrize("group", [pytest.param(group, marks=marks(group)) for group in GROUPS])
def test_every_output_is_the_stored_one(group: str) -> None:
    done = subprocess.run(
        [sys.executable, RECORD, "--check", "--only", group], capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, f"\n{done.stdout}{done.stderr}"


def test_every_stored_output_belongs_to_a_group() -> None:
    assert sorted(path.name for path in (RECORD.parent / "outputs").iterdir()) == sorted(GROUPS)
