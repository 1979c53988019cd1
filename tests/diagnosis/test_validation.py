"""Validation: comparison errors and uncertainties follow their definitions; the intervals hold
known errors of the model.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from calls import call
from diagnosed import LOGS, PLANTED, diagnosed, made_logs
from rigs import calibrated_rig

from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.explain.validation import Compared
from winchcascade.diagnosis.explain.windowed import QUANTITIES, quantities_of, windowed
from winchcascade.diagnosis.fit.covariance import (
    covariances_without,
    joint_covariance,
    predictive_covariance,
)
from winchcascade.diagnosis.fit.nuisances import SKEW, stated_share
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.verdict_limits import AS_GOOD
from winchcascade.reduction.efficiency import METRICS
from winchcascade.reduction.uncertainty import budget
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import simulate

RESOLVED = 1e-3
"""Share of the uncertainty of the data that the steps of the simulation may have. [1]"""

DERIVATIVE = 0.02
"""Relative difference of two standard uncertainties whose derivatives are taken at different
models. [1]
"""

every_campaign = pytest.mark.parametrize("name", PLANTED)


def true_metrics(found: ModelDiagnosis, log: int, model: Model) -> Signal:
    """Metrics of a model along the motion of a log, without noise, in its windows."""
    one = windowed(found.data, log)
    return quantities_of(simulate(one.log.run, model).run, one.rig, one.windows)


@every_campaign
def test_every_metric_of_every_run_is_validated_by_its_definitions(name: str) -> None:
    found = diagnosed(name)
    assert [(one.log, one.quantity) for one in found.validation] == [
        (k, m) for k in range(len(LOGS)) for m in METRICS
    ]
    for one in found.validation:
        assert (one.after is None) == (not found.causes)
        assert one.held_out == bool(found.causes)
        assert one.u_num < RESOLVED * one.u_d
        for side in (one.before, one.after):
            if side is None:
                continue
            assert side.u_val**2 == pytest.approx(one.u_num**2 + side.u_input**2 + one.u_d**2)
            assert side.error == pytest.approx(side.simulated - one.measured)
            assert (side.low, side.high) == pytest.approx(
                (side.error - COVERED * side.u_val, side.error + COVERED * side.u_val)
            )


@every_campaign
def test_the_interval_before_holds_the_known_error_of_the_model(name: str) -> None:
    """With nothing injected that is 0."""
    found, stated = diagnosed(name), baseline(calibrated_rig())
    truth = stated
    for effect, fields in PLANTED[name].items():
        truth = make_effect(effect, fields).apply(truth)
    errors = [
        true_metrics(found, k, stated) - true_metrics(found, k, truth) for k in range(len(LOGS))
    ]
    for one in found.validation:
        known = float(errors[one.log][QUANTITIES.index(one.quantity)])
        assert one.before.low < known < one.before.high, one.quantity
        assert known != 0.0 or not PLANTED[name]
        assert one.before.u_val < 0.05 * abs(one.measured)


@pytest.mark.parametrize("name", ["copper", "rolloff"])
def test_the_corrected_model_has_no_error_that_its_interval_excludes(name: str) -> None:
    for one in diagnosed(name).validation:
        assert one.after is not None
        assert one.after.low < 0.0 < one.after.high, one.quantity
    significant = [
        one.quantity
        for one in diagnosed(name).validation
        if not one.before.low < 0.0 < one.before.high
    ]
    assert {"power_gen", "eta_pto"} <= set(significant)


@pytest.fixture(scope="module")
def misread() -> ModelDiagnosis:
    """A rig without a gap, read by a torque sensor with a gain."""
    runs = [one.run for one in made_logs({"torque_gain": {"gain_error": GAIN}})]
    return diagnose(runs, calibrated_rig(), {"torque_gain": EFFECTS["torque_gain"]})


GAIN = 0.06


def test_an_error_of_a_sensor_belongs_to_the_data_and_not_to_the_model(
    misread: ModelDiagnosis,
) -> None:
    assert [cause.effect for cause in misread.causes] == ["torque_gain"]
    (gain,) = misread.causes[0].parameters.values()
    assert gain.low < GAIN < gain.high
    for one in misread.validation:
        true = float(
            true_metrics(misread, one.log, baseline(calibrated_rig()))[
                QUANTITIES.index(one.quantity)
            ]
        )
        assert abs(one.measured - true) < 3.0 * one.u_d, one.quantity
        assert one.before.low < 0.0 < one.before.high, one.quantity
        assert one.after is not None
        assert one.after.low < 0.0 < one.after.high, one.quantity
        assert not one.worse
    alone = [one.before.simulated for one in misread.validation]
    assert alone == pytest.approx(
        [one.before.simulated for one in diagnosed("nothing").validation], rel=0.02
    )


def test_only_what_a_found_error_moves_takes_its_uncertainty(misread: ModelDiagnosis) -> None:
    """A line energy has no torque, and so the accuracies of its sensors."""
    others = {
        (one.log, one.quantity): one.u_d / abs(one.measured)
        for one in diagnosed("nothing").validation
    }
    for one in misread.validation:
        same = one.u_d / abs(one.measured) == pytest.approx(others[one.log, one.quantity], rel=0.05)
        assert same or one.quantity in ("energy_mech", "power_mech", "eta_trans", "eta_gen"), (
            one.quantity
        )


def test_a_lag_that_a_log_leaves_open_is_known_better_beside_a_fit() -> None:
    found = diagnosed("nothing")
    for k in range(len(LOGS)):
        one = windowed(found.data, k)
        assert one.reduction is not None
        known = math.sqrt(2.0) * SKEW / one.log.run.fs
        rows = [
            (row.of, min(known / row.source.u, 1.0))
            if row.source is not None and row.source.basis == "relation"
            else (row.of, 1.0)
            for row in budget(one.reduction).rows
        ]
        assert any(share < 1.0 for _, share in rows)
        for own in (own for own in found.validation if own.log == k):
            u = math.hypot(*(share * (of[own.quantity] or 0.0) for of, share in rows))
            assert own.u_d == pytest.approx(u)


def test_the_uncertainty_of_the_inputs_is_what_the_rig_file_states() -> None:
    """What a fit allows a number beside that is an error of the model."""
    found = diagnosed("nothing")
    data, nothing = found.data, np.zeros(len(found.data.nuisances))
    shares = [stated_share(data.rig, n) for n in data.nuisances]
    of_inputs = np.flatnonzero(shares)
    for k in range(len(LOGS)):
        (stated, *moved) = (
            true_metrics(found, k, data.models(nu, [])[k])
            for nu in (nothing, *np.diag(shares)[of_inputs])
        )
        u = np.sqrt(sum((one - stated) ** 2 for one in moved))
        for one in (one for one in found.validation if one.log == k):
            assert one.before.u_input == pytest.approx(
                float(u[QUANTITIES.index(one.quantity)]), rel=DERIVATIVE
            )


@pytest.mark.parametrize("name", ["copper", "rolloff"])
def test_a_fit_without_the_logs_of_a_load_knows_less(name: str) -> None:
    found = diagnosed(name)
    joint = predictive_covariance(found.data, found.found)
    assert covariances_without(found.data, found.found, [-1.0])[-1.0] == pytest.approx(joint)
    for load in LOGS.values():
        more = covariances_without(found.data, found.found, [load])[load] - joint
        scale = np.sqrt(np.maximum(np.diag(joint), 1e-12))
        assert np.linalg.eigvalsh(more / np.outer(scale, scale))[0] > -1e-6
        assert np.trace(more / np.outer(scale, scale)) > 1.0


def test_a_discrepancy_that_the_fit_does_not_find_widens_no_prediction() -> None:
    found = diagnosed("copper")
    allowed, predictive = (
        joint_covariance(found.found),
        predictive_covariance(found.data, found.found),
    )
    scale = np.sqrt(np.maximum(np.diag(allowed), 1e-12))
    for covariance in (predictive, allowed - predictive):
        assert np.linalg.eigvalsh(covariance / np.outer(scale, scale))[0] > -1e-6
    assert np.diag(predictive)[0] < np.diag(allowed)[0]


def test_cycles_of_the_only_load_are_not_held_out_as_a_load() -> None:
    runs = [one.run for one in made_logs(PLANTED["copper"])[:1]]
    found = diagnose(
        runs, calibrated_rig(), {"copper_heating": EFFECTS["copper_heating"]}, title="one", seed=1
    )
    assert {one.held_out for one in found.validation} == {False}
    assert [one.effect for one in found.causes] == ["copper_heating"]
    alike = math.exp(-AS_GOOD)  # heating, which one run cannot show
    assert found.causes[0].probability <= 1.0 / (1.0 + alike)


def test_the_record_has_the_validation_of_each_run() -> None:
    found = diagnosed("copper")
    rows = json.loads(json.dumps(as_json(found), allow_nan=False))["validation"]
    assert len(rows) == len(found.validation)
    for row, one in zip(rows, found.validation, strict=True):
        assert (row["run"], row["quantity"]) == (found.runs[one.log].name, one.quantity)
        for side in ("before", "after"):
            assert row[side].keys() == set(Compared.__struct_fields__)
            assert row[side]["error"] == pytest.approx(getattr(one, side).error, rel=1e-4)


def test_a_validation_is_a_page_or_a_pdf(tmp_path: Path, fixtures: Path) -> None:
    done = call("diagnose", fixtures / "campaign", "--validation", tmp_path / "validation.txt")
    assert (done.code, done.out, "validation.txt" in done.err) == (2, "", True)
