"""The switched circuit against closed forms, and the table that ships against the circuit."""

import math

import numpy as np
import pytest
from switched_bridge import steady_state

from winchcascade.rig.bridge import PHI_HIGH, PHI_LOW, S_POINTS, TABLE, bridge_state, bridge_table


def test_a_short_circuit_carries_the_sinusoid_of_the_phase_impedance() -> None:
    for rho in (0.1, 1.0, 10.0):
        expected = 3.0 * math.sqrt(2.0) / math.pi / math.sqrt(3.0), 1.0 / math.sqrt(3.0)
        assert steady_state(1e-9, rho) == pytest.approx(expected, rel=1e-6)
    assert steady_state(1.0, 0.5) == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("u", [0.87, 0.9, 0.95, 0.99, 0.999])
def test_a_bridge_without_inductance_conducts_while_the_line_voltage_exceeds_the_dc_side(
    u: float,
) -> None:
    angle = math.acos(u)
    mean = 3.0 / math.pi * math.sqrt(2.0) / 2.0 * (2.0 * math.sin(angle) - 2.0 * angle * u)
    assert steady_state(u, 1e5)[0] == pytest.approx(mean, rel=1e-4)  # as rho is not infinite


def test_the_table_that_ships_is_that_of_the_circuit_at_its_points_and_between() -> None:
    table = np.load(TABLE)
    for i, j in ((40, 10), (128, 32), (200, 60)):
        s, phi = i / (S_POINTS - 1), np.linspace(PHI_LOW, PHI_HIGH, table.shape[1])[j]
        assert table[i, j] == pytest.approx(
            steady_state(1.0 - s * s, math.tan(phi)), rel=1e-6
        )  # single precision
    rng = np.random.default_rng(1)
    for u, phi in zip(
        1.0 - rng.uniform(0.02, 0.95, 300) ** 2, rng.uniform(0.05, 1.5, 300), strict=True
    ):
        found = bridge_state(u * math.sqrt(2.0), 1.0, math.sin(phi), math.cos(phi), bridge_table())[
            :2
        ]
        assert found == pytest.approx(steady_state(u, math.tan(phi)), rel=2e-4, abs=2e-4)
