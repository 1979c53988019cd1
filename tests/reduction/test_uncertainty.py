"""The budget agrees with GTC, which carries uncertain numbers through any formula by the GUM, and keeps its laws."""

import math
import statistics
from functools import cache
from pathlib import Path
from typing import Any

import GTC
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from rigs import by_limits

from winchcascade.core.accuracy import error_sources, part_uncertainty
from winchcascade.core.cascade import PAPER as CASCADE
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig, Sensor, WindowRule
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.nuisances import sensor_errors
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import METRICS, Metrics
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Budget, budget, shares

Signal = NDArray[np.float64]
Uncertain = Any
"""An uncertain number of GTC, which has no types."""

LOGS = Path(__file__).parents[2] / "fixtures"
R36 = LOGS / "campaign" / "r36ohm.csv"
COLUMNS = ("t", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")
R_DRUM = 0.13

PAPER = {
    ("force", "zero"): 0.002 * 2000 * 9.80665,
    ("torque", "zero"): 0.002 * 500,
    ("vdc", "gain"): 0.005,
    ("idc", "gain"): 0.005,
}
"""Limits of the sensors' errors in SI units: Table 1's 0.2 % of 2000 kgf and of 500 N m, and 0.5 % of a reading."""

VELOCITY = Sensor("m/s", high=2.0, accuracy_full_scale=0.005, accuracy_reading=0.005)
WITH_VELOCITY = PAPER | {("velocity", "zero"): 0.01, ("velocity", "gain"): 0.005}
"""The same with an error that line and shaft share: 0.5 % of 2 m/s and of the reading."""

CASES: tuple[tuple[WindowRule, bool], ...] = ((5.48, False), ("auto", False), (5.48, True))
"""Window, and whether the velocity has an error: windows of one length and of several, errors of one stage and of two."""

ROUNDING = 1e-9
"""Both sides evaluate the same first derivatives of sums of a few hundred samples; only rounding may differ."""

FREEDOM_ROUNDING = 1e-6
"""Degrees of freedom go with the fourth power of a scatter that is a small difference of large numbers."""

MAX_PART = 0.8
"""The force cell's part in the variance of eta_trans: 0.2 % of 19.6 kN, where the line pulls 2 kN."""


LIMITED = by_limits(built_in())
"""The paper's rig without calibrations in place."""


def rig_with(**sensors: Sensor | None) -> Rig:
    """Give the paper's rig, by the makers' limits, other sensors, or none for a channel."""
    mixed = {name: s for name, s in (dict(LIMITED.sensors) | sensors).items() if s is not None}
    return msgspec.structs.replace(LIMITED, sensors=mixed)


def rig_with_drum(radius: float, u: float | None, **winch: Any) -> Rig:
    drum = msgspec.structs.replace(built_in().winch, r_drum=Quantity(radius, "m", "by hand", u), **winch)
    return msgspec.structs.replace(built_in(), winch=drum)


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


def none_of(budget_or_part: object) -> set[str]:
    return {m for m in METRICS if getattr(budget_or_part, m) is None}


# ------------------------------------------------------------------------------------------------ agreement with GTC
class Reference(msgspec.Struct):
    """What GTC makes of the raw log: its input errors, the metrics of each cycle, their means without and with scatter."""

    errors: dict[tuple[str, str], Uncertain]
    cycles: list[dict[str, Uncertain]]
    sensors: dict[str, Uncertain]
    mean: dict[str, Uncertain]


def area(t: Signal, x: Signal, begin: float, end: float) -> float:
    """Integrate by trapezia between two interpolated ends."""
    inside = (t > begin) & (t < end)
    t_in = np.concatenate(([begin], t[inside], [end]))
    return float(np.trapezoid(np.interp(t_in, t, x), t_in))


def energy(
    log: dict[str, Signal], errors: dict[tuple[str, str], Uncertain], pair: tuple[str, str], begin: float, end: float
) -> Uncertain:
    """Integrate the product of (reading - zero) / (1 + gain) of two channels, multiplied out."""
    (x, y), t = (log[name] for name in pair), log["t"]
    zero_x, zero_y = (errors.get((name, "zero"), 0.0) for name in pair)
    gain_x, gain_y = (errors.get((name, "gain"), 0.0) for name in pair)
    whole = area(t, x * y, begin, end) - zero_x * area(t, y, begin, end) - zero_y * area(t, x, begin, end)
    return (whole + zero_x * zero_y * (end - begin)) / ((1.0 + gain_x) * (1.0 + gain_y))


def metrics_of(
    log: dict[str, Signal], errors: dict[tuple[str, str], Uncertain], begin: float, end: float
) -> dict[str, Uncertain]:
    line = energy(log, errors, ("force", "velocity"), begin, end)
    mech = energy(log, errors, ("torque", "velocity"), begin, end) / R_DRUM
    gen = energy(log, errors, ("vdc", "idc"), begin, end)
    seconds = end - begin
    return {
        "energy_line": line,
        "energy_mech": mech,
        "energy_gen": gen,
        "power_line": line / seconds,
        "power_mech": mech / seconds,
        "power_gen": gen / seconds,
        "eta_trans": mech / line,
        "eta_gen": gen / mech,
        "eta_pto": gen / line,
    }


@cache
def reference(window: WindowRule, moving: bool) -> Reference:
    log = dict(zip(COLUMNS, np.loadtxt(R36, delimiter=",", skiprows=1).T, strict=True))
    limits = WITH_VELOCITY if moving else PAPER
    errors = {key: GTC.ureal(0.0, limit / math.sqrt(3.0)) for key, limit in limits.items()}
    spans = [(c.window.onset, c.window.cutoff) for c in reduced(window, moving).cycles]
    cycles = [metrics_of(log, errors, begin, end) for begin, end in spans]
    sensors = {m: sum(c[m] for c in cycles) / len(cycles) for m in METRICS}
    mean = {}
    for m in METRICS:
        scatter = GTC.type_a.estimate([GTC.value(c[m]) for c in cycles])
        mean[m] = sensors[m] + (scatter - GTC.value(scatter))
    return Reference(errors, cycles, sensors, mean)


@cache
def known(window: WindowRule, moving: bool) -> Budget:
    return budget(reduced(window, moving))


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize(("window", "moving"), CASES)
def test_the_uncertainty_of_every_cycle_is_that_of_gtc(window: WindowRule, moving: bool, metric: str) -> None:
    found = [getattr(c, metric) for c in known(window, moving).cycles]
    assert len(found) == 3
    expected = [GTC.uncertainty(c[metric]) for c in reference(window, moving).cycles]
    assert found == pytest.approx(expected, rel=ROUNDING)


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize(("window", "moving"), CASES)
def test_the_uncertainty_of_the_mean_is_that_of_gtc(window: WindowRule, moving: bool, metric: str) -> None:
    ours, theirs = known(window, moving), reference(window, moving)
    assert getattr(ours.sensors, metric) == pytest.approx(GTC.uncertainty(theirs.sensors[metric]), rel=ROUNDING)
    assert getattr(ours.mean, metric) == pytest.approx(GTC.uncertainty(theirs.mean[metric]), rel=ROUNDING)
    assert getattr(ours.freedom, metric) == pytest.approx(GTC.dof(theirs.mean[metric]), rel=FREEDOM_ROUNDING)


@pytest.mark.parametrize(("window", "moving"), CASES)
def test_every_row_of_the_budget_is_a_component_of_gtc(window: WindowRule, moving: bool) -> None:
    ours, theirs = known(window, moving), reference(window, moving)
    assert all(row.source is not None for row in ours.rows)
    rows = {(row.source.channel, row.source.part): row.of for row in ours.rows if row.source is not None}
    assert set(rows) == set(theirs.errors)
    for key, of in rows.items():
        for m in METRICS:
            expected = GTC.component(theirs.sensors[m], theirs.errors[key])
            unrelated = ROUNDING * getattr(ours.sensors, m)
            assert getattr(of, m) == pytest.approx(expected, rel=ROUNDING, abs=unrelated)


def test_a_gain_error_of_the_velocity_leaves_the_transmission_efficiency_alone() -> None:
    (row,) = (
        r.of
        for r in known(5.48, True).rows
        if r.source is not None and (r.source.channel, r.source.part) == ("velocity", "gain")
    )
    assert row.eta_trans == pytest.approx(0.0, abs=1e-15)
    assert row.eta_pto == pytest.approx(0.005 / math.sqrt(3.0) * (reduced().mean.eta_pto or 0.0), rel=ROUNDING)


# ------------------------------------------------------------------------------------------------ laws of the sources
def limits(sensor: Sensor) -> dict[str, float | None]:
    return {s.part: s.limit for s in error_sources("force", sensor)}


def deviations(sensor: Sensor) -> dict[str, float]:
    return {s.part: s.u for s in error_sources("force", sensor)}


SENSORS = {
    "full scale": (Sensor("N", high=20000.0, accuracy_full_scale=0.002), {"zero": 40.0}),
    "both ways": (Sensor("N.m", low=-500.0, high=500.0, accuracy_full_scale=0.002), {"zero": 1.0}),
    "mostly negative": (Sensor("N", low=-800.0, high=100.0, accuracy_full_scale=0.01), {"zero": 8.0}),
    "absolute with a range": (Sensor("N", high=1000.0, accuracy=10.0), {"zero": 10.0}),
    "absolute without a range": (Sensor("N", accuracy=10.0), {"zero": 10.0}),
    "reading": (Sensor("V", accuracy_reading=0.005), {"gain": 0.005}),
    "reading with a range": (Sensor("V", high=600.0, accuracy_reading=0.005), {"gain": 0.005}),
    "reading and absolute": (Sensor("V", accuracy_reading=0.005, accuracy=0.2), {"zero": 0.2, "gain": 0.005}),
    "reading and full scale": (
        Sensor("V", high=600.0, accuracy_reading=0.005, accuracy_full_scale=0.002),
        {"zero": 1.2, "gain": 0.005},
    ),
}


@pytest.mark.parametrize("kind", SENSORS)
def test_a_full_scale_is_a_zero_error_and_a_reading_a_gain_error(kind: str) -> None:
    sensor, expected = SENSORS[kind]
    assert limits(sensor) == pytest.approx(expected)
    assert deviations(sensor) == pytest.approx({part: a / math.sqrt(3.0) for part, a in expected.items()})
    assert {s.shape for s in error_sources("force", sensor)} == {"rectangular"}


IN = "calibration_in_place"
IN_PLACE: dict[str, tuple[dict[str, float], dict[str, tuple[float, str]]]] = {
    "zero and gain": ({"u_zero": 3.0, "u_gain": 0.1}, {"zero": (3.0, IN), "gain": (0.1, IN)}),
    "the zero": ({"u_zero": 3.0}, {"zero": (3.0, IN), "gain": (0.007 / math.sqrt(3.0), "limits")}),
    "the gain": ({"u_gain": 0.1}, {"zero": (40.0 / math.sqrt(3.0), "limits"), "gain": (0.1, IN)}),
    "an exact zero": ({"u_zero": 0.0, "u_gain": 0.1}, {"gain": (0.1, IN)}),
    "an acquisition system too": (
        {"u_zero": 3.0, "u_gain": 0.1, "daq_reading": 0.1},
        {"zero": (3.0, IN), "gain": (0.1, IN)},
    ),
}


@pytest.mark.parametrize("kind", IN_PLACE)
def test_a_calibration_in_place_replaces_the_limits(kind: str) -> None:
    stated, expected = IN_PLACE[kind]
    limits = {"high": 20000.0, "accuracy_full_scale": 0.002, "accuracy_reading": 0.005}
    sensor = msgspec.convert({"unit": "N", **limits, **stated}, Sensor)
    found = error_sources("force", sensor)
    assert [(s.part, s.basis) for s in found] == [(part, basis) for part, (_, basis) in expected.items()]
    assert [s.u for s in found] == pytest.approx([u for u, _ in expected.values()])
    assert sensor_errors(sensor) == tuple(part_uncertainty(sensor, part) for part in ("gain", "zero"))


def test_a_calibration_counts_where_no_accuracy_is_stated() -> None:
    sources = error_sources("idc", Sensor("A", high=20.0, u_zero=0.005, u_gain=0.001, source="in place"))
    assert [(s.channel, s.part, s.u, s.limit, s.shape, s.origin) for s in sources] == [
        ("idc", "zero", 0.005, None, "normal", "in place"),
        ("idc", "gain", 0.001, None, "normal", "in place"),
    ]
    assert deviations(Sensor("A", u_gain=0.001)) == {"gain": 0.001}


@given(high=st.floats(1e-3, 1e6), share=st.floats(1e-6, 0.1), factor=st.floats(1.0, 10.0))
def test_an_expanded_uncertainty_of_the_full_scale_is_a_normal_zero_error(
    high: float, share: float, factor: float
) -> None:
    (source,) = error_sources("force", Sensor("N", high=high, accuracy_full_scale=share, coverage=factor))
    assert (source.part, source.shape, source.basis) == ("zero", "normal", "expanded_uncertainty")
    assert source.u == pytest.approx(share * high / factor)


def test_the_acquisition_system_adds_an_error_of_its_own() -> None:
    sensor = Sensor(
        "N.m", high=100.0, accuracy_full_scale=0.001, coverage=2.0, daq_reading=0.0003, daq_full_scale=0.0002
    )
    sources = error_sources("torque", sensor)
    assert [(s.part, s.shape, s.origin == "acquisition system") for s in sources] == [
        ("zero", "normal", False),
        ("zero", "rectangular", True),
        ("gain", "rectangular", True),
    ]
    assert [s.limit for s in sources[1:]] == pytest.approx([0.02, 0.0003])
    assert part_uncertainty(sensor, "zero") == pytest.approx(math.hypot(0.05, 0.02 / math.sqrt(3.0)))


def test_the_budget_of_a_drive_bench_is_that_of_a_pocket_calculator() -> None:
    """The worked example of docs/method.md: a motor at 50 N m, 1500 rpm, 400 V and 22 A."""
    torque = Sensor(
        "N.m", low=-100.0, high=100.0, accuracy_full_scale=1e-3, coverage=2.0, daq_full_scale=2e-4, daq_reading=3e-4
    )
    speed = Sensor("rpm", accuracy_reading=1e-4)
    volt = Sensor("V", high=600.0, accuracy_reading=2e-4, accuracy_full_scale=4e-4)
    current = Sensor(
        "A", high=50.0, accuracy_reading=2e-4, accuracy_full_scale=4e-4, daq_reading=5e-4, daq_coverage=2.0
    )

    def relative(sensor: Sensor, x: float) -> float:
        return math.hypot(part_uncertainty(sensor, "gain"), part_uncertainty(sensor, "zero") / x)

    u = [relative(torque, 50.0), relative(speed, 157.08), relative(volt, 400.0), relative(current, 22.0)]
    assert u == pytest.approx([10.41e-4, 0.58e-4, 3.65e-4, 5.93e-4], abs=0.5e-6)
    eta = 50.0 * 157.08 / (400.0 * 22.0)
    assert eta * math.hypot(*u) == pytest.approx(11.19e-4, abs=0.5e-6)


@pytest.mark.parametrize("sensor", [Sensor("N"), Sensor("N", high=20.0, resolution=0.1), Sensor("N", accuracy=0.0)])
def test_a_sensor_without_any_accuracy_has_no_known_error(sensor: Sensor) -> None:
    assert error_sources("force", sensor) == ()


# ------------------------------------------------------------------------------------------------ laws of the budget
@pytest.mark.parametrize("path", sorted((LOGS / "campaign").glob("r*.csv")), ids=lambda p: p.stem)
def test_the_force_cell_makes_most_of_the_variance_of_the_transmission_efficiency(path: Path) -> None:
    found = budget(reduce(read_run(path), rig=LIMITED))
    force = [r.of for r in found.rows if r.source is not None and r.source.channel == "force"]
    assert sum(shares(of, found.mean).eta_trans or 0.0 for of in force) > MAX_PART


@pytest.mark.parametrize("metric", METRICS)
def test_rows_and_repeatability_add_in_squares_to_the_mean(metric: str) -> None:
    found = known(5.48, False)
    parts = [getattr(r.of, metric) for r in found.rows]
    assert math.hypot(*parts) == pytest.approx(getattr(found.sensors, metric), rel=ROUNDING)
    whole = math.hypot(*parts, getattr(found.repeatability, metric))
    assert whole == pytest.approx(getattr(found.mean, metric), rel=ROUNDING)


def test_of_a_single_cycle_the_sensors_are_all_that_is_known() -> None:
    one = budget(reduce(run36(), window=5.48, cycles=(2, 2)))
    assert one.mean == one.sensors
    assert none_of(one.repeatability) == set(METRICS)


def test_on_the_papers_rig_only_the_velocity_is_taken_as_exact() -> None:
    assert known(5.48, False).exact == ("velocity",)
    assert known(5.48, True).exact == ()
    assert known(5.48, False).unknown == ()


RADIUS_ACTS_ON = {
    "drum": {"energy_line", "power_line", "eta_trans", "eta_pto"},
    "line": {"energy_mech", "power_mech", "eta_trans", "eta_gen"},
}
"""Metrics that an error of the drum radius changes, by where the motion is measured: of E = F v t with v = r omega, of
E = tau v t / r with v measured on the line."""


def of_the_radius(reduction: Reduction) -> Metrics:
    (row,) = (r.of for r in budget(reduction).rows if r.source is not None and r.source.channel == "r_drum")
    return row


@pytest.mark.parametrize("motion", RADIUS_ACTS_ON)
@pytest.mark.parametrize("radius", [0.13, 1.0])
def test_an_error_of_the_drum_radius_acts_on_what_the_motion_needs_it_for(radius: float, motion: str) -> None:
    run = channels_of_run36(torque=run36().channels["torque"] * radius / R_DRUM)
    reduction = reduce(run, rig=rig_with_drum(radius, 0.01 * radius, motion=motion), window=5.48)
    row = of_the_radius(reduction)
    for m in METRICS:
        expected = 0.01 * getattr(reduction.mean, m) if m in RADIUS_ACTS_ON[motion] else 0.0
        assert getattr(row, m) == pytest.approx(expected, rel=ROUNDING), m


@pytest.mark.parametrize("motion", RADIUS_ACTS_ON)
def test_the_draws_of_a_drum_radius_agree_with_the_budget(motion: str) -> None:
    exact = {name: Sensor(s.unit, u_gain=1e-9) for name, s in built_in().sensors.items()}
    rig = msgspec.structs.replace(rig_with_drum(R_DRUM, 0.01 * R_DRUM, motion=motion), sensors=exact)
    reduction = reduce(run36(), rig=rig, window=5.48, cycles=(1, 1))
    found = uncertainty(reduction)
    for m in METRICS:
        assert getattr(found.drawn, m) == pytest.approx(
            getattr(found.budget.mean, m), rel=0.01, abs=1e-6 * reduction.mean.value(m)
        )


def test_a_velocity_made_of_the_speed_of_the_shaft_is_of_the_drum() -> None:
    run = channels_of_run36(speed=run36().channels["velocity"] / R_DRUM)
    rig = rig_with_drum(R_DRUM, 0.01 * R_DRUM, motion="line")
    assert of_the_radius(reduce(run, rig=rig, window=5.48)).energy_line
    slipping = channels_of_run36(speed=run36().channels["velocity"] / R_DRUM * 1.001)
    assert of_the_radius(reduce(slipping, rig=rig, window=5.48)).energy_line == 0.0


@pytest.mark.parametrize(("rectangular", "basis"), [(True, "limits"), (False, "standard_uncertainty")])
def test_limits_of_the_drum_radius_are_rectangular(rectangular: bool, basis: str) -> None:
    radius = Quantity(R_DRUM, "m", "by hand", 0.001, rectangular=rectangular)
    winch = msgspec.structs.replace(built_in().winch, r_drum=radius)
    found = budget(reduce(run36(), rig=msgspec.structs.replace(built_in(), winch=winch), window=5.48))
    (source,) = (r.source for r in found.rows if r.source is not None and r.source.channel == "r_drum")
    assert (source.shape, source.basis) == ("rectangular" if rectangular else "normal", basis)
    assert source.u == pytest.approx(0.001 / R_DRUM)


def test_an_exact_drum_radius_has_no_row() -> None:
    found = budget(reduce(run36(), rig=rig_with_drum(R_DRUM, None), window=5.48))
    assert "r_drum" not in {r.source.channel for r in found.rows if r.source is not None}


def test_without_an_accuracy_of_the_force_cell_what_it_measures_has_no_uncertainty() -> None:
    needs_force = {"energy_line", "power_line", "eta_trans", "eta_pto"}
    for sensor in (None, Sensor("N", high=20000.0)):
        found = budget(reduce(run36(), rig=rig_with(force=sensor), window=5.48))
        assert found.unknown == ("force",)
        assert none_of(found.mean) == none_of(found.sensors) == none_of(found.freedom) == needs_force
        assert all(none_of(c) == needs_force for c in found.cycles)
        for m in set(METRICS) - needs_force:
            assert getattr(found.mean, m) == pytest.approx(getattr(known(5.48, False).mean, m), rel=ROUNDING)


def test_a_single_cycle_has_no_repeatability() -> None:
    run = run36()
    first = run.t < 30.0
    alone = msgspec.structs.replace(
        run, t=run.t[first], channels={name: x[first] for name, x in run.channels.items()}, samples=int(first.sum())
    )
    found = budget(reduce(alone, window=5.48))
    assert len(found.cycles) == 1
    assert none_of(found.repeatability) == set(METRICS)
    for m in METRICS:
        sensors = getattr(found.sensors, m)
        assert sensors == pytest.approx(getattr(found.cycles[0], m), rel=ROUNDING)
        assert sensors == pytest.approx(getattr(found.mean, m), rel=ROUNDING)
        assert getattr(found.freedom, m) == math.inf


def test_cycles_that_do_not_count_have_an_uncertainty_but_no_part_in_the_mean() -> None:
    reduction = reduce(read_run(LOGS / "damaged_logs" / "aborted.csv"), window=5.48)
    found = budget(reduction)
    assert len(reduction.complete) < len(reduction.cycles) == len(found.cycles)
    values = [c.metrics.eta_trans or 0.0 for c in reduction.complete]
    expected = statistics.stdev(values) / math.sqrt(len(values))
    assert found.repeatability.eta_trans == pytest.approx(expected, rel=FREEDOM_ROUNDING)
    counted = [u.eta_trans or 0.0 for u, c in zip(found.cycles, reduction.cycles, strict=True) if c.complete]
    assert min(counted) <= (found.sensors.eta_trans or 0.0) <= max(counted)


def never_steady() -> Rig:
    """A rig whose window asks for a plateau that no payout holds."""
    rig = built_in()
    return msgspec.structs.replace(rig, thresholds=msgspec.structs.replace(rig.thresholds, plateau_hold=100.0))


def test_without_a_complete_cycle_no_mean_has_an_uncertainty() -> None:
    reduction = reduce(run36(), rig=never_steady(), window="auto")
    assert reduction.complete == ()
    found = budget(reduction)
    assert none_of(found.mean) == none_of(found.sensors) == none_of(found.repeatability) == set(METRICS)


def test_a_line_that_never_moves_gives_an_empty_budget() -> None:
    still = np.zeros_like(run36().t)
    found = budget(reduce(channels_of_run36(velocity=still, displacement=still)))
    assert (found.rows, found.cycles, found.unknown) == ((), (), ())
    assert none_of(found.mean) == set(METRICS)


def test_an_open_circuit_has_no_uncertainty_of_an_electrical_efficiency() -> None:
    found = budget(reduce(read_run(LOGS / "campaign" / "open_circuit.csv", load=math.inf)))
    electrical = {"eta_gen", "eta_pto"}
    assert none_of(found.mean) == none_of(found.sensors) == none_of(found.repeatability) == electrical
    assert all(none_of(of) == electrical for of in (*found.cycles, *(r.of for r in found.rows)))


def test_a_logged_shaft_power_has_the_error_of_its_own_sensor() -> None:
    power = run36().channels["torque"] * run36().channels["velocity"] / R_DRUM
    run = channels_of_run36(torque=None, power_mech=power)
    winch = rig_with_drum(R_DRUM, 0.01, motion="line").winch
    rig = msgspec.structs.replace(rig_with(power_mech=Sensor("W", accuracy=3.0, accuracy_reading=0.02)), winch=winch)
    found, mean = budget(reduce(run, rig=rig, window=5.48)), reduced().mean
    assert {r.source.channel for r in found.rows if r.source is not None} == {"force", "power_mech", "vdc", "idc"}
    expected = math.hypot(3.0, 0.02 * (mean.power_mech or 0.0)) / math.sqrt(3.0)
    assert found.sensors.power_mech == pytest.approx(expected, rel=ROUNDING)
    assert found.sensors.energy_mech == pytest.approx(5.48 * expected, rel=ROUNDING)
    nothing_known = budget(reduce(run, window=5.48))
    assert nothing_known.unknown == ("power_mech",)
    assert none_of(nothing_known.mean) == {"energy_mech", "power_mech", "eta_trans", "eta_gen"}


def test_bridged_gaps_have_a_row_without_a_source() -> None:
    reduction = reduce(read_run(LOGS / "damaged_logs" / "dropouts.csv"), window=5.48)
    found = budget(reduction)
    (row,) = (r.of for r in found.rows if r.source is None)
    n = len(reduction.complete)
    assert all(c.net.reason is None for c in reduction.complete)
    for stage, joules in reduction.bridged.items():
        counted = [joule for joule, c in zip(joules, reduction.cycles, strict=True) if c.complete]
        expected = math.hypot(*counted) / math.sqrt(3.0) / n  # limits of rectangular errors, independent of each other
        assert expected > 0 or CASCADE.parts[stage][1] == "haul_in"
        assert getattr(row, f"energy_{stage}") == pytest.approx(expected, rel=ROUNDING)
        if CASCADE.parts[stage][1] == "window":
            assert getattr(row, f"power_{stage}") == pytest.approx(expected / 5.48, rel=ROUNDING)
    for m in METRICS:
        parts = [getattr(r.of, m) for r in found.rows]
        assert getattr(found.sensors, m) == pytest.approx(math.hypot(*parts), rel=ROUNDING)


def test_a_log_without_gaps_has_no_row_without_a_source() -> None:
    assert all(r.source is not None for r in known(5.48, False).rows)
