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
    text = (tmp_path / "dyno_loss.csv").read_text(encoding="utf-8")
    head, *rows = csv.reader(line for line in text.splitlines() if not line.startswith("#"))
    filled = 0
    for row in rows:
        for omega, cell in zip(map(float, head[1:]), map(float, row[1:]), strict=True):
            if not math.isnan(cell):
                t = float(row[0])
                assert cell == pytest.approx(lost(omega, t), abs=3.0)
                filled += 1
    assert filled > 400


def lost(omega: float, torque: float) -> float:
    """Loss of the bench of the page. [W]"""
    return 2.0 * omega + 0.01 * omega**2 + 0.012 * torque**2 + 0.4 * torque + 0.02 * omega * torque


def test_the_intervals_hold_the_losses_that_the_log_was_made_with() -> None:
    (text, *_) = shown(PAGE).values()
    for row, true in (("speed  ", 2.0), ("speed^2", 0.01), ("torque^2", 0.012), ("|torque|", 0.4), ("speed x", 0.02)):
        (line,) = [line for line in text.splitlines() if line.startswith(row) and " to " in line]
        words = line.split()
        place = words.index("to")
        assert float(words[place - 1]) <= true <= float(words[place + 1]), row


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_outputs(PAGE, follow(PAGE, with_fixtures(Path(folder))))
