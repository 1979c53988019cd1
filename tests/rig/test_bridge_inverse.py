"""The bridge the other way round gives back what went in."""

import numpy as np
import pytest

from winchcascade.rig.bridge import back_emfs, bridge_state, bridge_table, dc_voltages

R_S, L_S, POLE_PAIRS = 0.61, 3.35e-3, 2
RPM = np.repeat(np.array([200.0, 700.0, 1500.0, 2500.0, 3500.0]), 40)
RATIO = np.tile(np.linspace(0.05, 0.999, 40), 5)

V_LL = 0.062 * RPM
REACTANCE = POLE_PAIRS * RPM * np.pi / 30.0 * L_S
V_TOTAL = RATIO * np.sqrt(2.0) * V_LL
I_DC, I_S = np.array(
    [bridge_state(v, e, R_S, x, bridge_table())[:2] for v, e, x in zip(V_TOTAL, V_LL, REACTANCE, strict=True)]
).T


def test_the_voltage_at_a_current_is_the_one_that_gives_it() -> None:
    voltage, i_s = dc_voltages(V_LL, I_DC, R_S, REACTANCE, bridge_table())
    assert voltage == pytest.approx(V_TOTAL, rel=1e-7)
    assert i_s == pytest.approx(I_S, rel=1e-6, abs=1e-9)


def test_the_back_emf_at_a_current_is_the_one_that_gives_it() -> None:
    v_ll, i_s = back_emfs(V_TOTAL, I_DC, R_S, REACTANCE, bridge_table())
    assert v_ll == pytest.approx(V_LL, rel=1e-7)
    assert i_s == pytest.approx(I_S, rel=1e-6, abs=1e-9)


def test_without_a_current_the_link_is_charged_to_the_peak() -> None:
    voltage, i_s = dc_voltages(V_LL, np.zeros_like(V_LL), R_S, REACTANCE, bridge_table())
    assert voltage == pytest.approx(np.sqrt(2.0) * V_LL)
    assert not i_s.any()
    v_ll, i_s = back_emfs(V_TOTAL, np.zeros_like(V_LL), R_S, REACTANCE, bridge_table())
    assert v_ll == pytest.approx(V_TOTAL / np.sqrt(2.0))
    assert not i_s.any()


def test_more_than_a_short_circuit_leaves_no_voltage() -> None:
    voltage, _ = dc_voltages(V_LL, np.full_like(V_LL, 1e4), R_S, REACTANCE, bridge_table())
    assert np.all(voltage < 1e-6 * V_LL)
