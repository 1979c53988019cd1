"""Waves, floats and rigs in them beside what a closed form gives."""

import math

import msgspec
import numpy as np
import pytest

from winchcascade.blind.drive import GRID, run_drive
from winchcascade.blind.injected import Hidden
from winchcascade.blind.twin import draw_twin, drive_of
from winchcascade.core.rig_toml import built_in
from winchcascade.design import operating
from winchcascade.rig.baseline import baseline
from winchcascade.rig.bridge import bridge_state, bridge_table
from winchcascade.rig.kernel import COLUMNS
from winchcascade.rig.parts import Model, RestoringModel, with_part
from winchcascade.rig.physics import RPM
from winchcascade.rig.simulate import solve
from winchcascade.rig.state import constants
from winchcascade.sea.coupled import POWERS, float_in_waves
from winchcascade.sea.hydrodynamics import Hydrodynamics
from winchcascade.sea.in_sea import PLACE, fixed, losses, ripple_of, run, scheduled
from winchcascade.sea.line_motion import FOLLOWER, FloatResponse, SeaPath, path_in_waves
from winchcascade.sea.wave_spectra import (
    PIERSON_MOSKOWITZ,
    ComplexSignal,
    SeaState,
    Waves,
    realised,
)

SEA, MINUTES_2 = SeaState(0.8, 4.0), 120.0
SIZES = {"paper": 1.0, "small": 0.1, "large": 6.0}


def sized(length: float) -> tuple[Model, SeaState, float]:
    """The rig of the paper, a sea and a duration, all larger by Froude's law; pressures do not
    follow it.
    """
    model, time, torque = baseline(built_in()).physics, math.sqrt(length), length**4
    model = with_part(model, "winch", r_drum=0.13 * length, inertia=0.3 * torque * time**2)
    model = with_part(
        model,
        "restoring",
        lead=model.restoring.lead * length,
        area=model.restoring.area * length**3,
    )
    model = with_part(model, "restoring", volume=model.restoring.volume * torque)
    shaft, machine = model.drivetrain, model.generator
    model = with_part(
        model, "drivetrain", b_rotor=shaft.b_rotor * torque * time, k_shaft=shaft.k_shaft * torque,
        c_shaft=shaft.c_shaft * torque * time, inertia_rotor=shaft.inertia_rotor * torque * time**2,
    )  # fmt: skip
    power = torque / time
    ohm, k_e = 1.0 / power, machine.k_e * time
    model = with_part(
        model,
        "generator",
        k_e=k_e,
        r_s=machine.r_s * ohm,
        l_s=machine.l_s * ohm * time,
        i_rated=machine.i_rated * power,
    )
    link = model.dc_link
    model = with_part(model, "dc_link", c_dc=link.c_dc * time / ohm, r_bleed=link.r_bleed * ohm)
    return model, SeaState(0.8 * length, 4.0 * time), MINUTES_2 * time


def damper(torque_per_speed: float) -> Model:
    """A drum with a viscous brake, and a machine and a shaft that take next to nothing."""
    model = baseline(built_in()).physics
    model = with_part(model, "winch", inertia=0.0, drag=torque_per_speed)
    model = with_part(model, "drivetrain", b_rotor=0.0, inertia_rotor=1e-6)
    model = with_part(model, "generator", k_e=1e-6)
    return Model(model.winch, RestoringModel(), model.drivetrain, model.generator, model.dc_link)


def cylinder() -> Hydrodynamics:
    """A float of smooth coefficients that nearly obey the relations of Kramers and Kronig, with
    a natural period of 3 s.
    """
    omega = np.linspace(0.05, 12.0, 240)
    decay, size = 1.2, 400.0
    damping = 2.0 * size * decay * omega**2 / ((decay**2 + omega**2) ** 2) * decay
    t = np.arange(0.0, 25.0, 0.01)
    kernel = np.array(
        [2.0 / np.pi * np.trapezoid(damping * np.cos(omega * now), omega) for now in t]
    )
    added = 300.0 - np.array([np.trapezoid(kernel * np.sin(w * t), t) / w for w in omega])
    excitation = 6000.0 * np.exp(-((omega / 3.0) ** 2)) * np.exp(-0.1j * omega)
    return Hydrodynamics(omega, added, damping, excitation, 1200.0, 6600.0)


