"""What the report of a calibration and its JSON state."""

from functools import cache
from pathlib import Path

import msgspec
import pytest
from openlog import made_log

from winchcascade import Calibration, calibrate
from winchcascade.core.files import json_bytes
from winchcascade.core.rig_toml import built_in
from winchcascade.report.content import Cell, Measured, Report, Table
from winchcascade.report.results.calibration import calibration_record, calibration_report
from winchcascade.report.views import write_report


@cache
def calibration() -> Calibration:
    return calibrate(made_log(seed=1), built_in())


def changed(name: str, **fields: float) -> Calibration:
    """The calibration with another number."""
    numbers = tuple(
        msgspec.structs.replace(n, **fields) if n.name == name else n for n in calibration().numbers
    )
    return msgspec.structs.replace(calibration(), numbers=numbers)


def table(report: Report, name: str) -> list[dict[str, Cell]]:
    (found,) = [block for block in report.blocks if isinstance(block, Table) and block.id == name]
    heads = [column.name for column in found.columns]
    return [dict(zip(heads, row, strict=True)) for row in found.cells]


def findings(found: Calibration) -> list[str]:
    return [note.text for note in calibration_report(found).notes if note.about == "Finding"]


def test_every_number_stands_beside_that_of_the_rig_file_with_its_interval() -> None:
    rows = table(calibration_report(calibration()), "calibrated-numbers")
    assert [row["number"] for row in rows] == ["k_e", "mu_screw", "eta_mesh", "b_rotor"]
    for row, number in zip(rows, calibration().numbers, strict=True):
        assert row["found"] == Measured(number.value, number.u)
        assert row["rig file"] == Measured(number.before, number.u)
        assert row["95 % interval"] == (number.low, number.high, number.u)
    assert [tile.name for tile in calibration_report(calibration()).tiles] == [
        "k_e",
        "mu_screw",
        "b_rotor",
    ]


@pytest.mark.parametrize(
    ("lag", "u_lag", "part"),
    [
        (0.120, 0.003, "120 ms late"),
        (-0.050, 0.003, "50 ms early"),
        (0.120, 0.050, ""),
        (0.004, 0.001, ""),
    ],
)
def test_a_lag_is_a_finding_where_it_is_beyond_doubt(lag: float, u_lag: float, part: str) -> None:
    late = msgspec.structs.replace(calibration().regression, lag=lag, u_lag=u_lag)
    found = findings(msgspec.structs.replace(calibration(), regression=late))
    assert len(found) == bool(part)
    assert part in "".join(found)


def test_without_convergence_only_the_regression_is_a_result() -> None:
    loose = msgspec.structs.replace(calibration(), settled=False)
    assert [tile.name for tile in calibration_report(loose).tiles] == ["k_e"]
    assert len(findings(loose)) == 1


def test_the_page_has_the_figures_of_damper_screw_and_back_emf(tmp_path: Path) -> None:
    page = write_report(changed("mu_screw", value=-0.01), tmp_path / "a.html").read_text(
        encoding="utf-8"
    )
    assert 'id="figure-model-emf"' in page
    assert 'id="figure-model-damper"' in page


def test_a_number_that_the_rig_file_did_not_have_has_no_value_before() -> None:
    unknown = changed("k_e", before=float("nan"), u_before=float("inf"))
    number = msgspec.json.decode(json_bytes(calibration_record(unknown)))["numbers"][0]
    assert (number["before"], number["u_before"]) == (None, None)
    (found,) = [
        b
        for b in calibration_report(unknown).blocks
        if isinstance(b, Table) and b.id == "calibrated-numbers"
    ]
    assert found.texts[0][1] == "-"
