"""The budget is that of GTC, which carries uncertain numbers through formulas; intervals are
those of Student.
"""

import math
from functools import cache
from pathlib import Path
from typing import Any

import GTC
import msgspec
import numpy as np
import pytest
from equal_cycles import LENGTH, amplified, cycles_of, run_of
from numpy.typing import NDArray
from scipy.stats import t as student

from winchcascade.core.accuracy import NORMAL, error_sources, part_uncertainty
from winchcascade.core.accuracy import student as quantile
from winchcascade.core.cascade import BUILT_IN, Cascade, Power, Stage, Term
from winchcascade.core.cascade import PAPER as CASCADE
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig, Sensor, WindowRule
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.fit.nuisances import sensor_errors
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import METRICS, Metrics
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import budget, uncertainty

Signal = NDArray[np.float64]
Uncertain = Any
"""An uncertain number of GTC, which has no types."""

LOGS = Path(__file__).parents[2] / "fixtures"
R36 = LOGS / "campaign" / "r36ohm.csv"
COLUMNS = ("t", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")
R_DRUM = 0.13

LIMITS = {
    ("force", "zero"): 0.002 * 2000 * 9.80665, ("torque", "zero"): 0.002 * 500,
    ("vdc", "zero"): 0.1, ("vdc", "gain"): 0.005, ("idc", "zero"): 0.01, ("idc", "gain"): 0.005,
}  # fmt: skip
"""Limits of the errors in SI units: Table 1's 0.2 % of 2000 kgf and of 500 N m, and what is
assumed of Vdc and Idc.
"""

VELOCITY = Sensor("m/s", high=2.0, accuracy_full_scale=0.005, accuracy_reading=0.005)
WITH_VELOCITY = LIMITS | {("velocity", "zero"): 0.01, ("velocity", "gain"): 0.005}
"""The same with an error that line and shaft share: 0.5 % of 2 m/s and of the reading."""

ROUNDING, QUANTILE = 1e-9, 2e-4
"""Two evaluations of the same derivatives; the quantile of Student's distribution."""

LIMITED = built_in()
"""The paper's rig, which states the limits of the makers."""


def rig_with(**sensors: Sensor) -> Rig:
    """Give the paper's rig, by the makers' limits, other sensors."""
    return msgspec.structs.replace(LIMITED, sensors=dict(LIMITED.sensors) | sensors)


@cache
def run36() -> Run:
    return read_run(R36, load=36.0)


def channels_of_run36(**changed: Signal) -> Run:
    """Give the log other channels."""
    return msgspec.structs.replace(run36(), channels=dict(run36().channels) | changed)


def untimed(reduction: Reduction) -> Reduction:
    """The reduction of a log whose channels are known to be recorded at one time."""
    return msgspec.structs.replace(reduction, relations=())


def none_of(part: Metrics) -> set[str]:
    return {m for m in METRICS if part[m] is None}


def area(t: Signal, x: Signal, begin: float, end: float) -> float:
    """Integrate by trapezia between two interpolated ends."""
    inside = (t > begin) & (t < end)
    t_in = np.concatenate(([begin], t[inside], [end]))
    return float(np.trapezoid(np.interp(t_in, t, x), t_in))


def metrics_of(
    errors: dict[tuple[str, str], Uncertain], begin: float, end: float
) -> dict[str, Uncertain]:
    """Metrics of one window of the raw log for uncertain errors: (reading - zero) / (1 + gain)
    multiplied out.
    """
    log = dict(zip(COLUMNS, np.loadtxt(R36, delimiter=",", skiprows=1).T, strict=True))
    t, energy = log["t"], {}
    for stage, pair in {
        "line": ("force", "velocity"),
        "mech": ("torque", "velocity"),
        "gen": ("vdc", "idc"),
    }.items():
        x, y = (log[name] for name in pair)
        zero_x, zero_y = (errors.get((name, "zero"), 0.0) for name in pair)
        gain_x, gain_y = (errors.get((name, "gain"), 0.0) for name in pair)
        whole = (
            area(t, x * y, begin, end)
            - zero_x * area(t, y, begin, end)
            - zero_y * area(t, x, begin, end)
        )
        energy[stage] = (whole + zero_x * zero_y * (end - begin)) / (
            (1.0 + gain_x) * (1.0 + gain_y)
        )
    energy["mech"] = energy["mech"] / R_DRUM
    ratios = {m: energy[out[7:]] / energy[into[7:]] for m, (out, into) in CASCADE.ratios.items()}
    powers = {f"power_{stage}": joules / (end - begin) for stage, joules in energy.items()}
    return {f"energy_{stage}": joules for stage, joules in energy.items()} | powers | ratios


@pytest.mark.parametrize(("window", "moving"), [(5.48, True), ("auto", False)])
def test_cycles_means_rows_and_freedom_are_those_of_gtc(window: WindowRule, moving: bool) -> None:
    """Windows of one length and of several, errors of one stage and one that two stages share."""
    reduction = untimed(
        reduce(run36(), rig=rig_with(velocity=VELOCITY) if moving else LIMITED, window=window)
    )
    limits, ours = WITH_VELOCITY if moving else LIMITS, budget(reduction)
    errors = {key: GTC.ureal(0.0, limit / math.sqrt(3.0)) for key, limit in limits.items()}
    spans = [(c.window.onset, c.window.cutoff) for c in reduction.cycles]
    cycles = [metrics_of(errors, begin, end) for begin, end in spans]
    rows = {
        (row.source.channel, str(row.source.part)): row.of
        for row in ours.rows
        if row.source is not None
    }
    assert (set(rows), len(rows)) == (set(errors), len(ours.rows))
    for m in METRICS:
        sensors = sum(c[m] for c in cycles) / len(cycles)
        scatter = GTC.type_a.estimate([GTC.value(c[m]) for c in cycles])
        mean = sensors + (scatter - GTC.value(scatter))
        found = [c.value(m) for c in ours.cycles]
        assert found == pytest.approx([GTC.uncertainty(c[m]) for c in cycles], rel=ROUNDING)
        assert ours.sensors[m] == pytest.approx(GTC.uncertainty(sensors), rel=ROUNDING)
        assert ours.mean[m] == pytest.approx(GTC.uncertainty(mean), rel=ROUNDING)
        assert ours.freedom[m] == pytest.approx(GTC.dof(mean), rel=1e3 * ROUNDING)  # a fourth power
        unrelated = ROUNDING * ours.sensors.value(m)
        parts = [GTC.component(sensors, error) for error in errors.values()]
        assert [rows[key][m] for key in errors] == pytest.approx(
            np.abs(parts), rel=ROUNDING, abs=unrelated
        )


THIRD, IN = math.sqrt(3.0), "calibration_in_place"
STATED: dict[str, tuple[dict[str, float], list[tuple[str, float, str]]]] = {
    "both ways, absolute and of the reading": (
        {"low": -800.0, "high": 100.0, "accuracy_full_scale": 0.01, "accuracy": 0.2, "accuracy_reading": 0.005},
        [("zero", 8.2 / THIRD, "limits"), ("gain", 0.005 / THIRD, "limits")],
    ),
    "expanded and acquired": (
        {"high": 100.0, "accuracy_full_scale": 0.001, "coverage": 2.0, "daq_reading": 0.0003, "daq_full_scale": 0.0002},
        [("zero", 0.05, "expanded_uncertainty"), ("zero", 0.02 / THIRD, "limits"), ("gain", 0.0003 / THIRD, "limits")],
    ),
    "in place": ({"accuracy": 0.1, "u_zero": 3.0, "u_gain": 0.1}, [("zero", 3.0, IN), ("gain", 0.1, IN)]),
    "zero in place": (
        {"high": 20000.0, "accuracy_full_scale": 0.002, "accuracy_reading": 0.005, "u_zero": 3.0},
        [("zero", 3.0, IN), ("gain", 0.007 / THIRD, "limits")],
    ),
    "nothing": ({"high": 20.0, "resolution": 0.1, "accuracy": 0.0, "u_zero": 0.0}, []),
}  # fmt: skip


@pytest.mark.parametrize("kind", STATED)
def test_what_a_rig_file_states_of_a_sensor_makes_errors_of_zero_and_gain(kind: str) -> None:
    stated, expected = STATED[kind]
    sensor = msgspec.convert({"unit": "N", **stated}, Sensor)
    found = error_sources("force", sensor)
    assert [(s.part, s.basis) for s in found] == [(part, basis) for part, _, basis in expected]
    assert [s.u for s in found] == pytest.approx([u for _, u, _ in expected])
    assert [s.limit for s in found] == [
        pytest.approx(s.u * THIRD) if s.basis == "limits" else None for s in found
    ]
    gain, zero = (
        math.hypot(*(u for p, u, _ in expected if p == part)) for part in ("gain", "zero")
    )
    assert (part_uncertainty(sensor, "gain"), part_uncertainty(sensor, "zero")) == pytest.approx(
        (gain, zero)
    )
    in_the_fit = (
        gain
        if "u_zero" in stated or not sensor.full_scale
        else math.hypot(gain, zero / sensor.full_scale)
    )
    assert sensor_errors(sensor) == pytest.approx((in_the_fit, zero))


RADIUS_ACTS_ON = {"drum": {"energy_line", "power_line", "eta_trans", "eta_pto"},
                  "line": {"energy_mech", "power_mech", "eta_trans", "eta_gen"}}  # fmt: skip
"""Metrics that an error of the drum radius changes, by where the motion is measured: of E = F v t
with v = r omega, of E = tau v t / r with v measured on the line."""


@pytest.mark.parametrize("motion", RADIUS_ACTS_ON)
def test_an_error_of_the_drum_radius_acts_on_what_the_motion_needs_it_for(motion: str) -> None:
    radius = Quantity(1.0, "m", "by hand", 0.01, rectangular=motion == "drum")
    winch = msgspec.structs.replace(built_in().winch, r_drum=radius, motion=motion)
    exact = {name: Sensor(s.unit, u_gain=1e-9) for name, s in built_in().sensors.items()}
    rig = msgspec.structs.replace(built_in(), winch=winch, sensors=exact)
    run = channels_of_run36(torque=run36().channels["torque"] / R_DRUM)
    reduction = untimed(reduce(run, rig=rig, window=5.48, cycles=(1, 1)))
    found = uncertainty(reduction)
    (row,) = (r for r in found.budget.rows if r.source is not None and r.source.channel == "r_drum")
    assert row.source is not None
    assert row.source.shape == ("rectangular" if motion == "drum" else "normal")
    for m in METRICS:
        expected = 0.01 * reduction.mean.value(m) if m in RADIUS_ACTS_ON[motion] else 0.0
        assert row.of[m] == pytest.approx(expected, rel=ROUNDING), m


def test_what_is_not_known_has_no_uncertainty() -> None:
    needs_force = {"energy_line", "power_line", "eta_trans", "eta_pto"}
    found = uncertainty(reduce(run36(), rig=rig_with(force=Sensor("N", high=20000.0)), window=5.48))
    of = found.budget
    assert (of.unknown, of.exact) == (("force",), ("velocity",))
    assert all(
        none_of(part) == needs_force
        for part in (of.mean, of.sensors, of.freedom, found.standard, *of.cycles)
    )
    assert not needs_force & {*found.interval_95}
    one = budget(reduce(run36(), rig=LIMITED, window=5.48, cycles=(2, 2)))
    assert one.mean == one.sensors == pytest.approx(one.cycles[0])
    assert (none_of(one.repeatability), set(one.freedom.values())) == (set(METRICS), {math.inf})
    still = np.zeros_like(run36().t)
    none = uncertainty(reduce(channels_of_run36(velocity=still, displacement=still)))
    assert (none.budget.cycles, dict(none.interval_95)) == ((), {})


def test_the_errors_of_a_power_that_is_a_sum_change_it_as_a_log_that_is_read_too_high() -> None:
    power = Power((Term(("vdc", "idc")), Term(("idc",), constant=60.0), Term((), constant=-5.0)))
    cascade = Cascade((BUILT_IN["line"], Stage("own", (power,))), configured=True)
    rig = msgspec.structs.replace(
        rig_with(vdc=Sensor("V", accuracy=0.5), idc=Sensor("A", accuracy_reading=0.01)),
        cascade=cascade,
    )
    plain = untimed(reduce(run36(), rig=rig, window=5.48))
    rows = [
        (row.source, row.of)
        for row in budget(plain).rows
        if row.source is not None and row.source.channel != "force"
    ]
    assert {source.channel for source, _ in rows} == {"vdc", "idc"}
    for source, of in rows:
        x = run36().channels[source.channel]
        true = x / (1.0 + source.u) if source.part == "gain" else x - source.u
        changed = reduce(channels_of_run36(**{source.channel: true}), rig=rig, window=5.48)
        for m in ("energy_own", "power_own", "eta_line_own"):
            assert of[m] == pytest.approx(
                plain.mean.value(m) - changed.mean.value(m), rel=source.u + 1e-6
            )


def test_bridged_gaps_have_one_row_without_a_source() -> None:
    reduction = reduce(read_run(LOGS / "damaged_logs" / "dropouts.csv"), window=5.48)
    found = budget(reduction)
    (row,) = (r.of for r in found.rows if r.source is None)
    for stage, joules in reduction.bridged.items():
        counted = [joule for joule, c in zip(joules, reduction.cycles, strict=True) if c.complete]
        expected = (
            math.hypot(*counted) / math.sqrt(3.0) / len(counted)
        )  # rectangular, independent of each other
        assert row[f"energy_{stage}"] == pytest.approx(expected, rel=ROUNDING)
    for m in METRICS:
        assert found.sensors[m] == pytest.approx(
            math.hypot(*(r.of.value(m) for r in found.rows)), rel=ROUNDING
        )


@pytest.mark.parametrize(
    "name", ["campaign/r36ohm.csv", "damaged_logs/dropouts.csv", "damaged_logs/aborted.csv"]
)
def test_an_interval_is_student_s_with_the_degrees_of_freedom_of_the_budget(name: str) -> None:
    reduction = reduce(read_run(LOGS / name))
    found = uncertainty(reduction)
    assert found.standard == found.budget.mean
    for m in METRICS:
        mean, known = reduction.mean.value(m), found.budget
        ends = student.interval(0.95, known.freedom.value(m), mean, known.mean.value(m))
        assert found.interval_95[m] == pytest.approx(ends, rel=QUANTILE)
        alone = mean - NORMAL * known.sensors.value(m), mean + NORMAL * known.sensors.value(m)
        assert found.interval_95_sensors[m] == pytest.approx(alone, rel=ROUNDING)


def test_quantiles_of_student_are_those_of_scipy() -> None:
    for freedom in (1.0, 1.3, 2.0, 2.5, 7.7, 29.9, 30.0, 1e3, 1e9):
        assert quantile(freedom) == pytest.approx(student.ppf(0.975, freedom), rel=QUANTILE)


def with_one_error(n: int, limit: float, pulled: Signal | float = 1.0) -> tuple[Reduction, Signal]:
    """Cycles that differ in their force alone; the zero of the force cell may be wrong by a limit
    [N], nothing else. The second is the force by which the line energy of each cycle divides into
    its travel [N]: a zero error is a share of it.
    """
    t, channels = cycles_of(n)
    run = run_of(t, amplified(channels, {"force": np.broadcast_to(pulled, n)}))
    sensors = {
        name: Sensor(unit, u_gain=1e-9)
        for name, unit in (("torque", "N.m"), ("vdc", "V"), ("idc", "A"))
    }
    rig = msgspec.structs.replace(
        built_in(), sensors=sensors | {"force": Sensor("N", accuracy=limit)}
    )
    found = untimed(reduce(run, rig=rig, window=LENGTH))
    force, v, spans = (
        run.channels["force"],
        run.channels["velocity"],
        [(c.window.onset, c.window.cutoff) for c in found.cycles],
    )
    return found, np.array(
        [area(run.t, force * v, *span) / area(run.t, v, *span) for span in spans]
    )


MEAN_FORCE = float(with_one_error(3, 1.0)[1][0])


@pytest.mark.parametrize("share", [0.005, 0.5, 1.1])
def test_an_error_that_could_take_all_away_leaves_an_efficiency_undetermined(share: float) -> None:
    """The energy is linear in the zero, an efficiency goes with 1 / (1 - x), x even in (-share,
    share).
    """
    reduction, _ = with_one_error(3, share * MEAN_FORCE)
    found, energy = uncertainty(reduction), reduction.mean.value("energy_line")
    u = energy * share / math.sqrt(3.0)
    assert found.standard.energy_line == pytest.approx(u, rel=1e-6)
    assert found.interval_95_sensors["energy_line"] == pytest.approx(
        (energy - NORMAL * u, energy + NORMAL * u), rel=1e-6
    )
    undetermined = {"eta_trans", "eta_pto"} if share > 1.0 else set()
    assert set(found.budget.undetermined) == none_of(found.budget.mean) == undetermined
    assert undetermined.isdisjoint(found.interval_95)


@pytest.mark.parametrize("n", [3, 8])
def test_cycles_that_scatter_give_the_interval_of_student(n: int) -> None:
    reduction, _ = with_one_error(n, 1e-6, np.linspace(0.9, 1.1, n))
    energies = [c.metrics.value("energy_line") for c in reduction.cycles]
    ends = student.interval(0.95, n - 1, np.mean(energies), np.std(energies, ddof=1) / math.sqrt(n))
    assert uncertainty(reduction).interval_95["energy_line"] == pytest.approx(ends, rel=QUANTILE)
