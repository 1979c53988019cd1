"""What is kept of a comparison: its numbers against ones made sample by sample, and its size."""

import math
from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from compared import KGCM2, LOGS, before_braking, binned, compared, reduced

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.compared_curves import CURVES, HAUL_IN, MIN_BIN_SAMPLES
from winchcascade.diagnosis.damper_curves import FACTORS
from winchcascade.diagnosis.loss_budget import GROUPS
from winchcascade.diagnosis.model_account import Account, account_of
from winchcascade.diagnosis.model_comparison import ModelComparison
from winchcascade.reduction.bins import stored_powers
from winchcascade.rig.simulate import LEDGER

KEPT = 5.1e-5
"""Five significant digits are kept."""

SMALL = 16_000
"""What a campaign may keep of each log. [bytes]"""

WHOLE = 1e-6
"""The trapezoidal books of a simulation close to this share of the line's energy."""

BY_SAMPLES = 5e-4
"""Energies from the samples alone differ from those of every step by less than this share of the line's energy."""


@pytest.fixture(scope="module")
def comparisons() -> dict[str, ModelComparison]:
    return {name: compared(reduced(name)) for name in LOGS}


@pytest.fixture(scope="module")
def accounts(comparisons: dict[str, ModelComparison]) -> dict[str, Account]:
    return {name: account_of(c) for name, c in comparisons.items()}


def means_over_speed(c: ModelComparison) -> Callable[[Signal], dict[float, float]]:
    """Means of a channel by bins of generator speed, of the samples before braking."""
    rpm = c.run.channels["velocity"] / 0.13 * 50.0 * 30.0 / math.pi
    return lambda y: binned(before_braking(c), rpm, y, 100.0, MIN_BIN_SAMPLES)


def without_stored(c: ModelComparison, run: Run) -> tuple[Signal, Signal]:
    """P_mech and P_gen without what rotor, shaft and capacitor store, with the numbers of the paper's rig."""
    x = run.channels
    stored = {name: of(slice(0, run.t.size)) for name, of in stored_powers(run, built_in()).items()}
    taken: Signal = x["torque"] * x["velocity"] / 0.13 - stored["rotor"] - stored["spring"]
    given: Signal = x["vdc"] * x["idc"] + stored["capacitor"]
    return taken, given


