"""Plans: more runs separate more and leave less uncertain; a plan is no longer than allowed and
reports whether it suffices.
"""

from __future__ import annotations

import json
from copy import copy
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest
from calls import call
from daily import daily
from diagnosed import PLANTED, SUSPECTS, write_campaign
from rigs import calibrated_rig

from winchcascade.core.errors import OptionError, RigError
from winchcascade.core.integrate import white_noise
from winchcascade.core.quantity import Quantity
from winchcascade.design.run_plan import Basis, RunPlan, after, before, determine, separate
from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.diagnosis.diagnosis_result import Alternative
from winchcascade.diagnosis.explain.planned_run import (
    PlannedRun,
    Setting,
    planned,
    prospect_of,
    usual,
)
from winchcascade.diagnosis.explain.planning import listed, options_after, plan_run
from winchcascade.diagnosis.fit.nuisances import with_quantity
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.report.results.plan_report import plan_record
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.effects.run_order import RunOrder, passed, warming
from winchcascade.rig.simulate import simulate

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.fit.misfit import Fitted

PAIR = ("copper_heating", "ke_rolloff")
PLAN = ("plan", "hsu2026", "--loads", "9,27", "--speeds", "0.3,0.6")


NOISE = {
    "velocity": 1e-3,
    "pressure": 1500.0,
    "force": 8.0,
    "torque": 0.5,
    "vdc": 0.15,
    "idc": 0.012,
}
"""Noise of a sample of each channel, SI units."""

OF_SCALES = 0.01
"""Share by which a run differs as one of several: these have the scales of their motion in
common. [1]
"""


@cache
def basis() -> Basis:
    """What is known of the rig of the paper before any run."""
    return before(calibrated_rig(), [9.0, 27.0], [0.3, 0.6], 10.0)


@cache
def separated(most: int, wanted: float = 1e6) -> RunPlan:
    return separate(basis(), PAIR, EFFECTS, most, wanted)


@cache
def determined(most: int, wanted: float = 1e-9) -> RunPlan:
    return determine(basis(), "eta_pto", wanted, most)


def test_every_run_separates_two_effects_further() -> None:
    found = separated(5)
    assert (found.before, len(found.runs)) == (0.0, 5)
    assert all(less < more for less, more in pairwise((found.before, *found.expected)))
    assert found.expected[-1] > found.random


def test_the_first_run_of_a_plan_is_the_best_single_one() -> None:
    known = basis()._replace(setting=basis().setting._replace(noise=NOISE))
    alone = [
        separate(known._replace(options=[one]), PAIR, EFFECTS, 1).expected[0]
        for one in known.options
    ]
    found = separate(known, PAIR, EFFECTS, 1)
    assert found.expected[0] == pytest.approx(max(alone), rel=OF_SCALES)
    assert found.runs[0] == known.options[alone.index(max(alone))]


def test_the_lightest_load_comes_once_more_at_the_end() -> None:
    *others, again = separated(5, separated(5).expected[1]).runs
    assert {run.place for run in others} == {"any"}
    assert (again.load, again.place) == (max(run.load for run in others), "last")


def test_an_effect_that_follows_the_order_needs_runs_at_both_ends() -> None:
    found = separate(basis(), ("gas_loss", "precharge"), EFFECTS, 4)
    assert {run.place for run in found.runs} == {"first", "last"}
    assert found.reached


@pytest.mark.parametrize("few", daily([True, False], [True]))
def test_the_plan_after_a_diagnosis_begins_with_its_next_experiment(
    copper: ModelDiagnosis, few: bool
) -> None:
    wanted = copper.experiment
    assert wanted is not None
    assert wanted.load is not None
    options = after(copper, [wanted.load, 36.0], [wanted.speed])
    found = separate(options if few else after(copper), wanted.separates, copper.suspects, 1)
    assert found.expected[0] == pytest.approx(wanted.expected_z)
    assert [(run.load, run.speed, run.place) for run in found.runs] == [
        (wanted.load, wanted.speed, "last")
    ]


def test_runs_after_a_campaign_stay_within_what_was_reached_and_within_the_rating(
    copper: ModelDiagnosis,
) -> None:
    data, seen = copper.data, usual(copper.data)
    assert seen is not None
    options = after(copper).options
    assert {log.load for log in data.logs} < {one.load for one in options}
    current = max(speed / load for load, speed in seen.fastest.items())
    assert all(one.speed / one.load <= current for one in options)
    assert all(one.speed <= seen.fastest_at(one.load) for one in options)
    rated = data.rig.generator.speed_rated
    assert rated is not None
    per_speed = data.nominal.drivetrain.gear / data.nominal.winch.r_drum
    assert all(one.speed * per_speed <= rated.value * OVERSHOOT for one in options)
    half = with_quantity(data.rig, "generator", "speed_rated", Quantity(0.5 * rated.value, "rpm"))
    slow = options_after(with_rig(data, half), copper.found)
    assert slow is not None
    assert all(one.speed * per_speed <= 0.5 * rated.value * OVERSHOOT for one in slow[1])


