"""The measured log that ships: steps of a dynamometer, compared with sums that need nothing of winchcascade."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from winchcascade import load_rig, read_run, reduce

FOLDER = Path(__file__).parents[2] / "fixtures" / "measured"
WITHIN = 1e-3
"""Share by which the energy of a step may differ from the sum over its samples."""


def test_each_step_has_the_energy_of_its_samples() -> None:
    rig = load_rig(FOLDER / "vdyno.toml")
    result = reduce(read_run(FOLDER / "vdyno_steps.csv", rig=rig), rig=rig)
    with (FOLDER / "vdyno_steps.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    power = np.array([float(r["Status_RPM_V1"]) * math.pi / 30.0 * float(r["TorqueValue"]) for r in rows])
    assert len(result.cycles) >= 3
    for cycle in result.cycles:
        begin, end = round(cycle.window.onset * 10), round(cycle.window.cutoff * 10)
        inside = power[begin : end + 1]
        energy = 0.1 * float(np.sum(0.5 * (inside[1:] + inside[:-1])))
        assert cycle.metrics.energy_mech == pytest.approx(energy, rel=WITHIN)


def test_the_log_is_stated_as_measured_with_its_licence() -> None:
    assert (FOLDER / "LICENSE-vdyno.txt").read_text(encoding="utf-8").startswith("MIT License")
    assert "measured = true" in (FOLDER / "campaign.toml").read_text(encoding="utf-8")