# ----------------------------------------------------------------------------------------------------------- the curves
def test_curves_over_speed_are_means_of_the_samples_before_braking(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, curves = comparisons["18 ohm"], accounts["18 ohm"].curves
    over_speed = means_over_speed(c)
    for k, run in enumerate((c.run, c.simulation.run)):
        x = run.channels
        taken, given = without_stored(c, run)
        expected = {
            "torque_nm": x["torque"], "vdc_v": x["vdc"], "idc_a": x["idc"], "power_gen_w": x["vdc"] * x["idc"],
            "loss_w": taken - given,
        }  # fmt: skip
        for name, y in expected.items():
            means = over_speed(y)
            found = (curves[name].log, curves[name].simulated)[k]
            assert curves[name].x == pytest.approx(list(means))
            assert found == pytest.approx(list(means.values()), rel=KEPT), name


def test_efficiency_and_apparent_resistance_are_ratios_of_the_means_of_a_bin(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, curves = comparisons["18 ohm"], accounts["18 ohm"].curves
    x, over_speed = c.run.channels, means_over_speed(c)
    mech, gen = map(over_speed, without_stored(c, c.run))
    vdc, idc = (over_speed(x[name]) for name in ("vdc", "idc"))
    eta = dict(zip(curves["eta_gen"].x, curves["eta_gen"].log, strict=True))
    ohm = dict(zip(curves["resistance_ohm"].x, curves["resistance_ohm"].log, strict=True))
    assert set(eta) == {k for k, watt in mech.items() if watt > 0.02 * max(mech.values())}
    assert set(ohm) == {k for k, ampere in idc.items() if ampere > 0.02 * max(idc.values())}
    assert eta == pytest.approx({k: gen[k] / mech[k] for k in eta}, rel=KEPT)
    assert ohm == pytest.approx({k: vdc[k] / idc[k] for k in ohm}, rel=KEPT)
    assert curves["resistance_ohm"].simulated == pytest.approx([18.0] * len(ohm), rel=1e-3)


def test_pressure_and_force_are_means_over_displacement_and_velocity(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, curves = comparisons["18 ohm"], accounts["18 ohm"].curves
    out = np.flatnonzero(c.payout).tolist()
    back = np.flatnonzero(c.haul_in).tolist()
    x = c.run.channels
    for name, rows in (("pressure_kgcm2", out), (HAUL_IN, back)):
        expected = binned(rows, x["displacement"], x["pressure"] / KGCM2, 0.5, MIN_BIN_SAMPLES)
        places = binned(rows, x["displacement"], x["displacement"], 0.5, MIN_BIN_SAMPLES)
        assert curves[name].log == pytest.approx(list(expected.values()), rel=KEPT)
        assert curves[name].x == pytest.approx(list(places.values()), rel=KEPT, abs=1e-4)
    expected = binned(
        sorted({*before_braking(c), *back}), x["velocity"], c.simulation.run.channels["force"], 0.1, MIN_BIN_SAMPLES
    )
    assert curves["force_n"].simulated == pytest.approx(list(expected.values()), rel=KEPT)
    assert min(curves["force_n"].x) < -0.5 < 0.5 < max(curves["force_n"].x)


def test_in_open_circuit_nothing_that_needs_a_current_is_reported(accounts: dict[str, Account]) -> None:
    account = accounts["open circuit"]
    assert set(account.curves) == {"pressure_kgcm2", HAUL_IN, "force_n", "vdc_v"}
    assert set(account.differences) == {"vdc", "pressure", "force"}
    assert account.budget is not None
    assert set(account.budget.log) == {"line"}
    assert set(accounts["18 ohm"].curves) == set(CURVES)


def test_differences_are_log_minus_simulation_over_the_payouts(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, found = comparisons["18 ohm"], accounts["18 ohm"].differences
    t = c.run.t
    rows = np.zeros(t.size, dtype=bool)
    for cycle in c.cycles:
        rows |= (t >= cycle.phases.onset) & (t <= cycle.phases.payout_end)
    for name, unit in (("torque", 1.0), ("vdc", 1.0), ("idc", 1.0), ("pressure", KGCM2), ("force", 1.0)):
        apart = (c.run.channels[name] - c.simulation.run.channels[name])[rows] / unit
        assert found[name].bias == pytest.approx(apart.sum() / apart.size)
        assert found[name].rms == pytest.approx(math.sqrt((apart @ apart) / apart.size))


@pytest.mark.parametrize("name", LOGS)
def test_what_is_kept_is_small_and_comes_back_from_json(accounts: dict[str, Account], name: str) -> None:
    content = msgspec.json.encode(accounts[name])
    assert len(content) < SMALL
    assert msgspec.json.decode(content, type=Account) == accounts[name]


# ----------------------------------------------------------------------------------------------------- the open circuit
def test_the_sweep_holds_the_rigs_own_damper_and_more_damper_takes_more_force(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, sweep = comparisons["open circuit"], accounts["open circuit"].sweep
    assert sweep is not None
    assert (sweep.factors, sweep.nominal) == (FACTORS, 7.5e-4)
    rpm = c.run.channels["velocity"] / 0.13 * 50.0 * 30.0 / math.pi
    rows = before_braking(c)
    own = binned(rows, rpm, c.simulation.run.channels["force"], 100.0, MIN_BIN_SAMPLES)
    log = binned(rows, rpm, c.run.channels["force"], 100.0, MIN_BIN_SAMPLES)
    assert sweep.rpm == pytest.approx(list(own))
    assert sweep.simulated[FACTORS.index(1.0)] == pytest.approx(list(own.values()), rel=KEPT)
    assert sweep.log == pytest.approx(list(log.values()), rel=KEPT)
    fast = np.array(sweep.rpm) > 2000.0
    forces = np.array(sweep.simulated)[:, fast]
    assert (np.diff(forces, axis=0) > 0.0).all()
    at_plateau = np.array(sweep.rpm)[fast][-1] * math.pi / 30.0
    whole = 50.0 / 0.95 * 7.5e-4 * at_plateau / 0.13  # force of the damper at the line
    assert forces[4, -1] - forces[0, -1] == pytest.approx(2.0 * whole, rel=0.03)


def test_the_regression_knows_the_back_emf_constant(accounts: dict[str, Account]) -> None:
    fit = accounts["open circuit"].regression
    assert fit is not None
    assert accounts["18 ohm"].regression is None
    assert accounts["18 ohm"].sweep is None
    assert fit.low < 0.0620 < fit.high
    assert fit.reference == 0.0620
    assert fit.r2 > 0.99
    assert min(fit.rpm) > 1000.0
    assert np.array(fit.v_ll) == pytest.approx(fit.slope * np.array(fit.rpm), rel=0.03)
    assert len(fit.rpm) == len(fit.v_ll) == len(fit.v_dc) <= fit.points


# ------------------------------------------------------------------------------------------------------ the loss budget
def test_every_entry_of_the_ledger_is_reported_once() -> None:
    listed = [entry for group in GROUPS.values() for entry in (*group.behind, *group.before)]
    assert sorted(listed) == sorted(set(LEDGER) - {"line"})


@pytest.mark.parametrize("name", LOGS)
def test_the_loss_budget_sums_to_the_lines_energy(accounts: dict[str, Account], name: str) -> None:
    budget = accounts[name].budget
    assert budget is not None
    assert sum(budget.shares.values()) == pytest.approx(1.0, abs=WHOLE)
    assert min(budget.shares.values()) > -1e-9


def energy(c: ModelComparison, watt: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Mean energy over the windows from the samples, their ends between samples. [J]"""
    t, joules = c.run.t, []
    for cycle in c.cycles:
        begin, end = cycle.window.onset, cycle.window.cutoff
        stamps = np.array([begin, *t[(t > begin) & (t < end)], end])
        joules.append(float(np.trapezoid(np.interp(stamps, t, watt), stamps)))
    return float(np.mean(joules))


def test_the_parts_of_the_budget_are_the_powers_of_the_simulation(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, budget = comparisons["18 ohm"], accounts["18 ohm"].budget
    assert budget is not None
    sim = c.simulation
    x, omega, v = sim.run.channels, sim.rpm_gen * math.pi / 30.0, c.run.channels["velocity"]
    expected = {
        "dc": x["vdc"] * x["idc"],
        "copper": 3.0 * 0.61 * sim.i_s**2,
        "damper": 7.5e-4 * omega**2,
        "mesh": 0.05 * x["torque"] * omega / 50.0,
    }
    for name, watt in expected.items():
        assert budget.groups[name] == pytest.approx(energy(c, watt), abs=BY_SAMPLES * budget.line), name
    assert budget.line == pytest.approx(energy(c, x["force"] * v), rel=2 * BY_SAMPLES)
    assert budget.mech == pytest.approx(energy(c, x["torque"] * v / 0.13) / budget.line, abs=2 * BY_SAMPLES)
    assert budget.log["mech"] == pytest.approx(energy(c, c.run.channels["torque"] * v / 0.13), rel=2 * BY_SAMPLES)


def test_inertia_is_what_turns_at_the_cutoff(
    comparisons: dict[str, ModelComparison], accounts: dict[str, Account]
) -> None:
    c, budget = comparisons["18 ohm"], accounts["18 ohm"].budget
    assert budget is not None
    t = c.run.t
    v = np.interp([cycle.window.cutoff for cycle in c.cycles], t, c.run.channels["velocity"])
    rpm = np.interp([cycle.window.cutoff for cycle in c.cycles], t, c.simulation.rpm_gen)
    drum, rotor = np.mean(0.5 * 0.3 * (v / 0.13) ** 2), np.mean(0.5 * 626e-6 * (rpm * math.pi / 30.0) ** 2)
    assert budget.drum == pytest.approx(drum, rel=0.02)
    assert budget.groups["inertia"] == pytest.approx(drum + rotor, rel=0.02)
