"""Files with several tables: a log is read where it is the only one or is named, and never
chosen silently.
"""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest
from calls import call
from nptdms import ChannelObject, TdmsWriter
from read_here import readers_here
from scipy.io import savemat

from winchcascade import read_run
from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import run_batch
from winchcascade.core.errors import CampaignError, LogError

FIXTURES = Path(__file__).parents[2] / "fixtures" / "campaign"
UNITS = {"Time": "s", "Velocity": "m/s", "Force": "N"}


def motion(seed: int, rows: int = 400) -> np.ndarray[Any, Any]:
    """Time, velocity and force of a few payouts; each seed has its own force, so that it shows
    which was read.
    """
    t = 0.04 * np.arange(rows)
    v = 0.8 * np.sin(2 * np.pi * t / 8.0)
    return np.column_stack([t, v, np.where(v > 0, 1500.0, 300.0) + 10.0 * seed + 5 * np.sin(7 * t)])


def peak(run: Any) -> int:
    """Which seed was read."""
    return int((float(run.channels["force"].max()) - 1500.0) // 10)


def workbook(path: Path, runs: dict[str, int]) -> Path:
    """Runs as sheets, the last one hidden, behind sheets of notes, parameters and bins, which
    are no logs.
    """
    book = openpyxl.Workbook(write_only=True)
    tables: dict[str, list[Any]] = {
        "Notes": [["note"], *[["the crane stood still", "by H."]] * 30],
        "Parameters": [
            ("Name", "Value", "Speed (m/s)"),
            *((f"p{k}", k, 0.1 * k) for k in range(6)),
        ],
        "Bins": [("Speed (rpm)", "Power (W)"), *((100 * k, 10.0 * k) for k in range(40))],
    }
    head = [f"{name} ({unit})" for name, unit in UNITS.items()]
    for name, rows in (
        tables | {name: [head, *motion(seed).tolist()] for name, seed in runs.items()}
    ).items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    if len(runs) > 1:
        sheet.sheet_state = "hidden"
    book.save(path)
    return path


def struct_array(path: Path, runs: dict[str, int]) -> Path:
    array = np.zeros(len(runs), dtype=[(name, object) for name in ("t", "velocity", "force")])
    for k, seed in enumerate(runs.values()):
        array[k] = tuple(motion(seed).T)
    savemat(path, {"run": array})
    return path


def groups(path: Path, runs: dict[str, int]) -> Path:
    with TdmsWriter(path) as writer:
        for name, seed in runs.items():
            columns = zip(UNITS.items(), motion(seed, 400 + seed).T, strict=True)
            writer.write_segment(
                [ChannelObject(name, c, x, properties={"unit_string": u}) for (c, u), x in columns]
            )
    return path


SEVERAL: dict[str, tuple[Callable[[Path, dict[str, int]], Path], list[str]]] = {
    "a.xlsx": (workbook, ["Run 1", "Run 2"]),
    "a.mat": (struct_array, ["run(1)", "run(2)"]),
    "a.tdms": (groups, ["Run 1", "Run 2"]),
}


@pytest.mark.parametrize("file", SEVERAL)
def test_of_several_tables_the_named_one_is_read_and_none_is_chosen(
    tmp_path: Path, file: str
) -> None:
    write, names = SEVERAL[file]
    path = write(tmp_path / file, {names[0]: 1, names[1]: 4})
    with readers_here():
        with pytest.raises(LogError, match="--sheet NAME") as fault:
            read_run(path)
        assert ", ".join(map(repr, names)) in str(fault.value)
        for name, seed in zip(names, (1, 4), strict=True):
            run = read_run(path, table=name.upper())
            assert (run.table, peak(run)) == (name, seed)
        with pytest.raises(LogError, match=r"'Run 9'; expected one of .*or a number from 1 to \d"):
            read_run(path, table="Run 9")
        run = read_run(write(tmp_path / f"single {file}", {names[0]: 3}))
        assert (run.table, peak(run)) == (names[0] if file != "a.mat" else None, 3)


def test_a_number_counts_all_sheets_and_one_without_a_table_is_rejected(tmp_path: Path) -> None:
    path = workbook(tmp_path / "a.xlsx", {"Run 1": 1, "2": 4})
    with readers_here():
        assert peak(read_run(path, table="4")) == 1
        assert peak(read_run(path, table="2")) == 4  # a name comes before a number
        with pytest.raises(
            LogError, match="'Notes' does not have a row of names over columns of numbers"
        ):
            read_run(path, table="Notes")
    with pytest.raises(LogError, match=r"is one table, and --sheet Run 1 names another"):
        read_run(FIXTURES / "r36ohm.csv", table="Run 1")


# ------------------------------------------------------------------------- commands and campaigns
@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of the shipped campaign as sheets of one workbook."""
    path = tmp_path_factory.mktemp("book") / "all.xlsx"
    out = openpyxl.Workbook(write_only=True)
    for name in ("r36ohm", "r9ohm"):
        sheet = out.create_sheet(name)
        with (FIXTURES / f"{name}.csv").open(newline="") as file:
            for k, row in enumerate(csv.reader(file)):
                sheet.append(row if k == 0 else [float(cell) if cell else None for cell in row])
    out.save(path)
    return path


ENTRIES = '[[run]]\nfile = "all.xlsx"\nsheet = "r36ohm"\nload_ohm = 36.0\nwindow_s = 5.48\n'
ENTRIES += (
    '[[run]]\nfile = "all.xlsx"\nsheet = 2\nload_ohm = 9.0\nwindow_s = 5.96\nwithheld = true\n'
)


def test_a_command_names_the_sheet_and_shows_it(book: Path) -> None:
    assert (
        "2 sheets could be the log: 'r36ohm', 'r9ohm'"
        in call("reduce", book, "--load-ohm", "36").err
    )
    done = call("reduce", book, "--load-ohm", "9", "--sheet", "2", "--json", "-")
    assert json.loads(done.out)["log"]["table"] == "r9ohm"


def test_a_campaign_lists_the_sheets_of_one_file_as_runs_of_their_own(
    book: Path, tmp_path: Path
) -> None:
    (book.parent / "campaign.toml").write_text(ENTRIES)
    plan = make_plan([str(book.parent)])
    names = {"all.xlsx-sheet-r36ohm": "r36ohm", "all.xlsx-sheet-2": "2"}
    assert {work.name: work.settings.sheet for work in plan.work} == names
    assert len({work.key for work in plan.work}) == 2
    with readers_here():
        done = run_batch(plan, tmp_path / "out")
    assert done.faults == {}
    assert [run.table for run in done.summary.reduced] == ["r36ohm", "r9ohm"]
    for name, energy in zip(names, (4956.2, 5309.3), strict=True):
        record = json.loads((tmp_path / "out" / "runs" / f"{name}.json").read_bytes())
        assert record["mean"]["energy_gen_j"] == pytest.approx(energy, abs=0.5)
    with readers_here():
        assert run_batch(plan, tmp_path / "out").kept == 2
        assert "lists 2 sheets of all.xlsx: 'r36ohm', '2'; expected one" in call("reduce", book).err
        assert "load 36 ohm (campaign.toml)" in call("reduce", book, "--sheet", "r36ohm").out


@pytest.mark.parametrize("sheet", ["1.5", '""', '["a"]'])
def test_a_sheet_that_is_no_name_is_reported(tmp_path: Path, sheet: str) -> None:
    (tmp_path / "campaign.toml").write_text(f'[[run]]\nfile = "a.xlsx"\nsheet = {sheet}\n')
    with pytest.raises(CampaignError, match="run 1: sheet is"):
        make_plan([str(tmp_path)])
