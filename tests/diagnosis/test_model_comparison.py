"""A log beside its simulation: why others have none, which samples count, and the numbers that
are kept of it.
"""

import math
from functools import cache

import msgspec
import numpy as np
import pytest
from compared import KGCM2, LOGS, before_braking, binned, compared, reduced
from rigs import scale_of

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Signal
from winchcascade.diagnosis.explain.model_comparison import (
    BINS,
    CURVES,
    HAUL_IN,
    LONGEST,
    MIN_BIN_SAMPLES,
    Account,
    SimulatedLog,
    modelled,
    samples_of,
    simulated_log,
)
from winchcascade.reduction.bins import stored_powers
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.rig.baseline import load_rig

KEPT = 5.1e-5
"""Five significant digits are kept."""

SMALL = 16_000
"""What a campaign may keep of each log. [bytes]"""

WHOLE = 1e-6
"""The trapezoidal books of a simulation close to this share of the line's energy."""

BY_SAMPLES = 5e-4
"""Energies from the samples alone differ from those of every step by less than this share of the
line's energy.
"""


@cache
def comparison(name: str = "18 ohm") -> SimulatedLog:
    return compared(reduced(name))


@cache
def account(name: str = "18 ohm") -> Account:
    return modelled(reduced(name))


def changed(**fields: object) -> Reduction:
    """The log at 18 ohm with other fields."""
    reduction = reduced("18 ohm")
    return msgspec.structs.replace(reduction, run=msgspec.structs.replace(reduction.run, **fields))


# ------------------------------------------------------------------------------- what is left out
def test_a_rig_a_motion_and_cycles_that_cannot_be_simulated_have_a_reason() -> None:
    loaded = reduced("18 ohm")
    assert "the load of the log is not known" in str(simulated_log(changed(load=None)))
    other = msgspec.structs.replace(loaded, rig=load_rig("kitepower"))
    assert "kitepower" in str(simulated_log(other))
    still = {name: x for name, x in loaded.run.channels.items() if name != "velocity"}
    assert "no line velocity" in str(simulated_log(changed(channels=still)))
    far = {**loaded.run.channels, "displacement": 5.0 * loaded.run.channels["displacement"]}
    assert str(simulated_log(changed(channels=far))).startswith("the line pays out 48.4")
    cycles = tuple(msgspec.structs.replace(c, complete=False) for c in loaded.cycles)
    assert "no complete cycle" in str(simulated_log(msgspec.structs.replace(loaded, cycles=cycles)))


# ------------------------------------------------------------------------------- what is compared
def test_payouts_end_with_braking_where_the_clutch_is_to_drive_the_generator() -> None:
    found, samples, t = comparison(), samples_of(comparison()), comparison().run.t
    for c in found.cycles:
        inside, flat = (t >= c.phases.onset) & (t <= c.phases.payout_end), c.summary.payout.plateau
        assert flat is not None
        assert samples.payout[inside].all()
        assert not samples.driven[inside & (t > flat.braking)].any()
        assert samples.driven[inside & (t > flat.begin) & (t < flat.braking)].all()
    assert not (samples.payout & samples.haul_in).any()


@pytest.mark.parametrize("channel", [CLOCK, "pressure"])
def test_bridged_samples_of_any_channel_are_not_compared(channel: str) -> None:
    whole, c = samples_of(comparison()), comparison().cycles[1]
    gap = np.array([[c.phases.onset + 3.0, c.phases.onset + 4.0]])
    found = compared(changed(gaps={channel: gap}))
    inside, samples = (found.run.t >= gap[0, 0]) & (found.run.t <= gap[0, 1]), samples_of(found)
    assert not (samples.payout | samples.driven)[inside].any()
    assert (samples.payout == whole.payout)[~inside].all()


def test_of_a_long_log_the_first_complete_cycles_are_compared() -> None:
    run = reduced("18 ohm").run
    span = float(run.t[-1] - run.t[0]) + 1.0 / run.fs
    t = np.concatenate([run.t + k * span for k in range(5)])
    channels = {name: np.tile(x, 5) for name, x in run.channels.items()}
    long = reduce(msgspec.structs.replace(run, t=t, channels=channels, samples=t.size), window=5.96)
    found = compared(long)
    assert [c.cycle for c in found.cycles] == [c.cycle for c in long.complete[: len(found.cycles)]]
    assert 3 <= len(found.cycles) < len(long.complete)
    assert found.run.t[-1] - found.run.t[0] <= (LONGEST + 0.5) * scale_of(found.run).time


# ------------------------------------------------------------------------------------- the curves
def binned_over(rows: list[int], x: Signal, y: Signal, least: float = 0.0) -> Signal:
    """Means of y in bins of x, one sample after the other."""
    width = max(least, float(np.ptp(x[rows])) / BINS)
    return np.array([*binned(rows, x, y, width, MIN_BIN_SAMPLES).values()])


