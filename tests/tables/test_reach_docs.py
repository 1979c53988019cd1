"""The manual shows what `audit --physics` prints of the paper's table.

`python tests/tables/test_reach_docs.py` writes the present output into it.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

MANUAL = Path(__file__).parent.parent.parent / "docs" / "tables.md"
BLOCK = re.compile(r"(hsu2026-table2 --physics`:\n\n```text\n)(.*?)(```)", re.DOTALL)


def physics() -> str:
    """The part of the output that the manual shows."""
    command = [sys.executable, "-m", "winchcascade", "audit", "hsu2026-table2", "--physics"]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    return done.stdout[done.stdout.index("physics: what rig") :]


@pytest.mark.slow
def test_the_manual_shows_what_the_command_prints() -> None:
    found = BLOCK.search(MANUAL.read_text(encoding="utf-8"))
    assert found is not None
    assert found[2] == physics()


if __name__ == "__main__":
    output = physics()
    text = BLOCK.sub(lambda found: found[1] + output + found[3], MANUAL.read_text(encoding="utf-8"))
    MANUAL.write_text(text, encoding="utf-8")
