"""The loss map against surfaces and models that are known."""

import json
import math
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.io import loadmat

from winchcascade import baseline, load_rig, read_run, reduce, simulate
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade
from winchcascade.core.errors import LogError, OptionError, RigError
from winchcascade.core.integrate import means
from winchcascade.core.rig_file import Drivetrain, Rig
from winchcascade.core.run import Run
from winchcascade.reduction.loss_map import (
    Coefficient,
    LossMap,
    _held_out_groups,
    condition_number,
    convex_hull,
    fit_surface,
    make_loss_map,
    within,
)
from winchcascade.reduction.loss_points import (
    TURNING,
    LossPoints,
    _spans,
    columns_at,
    joined,
    loss_points,
    stages_of_loss,
)
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import Table
from winchcascade.report.loss_map_file import write_loss_map
from winchcascade.report.results.loss_surface import loss_map_section

FIXTURES = Path(__file__).parents[2] / "fixtures"

TRUE = np.array([3.0, 0.8, 0.002, 0.15, 0.04])
"""Coefficients of an invented machine, in the order of `TERMS`."""

TWO = Cascade(tuple(BUILT_IN[name] for name in ("mech", "gen")), configured=True)
BENCH = Rig(name="bench", cascade=TWO)
"""A bench whose sensors are exact and whose inertia is unknown."""


def points_at(torque: np.ndarray, speed: np.ndarray, noise: np.ndarray) -> LossPoints:
    """Points of the invented machine that drive a DC link of 100 V."""
    columns, n = columns_at(torque, speed), torque.size
    power_in = torque * speed
    power_out = power_in - columns @ TRUE + noise
    made_of = (TWO.stages[0].powers[-1], TWO.stages[1].powers[-1])
    return LossPoints(
        ("mech", "gen"), torque, speed, power_in, power_out, np.zeros(n), columns,
        {"torque": torque, "speed": speed, "vdc": np.full(n, 100.0), "idc": power_out / 100.0},
        made_of, np.full(n, 2.0), np.arange(n), np.zeros(n, dtype=np.intp), ("bench.csv",), {},
    )  # fmt: skip


def scattered(seed: int, n: int = 60) -> LossPoints:
    rng = np.random.default_rng(seed)
    return points_at(rng.uniform(20.0, 600.0, n), rng.uniform(1.0, 12.0, n), rng.normal(0.0, 4.0, n))


def holds(c: Coefficient, true: float) -> bool:
    assert c.low is not None
    assert c.high is not None
    return c.low <= true <= c.high


def test_the_coefficients_of_a_known_surface_lie_in_their_intervals() -> None:
    inside = np.array([
        [holds(c, true) for c, true in zip(fit_surface(scattered(seed), BENCH).coefficients, TRUE, strict=True)]
        for seed in range(200)
    ])  # fmt: skip
    assert 0.92 <= inside.mean() <= 0.98


def test_exact_points_give_the_exact_surface_and_a_table_within_their_hull_alone() -> None:
    rng = np.random.default_rng(3)
    torque, speed = rng.uniform(-300.0, 300.0, 80), rng.uniform(1.0, 12.0, 80)
    found = make_loss_map(points_at(torque, speed, np.zeros(80)), BENCH)
    assert found.surface.values == pytest.approx(TRUE, rel=1e-9)
    grid = np.stack(np.meshgrid(found.torque, found.speed, indexing="ij"), axis=-1)
    inside = within(found.hull, grid[..., 0], grid[..., 1])
    assert 0.5 < inside.mean() < 1.0
    assert np.array_equal(np.isfinite(found.loss), inside)
    assert found.loss[inside] == pytest.approx((columns_at(grid[..., 0], grid[..., 1]) @ TRUE)[inside])


