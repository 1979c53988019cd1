"""What the JSON of a reduction states of the uncertainty: on what the drum radius acts, and by what each sensor is known."""

import json
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
    for cells in rows:
        cells[torque] = repr((1.11 if float(cells[0]) < 38.0 else 1.0) * float(cells[torque]))
    bent = tmp_path / "bent.csv"
    bent.write_text("\n".join([lines[0], *map(",".join, rows)]), encoding="utf-8")
    done = winchcascade("reduce", bent, "--load-ohm", "36", "--window", "5.48", "--json", "-")
    found = json.loads(done.stdout)
    etas = [cycle["eta_trans"] for cycle in found["cycles"]]
    assert etas[0] > 1.0 > etas[1]
    assert found["mean"]["eta_trans"] == pytest.approx(sum(etas) / len(etas))
    assert found["standard_uncertainty"]["eta_trans"] > 0.0
    assert [f["count"] for f in found["quality"] if f["kind"] == "efficiency_above_one"] == [1]


def test_a_radius_with_a_tolerance_is_rejected_with_both_keys(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        'based_on = "hsu2026"\nname = "ours"\n[winch]\nr_drum = { value = 0.13, unit = "m", tolerance = 0.001 }\n'
    )
    message = one_sentence("reduce", LOG, "--rig", rig)
    assert all(word in message for word in ("[winch] r_drum", "tolerance", " u ", " limits "))
