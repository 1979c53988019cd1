"""The twin: independent of the rig, in balance, lawful in all that is injected, and followed by
the rig.
"""

import math
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rigs import LOADS as NOMINAL
from rigs import assert_followed, own_model
from run_history import History, stator_heat, temperatures, twin_by_run

from winchcascade import read_run
from winchcascade.blind.cases import DealtCase, draw, write_campaign
from winchcascade.blind.crane_motion import line_motion
from winchcascade.blind.drive import FINE, LEDGER, weakened
from winchcascade.blind.injected import INJECTED, OUTSIDERS, PHYSICS, Hidden, draw_hidden
from winchcascade.blind.twin import Solved, Twin, gas_pressure, solve_twin
from winchcascade.blind.twin_log import noiseless, stamps_of
from winchcascade.blind.twin_numbers import LOADS, SENSORS, Numbers
from winchcascade.rig.effects.catalogue import EFFECTS, OF_THE_RIG
from winchcascade.rig.parts import with_part
from winchcascade.rig.simulate import simulate

BY_FAMILY = {"heating", "load_proportional_loss", "gas_loss"}
"""Effects that campaigns of their own inject, as they need an order of the runs or have a
look-alike by physics.
"""

LOG = "r18ohm"
ORDER = tuple(LOADS)
SHUFFLED = ("r9ohm", "r27ohm", "r45ohm", "r18ohm", "r4p5ohm", "open_circuit", "r36ohm")

STRANGERS = ("rig", "reduction", "diagnosis", "tables", "report", "batch")

CODE = """
import sys
from winchcascade.blind.cases import DealtCase
from winchcascade.blind.trial import answer_of, deal, diagnose
answer_of(DealtCase(1, 1))
print(" ".join(sys.modules))
"""


def twin_with(hidden: Hidden | None = None, numbers: Numbers = Numbers()) -> Twin:  # noqa: B008
    return Twin(numbers, dict(LOADS), dict.fromkeys(SENSORS, 1.0), hidden or Hidden())


