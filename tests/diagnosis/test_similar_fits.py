"""Calibration, fit and plan of a rig in other units of nature find the same, each number times
its factor.
"""

from functools import cache

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from openlog import estimated_rig, made_log
from own_rigs import own_campaign, own_rig
from rigs import calibrated_rig
from units_of_nature import (
    BENCH,
    CHANNELS,
    EXACTLY,
    NUMBERS,
    Nature,
    factor_of,
    natures,
    rig_in,
    run_in,
)

from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run
from winchcascade.design.design import design
from winchcascade.design.design_result import Design
from winchcascade.design.operating import QUANTITIES
from winchcascade.design.run_plan import before, separate
from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.diagnosis.explain.planned_run import planned
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.nuisances import Nuisance
from winchcascade.diagnosis.fit.undetermined import undetermined
from winchcascade.diagnosis.handover.calibrate import calibrate
from winchcascade.diagnosis.handover.posterior import RigPosterior
from winchcascade.diagnosis.handover.tested import Tested as Covered
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.effects.effect import Parameter

FEW = settings(max_examples=max(settings().max_examples // 100, 1))
"""A fit takes about a second: fewer examples than of other laws."""

PAIR = ("copper_heating", "ke_rolloff")
LOADS, SPEEDS, LENGTH = (9.0, 27.0), (0.3, 0.6), 10.0
"""Of a plan: two effects, loads [ohm], line speeds [m/s] and the length of a payout [m]."""


def logs_of(kind: str) -> tuple[Rig, list[Run]]:
    """A rig of a kind of restoring module, with noisy logs of a cycle each."""
    if kind == "gas_screw":
        return calibrated_rig(), [
            made_log(seed=k, cycles=1, load=load) for k, load in enumerate((np.inf, 18.0, 4.5))
        ]
    return own_rig(kind), own_campaign(kind, "geared", {})


@cache
def fit_of(kind: str) -> Fitted:
    rig, runs = logs_of(kind)
    return Fitted(runs, rig)


def fit_in(nature: Nature, kind: str) -> Fitted:
    rig, runs = logs_of(kind)
    return Fitted([run_in(nature, run) for run in runs], rig_in(nature, rig))


def unit_of(nature: Nature, nuisance: Nuisance) -> float:
    """Factor of the standard deviation of a nuisance. [1]"""
    if nuisance.kind in ("rig", "law"):
        return factor_of(nature, nuisance)
    return {"timing": nature.time, "zero": nature.of(CHANNELS.get(nuisance.name, ""))}.get(
        nuisance.kind, 1.0
    )


def assert_fits_alike(nature: Nature, one: Fitted, other: Fitted) -> None:
    """Blocks, tolerances and whitened residuals at moved nuisances, and what moves them."""
    assert [(n.kind, n.path, n.phase, n.log) for n in other.nuisances] == [
        (n.kind, n.path, n.phase, n.log) for n in one.nuisances
    ]
    assert [n.sd for n in other.nuisances] == pytest.approx(
        [unit_of(nature, n) * n.sd for n in one.nuisances]
    )
    for name in ("start", "stop", "phase", "cycle", "joined"):
        assert np.array_equal(getattr(one.blocks, name), getattr(other.blocks, name)), name
    assert np.array_equal(one.seen, other.seen)
    nu = np.random.default_rng(1).normal(0.0, 0.5, len(one.nuisances))
    for x, y in (
        (one.residual(nu, []), other.residual(nu, [])),
        (one.columns(nu, []).dense, other.columns(nu, []).dense),
        (one.local.toarray(), other.local.toarray()),
    ):
        assert np.max(np.abs(y - x)) < EXACTLY * np.max(np.abs(x))


@FEW
@example(BENCH)
@given(natures())
def test_a_fit_compares_and_allows_the_same(nature: Nature) -> None:
    assert_fits_alike(nature, fit_of("gas_screw"), fit_in(nature, "gas_screw"))


@FEW
@example(BENCH)
@given(natures())
def test_so_does_that_of_a_spring(nature: Nature) -> None:
    assert_fits_alike(nature, fit_of("spring"), fit_in(nature, "spring"))


@FEW
@example(BENCH)
@given(natures(with_weights=True))
def test_so_does_that_of_a_counterweight_where_gravity_stays(nature: Nature) -> None:
    assert_fits_alike(nature, fit_of("counterweight"), fit_in(nature, "counterweight"))


DIRECTIONS = 1e-3
"""Difference of the powers of a direction that the logs do not know: those of derivatives by
small steps. [1]
"""


@pytest.mark.parametrize("kind", ["gas_screw", "spring"])
@FEW
@example(BENCH)
@given(natures())
def test_the_logs_do_not_know_the_same_directions(kind: str, nature: Nature) -> None:
    one, other = (undetermined(data) for data in (fit_of(kind), fit_in(nature, kind)))
    assert len(one) > 0
    assert [found.leading for found in other] == [known.leading for known in one]
    for known, found in zip(one, other, strict=True):
        assert found.powers == pytest.approx(known.powers, abs=DIRECTIONS)


@FEW
@example(BENCH)
@given(natures())
def test_a_calibration_finds_the_same_numbers(nature: Nature) -> None:
    run, rig = made_log(seed=1), estimated_rig()
    one, other = calibrate(run, rig), calibrate(run_in(nature, run), rig_in(nature, rig))
    for number, found in zip(one.numbers, other.numbers, strict=True):
        path = f"{number.section}.{number.name}"
        factor = factor_of(nature, Nuisance(number.name, path=path, kind="rig"))
        assert (found.value, found.u) == pytest.approx(
            (factor * number.value, factor * number.u), rel=EXACTLY
        ), path
    assert other.misfit == pytest.approx(one.misfit, rel=EXACTLY)
    assert other.regression.lag == pytest.approx(nature.time * one.regression.lag, rel=EXACTLY)
    assert other.regression.rpm_min == pytest.approx(
        nature.rotor * one.regression.rpm_min, rel=EXACTLY
    )


@pytest.mark.slow
@FEW
@example(BENCH)
@given(natures())
def test_a_design_has_the_same_points_and_schedule(nature: Nature) -> None:
    one, other = designed(Nature()), designed(nature)
    for row, found in zip(one.rows, other.rows, strict=True):
        assert found.within_domain == row.within_domain
        for name, band in row.values.items():
            factor, expected = nature.of(UNIT_OF[QUANTITIES[name]]), msgspec.structs.astuple(band)
            assert msgspec.structs.astuple(found.values[name]) == pytest.approx(
                [factor * x for x in expected], rel=EXACTLY
            ), name
    for best, again in zip(one.schedule, other.schedule, strict=True):
        assert best.load is not None
        assert again.load == pytest.approx(nature.ohm * best.load, rel=EXACTLY)
        assert again.rpm_low == pytest.approx(nature.rotor * best.rpm_low, rel=EXACTLY)
    for repair, found_repair in zip(one.repairs, other.repairs, strict=True):
        assert found_repair.effect == repair.effect
        assert found_repair.per_cycle.value == pytest.approx(
            nature.torque * repair.per_cycle.value, rel=EXACTLY
        )


UNIT_OF = {
    "rpm": "rotor", "W": "torque / time", "1": "", "N.m": "torque", "A": "ampere", "N": "force", "J": "torque",
    "s": "time",
}  # fmt: skip
"""Unit of a quantity of a design."""


@cache
def designed(nature: Nature) -> Design:
    """A design of a rig of two uncertain numbers and two effects."""
    speed, model = nature.length / nature.time, baseline(rig_in(nature, calibrated_rig()))
    numbers = tuple(
        Parameter(name, path=f"generator.{name}", operation="scale") for name in ("r_s", "k_e")
    )
    drag = 0.9 * nature.of(NUMBERS["winch.drag"])
    effects = (
        make_effect("copper_heating", {"r_s_change": 0.4}),
        make_effect("line_drag", {"b": drag}),
    )
    covariance = np.diag([0.03, 0.004, 0.05, drag / 9.0]) ** 2
    border = tuple((v * speed, i * nature.ampere) for v, i in ((0.0, 0.0), (0.9, 0.0), (0.9, 10.0)))
    loads = tuple(nature.ohm * load for load in LOADS)
    judgement = Judgement("explained", causes=("copper_heating", "line_drag"))
    force, length, ramp = 2000.0 * nature.force, 9.0 * nature.length, 1.6 * nature.time
    tested = Covered("", "", judgement, loads, border, force, 0.9 * speed, length, ramp)
    known = RigPosterior(model, numbers, (0.01, -0.002), effects, covariance)
    return design(known, tested, speeds=[v * speed for v in SPEEDS])


@example(BENCH)
@given(natures())
def test_a_planned_run_is_the_same_motion(nature: Nature) -> None:
    speed, time = nature.length / nature.time, nature.time
    run, other = (
        planned(9.0, 0.6, 10.0, 12.0, 25.0),
        planned(9.0, 0.6 * speed, 10.0 * nature.length, 12.0 * time, 25.0 / time),
    )
    assert (
        abs(run.t.size - other.t.size) <= 1
    )  # the last stamp is the end of the motion, or rounded beyond it
    k = min(run.t.size, other.t.size)
    assert other.t[:k] == pytest.approx(time * run.t[:k])
    assert other.channels["velocity"][:k] == pytest.approx(
        speed * run.channels["velocity"][:k], abs=EXACTLY * speed
    )


@pytest.mark.slow
@FEW
@example(BENCH)
@given(natures())
def test_a_plan_before_a_campaign_makes_the_same_runs(nature: Nature) -> None:
    speed, rig = nature.length / nature.time, calibrated_rig()
    loads, speeds = [x * nature.ohm for x in LOADS], [x * speed for x in SPEEDS]
    one = separate(before(rig, LOADS, SPEEDS, LENGTH), PAIR, EFFECTS, 2)
    other = separate(
        before(rig_in(nature, rig), loads, speeds, LENGTH * nature.length), PAIR, EFFECTS, 2
    )
    expected = [(run.load * nature.ohm, run.speed * speed) for run in one.runs]
    assert [(run.load, run.speed) for run in other.runs] == [
        pytest.approx(pair) for pair in expected
    ]
    assert other.expected == pytest.approx(one.expected, rel=EXACTLY)
    assert msgspec.structs.astuple(other.runs[0])[2:] == msgspec.structs.astuple(one.runs[0])[2:]
