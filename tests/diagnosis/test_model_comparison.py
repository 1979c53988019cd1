"""Which logs are laid beside a simulation, which samples of them, and why others are not."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from compared import compared, reduced

from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import CLOCK
from winchcascade.diagnosis.model_comparison import (
    LONGEST,
    SLOWEST,
    LeftOut,
    ModelComparison,
    compare,
    compare_with_baseline,
)
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.open_rig import load_rig

LONGEST_SENTENCE = 200


@pytest.fixture(scope="module")
def loaded() -> Reduction:
    return reduced("18 ohm")


def why(reduction: Reduction) -> str:
    found = compare_with_baseline(reduction)
    assert isinstance(found, LeftOut)
    assert len(found.why) < LONGEST_SENTENCE
    assert found.why.count(". ") == 0
    assert found.why.endswith(".")
    return found.why


def repeated(reduction: Reduction, times: int) -> Reduction:
    """The same log several times in a row."""
    run = reduction.run
    span = float(run.t[-1] - run.t[0]) + 1.0 / run.fs
    t = np.concatenate([run.t + k * span for k in range(times)])
    channels = {name: np.tile(x, times) for name, x in run.channels.items()}
    return reduce(msgspec.structs.replace(run, t=t, channels=channels, samples=t.size), window=5.96)


# ------------------------------------------------------------------------------------------------------ what is left out
def test_a_rig_without_numbers_of_a_model_is_named_with_the_sections_that_lack_them(loaded: Reduction) -> None:
    text = why(msgspec.structs.replace(loaded, rig=load_rig("kitepower")))
    assert text.startswith("the rig file of kitepower lacks what a model needs: 22 numbers under [winch], [restoring]")
    assert "`winchcascade rig hsu2026`" in text


def test_a_measured_log_of_another_winch_is_not_simulated(shared: Path) -> None:
    rig = load_rig("kitepower")
    run = read_run(shared / "kitepower-2019-10-08" / "ground_station_cycles_01_43.csv", rig=rig)
    assert "kitepower lacks" in why(reduce(run, rig=rig))


def test_few_missing_numbers_are_named_each(loaded: Reduction) -> None:
    rig = load_rig("hsu2026")
    shaft = msgspec.structs.replace(rig.drivetrain, k_shaft=None, b_rotor=None)
    text = why(msgspec.structs.replace(loaded, rig=msgspec.structs.replace(rig, drivetrain=shaft)))
    assert "lacks what a model needs: b_rotor under [drivetrain], k_shaft under [drivetrain] (" in text


def test_a_log_of_unknown_load_is_left_out(loaded: Reduction) -> None:
    run = msgspec.structs.replace(loaded.run, load=None)
    assert "the load of the log is not known" in why(msgspec.structs.replace(loaded, run=run))


def test_a_log_without_velocity_is_left_out(loaded: Reduction) -> None:
    channels = {name: x for name, x in loaded.run.channels.items() if name != "velocity"}
    run = msgspec.structs.replace(loaded.run, channels=channels)
    assert "no line velocity" in why(msgspec.structs.replace(loaded, run=run))


def test_a_log_without_a_complete_cycle_is_left_out(loaded: Reduction) -> None:
    cycles = tuple(msgspec.structs.replace(c, complete=False) for c in loaded.cycles)
    assert "no complete cycle" in why(msgspec.structs.replace(loaded, cycles=cycles))


def test_a_log_of_few_samples_is_left_out(loaded: Reduction) -> None:
    run = msgspec.structs.replace(loaded.run, fs=0.9 * SLOWEST)
    assert "4.5 samples a second" in why(msgspec.structs.replace(loaded, run=run))


def test_a_motion_that_the_rig_cannot_follow_is_left_out_with_the_models_sentence(loaded: Reduction) -> None:
    channels = {**loaded.run.channels, "displacement": 5.0 * loaded.run.channels["displacement"]}
    run = msgspec.structs.replace(loaded.run, channels=channels)
    found = compare_with_baseline(msgspec.structs.replace(loaded, run=run))
    assert isinstance(found, LeftOut)
    assert found.why.startswith("the line pays out 48.4")


# ----------------------------------------------------------------------------------------------------- what is compared
def test_payouts_end_with_braking_where_the_clutch_is_to_drive_the_generator(loaded: Reduction) -> None:
    found = compared(loaded)
    t = found.run.t
    for c in found.cycles:
        inside = (t >= c.phases.onset) & (t <= c.phases.payout_end)
        assert found.payout[inside].all()
        flat = c.summary.payout.plateau
        assert flat is not None
        assert not found.driven[inside & (t > flat.braking)].any()
        assert found.driven[inside & (t > flat.begin) & (t < flat.braking)].all()
    assert not (found.payout & found.haul_in).any()
    assert (found.run.channels["velocity"][found.haul_in] < 0.01).all()


def test_bridged_samples_of_any_channel_are_not_compared(loaded: Reduction) -> None:
    whole = compared(loaded)
    c = whole.cycles[1]
    gap = np.array([[c.phases.onset + 3.0, c.phases.onset + 4.0]])
    for channel in (CLOCK, "pressure"):
        run = msgspec.structs.replace(loaded.run, gaps={channel: gap})
        found = compared(msgspec.structs.replace(loaded, run=run))
        inside = (found.run.t > gap[0, 0]) & (found.run.t < gap[0, 1])
        assert not (found.payout | found.driven)[inside].any()
        assert (found.payout == whole.payout)[~inside].all()


def test_of_a_long_log_the_first_complete_cycles_are_compared(loaded: Reduction) -> None:
    long = repeated(loaded, 5)
    found = compared(long)
    assert found.total == len(long.complete) >= 14
    assert 3 <= len(found.cycles) < found.total
    assert [c.cycle for c in found.cycles] == [c.cycle for c in long.complete[: len(found.cycles)]]
    assert found.run.t[-1] - found.run.t[0] <= LONGEST
    first, last = found.cycles[0], found.cycles[-1]
    assert found.run.t[0] < first.phases.onset
    assert last.phases.haul_in is not None
    assert found.run.t[-1] > last.phases.haul_in[1]
    torque = found.simulation.run.channels["torque"]
    short = compared(loaded)
    n = int(np.count_nonzero(short.driven[short.run.t < short.cycles[1].phases.onset]))
    assert np.flatnonzero(found.driven)[:n].size == n
    first_long, first_short = torque[found.driven][:n], short.simulation.run.channels["torque"][short.driven][:n]
    assert np.max(np.abs(first_long - first_short)) < 0.02 * np.max(first_short)


def test_a_model_with_an_effect_is_compared_alike_and_reported(loaded: Reduction) -> None:
    model = make_effect("gear_mesh_loss", {"efficiency_change": -0.05}).apply(baseline(loaded.rig))
    found = compare(loaded, model, changed="gear_mesh_loss")
    assert isinstance(found, ModelComparison)
    assert found.changed == "gear_mesh_loss"
    plain = compared(loaded)
    assert plain.changed == ""
    rows = plain.driven & (plain.rpm > 2000)
    ratio = found.simulation.run.channels["torque"][rows] / plain.simulation.run.channels["torque"][rows]
    assert np.median(ratio) == pytest.approx(0.95 / 0.90, rel=0.01)


def test_a_rig_of_ones_own_is_simulated_with_its_own_numbers(loaded: Reduction) -> None:
    rig = parse_rig('based_on = "hsu2026"\nname = "mine"\n[generator]\nk_e = { value = 0.031, unit = "V/rpm" }\n', "r")
    rows = compared(loaded).driven
    half = compared(msgspec.structs.replace(loaded, rig=rig)).simulation.run.channels["vdc"][rows].max()
    assert half == pytest.approx(0.5 * compared(loaded).simulation.run.channels["vdc"][rows].max(), rel=0.05)