@cache
def motion() -> tuple[np.ndarray, np.ndarray]:
    """The first payout and haul-in of a log."""
    x, v = line_motion(LOG, np.random.default_rng(5))
    return x[: x.size * 2 // 5], v[: x.size * 2 // 5]


@cache
def solved(**physics: float) -> Solved:
    return solve_twin(twin_with(Hidden(physics=physics)), LOG, *motion(), 0.0)


def plateau(found: Solved, channel: str) -> float:
    """Mean of a channel while the line is fast."""
    speed = motion()[1][1:]
    return float(np.mean(found.channels[channel][speed > 0.9 * np.max(speed)]))


def haul_in(found: Solved, channel: str) -> float:
    return float(np.mean(found.channels[channel][motion()[1][1:] < -0.5]))


def test_the_twin_imports_nothing_of_the_rig_it_is_an_answer_to() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    rooms = {name.split(".")[1] for name in done.stdout.split() if name.startswith("winchcascade.")}
    assert "blind" in rooms
    assert not rooms & set(STRANGERS)


def test_every_effect_of_the_catalogue_may_be_hidden_and_reports_what_a_diagnosis_reports() -> None:
    assert set(INJECTED) == set(OF_THE_RIG) - BY_FAMILY
    for name, part in INJECTED.items():
        assert EFFECTS[name].stage == part.stage
        assert part.parameter == EFFECTS[name].parameter
    assert not set(OUTSIDERS) & set(EFFECTS)


# ----------------------------------------------------------------------------------------- energy
BALANCED, PULSED = 1e-4, 2e-3
"""Share of the energy by which the ledger may deviate; with a dead diode the DC link is charged
in larger pulses.
"""


def in_balance(energy: dict[str, float], share: float) -> bool:
    lost = sum(energy[name] for name in LEDGER[1:])
    return lost == pytest.approx(energy["shaft"], rel=share) and min(energy.values()) >= 0.0


@pytest.mark.parametrize("log", ["open_circuit", "r18ohm", "r4p5ohm"])
def test_the_energy_of_the_drive_is_lost_delivered_or_stored(log: str) -> None:
    x, v = line_motion(log, np.random.default_rng(5))
    assert in_balance(solve_twin(twin_with(), log, x, v, 0.0).energy, BALANCED)


@pytest.mark.parametrize("name", PHYSICS)
def test_the_energy_is_in_balance_with_further_physics_which_is_absent_at_size_zero(
    name: str,
) -> None:
    assert in_balance(solved(**{name: round(PHYSICS[name][1], 2)}).energy, PULSED)
    if name != "dead_diode":  # its number is that of a phase
        for channel, value in solved(**{name: 0.0}).channels.items():
            assert np.array_equal(value, solved().channels[channel])


HALVED = 5e-4
"""Half the step changes no channel by more than this share of its largest value."""


@pytest.mark.slow
@pytest.mark.parametrize("log", ["open_circuit", "r4p5ohm"])
def test_half_the_step_of_the_twin_changes_nothing(log: str) -> None:
    x, v = line_motion(log, np.random.default_rng(6))
    coarse, fine = (
        solve_twin(twin_with(), log, x, v, 0.0, fine=n).channels for n in (FINE, 2 * FINE)
    )
    for name in ("torque", "vdc", "idc", "force"):
        assert np.max(np.abs(coarse[name] - fine[name])) < HALVED * np.max(np.abs(fine[name])), name


# ------------------------------------------------------------------------------------------- laws
def test_a_gas_that_keeps_its_heat_is_adiabatic_and_one_that_gives_it_away_isothermal() -> None:
    volume = np.linspace(4e-3, 3e-3, 2000)
    pressed = volume[0] / volume[-1]
    assert gas_pressure(volume, 2e6, 1.3, 1e9)[-1] == pytest.approx(2e6 * pressed**1.3, rel=1e-6)
    assert gas_pressure(volume, 2e6, 1.3, 1e-6)[-1] == pytest.approx(2e6 * pressed, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_a_rolloff_leaves_at_10_a_what_its_answer_says_and_never_grows(seed: int) -> None:
    hidden = draw_hidden({"ke_rolloff": 1.0}, None, np.random.default_rng(seed))
    law = [hidden.laws[name] for name in ("law", "knee", "width", "power")]
    assert weakened(10.0, *law) == pytest.approx(
        hidden.reported()["ke_rolloff"]["k_e_ratio_at_10_a"]
    )
    left = [weakened(i, *law) for i in np.linspace(0.0, 25.0, 60)]
    assert left[0] == 1.0
    assert all(a >= b for a, b in pairwise(left))


def test_a_stated_value_is_injected_as_it_is_reported() -> None:
    stated = {"ke_rolloff": 0.9, "gas_polytropic": 1.2, "line_drag": 0.4}
    found = draw_hidden(
        dict.fromkeys(stated, 1.0), None, np.random.default_rng(1), stated
    ).reported()
    assert {name: next(iter(row.values())) for name, row in found.items()} == pytest.approx(stated)


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


def test_resistances_of_diodes_and_of_a_cable_act_where_they_are() -> None:
    warm = solve_twin(
        twin_with(numbers=Numbers()._replace(r_s=Numbers().r_s + 0.1)), LOG, *motion(), 0.0
    )
    assert np.allclose(
        solved(diode_slope=0.1).channels["vdc"], warm.channels["vdc"], rtol=1e-9, atol=1e-9
    )
    found = solved(cable=0.4)
    assert plateau(found, "vdc") < 0.99 * plateau(solved(), "vdc")
    assert np.allclose(found.channels["vdc"], LOADS[LOG] * found.channels["idc"])


def test_an_overrunning_clutch_brakes_the_rotor_and_reads_its_drag_in_haul_in() -> None:
    found = solved(overrunning_drag=4.0)
    assert haul_in(found, "torque") == pytest.approx(-4.0, rel=1e-3)
    assert plateau(found, "torque") == pytest.approx(plateau(solved(), "torque"), rel=1e-6)
    dragging = Hidden(physics={"overrunning_drag": 4.0})
    free, braked = (
        solve_twin(twin_with(hidden), "open_circuit", *motion(), 0.0).channels
        for hidden in (None, dragging)
    )
    coasting = (free["torque"] == 0.0) & (free["omega"] > 20.0)
    assert np.mean(braked["omega"][coasting]) < 0.95 * np.mean(free["omega"][coasting])


VISIBLE = 1.5
"""Times its sensor's noise that a channel must change somewhere by an effect at two fifths of
its strength or an outsider.
"""


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)], ids=["some", "all"])
def test_each_effect_and_each_outsider_shows_in_some_channel(every: int) -> None:
    def readings(hidden: Hidden) -> dict[str, np.ndarray]:
        twin = twin_with(hidden)
        found = solve_twin(twin, LOG, *motion(), 0.0)
        read = noiseless(twin, found, stamps_of(found))
        return {name: value / SENSORS[name].noise for name, value in read.items()}

    plain = readings(Hidden())
    cases = [draw_hidden({name: 0.4}, None, np.random.default_rng(9)) for name in INJECTED]
    cases += [
        draw_hidden({}, name, np.random.default_rng(9))
        for name in OUTSIDERS
        if name != "elastic_encoder"
    ]
    for hidden in cases[::every]:
        changed = readings(hidden)
        assert max(np.max(np.abs(changed[name] - plain[name])) for name in SENSORS) > VISIBLE, (
            hidden
        )


