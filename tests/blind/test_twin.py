"""The twin: independent of the rig, in balance, and like the labelled campaigns."""

import math
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from likeness import likeness
from rigs import LOADS as NOMINAL
from rigs import assert_followed, own_model

from winchcascade import read_run
from winchcascade.blind.cases import ORIGIN, Case, answer_of, make_campaign
from winchcascade.blind.drive import FINE, LEDGER, weakened
from winchcascade.blind.injected import INJECTED, OUTSIDERS, Hidden, draw_hidden
from winchcascade.blind.twin import Twin, gas_pressure, line_motion, make_log, noiseless, solve_twin, stamps_of
from winchcascade.blind.twin_numbers import LOADS, SENSORS, Numbers
from winchcascade.rig.effects.catalogue import EFFECTS, OF_THE_RIG
from winchcascade.rig.simulate import simulate

BY_FAMILY = {"heating", "load_proportional_loss", "gas_loss"}
"""Effects that campaigns of their own inject, as they need an order of the runs or have a look-alike by physics."""

STRANGERS = ("rig", "reduction", "diagnosis", "tables", "report", "batch")

CODE = """
import sys
import numpy as np
from winchcascade.blind.cases import Case, answer_of
from winchcascade.blind.trial import deal, diagnose
from winchcascade.blind.twin import draw_twin, make_log
from winchcascade.blind.injected import Hidden
answer_of(Case(1, 1, "none", {}))
print(" ".join(sys.modules))
"""


def plain_twin(hidden: Hidden | None = None) -> Twin:
    return Twin(Numbers(), dict(LOADS), dict.fromkeys(SENSORS, 1.0), hidden or Hidden())


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


BALANCED = 1e-4


@pytest.mark.parametrize("log", ["open_circuit", "r18ohm", "r4p5ohm"])
def test_the_drives_energy_is_lost_delivered_or_stored(log: str) -> None:
    x, v = line_motion(log, np.random.default_rng(5))
    energy = solve_twin(plain_twin(), log, x, v, 0.0).energy
    assert tuple(energy) == LEDGER
    assert sum(energy[name] for name in LEDGER[1:]) == pytest.approx(energy["shaft"], rel=BALANCED)
    assert all(energy[name] >= 0.0 for name in LEDGER)


HALVED = 5e-4
"""Half the step changes no channel by more than this share of its largest value."""


@pytest.mark.slow
@pytest.mark.parametrize("log", ["open_circuit", "r4p5ohm"])
def test_half_the_twins_step_changes_nothing(log: str) -> None:
    x, v = line_motion(log, np.random.default_rng(6))
    coarse, fine = (solve_twin(plain_twin(), log, x, v, 0.0, fine=n).channels for n in (FINE, 2 * FINE))
    for name in ("torque", "vdc", "idc", "force"):
        assert np.max(np.abs(coarse[name] - fine[name])) < HALVED * np.max(np.abs(fine[name])), name


def test_a_gas_that_keeps_its_heat_is_adiabatic_and_one_that_gives_it_away_isothermal() -> None:
    volume = np.linspace(4e-3, 3e-3, 2000)
    pressed = volume[0] / volume[-1]
    assert gas_pressure(volume, 2e6, 1.3, 1e9)[-1] == pytest.approx(2e6 * pressed**1.3, rel=1e-6)
    assert gas_pressure(volume, 2e6, 1.3, 1e-6)[-1] == pytest.approx(2e6 * pressed, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_a_rolloff_leaves_at_10_a_what_its_answer_says_and_never_grows(seed: int) -> None:
    hidden = draw_hidden({"ke_rolloff": 1.0}, None, np.random.default_rng(seed))
    law = [hidden.laws[name] for name in ("law", "knee", "width", "power")]
    assert weakened(10.0, *law) == pytest.approx(hidden.reported()["ke_rolloff"]["k_e_ratio_at_10_a"])
    left = [weakened(i, *law) for i in np.linspace(0.0, 25.0, 60)]
    assert left[0] == 1.0
    assert all(a >= b for a, b in pairwise(left))


VISIBLE = 1.5
"""Times its sensor's noise that a channel must change somewhere by an effect at two fifths of its strength or an outsider."""


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)], ids=["some", "all"])
def test_each_effect_and_each_outsider_shows_in_some_channel(every: int) -> None:
    x, v = line_motion("r18ohm", np.random.default_rng(8))
    keep = x.size * 2 // 5  # the first payout and haul-in
    x, v = x[:keep], v[:keep]
    plain = _readings(plain_twin(), x, v)
    cases = [draw_hidden({name: 0.4}, None, np.random.default_rng(9)) for name in INJECTED]
    cases += [draw_hidden({}, name, np.random.default_rng(9)) for name in OUTSIDERS]
    for hidden in cases[::every]:
        if "elastic_encoder" in hidden.outsiders:  # changes what is logged of the motion, not what follows from it
            continue
        changed = _readings(plain_twin(hidden), x, v)
        change = max(np.max(np.abs(changed[name] - plain[name])) for name in SENSORS)
        assert change > VISIBLE, hidden


