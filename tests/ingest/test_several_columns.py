"""Several columns that could be one channel: the other channels decide, else none is read and the log is still reduced."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from campaign_log import HEAD, ROWS, SAME, clean, efficiencies, read, text

from winchcascade import Run
from winchcascade.core.errors import LogError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import parse_rig

PRESSURE, FORCE, TORQUE = HEAD[3], HEAD[4], HEAD[5]


def with_column(head: str, value: Callable[[int, list[str]], str], *, first: bool = False) -> str:
    """The clean log with one more column behind the others, or before them."""
    rows = [[row[0], value(k, row), *row[1:]] if first else [*row, value(k, row)] for k, row in enumerate(ROWS)]
    return text(rows, [HEAD[0], head, *HEAD[1:]] if first else [*HEAD, head])


def wave(k: int, _: list[str]) -> str:
    return f"{6.0 + math.sin(0.37 * k):.4f}"


def found(run: Run) -> tuple[str, str, str | None]:
    (finding,) = [f for f in run.findings if f.kind == "ambiguous_column"]
    return finding.message, finding.action, finding.channel


@pytest.mark.parametrize("first", [True, False])
def test_the_pressure_is_the_one_that_follows_the_stroke(first: bool, tmp_path: Path) -> None:
    run = read(
        tmp_path,
        with_column("Pressure 2 (kg/cm2)", wave, first=first).replace(PRESSURE, "Pressure 1 (kg/cm2)"),
    )
    message, action, channel = found(run)
    assert "2 columns could be the pressure" in message
    assert "'Pressure 1 (kg/cm2)' is read: it follows the displacement (correlation" in action
    assert channel == "pressure"
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(("head", "other"), [(FORCE, "torque"), (TORQUE, "force"), (HEAD[2], "displacement")])
def test_of_two_columns_of_one_name_the_one_that_follows_another_channel_is_read(
    head: str, other: str, tmp_path: Path
) -> None:
    run = read(tmp_path, with_column(head, wave))
    message, action, _ = found(run)
    assert f"(column {len(HEAD) + 1})" in message
    assert f"(column {HEAD.index(head) + 1}) is read: it follows the {other}" in action
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_columns_of_the_same_signal_count_as_one(tmp_path: Path) -> None:
    run = read(tmp_path, with_column(FORCE, lambda _, row: row[4]))
    assert "is read: they hold the same signal" in found(run)[1]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_an_empty_column_is_not_the_channel(tmp_path: Path) -> None:
    run = read(tmp_path, with_column(FORCE, lambda *_: "", first=True))
    assert "(column 6) is read: the others hold no numbers" in found(run)[1]


def test_without_a_clear_column_the_channel_is_left_out_and_the_log_is_read(tmp_path: Path) -> None:
    run = read(tmp_path, with_column(TORQUE, lambda _, row: f"{1.05 * float(row[5]):.5f}"))
    message, action, _ = found(run)
    assert "2 columns could be the torque: 'Torque (N.m)' (column 6), 'Torque (N.m)' (column 9)" in message
    assert action == "none is read; name the right one in a rig file under [columns]"
    assert "torque" not in run.channels
    assert "force" in run.channels


def test_the_rig_file_decides_first(tmp_path: Path) -> None:
    rig: Rig = parse_rig('based_on = "hsu2026"\nname = "two"\n[columns]\npressure = "Pressure 2"\n', "two.toml")
    run = read(tmp_path, with_column("Pressure 2 (kg/cm2)", wave), rig=rig)
    assert {f.kind for f in run.findings} >= {"unknown_column"}
    assert "ambiguous_column" not in {f.kind for f in run.findings}


def test_a_log_that_shows_nothing_but_two_possible_motions_is_rejected(tmp_path: Path) -> None:
    rows = [[row[0], row[2], wave(k, row)] for k, row in enumerate(ROWS)]
    with pytest.raises(LogError) as caught:
        read(tmp_path, text(rows, [HEAD[0], HEAD[2], "Line speed (m/s)"]))
    assert "several columns could be the motion or the power: 'Velocity (m/s)', 'Line speed (m/s)'" in str(caught.value)
