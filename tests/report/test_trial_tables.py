"""Numbers of a trial as its report tells them: in words, with units, with the digits that the interval allows."""

from winchcascade.blind.score import ParameterScore
from winchcascade.report.digits import MINUS
from winchcascade.report.trial_report import _parameter


def test_a_number_is_formatted_as_a_diagnosis_formats_it() -> None:
    score = ParameterScore("rotor_viscous", "b_extra", 0.0002478, 0.0002288, 0.0002116, 0.000246)
    drag = "fast shaft, drag over speed, mN·m·s/rad"
    assert _parameter(score) == ("rotor_viscous", drag, "0.2478", "0.2288", "0.2116 to 0.2460", "no")


def test_a_share_is_formatted_in_percent_with_a_true_minus() -> None:
    score = ParameterScore("ke_shift", "k_e_change", -0.01189, -0.01193, -0.01429, -0.009567)
    _, what, truth, found, interval, holds = _parameter(score)
    assert what == "back-EMF constant, %"
    assert (truth, found, interval) == (f"{MINUS}1.19", f"{MINUS}1.19", f"{MINUS}1.43 to {MINUS}0.96")
    assert holds == "yes"


def test_what_was_not_reported_is_a_dash() -> None:
    assert _parameter(ParameterScore("ke_shift", "k_e_change", 0.02))[3:] == ("–", "–", "no")
