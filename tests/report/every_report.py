"""Every kind of page that commands write, each made once from logs, campaigns and rigs of any
names and titles.
"""

from __future__ import annotations

import math
import os
import shutil
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from unittest import mock

from bench_logs import write_bench_logs
from calls import call
from diagnosed import diagnosed
from inputs import worn
from msgspec.structs import replace

from winchcascade.report.render import page as page_module
from winchcascade.report.results.diagnosis import diagnosis_report

if TYPE_CHECKING:
    from collections.abc import Iterator

    from winchcascade.report.content import Report

ROOT = Path(__file__).parents[2]
CAMPAIGN, DAMAGED = ROOT / "fixtures" / "campaign", ROOT / "fixtures" / "damaged_logs"
KITE = ROOT.parent / "shared" / "data" / "kitepower-2019-10-08"
"""Logs of a winch without a model, beside the project; users do not have them."""

LOGS = {
    "r36ohm": CAMPAIGN / "r36ohm.csv",
    "open_circuit": CAMPAIGN / "open_circuit.csv",
    **{name: DAMAGED / f"{name}.csv" for name in ("dropouts", "aborted", "no_torque")},
}
LOADS = {"r36ohm": 36.0, "open_circuit": math.inf}
"""Logs of the campaign and of the other side of a comparison with their loads [ohm]."""

PATIENCE = 600
"""A command that has not ended after this never will. [s]"""

COMMANDS: dict[str, str] = {
    "log": "reduce|{odd}r36ohm.csv|--load-ohm|36|--window|5.48",
    "open circuit": "reduce|{odd}open_circuit.csv|--load-ohm|inf",
    "dropouts": "reduce|{odd}dropouts.csv|--load-ohm|36|--window|5.48",
    "aborted": "reduce|{odd}aborted.csv|--load-ohm|36",
    "without torque": "reduce|{odd}no_torque.csv|--load-ohm|36",
    "steps": "reduce|dyno.csv|--rig|dyno.toml",
    "waves": "reduce|sea_1.csv|--rig|waves.toml|--load-ohm|36",
    "campaign": "batch|campaign|--out|results|--reports|html|--jobs|1",
    "campaign of waves": "batch|sea.toml|--out|results|--reports|html|--jobs|1",
    "loss map": "batch|dyno.csv|--rig|dyno.toml|--out|results|--reports|html|--jobs|1|--loss-map|map.json",
    "check": "check|campaign|--against|hsu2026-table2|--jobs|1",
    "audit": "audit|hsu2026-table2",
    "audit of points": "audit|points.toml",
    "physics": "audit|hsu2026-table2|--physics",
    "calibrate": "calibrate|{odd}open_circuit.csv|--load-ohm|inf",
    "simulate": "simulate|{odd}r36ohm.csv|--load-ohm|36|--out|simulated.csv",
    "compare": "compare|campaign|other|--max-drop|0.01|--jobs|1",
    "line": "diagnose|kite|--jobs|1",
}
"""Commands by the kind of their page, words parted by bars; `{odd}` is how the names of logs
begin.
"""

DIAGNOSES = {"diagnosis": "rolloff", "nothing found": "nothing"}
"""Kinds of pages of a diagnosis with a model, by the campaign that is diagnosed."""

KINDS = (*COMMANDS, *DIAGNOSES)

SLOW = {
    "physics",
    "line",
    "campaign of waves",
    "loss map",
    "log",
    "without torque",
    "aborted",
    "open circuit",
}
"""Kinds that take long, or are variants of another one: a campaign has the page of each log."""


class Made(NamedTuple):
    """A page that a command wrote: what it states, and its text."""

    report: Report
    page: str


def made(
    kind: str, folder: Path, *, odd: str = "", title: str = "A campaign of two loads"
) -> list[Made]:
    """Call the command of a kind in an empty folder; the pages that it wrote there, in the order in
    which it made them. A diagnosis is that of several tests, under the title.
    """
    if kind in DIAGNOSES:
        found = replace(diagnosed(DIAGNOSES[kind]), title=title)
        report = diagnosis_report(found, command="winchcascade diagnose planted")
        made_here = Made(report, page_module.page_text(report))
        (folder / "page.html").write_text(made_here.page, encoding="utf-8")
        return [made_here]
    _write_inputs(kind, folder, odd, title)
    pages: list[Made] = []
    usual = page_module.page_text

    def noted(report: Report) -> str:
        pages.append(Made(report, usual(report)))
        return pages[-1].page

    words = COMMANDS[kind].format(odd=odd).split("|")
    page = [] if words[0] == "batch" else ["--html", "page.html"]
    with _within(folder), mock.patch.object(page_module, "page_text", noted):
        code, out, err = call(*words, *page, patience=PATIENCE)
    assert code in (0, 1), out + err
    assert pages, f"{kind} wrote no page"
    return pages


@contextmanager
def _within(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _write_inputs(kind: str, folder: Path, odd: str, title: str) -> None:
    """Write what the command of a kind reads."""
    words = COMMANDS[kind].split("|")
    for name, log in LOGS.items():
        if f"{{odd}}{name}.csv" in words:
            shutil.copy(log, folder / f"{odd}{name}.csv")
    if any(word in ("dyno.csv", "sea_1.csv", "sea.toml", "points.toml") for word in words):
        with _within(folder):
            write_bench_logs()
    for side in {"campaign", "other"} & set(words):
        _write_campaign(folder / side, odd, title)
    if "kite" in words:
        (folder / "kite").mkdir()
        shutil.copy(KITE / "ground_station_cycles_01_43.csv", folder / "kite" / f"{odd}kite.csv")
        _write_list(
            folder / "kite", title, f"file = '{odd}kite.csv'\ncycles = [1, 20]", rig="kitepower"
        )


def _write_campaign(folder: Path, odd: str, title: str) -> None:
    """Write a campaign of a load and an open circuit; the current of `other` is smaller."""
    folder.mkdir()
    for name in LOADS:
        text = (CAMPAIGN / f"{name}.csv").read_text(encoding="utf-8")
        (folder / f"{odd}{name}.csv").write_text(
            worn(text) if folder.name == "other" else text, encoding="utf-8"
        )
    runs = [
        f"file = '{odd}{name}.csv'\nload_ohm = {load}\nwindow_s = 5.48"
        for name, load in LOADS.items()
    ]
    _write_list(folder, title, *runs)


def _write_list(folder: Path, title: str, *runs: str, rig: str = "hsu2026") -> None:
    """Write a campaign.toml; the title stands between three quotes, which it must not hold."""
    entries = "".join(f"[[run]]\n{run}\n" for run in runs)
    (folder / "campaign.toml").write_text(
        f"title = '''{title}'''\nrig = \"{rig}\"\n{entries}", encoding="utf-8"
    )
