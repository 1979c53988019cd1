"""Harmful files: huge, lying, named to be obeyed, or no files at all. Each is read, or rejected
in one sentence.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import openpyxl
import pypdf
import pytest
from bombs import BOMBS
from calls import Called, call, error_sentence
from daily import daily
from loops import failures
from own_process import run_alone
from page_reader import PageReader
from seeds import HEADERS, LOG, ROOT, ROWS, text
from undrawn import undrawn

from winchcascade import LogError, read_run

POSIX = pytest.mark.skipif(os.name == "nt", reason="files as POSIX has them")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="memory as Linux counts it")
TABLE = "hsu2026-table2"

# --- small files that claim or unpack to much

MEMORY, SECONDS = 2000, 60
"""What a file of less than a megabyte may take: memory [MB] and time of the processor. [s]"""

QUICK = (
    "xlsx, a cell in the last corner",
    "gzip, a million columns",
    "mat, a claimed length",
    "tdms, claimed samples",
)
"""Bombs of every day, that are made and rejected in a second; slow tests do the others."""


@LINUX
@pytest.mark.parametrize("name", daily(BOMBS, QUICK))
def test_a_small_file_that_claims_much_is_read_or_rejected_within_limits(
    name: str, tmp_path: Path
) -> None:
    path = tmp_path / "bomb.dat"
    path.write_bytes(BOMBS[name]())
    assert path.stat().st_size < 10**6
    ended = run_alone("-m", "winchcascade", "reduce", str(path))
    assert ended.code == 0 or (
        ended.code == 2 and ended.err.startswith("winchcascade: bomb.dat: ")
    ), ended
    assert ended.err.count("\n") <= 1
    assert ended.seconds < SECONDS
    assert ended.memory < MEMORY


def test_the_memory_of_a_command_is_not_that_of_the_process_that_starts_it() -> None:
    path, filled = (
        f"import sys; sys.path.insert(0, {str(ROOT / 'tests')!r})",
        "x = b'1' * 250_000_000",
    )
    started = run_alone(
        "-c",
        f"{path}; {filled}; from own_process import run_alone; print(run_alone('-c', '').memory)",
    )
    assert float(started.out) < 100 < 200 < started.memory


# --- files that are none, for every command that takes one

COMMANDS = {
    "reduce": "reduce FILE --json OUT/a.json",
    "reduce --rig": f"reduce '{LOG}' --rig FILE",
    "batch": "batch FILE --out OUT/batch --reports none --jobs 1",
    "batch --rig": f"batch '{LOG}' --out OUT/batch --rig FILE",
    "check": f"check FILE --against {TABLE} --jobs 1",
    "check --against": f"check '{ROOT}/fixtures/campaign' --against FILE",
    "audit": "audit FILE",
    "simulate": "simulate FILE --load-ohm 36 --out OUT/a.csv",
    "simulate --profile": "simulate --profile FILE --load-ohm 36 --out OUT/a.csv",
    "calibrate": "calibrate FILE",
    "diagnose": "diagnose FILE",
    "blind diagnose": "blind diagnose FILE",
    "blind score": "blind score FILE",
}

BAD: dict[str, Callable[[Path], object]] = {
    "missing": str,
    "empty": Path.touch,
    "a folder": Path.mkdir,
    "a pipe": lambda path: os.mkfifo(path),
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 40),
    "zeros": lambda path: path.write_bytes(bytes(5000)),
    "another format": lambda path: path.write_bytes(b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'}"),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a link to nothing": lambda path: path.symlink_to("nowhere"),
    "a device": lambda path: path.symlink_to("/dev/zero"),
}


def with_file(command: str, file: Path, out: Path) -> list[str]:
    """The arguments of a command on a file."""
    return [
        word.replace("FILE", str(file)).replace("OUT", str(out))
        for word in shlex.split(COMMANDS[command])
    ]


@POSIX
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_rejects_what_is_no_file_of_the_kind_in_one_sentence(
    command: str, tmp_path: Path
) -> None:
    def check(bad: str, name: str) -> None:
        path = tmp_path / bad / "in put" / name
        path.parent.mkdir(parents=True)
        BAD[bad](path)
        arguments = with_file(command, path, tmp_path / bad)
        if (
            command == "batch" and path.is_file() and path.suffix != ".toml"
        ):  # a log that fails does not stop a batch
            called = call(*arguments)
            assert called.code == 1
            assert "0 of 1 logs reduced" in called.out
            return
        error_sentence(arguments)
        assert not [found for found in tmp_path.rglob("*") if found.suffix == ".part"]

    names, first = ("my dröp 測試.csv", "it.toml", "it.json"), list(COMMANDS).index(command)
    assert failures(check, [(bad, names[(first + k) % 3]) for k, bad in enumerate(BAD)]) == []


@POSIX
@pytest.mark.parametrize(
    "command",
    daily(["reduce", "reduce --rig", "batch", "audit", "diagnose"], ["reduce", "reduce --rig"]),
)
def test_a_file_that_may_not_be_read_is_reported_by_every_command(
    command: str, tmp_path: Path
) -> None:
    path = tmp_path / "locked.toml"
    path.write_text("x")
    path.chmod(0)
    everything = [
        "setpriv",
        "--bounding-set=-dac_override,-dac_read_search",
    ]  # which the superuser may read
    if os.getuid() == 0 and shutil.which(everything[0]) is None:
        pytest.skip("needs setpriv")
    python = [*(everything if os.getuid() == 0 else []), sys.executable, "-m", "winchcascade"]
    done = subprocess.run(
        [*python, *with_file(command, path, tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done
    assert done.stderr.count("\n") == 1
    assert "locked.toml" in done.stderr


# --- names to be obeyed

NASTY = "=1+1 <script>alert(1)</script> <b>&amp; #let x = 1 *star* $x$ @SUM [red]{{7*7}} \x1b[31m\x07\x9b2J\u202e"


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign in which everything that can be named is named to be obeyed."""
    folder = tmp_path_factory.mktemp("named") / "-=+@ [folder] \x1b[31m 測試"
    folder.mkdir()
    header, *rows = text().splitlines()
    log = "\n".join([f"{header},={NASTY[1:20]}\x1b]0;title\x07", *(f"{row},1" for row in rows)])
    nasty, runs = json.dumps(NASTY), []
    for name, load in (("<b>&\x1b[2J.csv", 36), ("=cmd|' !A0.csv", 9)):
        (folder / name).write_text(log, encoding="utf-8")
        runs.append(f"[[run]]\nfile = {json.dumps(name)}\nload_ohm = {load}\n")
    words = "\n".join(f"{key} = {nasty}" for key in ("name", "title", "source", "note"))
    (folder / "rig.toml").write_text(f'based_on = "hsu2026"\n{words}\n', encoding="utf-8")
    campaign = f'title = {nasty}\nrig = "rig.toml"\n{"".join(runs)}'
    (folder / "campaign.toml").write_text(campaign, encoding="utf-8")
    return folder


