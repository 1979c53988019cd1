"""Findings of logs and of own simulations in the record of a diagnosis, and simulations in a
unit that was assumed.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from winchcascade.batch.campaign_diagnosis import diagnose_campaign
from winchcascade.core.errors import LogError
from winchcascade.diagnosis.diagnosis_result import Shrunk
from winchcascade.rig.effects.catalogue import EFFECTS

ONE_CYCLE = 45.0
"""Within this time of a log is its first cycle. [s]"""

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOADS = {"r36ohm.csv": 36.0, "r9ohm.csv": 9.0}


def scaled(text: str, header: str, factor: float, called: str, zero: float = 0.0) -> str:
    """A log with a column under another name and in another unit."""
    head, *rows = (line.split(",") for line in text.splitlines())
    k = head.index(header)
    lines = [[*row[:k], repr(float(row[k]) * factor + zero), *row[k + 1 :]] for row in rows]
    return "\n".join(map(",".join, [[*head[:k], called, *head[k + 1 :]], *lines])) + "\n"


def record(
    folder: Path,
    fixtures: Path,
    simulation: tuple[str, float, str] | None = None,
    torque_zero: float = 0.0,
) -> Mapping[str, Any]:
    """The diagnosis of one cycle of two logs, each beside a copy of itself as its simulation,
    with one column changed there.
    """
    entries = []
    for name, load in LOADS.items():
        head, *rows = (fixtures / "campaign" / name).read_text().splitlines()
        text = "\n".join([head, *(row for row in rows if float(row.split(",")[0]) < ONE_CYCLE)])
        (folder / name).write_text(scaled(text, "Torque (N.m)", 1.0, "Torque (N.m)", torque_zero))
        entries.append(f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n')
        if simulation is not None:
            (folder / f"own_{name}").write_text(scaled(text, *simulation))
            entries.append(f'simulated = "own_{name}"\n')
    (folder / "campaign.toml").write_text("".join(entries))
    suspects = {name: EFFECTS[name] for name in ("line_drag", "ke_rolloff")}
    return diagnose_campaign(folder / "campaign.toml", suspects=suspects)


@pytest.fixture(scope="module")
def with_zero(
    tmp_path_factory: pytest.TempPathFactory,
) -> Mapping[str, Any]:
    """The diagnosis of logs whose torque has a zero of 4 N m."""
    return record(tmp_path_factory.mktemp("zero"), FIXTURES, torque_zero=4.0)


def kinds(files: list[Mapping[str, Any]]) -> dict[str, list[tuple[str, str | None]]]:
    return {one["file"]: [(f["kind"], f["channel"]) for f in one["findings"]] for one in files}


def test_findings_of_the_logs_are_in_the_record_also_those_of_their_cycles(
    with_zero: Mapping[str, Any],
) -> None:
    assert with_zero["simulations"] == []
    assert all(("zero_offset", "torque") in one for one in kinds(with_zero["logs"]).values())


@pytest.mark.slow
def test_a_unit_that_was_assumed_of_a_simulation_is_in_the_record(
    fixtures: Path, tmp_path: Path
) -> None:
    found = record(tmp_path, fixtures, ("Vdc (V)", 1.0, "Vdc"))
    assert kinds(found["simulations"]) == {
        f"own_{name}": [("unit_assumed", "vdc")] for name in LOADS
    }
    assert all(one["findings"][0]["message"] for one in found["simulations"])


@pytest.mark.parametrize(
    ("header", "factor", "name", "assumed", "likely"),
    [
        ("Pressure (kg/cm2)", 98066.5, "Pressure", "kg/cm2", "Pa"),
        ("Force (N)", 1.0 / 9.80665, "Force", "N", "kgf"),
        ("Idc (A)", 1050.0, "Idc", "A", "mA"),
    ],
)
def test_a_simulation_in_another_unit_than_the_assumed_one_is_rejected(
    header: str, factor: float, name: str, assumed: str, likely: str, fixtures: Path, tmp_path: Path
) -> None:
    with pytest.raises(LogError) as fault:
        record(tmp_path, fixtures, (header, factor, name))
    assert {name.casefold(), assumed, likely} <= set(
        str(fault.value).replace(",", "").replace(".", "").split()
    )
    assert "own_" in str(fault.value)


@pytest.mark.slow
def test_a_level_far_from_that_of_the_log_is_accepted_where_the_unit_is_stated(
    fixtures: Path, tmp_path: Path
) -> None:
    with pytest.raises(LogError, match="23 times"):
        record(tmp_path, fixtures, ("Vdc (V)", 23.0, "Vdc"))
    stated = record(tmp_path, fixtures, ("Vdc (V)", 23.0, "Vdc (V)"))
    assert kinds(stated["simulations"]) == {f"own_{name}": [] for name in LOADS}


def test_a_channel_that_the_causes_make_worse_is_marked_as_such(
    with_zero: Mapping[str, Any],
) -> None:
    assert [Shrunk(3.0, after, 1.0).worse for after in (0.0, 3.1, 3.2)] == [False, False, True]
    closure = with_zero["closure"]
    assert closure is not None
    for one in closure["channels"].values():
        assert one["worse"] == (one["after"] ** 2 - one["before"] ** 2 > one["noise"] ** 2)
