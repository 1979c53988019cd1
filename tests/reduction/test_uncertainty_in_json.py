"""What the JSON of a reduction states of the uncertainty: on what the drum radius acts, and by what each sensor is known."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from test_cli import one_sentence, winchcascade

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
FORCE = '[sensors.force]\nunit = "N"\nhigh = 20000\naccuracy_full_scale = 0.002\n'


def reduced(tmp_path: Path, rig: str) -> dict[str, Any]:
    """The JSON of the log of 36 ohm on a rig that differs from the paper's by some tables."""
    path = tmp_path / "rig.toml"
    path.write_text(f'based_on = "hsu2026"\nname = "ours"\n{rig}', encoding="utf-8")
    done = winchcascade("reduce", LOG, "--rig", path, "--json", "-")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def row(record: dict[str, Any], source: str, part: str) -> dict[str, Any]:
    (found,) = (r for r in record["uncertainty"]["budget"] if (r["source"], r.get("part")) == (source, part))
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize(
    ("motion", "acts_on"),
    [
        ("", {"energy_line_j", "eta_trans", "eta_pto"}),
        ('motion = "drum"', {"energy_line_j", "eta_trans", "eta_pto"}),
        ('motion = "line"', {"energy_mech_j", "eta_trans", "eta_gen"}),
    ],
)
def test_the_drum_radius_acts_on_the_stages_that_need_it(tmp_path: Path, motion: str, acts_on: set[str]) -> None:
    record = reduced(tmp_path, f'[winch]\n{motion}\nr_drum = {{ value = 0.13, unit = "m", limits_percent = 1 }}\n')
    found = row(record, "r_drum", "gain")
    named = {"energy_line_j", "energy_mech_j", "energy_gen_j", "eta_trans", "eta_gen", "eta_pto"}
    assert {m for m in named if found["contribution"][m]} == acts_on
    for m in acts_on:
        assert found["contribution"][m] == pytest.approx(0.01 / math.sqrt(3.0) * record["mean"][m], rel=1e-9)
    assert (found["distribution"], found["basis"]) == ("rectangular", "limits")


def test_a_full_scale_is_a_zero_error_of_its_whole_size(tmp_path: Path) -> None:
    record = reduced(tmp_path, FORCE)
    zero = row(record, "force", "zero")
    assert (zero["basis"], zero["limit"]) == ("limits", pytest.approx(40.0))
    assert zero["standard_uncertainty"] == pytest.approx(40.0 / math.sqrt(3.0))
    assert {r["part"] for r in record["uncertainty"]["budget"] if r["source"] == "force"} == {"zero"}


def test_a_calibration_in_place_replaces_the_limits(tmp_path: Path) -> None:
    record = reduced(tmp_path, f"{FORCE}u_zero = 2\nu_gain = 0.001\n")
    found = [r for r in record["uncertainty"]["budget"] if r["source"] == "force"]
    assert {r["part"]: (r["standard_uncertainty"], r["basis"]) for r in found} == {
        "zero": (2.0, "calibration_in_place"),
        "gain": (0.001, "calibration_in_place"),
    }
    assert len(found) == 2


def test_a_mean_keeps_an_efficiency_above_1(tmp_path: Path) -> None:
    lines = LOG.read_text(encoding="utf-8").splitlines()
    torque, rows = lines[0].split(",").index("Torque (N.m)"), [line.split(",") for line in lines[1:]]
    for row_ in rows:
        if float(row_[0]) < 38.0:
            row_[torque] = repr(1.1 * float(row_[torque]))  # eta_trans of the first cycle becomes 0.993
    bent = tmp_path / "bent.csv"

    def of(factor: float) -> dict[str, Any]:
        text = [[*r[:torque], repr(factor * float(r[torque])), *r[torque + 1 :]] for r in rows]
        bent.write_text("\n".join([lines[0], *map(",".join, text)]), encoding="utf-8")
        done = winchcascade("reduce", bent, "--load-ohm", "36", "--window", "5.48", "--json", "-")
        found: dict[str, Any] = json.loads(done.stdout)
        return found

    below, above = of(1.0), of(1.01)
    first = below["cycles"][0]["eta_trans"]
    assert 0.99 < first < 1.0 < above["cycles"][0]["eta_trans"] == pytest.approx(1.01 * first, rel=1e-3)
    assert above["mean"]["eta_trans"] == pytest.approx(1.01 * below["mean"]["eta_trans"], rel=1e-3)
    assert above["standard_uncertainty"]["eta_trans"] > 0.0
    kinds = [{f["kind"]: f["count"] for f in record["quality"]} for record in (below, above)]
    assert [found.get("efficiency_above_one") for found in kinds] == [None, 1]


def test_a_radius_with_a_tolerance_is_rejected_with_both_keys(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        'based_on = "hsu2026"\nname = "ours"\n[winch]\nr_drum = { value = 0.13, unit = "m", tolerance = 0.001 }\n'
    )
    message = one_sentence("reduce", LOG, "--rig", rig)
    assert all(word in message for word in ("[winch] r_drum", "tolerance", " u ", " limits "))
