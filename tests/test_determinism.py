"""The same input gives the same files to the byte: in a second call, in any order of sets, on one
process and on two.

Reports tell when they were made, or the moment of SOURCE_DATE_EPOCH where it is set; nothing else
knows the time.
"""

import re
import shutil
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import pytest
from test_cli import started

FIXTURES = Path(__file__).parent.parent / "fixtures" / "campaign"
LOG = str(FIXTURES / "r18ohm.csv")
OPEN = str(FIXTURES / "open_circuit.csv")
LOADS = {"r18ohm.csv": 18.0, "r4p5ohm.csv": 4.5}

EPOCH, LATER = "1767225600", "1800000000"
MADE_ON = re.compile(rb"20\d\d-\d\d-\d\d[ T]\d\d:\d\d:\d\d( UTC|Z)")

TABLE = "hsu2026-table2"
REPORTS = ("--json", "r.json", "--html", "r.html", "--pdf", "r.pdf")
JOBS = ("--jobs", "{jobs}")
BATCH = ("batch", "{campaign}", "--out", "out", *JOBS, "--reports")

Files = dict[str, bytes]


class Call(NamedTuple):
    """How commands are called: the seed of the order of sets, processes or threads, and the time
    that reports tell.
    """

    name: str
    seed: int = 1
    jobs: int = 1
    epoch: str = EPOCH


COMMANDS: dict[str, list[tuple[str, ...]]] = {
    "reduce": [("reduce", LOG, "--json", "r.json", "--parquet", "tables")],
    "simulate": [("simulate", LOG, "--with", "copper_heating.r_s_change=0.2", "--out", "s.csv")],
    "calibrate": [("calibrate", OPEN, "--json", "c.json", "--write", "rig.toml")],
    "check": [
        ("check", str(FIXTURES), "--against", TABLE, "--json", "c.json", "--junit", "c.xml", *JOBS)
    ],
    "audit": [("audit", TABLE, "--json", "a.json")],
    "batch": [(*BATCH, "none")],
    "reports": [("reduce", LOG, *REPORTS)],
    "batch with reports": [(*BATCH, "all", "--excel")],
    "diagnose": [
        (
            "diagnose",
            "{campaign}",
            "--withhold",
            "18",
            "--predictions",
            "predicted",
            *JOBS,
            *REPORTS,
        )
    ],
}
"""Commands by what they show, given one after the other in an empty folder."""

LONG = {
    "reduce",
    "simulate",
    "calibrate",
    "check",
    "audit",
    "reports",
    "batch with reports",
    "diagnose",
}
"""What takes more than ten seconds, or is part of another command or of the reference outputs."""

WITH_JOBS = [
    name for name, commands in COMMANDS.items() if any("{jobs}" in command for command in commands)
]
WITHOUT_JOBS = [name for name in COMMANDS if name not in WITH_JOBS]

DIGEST = re.compile(rb'"[0-9a-f]{64}"')
"""A SHA-256 in a JSON file."""

TABLE_IS_WRONG = 1
"""Exit code of an audit that finds a contradiction, as there is one in the printed table."""


def each(names: list[str]) -> pytest.MarkDecorator:
    """One test for each name, slow where it is long."""
    marked = [
        pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in names
    ]
    return pytest.mark.parametrize("name", marked)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Call], Files]:
    """Give every file that a call writes, and what it prints; each call is made once."""
    campaign = tmp_path_factory.mktemp("two loads")
    for log in LOADS:
        shutil.copy(FIXTURES / log, campaign)
    runs = [
        f'[[run]]\nfile = "{log}"\nload_ohm = {load}\nwindow_s = 5.96\n'
        for log, load in LOADS.items()
    ]
    (campaign / "campaign.toml").write_text("\n".join(runs))
    known: dict[Call, Files] = {}

    def give(call: Call) -> Files:
        if call not in known:
            known[call] = _made(call, campaign, tmp_path_factory.mktemp("place"))
        return known[call]

    return give


def _made(call: Call, campaign: Path, place: Path) -> Files:
    environment = {"PYTHONHASHSEED": str(call.seed), "SOURCE_DATE_EPOCH": call.epoch}
    printed = ""
    for command in COMMANDS[call.name]:
        words = [word.format(campaign=campaign, jobs=call.jobs) for word in command]
        done = started(*words, cwd=place, **environment)
        assert done.returncode == (TABLE_IS_WRONG if call.name == "audit" else 0), done.stderr
        printed += done.stdout
    found = {
        str(path.relative_to(place)): path.read_bytes()
        for path in sorted(place.rglob("*"))
        if path.is_file()
    }
    return {**found, "printed": printed.encode()}


def same(one: Files, other: Files) -> None:
    """Two calls wrote the same files, and the same into each."""
    assert list(one) == list(other)
    assert [name for name in one if one[name] != other[name]] == []


@pytest.mark.slow
@each([*WITHOUT_JOBS, "batch with reports"])
def test_a_second_call_gives_the_same_bytes(files: Callable[[Call], Files], name: str) -> None:
    first = files(Call(name))
    assert len(first) > 1
    same(first, files(Call(name, seed=2)))


@each(WITH_JOBS)
def test_two_processes_give_the_same_bytes_as_one(
    files: Callable[[Call], Files], name: str
) -> None:
    """Also in another order of sets."""
    first = files(Call(name))
    assert len(first) > 1
    same(
        _without_jobs(_compared(first)), _without_jobs(_compared(files(Call(name, seed=2, jobs=2))))
    )


def _compared(made: Files) -> Files:
    """Files of which the JSON hold no digests: those of the pages follow the pages, which are
    compared themselves.
    """
    return {
        path: DIGEST.sub(b"", content) if path.endswith(".json") else content
        for path, content in made.items()
    }


def _without_jobs(made: Files) -> Files:
    """Files without the number of processes, which a report's command tells; a PDF, in which it
    cannot be seen, is left out.
    """
    return {
        path: re.sub(rb"--jobs \d", b"", content)
        for path, content in made.items()
        if not path.endswith(".pdf")
    }


@each(["reduce", "batch", "reports", "batch with reports"])
def test_a_report_holds_the_time_once_and_nothing_else_does(
    files: Callable[[Call], Files], name: str
) -> None:
    one, other = _compared(files(Call(name))), _compared(files(Call(name, epoch=LATER)))
    timed = [path for path in one if one[path] != other[path]]
    reports = [
        path
        for path in one
        if path.endswith((".html", ".pdf", ".xlsx")) and path != "out/index.html"
    ]
    assert reports == timed  # the list of files in the index has no time of its own
    for path in timed:
        if path.endswith(".html"):
            assert len(MADE_ON.findall(one[path])) == 1
        if not path.endswith(".pdf"):
            assert _without_time(one[path]) == _without_time(other[path])


def _without_time(content: bytes) -> list[bytes]:
    """Contents without the time: of a page, or of every file in a workbook."""
    if not content.startswith(b"PK"):
        return [MADE_ON.sub(b"", content)]
    with zipfile.ZipFile(BytesIO(content)) as book:
        return [MADE_ON.sub(b"", book.read(name)) for name in book.namelist()]