def batch(campaign: Path, out: Path, *options: str, encoding: str = "utf-8") -> Called:
    """Reduce a campaign without reports unless the options say otherwise."""
    options = options or ("--reports", "none")
    return call("batch", campaign, "--out", out, "--jobs", "1", *options, encoding=encoding)


def harmless(said: str) -> bool:
    """Whether a terminal obeys nothing of a text but its line ends."""
    return all(c == "\n" or c.isprintable() for c in said)


@POSIX
@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "cp950"])
def test_a_terminal_of_any_letters_obeys_nothing_of_a_name(
    named: Path, encoding: str, tmp_path: Path
) -> None:
    out = tmp_path / "-out \x1b[31m 測試"
    log = min(named.glob("*.csv"))
    called = [
        batch(named, out, encoding=encoding),
        *(
            call(*words, encoding=encoding)
            for words in (
                ["reduce", log],
                ["check", out, "--against", TABLE, "--github"],
                ["simulate", log, "--load-ohm", "36", "--out", out / "\x1b[31m.csv"],
                ["calibrate", log],
                ["reduce", tmp_path / "\x1b[31m not there"],
                ["reduce", "--\x1b[31m"],
                ["\x1b[31m"],
            )
        ),
    ]
    assert {one.code for one in called} <= {0, 1, 2}
    assert [one for one in called if not harmless(one.out + one.err) or not one.out + one.err] == []


