"""Numbers of the causes beside what is known and plausible of them, the law of the back-EMF, costs and thresholds."""

import msgspec
import numpy as np
import pytest
from diagnosed import PLANTED, SUSPECTS, diagnosed, made_logs

from winchcascade.diagnosis.cause_numbers import cause_numbers, profile_of, tolerance_of
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.diagnosis_result import Contribution
from winchcascade.diagnosis.load_costs import MAX_PARTS, OTHER, load_costs, waterfall_costs
from winchcascade.rig.baseline import load_rig
from winchcascade.rig.effects.catalogue import EFFECTS

# ------------------------------------------------------------------------------------------------------------ the laws
UNKNOWN = {
    "ke_rolloff", "rotor_windage", "line_drag", "drum_layering", "gas_polytropic", "electrical_lag", "drum_radius",
    "gear_ratio", "pole_pairs", "screw_lead", "encoder_scale", "stribeck", "clutch_drag",
    "load_proportional_loss",
}  # fmt: skip
"""Effects that change nothing of which a tolerance is known, or several numbers by a law."""


@pytest.mark.parametrize("effect", EFFECTS)
def test_the_tolerance_of_what_an_effect_changes_is_found(effect: str) -> None:
    assert (tolerance_of(diagnosed("nothing"), EFFECTS[effect]) == 0.0) == (effect in UNKNOWN)


def test_a_tolerance_is_reported_in_the_unit_of_its_effect() -> None:
    found = diagnosed("nothing")
    rig = found.rig
    sd = {(n.section, n.name): n.sd for n in found.data.nuisances}
    assert rig.generator.k_e is not None
    assert rig.restoring.p_precharge is not None
    assert tolerance_of(found, EFFECTS["ke_shift"]) == pytest.approx(sd["generator", "k_e"] / rig.generator.k_e.value)
    absolute = rig.restoring.p_precharge.value + 101325.0
    assert tolerance_of(found, EFFECTS["precharge"]) == pytest.approx(sd["restoring", "p_precharge"] / absolute)
    assert tolerance_of(found, EFFECTS["gear_mesh_loss"]) == pytest.approx(sd["drivetrain", "eta_mesh"])
    assert tolerance_of(found, EFFECTS["torque_gain"]) == pytest.approx(0.001)
    assert tolerance_of(found, EFFECTS["rotor_windage"]) == 0.0


def test_each_number_stands_within_what_is_plausible() -> None:
    (row,) = cause_numbers(diagnosed("copper"))
    assert row.low <= row.found.value <= row.high
    assert row.absent == 0.0


def test_the_roll_off_never_rises_lies_in_its_band_and_is_the_one_reported() -> None:
    found = diagnosed("rolloff")
    profile = profile_of(found)
    assert profile is not None
    assert profile.left[0] == 1.0
    assert np.all(np.diff(profile.left) <= 1e-12)
    assert np.all(profile.low <= profile.left + 2e-3)
    assert np.all(profile.high >= profile.left - 2e-3)
    reported = found.causes[0].parameters["k_e_ratio_at_10_a"].value
    if profile.current[-1] > 10.0:
        assert np.interp(10.0, profile.current, profile.left) == pytest.approx(reported, abs=1e-4)
    assert profile_of(diagnosed("copper")) is None


# ---------------------------------------------------------------------------------------------------------- the costs
def test_runs_of_one_load_are_averaged() -> None:
    found = diagnosed("copper")
    twice = msgspec.structs.replace(found, contributions=(*found.contributions, *found.contributions))
    for two, one in zip(load_costs(twice, "eta_pto"), load_costs(found, "eta_pto"), strict=True):
        assert (two.load, two.as_given) == pytest.approx((one.load, one.as_given))
        assert two.parts[0].value == pytest.approx(one.parts[0].value)


def test_the_causes_that_cost_least_are_one_part_and_nothing_is_lost() -> None:
    found = diagnosed("copper")
    (cause,), many = found.causes, 7
    shares = [(k + 1.0) / sum(range(1, many + 1)) for k in range(many)]

    def split(one: Contribution) -> Contribution:
        own, *others = one.parts
        parts = [
            msgspec.structs.replace(own, value=share * own.value, low=share * own.low, high=share * own.high)
            for share in shares
        ]
        return msgspec.structs.replace(one, parts=(*parts, *others))

    several = msgspec.structs.replace(
        found, causes=(cause,) * many, contributions=tuple(split(one) for one in found.contributions)
    )
    for whole, one in zip(waterfall_costs(found), waterfall_costs(several), strict=True):
        assert len(one.parts) == MAX_PARTS
        assert sum(part.effect == OTHER for part in one.parts) == 1
        assert one.as_given + sum(part.value for part in one.parts) == pytest.approx(one.measured, abs=1e-6)
        assert sum(p.value for p in one.parts[: MAX_PARTS + 1 - len(whole.parts)]) == pytest.approx(
            whole.parts[0].value
        )


def test_a_larger_effect_would_be_named_and_a_smaller_one_would_not() -> None:
    found = diagnosed("nothing")
    named = {one.effect: one.value for one in found.thresholds}
    assert set(named) == set(SUSPECTS)
    assert named["copper_heating"] is not None
    assert (
        tolerance_of(found, EFFECTS["copper_heating"])
        < named["copper_heating"]
        < PLANTED["copper"]["copper_heating"]["r_s_change"]
    )
    assert named["ke_rolloff"] is not None
    assert 0.8 < named["ke_rolloff"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("times", "named"), [(2.0, True), (0.4, False)])
def test_what_is_said_of_the_smallest_effect_holds_in_logs(times: float, named: bool) -> None:
    (minimum,) = (one.value for one in diagnosed("nothing").thresholds if one.effect == "copper_heating")
    assert minimum is not None
    runs = [one.run for one in made_logs({"copper_heating": {"r_s_change": times * minimum}})]
    found: ModelDiagnosis = diagnose(runs, load_rig("hsu2026"), {suspect: EFFECTS[suspect] for suspect in SUSPECTS})
    assert [cause.effect for cause in found.causes] == (["copper_heating"] if named else [])
