"""Designs: the schedule against an exhaustive search, limits, the worth of a repair against
simulations, and the domain.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest
from calls import call
from daily import daily
from hypothesis import given
from hypothesis import strategies as st
from rigs import calibrated_rig
from scipy.special import ndtr
from undrawn import undrawn

from winchcascade.batch.campaign_design import motions_of
from winchcascade.core.errors import OptionError
from winchcascade.core.run import Run
from winchcascade.design.corrected_rig import Explanation, mixed
from winchcascade.design.design import design
from winchcascade.design.design_result import METRIC, Design, Limits
from winchcascade.design.operating import PLACE, path_of, planned_cycle, points
from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.diagnosis.handover.posterior import RigPosterior
from winchcascade.diagnosis.handover.tested import NEAR
from winchcascade.report.results.design_report import design_record, schedule_csv
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.simulate import simulate

if TYPE_CHECKING:
    from pathlib import Path

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.handover.tested import Tested
    from winchcascade.rig.parts import Model

BOTH = Judgement("explained", causes=("copper_heating", "line_drag"))

LOADS, SPEEDS = [4.5, 9.0, 18.0], [0.3, 0.8]

SHORT = 1e-3
"""Relative loss of power or efficiency that a scheduled load may have against the best of a fine
grid. [1]
"""

ROUNDED = 1e-5
"""Probability beyond 1.96 standard deviations, for which 2.5 % stand. [1]"""

STEPS = 1e-5
"""Relative difference between simulations of a rig and of another one with the step that
resolves either. [1]
"""

RULE = 2e-3
"""Relative difference of two rules of integration. [1]"""

FIRST_CYCLE = 1100
"""Lines of the log whose motion is designed with that hold its head and its first cycle."""


@pytest.fixture(scope="module")
def tested(tested: Tested) -> Tested:
    """What the campaign tested, with half the stroke: points by shorter simulations."""
    return msgspec.structs.replace(tested, length=0.5 * tested.length)


@pytest.fixture(scope="module")
def found(small: RigPosterior, tested: Tested) -> Design:
    return design(
        small, msgspec.structs.replace(tested, judgement=BOTH), loads=LOADS, speeds=SPEEDS
    )


def along(model: Model, tested: Tested, speed: float, loads: list[float]) -> Signal:
    """Quantities of a model in a usual cycle at each load, (quantities, loads)."""
    path = path_of(planned_cycle(speed, tested.length, tested.ramp), model, tested.rules)
    return np.asarray(points([model], [path], loads)[0, 0].T)


def delivered(model: Model, tested: Tested, speed: float, load: float) -> float:
    """Energy of a simulated log of a usual cycle. [J]"""
    motion = path_of(planned_cycle(speed, tested.length, tested.ramp), model, tested.rules).motion
    run = Run("log", motion.t, {"velocity": motion.v}, 1.0 / motion.step, motion.t.size, load=load)
    made = simulate(run, model).run
    return float(np.trapezoid(made.channels["vdc"] ** 2 / load, made.t))


def test_a_scheduled_load_is_the_best_of_a_fine_grid(
    small: RigPosterior, tested: Tested, found: Design
) -> None:
    grid = np.geomspace(LOADS[0], LOADS[-1], 25).tolist()
    for one in found.schedule:
        assert one.load is not None
        assert one.gain is not None
        values = along(
            small.model(), tested, one.speed, [one.load, found.fixed[one.criterion], *grid]
        )
        own, fixed, *others = values[PLACE[METRIC[one.criterion]]]
        assert own >= (1.0 - SHORT) * max(others)
        assert one.gain.value == pytest.approx(own / fixed - 1.0, abs=1e-9)
        assert -SHORT < one.gain.low <= one.gain.value <= one.gain.high
    for criterion in METRIC:
        own = [one for one in found.schedule if one.criterion == criterion]
        assert [one.rpm_high for one in own[:-1]] == pytest.approx([one.rpm_low for one in own[1:]])


@pytest.mark.parametrize("speeds", [SPEEDS, [0.8]])
def test_one_load_is_scheduled_in_every_band_without_gain(
    small: RigPosterior, tested: Tested, speeds: list[float]
) -> None:
    one = design(small, tested, loads=[9.0], speeds=speeds)
    assert {row.speed for row in one.rows} == set(speeds)
    assert all(band.rpm_low < band.rpm_high and band.load == 9.0 for band in one.schedule)
    assert {(band.gain.low, band.gain.high) for band in one.schedule if band.gain is not None} == {
        (0.0, 0.0)
    }
    assert {*one.fixed.values(), one.repaired_at} == {9.0}


LIMITED = (("current", "i_s_a", 0.6), ("tension", "force_n", 0.7), ("heating", "i_dc_rms_a", 0.6))
"""Limits, the quantity of each, and the share of its largest value that is allowed."""


@pytest.mark.parametrize(("name", "quantity", "share"), daily(LIMITED, LIMITED[:1], spread=True))
def test_no_scheduled_load_exceeds_a_limit(
    small: RigPosterior, tested: Tested, found: Design, name: str, quantity: str, share: float
) -> None:
    most = share * max(row.values[quantity].value for row in found.rows)
    limits = Limits() if name == "heating" else Limits(**{name: most})
    covered = msgspec.structs.replace(tested, warm=most if name == "heating" else None)
    limited = design(small, covered, loads=LOADS, speeds=SPEEDS, limits=limits)
    for row in limited.rows:
        assert row.exceeds == ((name,) if row.values[quantity].value > most else ())
    assert [one.load for one in limited.schedule] != [one.load for one in found.schedule]
    for one in limited.schedule:
        loads = LOADS if one.load is None else [one.load]
        fastest = one.speed * 2.0 * one.rpm_high / (one.rpm_low + one.rpm_high)
        assert (along(small.model(), tested, fastest, loads)[PLACE[quantity]].min() <= most) == (
            one.load is not None
        )


def test_a_band_without_an_allowed_load_has_a_reason(small: RigPosterior, tested: Tested) -> None:
    limited = design(small, tested, loads=LOADS, speeds=SPEEDS, limits=Limits(speed=1500.0))
    beyond = [0.5 * (one.rpm_low + one.rpm_high) > 1500.0 for one in limited.schedule]
    assert set(beyond) == {True, False}
    assert [
        (one.load is None, one.gain is None, "speed" in one.reason) for one in limited.schedule
    ] == [(x,) * 3 for x in beyond]
    assert set(limited.fixed.values()) <= {*np.geomspace(LOADS[0], LOADS[-1], 41)}
    assert schedule_csv(limited).count("\n") == 1 + beyond.count(False) // 2


def test_limits_that_allow_nothing_leave_a_record_of_numbers(
    small: RigPosterior, tested: Tested
) -> None:
    nothing = design(small, tested, loads=LOADS, speeds=SPEEDS, limits=Limits(current=1e-3))
    record = json.loads(json.dumps(design_record(nothing), allow_nan=False))
    assert (
        {one["load_ohm"] for one in record["schedule"]}
        == {None}
        == set(record["fixed_load_ohm"].values())
    )
    assert record["repaired_at_load_ohm"] == LOADS[-1]


def test_a_repair_is_worth_the_difference_of_two_simulations(
    small: RigPosterior, tested: Tested, found: Design
) -> None:
    assert {one.effect for one in found.repairs} == set(BOTH.causes)
    for one in found.repairs:
        models = small.model(), small.model(without=one.effect)
        acting, repaired = (
            delivered(model, tested, SPEEDS[-1], found.repaired_at) for model in models
        )
        assert one.per_cycle.value == pytest.approx(repaired - acting, abs=RULE * acting)
        assert one.per_cycle.low <= one.per_cycle.value <= one.per_cycle.high


def test_a_year_adds_up_the_cycles_of_each_speed(
    small: RigPosterior, tested: Tested, tmp_path: Path
) -> None:
    table = tmp_path / "sea.csv"
    table.write_text("speed_mps,cycles_per_year\n0.4,3000\n0.8,1000\n", encoding="utf-8")
    motion, sea = motions_of(table)
    assert (motion, sea) == (None, [(0.4, 3000.0), (0.8, 1000.0)])
    covered = msgspec.structs.replace(tested, judgement=BOTH)
    for one in design(small, covered, loads=[9.0], speeds=[0.8], sea=sea).repairs:
        models = small.model(), small.model(without=one.effect)
        acting, repaired = (
            sum(n * along(model, tested, v, [9.0])[PLACE["e_gen_j"], 0] for v, n in sea)
            for model in models
        )
        assert one.per_cycle.value == pytest.approx((repaired - acting) / 4000.0, rel=STEPS)
        assert one.per_year is not None
        assert one.per_year.value == pytest.approx((repaired - acting) / 3.6e6, rel=STEPS)


def alike(small: RigPosterior, weight: float) -> RigPosterior:
    """The rig with a look-alike of its stator resistance that is an error of a sensor, of a
    weight.
    """
    keep = np.array([0, 1, 3])
    sensor = RigPosterior(
        small.nominal,
        small.numbers,
        small.moves,
        small.effects[1:],
        small.covariance[np.ix_(keep, keep)],
        weight,
    )
    return msgspec.structs.replace(small, weight=1.0 - weight, others=(sensor,))


@pytest.mark.parametrize("weight", daily((0.01, 0.3), (0.01,)))
def test_bands_and_worths_hold_a_look_alike_that_costs_nothing(
    small: RigPosterior, tested: Tested, found: Design, weight: float
) -> None:
    covered = msgspec.structs.replace(tested, judgement=BOTH)
    mixed_up = design(alike(small, weight), covered, loads=LOADS, speeds=SPEEDS)
    worths = {one.effect: one for one in mixed_up.repairs}
    per_cycle = worths["copper_heating"].per_cycle
    assert per_cycle.low == pytest.approx(0.0, abs=STEPS * per_cycle.value)
    assert worths["line_drag"].saved.low > 0.0
    without = small.model(without="copper_heating")
    for row, alone in zip(mixed_up.rows, found.rows, strict=True):
        own, band = alone.values["p_gen_w"], row.values["p_gen_w"]
        other = along(without, tested, row.speed, [row.load])[PLACE["p_gen_w"], 0]
        assert band.value == own.value
        assert (band.low < other < band.high) or weight < 0.025


def test_beyond_the_logs_bands_are_as_wide_as_the_law_of_each_effect_is_known(
    small: RigPosterior,
) -> None:
    effect = make_effect("stribeck", {"torque": 5.0})
    law = effect.effect.law_u
    exact = np.zeros((len(small.moves) + len(effect.values),) * 2)
    certain = msgspec.structs.replace(small, effects=(effect,), covariance=exact, others=())
    explanation = Explanation(certain)
    found = np.array([5.0, *np.full(len(explanation.moved) - 1, 5.0), 3.0])
    assert explanation.laws == {"stribeck": law}
    assert explanation.u(found, np.bool_(False)) == pytest.approx(2.0 * law)
    assert explanation.u(found, np.bool_(True)) == 0.0


@given(
    st.lists(
        st.tuples(st.floats(0.05, 1.0), st.floats(-3.0, 3.0), st.floats(0.1, 2.0)),
        min_size=1,
        max_size=4,
    ),
)
def test_an_interval_of_a_mixture_leaves_as_much_on_either_side(
    parts: list[tuple[float, float, float]],
) -> None:
    weights, values, u = np.array(parts).T
    low, high = mixed(weights / weights.sum(), values, u)
    for end, left in ((low, 0.025), (high, 0.975)):
        assert weights @ ndtr((end - values) / u) / weights.sum() == pytest.approx(
            left, abs=ROUNDED
        )


def test_a_candidate_acts_in_the_model_and_has_no_repair(
    small: RigPosterior, tested: Tested, found: Design
) -> None:
    doubtful = Judgement("partly_explained", causes=("line_drag",), candidates=("copper_heating",))
    parted = design(
        small, msgspec.structs.replace(tested, judgement=doubtful), loads=LOADS, speeds=SPEEDS
    )
    assert [one.effect for one in parted.repairs] == ["line_drag"]
    assert parted.rows == found.rows


@pytest.mark.parametrize("row", ["0.5,0,100", "0.5,-1", "nan,5", "1,2,3", "inf,5"])
def test_a_wrong_row_of_a_sea_is_rejected_with_its_line(tmp_path: Path, row: str) -> None:
    table = tmp_path / "sea.csv"
    table.write_text(f"speed_mps,cycles_per_year\n0.4,3000\n{row}\n", encoding="utf-8")
    with pytest.raises(OptionError, match=rf"sea\.csv.* 3 .*{row}"):
        motions_of(table)


@pytest.mark.slow
def test_bands_hold_the_rig_that_the_logs_are_of(fitted: RigPosterior, tested: Tested) -> None:
    stated, held = baseline(calibrated_rig()), []
    truth = make_effect("copper_heating", {"r_s_change": 0.4}).apply(stated)
    predicted = design(fitted, tested, loads=LOADS, speeds=[0.4, 0.8])
    for row in predicted.rows:
        true = along(truth, tested, row.speed, [row.load])[:, 0]
        held += [
            band.low <= true[PLACE[name]] <= band.high
            for name, band in row.values.items()
            if name != "rpm"
        ]
    assert np.mean(held) > 0.9
    (repair,) = predicted.repairs
    worth = np.diff(
        [delivered(model, tested, 0.8, predicted.repaired_at) for model in (truth, stated)]
    )[0]
    assert repair.per_cycle.low < worth < repair.per_cycle.high


def test_a_repair_beyond_the_currents_of_the_logs_is_outside_the_domain(
    small: RigPosterior, tested: Tested
) -> None:
    load, speed = LOADS[1], SPEEDS[-1]
    acting, repaired = (
        along(model, tested, speed, [load])[PLACE["i_dc_a"], 0]
        for model in (small.model(), small.model(without="copper_heating"))
    )
    assert repaired > acting
    for largest, within in ((2.0 * repaired, True), (0.5 * (acting + repaired), False)):
        border = (
            (0.0, 0.0),
            (2.0 * speed, 0.0),
            (2.0 * speed, largest / (1.0 + NEAR)),
            (0.0, largest / (1.0 + NEAR)),
        )
        covered = msgspec.structs.replace(tested, judgement=BOTH, border=border, force=math.inf)
        (one,) = (
            r
            for r in design(small, covered, loads=[load], speeds=[speed]).repairs
            if r.effect == "copper_heating"
        )
        assert one.within_domain == within


def test_points_beyond_the_logs_are_flagged(small: RigPosterior, tested: Tested) -> None:
    rows = design(small, tested, loads=[2.0, 4.5, 9.0], speeds=[0.25, 1.6]).rows
    within = {(row.load, row.speed) for row in rows if row.within_domain}
    assert (9.0, 0.25) in within
    assert not within & {(2.0, 0.25), (2.0, 1.6), (4.5, 1.6), (9.0, 1.6)}


def test_a_command_writes_the_map_as_json_and_the_schedule_as_csv(
    record: Path, fixtures: Path, tmp_path: Path
) -> None:
    written, table = tmp_path / "design.json", tmp_path / "schedule.csv"
    motion = tmp_path / "one_cycle.csv"
    rows = (fixtures / "campaign" / "r9ohm.csv").read_text().splitlines(keepends=True)
    motion.write_text("".join(rows[:FIRST_CYCLE]))
    options = (
        "--motion",
        motion,
        "--loads",
        "4.5,9",
        "--speeds",
        "0.4,0.8",
    )
    assert (
        call(
            "design", record, *options, "--current-limit", "14", "--json", written, "--csv", table
        ).code
        == 0
    )
    found = json.loads(written.read_text())
    assert (found["schema"], found["limits"]) == (
        "winchcascade/design/1",
        {"i_s_a": 14.0, "rpm": None, "force_n": None, "i_dc_rms_a": None},
    )
    assert {(row["load_ohm"], row["speed_mps"]) for row in found["rows"]} == {
        (r, v) for r in (4.5, 9) for v in (0.4, 0.8)
    }
    for row in found["rows"]:
        assert (
            row["over_limit"] == (row["i_s_a"]["value"] > 14.0) == (row["exceeds"] == ["current"])
        )
        assert all(row[name]["low"] <= row[name]["value"] <= row[name]["high"] for name in PLACE)
    causes = json.loads(record.read_text())["causes"]
    alike = {one["effect"]: [other["effect"] for other in one["look_alikes"]] for one in causes}
    assert {one["effect"]: one["look_alikes"] for one in found["repairs"]} == alike
    assert (found["causes"], found["candidates"]) == ([*alike], [])
    assert found["classes"]["copper_heating"]["name"] == "series_resistance"
    head, *lines = table.read_text().splitlines()
    assert head == "rpm_low,rpm_high,load_ohm,within_domain,verdict"
    power = [
        one
        for one in found["schedule"]
        if one["criterion"] == "power" and one["load_ohm"] is not None
    ]
    for line, one in zip(lines, power, strict=True):
        *cells, verdict = line.split(",")
        assert verdict == found["verdict"]
        numbers = {
            name: json.loads(cell) for name, cell in zip(head.split(",")[:-1], cells, strict=True)
        }
        assert numbers == pytest.approx({name: one[name] for name in numbers}, rel=1e-3)


@pytest.mark.parametrize(
    ("content", "options", "place"),
    [
        ('{"schema": "winchcascade/reduction/1"}', (), "other.json"),
        ("[]", (), "other.json"),
        ("{", (), "other.json"),
        (None, ("--rig", "hsu2026"), "--rig"),
        (None, ("--loads", "nine"), "--loads"),
        (None, ("--speeds", "0"), "--speeds"),
        (None, ("--current-limit", "-1"), "--current-limit"),
        (None, ("--tension-limit", "nan"), "--tension-limit"),
    ],
)
def test_what_cannot_be_designed_with_is_rejected(
    record: Path, tmp_path: Path, content: str | None, options: tuple[str, ...], place: str
) -> None:
    other = tmp_path / "other.json"
    other.write_text(content or record.read_text(), encoding="utf-8")
    done = call("design", other, *options)
    assert (done.code, done.out) == (2, "")
    assert place in done.err


def test_an_unexplained_diagnosis_is_rejected_and_forced_with_its_verdict(
    record: Path, tmp_path: Path
) -> None:
    refused, page, table = (
        tmp_path / name for name in ("refused.json", "design.html", "schedule.csv")
    )
    content = json.loads(record.read_text())
    content["posterior"]["tested"]["judgement"] |= {"verdict": "unexplained", "causes": []}
    refused.write_text(json.dumps(content), encoding="utf-8")
    options = (
        "design",
        refused,
        "--loads",
        "9",
        "--speeds",
        "0.8",
        "--csv",
        table,
        "--html",
        page,
        "--json",
    )
    done = call(*options, tmp_path / "refused_design.json")
    assert (done.code, done.out, table.exists(), page.exists()) == (2, "", False, False)
    assert str(refused) in done.err
    with undrawn():
        forced = call(*options, tmp_path / "forced.json", "--force")
    assert forced.code == 0
    written = json.loads((tmp_path / "forced.json").read_text())
    assert (written["verdict"], written["repairs"]) == ("unexplained", [])
    _, *rows = table.read_text().splitlines()
    assert {row.rpartition(",")[2] for row in rows} == {"unexplained"}
    assert "unexplained" in forced.out
    assert "unexplained" in page.read_text(encoding="utf-8")


def test_a_rig_without_a_model_is_rejected(fixtures: Path) -> None:
    done = call("design", fixtures / "campaign", "--rig", "kitepower")
    assert (done.code, done.out, "kitepower" in done.err) == (2, "", True)
