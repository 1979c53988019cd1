"""A log that a campaign lists in several entries: `reduce` states which cycles are listed
elsewhere, `batch` reduces each.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from calls import call

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
ENTRY = '[[run]]\nfile = "{file}"\nload_ohm = 36\nwindow_s = 5.48\n{cycles}\n'


def listed(folder: Path, *entries: tuple[str, str]) -> Path:
    """A campaign of entries of one log, each with the spelling of its file and its cycles."""
    log = Path(shutil.copy(LOG, folder))
    runs = "".join(ENTRY.format(file=file, cycles=cycles) for file, cycles in entries)
    (folder / "campaign.toml").write_text(f'rig = "hsu2026"\n{runs}')
    return log


def found_in(log: Path) -> tuple[list[dict[str, Any]], list[int]]:
    """Findings on parts, and the numbers of the cycles."""
    record = json.loads(call("reduce", log, "--json", "-").out)
    return [f for f in record["quality"] if f["kind"] == "listed_in_parts"], [
        c["cycle"] for c in record["cycles"]
    ]


@pytest.mark.parametrize("spelling", ["r36ohm.csv", "./r36ohm.csv"])
def test_reduce_states_which_cycles_are_listed_elsewhere(tmp_path: Path, spelling: str) -> None:
    parts, cycles = found_in(
        listed(tmp_path, ("r36ohm.csv", "cycles = [1, 1]"), (spelling, "cycles = [2, 3]"))
    )
    assert cycles == [1]
    assert [finding["count"] for finding in parts] == [1]


def test_a_log_that_is_listed_once_has_no_such_finding(tmp_path: Path) -> None:
    assert found_in(listed(tmp_path, ("r36ohm.csv", "cycles = [1, 2]"))) == ([], [1, 2])


def test_a_batch_of_a_pattern_reduces_each_part(tmp_path: Path) -> None:
    listed(tmp_path, ("r36ohm.csv", "cycles = [1, 1]"), ("r36ohm.csv", "cycles = [2, 3]"))
    call("batch", tmp_path / "*.csv", "--out", tmp_path / "out", "--reports", "none")
    records = [
        json.loads(path.read_bytes()) for path in sorted((tmp_path / "out" / "runs").glob("*.json"))
    ]
    assert [[c["cycle"] for c in record["cycles"]] for record in records] == [[1], [2, 3]]
    assert [f["kind"] for record in records for f in record["quality"]] == []
