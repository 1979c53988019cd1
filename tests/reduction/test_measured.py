"""The measured logs that ship, reduced with the rig files beside them and compared with sums
that need no winchcascade.
"""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from winchcascade import audit, reduce
from winchcascade.core.run import Signal

FOLDER = Path(__file__).parents[2] / "fixtures" / "measured"
BUOY = FOLDER / "mbari" / "2021.07.26T10.51.44.exp.gz"
TURBINE = FOLDER / "turbine" / "MM_axial_PDLT_compressedair_05192023.csv.gz"
DYNO = FOLDER / "vdyno_steps.csv"

METRES_PER_INCH, NEWTONS_PER_POUND, RPM = 0.0254, 4.4482216152605, 30.0 / math.pi

WITHIN = 1e-3
"""Share by which the energy of a stretch may differ from the sum over its samples."""


def columns(path: Path, *wanted: int, delimiter: str | None = None) -> list[Signal]:
    """Columns of a log by their numbers, rows without numbers left out."""
    text = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    lines = text.decode("utf-8", "replace").splitlines()[1:]
    rows = np.genfromtxt(lines, delimiter=delimiter, usecols=wanted)
    return list(rows[np.isfinite(rows).all(axis=1)].T)


def test_what_battery_and_load_dump_of_the_buoy_take_is_0_648_of_what_the_rod_gives() -> None:
    (cycle,) = reduce(BUOY).cycles
    t, speed, pounds, volts, battery, dump = columns(BUOY, 0, 2, 16, 6, 8, 9)
    rod = METRES_PER_INCH * speed * NEWTONS_PER_POUND * pounds
    line, dc, charged = np.trapezoid([rod, volts * (battery + dump), volts * battery], t)
    assert cycle.metrics.value("energy_line") == pytest.approx(line, rel=1e-6)
    assert cycle.metrics.value("energy_dc") == pytest.approx(dc, rel=1e-6)
    assert cycle.metrics.value("eta_line_dc") == pytest.approx(0.648, abs=5e-4)
    assert charged / line == pytest.approx(0.371, abs=5e-4)
    part = (t >= 100.0) & (t <= 200.0)
    line, dc = np.trapezoid([rod[part], (volts * (battery + dump))[part]], t[part])
    assert dc / line == pytest.approx(
        0.663, abs=5e-4
    )  # a part of the record has another efficiency


def test_the_energy_of_the_turbine_is_that_of_the_power_that_its_stand_logs() -> None:
    found = reduce(TURBINE)
    t, (_, logged) = found.run.t, columns(TURBINE, 1, 3, delimiter=",")
    assert len(found.cycles) == 4
    for cycle in found.cycles:
        inside = (t >= cycle.window.onset) & (t <= cycle.window.cutoff)
        energy = float(np.trapezoid(-logged[inside], t[inside]))
        assert cycle.metrics.energy_mech == pytest.approx(energy, rel=WITHIN)


def test_each_step_of_the_dynamometer_has_the_energy_of_its_samples() -> None:
    found = reduce(DYNO)
    rpm, torque = columns(DYNO, 0, 6, delimiter=",")
    power = rpm * torque / RPM
    assert len(found.cycles) >= 3
    for cycle in found.cycles:
        begin, end = round(cycle.window.onset * 10), round(cycle.window.cutoff * 10)
        assert cycle.metrics.energy_mech == pytest.approx(
            float(np.trapezoid(power[begin : end + 1], dx=0.1)), rel=WITHIN
        )


def test_two_heads_of_the_table_of_the_spindle_are_exchanged() -> None:
    found = audit(FOLDER / "spindle" / "spindle.toml")
    assert [(fault.kind, set(fault.columns)) for fault in found.faults] == [
        ("swapped", {"power_mech", "power_factor"})
    ]
    assert not found.contradictions


@pytest.mark.parametrize("log", [BUOY, TURBINE, DYNO], ids=["buoy", "turbine", "dynamometer"])
def test_a_shipped_log_is_stated_as_measured_and_its_rig_file_is_short(log: Path) -> None:
    found = reduce(log)
    assert found.run.origin.measured
    assert not found.rig.assumed
    assert len(Path(found.rig.path).read_text(encoding="utf-8").splitlines()) <= 20


@pytest.mark.parametrize(
    "licence", ["mbari/LICENSE", "turbine/LICENSE", "spindle/LICENSE", "LICENSE-vdyno.txt"]
)
def test_a_measured_log_has_its_licence_beside_it(licence: str) -> None:
    assert (FOLDER / licence).read_text(encoding="utf-8").split()[0] in ("Apache", "MIT")
