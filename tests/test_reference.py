"""Every output is the one that is stored in `tests/reference/outputs`; CONTRIBUTING.md describes
how to record them.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from commands import GROUPS

RECORD = Path(__file__).parent / "reference" / "record.py"


def require_stored(*groups: str) -> None:
    """The present outputs of some groups, made one after the other in one process, are the
    stored ones.
    """
    done = subprocess.run(
        [sys.executable, RECORD, "--check", "--only", *groups],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, f"\n{done.stdout}{done.stderr}"


@pytest.mark.slow
def test_every_output_of_the_quick_groups_is_the_stored_one() -> None:
    require_stored(*(name for name, group in GROUPS.items() if not group.slow))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, group in GROUPS.items() if group.slow])
def test_every_output_is_the_stored_one(name: str) -> None:
    require_stored(name)


def test_every_stored_output_belongs_to_a_group() -> None:
    assert sorted(path.name for path in (RECORD.parent / "outputs").iterdir()) == sorted(GROUPS)