OVERSHOOT = 1.01
"""Speed of the generator over that of the line in a run whose plateau has the rated speed: it
swings. [1]
"""


def with_rig(data: Fitted, rig: Rig) -> Fitted:
    """The same logs with another rig file."""
    found = copy(data)
    found.rig = rig
    return found


@pytest.mark.parametrize("speed", [1e-9, 1e-12])
def test_a_run_after_a_campaign_is_no_longer_than_memory_allows(
    copper: ModelDiagnosis, speed: float
) -> None:
    with pytest.raises(OptionError):
        after(copper, speeds=[speed])


def test_a_plan_keeps_what_the_logs_know_of_a_nuisance(copper: ModelDiagnosis) -> None:
    data, basis_after = copper.data, after(copper, [log.load for log in copper.data.logs])
    prospect = prospect_of(basis_after.setting, basis_after.options)
    shared = [
        (n, data.nuisances[int(np.argmax(row))])
        for n, row in zip(prospect.runs.nuisances, prospect.carried, strict=True)
        if row.any()
    ]
    assert all(
        (n.kind, n.path, n.name, n.phase, n.course) == (m.kind, m.path, m.name, m.phase, m.course)
        for n, m in shared
    )
    own = {
        n.kind
        for n, row in zip(prospect.runs.nuisances, prospect.carried, strict=True)
        if not row.any()
    }
    assert own == {"zero"}
    assert {n.kind for n, _ in shared} == {"rig", "law", "load", "gain", "timing", "discrepancy"}


@pytest.mark.parametrize("planned_for", daily([False, True], [False]))
def test_a_listed_pair_that_the_logs_know_together_alone_is_not_planned_for(
    copper: ModelDiagnosis, planned_for: bool
) -> None:
    found = copper.found
    assert isinstance(found.problem, RigProblem)
    groups = (frozenset({"copper_heating"}), frozenset({"line_drag"}))
    known = msgspec.structs.replace(found.problem, exclusive=(groups,))
    evidence = msgspec.structs.replace(found.evidence, problem=known)
    together = msgspec.structs.replace(
        found, expansion=msgspec.structs.replace(found.expansion, evidence=evidence)
    )
    alike = tuple(Alternative(name, 0.3, None) for name in ("line_drag", "ke_rolloff"))
    (cause,) = copper.fitted
    causes = [msgspec.structs.replace(cause, look_alikes=alike)]
    assert listed(together, causes) == (
        [("copper_heating", "ke_rolloff")],
        [("copper_heating", "line_drag")],
    )
    assert listed(found, causes)[1] == []
    if planned_for:
        experiment = plan_run(copper.data, together, causes)
        assert experiment is not None
        assert experiment.separates == ("copper_heating", "ke_rolloff")


@pytest.mark.parametrize("share", daily([0.035, 1e-3], [1e-3]))
def test_no_run_is_planned_that_the_rig_of_the_best_fit_could_not_make(
    copper: ModelDiagnosis, share: float
) -> None:
    """With a light rotor the slower runs cannot be stepped, with a lighter one none of them."""
    data = copy(copper.data)
    shaft = data.nominal.drivetrain
    light = shaft._replace(inertia_rotor=share * shaft.inertia_rotor)
    data.nominal = msgspec.structs.replace(data.nominal, drivetrain=light)
    with pytest.raises(RigError):
        prospect_of(*_options(data, copper))
    assert plan_run(data, copper.found, copper.fitted) is None


def _options(data: Fitted, found: ModelDiagnosis) -> tuple[Setting, list[PlannedRun]]:
    options = options_after(data, found.found)
    assert options is not None
    return options


PROMISED = 0.1
"""Share by which a promised uncertainty may differ from what the campaign with the run leaves:
noise is drawn once. [1]
"""


@pytest.mark.slow
def test_a_campaign_with_the_planned_run_leaves_the_uncertainty_that_is_promised(
    copper: ModelDiagnosis,
) -> None:
    begun = after(copper)
    plan = determine(begun, "eta_pto", 1e-9, 1)
    run = plan.runs[0]
    load, speed = run.load, run.speed
    model = make_effect("copper_heating", PLANTED["copper"]["copper_heating"]).apply(
        baseline(copper.rig)
    )
    made = simulate(
        planned(load, speed, begun.setting.length, begun.setting.time, begun.setting.rate), model
    ).run
    moves = ("velocity", "displacement")
    rng, noise = (
        np.random.default_rng(2),
        NOISE | {n: white_noise(copper.runs[0].channels[n]) for n in moves},
    )
    channels = {
        name: x + rng.normal(0.0, noise.get(name, 0.0), x.size) for name, x in made.channels.items()
    }
    logs = [*copper.runs, msgspec.structs.replace(made, channels=channels)]
    again = diagnose(logs, copper.rig, {name: EFFECTS[name] for name in SUSPECTS}, seed=1)
    promised = determine(begun._replace(options=[run]), "eta_pto", 1e-9, 1)
    left = determine(after(again, [load], [speed]), "eta_pto", 1e-9, 1).before
    assert promised.expected[0] < promised.before
    assert promised.expected[0] == pytest.approx(left, rel=PROMISED)


