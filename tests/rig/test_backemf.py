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
from winchcascade.rig.backemf import SLOW_SHARE, BackEmf, back_emf
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import Model, with_part

MODEL = baseline(built_in())

EXACTLY = 3e-4
"""Without noise the constant comes back to this share: what the smoothing of the velocity and a
step leave.
"""

BIAS = 1.5e-3
"""What smoothing and the capacitor's current leave of a lag where there is none; 0.8 ms seen.
[s]
"""


def made(k_e: float = 0.0620, lag: float = 0.0, **others: float) -> Run:
    """An open circuit of a rig with a back-EMF constant, and with Vdc recorded late."""
    model = with_part(with_part(MODEL, "generator", k_e=k_e), "sensors", electrical_lag=lag)
    return made_log(model, **others)  # type: ignore[arg-type]


def fitted(run: Run, model: Model = MODEL, **others: float) -> BackEmf:
    return back_emf(run, model, steady_payouts(run), **others)


@pytest.mark.parametrize(
    ("k_e", "lag"), [(0.0550, 0.0), (0.0700, 0.0), (0.0620, 0.12), (0.0620, -0.04)]
)
def test_a_known_constant_and_a_lag_are_found_again_whatever_the_rig_file_says(
    k_e: float, lag: float
) -> None:
    found = fitted(made(k_e, lag))
    assert found.k_e == pytest.approx(k_e, rel=2.0 * EXACTLY)
    assert found.r2 > 0.9999
    assert found.lag == pytest.approx(lag, abs=3e-3)


def test_eq_8_alone_reads_low_by_what_the_bridge_drops_and_is_right_without_bleed_and_capacitor() -> (
    None
):
    found = fitted(made())
    assert -0.03 < found.eq8 / found.k_e - 1.0 < -0.01
    light = with_part(MODEL, "dc_link", r_bleed=1e7, c_dc=1e-8)
    found = fitted(made_log(light), light)
    assert found.eq8 == pytest.approx(found.k_e, rel=2e-3)


def test_noise_moves_constant_and_lag_by_their_standard_uncertainty() -> None:
    found = [fitted(made(seed=seed)) for seed in range(24)]
    assert np.std([f.k_e for f in found]) == pytest.approx(
        np.mean([f.u_fit for f in found]), rel=0.4
    )
    assert np.std([f.lag for f in found]) == pytest.approx(
        np.mean([f.u_lag for f in found]), rel=0.4
    )
    assert np.mean([f.k_e for f in found]) == pytest.approx(0.0620, rel=EXACTLY)
    assert abs(np.mean([f.lag for f in found])) < BIAS


def test_the_interval_holds_the_gain_of_the_sensor() -> None:
    bare, known = (fitted(made(seed=2), u_gain=u_gain) for u_gain in (0.0, 0.005))
    assert known.k_e == bare.k_e
    assert known.high - known.k_e == pytest.approx(1.96 * math.hypot(bare.u_fit, 0.005 * bare.k_e))


@pytest.mark.parametrize("case", ["none", "none_2", "ke_rolloff", "copper_heating"])
def test_an_independent_simulation_gives_its_constant_back(shared: Path, case: str) -> None:
    truth = truth_of(shared / "labelled" / case)
    run = read_run(shared / "labelled" / case / "open_circuit.csv", load=math.inf)
    found = fitted(run, own_model(truth))
    assert found.k_e / truth["sensor_gains"][3] == pytest.approx(truth["rig"]["ke_ll"], rel=1e-3)


def test_samples_of_the_regression_are_those_above_a_share_of_the_largest_speed_in_the_payouts_handed_in() -> (
    None
):
    run = made()
    whole, first = fitted(run), back_emf(run, MODEL, steady_payouts(run)[:1])
    assert whole.rpm.min() > whole.rpm_min > 0.99 * SLOW_SHARE * whole.rpm.max()
    assert 2.5 < whole.rpm.size / first.rpm.size < 3.5
    with pytest.raises(
        LogError, match=rf"0 samples above {whole.rpm_min:.4g} rpm .* pay out faster"
    ):
        back_emf(run, MODEL, [])
    bare = {name: x for name, x in run.channels.items() if name != "vdc"}
    with pytest.raises(
        LogError, match="no DC voltage, which a back-EMF constant is fitted to; log Vdc"
    ):
        fitted(msgspec.structs.replace(run, channels=bare))
