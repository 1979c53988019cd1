"""The report of one log: what its summary says, where its numbers come from, and what is
rejected before any work.
"""

import hashlib
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from calls import error_sentence

from winchcascade import __version__
from winchcascade.core.run import SIMULATED_HEADERS
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
from winchcascade.report.content import Report, Span, Table, shown
from winchcascade.report.results.reduction import reduction_report
from winchcascade.rig.baseline import load_rig

FIXTURES = Path(__file__).parents[2] / "fixtures"
CLEAN = FIXTURES / "campaign" / "r36ohm.csv"
OWN = 'based_on = "hsu2026"\nname = "mine"\ntitle = "My winch"\nsource = "the workshop"\n'

Result = tuple[Reduction, Uncertainty]


@pytest.fixture(scope="module")
def clean() -> Result:
    reduction = reduce(read_run(CLEAN, load=36.0, campaign=False), window=5.48)
    return reduction, uncertainty(reduction)


@pytest.fixture(scope="module")
def report(clean: Result) -> Report:
    return reduction_report(*clean, command="winchcascade reduce r36ohm.csv")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """An open circuit with the columns that only simulations have, with one's own rig file, made
    at a given time.
    """
    folder = tmp_path_factory.mktemp("simulated")
    head, *rows = (FIXTURES / "campaign" / "open_circuit.csv").read_text().splitlines()
    log, rig_file = folder / "made.csv", folder / "my rig.toml"
    log.write_text(
        "\n".join(
            [",".join([head, *SIMULATED_HEADERS]), *(f"{row},3000.0,1.0,2.0" for row in rows)]
        )
        + "\n"
    )
    rig_file.write_text(OWN)
    rig = load_rig(rig_file)
    reduction = reduce(read_run(log, rig=rig, load=math.inf), rig=rig)
    with pytest.MonkeyPatch.context() as changed:
        changed.setenv("SOURCE_DATE_EPOCH", "1776506400")
        return reduction_report(reduction, uncertainty(reduction))


def provenance(report: Report) -> dict[str, str]:
    (table,) = (
        block for block in report.blocks if isinstance(block, Table) and block.id == "provenance"
    )
    return {row[0]: row[1] for row in table.texts}


# ------------------------------------------------------------------------------------ the summary


def test_the_tiles_show_the_efficiencies_with_their_intervals(
    clean: Result, report: Report
) -> None:
    reduction, found = clean
    assert [tile.name for tile in report.tiles] == ["eta_trans", "eta_gen", "eta_pto"]
    for tile in report.tiles:
        u, interval = found.standard[tile.name], found.interval_95[tile.name]
        assert float(tile.value) == pytest.approx(reduction.mean.value(tile.name), abs=5e-5)
        assert tile.beside == f"95 %: {shown(Span(interval.low, interval.high, u))}"


def test_a_simulated_log_is_said_to_be_simulated_before_all_else(simulated: Report) -> None:
    first = simulated.notes[0]
    assert (first.about, first.tone) == ("Data", "warn")
    assert "simulate" in first.text
    assert simulated.banner


# --------------------------------------------------------------------------------- the provenance
def test_the_provenance_names_log_command_and_version(report: Report) -> None:
    rows = provenance(report)
    assert rows["Log"] == str(CLEAN)
    assert rows["SHA-256 of the log"] == hashlib.sha256(CLEAN.read_bytes()).hexdigest()
    assert rows["Command"] == "winchcascade reduce r36ohm.csv"
    assert f"winchcascade {__version__}" in rows["Made by"]
    assert rows["Samples"] == "2767 at 25 Hz, 110.6 s"
    assert "SHA-256 of the rig file" not in rows  # a built-in one goes with the version


def test_the_provenance_holds_the_digest_of_ones_own_rig_file(simulated: Report) -> None:
    rows = provenance(simulated)
    assert rows["SHA-256 of the rig file"] == hashlib.sha256(OWN.encode()).hexdigest()
    assert rows["Rig"].startswith("mine (")
    assert (rows["Source of the rig's numbers"], rows["What the rig is"]) == (
        "the workshop",
        "My winch",
    )


# ------------------------------------------------------------------------------- the command line
def command(
    *arguments: str | Path | bytes, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "winchcascade", "reduce", *(os.fsdecode(a) for a in arguments)],
        capture_output=True, text=True, encoding="utf-8", errors="replace", cwd=cwd, env=os.environ | environment,
        check=False,
    )  # fmt: skip


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log in a folder and with a name that have blanks."""
    folder = tmp_path / "my logs"
    folder.mkdir()
    return Path(shutil.copy(CLEAN, folder / "run 1 36 ohm.csv"))


def rejected(log: Path, *arguments: str | Path) -> str:
    """The one sentence of a rejection; nothing is written and the log is as it was."""
    before = {p: p.read_bytes() for p in log.parent.rglob("*") if p.is_file()}
    said = error_sentence(["reduce", log, *arguments])
    assert {p: p.read_bytes() for p in log.parent.rglob("*") if p.is_file()} == before
    return said


def test_two_spellings_of_one_name_are_rejected(log: Path) -> None:
    inside = log.parent / "inside"
    inside.mkdir()
    assert "both name" in rejected(
        log, "--html", log.parent / "report", "--pdf", inside / ".." / "report"
    )


@pytest.mark.parametrize("option", ["--html", "--pdf"])
def test_the_log_is_never_replaced_by_its_report(log: Path, option: str) -> None:
    assert "is an input of this command" in rejected(log, option, log, "--force")


@pytest.mark.parametrize(
    ("name", "says"), [("", "is a folder"), ("no such folder/report", "does not exist")]
)
def test_a_place_that_no_report_can_have_is_reported(log: Path, name: str, says: str) -> None:
    for option in ("--html", "--pdf"):
        assert says in rejected(log, option, log.parent / name)


def test_a_rejected_pdf_leaves_no_page_behind(log: Path) -> None:
    (log.parent / "thesis.pdf").write_bytes(b"%PDF-1.7\nmine")
    rejected(log, "--html", log.parent / "new.html", "--pdf", log.parent / "thesis.pdf")
    assert not (log.parent / "new.html").exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs file names of any bytes")
def test_a_log_whose_name_is_no_utf_8_has_a_report(log: Path) -> None:
    odd = log.rename(log.parent / os.fsdecode(b"run \xff.csv"))
    done = command(odd, "--html", log.parent / "report.html", "--pdf", log.parent / "report.pdf")
    assert "Traceback" not in done.stderr
    assert done.returncode == 0
    assert "run ?.csv" in (log.parent / "report.html").read_text(encoding="utf-8")
