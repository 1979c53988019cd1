"""A run carries the rig, the window and the cycles with which it was read; a rig that nobody
named is reported.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from paper_rules import PAPER_RULES
from test_cli import winchcascade

from winchcascade import (
    OptionError,
    RigError,
    Run,
    calibrate,
    load_rig,
    open_campaign,
    read_run,
    reduce,
    simulate,
)
from winchcascade.reduction.run_record import reduction_json

CAMPAIGN = Path(__file__).parent.parent / "fixtures" / "campaign"
MINE = (
    'based_on = "hsu2026"\nname = "mine"\n[winch]\nr_drum = { value = 0.15, unit = "m" }\n'
    + PAPER_RULES
)
LISTED = '[[run]]\nfile = "r36ohm.csv"\nload_ohm = 36.0\nwindow_s = 5.0\ncycles = [2, 3]\n'


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log that stands alone, beside a rig file."""
    (tmp_path / "mine.toml").write_text(MINE)
    return Path(shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path))


def printed(*arguments: str | Path) -> dict[str, Any]:
    """JSON of the command `reduce`."""
    done = winchcascade("reduce", *arguments, "--json", "-")
    assert done.returncode == 0, done.stderr
    record: dict[str, Any] = json.loads(done.stdout)
    return record


def kinds(record: dict[str, Any]) -> list[str]:
    return [finding["kind"] for finding in record["quality"]]


def without(log: Path, *columns: int) -> Path:
    """The log without some of its columns."""
    rows = [line.split(",") for line in log.read_text().splitlines()]
    log.write_text(
        "\n".join(",".join(c for k, c in enumerate(row) if k not in columns) for row in rows) + "\n"
    )
    return log


# ---------------------------------------------------------------------------------------- the rig
def test_a_run_is_reduced_with_the_rig_that_it_was_read_with(log: Path) -> None:
    mine = load_rig(log.parent / "mine.toml")
    found = reduce(read_run(log, rig=mine))
    paper = reduce(read_run(log)).mean
    assert found.rig.name == "mine"
    assert found.mean.energy_mech == pytest.approx(0.13 / 0.15 * paper.value("energy_mech"))
    assert (
        json.loads(reduction_json(found))["mean"]
        == printed(log, "--rig", log.parent / "mine.toml")["mean"]
    )
    assert reduce(read_run(log), rig=mine).mean == found.mean
    assert reduce(read_run(log, rig=mine), rig=load_rig("hsu2026")).mean == paper


def test_calibrate_and_simulate_take_the_rig_of_the_run(log: Path) -> None:
    mine = load_rig(log.parent / "mine.toml")
    assert calibrate(read_run(CAMPAIGN / "open_circuit.csv", rig=mine)).rig.name == "mine"
    made = simulate(read_run(log, rig=mine, load=36.0))
    assert made.model.winch.r_drum == 0.15
    assert reduce(made.run).rig.name == "mine"
    with pytest.raises(RigError, match="no model can be made"):
        simulate(replace(read_run(log), rig=load_rig("kitepower")))


def test_a_velocity_that_was_made_with_one_drum_is_not_reduced_with_another(log: Path) -> None:
    mine = load_rig(log.parent / "mine.toml")
    rows = [line.split(",") for line in log.read_text().splitlines()]
    speed = [f"{float(row[2]) / 0.13 * 30.0 / np.pi:.6f}" for row in rows[1:]]
    lines = zip(["Shaft speed (rpm)", *speed], rows, strict=True)
    log.write_text("\n".join(",".join([row[0], n, *row[4:]]) for n, row in lines) + "\n")
    with pytest.raises(OptionError, match=r"drum radius .* 0\.13 m, and the rig mine has 0\.15 m"):
        reduce(read_run(log), rig=mine)
    assert reduce(read_run(log, rig=mine)).rig.name == "mine"


# ----------------------------------------------------------------------------------- the campaign
def test_a_log_that_a_campaign_lists_is_read_as_the_command_reads_it(log: Path) -> None:
    (log.parent / "campaign.toml").write_text(
        f'title = "Two"\nrig = "mine.toml"\nmeasured = true\n{LISTED}'
    )
    run = read_run(log)
    record = json.loads(reduction_json(reduce(run)))
    assert record == printed(log)
    assert (record["rig"]["name"], record["window"], record["log"]["load_ohm"]) == (
        "mine",
        5.0,
        36.0,
    )
    assert [cycle["cycle"] for cycle in record["cycles"]] == [2, 3]
    assert (run.origin.measured, run.about, run.load_source) == (True, "Two", "campaign.toml")


