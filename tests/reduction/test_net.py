"""Whole cycles: what a payout takes and a haul-in returns, the net energy from onset to onset,
and when there is none.
"""

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from synthetic import SCENARIOS, integral, make_log, motion, powers, signals, write_csv

from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import NET_METRICS, Metrics, named
from winchcascade.reduction.energies import NetSpan, net_metrics
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import reduction_json
from winchcascade.reduction.uncertainty import budget

LOG = read_run(Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv", load=36.0)
WHOLE = reduce(LOG, window=5.48)

ZERO = 3 * 2.0
"""The zero of the force of these logs is drawn with 2 N; times the travel it is in the energies
of payout and haul-in. [N]
"""

NOISE = 0.003
"""Share by which the net energies may differ from those of the exact motion; the zero cancels in
them.
"""


def net(metrics: Metrics) -> list[float | None]:
    return [metrics[name] for name in NET_METRICS]


def changed(**channels: np.ndarray) -> Run:
    return replace(LOG, channels={**LOG.channels, **channels})


def reasons(found: Reduction) -> list[str | None]:
    return [c.net.reason for c in found.cycles]


@pytest.mark.parametrize("name", ["smooth", "heavy_load"])
def test_the_net_energies_are_those_of_the_exact_motion(name: str, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    write_csv(make_log(scenario, np.random.default_rng(5)), tmp_path / "log.csv")
    found = reduce(read_run(tmp_path / "log.csv", load=scenario.load))
    exact = signals(motion(scenario), scenario.load)
    watts = powers(exact)
    whole = [c for c in found.cycles if c.net.reason is None and c.phases.haul_in is not None]
    assert whole
    for c in whole:
        span, haul_in = (c.net.begin, c.net.end), c.phases.haul_in or (0.0, 0.0)
        zero = ZERO * (c.summary.payout.travel or math.nan)
        joules = [
            integral(exact.t, watts["line"], (c.phases.onset, c.phases.payout_end)),
            -integral(exact.t, watts["line"], haul_in),
            integral(exact.t, watts["line"], span),
            integral(exact.t, watts["gen"], span),
        ]
        for value, joule, off in zip(net(c.metrics), joules, (zero, zero, 0.0, 0.0), strict=False):
            assert value == pytest.approx(joule, rel=NOISE, abs=off)
        assert c.metrics.eta_net == pytest.approx(joules[3] / joules[2], rel=NOISE)


def test_a_cycle_ends_where_the_next_begins_and_the_last_with_the_log_at_rest() -> None:
    onsets = [*(c.phases.onset for c in WHOLE.cycles), float(LOG.t[-1])]
    assert [(c.net.begin, c.net.end) for c in WHOLE.cycles] == [*pairwise(onsets)]
    assert reasons(WHOLE) == [None] * 3
    assert reduce(LOG, window=5.48, cycles=(1, 2)).cycles[-1].net == WHOLE.cycles[1].net


@pytest.mark.parametrize("window", ["auto", "payout", 3.0, 9.0])
def test_net_energies_do_not_depend_on_the_window(window: str | float) -> None:
    assert net(reduce(LOG, window=window).mean) == pytest.approx(net(WHOLE.mean), rel=1e-9)


def test_a_log_that_ends_early_leaves_its_last_cycle_without_net_energies() -> None:
    last = WHOLE.cycles[-1].phases
    hold, haul_in = last.hold or (0.0, 0.0), last.haul_in or (0.0, 0.0)
    for end, reason in (
        (0.5 * (last.onset + last.payout_end), "the log ends inside the payout"),
        (0.5 * sum(hold), "no haul-in follows"),
        (0.5 * sum(haul_in), "the log ends before the line is at rest after the haul-in"),
        (haul_in[1] + 0.2, "the log ends before the line is at rest after the haul-in"),
        (haul_in[1] + 2.0, None),
    ):
        n = int(np.searchsorted(LOG.t, end))
        cut = replace(
            LOG, t=LOG.t[:n], channels={name: x[:n] for name, x in LOG.channels.items()}, samples=n
        )
        found = reduce(cut, window=5.48)
        assert reasons(found) == [None, None, reason]
        assert net(found.cycles[-1].metrics).count(None) == (0 if reason is None else 5)
        two = [c.metrics.eta_net for c in found.cycles if c.metrics.eta_net is not None]
        assert found.mean.eta_net == pytest.approx(sum(two) / len(two))
        record = json.loads(reduction_json(found))
        assert [c["net_span"]["reason"] for c in record["cycles"]] == reasons(found)
        assert None not in [
            record["standard_uncertainty"][field] for field in named({}, NET_METRICS)
        ]


@pytest.mark.parametrize(("share", "whole"), [(0.007, True), (0.013, False)])
def test_a_line_that_ends_elsewhere_has_no_net_energy(share: float, whole: bool) -> None:
    first = WHOLE.cycles[0]
    ramp = np.clip((LOG.t - first.net.begin) / (first.net.end - first.net.begin), 0.0, 1.0)
    drift = (
        share * (first.summary.payout.travel or math.nan) - (first.net.travel or math.nan)
    ) * ramp
    found = reduce(changed(displacement=LOG.channels["displacement"] + drift))
    assert [reason is None for reason in reasons(found)] == [whole, True, True]


def test_a_gap_outside_the_window_counts_for_the_cycle_alone() -> None:
    c = WHOLE.cycles[0]
    middle = 0.5 * (c.window.cutoff + c.phases.payout_end)
    long, short = (
        reduce(replace(LOG, gaps={"force": np.array([[middle, middle + x]])}), window=5.48)
        for x in (1.5, 0.12)
    )
    assert long.cycles[0].complete
    assert reasons(long) == ["a gap of 1.50 s lies in the cycle (E_payout)", None, None]
    assert reasons(short) == [None] * 3
    assert short.bridged["net"][0] > 0.0
    assert short.bridged["line"][0] == 0.0


def test_the_budget_of_a_net_energy_is_what_a_shifted_sensor_changes() -> None:
    """Shift each sensor by its standard uncertainty and reduce again: what changes is the row of
    the budget.
    """
    for row in budget(replace(WHOLE, relations=())).rows:
        source = row.source
        assert source is not None
        x = LOG.channels[source.channel]
        shifted = x * (1.0 + source.u) if source.part == "gain" else x + source.u
        moved = reduce(changed(**{source.channel: shifted}), window=5.48).mean
        for metric in NET_METRICS:
            change = abs(moved.value(metric) - WHOLE.mean.value(metric))
            assert change == pytest.approx(row.of[metric], rel=0.02, abs=1e-9), (source, metric)


@pytest.mark.parametrize(
    ("net_energy", "gen", "eta", "has_reason"),
    [
        (8e3, 9e3, 1.125, False),
        (0.0, 6e3, None, True),
        (-1e3, 6e3, None, True),
        (8e3, -1e3, None, True),
        (None, 6e3, None, False),
    ],
)
def test_a_cycle_has_a_net_efficiency_where_line_and_generator_give_energy(
    net_energy: float | None, gen: float, eta: float | None, has_reason: bool
) -> None:
    joules: dict[str, float | None] = {
        "payout": 10e3,
        "returned": 2e3,
        "net": net_energy,
        "gen_cycle": gen,
    }
    values, span = net_metrics(joules, NetSpan(0.0, 60.0))
    assert (values.get("eta_net"), span.reason is not None) == (eta, has_reason)


def test_an_open_circuit_has_no_net_energies() -> None:
    found = reduce(replace(LOG, load=math.inf))
    assert net(found.mean) == [None] * 5
    assert None not in reasons(found)
