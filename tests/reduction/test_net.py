"""Whole cycles: what a payout takes and a haul-in returns, the net energy from onset to onset, and when there is none."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from synthetic import SCENARIOS, integral, make_log, motion, powers, signals, write_csv

from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import FIELDS, NET_METRICS, Metrics
from winchcascade.reduction.energies import NetSpan, net_metrics
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import reduction_json
from winchcascade.reduction.uncertainty import budget, uncertainty

R36 = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
LOG = read_run(R36, load=36.0)
WHOLE = reduce(LOG, window=5.48)

ZERO = 3 * 2.0
"""The zero of the force of these logs is drawn with 2 N; times the travel it is in the energies of payout and haul-in. [N]"""

NOISE = 0.003
"""Share by which the net energies may differ from those of the exact motion; the zero cancels in them."""

REST = 1e-9
"""Only the order of the sums differs."""


def net(metrics: Metrics) -> list[float | None]:
    return [getattr(metrics, name) for name in NET_METRICS]


def changed(**channels: np.ndarray) -> Run:
    return msgspec.structs.replace(LOG, channels={**LOG.channels, **channels})


def cut(end: float, run: Run = LOG) -> Run:
    """The log until an instant."""
    n = int(np.searchsorted(run.t, end))
    return msgspec.structs.replace(
        run, t=run.t[:n], channels={name: x[:n] for name, x in run.channels.items()}, samples=n
    )


def reasons(found: Reduction) -> list[str | None]:
    return [c.net.reason for c in found.cycles]


@pytest.mark.parametrize("name", ["smooth", "heavy_load"])
def test_the_net_energies_are_those_of_the_exact_motion(name: str, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    write_csv(make_log(scenario, np.random.default_rng(5)), tmp_path / "log.csv")
    found = reduce(read_run(tmp_path / "log.csv", load=scenario.load))
    exact = signals(motion(scenario), scenario.load)
    watts = powers(exact)
    whole = [c for c in found.cycles if c.net.reason is None]
    assert whole
    for c in whole:
        assert c.phases.haul_in is not None
        joules = {
            "energy_payout": integral(exact.t, watts["line"], (c.phases.onset, c.phases.payout_end)),
            "energy_returned": -integral(exact.t, watts["line"], c.phases.haul_in),
            "energy_net": integral(exact.t, watts["line"], (c.net.begin, c.net.end)),
            "energy_gen_cycle": integral(exact.t, watts["gen"], (c.net.begin, c.net.end)),
        }
        for metric, joule in joules.items():
            zero = 0.0 if metric in ("energy_net", "energy_gen_cycle") else ZERO * (c.summary.payout.travel or math.nan)
            assert getattr(c.metrics, metric) == pytest.approx(joule, rel=NOISE, abs=zero), metric
        assert c.metrics.eta_net == pytest.approx(joules["energy_gen_cycle"] / joules["energy_net"], rel=NOISE)


def test_a_net_energy_is_the_payout_less_the_haul_in_and_what_moves_between() -> None:
    line = LOG.channels["force"] * LOG.channels["velocity"]
    for c in WHOLE.cycles:
        assert c.phases.haul_in is not None
        resting = [(c.phases.payout_end, c.phases.haul_in[0]), (c.phases.haul_in[1], c.net.end)]
        rest = sum(integral(LOG.t, line, span) for span in resting)
        m = c.metrics
        assert m.energy_payout is not None
        assert m.energy_returned is not None
        assert m.energy_net == pytest.approx(m.energy_payout - m.energy_returned + rest, rel=REST)
        assert m.eta_net is not None
        assert m.eta_pto is not None
        assert m.eta_net > m.eta_pto  # what the gas stores counts against eta_pto of the window alone


def test_a_cycle_ends_where_the_next_begins_and_the_last_with_the_log_at_rest() -> None:
    ends = [*(c.phases.onset for c in WHOLE.cycles[1:]), float(LOG.t[-1])]
    assert [(c.net.begin, c.net.end) for c in WHOLE.cycles] == [
        (c.phases.onset, end) for c, end in zip(WHOLE.cycles, ends, strict=True)
    ]
    assert reasons(WHOLE) == [None] * 3
    chosen = reduce(LOG, window=5.48, cycles=(1, 2))
    assert chosen.cycles[-1].net == WHOLE.cycles[1].net


@pytest.mark.parametrize("window", ["auto", "payout", 3.0, 9.0])
def test_net_energies_do_not_depend_on_the_window(window: str | float) -> None:
    assert net(reduce(LOG, window=window).mean) == pytest.approx(net(WHOLE.mean), rel=REST)


def test_a_log_that_ends_early_leaves_its_last_cycle_without_net_energies() -> None:
    last = WHOLE.cycles[-1].phases
    assert last.haul_in is not None
    assert last.hold is not None
    for end, reason in (
        (0.5 * (last.onset + last.payout_end), "the log ends inside the payout"),
        (0.5 * sum(last.hold), "no haul-in follows"),
        (0.5 * sum(last.haul_in), "the log ends before the line is at rest after the haul-in"),
        (last.haul_in[1] + 0.2, "the log ends before the line is at rest after the haul-in"),
        (last.haul_in[1] + 2.0, None),
    ):
        found = reduce(cut(end), window=5.48)
        assert reasons(found) == [None, None, reason]
        assert net(found.cycles[-1].metrics).count(None) == (0 if reason is None else 5)
        two = [c.metrics.eta_net for c in found.cycles if c.metrics.eta_net is not None]
        assert found.mean.eta_net == pytest.approx(sum(two) / len(two))


@pytest.mark.parametrize(("share", "whole"), [(0.007, True), (0.013, False)])
def test_a_line_that_ends_elsewhere_has_no_net_energy(share: float, whole: bool) -> None:
    first = WHOLE.cycles[0]
    assert first.net.travel is not None
    ramp = np.clip((LOG.t - first.net.begin) / (first.net.end - first.net.begin), 0.0, 1.0)
    drift = (share * (first.summary.payout.travel or math.nan) - first.net.travel) * ramp
    found = reduce(changed(displacement=LOG.channels["displacement"] + drift))
    assert (reasons(found)[0] is None) is whole
    assert reasons(found)[1:] == [None, None]


def test_a_gap_outside_the_window_counts_for_the_cycle_alone() -> None:
    c = WHOLE.cycles[0]
    middle = 0.5 * (c.window.cutoff + c.phases.payout_end)
    long, short = np.array([[middle, middle + 1.5]]), np.array([[middle, middle + 0.12]])
    found = reduce(msgspec.structs.replace(LOG, gaps={"force": long}), window=5.48)
    assert found.cycles[0].complete
    assert found.cycles[0].net.reason == "a gap of 1.50 s lies in the cycle (E_payout)"
    assert reasons(found)[1:] == [None, None]
    bridged = reduce(msgspec.structs.replace(LOG, gaps={"force": short}), window=5.48)
    assert reasons(bridged) == [None] * 3
    assert bridged.bridged["net"][0] > 0.0
    assert bridged.bridged["line"][0] == 0.0


def test_the_budget_of_a_net_energy_is_what_a_shifted_sensor_changes() -> None:
    """Shift each sensor by its standard uncertainty and reduce again: what changes is the row of the budget."""
    known = budget(WHOLE)
    for row in known.rows:
        source = row.source
        assert source is not None
        x = LOG.channels[source.channel]
        shifted = x * (1.0 + source.u) if source.part == "gain" else x + source.u
        moved = reduce(changed(**{source.channel: shifted}), window=5.48).mean
        for metric in NET_METRICS:
            change = abs(getattr(moved, metric) - getattr(WHOLE.mean, metric))
            assert change == pytest.approx(getattr(row.of, metric), rel=0.02, abs=1e-9), (source, metric)


def test_the_record_holds_the_net_energies_and_why_they_are_missing() -> None:
    last = WHOLE.cycles[-1].phases
    assert last.hold is not None
    found = reduce(cut(0.5 * sum(last.hold)), window=5.48)
    record = msgspec.json.decode(reduction_json(found, uncertainty(found)))
    fields = [FIELDS[name] for name in NET_METRICS]
    assert {"energy_payout_j", "energy_returned_j", "energy_net_j", "eta_net"} < set(fields)
    for part in ("mean", "standard_uncertainty", "interval_95"):
        assert all(record[part][field] is not None for field in fields)
    assert [c["net_span"]["reason"] for c in record["cycles"]] == [None, None, "no haul-in follows"]
    assert all(record["cycles"][-1][field] is None for field in fields)
    assert record["cycles"][0]["eta_net"] == pytest.approx(
        record["cycles"][0]["energy_gen_cycle_j"] / record["cycles"][0]["energy_net_j"]
    )


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
    joules: dict[str, float | None] = {"payout": 10e3, "returned": 2e3, "net": net_energy, "gen_cycle": gen}
    values, span = net_metrics(joules, NetSpan(0.0, 60.0))
    assert (values.get("eta_net"), span.reason is not None) == (eta, has_reason)


def test_an_open_circuit_has_no_net_energies() -> None:
    found = reduce(msgspec.structs.replace(LOG, load=math.inf))
    assert net(found.mean) == [None] * 5
    assert None not in reasons(found)
