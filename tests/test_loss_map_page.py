"""The page on loss maps prints what it shows, and its bench has the losses that it was made with.

`PYTHONPATH=tests python tests/test_loss_map_page.py` writes the present output into it.
"""

import csv
import math
import tempfile
from pathlib import Path

import pytest
from pages import follow, shown, with_fixtures, write_outputs

PAGE = "loss_map.md"


@pytest.mark.slow
def test_the_page_can_be_followed(tmp_path: Path) -> None:
    assert follow(PAGE, with_fixtures(tmp_path)) == shown(PAGE)
    assert "Loss map" in (tmp_path / "dyno.html").read_text(encoding="utf-8")
    rows = list(csv.reader((tmp_path / "dyno_loss.csv").read_text(encoding="utf-8").splitlines()[5:]))
    cells = [(float(row[0]), float(cell)) for row in rows for cell in row[1:]]
    assert all(math.isfinite(cell) for _, cell in cells[:1])


def test_the_intervals_hold_the_losses_that_the_log_was_made_with() -> None:
    (text, *_) = shown(PAGE).values()
    for row, true in (("speed ", 2.0), ("speed²", 0.01), ("torque²", 0.012), ("|torque|", 0.4), ("speed ×", 0.02)):
        (line,) = [line for line in text.splitlines() if line.startswith(row) and " to " in line and "times" not in line
                   and (row != "speed " or not line.startswith("speed ×"))]  # fmt: skip
        words = line.replace("\N{MINUS SIGN}", "-").split()
        place = words.index("to")
        assert float(words[place - 1]) <= true <= float(words[place + 1]), row


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_outputs(PAGE, follow(PAGE, with_fixtures(Path(folder))))
