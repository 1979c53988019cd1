"""The bridge against a switched-circuit simulator, against closed forms, and its table against the circuit itself."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from circuit import R_S, solved

from winchcascade.rig.bridge import bridge_state, bridge_table
from winchcascade.rig.switched import S_POINTS, TABLE, steady_state

EXACT = 1e-6
"""Closed forms are met to rounding and to how far a steady state is followed."""

INTERPOLATED, AT_THE_KINK = 2e-4, 2e-4
"""The table is within this share of the circuit; where conduction turns continuous, within this of V_LL / Z."""


def test_a_short_circuit_carries_the_sinusoid_of_the_phase_impedance() -> None:
    for rho in (0.1, 1.0, 10.0):
        i_dc, i_s = steady_state(1e-9, rho)
        assert i_s == pytest.approx(1.0 / math.sqrt(3.0), rel=EXACT)
        assert i_dc == pytest.approx(3.0 * math.sqrt(2.0) / math.pi / math.sqrt(3.0), rel=EXACT)


@pytest.mark.parametrize("u", [0.87, 0.9, 0.95, 0.99, 0.999])
def test_a_bridge_without_inductance_conducts_while_the_line_voltage_exceeds_the_dc_side(u: float) -> None:
    angle = math.acos(u)
    mean = 3.0 / math.pi * math.sqrt(2.0) / 2.0 * (2.0 * math.sin(angle) - 2.0 * angle * u)
    assert steady_state(u, 1e5)[0] == pytest.approx(mean, rel=1e-4)  # as rho is not infinite


def test_nothing_flows_where_the_back_emf_does_not_reach_the_dc_link() -> None:
    assert steady_state(1.0, 0.5) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert bridge_state(142.0, 100.0, R_S, 1.0, bridge_table())[:2] == (0.0, 0.0)
    assert bridge_state(1.4, 0.0, R_S, 0.0, bridge_table())[:2] == (0.0, 0.0)


def test_the_table_gives_what_the_circuit_gives() -> None:
    rng = np.random.default_rng(1)
    for u, phi in zip(1.0 - rng.uniform(0.02, 0.95, 300) ** 2, rng.uniform(0.05, 1.5, 300), strict=True):
        exact = steady_state(u, math.tan(phi))
        found = bridge_state(u * math.sqrt(2.0), 1.0, math.sin(phi), math.cos(phi), bridge_table())[:2]
        assert found == pytest.approx(exact, rel=INTERPOLATED, abs=AT_THE_KINK)


def test_the_table_that_ships_is_the_one_that_the_code_makes() -> None:
    table = np.load(TABLE)
    for i, j in ((40, 10), (128, 32), (200, 60)):
        s, phi = i / (S_POINTS - 1), np.linspace(0.03, 1.56, table.shape[1])[j]
        assert table[i, j] == pytest.approx(steady_state(1.0 - s * s, math.tan(phi)), rel=1e-6)  # single precision


def test_more_voltage_on_the_dc_side_never_draws_more_current() -> None:
    for speed in (0.2, 1.0, 3.0):
        currents = [bridge_state(v, 100.0, R_S, speed, bridge_table())[:2] for v in np.linspace(1.0, 141.0, 300)]
        assert np.all(np.diff(np.array(currents), axis=0) <= 1e-3)


V_WITHIN, I_WITHIN, P_WITHIN, V_OPEN_WITHIN = 0.003, 0.01, 0.007, 0.01
"""Shares that the model may be off from ngspice, whose diodes are not ideal and whose capacitor ripples."""

STIFF_FROM = {"C4m7": 1000.0, "C1m": 1500.0}
"""Speeds from which the DC link of a circuit is stiff. [rpm]"""


def test_steady_states_are_those_of_a_switched_circuit_simulator(shared: Path) -> None:
    with (shared / "bridge" / "ngspice_bridge.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if float(row["rpm"]) >= STIFF_FROM.get(row["cfg"], math.inf)]
    assert len(rows) > 40
    for row in rows:
        v_dc, i_s, p_em = solved(float(row["rpm"]), float(row["R"]))
        if float(row["R"]) > 100.0:
            assert v_dc == pytest.approx(float(row["vdc"]), rel=V_OPEN_WITHIN)
            continue
        assert v_dc == pytest.approx(float(row["vdc"]), rel=V_WITHIN)
        assert i_s == pytest.approx(float(row["irms"]), rel=I_WITHIN)
        assert p_em == pytest.approx(float(row["pem"]), rel=P_WITHIN)