def _readings(twin: Twin, x: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
    """Channels in units of their sensors' noise, without any."""
    solved = solve_twin(twin, "r18ohm", x, v, 0.0)
    read = noiseless(twin, solved, stamps_of(solved))
    return {name: value / SENSORS[name].noise for name, value in read.items()}


def test_a_case_gives_the_same_bytes_again_and_another_case_others() -> None:
    one = Case(1, 11, "single", {"gear_mesh_loss": 1.0})
    log = _log(one)
    assert log == _log(one)
    assert log != _log(msgspec.structs.replace(one, number=2))
    assert answer_of(one) == answer_of(one)


def _log(case: Case) -> bytes:
    rng = np.random.default_rng([case.seed, case.number])
    hidden = draw_hidden(case.effects, case.outsider, rng)
    return make_log(plain_twin(hidden), "r18ohm", rng)["force"].tobytes()


ALIKE = {"noise": 0.15, "force at rest": 0.4, "wobble": 0.2, "plateau": 0.05}
"""Largest differences from the labelled campaigns, as shares; ramps, holds and travel may differ by 0.25."""


@pytest.mark.slow
def test_a_campaign_of_the_twin_looks_like_the_labelled_ones_and_is_followed_by_the_rig_as_well(
    tmp_path: Path, shared: Path
) -> None:
    case = Case(4, 1, "none", {})
    for name, content in make_campaign(case).items():
        (tmp_path / name).write_bytes(content)
    head = (shared / "labelled" / "none" / "r36ohm.csv").read_text().splitlines()[0]
    assert (tmp_path / "r36ohm.csv").read_text().splitlines()[0] == head
    listed = (tmp_path / "campaign.toml").read_text().replace(case.name, "none").splitlines()
    assert listed[1:4] == ['rig = "hsu2026"', "measured = false", f'origin = "{ORIGIN}"']
    assert [listed[0], *listed[4:]] == (shared / "labelled" / "none" / "campaign.toml").read_text().splitlines()
    ours, theirs = likeness(tmp_path), likeness(shared / "labelled" / "none")
    for name, value in theirs.items():
        share = next((s for start, s in ALIKE.items() if name.startswith(start)), 0.25)
        assert ours[name] == pytest.approx(value, rel=share), name
    _is_followed(tmp_path, case)


def _is_followed(folder: Path, case: Case) -> None:
    truth = answer_of(case)
    rig = {
        "mu_screw": truth.rig["mu"],
        "area": truth.rig["area"],
        "p0": truth.rig["p_gas"],
        "v_gas": truth.rig["v_gas"],
    }
    rig |= {"eta_gear": truth.rig["eta_mesh"], "b_visc": truth.rig["b_rotor"], "ke_ll": truth.rig["k_e"]}
    rig |= {"rs": truth.rig["r_s"], "ls": truth.rig["l_s"], "c_dc": truth.rig["c_dc"]}
    model = own_model({"rig": rig})
    for log, load in NOMINAL.items():
        run = read_run(folder / f"{log}.csv", load=load)
        assert {finding.kind for finding in run.findings} <= {"out_of_range"}  # 4.5 ohm passes the range of Table 1
        change = 0.0 if math.isinf(load) else truth.loads[log] / load - 1.0
        found = simulate(
            run, msgspec.structs.replace(model, dc_link=msgspec.structs.replace(model.dc_link, load_change=change))
        )
        assert_followed(run, found.run, truth.gains)
