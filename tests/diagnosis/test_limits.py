"""Numbers at the end of their range, and beyond what is plausible."""

import math

import msgspec
import numpy as np
import pytest
from openlog import motion_run
from scipy.stats import truncnorm

from winchcascade import simulate
from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.causes import one_sided, parameters_of
from winchcascade.diagnosis.diagnosis_result import Reported
from winchcascade.diagnosis.evidence import Fit, RigProblem, fit_set
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.solve import Bounds
from winchcascade.report.diagnosis_names import range_words
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect

RIG = built_in()


def fitted(drop: float) -> Reported:
    model = make_effect("diode_drop", {"v_d_extra": drop}).apply(baseline(RIG))
    data = Fitted([simulate(motion_run(load=load, cycles=2), model).run for load in (9.0, 36.0)], RIG)
    fit = fit_set(RigProblem(data, EFFECTS, ("diode_drop",)))
    return parameters_of(data, EFFECTS, fit, "diode_drop", 1.0)["v_d_extra"]


@pytest.mark.parametrize(("drop", "beyond"), [(1.0, False), (2.4, True)])
def test_a_fit_passes_the_plausible_range_and_says_so(drop: float, beyond: bool) -> None:
    found = fitted(drop)
    assert found.value == pytest.approx(drop, abs=0.2)
    assert found.low < drop < found.high
    assert (found.at_limit, found.beyond_range) == (None, beyond)


@pytest.mark.parametrize("push", [0.0, 0.5, 4.0, 300.0])
def test_the_interval_at_a_limit_holds_95_percent_of_a_normal_that_is_cut_off(push: float) -> None:
    curve, one = np.array([[4.0]]), np.ones(1)
    bounds = Bounds.of(-10.0 * one, one)
    none, slope = np.zeros(0), 2.0 * push * one
    fit = Fit(("a",), {"a": slice(0, 1)}, one, none, 0.0, none, curve, slope, bounds, None, {}, settled=True)
    away = one_sided(fit, 0, 1.0)
    expected = -math.log(0.05) / 300.0 if push == 300.0 else float(truncnorm(push, math.inf).isf(0.05)) - push
    assert away == pytest.approx(0.5 * expected, rel=1e-3)


def test_words_say_which_end_of_its_range_a_number_reaches() -> None:
    number = Reported(1.0, 0.8, 1.0, "V", "high")
    plain = msgspec.structs.replace(number, at_limit=None)
    low, beyond = (msgspec.structs.replace(plain, **change) for change in ({"at_limit": "low"}, {"beyond_range": True}))
    assert len({range_words(one) for one in (number, low, beyond, plain)}) == 4
    assert "upper" in range_words(number)
    assert range_words(plain) == ""
