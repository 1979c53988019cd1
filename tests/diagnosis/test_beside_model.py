"""Laws of stages beside a model: what a stage gives beyond it is named at its place and with its
power, nothing is named where nothing acts, and what the model cannot explain is a contradiction.
"""

from functools import cache

from diagnosed import diagnosed

from winchcascade.diagnosis.stages.beside_model import beside_model
from winchcascade.diagnosis.stages.diagnose_stages import StageAgreement, StageDiagnosis
from winchcascade.report.results.diagnosis import diagnosis_report
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.baseline import baseline

HIDDEN_COPPER = 2.0 * 0.4
"""Resistance that a direct current meets beyond that of two phases, over that of one. [1]"""

HIDDEN_DRAGS = {"shaft_viscous": 0.0008, "clutch_drag": 3.0}
"""Viscous drag of the high-speed shaft [N m s/rad] and torque of the open clutch [N m]."""

HIDDEN_MESH = 0.06
"""Share of the power that the gear mesh of the outsider loses beyond its model. [1]"""


@cache
def laws_of(name: str) -> StageDiagnosis:
    """Laws of a small campaign beside its model."""
    own = beside_model(diagnosed(name)).by_laws
    assert own is not None
    return own


def at(found: StageDiagnosis, stage: str) -> StageAgreement:
    """Powers of one stage by laws and by causes."""
    return next(one for one in found.agreement if one.stage == stage)


def test_a_resistance_is_named_at_the_generator_with_the_power_of_the_cause() -> None:
    found = laws_of("copper")
    (cause,) = found.causes
    number, own = cause.parameters["resistance"], found.rig.generator.r_s
    assert own is not None
    assert (cause.effect, cause.stage, found.verdict) == ("copper", "generator", "explained")
    assert number.low <= HIDDEN_COPPER * own.value <= number.high
    assert all(one.agrees for one in found.agreement)
    assert at(found, "generator").by_laws < 0.0


def test_a_flux_that_falls_shows_at_the_generator_and_takes_no_power_of_the_shaft() -> None:
    found = laws_of("rolloff")
    assert {cause.stage for cause in found.causes} == {"generator"}
    assert all(one.agrees for one in found.agreement)
    lost = at(found, "generator")
    assert abs(at(found, "gearbox").by_laws) < 0.2 * abs(lost.by_laws)


def test_nothing_is_named_where_nothing_acts() -> None:
    found = laws_of("nothing")
    assert (found.verdict, found.causes, found.candidates) == ("no_gap", (), ())
    assert all(one.agrees for one in found.agreement)


def test_a_loss_outside_of_the_suspects_is_named_by_its_law_and_contradicts_the_model() -> None:
    found = laws_of("outsider")
    share = next(one for one in found.causes if one.effect == "power_share").parameters["share"]
    assert share.low <= HIDDEN_MESH <= share.high
    assert not at(found, "gearbox").agrees
    assert not as_json(beside_model(diagnosed("outsider")))["stage_laws"]["agrees"]


def test_a_drag_of_the_rotor_is_told_from_one_of_the_clutch_that_has_let_it_go() -> None:
    found = laws_of("drags")
    numbers = {one.effect: next(iter(one.parameters.values())) for one in found.fitted}
    assert numbers.keys() == HIDDEN_DRAGS.keys()
    gear = baseline(found.rig).drivetrain.gear
    hidden = HIDDEN_DRAGS | {"shaft_viscous": HIDDEN_DRAGS["shaft_viscous"] * gear**2}
    assert all(one.low <= hidden[name] <= one.high for name, one in numbers.items())


def test_laws_have_a_record_and_a_section_only_where_they_are_wanted() -> None:
    found = diagnosed("copper")
    beside = beside_model(found)
    record = as_json(beside)["stage_laws"]
    assert [one["effect"] for one in record["causes"]] == ["copper"]
    assert record["agrees"]
    assert {one["stage"] for one in record["agreement"]} == {
        "restoring",
        "transmission",
        "gearbox",
        "generator",
    }
    assert "stage_laws" not in as_json(found)
    reports = [diagnosis_report(each).illustrated() for each in (beside, found)]
    sections = [{one.id for one in report.sections} for report in reports]
    assert ["stage-laws" in each for each in sections] == [True, False]