def test_the_hull_holds_every_point_and_none_beyond() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 50))
    hull = convex_hull(x, y)
    assert within(hull, x, y).all()
    middle = hull.mean(axis=0)
    beyond = middle + 1.01 * (hull - middle)
    assert not within(hull, beyond[:, 0], beyond[:, 1]).any()
    assert within(convex_hull(x, 2.0 * x), x, 2.0 * x).tolist() == [False] * 50  # a straight line


@pytest.mark.parametrize(
    ("logs", "cycles", "held_out"), [(3, 6, "log"), (2, 3, "cycle"), (2, 2, "point"), (1, 60, "cycle")]
)
def test_logs_are_held_out_where_there_are_three_else_cycles_else_points(logs: int, cycles: int, held_out: str) -> None:
    points = scattered(3)
    number = np.arange(points.loss.size)
    points = msgspec.structs.replace(points, log=number % logs, cycle=number % cycles)
    groups, what = _held_out_groups(points)
    assert what == held_out
    assert np.unique(groups).size == {"log": logs, "cycle": cycles, "point": 10}[held_out]


def shown_tables(found: LossMap) -> dict[str, list[list[str]]]:
    """Rows of the tables of a loss map as they are shown."""
    return {block.id: block.texts for block in loss_map_section(found).blocks if isinstance(block, Table)}


def test_columns_of_one_load_are_not_distinguished_and_named() -> None:
    rng = np.random.default_rng(2)
    speed = np.linspace(2.0, 11.0, 40)
    found = make_loss_map(points_at(40.0 * speed, speed, rng.normal(0.0, 1.0, 40)), BENCH)
    fitted = [c for c in found.surface.coefficients if c.value is not None]
    assert len(fitted) == 2
    assert found.surface.condition < 100.0
    assert math.isinf(found.surface.condition_all)
    assert found.surface.residual < 1.3
    assert all(c.contained_in for c in found.surface.coefficients if c.value is None)
    cells = shown_tables(found)
    left_out = [row[0] for row in cells["loss-coefficients"] if row[2] == "not distinguished"]
    assert len(left_out) == sum(c.value is None for c in found.surface.coefficients)
    assert "Table" in {row[0] for row in cells["loss-quality"]}  # that holds no value


@pytest.mark.parametrize("n", [1, 2])
def test_as_many_coefficients_as_points_have_no_interval(n: int, tmp_path: Path) -> None:
    found = make_loss_map(scattered(4, n), BENCH)
    fitted = [c for c in found.surface.coefficients if c.value is not None]
    assert len(fitted) == n
    assert {(c.low, c.high) for c in fitted} == {(None, None)}
    assert math.isnan(found.u_energy)
    assert not np.isfinite(found.u_loss).any()
    cells = shown_tables(found)
    rows = dict(cells["loss-quality"])
    assert rows["Points"] == f"{n} of 1 log"
    assert "uncertainty unknown" in rows["Energy lost"]
    assert sum(row[2] == "unknown" for row in cells["loss-coefficients"]) == n
    for name in ("map.csv", "map.json", "map.mat"):
        write_loss_map(found, tmp_path / name, "log")
    assert json.loads((tmp_path / "map.json").read_text())["energy_lost_standard_uncertainty_j"] is None


def test_the_accuracy_of_a_sensor_widens_the_intervals() -> None:
    sensors = load_rig("hsu2026").sensors
    plain, points = fit_surface(scattered(5), BENCH), scattered(5)
    stated = fit_surface(points, msgspec.structs.replace(BENCH, sensors=sensors))
    assert all(np.diag(stated.covariance) > np.diag(plain.covariance))
    high = points.with_error("torque", "gain", 0.01)
    assert high.power_in == pytest.approx(1.01 * points.power_in)
    assert high.columns == pytest.approx(columns_at(1.01 * points.torque, points.speed))
    assert high.torque == pytest.approx(1.01 * points.torque)
    more = points.with_error("idc", "zero", 0.5)
    assert more.power_out == pytest.approx(points.power_out + 50.0)


