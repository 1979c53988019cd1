"""Damaged files of every kind are read or rejected in one sentence, and faults that were found
stay mended.
"""

from collections.abc import Callable
from pathlib import Path

import fuzz
import numpy as np
import pyarrow as pa
import pytest
from calls import error_sentence
from mutate import mutated
from own_process import run_alone
from pyarrow import parquet
from seeds import DATA, HEADERS, SEEDS, seeds

from winchcascade import LogError, WinchcascadeError, audit, load_rig, open_campaign, read_run

MANY = 300
PATIENCE = 900.0
"""A run of so many inputs that has not ended after this never will. [s]"""

MEMORY = 3000
"""Largest memory of a process of the run: 2 GB for a file, and what the libraries take. [MB]"""


@pytest.mark.slow
def test_many_damaged_files_of_every_kind_are_read_or_rejected() -> None:
    ended = run_alone(fuzz.__file__, "--inputs", str(MANY), "--first", "1000000", patience=PATIENCE)
    assert [line for line in ended.out.splitlines() if ": " in line] == [], ended.err[-2000:]
    assert ended.code == 0
    assert ended.memory < MEMORY


@pytest.mark.parametrize("form", SEEDS)
def test_a_number_makes_the_same_file_at_every_call(form: str) -> None:
    first = [mutated(form, k) for k in range(3)]
    seeds.cache_clear()
    assert [mutated(form, k) for k in range(3)] == first


# --- what was found and mended

LOADERS: dict[str, Callable[[Path], object]] = {
    "rig": load_rig,
    "campaign": open_campaign,
    "table": audit,
}

NUMBERS = ("9" * 5000, "-" + "9" * 400, "9223372036854775809", "[[1, {a = 99999999999999999999}]]")


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number[:20])
@pytest.mark.parametrize("form", LOADERS)
def test_a_whole_number_beyond_64_bits_is_one_sentence(
    form: str, number: str, tmp_path: Path
) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(f"title = {number}\n", encoding="utf-8")
    with pytest.raises(WinchcascadeError) as caught:
        LOADERS[form](path)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 2100


@pytest.mark.parametrize(
    "content",
    [b'{"schema": "\xff"}', b"[" * 100_000, b'{"a": ' * 100_000],
    ids=["bytes", "lists", "deep"],
)
def test_json_that_is_no_text_or_too_deep_is_no_result(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_bytes(content)
    assert "result.json" in error_sentence(["check", path, "--against", "hsu2026-table2"])


def test_a_rejection_is_one_line_of_a_length_to_be_read_whatever_it_quotes() -> None:
    assert str(LogError("a\nb\tc\x1b[2J\u202e\ud800")) == "a b c?[2J??"
    said = str(LogError(f"a.csv: {'9' * 10_000}; expected less. Correct it."))
    assert said.startswith("a.csv: 999")
    assert said.endswith("9; expected less. Correct it.")
    assert len(said) < 2100


def test_a_signalling_nan_is_a_hole_like_any_other(tmp_path: Path) -> None:
    """Warnings are faults in these tests."""
    columns = {header: DATA[name].copy() for header, name in zip(HEADERS, DATA, strict=True)}
    for header in HEADERS[1:]:
        columns[header].view(np.uint64)[100] = 0x7FF0_0000_0000_0001
    parquet.write_table(pa.table(columns), tmp_path / "log.parquet")
    assert {f.kind for f in read_run(tmp_path / "log.parquet").findings} >= {"not_a_number"}