def own_response(body: Hydrodynamics, waves: Waves, brake: float) -> ComplexSignal:
    """Complex heave of a float with a linear brake, in the frequency domain. [m]"""
    omega = 2.0 * math.pi * waves.frequency
    added, damping = (np.interp(omega, body.omega, x) for x in (body.added, body.damping))
    stiff = body.stiffness - omega**2 * (body.mass + added) + 1j * omega * (damping + brake)
    return np.asarray(body.response.at(waves) / stiff)


@pytest.mark.parametrize("gamma", [PIERSON_MOSKOWITZ, 3.3])
def test_a_realisation_has_the_variance_of_its_sea_and_depends_on_its_seed_alone(
    gamma: float,
) -> None:
    sea = SeaState(1.5, 6.0, gamma)
    first, again, other = (realised(sea, 600.0, seed) for seed in (1, 1, 2))
    surface = first.sampled(first.amplitude, 6000)
    assert 4.0 * float(np.std(surface)) == pytest.approx(1.5, rel=1e-12)
    assert np.array_equal(first.amplitude, again.amplitude)
    assert not np.array_equal(first.amplitude, other.amplitude)
    peak = first.frequency[int(np.argmax(np.abs(first.amplitude)))]
    assert peak == pytest.approx(1.0 / 6.0, rel=0.02)


def test_a_linear_damper_takes_the_power_of_the_spectrum() -> None:
    brake, waves = 20.0, realised(SEA, MINUTES_2, 3)
    model = damper(brake)
    path = path_in_waves(model, waves, FOLLOWER, SEA.tp, 0.0)
    speed = 2.0 * math.pi * waves.frequency * np.abs(waves.amplitude)
    expected = brake / model.winch.r_drum**2 * 0.5 * float(speed @ speed)
    assert run(model, path, fixed(1e6))[PLACE["p_line_w"]] == pytest.approx(expected, rel=0.01)


def test_a_float_of_known_response_moves_the_line_by_it() -> None:
    waves, model = realised(SEA, MINUTES_2, 4), baseline(built_in()).physics
    half = FloatResponse(np.array([1e-3, 10.0]), np.array([0.5j, 0.5j]))
    surface, moved = (
        path_in_waves(model, waves, body, SEA.tp, 2.0).motion for body in (FOLLOWER, half)
    )
    assert float(np.std(moved.x)) == pytest.approx(0.5 * float(np.std(surface.x)), rel=0.01)


@pytest.mark.parametrize("size", SIZES)
def test_the_energy_of_the_line_is_delivered_or_lost_and_half_the_step_changes_nothing(
    size: str,
) -> None:
    model, sea, duration = sized(SIZES[size])
    waves, loads = realised(sea, duration, 5), 20.0 * model.dc_link.r_bleed / 4500.0
    payout = 3.0 * SIZES[size]
    path = path_in_waves(model, waves, FOLLOWER, sea.tp, payout)
    out = np.empty((path.motion.v.size, len(COLUMNS)))
    found = run(model, path, fixed(loads), out)
    lost = sum(losses(model, path, out).values())
    assert found[PLACE["p_gen_w"]] + lost == pytest.approx(found[PLACE["p_line_w"]], rel=5e-3)
    whole = solve(model, path.motion, loads)
    assert np.max(np.abs(out - whole) / np.max(np.abs(whole), axis=0)) < 1e-9
    count = 2 * (path.motion.v.size - path.first)
    fine = run(model, path_in_waves(model, waves, FOLLOWER, sea.tp, payout, count), fixed(loads))
    assert found[: PLACE["eta_net"]] == pytest.approx(fine[: PLACE["eta_net"]], rel=1e-3)


def test_a_schedule_of_one_load_is_that_load() -> None:
    model = baseline(built_in()).physics
    path = path_in_waves(model, realised(SEA, 30.0, 6), FOLLOWER, SEA.tp, 2.0)
    flat = scheduled([(100.0, 500.0, 20.0), (500.0, 900.0, 20.0)], "test")
    assert run(model, path, flat) == pytest.approx(run(model, path, fixed(20.0)), rel=1e-9)


