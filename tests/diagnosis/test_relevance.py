"""Causes that are significant but too small to matter."""

import math

import msgspec
import pytest
from openlog import motion_run
from rigs import calibrated_rig

from winchcascade import simulate
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.diagnosis_result import Contribution, ContributionPart
from winchcascade.diagnosis.explain.contributions import without
from winchcascade.report.results.diagnosis_parts import minor_table
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect

RIG = calibrated_rig()


def diagnosed(share: float) -> ModelDiagnosis:
    """A drag of 0.05 N m s/rad in logs without noise, with so much of a channel's level called
    relevant.
    """
    model = make_effect("line_drag", {"b": 0.25}).apply(baseline(RIG))
    accuracy = msgspec.structs.replace(
        RIG.model, relevant_share=share, relevant_efficiency=share, discrepancy=1e-4
    )
    rig = msgspec.structs.replace(RIG, model=accuracy)
    runs = [simulate(motion_run(load=load, cycles=2), model).run for load in (9.0, 36.0)]
    return diagnose(
        runs, rig, {name: EFFECTS[name] for name in ("line_drag", "line_friction", "torque_gain")}
    )


@pytest.mark.slow
def test_a_cause_is_minor_where_it_changes_less_than_what_is_called_relevant() -> None:
    large, small = diagnosed(1e-4), diagnosed(0.2)
    assert ([cause.effect for cause in large.causes], large.verdict, large.minor) == (
        ["line_drag"],
        "explained",
        (),
    )
    (minor,) = small.minor
    assert (minor.effect, small.verdict, small.causes, small.unnamed) == (
        "line_drag",
        "no_gap",
        (),
        [],
    )
    assert 0.0 < abs(minor.largest.change) < 0.2
    assert minor.largest.load in (9.0, 36.0)
    assert all(part.effect is None for one in small.contributions for part in one.parts)
    table = minor_table(small)
    assert table is not None
    assert str(table.cells[0][0]).endswith("(line_drag)")
    assert math.isnan(minor.hint)
    (record,) = as_json(small)["minor"]
    assert record["effect"] == "line_drag"
    assert as_json(large)["minor"] == []


def test_the_part_of_a_minor_effect_counts_among_the_tolerances() -> None:
    parts = (
        ContributionPart("line_drag", "physical", 0.5, 0.2, 0.8),
        ContributionPart(None, "tolerances", 1.0, 0.6, 1.4),
        ContributionPart(None, "residual", 0.1, 0.0, 0.2),
    )
    (one,) = without([Contribution(0, 9.0, "eta_pto", 1.0, 2.6, parts)], {"line_drag"})
    tolerances, residual = one.parts
    assert (tolerances.value, tolerances.low, tolerances.high) == pytest.approx((1.5, 1.0, 2.0))
    assert residual == parts[-1]
