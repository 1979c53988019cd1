"""The report of one log: what its summary says, where its numbers come from, and what is rejected before any work."""

import hashlib
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest
from calls import error_sentence

from winchcascade import __version__
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import CLOCK, SIMULATED_HEADERS
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.montecarlo import Uncertainty, uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import Note, Picture, Report, Span, Table, shown
from winchcascade.report.results.drawn_reduction import drawn_report
from winchcascade.report.results.reduction import reduction_report
from winchcascade.rig.open_rig import load_rig

FIXTURES = Path(__file__).parents[2] / "fixtures"
CLEAN = FIXTURES / "campaign" / "r36ohm.csv"
BARE = 'name = "bare"\nnote = "Numbers of a guess."\n[winch]\nr_drum = { value = 0.13, unit = "m" }\n'
OWN = 'based_on = "hsu2026"\nname = "mine"\ntitle = "My winch"\nsource = "the workshop"\n'

Result = tuple[Reduction, Uncertainty]


def reduced(log: Path, window: str | float = 5.48, rig: str | None = None, load: float | None = None) -> Result:
    used = load_rig("hsu2026") if rig is None else parse_rig(rig, "rig.toml")
    reduction = reduce(read_run(log, rig=used, load=load, campaign=False), window=window)
    return reduction, uncertainty(reduction, draws=2000)


@pytest.fixture(scope="module")
def clean() -> Result:
    return reduced(CLEAN, load=36.0)


@pytest.fixture(scope="module")
def reports(clean: Result) -> dict[str, Report]:
    damaged = FIXTURES / "damaged_logs"
    return {
        "clean": drawn_report(*clean, command="winchcascade reduce r36ohm.csv"),
        "aborted": reduction_report(*reduced(damaged / "aborted.csv", "auto")),
        "no accuracies": reduction_report(*reduced(CLEAN, rig=BARE)),
        "none complete": drawn_report(*reduced(CLEAN, 0.05)),
    }


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """An open circuit with the columns that only simulations have, with one's own rig file, made at a given time."""
    folder = tmp_path_factory.mktemp("simulated")
    head, *rows = (FIXTURES / "campaign" / "open_circuit.csv").read_text().splitlines()
    log, rig_file = folder / "made.csv", folder / "my rig.toml"
    log.write_text("\n".join([",".join([head, *SIMULATED_HEADERS]), *(f"{row},3000.0,1.0,2.0" for row in rows)]) + "\n")
    rig_file.write_text(OWN)
    rig = load_rig(rig_file)
    reduction = reduce(read_run(log, rig=rig, load=math.inf), rig=rig)
    with pytest.MonkeyPatch.context() as changed:
        changed.setenv("SOURCE_DATE_EPOCH", "1776506400")
        return reduction_report(reduction, uncertainty(reduction))


def point(report: Report, about: str) -> Note:
    (found,) = (note for note in report.notes if note.about == about)
    return found


def provenance(report: Report) -> dict[str, str]:
    (table,) = (block for block in report.blocks if isinstance(block, Table) and block.id == "provenance")
    return {row[0]: row[1] for row in table.texts}


# ------------------------------------------------------------------------------------------------------ the summary
def test_a_clean_log_has_no_warning(reports: dict[str, Report]) -> None:
    assert {note.tone for note in reports["clean"].notes} == {"plain", "good"}
    assert point(reports["clean"], "Findings").tone == "good"
    assert "findings" not in [one.id for one in reports["clean"].filled]


def test_the_tiles_show_the_efficiencies_with_their_intervals(clean: Result, reports: dict[str, Report]) -> None:
    reduction, found = clean
    assert [tile.name for tile in reports["clean"].tiles] == ["eta_trans", "eta_gen", "eta_pto"]
    for tile in reports["clean"].tiles:
        u, interval = found.standard[tile.name], found.interval_95[tile.name]
        assert float(tile.value) == pytest.approx(reduction.mean.value(tile.name), abs=5e-5)
        assert tile.beside == f"95 %: {shown(Span(interval.low, interval.high, u))}"


def test_where_only_the_repeatability_is_known_the_tiles_say_so(reports: dict[str, Report]) -> None:
    assert all(tile.beside.startswith("+- ") for tile in reports["no accuracies"].tiles)
    assert not reports["none complete"].tiles


def test_an_open_circuit_shows_energies_where_it_has_no_efficiency(simulated: Report) -> None:
    assert [tile.name for tile in simulated.tiles] == ["eta_trans", "energy_line", "energy_mech"]
    assert "open circuit" in simulated.subtitle


def test_the_measured_load_stands_beside_the_stated_one(clean: Result, reports: dict[str, Report]) -> None:
    measured = clean[0].measured_load
    assert measured is not None
    assert f"{measured.ohm:.4g} ohm" in reports["clean"].subtitle


