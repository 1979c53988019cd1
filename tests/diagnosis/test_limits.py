"""Numbers at the end of their range, and beyond what is plausible."""

import msgspec
import pytest
from openlog import motion_run
from rigs import calibrated_rig

from winchcascade import simulate
from winchcascade.diagnosis.diagnosis_result import Reported
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.diagnosis.fit.search import search
from winchcascade.diagnosis.judge.causes import parameters_of, posterior_of
from winchcascade.report.diagnosis_names import range_words
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect

RIG = calibrated_rig()


def fitted(drop: float) -> Reported:
    model = make_effect("diode_drop", {"v_d_extra": drop}).apply(baseline(RIG))
    data = Fitted(
        [simulate(motion_run(load=load, cycles=2), model).run for load in (9.0, 36.0)], RIG
    )
    found = search(RigProblem(data, {"diode_drop": EFFECTS["diode_drop"]}))
    return parameters_of(posterior_of(found, found.best), EFFECTS["diode_drop"], "diode_drop")[
        "v_d_extra"
    ]


@pytest.mark.parametrize(("drop", "beyond"), [(1.0, False), (2.4, True)])
def test_a_fit_passes_the_plausible_range_and_says_so(drop: float, beyond: bool) -> None:
    found = fitted(drop)
    assert found.value == pytest.approx(drop, abs=0.2)
    assert found.low < drop < found.high
    assert (found.at_limit, found.beyond_range) == (None, beyond)


def test_words_say_which_end_of_its_range_a_number_reaches() -> None:
    number = Reported(1.0, 0.8, 1.0, "V", "high")
    plain = msgspec.structs.replace(number, at_limit=None)
    low, beyond = (
        msgspec.structs.replace(plain, **change)
        for change in ({"at_limit": "low"}, {"beyond_range": True})
    )
    assert len({range_words(one) for one in (number, low, beyond, plain)}) == 4
    assert "upper" in range_words(number)
    assert range_words(plain) == ""
