"""The page of a results folder lists a diagnosis as soon as one was written there."""

import shutil
from pathlib import Path

import pytest
from undrawn import undrawn

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import load_results
from winchcascade.batch.results_pages import write_index
from winchcascade.batch.run_batch import Batch, Products, run_batch
from winchcascade.report.content import Report
from winchcascade.report.render.report_files import publish


def _batch(folder: Path, *logs: Path) -> Batch:
    with undrawn():
        return run_batch(make_plan([*map(str, logs)]), folder, Products(("html",)))


LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r9ohm.csv"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a batch."""
    folder = tmp_path_factory.mktemp("made") / "results"
    _batch(folder, LOG)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """These results, with a page of a diagnosis that was written there afterwards."""
    shutil.copytree(made, tmp_path / "results")
    publish(
        Report("Diagnosis of a campaign", "A sentence."),
        html=tmp_path / "results" / "diagnosis.html",
    )
    return tmp_path / "results"


def test_the_page_lists_a_diagnosis_and_the_next_batch_keeps_it(folder: Path) -> None:
    assert "diagnosis.html" not in (folder / "index.html").read_text(encoding="utf-8")
    assert write_index(folder) == folder / "index.html"
    page = (folder / "index.html").read_bytes()
    assert b'href="diagnosis.html"' in page
    assert b'href="runs/r9ohm.csv.html"' in page
    assert load_results(folder).verified
    batch = _batch(folder, LOG)
    assert (batch.kept, batch.altered) == (1, ())
    assert (folder / "index.html").read_bytes() == page


def test_a_page_that_this_tool_did_not_write_is_not_listed(folder: Path) -> None:
    (folder / "diagnosis.html").write_text("<p>notes of the operator</p>", encoding="utf-8")
    write_index(folder)
    assert "diagnosis.html" not in (folder / "index.html").read_text(encoding="utf-8")


def test_a_folder_without_a_batch_gets_no_page(tmp_path: Path) -> None:
    assert write_index(tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_the_page_names_the_logs_that_failed_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "kaputt.csv").write_text("name,colour\na,b\n")
    _batch(tmp_path / "results", tmp_path / "kaputt.csv")
    page = (tmp_path / "results" / "index.html").read_text(encoding="utf-8")
    assert "kaputt.csv: " in page
