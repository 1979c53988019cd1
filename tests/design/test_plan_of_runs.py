"""Plans: more runs separate more and leave less uncertain; a plan is no longer than allowed and reports whether it suffices."""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from calls import call
from diagnosed import PLANTED, write_campaign

from winchcascade.core.rig_toml import built_in
from winchcascade.design.run_plan import Basis, RunPlan, after, before, determine, separate
from winchcascade.report.results.plan_report import plan_record
from winchcascade.rig.effects.catalogue import EFFECTS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from winchcascade.diagnosis.diagnose import ModelDiagnosis

PAIR = ("copper_heating", "ke_rolloff")
PLAN = ("plan", "hsu2026", "--loads", "9,27", "--speeds", "0.3,0.6")


OF_SCALES = 0.01
"""Share by which a run differs as one of several: these have the scales of their motion in common. [1]"""


@cache
def basis() -> Basis:
    """What is known of the rig of the paper before any run."""
    return before(built_in(), [9.0, 27.0], [0.3, 0.6], 10.0)


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
    options = basis().options
    alone = [separate(basis()._replace(options=[one]), PAIR, EFFECTS, 1).expected[0] for one in options]
    assert separated(5).expected[0] == pytest.approx(max(alone), rel=OF_SCALES)
    assert separated(5).runs[0] == options[alone.index(max(alone))]


def test_the_lightest_load_comes_once_more_at_the_end() -> None:
    *others, again = separated(5, separated(5).expected[1]).runs
    assert {run.place for run in others} == {"any"}
    assert (again.load, again.place) == (max(run.load for run in others), "last")


def test_an_effect_that_follows_the_order_needs_runs_at_both_ends() -> None:
    found = separate(basis(), ("gas_loss", "precharge"), EFFECTS, 4)
    assert {run.place for run in found.runs} == {"first", "last"}
    assert found.reached


def test_the_plan_after_a_diagnosis_begins_with_its_next_experiment(copper: ModelDiagnosis) -> None:
    wanted = copper.experiment
    assert wanted is not None
    found = separate(after(copper), wanted.separates, copper.suspects, 1)
    assert found.expected[0] == pytest.approx(wanted.expected_z)
    assert [(run.load, run.speed, run.place) for run in found.runs] == [(wanted.load, wanted.speed, "last")]


def test_every_run_leaves_a_metric_less_uncertain(copper: ModelDiagnosis) -> None:
    found = determined(5)
    assert len(found.runs) == 5
    assert all(more > less > 0.0 for more, less in pairwise((found.before, *found.expected)))
    assert found.expected[-1] < found.random
    known = after(copper, [9.0], [0.6])
    stated = before(copper.rig, [9.0], [0.6], known.setting.length)
    assert determine(known, "p_gen_w", 1e-9, 1).before < determine(stated, "p_gen_w", 1e-9, 1).before


@pytest.mark.parametrize("plan_of", [separated, determined])
def test_a_plan_ends_where_its_aim_is_reached_or_at_its_length(plan_of: Callable[..., RunPlan]) -> None:
    third, first = plan_of(5).expected[2], plan_of(5).before
    assert [(len(one.runs), one.reached) for one in (plan_of(5, third), plan_of(2, third))] == [(4, True), (2, False)]
    assert (plan_of(5, first).runs, plan_of(5, first).reached) == ((), True)
    record = json.loads(json.dumps(plan_record(plan_of(2, third)), allow_nan=False))
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
        ((*PLAN, "--separate", *PAIR, "--length", "1e9"), "0.3 m/s"),
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
    assert call(*PLAN, "--loads", "9,inf", "--separate", *PAIR, "--runs", "2", "--json", written).code == 0
    found = json.loads(written.read_text())
    assert found["schema"] == "winchcascade/plan/1"
    for run, expected in zip(found["runs"], found["expected"], strict=True):
        assert (run["load_ohm"] in (9.0, "inf"), run["speed_mps"] in (0.3, 0.6)) == (True, True)
        assert expected["pair"] == list(PAIR)
    assert found["reached"] == (found["expected"][-1]["z"] >= found["wanted"]["z"])


@pytest.mark.slow
def test_a_command_plans_after_a_campaign(tmp_path: Path) -> None:
    folder, written = write_campaign(tmp_path, PLANTED["copper"]), tmp_path / "plan.json"
    assert call("plan", folder, "--uncertainty", "eta_pto=0.0005", "--runs", "3", "--json", written).code == 0
    found = json.loads(written.read_text())
    assert {run["place"] for run in found["runs"]} == {"last"}
    assert found["expected"][-1]["u"] < found["without"]["u"]