# ------------------------------------------------------------------------------------- run by run
@pytest.mark.parametrize("heat", ["constant", "load"])
@pytest.mark.parametrize("order", [ORDER, SHUFFLED])
def test_the_hottest_run_has_the_stated_changes_and_the_first_is_cold_at_its_start(
    heat: str, order: tuple[str, ...]
) -> None:
    history = History(heat, 2.0, 0.0, k_e_fall=0.03, r_s_rise=0.2)  # type: ignore[arg-type]
    changes = [
        twin.numbers.k_e / Numbers().k_e - 1.0 for twin in twin_by_run(twin_with(), history, order)
    ]
    warmed = [
        twin.numbers.r_s / Numbers().r_s - 1.0 for twin in twin_by_run(twin_with(), history, order)
    ]
    assert changes[0] == warmed[0] == 0.0
    assert [min(changes), max(warmed)] == pytest.approx([-0.03, 0.2])
    assert np.allclose(warmed, -np.array(changes) * 0.2 / 0.03)


def test_constant_heat_follows_the_order_of_the_runs_and_that_of_the_load_the_current() -> None:
    constant, loaded = (
        temperatures(History(heat, 3.0, 0.5), SHUFFLED) for heat in ("constant", "load")
    )
    assert constant == sorted(constant)
    assert loaded != sorted(loaded)
    assert [stator_heat(log) for log in ORDER] == sorted(stator_heat(log) for log in ORDER)


def test_a_machine_in_a_run_differs_in_what_its_history_states_and_keeps_the_rest() -> None:
    history = History("constant", 1.0, 0.0, 0.02, 0.1, 0.01, {"vdc": 0.02}, {"torque": 3.0})
    last = twin_by_run(twin_with(), history, ORDER)[-1]
    n = Numbers()
    assert last.numbers == pytest.approx(
        n._replace(k_e=0.98 * n.k_e, r_s=1.1 * n.r_s, p_gas=0.99 * n.p_gas)
    )
    plain, drifted = (
        noiseless(twin, solved(), stamps_of(solved())) for twin in (twin_with(), last)
    )
    assert np.allclose(drifted["torque"] - plain["torque"], 3.0)
    assert np.allclose(drifted["vdc"], 1.02 * plain["vdc"])
    assert np.array_equal(drifted["pressure"], plain["pressure"])
    assert all(twin == twin_with() for twin in twin_by_run(twin_with(), History(), ORDER))


@pytest.mark.slow
def test_a_campaign_of_the_twin_is_followed_by_the_rig(tmp_path: Path) -> None:
    case = DealtCase(4, 1)
    write_campaign(case, tmp_path)
    _, twin, _ = draw(case)
    keys = {
        "mu": "mu_screw",
        "p_gas": "p0",
        "eta_mesh": "eta_gear",
        "b_rotor": "b_visc",
        "k_e": "ke_ll",
        "r_s": "rs",
    }
    keys |= {"l_s": "ls"}
    model = own_model(
        {"rig": {keys.get(name, name): value for name, value in twin.numbers._asdict().items()}}
    )
    for log, load in NOMINAL.items():
        run = read_run(tmp_path / f"{log}.csv", load=load)
        assert {finding.kind for finding in run.findings} <= {
            "out_of_range"
        }  # 4.5 ohm passes the range of Table 1
        change = 0.0 if math.isinf(load) else twin.loads[log] / load - 1.0
        here = with_part(model, "dc_link", load_change=change)
        assert_followed(run, simulate(run, here).run, twin.gains)
