"""The budget is that of GTC, which carries uncertain numbers through formulas; draws and intervals are those of known laws."""

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import GTC
import msgspec
import numpy as np
import pytest
from equal_cycles import LENGTH, amplified, cycles_of, run_of
from numpy.typing import NDArray
from rigs import by_limits
from scipy.stats import t as student

from winchcascade.core.accuracy import error_sources, part_uncertainty
from winchcascade.core.cascade import BUILT_IN, Cascade, Power, Stage, Term
from winchcascade.core.cascade import PAPER as CASCADE
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig, Sensor, WindowRule
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.nuisances import sensor_errors
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import METRICS, Metrics
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import reduction_json
from winchcascade.reduction.uncertainty import DRAWS, Budget, budget, uncertainty

Signal = NDArray[np.float64]
Uncertain = Any
"""An uncertain number of GTC, which has no types."""

LOGS = Path(__file__).parents[2] / "fixtures"
R36 = LOGS / "campaign" / "r36ohm.csv"
COLUMNS = ("t", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")
R_DRUM = 0.13

LIMITS = {
    ("force", "zero"): 0.002 * 2000 * 9.80665, ("torque", "zero"): 0.002 * 500, ("vdc", "gain"): 0.005, ("idc", "gain"): 0.005,
}  # fmt: skip
"""Limits of the errors in SI units: Table 1's 0.2 % of 2000 kgf and of 500 N m, and 0.5 % of a reading."""

VELOCITY = Sensor("m/s", high=2.0, accuracy_full_scale=0.005, accuracy_reading=0.005)
WITH_VELOCITY = LIMITS | {("velocity", "zero"): 0.01, ("velocity", "gain"): 0.005}
"""The same with an error that line and shaft share: 0.5 % of 2 m/s and of the reading."""

CASES: tuple[tuple[WindowRule, bool], ...] = ((5.48, False), ("auto", False), (5.48, True))
"""Window, and whether the velocity has an error: windows of one length and of several, errors of one stage and of two."""

ROUNDING, FREEDOM_ROUNDING = 1e-9, 1e-6
"""Both sides evaluate the same derivatives; degrees of freedom go with the fourth power of a difference of large numbers."""

LINEAR = 0.02
"""Standard uncertainties of budget and draws differ by no more on a rig whose errors are small."""

QUANTILE = 0.01
"""Error of an end of an interval, in widths of it."""

LIMITED = by_limits(built_in())
"""The paper's rig without calibrations in place."""


def rig_with(**sensors: Sensor | None) -> Rig:
    """Give the paper's rig, by the makers' limits, other sensors, or none for a channel."""
    mixed = {name: s for name, s in (dict(LIMITED.sensors) | sensors).items() if s is not None}
    return msgspec.structs.replace(LIMITED, sensors=mixed)


@cache
def run36() -> Run:
    return read_run(R36, load=36.0)


def channels_of_run36(**changed: Signal | None) -> Run:
    """Give the log other channels, or take one away."""
    mixed = {name: x for name, x in (dict(run36().channels) | changed).items() if x is not None}
    return msgspec.structs.replace(run36(), channels=mixed)


@cache
def reduced(window: WindowRule = 5.48, moving: bool = False) -> Reduction:
    return reduce(run36(), rig=rig_with(velocity=VELOCITY) if moving else LIMITED, window=window)


def none_of(part: Mapping[str, float | None]) -> set[str]:
    return {m for m in METRICS if part[m] is None}


# ------------------------------------------------------------------------------------------------ agreement with GTC
def area(t: Signal, x: Signal, begin: float, end: float) -> float:
    """Integrate by trapezia between two interpolated ends."""
    inside = (t > begin) & (t < end)
    t_in = np.concatenate(([begin], t[inside], [end]))
    return float(np.trapezoid(np.interp(t_in, t, x), t_in))


def metrics_of(errors: dict[tuple[str, str], Uncertain], begin: float, end: float) -> dict[str, Uncertain]:
    """Metrics of one window of the raw log for uncertain errors: (reading - zero) / (1 + gain) multiplied out."""
    log = dict(zip(COLUMNS, np.loadtxt(R36, delimiter=",", skiprows=1).T, strict=True))
    t, energy = log["t"], {}
    for stage, pair in {"line": ("force", "velocity"), "mech": ("torque", "velocity"), "gen": ("vdc", "idc")}.items():
        x, y = (log[name] for name in pair)
        zero_x, zero_y = (errors.get((name, "zero"), 0.0) for name in pair)
        gain_x, gain_y = (errors.get((name, "gain"), 0.0) for name in pair)
        whole = area(t, x * y, begin, end) - zero_x * area(t, y, begin, end) - zero_y * area(t, x, begin, end)
        energy[stage] = (whole + zero_x * zero_y * (end - begin)) / ((1.0 + gain_x) * (1.0 + gain_y))
    energy["mech"] = energy["mech"] / R_DRUM
    ratios = {m: energy[out[7:]] / energy[into[7:]] for m, (out, into) in CASCADE.ratios.items()}
    powers = {f"power_{stage}": joules / (end - begin) for stage, joules in energy.items()}
    return {f"energy_{stage}": joules for stage, joules in energy.items()} | powers | ratios


@cache
def known(window: WindowRule = 5.48, moving: bool = False) -> Budget:
    return budget(reduced(window, moving))


@pytest.mark.parametrize(("window", "moving"), CASES)
def test_cycles_means_rows_and_freedom_are_those_of_gtc(window: WindowRule, moving: bool) -> None:
    limits, ours = WITH_VELOCITY if moving else LIMITS, known(window, moving)
    errors = {key: GTC.ureal(0.0, limit / math.sqrt(3.0)) for key, limit in limits.items()}
    spans = [(c.window.onset, c.window.cutoff) for c in reduced(window, moving).cycles]
    cycles = [metrics_of(errors, begin, end) for begin, end in spans]
    rows: dict[tuple[str, str], Metrics] = {}
    rows |= {(row.source.channel, row.source.part): row.of for row in ours.rows if row.source is not None}
    assert set(rows) == set(errors)
    assert len(rows) == len(ours.rows)
    for m in METRICS:
        sensors = sum(c[m] for c in cycles) / len(cycles)
        scatter = GTC.type_a.estimate([GTC.value(c[m]) for c in cycles])
        mean = sensors + (scatter - GTC.value(scatter))
        found = [c.value(m) for c in ours.cycles]
        assert found == pytest.approx([GTC.uncertainty(c[m]) for c in cycles], rel=ROUNDING)
        assert ours.sensors[m] == pytest.approx(GTC.uncertainty(sensors), rel=ROUNDING)
        assert ours.mean[m] == pytest.approx(GTC.uncertainty(mean), rel=ROUNDING)
        assert ours.freedom[m] == pytest.approx(GTC.dof(mean), rel=FREEDOM_ROUNDING)
        unrelated = ROUNDING * ours.sensors.value(m)
        parts = [GTC.component(sensors, error) for error in errors.values()]
        assert [rows[key][m] for key in errors] == pytest.approx(np.abs(parts), rel=ROUNDING, abs=unrelated)


# ------------------------------------------------------------------------------------------------ errors of a sensor
THIRD, IN = math.sqrt(3.0), "calibration_in_place"
STATED: dict[str, tuple[dict[str, float], list[tuple[str, float, str]]]] = {
    "full scale": ({"high": 20000.0, "accuracy_full_scale": 0.002}, [("zero", 40 / THIRD, "limits")]),
    "both ways": ({"low": -800.0, "high": 100.0, "accuracy_full_scale": 0.01}, [("zero", 8 / THIRD, "limits")]),
    "reading": ({"high": 600.0, "accuracy_reading": 0.005}, [("gain", 0.005 / THIRD, "limits")]),
    "reading and absolute": (
        {"accuracy_reading": 0.005, "accuracy": 0.2}, [("zero", 0.2 / THIRD, "limits"), ("gain", 0.005 / THIRD, "limits")],
    ),
    "expanded": ({"high": 100.0, "accuracy_full_scale": 0.01, "coverage": 2.0}, [("zero", 0.5, "expanded_uncertainty")]),
    "acquired": (
        {"high": 100.0, "accuracy_full_scale": 0.001, "coverage": 2.0, "daq_reading": 0.0003, "daq_full_scale": 0.0002},
        [("zero", 0.05, "expanded_uncertainty"), ("zero", 0.02 / THIRD, "limits"), ("gain", 0.0003 / THIRD, "limits")],
    ),
    "in place": (
        {"high": 100.0, "accuracy_full_scale": 0.1, "daq_reading": 0.1, "u_zero": 3.0, "u_gain": 0.1},
        [("zero", 3.0, IN), ("gain", 0.1, IN)],
    ),
    "zero in place": (
        {"high": 20000.0, "accuracy_full_scale": 0.002, "accuracy_reading": 0.005, "u_zero": 3.0},
        [("zero", 3.0, IN), ("gain", 0.007 / THIRD, "limits")],
    ),
    "exact zero": ({"accuracy": 30.0, "u_zero": 0.0, "u_gain": 0.1}, [("gain", 0.1, IN)]),
    "nothing": ({"high": 20.0, "resolution": 0.1, "accuracy": 0.0}, []),
}  # fmt: skip


@pytest.mark.parametrize("kind", STATED)
def test_what_a_rig_file_states_of_a_sensor_makes_errors_of_zero_and_gain(kind: str) -> None:
    stated, expected = STATED[kind]
    sensor = msgspec.convert({"unit": "N", **stated}, Sensor)
    found = error_sources("force", sensor)
    assert [(s.part, s.basis) for s in found] == [(part, basis) for part, _, basis in expected]
    assert [s.u for s in found] == pytest.approx([u for _, u, _ in expected])
    assert [s.limit for s in found] == [pytest.approx(s.u * THIRD) if s.basis == "limits" else None for s in found]
    both = tuple(part_uncertainty(sensor, part) for part in ("gain", "zero"))
    assert sensor_errors(sensor) == both == pytest.approx([math.hypot(*(u for p, u, _ in expected if p == part))
                                                           for part in ("gain", "zero")])  # fmt: skip


# ------------------------------------------------------------------------------------------------ laws of the budget
RADIUS_ACTS_ON = {
    "drum": {"energy_line", "power_line", "eta_trans", "eta_pto"},
    "line": {"energy_mech", "power_mech", "eta_trans", "eta_gen"},
}
"""Metrics that an error of the drum radius changes, by where the motion is measured: of E = F v t with v = r omega, of
E = tau v t / r with v measured on the line."""


@pytest.mark.parametrize("motion", RADIUS_ACTS_ON)
@pytest.mark.parametrize("rectangular", [True, False])
def test_an_error_of_the_drum_radius_acts_on_what_the_motion_needs_it_for(motion: str, rectangular: bool) -> None:
    radius = Quantity(1.0, "m", "by hand", 0.01, rectangular=rectangular)
    winch = msgspec.structs.replace(built_in().winch, r_drum=radius, motion=motion)
    exact = {name: Sensor(s.unit, u_gain=1e-9) for name, s in built_in().sensors.items()}
    rig = msgspec.structs.replace(built_in(), winch=winch, sensors=exact)
    run = channels_of_run36(torque=run36().channels["torque"] / R_DRUM)
    reduction = reduce(run, rig=rig, window=5.48, cycles=(1, 1))
    found = uncertainty(reduction)
    (row,) = (r for r in found.budget.rows if r.source is not None and r.source.channel == "r_drum")
    assert row.source is not None
    assert row.source.shape == ("rectangular" if rectangular else "normal")
    assert row.source.u == pytest.approx(0.01)
    for m in METRICS:
        expected = 0.01 * reduction.mean.value(m) if m in RADIUS_ACTS_ON[motion] else 0.0
        assert row.of[m] == pytest.approx(expected, rel=ROUNDING), m
        assert found.drawn[m] == pytest.approx(expected, rel=0.01, abs=1e-6 * reduction.mean.value(m))


def test_what_a_channel_without_accuracy_measures_has_no_uncertainty() -> None:
    needs_force = {"energy_line", "power_line", "eta_trans", "eta_pto"}
    for sensor in (None, Sensor("N", high=20000.0)):
        found = uncertainty(reduce(run36(), rig=rig_with(force=sensor), window=5.48))
        of = found.budget
        assert (of.unknown, of.exact) == (("force",), ("velocity",))
        assert all(
            none_of(part) == needs_force for part in (of.mean, of.sensors, of.freedom, found.standard, *of.cycles)
        )
        assert not needs_force & {*found.interval_95, *found.method}
        assert of.mean.eta_gen == pytest.approx(known().mean.eta_gen, rel=ROUNDING)
    assert known(5.48, True).exact == ()


def test_without_cycles_or_with_one_only_what_is_known_is_stated() -> None:
    one = budget(reduce(run36(), rig=LIMITED, window=5.48, cycles=(2, 2)))
    assert one.mean == one.sensors == pytest.approx(one.cycles[0])
    assert none_of(one.repeatability) == set(METRICS)
    assert set(one.freedom.values()) == {math.inf}
    still = np.zeros_like(run36().t)
    none = uncertainty(reduce(channels_of_run36(velocity=still, displacement=still)))
    assert (none.budget.cycles, dict(none.interval_95), dict(none.method)) == ((), {}, {})
    hold = msgspec.structs.replace(built_in().thresholds, plateau_hold=100.0)  # which no payout reaches
    never = uncertainty(reduce(run36(), rig=msgspec.structs.replace(built_in(), thresholds=hold), window="auto"))
    assert (none_of(never.budget.mean), dict(never.interval_95)) == (set(METRICS), {})


def test_the_errors_of_a_power_that_is_a_sum_change_it_as_a_log_that_is_read_too_high() -> None:
    power = Power((Term(("vdc", "idc")), Term(("idc",), constant=60.0), Term((), constant=-5.0)))
    cascade = Cascade((BUILT_IN["line"], Stage("own", (power,))), configured=True)
    rig = msgspec.structs.replace(
        rig_with(vdc=Sensor("V", accuracy=0.5), idc=Sensor("A", accuracy_reading=0.01)), cascade=cascade
    )
    plain = reduce(run36(), rig=rig, window=5.48)
    rows = [
        (row.source, row.of) for row in budget(plain).rows if row.source is not None and row.source.channel != "force"
    ]
    assert {source.channel for source, _ in rows} == {"vdc", "idc"}
    for source, of in rows:
        x = run36().channels[source.channel]
        true = x / (1.0 + source.u) if source.part == "gain" else x - source.u
        changed = reduce(channels_of_run36(**{source.channel: true}), rig=rig, window=5.48)
        for m in ("energy_own", "power_own", "eta_line_own"):
            assert of[m] == pytest.approx(plain.mean.value(m) - changed.mean.value(m), rel=source.u + 1e-6)


def test_bridged_gaps_have_one_row_without_a_source() -> None:
    reduction = reduce(read_run(LOGS / "damaged_logs" / "dropouts.csv"), window=5.48)
    found = budget(reduction)
    (row,) = (r.of for r in found.rows if r.source is None)
    for stage, joules in reduction.bridged.items():
        counted = [joule for joule, c in zip(joules, reduction.cycles, strict=True) if c.complete]
        expected = math.hypot(*counted) / math.sqrt(3.0) / len(counted)  # rectangular, independent of each other
        assert row[f"energy_{stage}"] == pytest.approx(expected, rel=ROUNDING)
    up, down = row.value("energy_mech") / reduction.mean.value("energy_mech"), row.value("energy_line")
    both = math.hypot(up, down / reduction.mean.value("energy_line")) * reduction.mean.value("eta_trans")
    assert row.eta_trans == pytest.approx(both, rel=0.1)  # the cycles are nearly alike
    for m in METRICS:
        assert found.sensors[m] == pytest.approx(math.hypot(*(r.of.value(m) for r in found.rows)), rel=ROUNDING)


# ------------------------------------------------------------------------------------------------ draws and intervals
@pytest.mark.parametrize("name", ["campaign/r36ohm.csv", "damaged_logs/dropouts.csv", "damaged_logs/aborted.csv"])
def test_the_draws_confirm_the_budget_and_repeat_with_the_seed(name: str) -> None:
    reduction = reduce(read_run(LOGS / name))
    found, other = uncertainty(reduction), uncertainty(reduction, seed=7)
    assert uncertainty(reduction) == found != other
    assert (found.draws, other.seed) == (DRAWS, 7)
    assert set(found.method.values()) == {"gum"}
    for m in METRICS:
        assert found.drawn[m] == pytest.approx(found.budget.mean[m], rel=LINEAR)
        assert found.standard[m] == found.budget.mean[m]
        whole, alone = found.interval_95[m], found.interval_95_sensors[m]
        near = 3.0 * QUANTILE * (alone.high - alone.low)
        assert whole.low - near < alone.low < reduction.mean.value(m) < alone.high < whole.high + near
        assert other.interval_95_sensors[m] == pytest.approx(alone, abs=near)


def one_error(limit: float) -> Rig:
    """Give the paper's rig a force cell whose zero may be wrong by a limit [N], and otherwise perfect sensors."""
    sensors = {name: Sensor(unit, u_gain=1e-9) for name, unit in (("torque", "N.m"), ("vdc", "V"), ("idc", "A"))}
    return msgspec.structs.replace(built_in(), sensors=sensors | {"force": Sensor("N", accuracy=limit)})


def mean_force(reduction: Reduction) -> Signal:
    """Force by which the line energy of each cycle divides into its travel [N]: a zero error is a share of it."""
    t, v, force = reduction.run.t, reduction.run.channels["velocity"], reduction.run.channels["force"]
    spans = [(c.window.onset, c.window.cutoff) for c in reduction.cycles]
    return np.array([area(t, force * v, *span) / area(t, v, *span) for span in spans])


@pytest.mark.parametrize("share", [0.005, 0.5])
def test_one_rectangular_error_gives_the_interval_and_the_uncertainty_of_its_closed_form(share: float) -> None:
    """The energy is linear in the zero, an efficiency goes with 1 / (1 - x), x even in (-share, share)."""
    t, channels = cycles_of(3)
    limit = share * float(mean_force(reduce(run_of(t, channels), window=LENGTH))[0])
    reduction = reduce(run_of(t, channels), rig=one_error(limit), window=LENGTH)
    found, energy = uncertainty(reduction), reduction.mean.value("energy_line")
    ends = (energy * (1.0 - 0.95 * share), energy * (1.0 + 0.95 * share))
    assert found.interval_95_sensors["energy_line"] == pytest.approx(ends, abs=QUANTILE * np.ptp(ends))
    assert found.standard.energy_line == pytest.approx(energy * share / math.sqrt(3.0), rel=1e-6)
    square = 1.0 / (1.0 - share**2) - (math.atanh(share) / share) ** 2
    for m in ("eta_trans", "eta_pto"):
        eta = reduction.mean.value(m)
        ends = (eta / (1.0 + 0.95 * share), eta / (1.0 - 0.95 * share))
        assert found.interval_95_sensors[m] == pytest.approx(ends, abs=2.0 * QUANTILE * np.ptp(ends))
        assert found.standard[m] == pytest.approx(eta * math.sqrt(square), rel=LINEAR)
        assert found.method[m] == ("monte_carlo" if share > 0.1 else "gum")
    assert found.method["eta_gen"] == "gum"


def test_an_error_of_the_size_of_what_is_divided_by_leaves_no_uncertainty() -> None:
    t, channels = cycles_of(3)
    limit = 1.1 * float(mean_force(reduce(run_of(t, channels), window=LENGTH))[0])
    found = budget(reduce(run_of(t, channels), rig=one_error(limit), window=LENGTH))
    assert set(found.undetermined) == none_of(found.mean) == {"eta_trans", "eta_pto"}


def test_the_json_states_the_budget_of_the_means() -> None:
    record, found = json.loads(reduction_json(reduced())), uncertainty(reduced())
    assert record["standard_uncertainty"]["eta_pto"] == found.standard.eta_pto
    assert record["interval_95"]["eta_pto"] == [*found.interval_95["eta_pto"]]
    (row,) = (r for r in record["uncertainty"]["budget"] if r["source"] == "force")
    assert (row["part"], row["unit"], row["basis"], row["distribution"]) == ("zero", "N", "limits", "rectangular")
    assert row["limit"] == pytest.approx(LIMITS["force", "zero"])
    share = (row["contribution"]["eta_trans"] / found.budget.mean.value("eta_trans")) ** 2
    assert row["share"]["eta_trans"] == pytest.approx(share)


@pytest.mark.parametrize("n", [3, 8])
def test_cycles_that_scatter_give_the_interval_of_student(n: int) -> None:
    t, channels = cycles_of(n)
    channels = amplified(channels, {"force": np.linspace(0.9, 1.1, n)})
    reduction = reduce(run_of(t, channels), rig=one_error(1e-6), window=LENGTH)
    energies = [c.metrics.value("energy_line") for c in reduction.cycles]
    ends = student.interval(0.95, n - 1, np.mean(energies), np.std(energies, ddof=1) / math.sqrt(n))
    assert uncertainty(reduction).interval_95["energy_line"] == pytest.approx(ends, abs=2.0 * QUANTILE * np.ptp(ends))


def test_many_unlike_cycles_have_the_interval_of_the_mean_of_their_ratios() -> None:
    n = 320
    t, channels = cycles_of(n)
    pulled = 1.0 + 0.15 * np.arange(n) / n + 0.1 * (np.arange(n) % 2)  # drifts, and every other cycle pulls harder
    reduction = reduce(run_of(t, amplified(channels, {"force": pulled})), rig=one_error(100.0), window=LENGTH)
    found, share = uncertainty(reduction).interval_95_sensors, 95.0 / mean_force(reduction)
    for m in ("eta_trans", "eta_pto"):
        eta = np.array([c.metrics.value(m) for c in reduction.cycles])
        ends = (float(np.mean(eta / (1 + share))), float(np.mean(eta / (1 - share))))
        assert found[m] == pytest.approx(ends, abs=QUANTILE * np.ptp(ends))


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.0, 0.01])
def test_intervals_hold_the_truth_as_often_as_they_say(scatter: float) -> None:
    """200 times three cycles, equal or with lognormal amplitudes, whose inverses have the mean exp(s^2)."""
    (t, channels), rng, held = cycles_of(3), np.random.default_rng(2026), dict.fromkeys(METRICS, 0)
    true = reduce(run_of(t, channels), window=LENGTH).mean
    inverse = math.exp(scatter**2)
    for seed in range(200):
        factors = {name: np.exp(rng.normal(-0.5 * scatter**2, scatter, 3)) for name in ("force", "torque", "idc")}
        drawn = {key: rng.uniform(-limit, limit) for key, limit in LIMITS.items()}
        read = {
            name: (1.0 + drawn.get((name, "gain"), 0.0)) * x + drawn.get((name, "zero"), 0.0)
            for name, x in amplified(channels, factors).items()
        }
        found = uncertainty(reduce(run_of(t, read), rig=LIMITED, window=LENGTH), seed=seed)
        for m in METRICS:
            low, high = found.interval_95[m]
            held[m] += low <= true.value(m) * (inverse if m.startswith("eta") else 1.0) <= high
    # 95 % of 200; Student's draws of few cycles whose scatter decides hold up to 97.5 %.
    assert all(0.91 <= count / 200 <= 0.99 for count in held.values()), held