def with_metrics(reduction: Reduction, *cycles: Metrics) -> Reduction:
    numbered = zip(reduction.cycles, cycles, strict=True)
    return msgspec.structs.replace(reduction, cycles=tuple(msgspec.structs.replace(c, metrics=m) for c, m in numbered))


@pytest.mark.parametrize(
    ("cycles", "expected"),
    [
        ([Metrics(eta_trans=1 - eta, eta_pto=eta) for eta in (0.70, 0.61, 0.65)], (1, 2, "eta_pto")),
        (
            [Metrics(eta_trans=eta, energy_line=e) for eta, e in ((0.7, 1.0), (0.8, 2.0), (0.9, 0.5))],
            (3, 1, "eta_trans"),
        ),
        ([Metrics(eta_pto=0.7), Metrics(), Metrics(eta_pto=0.6)], (1, 3, "eta_pto")),
    ],
)
def test_best_and_worst_are_the_cycles_of_the_highest_and_lowest_efficiency(
    clean: Result, cycles: list[Metrics], expected: tuple[int, int, str]
) -> None:
    best, worst, metric = with_metrics(clean[0], *cycles).extremes or pytest.fail("two cycles can be compared")
    assert (best.cycle, worst.cycle, metric) == expected


def test_an_incomplete_cycle_is_neither_best_nor_worst(clean: Result) -> None:
    made = with_metrics(clean[0], *(Metrics(eta_pto=eta) for eta in (0.99, 0.61, 0.65)))
    first, *rest = made.cycles
    made = msgspec.structs.replace(made, cycles=(msgspec.structs.replace(first, complete=False), *rest))
    best, worst, _ = made.extremes or pytest.fail("two cycles can be compared")
    assert (best.cycle, worst.cycle) == (3, 2)
    assert msgspec.structs.replace(made, cycles=made.cycles[:2]).extremes is None


def test_findings_and_incomplete_cycles_are_warned_of(reports: dict[str, Report]) -> None:
    report = reports["aborted"]
    assert (point(report, "Cycles").tone, point(report, "Findings").tone) == ("warn", "warn")
    assert "ncomplete cycle" in point(report, "Findings").text


def test_a_rig_without_accuracies_is_warned_of(reports: dict[str, Report]) -> None:
    warned = point(reports["no accuracies"], "Accuracy")
    assert warned.tone == "warn"
    assert all(name in warned.text for name in ("force", "torque", "vdc", "idc", "accuracy_full_scale"))
    assert point(reports["no accuracies"], "Rig note").text == "Numbers of a guess."


def test_a_simulated_log_is_said_to_be_simulated_before_all_else(simulated: Report) -> None:
    first = simulated.notes[0]
    assert (first.about, first.tone) == ("Data", "warn")
    assert "simulate" in first.text
    assert simulated.banner


def test_a_log_of_which_nothing_is_stated_has_no_banner(reports: dict[str, Report]) -> None:
    assert reports["clean"].banner == ""


HAND = [
    ({}, 0.0),
    ({"force": [(1.0, 2.0)]}, 0.96),  # from the last good sample to the first: 24 of 25 samples are missing
    ({"force": [(1.0, 2.0)], "torque": [(1.0, 2.0)]}, 0.96),
    ({"force": [(1.0, 2.0)], "torque": [(1.48, 3.0)]}, 1.96),
    ({"force": [(1.0, 3.0)], "torque": [(1.48, 2.0)]}, 1.96),
    ({CLOCK: [(1.0, 2.0), (5.0, 5.08)]}, 1.0),
    ({"vdc": [(5.0, 6.0)], "force": [(1.0, 2.0)]}, 1.92),
]
"""Gaps [s] of a log of 10 s at 25 Hz, and what is bridged by hand [s]."""


@pytest.mark.parametrize(("gaps", "seconds"), HAND)
def test_the_lost_share_counts_time_that_any_channel_lost_once(
    clean: Result, gaps: dict[str, list[tuple[float, float]]], seconds: float
) -> None:
    run = msgspec.structs.replace(
        clean[0].run, t=0.04 * np.arange(251), fs=25.0, gaps={name: np.array(spans) for name, spans in gaps.items()}
    )
    assert msgspec.structs.replace(clean[0], run=run).lost_share == pytest.approx(seconds / 10.0)


