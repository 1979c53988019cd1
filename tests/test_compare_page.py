"""The page on comparisons prints what it shows.

`PYTHONPATH=tests python tests/test_compare_page.py` writes the present output into it.
"""

import json
import tempfile
from pathlib import Path

import pytest
from pages import follow, run, shown, with_fixtures, write_outputs

PAGE = "compare.md"


@pytest.mark.slow
def test_the_page_can_be_followed(tmp_path: Path) -> None:
    assert follow(PAGE, with_fixtures(tmp_path)) == shown(PAGE)
    record = json.loads(run("winchcascade compare before after --json -", tmp_path).stdout)
    for one in (runs["differences"]["eta_pto"] for runs in record["runs"]):
        assert abs(one["relative"] + 0.02) < 1e-4  # the current is 2 % smaller
        assert one["interval_95"][0] < one["difference"] < one["interval_95"][1]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_outputs(PAGE, follow(PAGE, with_fixtures(Path(folder))))
