"""Physics of the twin that its trials add: absent by default, and lawful where it is injected."""

from functools import cache

import numpy as np
import pytest

from winchcascade.blind.drive import LEDGER
from winchcascade.blind.history import History, in_run, run_changes, stator_heat, temperatures
from winchcascade.blind.injected import PHYSICS, Hidden
from winchcascade.blind.twin import Solved, Twin, line_motion, noiseless, solve_twin, stamps_of
from winchcascade.blind.twin_numbers import LOADS, SENSORS, Numbers

LOG = "r18ohm"
ORDER = tuple(LOADS)
SHUFFLED = ("r9ohm", "r27ohm", "r45ohm", "r18ohm", "r4p5ohm", "open_circuit", "r36ohm")


def twin_with(physics: dict[str, float] | None = None) -> Twin:
    return Twin(Numbers(), dict(LOADS), dict.fromkeys(SENSORS, 1.0), Hidden(physics=physics or {}))


@cache
def motion() -> tuple[np.ndarray, np.ndarray]:
    """The first payout and haul-in of a log."""
    x, v = line_motion(LOG, np.random.default_rng(5))
    keep = x.size * 2 // 5
    return x[:keep], v[:keep]


@cache
def solved(**physics: float) -> Solved:
    return solve_twin(twin_with(physics), LOG, *motion(), 0.0)


def plateau(found: Solved, channel: str) -> float:
    """Mean of a channel while the line is fast."""
    speed = motion()[1][1:]
    return float(np.mean(found.channels[channel][speed > 0.9 * np.max(speed)]))


def haul_in(found: Solved, channel: str) -> float:
    speed = motion()[1][1:]
    return float(np.mean(found.channels[channel][speed < -0.5]))


PULSED = 2e-3
"""Share of the energy by which the ledger may deviate: with a dead diode the DC link is charged in larger pulses."""


@pytest.mark.parametrize("name", PHYSICS)
def test_the_energy_of_the_drive_is_lost_delivered_or_stored(name: str) -> None:
    energy = solved(**{name: round(PHYSICS[name][1], 2)}).energy
    assert sum(energy[entry] for entry in LEDGER[1:]) == pytest.approx(energy["shaft"], rel=PULSED)
    assert all(joule >= 0.0 for joule in energy.values())


@pytest.mark.parametrize("name", PHYSICS)
def test_physics_of_no_size_changes_no_channel(name: str) -> None:
    if name != "dead_diode":  # its number is that of a phase
        for channel, value in solved(**{name: 0.0}).channels.items():
            assert np.array_equal(value, solved().channels[channel])


def test_the_rope_loses_a_share_of_the_tension_in_both_directions() -> None:
    found = solved(rope_loss=0.05)
    assert plateau(found, "force") == pytest.approx(plateau(solved(), "force") / 0.95, rel=1e-4)
    assert haul_in(found, "force") == pytest.approx(haul_in(solved(), "force") * 0.95, rel=1e-4)
    assert np.array_equal(found.channels["torque"], solved().channels["torque"])


@pytest.mark.parametrize("name", ["gear_slope", "gear_curve"])
def test_a_gear_under_load_needs_more_torque_at_the_same_power_of_the_generator(name: str) -> None:
    found = solved(**{name: 0.05})
    assert plateau(found, "torque") > 1.02 * plateau(solved(), "torque")
    assert plateau(found, "vdc") == pytest.approx(plateau(solved(), "vdc"), rel=1e-3)


@pytest.mark.parametrize("phase", [1.0, 2.0, 3.0])
def test_a_dead_diode_lowers_the_voltage_whichever_phase_it_is_in(phase: float) -> None:
    found = plateau(solved(dead_diode=phase), "vdc")
    assert found < 0.97 * plateau(solved(), "vdc")
    assert found == pytest.approx(plateau(solved(dead_diode=1.0), "vdc"), rel=0.01)


def test_the_slope_of_a_diode_acts_as_a_resistance_of_the_phase() -> None:
    numbers = Numbers()._replace(r_s=Numbers().r_s + 0.1)
    warm = solve_twin(Twin(numbers, dict(LOADS), dict.fromkeys(SENSORS, 1.0), Hidden()), LOG, *motion(), 0.0)
    assert np.allclose(solved(diode_slope=0.1).channels["vdc"], warm.channels["vdc"], rtol=1e-9, atol=1e-9)


