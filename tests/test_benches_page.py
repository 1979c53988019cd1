"""The page on benches of other people prints what it shows.

`PYTHONPATH=tests python tests/test_benches_page.py` writes the present output into it.
"""

import tempfile
from pathlib import Path

import pytest
from pages import ROOT, follow, shown, write_outputs

PAGE = "benches.md"
BENCHES = ROOT.parent / "shared" / "data" / "benches"


def with_benches(place: Path) -> Path:
    """A folder from which the logs of the page are found."""
    (place / "benches").symlink_to(BENCHES, target_is_directory=True)
    return place


@pytest.mark.slow
def test_the_page_can_be_followed(tmp_path: Path, shared: Path) -> None:
    assert shared / "benches" == BENCHES
    assert follow(PAGE, with_benches(tmp_path)) == shown(PAGE)


def test_what_the_page_says_of_its_numbers_is_what_the_commands_print() -> None:
    printed = {command.split("/")[-1].split()[0]: text for command, text in shown(PAGE).items()}
    at_rest = printed["StepsTest20230624_2023-06-24_190243.csv"]
    assert "eta" not in at_rest
    assert "with the cascade" in printed["6-15-2021_17-0-32.csv"]
    assert "power_mech is -0.98" in printed["6-15-2021_17-0-32.csv"]
    assert "stage gen has no power (vdc * idc): the log has no vdc" in " ".join(
        printed["2025-04-16_13-48-06.csv"].split()
    )
    assert "are swapped" in " ".join(shown(PAGE)["winchcascade audit spindle.toml"].split())


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_outputs(PAGE, follow(PAGE, with_benches(Path(folder))))