@pytest.mark.parametrize("heat", [0.0, 1.0, 9.0])
def test_a_planned_run_does_not_change_the_warmth_of_those_made(heat: float) -> None:
    order = RunOrder((0.0, 1.0, 2.0), (0.5, 1.0, 1.5))
    further = order.with_run(heat)
    assert warming(further, 3.0, 0.8)[:3] == pytest.approx(warming(order, 3.0, 0.8))
    assert passed(further) == pytest.approx((*passed(order), 1.5))
    assert warming(further.with_run(1.0), 3.0, 0.8)[:4] == pytest.approx(warming(further, 3.0, 0.8))


def test_every_run_leaves_a_metric_less_uncertain(copper: ModelDiagnosis) -> None:
    found = determined(5)
    assert len(found.runs) == 5
    assert all(more > less > 0.0 for more, less in pairwise((found.before, *found.expected)))
    assert found.expected[-1] < found.random
    known = after(copper, [9.0], [0.6])
    stated = before(copper.rig, [9.0], [0.6], known.setting.length)
    assert (
        determine(known, "p_gen_w", 1e-9, 1).before < determine(stated, "p_gen_w", 1e-9, 1).before
    )


@pytest.mark.parametrize("plan_of", [separated, determined])
def test_a_plan_ends_where_its_aim_is_reached_or_at_its_length(
    plan_of: Callable[..., RunPlan],
) -> None:
    third, first = plan_of(5).expected[2], plan_of(5).before
    assert [(len(one.runs), one.reached) for one in (plan_of(5, third), plan_of(2, third))] == [
        (4, True),
        (2, False),
    ]
    assert (plan_of(5, first).runs, plan_of(5, first).reached) == ((), True)
    record = json.loads(json.dumps(plan_record(plan_of(2, third)), allow_nan=False))
    assert record["known_together"] == []
    assert (record["reached"], [one["runs"] for one in record["expected"]]) == (False, [1, 2])


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (PLAN, "hsu2026"),
        ((*PLAN, "--uncertainty", "eta=0.001"), "eta"),
        ((*PLAN, "--uncertainty", "eta_pto=0"), "eta_pto=0"),
        ((*PLAN, "--uncertainty", "eta_pto=0.1", "--separate", *PAIR), "--separate"),
        ((*PLAN, "--uncertainty", "eta_pto=0.001", "--loads", "inf"), "--loads"),
        ((*PLAN, "--separate", "copper_heating", "nothing"), "nothing"),
        ((*PLAN, "--separate", "line_drag", "line_drag"), "--separate"),
        ((*PLAN, "--separate", *PAIR, "--length", "-1"), "--length"),
        ((*PLAN, "--separate", *PAIR, "--length", "1e9"), "--length"),
        ((*PLAN, "--separate", *PAIR, "--loads", ",".join(map(str, range(1, 102)))), "--loads"),
        ((*PLAN, "--separate", *PAIR, "--speeds", "0.5,nan"), "--speeds"),
        ((*PLAN, "--separate", *PAIR, "--loads", "-9"), "-9"),
        (("plan", "hsu2026", "--separate", *PAIR), "--loads"),
        (("plan", "kitepower", *PLAN[2:], "--separate", *PAIR), "kitepower"),
    ],
)
def test_what_cannot_be_planned_is_rejected(words: tuple[str, ...], place: str) -> None:
    done = call(*words)
    assert (done.code, done.out) == (2, "")
    assert place in done.err


def test_a_command_writes_the_plan_as_json(tmp_path: Path) -> None:
    written = tmp_path / "plan.json"
    assert (
        call(*PLAN, "--loads", "9,inf", "--separate", *PAIR, "--runs", "2", "--json", written).code
        == 0
    )
    found = json.loads(written.read_text())
    assert found["schema"] == "winchcascade/plan/1"
    for run, expected in zip(found["runs"], found["expected"], strict=True):
        assert (run["load_ohm"] in (9.0, "inf"), run["speed_mps"] in (0.3, 0.6)) == (True, True)
        assert expected["pair"] == list(PAIR)
    assert found["reached"] == (found["expected"][-1]["z"] >= found["wanted"]["z"])


@pytest.mark.slow
def test_a_command_plans_after_a_campaign(tmp_path: Path) -> None:
    folder, written = write_campaign(tmp_path, PLANTED["copper"]), tmp_path / "plan.json"
    assert (
        call(
            "plan", folder, "--uncertainty", "eta_pto=0.0005", "--runs", "3", "--json", written
        ).code
        == 0
    )
    found = json.loads(written.read_text())
    assert {run["place"] for run in found["runs"]} == {"last"}
    assert found["expected"][-1]["u"] < found["without"]["u"]