# ----------------------------------------------------------------------------------------------------- the sections
@pytest.mark.parametrize("kind", ["clean", "aborted", "no accuracies", "none complete"])
def test_every_id_is_its_own_and_energies_follow_the_findings(reports: dict[str, Report], kind: str) -> None:
    report = reports[kind]
    blocks = [block for block in report.blocks if isinstance(block, Table | Picture)]
    for ids in ([s.id for s in report.sections], [block.id for block in blocks]):
        assert len(ids) == len(set(ids))
    assert all(b.caption.endswith(".") for b in blocks)
    assert all(b.alt for b in blocks if isinstance(b, Picture))
    shown = [one.id for one in report.filled if one.id != "findings"]
    assert (shown[0], shown[-1]) == ("results", "provenance")


def test_what_is_open_has_room_on_four_screens(reports: dict[str, Report]) -> None:
    opened = [section for section in reports["clean"].filled if not section.folded]
    assert [section.id for section in opened] == ["results", "histories"]
    assert all(
        len(block.items) <= block.limit <= 14 for one in opened for block in one.blocks if isinstance(block, Table)
    )


# --------------------------------------------------------------------------------------------------- the provenance
def test_the_provenance_names_log_command_version_and_seed(clean: Result, reports: dict[str, Report]) -> None:
    rows = provenance(reports["clean"])
    assert rows["Log"] == str(CLEAN)
    assert rows["SHA-256 of the log"] == hashlib.sha256(CLEAN.read_bytes()).hexdigest()
    assert rows["Command"] == "winchcascade reduce r36ohm.csv"
    assert f"winchcascade {__version__}" in rows["Made by"]
    assert rows["Monte Carlo"] == f"2000 draws, seed {clean[1].seed}"
    assert rows["Samples"] == "2767 at 25 Hz, 110.6 s"
    assert "SHA-256 of the rig file" not in rows  # a built-in one goes with the version


def test_the_provenance_holds_the_digest_of_ones_own_rig_file(simulated: Report) -> None:
    rows = provenance(simulated)
    assert rows["SHA-256 of the rig file"] == hashlib.sha256(OWN.encode()).hexdigest()
    assert rows["Rig"].startswith("mine (")
    assert (rows["Source of the rig's numbers"], rows["What the rig is"]) == ("the workshop", "My winch")


def test_the_time_of_making_is_that_of_source_date_epoch(simulated: Report) -> None:
    assert provenance(simulated)["Made on"] == "2026-04-18 10:00:00 UTC"


# --------------------------------------------------------------------------------------------------- the command line
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


@pytest.mark.slow
def test_with_source_date_epoch_the_page_is_the_same_byte_for_byte(log: Path) -> None:
    pages = []
    for seed in ("1", "2"):
        done = command(
            log.name, "--html", "my report.html", cwd=log.parent, SOURCE_DATE_EPOCH="1776506400", PYTHONHASHSEED=seed
        )
        assert done.returncode == 0, done.stderr
        pages.append((log.parent / "my report.html").read_bytes())
    assert pages[0] == pages[1]
    given = "winchcascade reduce &#39;run 1 36 ohm.csv&#39; --html &#39;my report.html&#39;"
    assert given in pages[0].decode()


def rejected(log: Path, *arguments: str | Path) -> str:
    """The one sentence of a rejection; nothing is written and the log is as it was."""
    before = {p: p.read_bytes() for p in log.parent.rglob("*") if p.is_file()}
    said = error_sentence(["reduce", log, *arguments])
    assert {p: p.read_bytes() for p in log.parent.rglob("*") if p.is_file()} == before
    return said


def test_two_reports_of_one_name_are_rejected(log: Path) -> None:
    one = log.parent / "my report"
    assert "--html and --pdf both name" in rejected(log, "--html", one, "--pdf", one)


def test_two_spellings_of_one_name_are_rejected(log: Path) -> None:
    inside = log.parent / "inside"
    inside.mkdir()
    assert "both name" in rejected(log, "--html", log.parent / "report", "--pdf", inside / ".." / "report")


@pytest.mark.parametrize("option", ["--html", "--pdf"])
def test_the_log_is_never_replaced_by_its_report(log: Path, option: str) -> None:
    assert "is an input of this command" in rejected(log, option, log, "--force")


@pytest.mark.parametrize(("name", "says"), [("", "is a folder"), ("no such folder/report", "does not exist")])
def test_a_place_that_no_report_can_have_is_reported(log: Path, name: str, says: str) -> None:
    for option in ("--html", "--pdf"):
        assert says in rejected(log, option, log.parent / name)


def test_a_file_of_somebody_else_is_no_report_to_replace(log: Path) -> None:
    for option, name, content in (
        ("--html", "thesis.html", b"<!doctype html><p>mine"), ("--pdf", "thesis.pdf", b"%PDF-1.7\nmine\n%%EOF"),
    ):  # fmt: skip
        (log.parent / name).write_bytes(content)
        assert "was not written by winchcascade" in rejected(log, option, log.parent / name)


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
