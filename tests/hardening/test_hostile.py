"""Harmful files: huge, lying, named to be obeyed, or no files at all. Each is read, or rejected in one sentence."""

import json
import locale
import os
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import openpyxl
import pint
import pyarrow as pa
import pypdf
import pytest
from calls import call, error_sentence
from loops import failures
from page_reader import PageReader
from pyarrow import parquet
from seeds import HEADERS, LOG, ROOT, ROWS, tdms, text

from winchcascade.core.errors import LogError
from winchcascade.ingest.assign import _UNIT, _unit_by_pint
from winchcascade.ingest.read import read_run

POSIX = pytest.mark.skipif(os.name == "nt", reason="files as POSIX has them")
TABLE = "hsu2026-table2"
MEMORY = 1 << 30
"""What a small file may take. [bytes]"""

PATIENCE = 300.0
"""A process that has not ended after this never will. [s]"""

# --- files that are none, for every command that takes one

FILE, OUT = "FILE", "OUT"
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


def with_file(command: str, file: Path, out: Path) -> list[str]:
    """The arguments of a command on a file."""
    return [word.replace(FILE, str(file)).replace(OUT, str(out)) for word in shlex.split(COMMANDS[command])]


def _empty(path: Path) -> None:
    path.touch()


def _noise(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 40)


def _zeros(path: Path) -> None:
    path.write_bytes(bytes(5000))


