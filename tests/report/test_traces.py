"""Traces are thinned, but no peak is lost."""

import json
import math
from itertools import pairwise
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
from winchcascade.report.figures import powers_of
from winchcascade.report.time_histories import MAX_SPANS, READ_OUT, envelope, readout
from winchcascade.report.wording import clock_zero

SLACK = 4
"""Rows beyond `maximum`: the last stretch may be a short one (2), first and last row are always kept (2)."""

FOUR_DIGITS = 0.5e-3
"""What four digits may change in a value, relatively."""

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
    text = readout(reduction, powers_of(reduction))
    return json.loads(text, parse_constant=lambda word: pytest.fail(word))


def test_the_readout_of_a_short_log_has_every_sample(reduction: Reduction) -> None:
    run, data = reduction.run, page(reduction)
    traces = {trace["name"]: trace for trace in data["traces"]}
    assert data["span"] == [run.t[0], run.t[-1]]
    assert data["label"] == "Time (s)"
    assert data["times"] == pytest.approx(run.t.tolist())
    assert {"Line velocity", "Line tension", "P_line", "P_mech", "P_gen"} <= set(traces)
    assert (traces["Line tension"]["unit"], traces["P_gen"]["unit"]) == ("N", "W")
    assert traces["Line tension"]["x"] == pytest.approx(run.channels["force"].tolist(), rel=FOUR_DIGITS)
    power = run.channels["force"] * run.channels["velocity"]
    assert traces["P_line"]["x"] == pytest.approx(power.tolist(), rel=FOUR_DIGITS)


@pytest.mark.parametrize("n", [READ_OUT + 1, 3 * READ_OUT + 17, 100_003])
def test_the_readout_of_a_long_log_has_the_range_of_each_stretch(reduction: Reduction, n: int) -> None:
    force = 5000.0 + 1000.0 * np.random.default_rng(n).standard_normal(n)
    force[n // 3] = 19_876.0
    run = msgspec.structs.replace(
        reduction.run, t=0.04 * np.arange(n), samples=n, channels={"velocity": np.ones(n), "force": force}
    )
    data = page(msgspec.structs.replace(reduction, run=run, cycles=()))
    (trace,) = (trace for trace in data["traces"] if trace["name"] == "Line tension")
    times = np.array(data["times"])
    assert times[0] == 0.0
    assert (np.diff(times) > 0).all()
    assert times.size == len(trace["low"]) == len(trace["high"]) <= READ_OUT
    stretch = np.searchsorted(times, np.round(run.t, 3), side="right") - 1  # as the page finds it
    assert max(np.bincount(stretch)) <= 2 * n / times.size  # equal but for rounding
    for k in range(times.size):
        inside = force[stretch == k]
        assert [trace["low"][k], trace["high"][k]] == pytest.approx([inside.min(), inside.max()], rel=FOUR_DIGITS)
    assert max(trace["high"]) == pytest.approx(19_876.0, rel=FOUR_DIGITS)


def test_a_cycle_of_the_readout_spans_its_payout_hold_and_haul_in(reduction: Reduction) -> None:
    spans = page(reduction)["cycles"]
    assert [number for number, _, _ in spans] == [c.cycle for c in reduction.cycles]
    for (_, begin, end), c in zip(spans, reduction.cycles, strict=True):
        assert c.phases.haul_in is not None
        assert begin < c.window.onset < c.phases.haul_in[1] < end
    for (_, _, end), (_, begin, _) in pairwise(spans):
        assert end < begin


def test_the_readout_names_the_phase_and_the_window_of_an_instant(reduction: Reduction) -> None:
    spans = page(reduction)["spans"]
    c = reduction.cycles[1]
    inside = 0.5 * (c.window.onset + c.window.cutoff)
    assert {name for name, a, b in spans if a <= inside <= b} == {"payout of cycle 2", "integration window"}
    assert c.phases.haul_in is not None
    assert {name for name, a, b in spans if a <= sum(c.phases.haul_in) / 2 <= b} == {"haul-in of cycle 2"}


def test_the_readout_states_where_a_trace_is_repaired() -> None:
    log = Path(__file__).parents[2] / "fixtures" / "damaged_logs" / "dropouts.csv"
    found = reduce(read_run(log), window=5.48)
    traces = {trace["name"]: trace.get("repaired", []) for trace in page(found)["traces"]}
    (begin, end) = found.run.gaps["force"].tolist()[0]
    middle = 0.5 * (begin + end)
    inside = {name for name, spans in traces.items() if any(a <= middle <= b for a, b in spans)}
    assert inside == {"Line tension", "P_line"}


EPOCH = 1_776_506_400.0
"""18 April 2026 10:00 UTC in seconds of the Unix epoch."""

STAMP = 1e-6
"""What such a large float may lose of a second."""


def test_a_log_with_seconds_of_an_epoch_is_drawn_from_its_begin(reduction: Reduction) -> None:
    late = reduce(msgspec.structs.replace(reduction.run, t=reduction.run.t + EPOCH), window=5.48)
    usual, data = page(reduction), page(late)
    first = float(reduction.run.t[0])
    assert clock_zero(late.run) == EPOCH + first
    assert data["span"][0] == 0.0
    assert f"{EPOCH + first:.2f}" in data["label"]
    for key in ("span", "times"):
        assert data[key] == pytest.approx([t - first for t in usual[key]], abs=STAMP)
    for (_, *late_ends), (_, *ends) in zip(data["cycles"], usual["cycles"], strict=True):
        assert late_ends == pytest.approx([end - first for end in ends], abs=STAMP)


def test_a_log_that_begins_late_on_its_own_clock_keeps_its_clock(reduction: Reduction) -> None:
    run = msgspec.structs.replace(reduction.run, t=reduction.run.t + 1000.0)
    assert page(reduce(run, window=5.48))["span"][0] == pytest.approx(1000.0 + float(reduction.run.t[0]))


def test_a_reader_chooses_among_not_more_cycles_than_a_list_can_hold(reduction: Reduction) -> None:
    many = msgspec.structs.replace(reduction, cycles=reduction.cycles * 200)
    assert len(page(many)["cycles"]) == MAX_SPANS
