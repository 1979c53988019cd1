"""Archives: the one log inside is read as if it lay beside them, whatever its format, and
nothing is left behind.
"""

from __future__ import annotations

import gzip
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from campaign_log import SAME, SOURCE, clean, efficiencies
from daily import daily
from seeds import seeds, zipped

from winchcascade import read_run
from winchcascade.core.errors import LogError
from winchcascade.ingest.open_log import open_log

LOG = SOURCE.read_bytes()


def write(folder: Path, content: bytes, name: str = "run.dat") -> Path:
    (folder / name).write_bytes(content)
    return folder / name


BESIDE = {
    "README.md": b"x",
    "day 1/LIESMICH.txt": b"y",
    "__MACOSX/._r36ohm.csv": b"x",
    "photo.jpg": b"y",
}


@pytest.mark.parametrize(
    "content",
    [
        lambda: gzip.compress(LOG),
        lambda: zipped({"day 1/r36ohm.csv": LOG} | BESIDE),
        lambda: zipped({"no ending": LOG}),
    ],
    ids=["gzip", "zip with other files", "without an ending"],
)
def test_a_compressed_log_gives_the_same_results(
    content: Callable[[], bytes], tmp_path: Path
) -> None:
    run = read_run(write(tmp_path, content()))
    assert run.findings == ()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    "form", daily(("lvm", "tdms", "mat", "mat73", "parquet", "excel", "xls"), ("lvm", "excel"))
)
def test_a_log_of_any_format_may_be_inside(form: str, tmp_path: Path) -> None:
    inner = seeds(form)[0]
    plain = open_log(write(tmp_path, inner, "plain.dat"))
    packed = open_log(write(tmp_path, zipped({"log.dat": inner}), "packed.dat"))
    assert packed.headers == plain.headers
    one, other = (source.load([1, 2], None) for source in (plain, packed))
    assert all(np.array_equal(one.values[k], other.values[k], equal_nan=True) for k in (1, 2))
    plain.close()
    packed.close()


def test_several_logs_are_listed_and_one_can_be_named(tmp_path: Path) -> None:
    path = write(tmp_path, zipped({"a.csv": b"nothing", "b.csv": LOG}))
    with pytest.raises(LogError, match=r"'a.csv', 'b.csv'.*--sheet NAME"):
        read_run(path)
    assert read_run(path, table="b.csv").samples == 2767


def test_nothing_is_written_outside_of_the_scratch_folder_and_nothing_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "a" / "scratch"
    scratch.mkdir(parents=True)
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    source = open_log(write(tmp_path, zipped({"../../evil.csv": LOG})))
    assert [file.name for file in scratch.rglob("*.csv")] == ["evil.csv"]
    source.close()
    assert sorted(file.name for file in tmp_path.rglob("*")) == ["a", "run.dat", "scratch"]


def encrypted() -> bytes:
    content = bytearray(zipped({"a.csv": LOG}))
    content[6] |= 1
    content[content.index(b"PK\x01\x02") + 8] |= 1
    return bytes(content)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (lambda: zipped({"a.csv": b"t,v\n" + bytes(150_000_000)}), "unpacks to more than 100 MB"),
        (
            lambda: zipped({"a.zip": zipped({"b.csv": LOG})}),
            "a.zip: is an archive within an archive",
        ),
        (lambda: zipped({}), "holds no file that could be a log"),
        (lambda: zipped({"a.csv": LOG})[:20_000], "is damaged or breaks off"),
        (lambda: gzip.compress(LOG)[:20_000], "is damaged or breaks off"),
        (lambda: zipped({"a.csv": b""}), "a.csv: the file is empty"),
        (lambda: zipped({"a.csv": b"%PDF-1.4 " * 99}), "a.csv: is a PDF document"),
        (encrypted, "a.csv is encrypted"),
    ],
    ids=["bomb", "nested", "empty", "cut zip", "cut gzip", "an empty log", "no log", "encrypted"],
)
def test_an_archive_that_cannot_be_used_is_rejected(
    content: Callable[[], bytes], words: str, tmp_path: Path
) -> None:
    with pytest.raises(LogError, match=rf"^run.dat: .*{words}"):
        read_run(write(tmp_path, content()))