def _binary_name(path: Path) -> None:
    path.write_bytes(b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'}")


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


def _dangling(path: Path) -> None:
    path.symlink_to("nowhere")


def _device(path: Path) -> None:
    path.symlink_to("/dev/zero")


BAD: dict[str, Callable[[Path], object]] = {
    "missing": str,
    "empty": _empty,
    "a folder": Path.mkdir,
    "a pipe": lambda path: os.mkfifo(path),
    "noise": _noise,
    "zeros": _zeros,
    "another format": _binary_name,
    "a link to itself": _loop,
    "a link to nothing": _dangling,
    "a device": _device,
}


@POSIX
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_rejects_what_is_no_file_of_the_kind_in_one_sentence(command: str, tmp_path: Path) -> None:
    def check(bad: str, name: str) -> None:
        place = tmp_path / bad
        path = place / "in put" / name
        path.parent.mkdir(parents=True)
        BAD[bad](path)
        arguments = with_file(command, path, place)
        if command == "batch" and path.is_file() and path.suffix != ".toml":  # a log that fails does not stop a batch
            called = call(*arguments)
            assert called.code == 1
            assert "0 of 1 logs reduced" in called.out
            return
        error_sentence(arguments)
        assert not [found for found in place.rglob("*") if found.suffix == ".part"]

    names, first = ("my dröp 測試.csv", "it.toml", "it.json"), list(COMMANDS).index(command)
    assert failures(check, [(bad, names[(first + k) % 3]) for k, bad in enumerate(BAD)]) == []


@POSIX
@pytest.mark.parametrize("command", ["reduce", "reduce --rig", "batch", "check", "audit", "diagnose", "simulate"])
def test_a_file_that_may_not_be_read_is_reported_by_every_command(command: str, tmp_path: Path) -> None:
    path = tmp_path / "locked.toml"
    path.write_text("x")
    path.chmod(0)
    everything = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]  # which the superuser may read
    if os.getuid() == 0 and shutil.which(everything[0]) is None:
        pytest.skip("needs setpriv")
    python = [*(everything if os.getuid() == 0 else []), sys.executable, "-m", "winchcascade"]
    done = subprocess.run([*python, *with_file(command, path, tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done
    assert done.stderr.startswith("winchcascade: ")
    assert done.stderr.count("\n") == 1
    assert "locked.toml" in done.stderr
    assert "(Permission denied)" in done.stderr or "is not readable" in done.stderr


@POSIX
def test_a_pipe_in_a_campaign_is_a_log_that_fails_and_keeps_nobody_waiting(tmp_path: Path) -> None:
    shutil.copy(LOG, tmp_path / "a.csv")
    os.mkfifo(tmp_path / "b.csv")
    (tmp_path / "campaign.toml").write_text(
        '[[run]]\nfile = "a.csv"\nload_ohm = 36\n[[run]]\nfile = "b.csv"\nload_ohm = 9\n'
    )
    for _ in range(2):
        called = call("batch", tmp_path, "--out", tmp_path / "out", "--reports", "none", "--jobs", "1")
        assert called.code == 1
        assert "is not a file" in " ".join(called.out.split())
        assert "1 of 2 logs reduced" in called.out


# --- size and lies


def _limited(path: Path, *, memory: int = MEMORY) -> str:
    """What a process with so much memory says of a log; one that is killed or does not end is a fault."""
    code = (
        "import resource, sys\n"
        "import numpy, pyarrow.csv, pyarrow.parquet, python_calamine, nptdms, scipy.io\n"
        "from winchcascade.ingest.read import read_run\n"
        "from winchcascade.core.errors import LogError\n"
        "pages = int(open('/proc/self/statm').read().split()[0])\n"
        f"resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + {memory},) * 2)\n"
        "try:\n    print(read_run(sys.argv[1]))\nexcept LogError as fault:\n    print(fault)\n"
    )
    command = [sys.executable, "-c", code, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr[-500:]
    assert done.stderr == ""
    return done.stdout.strip()


def test_a_million_columns_are_rejected_from_their_beginning(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    names = ",".join(["Time (s)", *(f"Velocity {k} (m/s)" for k in range(10**6))])
    path.write_text("\n".join([names, *[",".join(["0.5"] * (10**6 + 1))] * 3]))
    said = _limited(path)
    assert (
        said == "wide.csv: lines of more than 64 kB; expected a log with a few dozen columns. Check that this is a log."
    )


@pytest.mark.slow
@pytest.mark.parametrize("quoted", [False, True])
def test_a_cell_of_a_hundred_megabytes_is_rejected_or_left_out(quoted: bool, tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    cell = '"' + "x\n" * (50 << 20) + '"' if quoted else "9" * (100 << 20)
    path.write_text(text(rows=[*ROWS[:400], [*ROWS[400][:-1], cell], *ROWS[401:]]))
    expected = "long.csv: a line of more than 16 MB; expected rows of a few numbers."
    if quoted:  # lines of their own, which are no rows
        expected = "Run('long.csv', 900 samples at 12.5 Hz, channels displacement, velocity, pressure, force, torque, vdc, idc)"
    assert _limited(path) == expected


def _tdms_lies(path: Path) -> None:
    content = tdms()[0]
    at = content.index(b"Velocity") + len(b"Velocity'") + 4
    dimension = content.index((len(ROWS)).to_bytes(8, "little"), at)
    path.write_bytes(content[:dimension] + (2**40).to_bytes(8, "little") + content[dimension + 8 :])


def _parquet_texts(path: Path) -> None:
    row = pa.array([0] * 100_000, pa.int32())
    long = pa.DictionaryArray.from_arrays(row, pa.array(["2026-01-01 00:00:00" + " " * 5_000_000]))
    table = pa.table({"Time": long, "Velocity (m/s)": [0.0] * 100_000})
    parquet.write_table(table, path, compression="zstd", store_schema=False)


LIES: dict[str, tuple[Callable[[Path], None], str]] = {
    "tdms": (_tdms_lies, "claims 1099511627776 samples; no more than the "),
    "parquet texts": (_parquet_texts, "the time column holds 0 readable stamps"),
}


@POSIX
@pytest.mark.parametrize("kind", LIES)
def test_a_small_file_that_claims_much_takes_little(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "small.dat"
    make, says = LIES[kind]
    make(path)
    assert path.stat().st_size < 400_000
    said = _limited(path)
    assert says in said


# --- names to be obeyed

NASTY = "=1+1 <script>alert(1)</script> <b>&amp; #let x = 1 *star* $x$ @SUM [red]{{7*7}} \x1b[31m\x07\x9b2J\u202e"
SAFE = "=1+1 <script>alert(1)</script> <b>&amp; #let x = 1 *star* $x$ @SUM [red]{{7*7}} ?[31m??2J?"
"""What stands of it where it is shown."""


def toml(word: str) -> str:
    return json.dumps(word)


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign in which everything that can be named is named to be obeyed."""
    folder = tmp_path_factory.mktemp("named") / "-=+@ [folder] \x1b[31m 測試"
    folder.mkdir()
    rows = text().splitlines()
    rows = [f"{rows[0]},={NASTY[1:20]}\x1b]0;title\x07", *(f"{row},1" for row in rows[1:])]
    for name in ("=cmd|' !A0.csv", "<b>&\x1b[2J.csv"):
        (folder / name).write_text("\n".join(rows), encoding="utf-8")
    (folder / "rig.toml").write_text(
        f'based_on = "hsu2026"\nname = {toml(NASTY)}\ntitle = {toml(NASTY)}\nsource = {toml(NASTY)}\nnote = {toml(NASTY)}\n'
    )
    runs = "".join(
        f"[[run]]\nfile = {toml(path.name)}\nload_ohm = {load}\n"
        for path, load in zip(sorted(folder.glob("*.csv")), (9, 36), strict=True)
    )
    (folder / "campaign.toml").write_text(f'title = {toml(NASTY)}\nrig = "rig.toml"\n{runs}', encoding="utf-8")
    return folder


def harmless(said: str) -> bool:
    """Whether a terminal obeys nothing of a text but its line ends."""
    return all(c == "\n" or c.isprintable() for c in said)


@POSIX
@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "cp1252", "cp950"])
def test_a_terminal_of_any_letters_obeys_nothing_of_a_name(named: Path, encoding: str, tmp_path: Path) -> None:
    out = tmp_path / "-out \x1b[31m 測試"
    log = min(named.glob("*.csv"))
    table = tmp_path / "\x1b[31m.toml"
    source = (ROOT / "winchcascade" / "published" / "hsu2026-table2.toml").read_text(encoding="utf-8")
    table.write_text(
        f"title = {toml(NASTY)}\n" + source.partition("\n")[2] if source.startswith("title") else source,
        encoding="utf-8",
    )
    calls: list[list[str | Path]] = [
        ["reduce", log],
        ["batch", named, "--out", out, "--reports", "none", "--jobs", "1"],
        ["check", out, "--against", table, "--github"],
        ["audit", table],
        ["simulate", log, "--load-ohm", "36", "--out", out / "\x1b[31m.csv"],
        ["calibrate", log],
        ["rig"],
        ["effects"],
        ["reduce", tmp_path / "\x1b[31m not there"],
        ["reduce", "--\x1b[31m"],
        ["\x1b[31m"],
        ["blind", "score", tmp_path / "\x1b[31m"],
    ]
    for arguments in calls:
        called = call(*arguments, encoding=encoding)
        assert called.code in (0, 1, 2)
        assert harmless(called.out + called.err), (arguments, called)
        assert called.out or called.err


@POSIX
@pytest.mark.parametrize("reports", ["html", pytest.param("all", marks=pytest.mark.slow)])
def test_reports_tables_and_records_show_a_name_and_obey_nothing_of_it(
    named: Path, reports: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    called = call("batch", named, "--out", out, "--reports", reports, "--excel", "--jobs", "1")
    assert called.code == 0, called
    for path in [out / "campaign.html", *(out / "runs").glob("*.html")]:
        written = path.read_text(encoding="utf-8")
        page = PageReader(written)
        assert page.faults == page.requests() == page.foreign_scripts() == []
        assert "alert(1)" in page.shown
        assert not {"\x1b", "\x9b"} & set(page.shown)
    assert len([*out.rglob("*.pdf")]) == (3 if reports == "all" else 0)
    for path in out.rglob("*.pdf"):
        words = "".join(page.extract_text() for page in pypdf.PdfReader(path).pages)
        assert "#let" in words
        assert "\x1b" not in words
    for sheet in openpyxl.load_workbook(out / "campaign.xlsx").worksheets:
        cells = [cell for row in sheet.iter_rows() for cell in row]
        assert not [cell.value for cell in cells if cell.data_type == "f"]
    record = json.loads((out / "campaign.json").read_bytes())
    assert record["title"] == SAFE
    assert {path.parent for path in out.rglob("*") if path.is_file()} == {out, out / "runs", out / "dataset"}


@POSIX
def test_junit_is_xml_whatever_the_names(named: Path, tmp_path: Path) -> None:
    out, junit = tmp_path / "out", tmp_path / "junit.xml"
    assert call("batch", named, "--out", out, "--reports", "none", "--jobs", "1").code == 0
    call("check", out, "--against", TABLE, "--junit", junit)
    assert ElementTree.parse(junit).getroot().tag == "testsuites"


COMMANDS_OF_A_RUNNER = [
    "::error file=x::planted", "  ::stop-commands::x", "\n::set-output name=a::b", "\r::add-mask::a", "%0A::debug::x",
    "##[error]planted", "x ##[add-path]/tmp", "###[debug]x", "\u2028::warning::x", "\x0b::error::x", "\x85::error::x",
]  # fmt: skip


def obeyed(said: str) -> list[str]:
    """The commands that a runner of GitHub finds in what a step prints, one for each line or part of one."""
    return [x for x in re.split("[\r\n]", said) if x.lstrip().startswith("::") or "##[" in x]


@POSIX
@pytest.mark.parametrize("words", COMMANDS_OF_A_RUNNER)
def test_a_runner_of_github_obeys_nothing_of_a_name(words: str, tmp_path: Path) -> None:
    name = f"{words.replace('/', '')}.csv"
    shutil.copy(LOG, tmp_path / name)
    (tmp_path / "bad.csv").write_text(f"{words.strip()},b\n")
    (tmp_path / "campaign.toml").write_text(
        f"title = {toml(words)}\n[[run]]\nfile = {toml(name)}\nload_ohm = 36\nwindow_s = 5.48\n",
        encoding="utf-8",
    )
    table, junit = tmp_path / "t.toml", tmp_path / "junit.xml"
    table.write_text(
        f"title = {toml(words)}\nsource = {toml(words)}\n[columns]\neta_pto = {{ unit = '1', decimals = 3 }}\n"
        "[[row]]\nload_ohm = 36\neta_pto = 0.1\n[[row]]\nload_ohm = 4.5\neta_pto = 0.1\n",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    calls: list[list[str | Path]] = [
        ["reduce", tmp_path / name],
        ["reduce", tmp_path / name, "--json", "-"],
        ["reduce", tmp_path / "bad.csv"],
        ["reduce", words],
        ["batch", tmp_path / "campaign.toml", "--out", out, "--reports", "none", "--jobs", "1"],
        ["audit", table],
        ["audit", table, "--json", "-"],
        ["check", out, "--against", table, "--json", "-"],
    ]
    for arguments in calls:
        called = call(*arguments)
        assert called.out or called.err
        assert obeyed(called.out) + obeyed(called.err) == [], arguments
        if "-" in arguments:
            assert called.code < 2, called
            assert json.loads(called.out)
    called = call("check", out, "--against", table, "--github", "--junit", junit)
    own = obeyed(called.out)
    assert len(own) >= 2
    assert all(
        re.fullmatch(r"::(error|warning) file=[^,:]*t\.toml,line=\d+,title=[^,:]*::.*|::notice::.*", x) for x in own
    )
    assert sum(x.startswith("::error ") for x in own) == 2
    assert ElementTree.parse(junit).getroot().tag == "testsuites"


# --- units to be evaluated

EVALUATED = [
    "9**9**9",
    "m/s*9**9**9",
    "N*9**9**9",
    "(((N)))",
    "m" * 61,
    "N**99",
    "1e999999999 N",
    "N!",
    "N if 1 else m",
]


@pytest.mark.parametrize("unit", EVALUATED)
def test_arithmetic_in_a_unit_is_not_evaluated(unit: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pint", None)  # whoever imports it fails
    assert _unit_by_pint(unit, "force") is None
    assert _unit_by_pint("m⁹⁹⁹⁹⁹⁹", "force") is None
    names = [HEADERS[0], HEADERS[1], HEADERS[2], f"Force [{unit}]"]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([",".join(names), *(",".join([*row[:3], row[4]]) for row in ROWS)]), encoding="utf-8")
    assert "unit_assumed" in {finding.kind for finding in read_run(path).findings}


def test_every_unit_that_pint_knows_passes_the_grammar() -> None:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    assert [name for name in (*registry._units, *registry._prefixes) if name and not re.fullmatch(_UNIT, name)] == []


UNITS_OF_PINT = {
    ("kilonewton", "force"): 1e3, ("kip", "force"): 4448.2216152605, ("kg m / s^2", "force"): 1.0,
    ("m * s**-1", "velocity"): 1.0, ("m s⁻¹", "velocity"): 1.0, ("km/hour", "velocity"): 1 / 3.6, ("1/s * m", "velocity"): 1.0,
    ("meters per second", "velocity"): 1.0, ("knot", "velocity"): 1852 / 3600, ("N/(mm^2)", "pressure"): 1e6,
    ("N m⁻²", "pressure"): 1.0, ("torr", "pressure"): 101325 / 760, ("foot pound_force", "torque"): 1.3558179483314,
    ("pound_force per square inch", "pressure"): 6894.757293168, ("kΩ A", "voltage"): 1e3,
}  # fmt: skip


def test_units_that_the_table_lacks_are_still_read(monkeypatch: pytest.MonkeyPatch) -> None:
    def check(unit: str, dimension: str) -> None:
        found = _unit_by_pint(unit, dimension)
        assert found is not None
        assert found.factor == pytest.approx(UNITS_OF_PINT[unit, dimension], rel=1e-9)

    registry: pint.UnitRegistry[float] = pint.UnitRegistry()  # one for all: it takes long to make
    monkeypatch.setattr(pint, "UnitRegistry", lambda: registry)
    assert failures(check, UNITS_OF_PINT) == []


# --- paths


def test_a_campaign_may_name_logs_elsewhere_and_its_results_stay_in_their_folder(tmp_path: Path) -> None:
    campaign, elsewhere, out = tmp_path / "campaign", tmp_path / "else where", tmp_path / "out"
    for folder in (campaign, elsewhere):
        folder.mkdir()
    shutil.copy(LOG, elsewhere / "a.csv")
    shutil.copy(LOG, elsewhere / "b.csv")
    (campaign / "campaign.toml").write_text(
        '[[run]]\nfile = "../else where/a.csv"\nload_ohm = 36\n'
        f"[[run]]\nfile = {toml(str(elsewhere / 'b.csv'))}\nload_ohm = 9\n"
    )
    before = {path: path.stat().st_mtime_ns for path in (*campaign.rglob("*"), *elsewhere.rglob("*"))}
    assert call("batch", campaign, "--out", out, "--reports", "none", "--jobs", "1").code == 0
    assert {path.name for path in (out / "runs").iterdir()} == {"a.csv.json", "b.csv.json"}
    assert {path: path.stat().st_mtime_ns for path in (*campaign.rglob("*"), *elsewhere.rglob("*"))} == before


@POSIX
@pytest.mark.parametrize("name", ["..", ".", "../..", "/", "a/../../b/..", "\\..\\..\\x", "CON", "a\u0000b", "x" * 300])
def test_a_campaign_that_names_no_file_writes_nothing_beyond_the_folder_of_results(name: str, tmp_path: Path) -> None:
    campaign, out = tmp_path / "in" / "campaign", tmp_path / "in" / "out"
    campaign.mkdir(parents=True)
    (campaign / "campaign.toml").write_text(f"[[run]]\nfile = {toml(name)}\nload_ohm = 36\n")
    called = call("batch", campaign, "--out", out, "--reports", "none", "--jobs", "1")
    assert called.code in (1, 2)
    assert harmless(called.out + called.err)
    assert {path.name for path in tmp_path.iterdir()} == {"in"}
    assert {path.name for path in (tmp_path / "in").iterdir()} <= {"campaign", "out"}


@POSIX
def test_a_link_to_a_log_elsewhere_is_read_and_left_as_it_is(tmp_path: Path) -> None:
    shutil.copy(LOG, tmp_path / "real.csv")
    folder = tmp_path / "campaign"
    folder.mkdir()
    (folder / "link.csv").symlink_to(tmp_path / "real.csv")
    (folder / "campaign.toml").write_text('[[run]]\nfile = "link.csv"\nload_ohm = 36\n')
    assert call("batch", folder, "--out", tmp_path / "out", "--reports", "none", "--jobs", "1").code == 0
    assert (folder / "link.csv").is_symlink()


# --- line ends and decimal signs


@pytest.mark.parametrize("kind", ["campaign", "rig", "table"])
def test_toml_with_carriage_returns_and_a_mark_says_the_same(kind: str, tmp_path: Path) -> None:
    sources = {
        "campaign": ROOT / "fixtures" / "campaign" / "campaign.toml",
        "rig": ROOT / "winchcascade" / "rigfiles" / "hsu2026.toml",
        "table": ROOT / "winchcascade" / "published" / "hsu2026-table2.toml",
    }
    content = b"\xef\xbb\xbf" + sources[kind].read_bytes().replace(b"\n", b"\r\n")
    shutil.copytree(ROOT / "fixtures" / "campaign", tmp_path / "campaign")
    file = tmp_path / "campaign" / "campaign.toml" if kind == "campaign" else tmp_path / "it.toml"
    file.write_bytes(content)
    log = tmp_path / "campaign" / LOG.name
    calls: dict[str, list[str | Path]] = {
        "campaign": ["reduce", log], "rig": ["reduce", log, "--rig", file], "table": ["audit", file],
    }  # fmt: skip
    plain: dict[str, list[str | Path]] = {
        "campaign": ["reduce", LOG],
        "rig": ["reduce", LOG],
        "table": ["audit", TABLE],
    }
    one, other = call(*calls[kind]), call(*plain[kind])
    assert (one.code, one.out.splitlines()[1:]) == (other.code, other.out.splitlines()[1:])


def test_a_locale_of_decimal_commas_changes_nothing(tmp_path: Path) -> None:
    usual = locale.setlocale(locale.LC_ALL)
    said = call("reduce", LOG).out
    for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "German_Germany.1252"):
        try:
            locale.setlocale(locale.LC_ALL, name)
        except locale.Error:
            continue
        try:
            assert call("reduce", LOG, "--html", tmp_path / "a.html").out == said
        finally:
            locale.setlocale(locale.LC_ALL, usual)
        return
    pytest.skip("no such locale on this machine")


def test_a_header_of_every_letter_is_reported_or_read(tmp_path: Path) -> None:
    """Every character of the first planes in a name, a few hundred at a time."""
    for first in range(1, 0x3000, 256):
        letters = "".join(chr(c) for c in range(first, first + 256) if chr(c) not in '\n\r,"')
        path = tmp_path / "log.csv"
        path.write_text(
            f"{HEADERS[0]},{HEADERS[2]},{letters}\n" + "".join(f"{r[0]},{r[2]},1\n" for r in ROWS), encoding="utf-8"
        )
        try:
            found = read_run(path).samples
        except LogError as fault:
            found = len(str(fault))
        assert found > 0