def test_a_cable_lowers_the_reading_of_the_voltage_and_keeps_its_ratio_to_the_current() -> None:
    found = solved(cable=0.4)
    assert plateau(found, "vdc") < 0.99 * plateau(solved(), "vdc")
    assert np.allclose(found.channels["vdc"], LOADS[LOG] * found.channels["idc"])
    assert found.energy["cable"] == pytest.approx(found.energy["load"] * 0.4 / LOADS[LOG])


def test_an_overrunning_clutch_brakes_the_rotor_and_reads_its_drag_in_haul_in() -> None:
    found = solved(overrunning_drag=4.0)
    assert haul_in(found, "torque") == pytest.approx(-4.0, rel=1e-3)
    assert plateau(found, "torque") == pytest.approx(plateau(solved(), "torque"), rel=1e-6)
    free, braked = (
        solve_twin(twin_with(physics), "open_circuit", *motion(), 0.0).channels
        for physics in ({}, {"overrunning_drag": 4.0})
    )
    coasting = (free["torque"] == 0.0) & (free["omega"] > 20.0)
    assert np.mean(braked["omega"][coasting]) < 0.95 * np.mean(free["omega"][coasting])
    assert np.mean(braked["torque"][coasting & (braked["omega"] > 20.0)]) < -2.0


@pytest.mark.parametrize("heat", ["constant", "load"])
@pytest.mark.parametrize("order", [ORDER, SHUFFLED])
def test_the_hottest_run_has_the_stated_changes_and_the_first_is_cold_at_its_start(
    heat: str, order: tuple[str, ...]
) -> None:
    history = History(heat, 2.0, 0.0, k_e_fall=0.03, r_s_rise=0.2)  # type: ignore[arg-type]
    changes = run_changes(history, order)
    assert changes[0].k_e == changes[0].r_s == 0.0
    assert min(change.k_e for change in changes) == pytest.approx(-0.03)
    assert max(change.r_s for change in changes) == pytest.approx(0.2)
    assert all(change.r_s == pytest.approx(-change.k_e * 0.2 / 0.03) for change in changes)


def test_constant_heat_follows_the_order_of_the_runs_and_that_of_the_load_the_current() -> None:
    constant, loaded = (temperatures(History(heat, 3.0, 0.5), SHUFFLED) for heat in ("constant", "load"))
    assert constant == sorted(constant)
    assert loaded != sorted(loaded)
    assert [stator_heat(log) for log in ORDER] == sorted(stator_heat(log) for log in ORDER)


def test_a_machine_in_a_run_differs_in_what_its_history_states_and_keeps_the_rest() -> None:
    history = History("constant", 1.0, 0.0, 0.02, 0.1, 0.01, {"vdc": 0.02}, {"torque": 3.0})
    last = in_run(twin_with(), run_changes(history, ORDER)[-1])
    assert last.numbers.k_e == pytest.approx(0.98 * Numbers().k_e)
    assert last.numbers.r_s == pytest.approx(1.1 * Numbers().r_s)
    assert last.numbers.p_gas == pytest.approx(0.99 * Numbers().p_gas)
    assert last.gains["vdc"] == pytest.approx(1.02)
    assert last.numbers._replace(k_e=0.0, r_s=0.0, p_gas=0.0) == Numbers()._replace(k_e=0.0, r_s=0.0, p_gas=0.0)
    found = solved()
    plain, drifted = (noiseless(twin, found, stamps_of(found)) for twin in (twin_with(), last))
    assert np.allclose(drifted["torque"] - plain["torque"], 3.0)
    assert np.allclose(drifted["vdc"], 1.02 * plain["vdc"])
    assert np.array_equal(drifted["pressure"], plain["pressure"])


def test_a_campaign_without_a_history_has_the_same_rig_in_every_run() -> None:
    twin = twin_with()
    assert all(in_run(twin, change) == twin for change in run_changes(History(), ORDER))