@pytest.mark.parametrize("side", [0, 1])
def test_curves_are_means_of_the_samples_of_a_bin_or_ratios_of_these(side: int) -> None:
    """P_mech and P_gen are without what rotor, shaft and capacitor store, with the numbers of
    the paper's rig.
    """
    c, curves = comparison(), account().curves
    run = (c.run, c.simulation.run)[side]
    x, v, z = run.channels, c.run.channels["velocity"], c.run.channels["displacement"]
    stored = stored_powers(run, built_in(), np.arange(run.t.size))
    taken = x["torque"] * v / 0.13 - stored["rotor"] - stored["spring"]
    power = x["vdc"] * x["idc"]
    out, back = (
        np.flatnonzero(getattr(samples_of(c), name)).tolist() for name in ("payout", "haul_in")
    )
    rows, rpm = before_braking(c), v / 0.13 * 50.0 * 30.0 / math.pi
    mech, gen, vdc, idc = (
        binned_over(rows, rpm, y, 100.0)
        for y in (taken, power + stored["capacitor"], x["vdc"], x["idc"])
    )
    expected = {
        "torque_nm": binned_over(rows, rpm, x["torque"], 100.0),
        "power_gen_w": binned_over(rows, rpm, power, 100.0),
        "loss_w": mech - gen, "vdc_v": vdc, "idc_a": idc,
        "eta_gen": (gen / mech)[mech > 0.02 * mech.max()],
        "resistance_ohm": (vdc / idc)[idc > 0.02 * idc.max()],
        "pressure_kgcm2": binned_over(out, z, x["pressure"] / KGCM2),
        HAUL_IN: binned_over(back, z, x["pressure"] / KGCM2),
        "force_n": binned_over(sorted({*rows, *back}), v, x["force"]),
    }  # fmt: skip
    assert set(expected) == set(CURVES)
    for name, values in expected.items():
        assert (curves[name].log, curves[name].simulated)[side] == pytest.approx(
            list(values), rel=KEPT
        ), name
    assert curves["torque_nm"].x == pytest.approx(
        list(binned_over(rows, rpm, rpm, 100.0)), rel=KEPT
    )


def test_differences_are_log_minus_simulation_and_an_open_circuit_has_none_that_needs_a_current() -> (
    None
):
    found = account("open circuit")
    assert set(found.curves) == {"pressure_kgcm2", HAUL_IN, "force_n", "vdc_v"}
    assert set(found.differences) == {"vdc", "pressure", "force"}
    assert found.budget is not None
    assert set(found.budget.log) == {"line"}
    c, payout = comparison(), samples_of(comparison()).payout
    for name, one in account().differences.items():
        unit = KGCM2 if name == "pressure" else 1.0
        apart = (c.run.channels[name] - c.simulation.run.channels[name])[payout] / unit
        assert (one.bias, one.rms) == pytest.approx(
            (apart.mean(), math.sqrt((apart @ apart) / apart.size))
        )


@pytest.mark.parametrize("name", LOGS)
def test_what_is_kept_is_small_and_comes_back_from_json(name: str) -> None:
    content = msgspec.json.encode(account(name))
    assert len(content) < SMALL
    assert msgspec.json.decode(content, type=Account) == account(name)


# -------------------------------------------------------------------------------- the loss budget
@pytest.mark.parametrize("name", LOGS)
def test_the_loss_budget_sums_to_the_lines_energy(name: str) -> None:
    budget = account(name).budget
    assert budget is not None
    assert sum(budget.shares.values()) == pytest.approx(1.0, abs=WHOLE)
    assert min(budget.shares.values()) > -1e-9


def energy(c: SimulatedLog, watt: Signal) -> float:
    """Mean energy over the windows from the samples, their ends between samples. [J]"""
    t, joules = c.run.t, []
    for cycle in c.cycles:
        begin, end = cycle.window.onset, cycle.window.cutoff
        stamps = np.array([begin, *t[(t > begin) & (t < end)], end])
        joules.append(float(np.trapezoid(np.interp(stamps, t, watt), stamps)))
    return float(np.mean(joules))


def test_the_parts_of_the_budget_are_the_powers_of_the_simulation() -> None:
    c, budget = comparison(), account().budget
    assert budget is not None
    sim = c.simulation
    x, omega, v = sim.run.channels, sim.rpm_gen * math.pi / 30.0, c.run.channels["velocity"]
    expected = {
        "DC link": x["vdc"] * x["idc"],
        "copper": 3.0 * 0.61 * sim.i_s**2,
        "damper": 7.5e-4 * omega**2,
        "mesh": 0.05 * x["torque"] * omega / 50.0,
    }
    for name, watt in expected.items():
        assert budget.groups[name] == pytest.approx(
            energy(c, watt), abs=BY_SAMPLES * budget.line
        ), name
    assert budget.line == pytest.approx(energy(c, x["force"] * v), rel=2 * BY_SAMPLES)
    assert budget.mech == pytest.approx(energy(c, x["torque"] * v / 0.13), rel=2 * BY_SAMPLES)
    assert budget.log["mech"] == pytest.approx(
        energy(c, c.run.channels["torque"] * v / 0.13), rel=2 * BY_SAMPLES
    )
    ends = [cycle.window.cutoff for cycle in c.cycles]
    v_end, omega_end = np.interp(ends, c.run.t, v), np.interp(ends, c.run.t, omega)
    drum, rotor = np.mean(0.5 * 0.3 * (v_end / 0.13) ** 2), np.mean(0.5 * 626e-6 * omega_end**2)
    assert budget.groups["inertia"] == pytest.approx(drum + rotor, rel=0.02)