def test_what_is_given_counts_before_the_campaign(log: Path) -> None:
    (log.parent / "campaign.toml").write_text(f'rig = "mine.toml"\n{LISTED}')
    run = read_run(log, rig=load_rig("hsu2026"), load=36.1)
    found = reduce(run, window="auto", cycles=(1, 1))
    assert (run.load, run.load_source, found.rig.name, found.window) == (
        36.1,
        "given",
        "hsu2026",
        "auto",
    )
    assert [cycle.cycle for cycle in found.cycles] == [1]
    alone = read_run(log, campaign=False)
    assert (alone.load, alone.window, alone.cycles, alone.rig and alone.rig.assumed) == (
        None,
        None,
        None,
        True,
    )


def test_ranges_of_a_campaign_are_the_cycles_of_the_run(log: Path) -> None:
    (log.parent / "campaign.toml").write_text(
        '[[run]]\nfile = "r36ohm.csv"\nranges_s = [[5.0, 15.0]]\n'
    )
    (cycle,) = reduce(read_run(log)).cycles
    assert (cycle.window.onset, cycle.window.cutoff) == (5.0, 15.0)


# ------------------------------------------------------------------------------------ the finding
def test_a_rig_that_nobody_named_is_the_first_finding(log: Path) -> None:
    (first, *_), record = reduce(read_run(log)).quality, printed(log)
    assert first.kind == kinds(record)[0] == "rig_assumed"
    assert "0.13 m" in first.message
    assert "hsu2026" in first.message
    assert record["rig"] == {"name": "hsu2026", "assumed": True, "r_drum_m": 0.13}
    (log.parent / "campaign.toml").write_text(LISTED)
    assert kinds(printed(log))[0] == "rig_assumed"
    without(log, 5, 7)
    assert kinds(printed(log)) == ["rig_assumed", "missing_channel", "missing_channel"]


@pytest.mark.parametrize("name", ["hsu2026", "mine.toml"])
def test_a_rig_that_was_named_gives_no_finding(log: Path, name: str) -> None:
    rig = log.parent / name if name.endswith("toml") else name
    by_option = printed(log, "--rig", rig)
    (log.parent / "campaign.toml").write_text(f'rig = "{name}"\n{LISTED}')
    for record in (by_option, printed(log)):
        assert (kinds(record), record["rig"]["assumed"]) == ([], False)
    assert reduce(read_run(log, rig=load_rig(rig), campaign=False)).quality == ()


def test_a_run_made_by_hand_has_no_rig() -> None:
    t = np.arange(0.0, 60.0, 0.04)
    run = Run("by hand", t, {"velocity": np.sin(0.2 * t)}, 25.0, t.size)
    assert reduce(run).quality[0].kind == "rig_assumed"
    assert "rig_assumed" not in {
        f.kind for f in reduce(replace(run, rig=load_rig("hsu2026"))).quality
    }


def test_the_shipped_campaign_names_its_rig() -> None:
    found = open_campaign(CAMPAIGN).reduce()
    assert {kind for run in found.summary.reduced for kind in run.findings} == set()


# ------------------------------------------------------------------------------- derived channels
def test_a_velocity_that_is_derived_is_a_finding(log: Path) -> None:
    record = printed(without(log, 2), "--rig", "hsu2026", "--window", "5.48")
    assert [(f["kind"], f["channel"]) for f in record["quality"]] == [
        ("derived_channel", "velocity")
    ]
    assert record["mean"]["eta_pto"] == pytest.approx(
        printed(CAMPAIGN / "r36ohm.csv")["mean"]["eta_pto"], abs=0.01
    )


def test_a_velocity_that_a_rig_does_not_measure_is_derived_with_the_same_finding(log: Path) -> None:
    bare = log.parent / "bare.toml"
    bare.write_text('name = "bare"\n[winch]\nr_drum = { value = 0.13, unit = "m" }\n')
    assert kinds(printed(without(log, 2), "--rig", bare)) == [
        "derived_channel",
        "thresholds_assumed",
    ]
