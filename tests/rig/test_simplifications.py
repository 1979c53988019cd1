"""Simplifications of other simulations: each is absent at a share of 0 and gives the simplified law at a share of 1."""

import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.bridge import blended_table, bridge_state, bridge_table
from winchcascade.rig.effects.effect import ActiveEffect
from winchcascade.rig.effects.simplifications import SIMPLIFICATIONS
from winchcascade.rig.simulate import Simulation, simulate

R_S, AVERAGE = 0.61, 3.0 * math.sqrt(2.0) / math.pi
TABULATED = 2e-3
"""The table is interpolated; the average has a kink where its current begins."""


FIXTURES = Path(__file__).parents[2] / "fixtures" / "campaign"


@cache
def first_cycle(load: float) -> Run:
    run = read_run(FIXTURES / ("open_circuit.csv" if math.isinf(load) else f"r{load:g}ohm.csv"), load=load)
    last = int(np.argmax(run.t > 40.0))
    channels = {name: x[:last] for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[:last], samples=last, channels=channels)


def simplified(load: float, **shares: float) -> Simulation:
    model = baseline(built_in())
    for name, share in shares.items():
        model = ActiveEffect(SIMPLIFICATIONS[name], (share,)).apply(model)
    return simulate(first_cycle(load), model)


@pytest.mark.parametrize("name", SIMPLIFICATIONS)
def test_a_share_of_zero_changes_nothing(name: str) -> None:
    given, absent = simplified(36.0), simplified(36.0, **{name: 0.0})
    for channel, x in given.run.channels.items():
        assert np.allclose(absent.run.channels[channel], x, rtol=1e-12)


def test_without_a_share_the_bridge_is_the_switched_circuit() -> None:
    assert blended_table(0.0, 0.0) is bridge_table()


@pytest.mark.parametrize("uncommutated", [0.0, 1.0])
def test_the_averaged_bridge_is_the_textbook_average(uncommutated: float) -> None:
    table = blended_table(1.0, uncommutated)
    for v_total in (40.0, 80.0, 120.0):
        for reactance in (0.3, 1.5, 3.0):
            i_dc, i_s, _, _ = bridge_state(v_total, 100.0, R_S, reactance, table)
            drop = 3.0 / math.pi * reactance * (1.0 - uncommutated) + 2.0 * R_S
            assert i_dc == pytest.approx((AVERAGE * 100.0 - v_total) / drop, rel=TABULATED)
            assert i_s == pytest.approx(math.sqrt(2.0 / 3.0) * i_dc, rel=TABULATED)


def test_a_quasi_static_dc_link_follows_the_speed_at_once() -> None:
    made = simplified(36.0, quasi_static=1.0, averaged_bridge=1.0)
    vdc, velocity = made.run.channels["vdc"], made.run.channels["velocity"]
    assert np.all(vdc[velocity < -0.2] == 0.0)
    rpm, i_dc = made.rpm_gen, made.run.channels["idc"]
    reactance = 2.0 * rpm * math.pi / 30.0 * 3.35e-3
    expected = AVERAGE * 0.062 * rpm - (3.0 / math.pi * reactance + 2.0 * R_S) * i_dc - 1.4
    assert np.allclose(vdc[velocity > 0.5], expected[velocity > 0.5], rtol=TABULATED)


def test_a_rotor_without_inertia_takes_less_torque_while_the_line_speeds_up() -> None:
    with_inertia, without = (simplified(36.0, **{name: 1.0}) for name in ("quasi_static", "no_rotor_inertia"))
    v, t = with_inertia.run.channels["velocity"], with_inertia.run.t
    speeds_up = (np.gradient(v, t) > 0.1) & (v > 0.2)
    assert np.all(without.run.channels["torque"][speeds_up] < with_inertia.run.channels["torque"][speeds_up])
    assert np.allclose(without.run.channels["vdc"], with_inertia.run.channels["vdc"])


def test_an_open_circuit_without_bleed_keeps_its_voltage() -> None:
    with_bleed, without = (simplified(math.inf, no_bleed=share).run.channels["vdc"] for share in (0.0, 1.0))
    assert with_bleed[-1] < 0.5 * with_bleed.max()
    assert without[-1] > 0.95 * without.max()


def test_a_drum_without_inertia_changes_the_force_alone() -> None:
    given, without = simplified(36.0).run.channels, simplified(36.0, no_drum_inertia=1.0).run.channels
    assert np.max(np.abs(given["force"] - without["force"])) > 1.0
    assert np.allclose(given["torque"], without["torque"])


def test_a_gas_that_heats_becomes_isothermal() -> None:
    model = baseline(built_in())
    hot = msgspec.structs.replace(model, restoring=msgspec.structs.replace(model.restoring, exponent=1.3))
    cold = ActiveEffect(SIMPLIFICATIONS["isothermal_gas"], (1.0,)).apply(hot)
    assert cold.restoring.exponent == pytest.approx(1.0)
