"""A handful of the disturbances that `faults.py` tries by the hundred."""

import os
import random
from pathlib import Path

import pytest
from faults import BATCH, DEAL, ENDED, Kind, both_at_once, full_disk, kills, nowhere, too_large

pytestmark = pytest.mark.skipif(os.name == "nt", reason="ends processes as POSIX does")

RNG = random.Random(20260418)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ENDED, ids=lambda kind: kind.name)
def test_calls_that_are_ended_at_any_moment_lose_nothing(kind: Kind, tmp_path: Path) -> None:
    counts = kills(kind, tmp_path, 3, RNG)
    assert counts.faults == ()
    assert counts.tries == 3


@pytest.mark.slow
@pytest.mark.parametrize("kind", [BATCH, DEAL], ids=lambda kind: kind.name)
def test_two_calls_on_one_folder_leave_what_one_leaves(kind: Kind, tmp_path: Path) -> None:
    assert both_at_once(kind, tmp_path, 1, RNG).faults == ()


@pytest.mark.slow
@pytest.mark.parametrize("kind", [BATCH, DEAL], ids=lambda kind: kind.name)
def test_a_file_that_finds_no_room_is_one_sentence_and_nothing_is_lost(kind: Kind, tmp_path: Path) -> None:
    counts = too_large(kind, tmp_path, [1024, 16_384])
    assert counts.faults == ()
    assert counts.hits > 0


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "size"), [(BATCH, 60_000), (DEAL, 200_000)], ids=["batch", "deal"])
def test_a_full_disk_is_one_sentence_and_nothing_is_lost(kind: Kind, size: int, tmp_path: Path) -> None:
    counts = full_disk(kind, tmp_path, [size])
    if not counts.tries:
        pytest.skip("no file system may be mounted")
    assert counts.faults == ()


@pytest.mark.parametrize("kind", [BATCH, pytest.param(DEAL, marks=pytest.mark.slow)], ids=lambda kind: kind.name)
def test_a_folder_that_cannot_be_made_is_one_sentence(kind: Kind, tmp_path: Path) -> None:
    assert nowhere(kind, tmp_path).faults == ()
