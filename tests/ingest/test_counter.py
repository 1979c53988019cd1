"""Clocks that count modulo N: they are counted on where they begin again, and samples lost there stay lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from campaign_log import HEAD, ROWS, SAME, T, clean, efficiencies, read, text

from winchcascade import Run

LATER = 40_000
"""First stamp: the counter runs before the log begins. [ms]"""


def counted(folder: Path, modulus: int, head: str, per_second: float = 1e3, lost: slice | None = None) -> Run:
    rows = [[str(round(t * per_second + LATER) % modulus), *row[1:]] for t, row in zip(T, ROWS, strict=True)]
    if lost is not None:
        del rows[lost]
    return read(folder, text(rows, [head, *HEAD[1:]]))


@pytest.mark.parametrize(("modulus", "places"), [(65_536, 2), (100_000, 1), (60_000, 2)])
def test_a_counter_of_milliseconds_is_counted_on(modulus: int, places: int, tmp_path: Path) -> None:
    run = counted(tmp_path, modulus, "Time (ms)")
    (finding,) = run.findings
    assert (finding.kind, finding.action, finding.count) == ("backward_stamp", "counted on", places)
    assert f"the clock counts up to {modulus / 1e3:g} s and begins again" in finding.message
    assert np.allclose(run.t - run.t[0], np.array(T) - T[0])
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_samples_lost_where_the_counter_begins_again_are_a_gap(tmp_path: Path) -> None:
    first = next(k for k, t in enumerate(T) if t * 1e3 + LATER >= 65_536)
    run = counted(tmp_path, 65_536, "Time (ms)", lost=slice(first, first + 2))
    assert {f.kind for f in run.findings} == {"backward_stamp", "dropped_samples"}
    assert run.t[-1] - run.t[0] == pytest.approx(T[-1] - T[0])


def test_a_clock_that_was_set_back_is_no_counter(tmp_path: Path) -> None:
    rows = [[f"{t if t < 55.0 else t - 41.3:.3f}", *row[1:]] for t, row in zip(T, ROWS, strict=True)]
    run = read(tmp_path, text(rows, HEAD))
    assert [f.action for f in run.findings if f.kind == "backward_stamp"] == ["later stamps moved forward to follow on"]