# ------------------------------------------------------------------------------------------------------- whole logs
INERTIA = 0.4


def dyno_run(ramp: float, *, reverse: bool = False) -> Run:
    """A dynamometer at steps of speed and torque, joined by ramps of some seconds: exact channels at 100 Hz."""
    corners, speeds, torques = [0.0], [2.0], [30.0]
    for speed in (2.0, 5.0, 8.0, 11.0):
        for torque in (30.0, 80.0, 150.0):
            for seconds in (ramp, 6.0):
                corners.append(corners[-1] + seconds)
                speeds.append(speed)
                torques.append(torque)
    t = np.arange(0.0, corners[-1], 0.01)
    omega, torque = np.interp(t, corners, speeds), np.interp(t, corners, torques)
    loss = columns_at(torque, omega) @ TRUE
    power = torque * omega - loss - INERTIA * omega * np.gradient(omega, t)
    sign = -1.0 if reverse else 1.0
    channels = {"speed": sign * omega, "torque": sign * torque, "vdc": np.full(t.size, 100.0), "idc": power / 100.0}
    return Run(name="dyno.csv", t=t, channels=channels, fs=100.0, samples=t.size)


def bench(tmp_path: Path, source: str, inertia: bool) -> Rig:
    text = f'name = "bench"\n[cascade]\nstages = ["mech", "gen"]\n[phases]\nfrom = "{source}"\n'
    if inertia:
        text += f'[drivetrain]\ninertia_rotor = {{ value = {INERTIA}, unit = "kg.m2" }}\n'
        text += 'gear_ratio = { value = 1, unit = "1" }\n'
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    return load_rig(tmp_path / "bench.toml")


@pytest.mark.parametrize("reverse", [False, True])
def test_steps_of_a_dynamometer_give_its_losses(tmp_path: Path, reverse: bool) -> None:
    rig = bench(tmp_path, "steps", inertia=False)
    found = make_loss_map(loss_points(reduce(dyno_run(1.0, reverse=reverse), rig=rig)), rig)
    assert found.points.loss.size == 12
    assert found.points.speed.min() > 0.0
    assert found.surface.values == pytest.approx(TRUE, rel=0.03)


def test_transients_count_with_the_inertia_alone(tmp_path: Path) -> None:
    rig = bench(tmp_path, "whole", inertia=True)
    run = dyno_run(1.0)
    spans = [(a, a + 0.5) for a in np.arange(0.0, float(run.t[-1]) - 1.0, 0.5)]
    ranges = msgspec.structs.replace(rig.phases, source="ranges", ranges=tuple(spans))
    rig = msgspec.structs.replace(rig, phases=ranges)
    known = loss_points(reduce(run, rig=rig))
    assert known.loss == pytest.approx(known.columns @ TRUE, abs=2.0)
    assert np.abs(known.stored).max() > 5.0
    unknown = loss_points(reduce(run, rig=msgspec.structs.replace(rig, drivetrain=Drivetrain())))
    assert unknown.left_out["speed changes and inertia_rotor is unknown"] >= 6
    assert unknown.loss == pytest.approx(unknown.columns @ TRUE, abs=0.5)


def test_no_map_exists_where_energy_is_stored_or_nothing_turns(tmp_path: Path) -> None:
    assert stages_of_loss(PAPER) == ("mech", "gen")
    with pytest.raises(RigError, match="energy is stored"):
        stages_of_loss(Cascade(tuple(BUILT_IN[name] for name in ("line", "mech"))))
    rig = bench(tmp_path, "whole", inertia=False)
    run = dyno_run(1.0)
    rest = msgspec.structs.replace(run, channels={**run.channels, "speed": np.zeros(run.t.size)})
    with pytest.raises(LogError, match="shaft at rest"):
        loss_points(reduce(rest, rig=rig))
    without = msgspec.structs.replace(run, channels={n: x for n, x in run.channels.items() if n != "idc"})
    with pytest.raises(LogError, match="lacks gen"):
        loss_points(reduce(without, rig=rig))