def test_a_float_without_its_rig_has_its_own_response() -> None:
    body, waves = cylinder(), realised(SeaState(0.5, 4.0), 200.0, 7)
    path, _ = float_in_waves(
        baseline(built_in()).physics, waves, body, 4.0, 2.0, fixed(20.0), acts=False
    )
    moved = path.motion.x[path.first :] - 2.0
    expected = waves.sampled(own_response(body, waves, 0.0), moved.size)
    late = slice(moved.size // 2, None)  # what is left of the start has faded
    assert float(np.std((moved - expected)[late])) < 0.01 * float(np.std(expected))


def test_a_float_with_a_linear_damper_has_the_power_of_the_frequency_domain() -> None:
    body, waves, brake = cylinder(), realised(SeaState(0.5, 4.0), 200.0, 8), 20.0
    model = damper(brake)
    per_speed = brake / model.winch.r_drum**2
    path, _ = float_in_waves(model, waves, body, 4.0, 2.0, fixed(1e6))
    speed = 2.0 * math.pi * waves.frequency * np.abs(own_response(body, waves, per_speed))
    assert run(model, path, fixed(1e6))[PLACE["p_line_w"]] == pytest.approx(
        0.5 * per_speed * float(speed @ speed), rel=0.01
    )


def test_waves_float_and_rig_balance() -> None:
    body, waves, model = (
        cylinder(),
        realised(SeaState(0.5, 4.0), 100.0, 9),
        baseline(built_in()).physics,
    )
    model = with_part(model, "winch", inertia=0.1)
    path, powers = float_in_waves(model, waves, body, 4.0, 2.0, fixed(20.0))
    mean = dict(zip(POWERS, powers[path.first :].mean(axis=0), strict=True))
    assert mean["waves"] - mean["radiated"] - mean["rig"] - mean["stored"] == pytest.approx(
        0.0, abs=1e-6 * mean["waves"]
    )
    taken = run(model, path, fixed(20.0))[PLACE["p_line_w"]]
    assert taken == pytest.approx(mean["rig"], rel=5e-3)


def test_waves_as_a_motion_give_what_a_design_gives_along_it() -> None:
    """The energies of a whole motion, and its largest values, are those of `design --motion`."""
    model, waves = baseline(built_in()).physics, realised(SEA, 40.0, 10)
    surface = path_in_waves(model, waves, FOLLOWER, SEA.tp, 0.0).motion
    designed = operating.path_of(operating.Motion(surface.t - surface.t[0], surface.v, 0.5), model)
    expected = dict(zip(operating.QUANTITIES, operating.point(model, designed, 20.0), strict=True))
    found = run(model, SeaPath(designed.motion, designed.direction, 0), fixed(20.0))
    takes = designed.motion.step * designed.motion.t.size
    for power, energy in (("p_gen_w", "e_gen_j"), ("p_line_w", "e_line_j")):
        assert found[PLACE[power]] * takes == pytest.approx(expected[energy], rel=1e-9)
    for name in ("rpm", "i_s_a", "force_n", "torque_nm", "i_dc_rms_a"):
        assert found[PLACE[name]] == pytest.approx(expected[name], rel=1e-9)


def test_the_pulses_of_a_bridge_are_those_of_a_switched_circuit() -> None:
    """What they cost beside what rotor, link, phases and switched diodes lose beyond a bridge on
    a stiff link.
    """
    twin = draw_twin(Hidden({}), np.random.default_rng(0), scatter=0.0)
    model, n = baseline(built_in()).physics, twin.numbers
    model = with_part(model, "generator", k_e=n.k_e, r_s=n.r_s, l_s=n.l_s)
    model = with_part(model, "dc_link", c_dc=n.c_dc)
    turns = np.interp(np.arange(0.0, 3.0, GRID), [0.0, 1.0], [0.0, 1.0]) / twin.fixed.gear
    for omega, ohm in ((60.0, 9.0), (75.0, 9.0), (75.0, 14.0)):
        at_load = msgspec.structs.replace(twin, loads={"here": ohm})
        out, _ = run_drive(omega * turns, np.ones(turns.size - 1), drive_of(at_load, "here"), 20)
        _, vdc, idc, speed, copper = out[-1000:, [0, 1, 2, 3, 8]].T
        i_bridge, own = float(idc.mean()), float(speed.mean())
        reactance = n.l_s * twin.fixed.pole_pairs * own
        v_total = float(vdc.mean()) + 2.0 * twin.fixed.v_diode
        i_s = bridge_state(v_total, n.k_e * own * RPM, n.r_s, reactance, bridge_table())[1]
        costs = ripple_of(own, i_bridge, ohm, constants(model, ohm, 0.005).shaft)
        lost = float(copper.mean()) / GRID
        assert costs + 3.0 * n.r_s * i_s**2 == pytest.approx(lost, rel=6e-3), omega
