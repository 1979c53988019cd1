"""A handful of the corruptions that `corruption.py` judges by the hundred, and the judge itself."""

from pathlib import Path

import numpy as np
import pytest
from base_logs import LOGS, RATES, base, bases
from clean_logs import print_findings
from corruption import CLASSES, draw, run, silent_share, table
from damage_signals import constant_offset, drift
from judge import Damage, csv, judged, moved, scratch, truth
from reasons import by_reason, lag_reason, zero_reason

SEED = 20261122


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("matrix")
    scratch(place)
    return place


@pytest.mark.parametrize("name", list(LOGS))
def test_undamaged_logs_have_no_finding_and_agree_at_all_rates(name: str, folder: Path) -> None:
    for rate in RATES:
        found = truth(base(name, rate))
        assert found.quality == ()
        assert moved(truth(base(name, 25)), found) == ((), set())


def test_a_change_beyond_the_bar_without_a_finding_is_silent(folder: Path) -> None:
    log = base("r18ohm", 25)
    damaged = log.changed(force=np.round(1.008 * log.columns["force"], 1))
    outcome = judged(Damage(log, "gain of force", frozenset({"force"}), csv(damaged)), folder)
    assert outcome.silent
    assert outcome.beyond[0] == "cycle 1 energy_line +0.80 %"


def test_a_change_below_the_bar_is_not_silent(folder: Path) -> None:
    log = base("r18ohm", 25)
    damaged = log.changed(force=np.round(1.002 * log.columns["force"], 1))
    outcome = judged(Damage(log, "gain of force", frozenset({"force"}), csv(damaged)), folder)
    assert outcome.beyond == ()
    assert not outcome.silent


def test_a_finding_counts_only_where_it_points_to_the_damage(folder: Path) -> None:
    log = base("r18ohm", 25)
    idc = log.columns["idc"].copy()
    idc[400] = 5000.0
    force = np.round(1.008 * log.columns["force"], 1)
    both = csv(log.changed(idc=idc, force=force))
    assert judged(Damage(log, "spike and gain", frozenset({"idc"}), both), folder).reported.startswith("spike idc")
    assert judged(Damage(log, "spike and gain", frozenset({"force"}), both), folder).silent


def test_a_cycle_that_is_reported_as_incomplete_is_not_silent(folder: Path) -> None:
    log = base("r18ohm", 25)
    end = int(np.searchsorted(log.t, truth(log).complete[2].window.onset + 2.0))
    outcome = judged(Damage(log, "ends in a window", frozenset(), csv(log.rows(np.arange(end)))), folder)
    assert outcome.beyond == ("cycle 3 incomplete",)
    assert outcome.reported


@pytest.mark.parametrize(
    ("late", "lag", "limit"),
    [
        (("velocity",), 0.09, "0.1 s between displacement and velocity"),
        (("idc",), 0.09, "0.1 s between vdc and idc"),
        (("vdc", "idc"), -0.2, "0.25 s between torque and vdc x idc"),
        (("force", "torque", "vdc", "idc"), 0.3, "0.35 s between velocity and vdc"),
        (("torque",), 0.09, "0.1 s between torque and force"),
        (("velocity",), 0.11, ""),
        (("torque",), 0.2, ""),
    ],
)
def test_a_lag_has_a_reason_only_below_the_smallest_limit_of_its_channels(
    late: tuple[str, ...], lag: float, limit: str
) -> None:
    reason = lag_reason(late, lag)(truth(base("r18ohm", 25)))
    assert (reason.figures if reason else "") == (f"{abs(lag):.3f} s; {limit}" if limit else "")


@pytest.mark.parametrize(("offset", "hidden"), [(0.8, True), (3.0, False)])
def test_a_zero_has_a_reason_only_inside_five_standard_uncertainties(offset: float, hidden: bool) -> None:
    log = base("r18ohm", 25)
    assert (zero_reason(log, "torque", log.columns["torque"] + offset)(truth(log)) is not None) == hidden


def test_a_force_has_a_reason_only_inside_the_band_of_friction() -> None:
    log = base("r45ohm", 25)
    reasons = [
        d.unseen(truth(log)) for k in range(40) if (d := constant_offset(log, np.random.default_rng(k), "force")).unseen
    ]
    assert None in reasons
    assert "friction explains the force at rest" in {r.why for r in reasons if r}


def test_a_silent_corruption_without_a_reason_is_listed_as_such() -> None:
    assert by_reason([(3, None)]) == "    3     1  no reason known"


def test_a_drift_that_should_be_seen_has_no_reason(folder: Path) -> None:
    log = base("r45ohm", 25)
    for k in range(12):
        outcome = judged(drift(log, np.random.default_rng(k)), folder)
        assert outcome.reported or outcome.reason or not outcome.beyond


@pytest.mark.parametrize("kind", list(CLASSES))
def test_a_corruption_is_the_same_at_every_call(kind: int, folder: Path) -> None:
    one, same, other = draw(kind, 1, SEED), draw(kind, 1, SEED), draw(kind, 1, SEED + 1)
    assert (one.what, repr(one.log)) == (same.what, repr(same.log))
    assert (one.what, repr(one.log)) != (other.what, repr(other.log))


@pytest.mark.parametrize("kind", list(CLASSES))
def test_no_corruption_ends_in_a_traceback(kind: int, folder: Path) -> None:
    (result,) = run([kind], range(1), SEED, folder)
    assert result.fault == ""
    assert len(table([result]).splitlines()) == 3


def test_every_class_has_logs_of_several_loads_and_rates(folder: Path) -> None:
    for kind, chosen in CLASSES.items():
        seen = {repr(draw(kind, number, SEED).log) for number in range(25)}
        assert len(seen) >= 3, kind
        assert seen <= {repr(b) for b in bases(chosen.rates)}, kind
        assert len(chosen.ways) > 1


MAX_SILENT, MAX_SILENT_IN_A_CLASS = 0.05, 0.15
"""Largest shares of silent corruptions among those that move a number beyond the bar."""


@pytest.mark.slow
def test_few_corruptions_beyond_the_bar_are_silent(folder: Path) -> None:
    results = list(run(list(CLASSES), range(27), SEED, folder))
    assert [r.fault for r in results if r.fault] == []
    found = table(results)
    for kind in CLASSES:
        assert silent_share([r for r in results if r.kind == kind]) <= MAX_SILENT_IN_A_CLASS, found
    assert silent_share(results) <= MAX_SILENT, found


@pytest.mark.slow
def test_undamaged_logs_have_no_finding(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert print_findings(folder, unreported_too=False) == 0, capsys.readouterr().out
