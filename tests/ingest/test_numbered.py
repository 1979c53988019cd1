"""Logs without names: the rig file numbers their columns."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign_log import HEAD, ROWS, SAME, clean, efficiencies, kinds, read, text

from winchcascade.core.errors import LogError
from winchcascade.core.rig_toml import parse_rig

CHANNELS = ["time", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc"]
UNITS = ["s", "m", "m/s", "kgf/cm2", "N", "N.m", "V", "A"]
NUMBERED = "".join(
    f'{name} = {{ number = {k}, unit = "{unit}" }}\n'
    for k, (name, unit) in enumerate(zip(CHANNELS, UNITS, strict=True), 1)
)
BARE = "".join(",".join(row) + "\n" for row in ROWS)


def rig(columns: str) -> str:
    return f'based_on = "hsu2026"\nname = "numbered"\n[columns]\n{columns}'


def test_a_log_without_names_is_read_by_the_numbers_of_its_columns(tmp_path: Path) -> None:
    run = read(tmp_path, BARE, rig=parse_rig(rig(NUMBERED), "rig.toml"))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_number_overrides_the_names_of_a_log(tmp_path: Path) -> None:
    swapped = [[*row[:4], row[5], row[4], *row[6:]] for row in ROWS]
    given = rig(
        'force = { number = 6, unit = "N", override = true }\ntorque = { number = 5, unit = "N.m", override = true }\n'
    )
    run = read(tmp_path, text(swapped, HEAD), rig=parse_rig(given, "rig.toml"))
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_without_numbers_the_message_shows_how_to_give_them(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"number the columns in a rig file: \[columns\] velocity = \{ number = 3"):
        read(tmp_path, BARE)


def test_a_number_beyond_the_columns_is_reported(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no column 9, which the rig numbered names for idc; the log has 8 columns"):
        read(tmp_path, BARE, rig=parse_rig(rig(NUMBERED.replace("number = 8", "number = 9")), "rig.toml"))
