"""LabVIEW measurement files: what they state of themselves is used, and no line of their
headings is taken for data.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from winchcascade import read_run
from winchcascade.core.errors import LogError

SAMPLES = Path(__file__).parents[3] / "shared" / "data" / "benches" / "lvm-samples"
TOP = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\t{axis}\nTime\t09:51:39,1970510124996\n"
END = "***End_of_Header***\t\n"

here = pytest.mark.skipif(
    not SAMPLES.exists(), reason="the example logs lie in ../shared/data, which is not here"
)


def lvm(
    names: list[str],
    units: list[str],
    rows: list[str],
    *,
    axis: str = "No",
    steps: tuple[str, ...] = (),
) -> str:
    steps = steps or ("4,0E-2",) * len(names)
    heading = {
        "Channels": [str(len(names))],
        "Date": ["2013/02/19"] * len(names),
        "Time": ["09:51:40,7271890640258789063"] * len(names),
        "Y_Unit_Label": units,
        "X0": ["0,0000000000000000E+0"] * len(names),
        "Delta_X": [*steps],
    }
    lines = ["\t".join([key, *cells, ""]) for key, cells in heading.items()]
    body = "\n".join([*lines, END.strip(), "\t".join(["X_Value", *names, "Comment"]), *rows])
    return TOP.format(axis=axis) + END + "\t\n" + body + "\n"


def write(folder: Path, content: str) -> Path:
    path = folder / "log.lvm"
    path.write_text(content, encoding="cp1252")
    return path


def test_one_channel_without_an_x_column_takes_its_interval_from_the_heading(
    tmp_path: Path,
) -> None:
    run = read_run(write(tmp_path, lvm(["Velocity"], ["m/s"], [f"\t0,{k:06d}" for k in range(40)])))
    assert run.fs == pytest.approx(25.0)
    assert np.allclose(run.channels["velocity"], np.arange(40) * 1e-6)


@pytest.mark.parametrize(("separator", "name"), [(",", "Comma"), (";", "Semicolon")])
def test_a_file_whose_headings_use_its_own_separator_is_read(
    separator: str, name: str, tmp_path: Path
) -> None:
    content = lvm(["Velocity", "Force"], ["m/s", "N"], [f"\t0.5\t{k}.25" for k in range(40)])
    content = (
        content.replace("\t,\n", "\t.\n")
        .replace(",", ".")
        .replace("\t", separator)
        .replace("Tab", name)
    )
    run = read_run(write(tmp_path, content))
    assert run.fs == pytest.approx(25.0)
    assert np.allclose(run.channels["force"], np.arange(40) + 0.25)


def test_channels_of_different_intervals_and_a_heading_without_rows_are_rejected(
    tmp_path: Path,
) -> None:
    content = lvm(
        ["Velocity", "Force"], ["m/s", "N"], ["\t0,5\t1,5"] * 40, steps=("4,0E-2", "2,0E-2")
    )
    with pytest.raises(LogError, match=r"Velocity 0.04 s, Force 0.02 s"):
        read_run(write(tmp_path, content))
    with pytest.raises(LogError, match="a LabVIEW heading but no rows of numbers below it"):
        read_run(write(tmp_path, lvm(["Velocity"], ["m/s"], [])))


@here
def test_the_sample_with_a_velocity_is_read() -> None:
    run = read_run(SAMPLES / "made_from_short_lvm.lvm")
    assert (run.samples, run.fs, set(run.channels)) == (3000, 25.0, {"velocity", "force"})


@here
@pytest.mark.parametrize(
    ("name", "listed"),
    [
        ("multi_time_column", "Voltage (Volts), Acceleration (g)"),
        ("no_decimal_separator", "ax (g), ay (g), az (g)"),
        ("short", "Excitation (Trigger) (Newtons), Response (Trigger) (m/s^2)"),
        ("short_new_line_end", "Excitation (Trigger) (Newtons), Response (Trigger) (m/s^2)"),
        ("with_comments", "Pressão ABS. (MPa)"),
        ("with_empty_fields", "Dev0/Ai0, Dev0/Ai2, Untitled"),
    ],
)
def test_samples_of_other_experiments_are_rejected_with_their_channels(
    name: str, listed: str
) -> None:
    with pytest.raises(LogError) as caught:
        read_run(SAMPLES / f"{name}.lvm")
    assert "no column for a motion" in str(caught.value)
    assert listed in str(caught.value)
