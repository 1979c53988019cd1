"""The net worth of a repair is what it delivers more and takes less from the line."""

import pytest

from winchcascade.design.design_result import Repair
from winchcascade.diagnosis.handover.posterior import Band
from winchcascade.report.results.design_report import net_worth


def test_a_repair_that_takes_more_from_the_line_is_worth_less_than_it_delivers() -> None:
    one = Repair("copper_heating", Band(120.0, 110.0, 130.0), None, Band(-50.0, -54.0, -46.0), True)
    found = net_worth(one)
    assert found.value == pytest.approx(70.0)
    assert found.u == pytest.approx((10.0 + 4.0) / 1.96, rel=1e-3)
