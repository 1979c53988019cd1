"""What is repaired of a log, and the log without its repairs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import call
from shipped_log import HEADERS, clean, column, row_after_onset, table

from winchcascade import OptionError, read_run, reduce

WHOLE = 1e-9
"""Rounding of an integral that is made twice, as a share of it. [1]"""


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    """A log with a spike, zeros, a held value, an empty cell and a torque of the other sign."""
    rows = table().copy()
    rows[row_after_onset(2.0), column("torque")] = 400.0
    k = row_after_onset(3.0)
    rows[k : k + 3, column("idc")] = 0.0
    k = row_after_onset(2.0, cycle=0)
    rows[k : k + 20, column("force")] = rows[k, column("force")]
    rows[row_after_onset(9.0), column("vdc")] = np.nan
    rows[:, column("torque")] *= -1.0
    path = tmp_path / "damaged.csv"
    np.savetxt(path, rows, "%.9g", ",", header=",".join(HEADERS), comments="")
    return path


def reduced(log: Path, *options: str) -> dict[str, Any]:
    """The record of a log as the command prints it."""
    called = call("reduce", log, "--load-ohm", "36", "--window", "5.48", "--json", "-", *options)
    assert called.code == 0, called.err
    found: dict[str, Any] = json.loads(called.out)
    return found


def changes(record: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    """Repairs by kind and channel of their findings."""
    return {
        (q["kind"], q["channel"]): q["repaired"]
        for q in record["quality"]
        if q["repaired"] is not None
    }


def test_without_repairs_the_same_is_listed_and_nothing_is_changed(damaged: Path) -> None:
    on, off = reduced(damaged), reduced(damaged, "--repairs", "off")
    assert (on["log"]["repairs"], off["log"]["repairs"]) == ("on", "off")
    for key in (("spike", "torque"), ("spike", "idc"), ("stuck", "force")):
        done, not_done = changes(on)[key], changes(off)[key]
        assert done["applied"]
        assert done == not_done | {"applied": True}
        assert not not_done["applied"]
        (span,) = done["spans_s"]
        assert span[1] - span[0] == pytest.approx(0.04 * (done["samples"] - 1), abs=1e-6)
    assert {q["removed_share"] for q in off["quality"] if q["kind"] in ("spike", "stuck")} == {0.0}
    rows = table()
    for cycle in off["cycles"]:
        window = cycle["window"]
        t = np.unique(np.concatenate((rows[:, 0], [window["onset_s"], window["cutoff_s"]])))
        t = t[(t >= window["onset_s"]) & (t <= window["cutoff_s"])]
        logged = np.loadtxt(damaged, delimiter=",", skiprows=1)
        power = logged[:, column("force")] * logged[:, column("velocity")]
        assert cycle["energy_line_j"] == pytest.approx(
            np.trapezoid(np.interp(t, rows[:, 0], power), t), rel=WHOLE
        )


def test_repairs_bring_the_energies_back_that_they_are_for(damaged: Path) -> None:
    true = clean().cycles[1].metrics
    on, off = (reduced(damaged, "--repairs", word)["cycles"][1] for word in ("on", "off"))
    for energy in ("energy_mech", "energy_gen"):
        assert on[f"{energy}_j"] == pytest.approx(true.value(energy), rel=0.003)
        assert off[f"{energy}_j"] != pytest.approx(true.value(energy), rel=0.003)


def test_signs_and_empty_cells_are_read_alike_without_repairs(damaged: Path) -> None:
    off = changes(reduced(damaged, "--repairs", "off"))
    assert off["sign_flipped", "torque"]["applied"]
    assert off["not_a_number", "vdc"]["applied"]
    run = read_run(damaged, repairs="off")
    assert np.isfinite(run.channels["vdc"]).all()
    assert float(np.median(run.channels["torque"])) >= 0.0


def test_a_clean_log_is_the_same_with_and_without_repairs(fixtures: Path) -> None:
    log = fixtures / "campaign" / "r36ohm.csv"
    on, off = reduced(log), reduced(log, "--repairs", "off")
    assert (on["quality"], on["mean"]) == (off["quality"], off["mean"]) == ([], on["mean"])


def test_the_library_keeps_what_was_logged_and_rejects_another_word(damaged: Path) -> None:
    off = read_run(damaged, load=36.0, repairs="off")
    assert off.repairs == "off"
    assert list(off.gaps) == ["vdc"]
    assert len(reduce(off, window=5.48).complete) == 3
    with pytest.raises(OptionError, match="maybe"):
        read_run(damaged, repairs="maybe")  # type: ignore[arg-type]
    assert call("reduce", damaged, "--repairs", "maybe").code == 2
