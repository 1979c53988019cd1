"""A batch that is led out of its folder by links, or meets files like its own: what lies
elsewhere is the user's and stays.
"""

import os
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
from seeds import text
from test_files import MENTIONS

from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.store import LOCK

pytestmark = pytest.mark.skipif(os.name == "nt", reason="makes links as POSIX does")

FOLDERS = ("runs", "dataset")
FILES = (
    LOCK, "runs/log.csv.json", "runs/log.csv.html", "runs/log.csv.pdf", "campaign.json", "campaign.html", "campaign.pdf",
    "campaign.xlsx", "dataset/runs.parquet", "dataset/cycles.parquet", "dataset/bins.parquet",
)  # fmt: skip


def batched(out: Path, *, force: bool = False) -> None:
    run_batch(make_plan([str(out.parent / "log.csv")]), out, Products(workbook=True), force=force)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("folders")
    (place / "log.csv").write_text(text())
    batched(place / "batch")
    return place


@pytest.mark.parametrize("force", [False, True])
def test_no_link_leads_a_batch_out_of_its_folder(made: Path, tmp_path: Path, force: bool) -> None:
    for k, name in enumerate((*FOLDERS, *FILES)):
        out, user = shutil.copytree(made, tmp_path / f"{k}") / "batch", tmp_path / f"{k}" / "user"
        user.mkdir()
        for mine in ("own.json", "log.csv.json", "runs.parquet"):
            (user / mine).write_text('{"schema": "winchcascade/reduction/1", "mine": true}')
        before = {path.name: path.read_bytes() for path in user.iterdir()}
        if name in FOLDERS:
            shutil.rmtree(out / name)
        (out / name).unlink(missing_ok=True)
        (out / name).symlink_to(user if name in FOLDERS else user / "own.json")
        with suppress(WinchcascadeError):
            batched(out, force=force)
        assert {path.name: path.read_bytes() for path in user.iterdir()} == before, name


@pytest.mark.parametrize("name", FILES[1:3] + FILES[4:6] + FILES[7:9])
def test_a_file_that_mentions_the_mark_stays_in_a_folder_of_results(
    made: Path, tmp_path: Path, name: str
) -> None:
    for k, content in enumerate(MENTIONS.values()):
        out = shutil.copytree(made, tmp_path / f"{k}") / "batch"
        (out / name).write_text(content)
        with pytest.raises(WinchcascadeError, match="was not written by winchcascade"):
            batched(out)
        assert (out / name).read_text() == content
