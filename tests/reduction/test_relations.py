"""Channels tied to the motion: lags found, their part in the budget, bounds of the machine, several
logs."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from winchcascade import Reduction, Run, read_run, reduce, simulate
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.reduction.lags_between_runs import lags_between
from winchcascade.reduction.reduction_result import Relation
from winchcascade.reduction.run_record import reduction_json
from winchcascade.reduction.timing import TIMING
from winchcascade.reduction.uncertainty import budget
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import with_part

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
WINDOW = 5.96
METRICS = ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen", "eta_pto")


@cache
def clean() -> Run:
    return read_run(CAMPAIGN / "r18ohm.csv", rig=built_in(), load=18.0)


def late(seconds: float, *names: str) -> Run:
    run = clean()
    moved = {name: np.interp(run.t - seconds, run.t, run.channels[name]) for name in names}
    return replace(run, channels={**run.channels, **moved})


def scaled(factor: float, *names: str) -> Run:
    run = clean()
    return replace(
        run, channels={**run.channels, **{name: factor * run.channels[name] for name in names}}
    )


def relation(found: Reduction, y: str) -> Relation:
    (one,) = [r for r in found.relations if r.y == y]
    return one


def kinds(found: Reduction) -> set[tuple[str, str | None]]:
    return {(f.kind, f.channel) for f in found.quality}


@pytest.mark.parametrize("seconds", [-0.4, -0.06, 0.06, 0.4])
@pytest.mark.parametrize(("group", "y"), [(("torque", "force"), "torque"), (("vdc", "idc"), "vdc")])
def test_a_group_that_is_late_together_is_late_behind_the_motion(
    seconds: float, group: tuple[str, ...], y: str
) -> None:
    before, after = (
        relation(reduce(clean(), window=WINDOW), y),
        relation(reduce(late(seconds, *group), window=WINDOW), y),
    )
    assert after.lag - before.lag == pytest.approx(seconds, abs=2.0 * after.u)
    assert abs(before.lag) < 2.0 * before.u


def test_the_timing_of_a_group_changes_energies_as_its_row_of_the_budget_says() -> None:
    seconds, plain = 0.02, reduce(clean(), window=WINDOW)
    moved = reduce(late(seconds, "vdc", "idc"), window=WINDOW)
    (row,) = [
        r for r in budget(plain).rows if r.source and r.source.origin.startswith("vdc and idc")
    ]
    assert row.source is not None
    assert row.source.channel == TIMING
    for metric in METRICS:
        change = abs(moved.mean.value(metric) - plain.mean.value(metric))
        expected = (row.of[metric] or 0.0) * seconds / row.source.u
        assert change == pytest.approx(expected, rel=0.05, abs=1e-6 * plain.mean.value(metric))


def test_a_stated_u_lag_replaces_what_the_log_shows() -> None:
    rig = built_in()
    sensors = {
        name: replace(s, u_lag=0.003) if name in ("vdc", "idc") else s
        for name, s in rig.sensors.items()
    }
    rows = [
        r.source
        for r in budget(reduce(clean(), rig=replace(rig, sensors=sensors), window=WINDOW)).rows
    ]
    timed = {s.origin: s.u for s in rows if s is not None and s.channel == TIMING}
    assert timed["u_lag of vdc"] == timed["u_lag of idc"] == 0.003
    assert not any(origin.startswith(("vdc", "idc")) for origin in timed)


def test_a_lag_that_is_not_reported_lies_in_the_interval() -> None:
    plain, moved = (reduce(run, window=WINDOW) for run in (clean(), late(0.05, "vdc", "idc")))
    u = budget(moved).sensors
    assert ("channel_lag", "vdc") not in kinds(moved)
    for metric in METRICS:
        assert abs(moved.mean.value(metric) - plain.mean.value(metric)) < 2.0 * (u[metric] or 0.0)


@pytest.mark.parametrize(
    ("factor", "names", "found"),
    [
        (0.85, ("torque",), True),
        (0.85, ("velocity", "displacement"), True),
        (0.9, ("force",), True),
        (1.1, ("torque",), True),
        (1.1, ("force", "torque"), False),
        (1.0, (), False),
    ],
)
def test_a_machine_gives_no_more_than_it_takes(
    factor: float, names: tuple[str, ...], found: bool
) -> None:
    assert (
        ("gain_mismatch", "torque") in kinds(reduce(scaled(factor, *names), window=WINDOW))
    ) is found


def test_an_offset_of_the_torque_while_moving_is_friction_in_every_channel() -> None:
    """Such an offset reads as friction behind the sensor in place of friction before it, so that
    one log cannot show it: what a rig file states of friction errs by more."""
    offset, run, model = 10.0, clean(), baseline(built_in()).physics
    gear, mesh = model.drivetrain.gear, model.drivetrain.eta_mesh
    before = with_part(model, "winch", friction=offset)
    behind = with_part(model, "drivetrain", friction=offset * mesh / gear)
    logged = simulate(run, before).run.channels
    moving = (run.channels["velocity"] > 0.1) & (logged["torque"] > 0.0)
    shown = {**logged, "torque": logged["torque"] + offset * moving}
    other = simulate(run, behind).run.channels
    phases = reduce(run, window=WINDOW).cycles
    for cycle in phases:
        plateau = cycle.summary.payout.plateau
        assert plateau is not None
        rows = slice(*run.t.searchsorted([plateau.begin, plateau.braking]))
        for name in ("force", "torque", "vdc", "idc"):
            assert shown[name][rows] == pytest.approx(other[name][rows], rel=2e-3)


def test_a_load_in_milliohm_is_reported_beside_vdc_over_idc() -> None:
    assert ("load_mismatch", None) in kinds(reduce(replace(clean(), load=18000.0), window=WINDOW))


def test_the_json_has_every_relation_with_its_gain_and_lag() -> None:
    written = msgspec.json.decode(reduction_json(reduce(clean(), window=WINDOW)))["relations"]
    assert {(r["y"], r["x"]) for r in written} == {
        ("displacement", "velocity"), ("vdc", "velocity"), ("idc", "vdc"), ("torque", "velocity"), ("force", "torque"),
    }  # fmt: skip
    for r in written:
        assert abs(r["lag_s"]) < 0.03
        assert r["gain"] is None or math.isclose(r["gain"], 1.0, abs_tol=0.01)


def test_a_relation_is_that_of_its_own_channels_whatever_the_size_of_others() -> None:
    run = replace(
        clean(), channels={**clean().channels, "pressure": 1e6 * clean().channels["pressure"]}
    )
    before, after = (relation(reduce(of, window=WINDOW), "vdc") for of in (clean(), run))
    assert (after.lag, after.u) == pytest.approx((before.lag, before.u), rel=1e-6)


@pytest.mark.parametrize("y", ["displacement", "force", "torque", "vdc", "idc"])
def test_a_channel_that_never_changes_has_no_relation(y: str) -> None:
    found = reduce(scaled(0.0, y), window=WINDOW)
    assert y not in {r.y for r in found.relations}
    assert not {kind for kind in kinds(found) if kind[0] == "channel_lag"}


# ----------------------------------------------------------------------------------- several logs
def logs(*lags: float) -> dict[str, tuple[Relation, ...]]:
    return {
        f"{k}": (Relation("vdc", "velocity", "speed", lag, 0.006, 0.005, 0.1),)
        for k, lag in enumerate(lags)
    }


def test_a_lag_that_all_logs_share_is_known_better_than_that_of_one() -> None:
    (found,) = lags_between(logs(0.07, 0.072, 0.068, 0.071))
    assert len(found.names) == 4
    assert found.lag == pytest.approx(0.0705)
    assert found.u < 0.006


def test_a_log_that_is_late_beside_the_others_is_named() -> None:
    (found,) = lags_between(logs(0.0, 0.002, 0.08, -0.001))
    assert found.names == ("2",)
    assert list(lags_between(logs(0.0, 0.08))) == []
    assert list(lags_between(logs(0.0, 0.002, -0.001))) == []


def test_a_machine_of_another_rig_bounds_no_voltage() -> None:
    """A rig file that states its drum alone takes back-EMF and gear from another rig."""
    own = parse_rig(
        'based_on = "hsu2026"\nname = "ours"\n[winch]\nr_drum = {value = 0.2, unit = "m"}', "r"
    )
    assert own.states("winch.r_drum")
    assert not own.states("generator.k_e")
    assert built_in().states("generator.k_e", "winch.r_drum")
