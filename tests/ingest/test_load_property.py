"""The load among the properties of a file: read with its unit, or reported as unreadable."""

import math
from pathlib import Path

import pytest

from winchcascade import read_run

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r9ohm.csv"


@pytest.mark.parametrize(
    ("line", "ohm"),
    [
        ("Load: 9 ohm / 50 Hz", 9.0), ("Load: 9 \u03a9", 9.0), ("R_load: 0.009 kohm", 9.0), ("load_mOhm: 9000", 9.0),
        ("load_ohm: 9", 9.0), ("Load resistance: 9000 mOhm (water cooled)", 9.0), ("Load: open "
                                                                                   "circuit", math.inf),
        ("Load: 1 kW", None), ("Load: 9 / 50 Hz", None), ("Load: 9 ohm or 18 ohm", None), ("Load: high", None),
        ("Load: -9 ohm", None), ("Load: 9 V", None),
    ],
)  # fmt: skip
def test_one_resistance_is_read_with_its_unit_and_anything_else_is_reported(
    line: str, ohm: float | None, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"{line}\n{LOG.read_text()}", encoding="utf-8")
    run = read_run(path)
    assert run.load == (None if ohm is None else pytest.approx(ohm))
    assert run.load_source.startswith("property" if ohm is not None else "unknown")
    assert [f.kind for f in run.findings] == ([] if ohm is not None else ["load_mismatch"])
