"""The closed share, computed again: right where the answer is known."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from winchcascade.blind.recomputed_closure import closure_of

HEAD = "Time (s),Displacement (m),Velocity (m/s),Pressure (kg/cm2),Force (N),Torque (N.m),Vdc (V),Idc (A)"
MARK = ",Generator speed (rpm),Stator current (A rms),Air-gap torque (N.m)"


def write(path: Path, columns: Mapping[str, np.ndarray], *, predicted: bool) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([*columns.values(), *([np.zeros(len(columns["t"]))] * 3 if predicted else [])])
    np.savetxt(path, table, delimiter=",", header=HEAD + (MARK if predicted else ""), comments="", fmt="%.6f")


def true_log() -> dict[str, np.ndarray]:
    """Three cycles whose channels follow the speed."""
    t = np.arange(0.0, 120.0, 0.04)
    v = np.interp(t % 40.0, [0, 4, 8, 15, 17, 22, 24, 30, 31, 40], [0, 0, 1, 1, 0, 0, -1.2, -1.2, 0, 0])
    x = np.concatenate([[0.0], np.cumsum(0.02 * (v[1:] + v[:-1]))])
    payout = np.maximum(v, 0.0)
    columns = {"t": t, "x": x, "v": v, "pressure": 20.5 + 0.5 * x, "force": 200 + 2000 * payout}
    return columns | {"torque": 300 * payout, "vdc": 280 * payout, "idc": 7.7 * payout}


NOISE = {"pressure": 0.01, "force": 5.0, "torque": 0.4, "vdc": 0.25, "idc": 0.015}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    truth = true_log()
    noisy = {name: x + rng.normal(0.0, NOISE.get(name, 0.0), x.size) for name, x in truth.items()}
    write(tmp_path / "case" / "r36ohm.csv", noisy, predicted=False)
    return tmp_path


def predict(place: Path, when: str, **factors: float) -> None:
    """Write what was predicted: the truth, some channels times a factor."""
    columns = {name: x * factors.get(name, 1.0) for name, x in true_log().items()}
    write(place / "predictions" / when / "r36ohm.csv", columns, predicted=True)


NEAR = 0.02


@pytest.mark.parametrize("left", [0.0, 0.3, 0.7, 1.0])
def test_a_gap_of_which_a_part_is_left_is_closed_by_the_square_of_the_rest(place: Path, left: float) -> None:
    predict(place, "before", torque=1.05, vdc=1.05)
    predict(place, "after", torque=1.0 + 0.05 * left, vdc=1.0 + 0.05 * left)
    found = closure_of(place / "case", place / "predictions")
    assert found.parts == 5
    assert found.share == pytest.approx(1.0 - left**2, abs=NEAR)


def test_a_diagnosis_that_makes_it_worse_has_a_negative_share(place: Path) -> None:
    predict(place, "before", torque=1.02)
    predict(place, "after", torque=1.06)
    share = closure_of(place / "case", place / "predictions").share
    assert share is not None
    assert share < -5.0


def test_a_zero_of_a_sensor_is_no_gap(place: Path) -> None:
    log = place / "case" / "r36ohm.csv"
    lines = log.read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        row[3] = str(float(row[3]) + 0.06)  # two standard uncertainties of the pressure
    log.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
    predict(place, "before")
    predict(place, "after")
    assert closure_of(place / "case", place / "predictions").share is None


def test_without_a_gap_there_is_no_share(place: Path) -> None:
    predict(place, "before")
    predict(place, "after", torque=1.05)
    assert closure_of(place / "case", place / "predictions").share is None


def test_without_predictions_the_reason_is_reported(place: Path) -> None:
    assert closure_of(place / "case", place / "predictions").fault == "no predicted logs"
    predict(place, "before", torque=1.05)
    assert "after" in (closure_of(place / "case", place / "predictions").fault or "")


def test_predictions_on_other_stamps_are_not_compared(place: Path) -> None:
    predict(place, "before", torque=1.05)
    predict(place, "after")
    path = place / "predictions" / "after" / "r36ohm.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:-100]) + "\n")
    assert "other stamps" in (closure_of(place / "case", place / "predictions").fault or "")
