"""Traces are thinned, but no peak is lost."""

import json
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
from winchcascade.report.figures.histories import POINTS, history_json, log_history, thinned
from winchcascade.report.wording import clock_zero

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
@example("spike", 101, 100, 1)
@example("noise", 100, 100, 1)
def test_a_thinned_trace_keeps_its_ends_and_its_extremes(
    shape: str, n: int, maximum: int, seed: int
) -> None:
    x = array(shape, n, seed)
    t, (kept,) = thinned(np.arange(n, dtype=float), [x], maximum)
    assert t.size == kept.size <= max(maximum, 1)
    assert (t[0], t[-1]) == (0.0, n - 1.0)
    assert (np.diff(t) >= 0.0).all()
    assert (kept.min(), kept.max()) == (x.min(), x.max())
    assert n > maximum or kept.tolist() == x.tolist()


def test_a_falling_trace_stays_one() -> None:
    _, (kept,) = thinned(np.arange(1000.0), [np.linspace(1.0, 0.0, 1000)], 100)
    assert (np.diff(kept) < 0.0).all()


@pytest.fixture(scope="module")
def reduction() -> Reduction:
    log = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
    return reduce(read_run(log), window=5.48)


def histories(reduction: Reduction) -> Any:
    return json.loads(
        history_json(log_history(reduction)), parse_constant=lambda word: pytest.fail(word)
    )


def curves(data: Any) -> dict[str, list[float]]:
    return {curve["label"]: curve["values"] for row in data["rows"] for curve in row["series"]}


def test_the_histories_of_a_short_log_have_every_sample(reduction: Reduction) -> None:
    run, data = reduction.run, histories(reduction)
    assert data["t"] == pytest.approx(run.t.tolist())
    assert curves(data)["Line tension"] == pytest.approx(
        run.channels["force"].tolist(), rel=SIX_DIGITS
    )
    power = run.channels["force"] * run.channels["velocity"]
    assert curves(data)["Power, P_line"] == pytest.approx(power.tolist(), rel=SIX_DIGITS)


@pytest.mark.parametrize("n", [POINTS + 1, 3 * POINTS + 17, 100_003])
def test_the_histories_of_a_long_log_keep_its_peaks(reduction: Reduction, n: int) -> None:
    force = 5000.0 + 1000.0 * np.random.default_rng(n).standard_normal(n)
    force[n // 3] = 19_876.0
    run = msgspec.structs.replace(
        reduction.run,
        t=0.04 * np.arange(n),
        samples=n,
        channels={"velocity": np.ones(n), "force": force},
    )
    data = histories(msgspec.structs.replace(reduction, run=run, cycles=()))
    drawn = curves(data)["Line tension"]
    assert len(data["t"]) == len(drawn) <= POINTS
    assert [min(drawn), max(drawn)] == pytest.approx([force.min(), 19_876.0], rel=SIX_DIGITS)
    assert data["t"][int(np.argmax(drawn))] == pytest.approx(
        run.t[n // 3], abs=2.0 * run.t[-1] / POINTS * 2.0
    )


def test_the_histories_mark_payouts_holds_and_repaired_stretches() -> None:
    log = Path(__file__).parents[2] / "fixtures" / "damaged_logs" / "dropouts.csv"
    found = reduce(read_run(log), window=5.48)
    data = histories(found)
    spans = data["spans"]
    for kind, ends in (
        ("payout", [[c.phases.onset, c.phases.payout_end] for c in found.cycles]),
        ("hold", [list(c.phases.hold) for c in found.cycles if c.phases.hold is not None]),
    ):
        assert [[span["from"], span["to"]] for span in spans if span["colour"] == kind] == ends
    (begin, end) = found.run.gaps["force"].tolist()[0]
    middle = 0.5 * (begin + end)
    marked = {row["series"][0]["label"]: row["repaired"] for row in data["rows"]}
    assert any(span["from"] <= middle <= span["to"] for span in marked["Line tension"])
    assert not any(
        span["from"] <= middle <= span["to"] for span in marked["Voltage of the DC link"]
    )


EPOCH = 1_776_506_400.0
"""18 April 2026 10:00 UTC in seconds of the Unix epoch."""

STAMP = 1e-4
"""What six digits and such a large float may lose of a second."""


def test_a_log_with_seconds_of_an_epoch_is_drawn_from_its_begin(reduction: Reduction) -> None:
    late = reduce(msgspec.structs.replace(reduction.run, t=reduction.run.t + EPOCH), window=5.48)
    first = float(reduction.run.t[0])
    assert clock_zero(late.run) == EPOCH + first
    assert histories(late)["t"] == pytest.approx(
        [t - first for t in histories(reduction)["t"]], abs=STAMP
    )


def test_a_log_that_begins_late_on_its_own_clock_keeps_its_clock(reduction: Reduction) -> None:
    run = msgspec.structs.replace(reduction.run, t=reduction.run.t + 1000.0)
    assert histories(reduce(run, window=5.48))["t"][0] == pytest.approx(
        1000.0 + float(reduction.run.t[0])
    )