@POSIX
@pytest.mark.parametrize("reports", ["html", pytest.param("all", marks=pytest.mark.slow)])
def test_reports_tables_and_records_show_a_name_and_obey_nothing_of_it(
    named: Path, reports: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with undrawn() if reports == "html" else nullcontext():
        assert batch(named, out, "--reports", reports, "--excel").code == 0
    for path in [out / "campaign.html", *(out / "runs").glob("*.html")]:
        page = PageReader(path.read_text(encoding="utf-8"))
        assert page.faults == page.requests() == page.foreign_scripts() == []
        assert "alert(1)" in page.shown
        assert not {"\x1b", "\x9b"} & set(page.shown)
    assert len([*out.rglob("*.pdf")]) == (3 if reports == "all" else 0)
    for path in out.rglob("*.pdf"):
        words = "".join(page.extract_text() for page in pypdf.PdfReader(path).pages)
        assert "#let" in words
        assert "\x1b" not in words
    for sheet in openpyxl.load_workbook(out / "campaign.xlsx").worksheets:
        assert not [
            cell.value for row in sheet.iter_rows() for cell in row if cell.data_type == "f"
        ]
    assert {path.parent for path in out.rglob("*") if path.is_file()} == {
        out,
        out / "runs",
        out / "dataset",
    }


def obeyed(said: str) -> list[str]:
    """The commands that a runner of GitHub finds in what a step prints, one for each line or
    part of one.
    """
    return [x for x in re.split("[\r\n]", said) if x.lstrip().startswith("::") or "##[" in x]


@POSIX
@pytest.mark.parametrize(
    "words",
    [
        "::error file=x::planted",
        "\n::set-output name=a::b",
        "%0A::debug::x",
        "x ##[add-path]/tmp",
        "\u2028::warning::x",
    ],
)
def test_a_runner_of_github_and_its_records_obey_nothing_of_a_name(
    words: str, tmp_path: Path
) -> None:
    name = f"{words.replace('/', '')}.csv"
    shutil.copy(LOG, tmp_path / name)
    (tmp_path / "campaign.toml").write_text(
        f"title = {json.dumps(words)}\n[[run]]\nfile = {json.dumps(name)}\nload_ohm = "
        f"36\nwindow_s = 5.48\n",
        encoding="utf-8",
    )
    table, junit, out = tmp_path / "t.toml", tmp_path / "junit.xml", tmp_path / "out"
    table.write_text(
        f"title = {json.dumps(words)}\nsource = {json.dumps(words)}\n[columns]\neta_pto = {{ unit "
        f"= '1', decimals = 3 }}\n"
        "[[row]]\nload_ohm = 36\neta_pto = 0.1\n",
        encoding="utf-8",
    )
    calls: list[list[str | Path]] = [
        ["reduce", tmp_path / name],
        ["reduce", words],
        ["audit", table],
    ]
    for called in [batch(tmp_path, out), *(call(*arguments) for arguments in calls)]:
        assert called.out or called.err
        assert obeyed(called.out) + obeyed(called.err) == []
    own = obeyed(call("check", out, "--against", table, "--github", "--junit", junit).out)
    assert sum(x.startswith("::error ") for x in own) == 1
    assert all(
        re.match(r"::(error|warning) file=[^,:]*t\.toml,line=\d+,title=[^,:]*::|::notice::", x)
        for x in own
    )
    assert ElementTree.parse(junit).getroot().tag == "testsuites"


# --- paths


@POSIX
@pytest.mark.parametrize(
    "name", ["..", ".", "../..", "/", "a/../../b/..", "\\..\\..\\x", "CON", "a\u0000b", "x" * 300]
)
def test_a_campaign_that_names_no_file_writes_nothing_beyond_the_folder_of_results(
    name: str, tmp_path: Path
) -> None:
    campaign = tmp_path / "in" / "campaign"
    campaign.mkdir(parents=True)
    (campaign / "campaign.toml").write_text(f"[[run]]\nfile = {json.dumps(name)}\nload_ohm = 36\n")
    called = batch(campaign, tmp_path / "in" / "out")
    assert called.code in (1, 2)
    assert harmless(called.out + called.err)
    assert {path.name for path in tmp_path.iterdir()} == {"in"}
    assert {path.name for path in (tmp_path / "in").iterdir()} <= {"campaign", "out"}


@POSIX
def test_a_campaign_may_name_logs_elsewhere_and_leaves_them_as_they_are(tmp_path: Path) -> None:
    campaign, elsewhere, out = tmp_path / "campaign", tmp_path / "else where", tmp_path / "out"
    for folder in (campaign, elsewhere):
        folder.mkdir()
    shutil.copy(LOG, elsewhere / "a.csv")
    (campaign / "link.csv").symlink_to(elsewhere / "a.csv")
    (campaign / "campaign.toml").write_text(
        '[[run]]\nfile = "../else where/a.csv"\nload_ohm = 36\n[[run]]\nfile = '
        '"link.csv"\nload_ohm = 36\nwithheld = true\n'
    )
    before = {
        path: path.lstat().st_mtime_ns for path in (*campaign.rglob("*"), *elsewhere.rglob("*"))
    }
    assert batch(campaign, out).code in (0, 1, 2)
    assert {
        path: path.lstat().st_mtime_ns for path in (*campaign.rglob("*"), *elsewhere.rglob("*"))
    } == before
    assert (campaign / "link.csv").is_symlink()


# --- line ends and letters


@pytest.mark.parametrize("kind", ["campaign", "rig", "table"])
def test_toml_with_carriage_returns_and_a_mark_says_the_same(kind: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "fixtures" / "campaign", tmp_path / "campaign")
    log = tmp_path / "campaign" / LOG.name
    files = {
        "campaign": (
            ROOT / "fixtures/campaign/campaign.toml",
            tmp_path / "campaign" / "campaign.toml",
        ),
        "rig": (ROOT / "fixtures/campaign/rig.toml", tmp_path / "rig.toml"),
        "table": (ROOT / "winchcascade/published/hsu2026-table2.toml", tmp_path / "table.toml"),
    }
    source, file = files[kind]
    file.write_bytes(b"\xef\xbb\xbf" + source.read_bytes().replace(b"\n", b"\r\n"))
    calls: dict[str, tuple[list[str | Path], list[str | Path]]] = {
        "campaign": (["reduce", log], ["reduce", LOG]),
        "rig": (["reduce", log, "--rig", file], ["reduce", LOG]),
        "table": (["audit", file], ["audit", TABLE]),
    }
    one, other = (call(*arguments) for arguments in calls[kind])
    assert (one.code, one.out.splitlines()[1:]) == (other.code, other.out.splitlines()[1:])


def test_a_header_of_every_letter_is_reported_or_read(tmp_path: Path) -> None:
    """Every character of the first planes in a name, a few hundred at a time."""
    path = tmp_path / "log.csv"
    rows = "".join(f"{r[0]},{r[2]},1\n" for r in ROWS)
    for first in range(1, 0x3000, 256):
        letters = "".join(chr(c) for c in range(first, first + 256) if chr(c) not in '\n\r,"')
        path.write_text(f"{HEADERS[0]},{HEADERS[2]},{letters}\n{rows}", encoding="utf-8")
        try:
            words = repr(read_run(path))
        except LogError as fault:
            words = str(fault)
        assert words.isprintable()
