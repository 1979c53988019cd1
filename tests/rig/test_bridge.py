"""The bridge against a switched-circuit simulator, and the other way round."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from circuit import NGSPICE, R_S, solved, solved_by_ngspice

from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.rig.bridge import back_emfs, bridge_state, bridge_table, dc_voltages
from winchcascade.rig.physics import RPM, reactance

WITHIN = {"vdc": 0.003, "irms": 0.01, "pem": 0.007}
"""Shares that the model may be off from the stored points, whose diodes are not ideal and whose
capacitor ripples.
"""

STIFF_FROM = {"C4m7": 1000.0, "C1m": 1500.0}
"""Speeds from which the DC link of a circuit is stiff. [rpm]"""


def test_steady_states_are_those_of_a_switched_circuit_simulator(shared: Path) -> None:
    with (shared / "bridge" / "ngspice_bridge.csv").open() as file:
        rows = [
            row
            for row in csv.DictReader(file)
            if float(row["rpm"]) >= STIFF_FROM.get(row["cfg"], math.inf)
        ]
    assert len(rows) > 40
    for row in rows:
        found = dict(zip(WITHIN, solved(float(row["rpm"]), float(row["R"])), strict=True))
        allowed = (
            {"vdc": 0.01} if float(row["R"]) > 100.0 else WITHIN
        )  # in open circuit some watts flow
        for name, share in allowed.items():
            assert found[name] == pytest.approx(float(row[name]), rel=share), (row, name)


@pytest.mark.skipif(NGSPICE is None, reason="needs ngspice on the path")
@pytest.mark.parametrize(
    ("rpm", "load"),
    [(1250.0, 15.0), (2300.0, 6.0), pytest.param(2900.0, 100.0, marks=pytest.mark.slow)],
)
def test_a_steady_state_is_that_of_ngspice_at_points_that_no_file_holds(
    rpm: float, load: float
) -> None:
    assert solved(rpm, load) == pytest.approx(solved_by_ngspice(rpm, load), rel=0.002)


def test_nothing_flows_where_the_back_emf_does_not_reach_and_more_voltage_never_draws_more() -> (
    None
):
    assert bridge_state(142.0, 100.0, R_S, 1.0, bridge_table())[:2] == (0.0, 0.0)
    assert bridge_state(1.4, 0.0, R_S, 0.0, bridge_table())[:2] == (0.0, 0.0)
    for speed in (0.2, 1.0, 3.0):
        currents = [
            bridge_state(v, 100.0, R_S, speed, bridge_table())[:2]
            for v in np.linspace(1.0, 141.0, 300)
        ]
        assert np.all(np.diff(np.array(currents), axis=0) <= 1e-3)


# ---------------------------------------------------------------------------- the other way round
MACHINE = baseline(built_in()).generator._replace(v_diode=0.0)
OMEGA = np.repeat(np.array([200.0, 700.0, 1500.0, 2500.0, 3500.0]), 40) / RPM
V_LL, REACTANCE = MACHINE.k_e * OMEGA * RPM, reactance(OMEGA, MACHINE)
V_DC = np.tile(np.linspace(0.05, 0.999, 40), 5) * np.sqrt(2.0) * V_LL
I_DC, I_S = np.array(
    [
        bridge_state(v, e, MACHINE.r_s, x, bridge_table())[:2]
        for v, e, x in zip(V_DC, V_LL, REACTANCE, strict=True)
    ]
).T


def test_the_inverse_gives_back_what_went_in() -> None:
    load = float(V_DC[20] / I_DC[20])
    for found, known, where in (
        (dc_voltages(MACHINE, OMEGA, I_DC, bridge_table()), V_DC, slice(None)),
        (dc_voltages(MACHINE, OMEGA, 0.0 * OMEGA, bridge_table(), 1.0 / load), V_DC, slice(20, 21)),
        (back_emfs(MACHINE, OMEGA, V_DC, I_DC), V_LL, slice(None)),
    ):
        assert found[0][where] == pytest.approx(known[where], rel=1e-7)
        assert found[1][where] == pytest.approx(I_S[where], rel=1e-6, abs=1e-9)


def test_without_a_current_the_link_is_charged_to_the_peak_and_a_short_circuit_leaves_none() -> (
    None
):
    nothing = np.zeros_like(V_LL)
    assert dc_voltages(MACHINE, OMEGA, nothing, bridge_table())[0] == pytest.approx(
        np.sqrt(2.0) * V_LL
    )
    assert back_emfs(MACHINE, OMEGA, V_DC, nothing)[0] == pytest.approx(V_DC / np.sqrt(2.0))
    assert np.all(dc_voltages(MACHINE, OMEGA, nothing + 1e4, bridge_table())[0] < 1e-6 * V_LL)


def test_a_bridge_without_a_drop_carries_a_current_into_no_voltage() -> None:
    """The back-EMF is then what the short circuit takes, from standstill on."""
    v_ll, i_s = back_emfs(MACHINE._replace(v_diode=0.0), np.zeros(2), np.zeros(2), np.full(2, 5.0))
    assert v_ll == pytest.approx(math.sqrt(3.0) * MACHINE.r_s * i_s, rel=1e-3)
