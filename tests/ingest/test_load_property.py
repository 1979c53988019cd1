"""The load among the properties of a file: read with its unit, or reported as unreadable."""

import math
from pathlib import Path

import pytest

from winchcascade import read_run

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r9ohm.csv"


def with_property(folder: Path, line: str) -> Path:
    path = folder / "log.csv"
    path.write_text(f"{line}\n{LOG.read_text()}", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("line", "ohm"),
    [
        ("Load: 9 ohm / 50 Hz", 9.0),
        ("Load: 9.0 Ohm", 9.0),
        ("Load: 9 \u03a9", 9.0),
        ("R_load: 0.009 kohm", 9.0),
        ("load_mOhm: 9000", 9.0),
        ("load_ohm: 9", 9.0),
        ("Load resistance: 9000 mOhm (water cooled)", 9.0),
        ("Load: open circuit", math.inf),
        ("Load: inf", math.inf),
    ],
)
def test_a_resistance_is_read_with_its_unit(tmp_path: Path, line: str, ohm: float) -> None:
    run = read_run(with_property(tmp_path, line))
    assert run.load == pytest.approx(ohm)
    assert run.load_source.startswith("property")
    assert not run.findings


@pytest.mark.parametrize(
    "line",
    [
        "Load: 1 kW",
        "Load: 9 / 50 Hz",
        "Load: 9 ohm or 18 ohm",
        "Load: high",
        "Load: -9 ohm",
        "Load: 9 V",
    ],
)
def test_what_is_no_single_resistance_is_reported_and_not_used(tmp_path: Path, line: str) -> None:
    run = read_run(with_property(tmp_path, line))
    assert run.load is None
    (finding,) = run.findings
    assert finding.kind == "load_mismatch"
    assert "expected one resistance such as 9 ohm" in finding.message
