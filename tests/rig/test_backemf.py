"""The back-EMF constant of an open circuit: found again where it is known, with a lag beside it."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from openlog import made_log, steady_payouts
from rigs import own_model, truth_of

from winchcascade import read_run
from winchcascade.core.errors import LogError
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.rig.backemf import RPM_MIN, back_emf
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import Model

MODEL = baseline(built_in())

EXACTLY = 3e-4
"""Without noise the constant comes back to this share: what the smoothing of the velocity and a step leave."""


def with_k_e(k_e: float, lag: float = 0.0) -> Model:
    return msgspec.structs.replace(
        MODEL,
        generator=msgspec.structs.replace(MODEL.generator, k_e=k_e),
        sensors=msgspec.structs.replace(MODEL.sensors, electrical_lag=lag),
    )


def without(run: Run, *names: str) -> Run:
    return msgspec.structs.replace(run, channels={k: x for k, x in run.channels.items() if k not in names})


@pytest.mark.parametrize("k_e", [0.0550, 0.0620, 0.0700])
def test_a_known_constant_is_found_again_whatever_the_rig_file_says(k_e: float) -> None:
    run = made_log(with_k_e(k_e))
    found = back_emf(run, MODEL, steady_payouts(run))
    assert found.k_e == pytest.approx(k_e, rel=EXACTLY)
    assert found.r2 > 0.9999
    assert abs(found.lag) < 2e-3


@pytest.mark.parametrize("lag", [0.05, 0.12, -0.04])
def test_a_lag_is_found_beside_the_constant(lag: float) -> None:
    run = made_log(with_k_e(0.0620, lag))
    found = back_emf(run, MODEL, steady_payouts(run))
    assert found.lag == pytest.approx(lag, abs=3e-3)
    assert found.k_e == pytest.approx(0.0620, rel=2.0 * EXACTLY)


def test_eq_8_alone_reads_low_by_what_the_bridge_drops() -> None:
    run = made_log()
    found = back_emf(run, MODEL, steady_payouts(run))
    assert -0.03 < found.eq8 / found.k_e - 1.0 < -0.01


def test_without_bleed_and_capacitor_eq_8_is_right() -> None:
    light = msgspec.structs.replace(MODEL, dc_link=msgspec.structs.replace(MODEL.dc_link, r_bleed=1e7, c_dc=1e-8))
    run = made_log(light)
    found = back_emf(run, light, steady_payouts(run))
    assert found.eq8 == pytest.approx(found.k_e, rel=2e-3)


SEEDS = range(24)

BIAS = 1.5e-3
"""What smoothing and the capacitor's current leave of a lag where there is none; 0.8 ms seen. [s]"""


def test_noise_moves_constant_and_lag_by_their_standard_uncertainty() -> None:
    found = []
    for seed in SEEDS:
        run = made_log(seed=seed)
        found.append(back_emf(run, MODEL, steady_payouts(run)))
    assert np.std([f.k_e for f in found]) == pytest.approx(np.mean([f.u_fit for f in found]), rel=0.4)
    assert np.std([f.lag for f in found]) == pytest.approx(np.mean([f.u_lag for f in found]), rel=0.4)
    assert np.mean([f.k_e for f in found]) == pytest.approx(0.0620, rel=EXACTLY)
    assert abs(np.mean([f.lag for f in found])) < BIAS


def test_the_interval_holds_the_gain_of_the_sensor() -> None:
    run = made_log(seed=2)
    payouts = steady_payouts(run)
    bare, known = back_emf(run, MODEL, payouts), back_emf(run, MODEL, payouts, u_gain=0.005)
    assert known.k_e == bare.k_e
    assert known.u_sensor == pytest.approx(0.005 * bare.k_e)
    assert known.high - known.k_e == pytest.approx(1.96 * math.hypot(bare.u_fit, 0.005 * bare.k_e))


def test_samples_of_the_regression_are_those_above_1000_rpm_in_the_payouts_handed_in() -> None:
    run = made_log()
    payouts = steady_payouts(run)
    whole, first = back_emf(run, MODEL, payouts), back_emf(run, MODEL, payouts[:1])
    assert whole.rpm.min() > RPM_MIN
    assert whole.rpm.shape == whole.v_ll.shape == whole.vdc.shape
    assert 2.5 < whole.rpm.size / first.rpm.size < 3.5


@pytest.mark.parametrize("case", ["none", "none_2", "ke_rolloff", "copper_heating"])
def test_an_independent_simulation_gives_its_constant_back(shared: Path, case: str) -> None:
    folder = shared / "labelled" / case
    truth = truth_of(folder)
    run = read_run(folder / "open_circuit.csv", load=math.inf)
    found = back_emf(run, own_model(truth), steady_payouts(run))
    assert found.k_e / truth["sensor_gains"][3] == pytest.approx(truth["rig"]["ke_ll"], rel=1e-3)


def test_a_log_without_a_voltage_is_rejected() -> None:
    run = made_log(cycles=1)
    with pytest.raises(LogError, match=r"made\.csv: no DC voltage, which a back-EMF constant is fitted to; log Vdc\."):
        back_emf(without(run, "vdc"), MODEL, steady_payouts(run))


def test_a_payout_too_slow_for_the_regression_is_rejected() -> None:
    run = made_log(cycles=1, speed=0.2)
    with pytest.raises(
        LogError,
        match=r"made\.csv: 0 samples above 1000 rpm in which the bridge conducts; .* at least 25: pay out faster",
    ):
        back_emf(run, MODEL, steady_payouts(run))


def test_no_payout_is_rejected() -> None:
    run = made_log(cycles=1)
    with pytest.raises(LogError, match="0 samples above 1000 rpm"):
        back_emf(run, MODEL, [])