@pytest.fixture(scope="module")
def crane() -> tuple[LossMap, float]:
    """Loss map of the shipped campaign as the model of the rig simulates it with noise, and the energy that the model loses."""
    rig, rng, parts, lost = load_rig("hsu2026"), np.random.default_rng(4), [], 0.0
    noise = {"velocity": 0.004, "torque": 0.8, "vdc": 0.3, "idc": 0.01}
    for listed in load_campaign(FIXTURES / "campaign").runs:
        done = simulate(read_run(listed.file, load=listed.load), baseline(rig))
        channels = {n: x + rng.normal(0.0, noise[n], x.size) if n in noise else x for n, x in done.run.channels.items()}
        reduction = reduce(msgspec.structs.replace(done.run, channels=channels), rig=rig, window=listed.window)
        part = loss_points(reduction)
        parts.append(part)
        watts = sum(
            done.energy[name] for name in ("shaft_loss", "mesh", "damper", "windage", "friction", "copper", "diodes")
        )
        spans = block_spans(part, reduction)
        lost += float(np.diff(np.interp(spans, done.run.t, watts), axis=1).sum())
    return make_loss_map(joined(parts), rig), lost


def block_spans(points: LossPoints, reduction: Reduction) -> np.ndarray:
    """Spans of the blocks that were kept."""
    spans, _ = _spans(reduction)
    turning = np.abs(means(reduction.run.t, reduction.run.channels["velocity"].__getitem__, spans)) / 0.13 >= TURNING
    kept: np.ndarray = spans[turning]
    assert len(kept) == points.loss.size
    return kept


@pytest.mark.slow
def test_the_loss_of_the_whole_campaign_is_that_of_the_model(crane: tuple[LossMap, float]) -> None:
    found, lost = crane
    assert abs(found.energy - lost) < 1.96 * found.u_energy
    assert abs(found.energy - lost) < 0.02 * lost
    assert float(found.points.columns @ found.surface.values @ found.points.duration) == pytest.approx(lost, rel=0.02)
    assert found.surface.held_out is not None
    assert found.surface.held_out < 0.05 * found.points.loss.mean()
    assert condition_number(found.points.columns) == found.surface.condition_all


def test_the_files_hold_the_same_table(tmp_path: Path, crane: tuple[LossMap, float]) -> None:
    found, _ = crane
    for ending in ("csv", "mat", "json"):
        write_loss_map(found, tmp_path / f"map.{ending}", "a campaign")
        write_loss_map(found, tmp_path / f"map.{ending}", "a campaign")  # over its own file
    lines = [line.split(",") for line in (tmp_path / "map.csv").read_text().splitlines() if not line.startswith("#")]
    table = np.array([[float(cell) for cell in row] for row in lines[1:]])
    assert table[:, 0] == pytest.approx(found.torque)
    assert [float(x) for x in lines[0][1:]] == pytest.approx(found.speed)
    assert table[:, 1:] == pytest.approx(found.loss, nan_ok=True)
    record = json.loads((tmp_path / "map.json").read_text())
    assert [[math.nan if x is None else x for x in row] for row in record["loss_w"]] == [
        pytest.approx(row, nan_ok=True) for row in found.loss.tolist()
    ]
    assert record["schema"] == "winchcascade/loss_map/1"
    model = loadmat(tmp_path / "map.mat", squeeze_me=True, simplify_cells=True)["loss_map"]
    assert model["loss_w"] == pytest.approx(found.loss, nan_ok=True)
    assert model["stage_in"] == "mech"
    assert all(a < b for a, b in pairwise(model["torque_nm"]))
    with pytest.raises(OptionError, match="expected a file that ends in"):
        write_loss_map(found, tmp_path / "map.txt", "a campaign")
