"""The page of a results folder lists a diagnosis as soon as one was written there."""

from pathlib import Path

import msgspec
import pytest

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import load_results
from winchcascade.batch.results_pages import list_diagnosis
from winchcascade.batch.run_batch import Batch, Products, run_batch
from winchcascade.core.store import KeptFiles, altered, marked
from winchcascade.report.publish import publish
from winchcascade.report.sheet import Note, Report, Section


class _Record(msgspec.Struct):
    store: KeptFiles


def _batch(campaign: Path, folder: Path) -> Batch:
    return run_batch(make_plan([str(campaign / "r9ohm.csv")]), folder, Products(("html",)))


@pytest.fixture
def folder(fixtures: Path, tmp_path: Path) -> Path:
    """Results of a batch, with a page of a diagnosis that was written there afterwards."""
    _batch(fixtures / "campaign", tmp_path / "results")
    page = Report("Diagnosis of a campaign", "Title", "", (), (), (Section("s", "Heading", (Note("A sentence."),)),))
    publish(page, html=tmp_path / "results" / "diagnosis.html")
    return tmp_path / "results"


def test_the_page_lists_a_diagnosis_and_the_record_knows_the_page(folder: Path) -> None:
    assert "diagnosis.html" not in (folder / "index.html").read_text(encoding="utf-8")
    assert list_diagnosis(folder) == folder / "index.html"
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert page.count('href="diagnosis.html"') == 2  # among the pages, and in the list of files
    assert 'href="runs/r9ohm.csv.html"' in page
    record = marked(folder / "campaign.json", _Record)
    assert isinstance(record, _Record)
    assert altered(folder, record.store.files) == []
    assert load_results(folder).verified
    assert sorted(path.name for path in folder.iterdir() if path.is_file()) == [
        "campaign.html", "campaign.json", "diagnosis.html", "index.html",
    ]  # fmt: skip


def test_the_next_batch_links_all_pages_to_it_and_reports_no_changed_file(fixtures: Path, folder: Path) -> None:
    list_diagnosis(folder)
    batch = _batch(fixtures / "campaign", folder)
    assert batch.altered == ()
    for page in ("campaign.html", "index.html"):
        assert 'href="diagnosis.html"' in (folder / page).read_text(encoding="utf-8")
    assert 'href="../diagnosis.html"' in (folder / "runs" / "r9ohm.csv.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_changed_page_and_another_folder_are_left_alone(folder: Path, tmp_path: Path) -> None:
    page = folder / "index.html"
    page.write_text(page.read_text(encoding="utf-8") + "<!-- mine -->", encoding="utf-8")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert list_diagnosis(folder) is None
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    (tmp_path / "other").mkdir()
    assert list_diagnosis(tmp_path / "other") is None
    assert list((tmp_path / "other").iterdir()) == []


def test_the_page_names_the_logs_that_failed_with_the_reason(fixtures: Path, tmp_path: Path) -> None:
    (tmp_path / "kaputt.csv").write_text("name,colour\na,b\n")
    logs = [str(fixtures / "campaign" / "r9ohm.csv"), str(tmp_path / "kaputt.csv")]
    run_batch(make_plan(logs), tmp_path / "results", Products(("html",)))
    page = (tmp_path / "results" / "index.html").read_text(encoding="utf-8")
    assert "<dt>Not reduced</dt><dd>kaputt.csv: " in page
    assert "no table of numbers found" in page
