"""A rig from its open circuit: known numbers are found again, within the stated intervals."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from daily import daily
from openlog import NOISE, estimated_rig, made_log, motion_run
from rigs import scales_on, truth_of

from winchcascade import calibrate, read_run, simulate
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import Calibrated, Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.fit.block_means import PAYOUT
from winchcascade.diagnosis.fit.nuisances import (
    Nuisance,
    before_calibration,
    nuisances,
    quantity_of,
    with_quantity,
)
from winchcascade.diagnosis.handover.calibrate import STRAINED, Calibration, Number
from winchcascade.report.results.calibration import calibration_report
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import with_part

RIG = built_in()


def shifted(rig: Rig, moves: dict[tuple[str, str], float]) -> Rig:
    """A rig whose numbers, by section and name, are moved."""
    for place, move in moves.items():
        stated = quantity_of(rig, *place)
        assert stated is not None
        rig = with_quantity(rig, *place, msgspec.structs.replace(stated, value=stated.value + move))
    return rig


TRUE = {"k_e": "ke_ll", "mu_screw": "mu_screw", "eta_mesh": "eta_gear", "b_rotor": "b_visc"}
"""What a labelled campaign calls a number of the rig."""

PLACES = [
    ("generator", "k_e"),
    ("restoring", "mu_screw"),
    ("drivetrain", "eta_mesh"),
    ("drivetrain", "b_rotor"),
]


def number(calibration: Calibration, name: str) -> Number:
    return next(n for n in calibration.numbers if n.name == name)


def with_number(section: str, name: str, **fields: float | None) -> Rig:
    """The built-in rig with another value or uncertainty of a number."""
    stated = quantity_of(RIG, section, name)
    assert stated is not None
    return with_quantity(RIG, section, name, msgspec.structs.replace(stated, **fields))


def without(run: Run, *names: str) -> Run:
    return msgspec.structs.replace(
        run, channels={k: x for k, x in run.channels.items() if k not in names}
    )


@cache
def noisy() -> Run:
    return made_log(seed=1)


@cache
def found_in_noise() -> Calibration:
    return calibrate(noisy(), estimated_rig())


def nuisances_of(run: Run) -> tuple[Nuisance, ...]:
    return nuisances(RIG, [run], scales_on(RIG, [run]))


def drawn(seed: int) -> tuple[Run, dict[str, float]]:
    """A noisy log of a rig whose numbers, gains and zeros are drawn from their tolerances, and the
    numbers to be found.

    Damper and screw friction are drawn a tenth and a twentieth wide: they are what a calibration is
    for.
    """
    rng = np.random.default_rng(seed)
    motion = motion_run()
    moves = {
        (n.section, n.name): n.sd * rng.normal()
        for n in nuisances_of(made_log(cycles=1))
        if n.kind == "rig"
    }
    moves["drivetrain", "b_rotor"] = 0.1 * 7.5e-4 * rng.normal()
    moves["restoring", "mu_screw"] = 0.05 * 0.04 * rng.normal()
    run = simulate(motion, baseline(shifted(RIG, moves))).run
    channels = dict(run.channels)
    for n in nuisances_of(run):
        if n.kind == "gain":
            channels[n.name] = channels[n.name] * (1.0 + n.sd * rng.normal())
        if n.kind == "zero":
            channels[n.name] = channels[n.name] + n.sd * rng.normal()
    channels = {
        name: x + rng.normal(0.0, NOISE.get(name, 0.0), x.size) for name, x in channels.items()
    }
    true = {
        name: getattr(getattr(RIG, section), name).value + moves[section, name]
        for section, name in PLACES
    }
    return msgspec.structs.replace(run, channels=channels, simulated=False), true


@pytest.mark.parametrize(("logs", "misses"), [(3, 2), pytest.param(10, 5, marks=pytest.mark.slow)])
def test_intervals_hold_the_true_numbers_as_often_as_they_state(logs: int, misses: int) -> None:
    """Of 12 or 40 intervals of 95 %, so many or fewer miss the true number with a probability
    above 0.95.
    """
    missed = []
    for seed in range(logs):
        run, true = drawn(seed)
        found = calibrate(run, RIG)
        missed += [
            (seed, n)
            for n, value in true.items()
            if not number(found, n).low <= value <= number(found, n).high
        ]
    assert len(missed) <= misses, missed


@pytest.mark.slow
def test_the_numbers_of_labelled_campaigns_lie_in_their_intervals(shared: Path) -> None:
    """Those whose injected effect leaves the numbers of an open circuit alone: of 20 intervals
    of 95 %, 18 hold the number.
    """
    inside = 0
    for case in ("none", "none_2", "ke_rolloff", "copper_heating", "electrical_lag"):
        folder = shared / "labelled" / case
        truth = truth_of(folder)["rig"]
        found = calibrate(read_run(folder / "open_circuit.csv", load=math.inf), RIG)
        inside += sum(n.low <= truth[TRUE[n.name]] <= n.high for n in found.numbers)
        late = abs(found.regression.lag) > 3.0 * found.regression.u_lag
        assert late == (case == "electrical_lag"), case
    assert inside >= 18


def test_without_noise_the_numbers_are_those_of_the_model_and_the_damper_that_of_the_figure() -> (
    None
):
    truth = {"k_e": 0.0610, "b_rotor": 9.0e-4, "mu_screw": 0.05}
    places = {(section, name): truth[name] for section, name in PLACES if name in truth}
    moves = {
        place: value - getattr(getattr(RIG, place[0]), place[1]).value
        for place, value in places.items()
    }
    found = calibrate(made_log(baseline(shifted(RIG, moves))), RIG)
    for name, value in truth.items():
        assert number(found, name).value == pytest.approx(value, rel=5e-3)
    assert number(found, "k_e").value == pytest.approx(0.0610, rel=2e-4)
    assert found.misfit < 1.5
    assert found.strained == ()
    assert found.settled
    blocks = found.blocks
    fast = (blocks.phase == PAYOUT) & (blocks.rpm > 3000.0)
    omega = blocks.rpm[fast] * math.pi / 30.0
    eta_mesh, b_rotor = number(found, "eta_mesh").value, number(found, "b_rotor").value
    assert RIG.drivetrain.gear_ratio is not None
    damper = RIG.drivetrain.gear_ratio.value / eta_mesh * b_rotor * omega
    assert blocks.damper[fast] == pytest.approx(damper, rel=1e-6)
    assert np.max(np.abs(blocks.measured - blocks.fitted)[fast, 2]) < 0.1 * np.min(
        blocks.damper[fast]
    )


def test_a_number_that_the_log_does_not_determine_is_marked_and_one_held_together_with_it_named() -> (
    None
):
    assert [n.name for n in found_in_noise().numbers if n.new] == ["k_e", "mu_screw", "b_rotor"]
    assert found_in_noise().together[0].startswith("k_e and gain of vdc (-0.9")
    loose = calibrate(noisy(), with_number("drivetrain", "eta_mesh", u=0.05))
    assert any({"eta_mesh", "b_rotor"} <= set(pair.split()) for pair in loose.together), (
        loose.together
    )


def test_a_fit_that_did_not_come_to_rest_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("winchcascade.diagnosis.handover.calibrate.ROUNDS", 1)
    found = calibrate(made_log(baseline(shifted(RIG, {("drivetrain", "b_rotor"): 2e-4}))), RIG)
    assert not found.settled
    assert [tile.name for tile in calibration_report(found).tiles] == ["k_e"]


ALIKE = (
    ("winch", "r_drum", "k_e"),
    ("drivetrain", "gear_ratio", "k_e"),
    ("drivetrain", "eta_mesh", "b_rotor"),
)


@pytest.mark.parametrize(("section", "name", "found"), daily(ALIKE, ALIKE[2:], spread=True))
def test_an_uncertainty_contains_those_of_numbers_that_act_alike(
    section: str, name: str, found: str
) -> None:
    """The uncertainty is at least half of the one that is tied to it; the log contains a part of
    that itself.
    """
    value = getattr(getattr(RIG, section), name).value
    wide, narrow = (
        number(calibrate(noisy(), with_number(section, name, u=u * value)), found)
        for u in (0.01, 1e-6)
    )
    assert math.sqrt(wide.u**2 - narrow.u**2) > 0.5 * 0.01 * wide.value


def test_a_calibration_does_not_depend_on_an_earlier_one() -> None:
    rig = calibrated = estimated_rig()
    for n in found_in_noise().numbers:
        record = Calibrated("earlier.csv", "", quantity_of(rig, n.section, n.name))
        earlier = Quantity(0.9 * n.value, n.unit, "", 1e-6 * n.value, record)
        calibrated = with_quantity(calibrated, n.section, n.name, earlier)
    assert before_calibration(calibrated) == rig
    assert calibrate(noisy(), calibrated).numbers == found_in_noise().numbers


def test_something_else_that_acts_is_reported_as_strain() -> None:
    model = baseline(RIG)
    heated = with_part(model, "restoring", exponent=1.3)
    found = calibrate(made_log(heated), RIG)
    assert found.misfit > 2.0
    assert all(abs(strain.by) > STRAINED for strain in found.strained)
    assert "volume_gas" in {strain.name for strain in found.strained}


def test_only_the_cycles_that_count_are_looked_at_for_damper_and_screw() -> None:
    force = np.where(noisy().t > 72.0, 2.0 * noisy().channels["force"], noisy().channels["force"])
    spoilt = msgspec.structs.replace(noisy(), channels={**noisy().channels, "force": force})
    assert number(calibrate(spoilt, RIG, cycles=(1, 2)), "mu_screw").value == pytest.approx(
        0.04, rel=0.03
    )


def test_a_coarse_estimate_and_a_log_without_torque_give_the_damper_too() -> None:
    damper = number(
        calibrate(without(noisy(), "torque"), with_number("drivetrain", "b_rotor", value=2.5e-4)),
        "b_rotor",
    )
    assert damper.low <= 7.5e-4 <= damper.high
    assert damper.how == "line tension and pressure"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"load": 18.0},
            r"made.csv: a log with a load of 18 ohm; a calibration needs an open circuit",
        ),
        ({"load": None}, r"its load is unknown; .* --load-ohm inf"),
        ({"lost": "force"}, "no line tension, which the losses"),
        ({"lost": "vdc"}, "no DC voltage, which a back"),
        ({"idc": 2.0}, "stated as an open circuit, but it delivers .* W "),
    ],
    ids=str,
)
def test_a_log_that_is_no_open_circuit_is_rejected(change: dict[str, Any], says: str) -> None:
    run = without(made_log(cycles=1), change.get("lost", ""))
    channels = {**run.channels, "idc": run.channels["idc"] + change.get("idc", 0.0)}
    run = msgspec.structs.replace(run, load=change.get("load", run.load), channels=channels)
    with pytest.raises(LogError, match=says):
        calibrate(run, RIG)


def test_a_number_without_an_estimate_is_rejected() -> None:
    with pytest.raises(
        RigError,
        match=r"b_rotor under \[drivetrain\] is 0; a calibration starts from an estimate, give one",
    ):
        calibrate(noisy(), with_number("drivetrain", "b_rotor", value=0.0))
