"""The manual shows what `audit --physics` prints of the paper's table, as it is stored.

A slow test compares what is stored with what is printed.

`python tests/tables/test_reach_docs.py` writes the stored output into it.
"""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
MANUAL = ROOT / "docs" / "tables.md"
STORED = ROOT / "tests" / "reference" / "outputs" / "physics" / "physics.txt"
BLOCK = re.compile(r"(hsu2026-table2 --physics`:\n\n```text\n)(.*?)(```)", re.DOTALL)


def physics() -> str:
    """The part of the output that the manual shows."""
    printed = STORED.read_text(encoding="utf-8")
    assert printed.startswith("$ winchcascade audit hsu2026-table2 --physics ")
    return printed[printed.index("What the rig can attain") :]


def test_the_manual_shows_what_the_command_prints() -> None:
    found = BLOCK.search(MANUAL.read_text(encoding="utf-8"))
    assert found is not None
    assert found[2] == physics()


if __name__ == "__main__":
    output = physics()
    text = BLOCK.sub(lambda found: found[1] + output + found[3], MANUAL.read_text(encoding="utf-8"))
    MANUAL.write_text(text, encoding="utf-8")
