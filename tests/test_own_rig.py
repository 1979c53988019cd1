"""The page on one's own rig is followed from an empty folder, and prints what it shows.

`PYTHONPATH=tests python tests/test_own_rig.py` writes the present output into it.
"""

import json
import tempfile
from pathlib import Path

import pytest
from pages import DOCS, follow, shown, write_outputs

from winchcascade import baseline, load_rig, read_run, reduce
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import RigError

PAGE = "own_rig.md"


@pytest.mark.slow
def test_the_page_can_be_followed_from_an_empty_folder(tmp_path: Path) -> None:
    assert len(shown(PAGE)) == 7
    assert follow(PAGE, tmp_path) == shown(PAGE)
    assert load_rig(tmp_path / "north_calibrated.toml").r_drum == 0.15
    assert [run.load for run in load_campaign(tmp_path / "testday").runs] == [float("inf"), 30.0, 12.0]
    assert (tmp_path / "last12.html").stat().st_size > 1000
    estimates = json.loads((tmp_path / "estimates.json").read_text(encoding="utf-8"))
    assert [cause["effect"] for cause in estimates["causes"]] == ["copper_heating"]
    with pytest.raises(RigError, match="no model can be made"):
        baseline(load_rig(tmp_path / "lean.toml"))
    forgot_the_unit(tmp_path)


def forgot_the_unit(place: Path) -> None:
    """What the page says of a rig file without the unit of the load cell."""
    rig = (place / "north.toml").read_text(encoding="utf-8").replace(', unit = "kN" }', " }")
    (place / "forgot.toml").write_text(rig, encoding="utf-8")
    run = read_run(place / "testday" / "last12.csv", rig=load_rig(place / "forgot.toml"))
    reduction = reduce(run, rig=load_rig(place / "forgot.toml"))
    assert round(reduction.mean.energy_line or 0.0) == 3
    assert (reduction.mean.eta_pto or 0.0) > 1.0
    assert {"unit_assumed", "efficiency_above_one"} <= {finding.kind for finding in reduction.quality}


def test_what_the_page_says_of_its_numbers_is_what_the_commands_print() -> None:
    printed = shown(PAGE)
    text = " ".join((DOCS / PAGE).read_text(encoding="utf-8").split())
    assert "torques of up to 643.69 N m" in text
    assert "up to 643.69" in printed["winchcascade reduce testday/last12.csv --rig north.toml"]
    found = printed["winchcascade calibrate testday/leerlauf.csv --write north_calibrated.toml"]
    for name, true in (("k_e", 0.0711), ("mu_screw", 0.045), ("b_rotor", 9e-4)):
        (row,) = [line.split() for line in found.splitlines() if line.startswith(f"{name} ")]
        assert float(row[3]) <= true <= float(row[5]), name
    assert "copper_heating" in printed["winchcascade diagnose testday --rig north_calibrated.toml"]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_outputs(PAGE, follow(PAGE, Path(folder)))
