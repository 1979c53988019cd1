"""Traces are thinned, but no peak is lost."""

import json
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.histories import POINTS, histories_json
from winchcascade.report.time_histories import envelope
from winchcascade.report.wording import clock_zero

SLACK = 4
"""Rows beyond `maximum`: the last stretch may be a short one (2), first and last row are always kept (2)."""

SIX_DIGITS = 0.5e-5
"""What six digits may change in a value, relatively."""

SHAPES = ("noise", "steps", "constant", "spike", "rising")


def array(shape: str, n: int, seed: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    rng = np.random.default_rng(seed)
    if shape == "noise":
        return rng.standard_normal(n)
    if shape == "steps":
        return rng.integers(-2, 3, n).astype(float)
    if shape == "constant":
        return np.full(n, 7.0)
    if shape == "rising":
        return np.arange(n, dtype=float)
    x = np.zeros(n)
    x[rng.integers(n)] = rng.choice([-1.0, 1.0])
    return x


@given(st.sampled_from(SHAPES), st.integers(1, 500), st.integers(4, 300), st.integers(0, 99))
@example("noise", 101, 100, 1)
@example("spike", 101, 100, 1)
@example("constant", 101, 100, 1)
@example("noise", 100, 100, 1)
@example("noise", 200, 100, 1)
@example("steps", 201, 100, 1)
@example("noise", 1, 4, 1)
def test_every_sample_lies_between_kept_ones_of_its_neighbourhood(shape: str, n: int, maximum: int, seed: int) -> None:
    x = array(shape, n, seed)
    rows = envelope(x, maximum)
    assert (rows[0], rows[-1]) == (0, n - 1)
    assert (np.diff(rows) > 0).all()
    assert rows.size <= maximum + SLACK
    assert (x[rows].min(), x[rows].max()) == (x.min(), x.max())
    near = math.ceil(2 * n / maximum)  # two rows of each stretch
    for i in range(n):
        beside = x[rows[(rows > i - near) & (rows < i + near)]]
        assert beside.min() <= x[i] <= beside.max()


@given(st.integers(1, 300), st.integers(0, 50), st.integers(0, 99))
def test_a_trace_that_is_short_enough_is_drawn_whole(n: int, room: int, seed: int) -> None:
    assert envelope(array("noise", n, seed), n + room).tolist() == list(range(n))


@pytest.mark.parametrize("place", [0, 1, 49_999, 99_998, 99_999])
@pytest.mark.parametrize("height", [-1.0, 1.0])
def test_a_single_odd_sample_of_a_long_trace_is_kept(place: int, height: float) -> None:
    x = np.zeros(100_000)
    x[place] = height
    assert place in envelope(x, 3000)


@pytest.fixture(scope="module")
def reduction() -> Reduction:
    log = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
    return reduce(read_run(log), window=5.48)


def page(reduction: Reduction) -> Any:
    return json.loads(histories_json(reduction), parse_constant=lambda word: pytest.fail(word))


def curves(data: Any) -> dict[str, list[float]]:
    return {series["label"]: series["values"] for row in data["rows"] for series in row["series"]}


def test_the_page_of_a_short_log_has_every_sample(reduction: Reduction) -> None:
    run, data = reduction.run, page(reduction)
    shown = curves(data)
    assert data["t"] == pytest.approx(run.t.tolist(), rel=SIX_DIGITS)
    assert shown["Line tension"] == pytest.approx(run.channels["force"].tolist(), rel=SIX_DIGITS)
    power = run.channels["force"] * run.channels["velocity"]
    assert shown["P_line"] == pytest.approx(power.tolist(), rel=SIX_DIGITS)


@pytest.mark.parametrize("n", [POINTS + 1, 3 * POINTS + 17, 100_003])
def test_the_page_of_a_long_log_has_the_range_of_each_stretch(reduction: Reduction, n: int) -> None:
    force = 5000.0 + 1000.0 * np.random.default_rng(n).standard_normal(n)
    force[n // 3] = 19_876.0
    run = msgspec.structs.replace(
        reduction.run, t=0.04 * np.arange(n), samples=n, channels={"velocity": np.ones(n), "force": force}
    )
    data = page(msgspec.structs.replace(reduction, run=run, cycles=()))
    shown, t = curves(data)["Line tension"], np.array(data["t"])
    assert t.size == len(shown) == POINTS
    assert (np.diff(t) >= 0.0).all()
    starts = np.linspace(0, n, POINTS // 2 + 1).astype(int)
    for low, high, a, b in zip(shown[::2], shown[1::2], starts[:-1], starts[1:], strict=True):
        assert [low, high] == pytest.approx([force[a:b].min(), force[a:b].max()], rel=SIX_DIGITS)


def test_payouts_and_repaired_stretches_are_marked_on_the_page() -> None:
    log = Path(__file__).parents[2] / "fixtures" / "damaged_logs" / "dropouts.csv"
    found = reduce(read_run(log), window=5.48)
    spans = page(found)["spans"]
    payouts = [(span["from"], span["to"]) for span in spans if span["colour"] == "payout"]
    assert payouts == [(c.phases.onset, c.phases.payout_end) for c in found.cycles]
    middle = float(found.run.gaps["force"][0].mean())
    assert any(span["from"] <= middle <= span["to"] for span in spans if span["colour"] == "repaired")


EPOCH = 1_776_506_400.0
"""18 April 2026 10:00 UTC in seconds of the Unix epoch."""


def test_a_log_with_seconds_of_an_epoch_is_drawn_from_its_begin(reduction: Reduction) -> None:
    late = reduce(msgspec.structs.replace(reduction.run, t=reduction.run.t + EPOCH), window=5.48)
    first = float(reduction.run.t[0])
    assert clock_zero(late.run) == EPOCH + first
    assert page(late)["t"] == pytest.approx([t - first for t in page(reduction)["t"]], abs=1e-4)
    for own, usual in zip(page(late)["spans"], page(reduction)["spans"], strict=True):
        assert own["from"] == pytest.approx(usual["from"] - first, abs=1e-5)


def test_a_log_that_begins_late_on_its_own_clock_keeps_its_clock(reduction: Reduction) -> None:
    run = msgspec.structs.replace(reduction.run, t=reduction.run.t + 1000.0)
    assert page(reduce(run, window=5.48))["t"][0] == pytest.approx(1000.0 + float(reduction.run.t[0]))
