"""The loss map against surfaces and models that are known."""

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.io import loadmat

from winchcascade import baseline, load_rig, read_run, reduce, simulate
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade
from winchcascade.core.errors import LogError, OptionError, RigError
from winchcascade.core.integrate import means_of
from winchcascade.core.rig_file import Drivetrain, Rig, Sensor
from winchcascade.core.run import Run
from winchcascade.reduction.loss_map import convex_hull, fit_surface, make_loss_map
from winchcascade.reduction.loss_points import (
    TURNING,
    LossPoints,
    _spans,
    columns_at,
    joined,
    loss_points,
    onset_of_shaft,
    stages_of_loss,
)
from winchcascade.report.loss_map_file import write_loss_map

FIXTURES = Path(__file__).parents[2] / "fixtures"

TRUE = np.array([3.0, 0.8, 0.002, 0.15, 0.04])
"""Coefficients of an invented machine, in the order of `TERMS`."""


def points_at(torque: np.ndarray, speed: np.ndarray, noise: np.ndarray) -> LossPoints:
    """Points of the invented machine, whose sensors are exact."""
    columns, n = columns_at(torque, speed), torque.size
    power_in = torque * speed
    power_out = power_in - columns @ TRUE + noise
    return LossPoints(
        ("mech", "gen"), torque, speed, power_in, power_out, np.zeros(n), columns, np.empty((n, 0, 6)), np.full(n, 2.0),
        np.arange(n), np.zeros(n, dtype=np.intp), ("bench.csv",), {},
    )  # fmt: skip


def scattered(seed: int, n: int = 60) -> LossPoints:
    rng = np.random.default_rng(seed)
    return points_at(rng.uniform(20.0, 600.0, n), rng.uniform(1.0, 12.0, n), rng.normal(0.0, 4.0, n))


def test_the_coefficients_of_a_known_surface_lie_in_their_intervals() -> None:
    found = [zip(fit_surface(scattered(seed)).coefficients, TRUE, strict=True) for seed in range(200)]
    held = sum((c.low or 0.0) <= true <= (c.high or 0.0) for of in found for c, true in of)
    assert 0.92 <= held / 1000 <= 0.98


def test_exact_points_give_the_exact_surface_and_a_table_within_their_hull_alone() -> None:
    rng = np.random.default_rng(3)
    torque, speed = rng.uniform(-300.0, 300.0, 80), rng.uniform(1.0, 12.0, 80)
    found = make_loss_map(points_at(torque, speed, np.zeros(80)))
    assert found.surface.values == pytest.approx(TRUE, rel=1e-9)
    grid = np.stack(np.meshgrid(found.torque, found.speed, indexing="ij"), axis=-1)
    inside = np.isfinite(found.loss)
    assert 0.5 < inside.mean() < 1.0
    assert found.loss[inside] == pytest.approx((columns_at(grid[..., 0], grid[..., 1]) @ TRUE)[inside])


def test_the_hull_holds_every_point_and_none_beyond() -> None:
    points = np.random.default_rng(1).normal(size=(50, 2))
    hull, inside = convex_hull(points, points)
    assert inside.all()
    assert not convex_hull(points, hull.mean(axis=0) + 1.01 * (hull - hull.mean(axis=0)))[1].any()
    assert not convex_hull(points * (1.0, 0.0), points * (1.0, 0.0))[1].any()  # a straight line


def test_of_one_load_the_first_columns_are_fitted_and_the_others_named() -> None:
    speed = np.linspace(2.0, 11.0, 40)
    points = points_at(40.0 * speed, speed, np.random.default_rng(2).normal(0.0, 1.0, 40))
    found = make_loss_map(points)
    surface = found.surface
    assert [c.term for c in surface.coefficients if c.value is not None] == ["speed", "speed_squared"]
    assert {c.contained_in for c in surface.coefficients if c.value is None} == {("speed", "speed_squared")}
    assert surface.condition < 100.0 < surface.condition_all
    assert surface.residual < 1.3


def test_as_many_coefficients_as_points_have_no_interval(tmp_path: Path) -> None:
    found = make_loss_map(scattered(4, 2))
    assert [(c.low, c.high) for c in found.surface.coefficients if c.value is not None] == [(None, None)] * 2
    assert math.isnan(found.u_energy)
    assert not np.isfinite(found.u_loss).any()
    write_loss_map(found, tmp_path / "map.json", "log")
    assert json.loads((tmp_path / "map.json").read_text())["energy_lost_standard_uncertainty_j"] is None


# ------------------------------------------------------------------------------------------------------- whole logs
INERTIA = 0.4


def dyno_run(*, reverse: bool = False) -> Run:
    """A dynamometer at steps of 6 s of speed and torque, joined by ramps of 1 s: exact channels at 100 Hz."""
    steps = [(speed, torque) for speed in (2.0, 5.0, 8.0, 11.0) for torque in (30.0, 80.0, 150.0)]
    corners = np.cumsum([0.0, *[1.0, 6.0] * len(steps)])
    t = np.arange(0.0, corners[-1], 0.01)
    omega, torque = (
        np.interp(t, corners, [of[0][k], *np.repeat([x[k] for x in of], 2)]) for k, of in ((0, steps), (1, steps))
    )
    power = torque * omega - columns_at(torque, omega) @ TRUE - INERTIA * omega * np.gradient(omega, t)
    sign = -1.0 if reverse else 1.0
    channels = {"speed": sign * omega, "torque": sign * torque, "vdc": np.full(t.size, 100.0), "idc": power / 100.0}
    return Run(name="dyno.csv", t=t, channels=channels, fs=100.0, samples=t.size)


def bench(tmp_path: Path, source: str, inertia: float | None = None) -> Rig:
    text = f'name = "bench"\n[cascade]\nstages = ["mech", "gen"]\n[phases]\nfrom = "{source}"\n'
    if inertia is not None:
        text += f'[drivetrain]\ninertia_rotor = {{ value = {inertia}, unit = "kg.m2" }}\n'
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    return load_rig(tmp_path / "bench.toml")


@pytest.mark.parametrize("reverse", [False, True])
def test_steps_of_a_dynamometer_give_its_losses(tmp_path: Path, reverse: bool) -> None:
    rig = bench(tmp_path, "steps")
    found = make_loss_map(loss_points(reduce(dyno_run(reverse=reverse), rig=rig)))
    assert found.points.loss.size == 12
    assert found.points.speed.min() > 0.0
    assert found.surface.values == pytest.approx(TRUE, rel=0.03)
    sensors = {
        "torque": Sensor("N.m", u_gain=0.01),
        "idc": Sensor("A", u_zero=0.5),
        "vdc": Sensor("V"),
        "flow": Sensor("1", u_gain=1.0),
    }
    points = loss_points(reduce(dyno_run(reverse=reverse), rig=msgspec.structs.replace(rig, sensors=sensors)))
    assert points.errors[:, :, 0] == pytest.approx(
        np.column_stack((0.01 * points.power_in, np.full(12, -50.0), np.zeros(12)))
    )
    assert points.errors[:, 0, 1:] == pytest.approx(points.columns * (0.0, 0.0, 0.0201, 0.01, 0.01))
    assert all(np.diag(fit_surface(points).covariance) > np.diag(found.surface.covariance))


def test_transients_count_with_the_inertia_alone(tmp_path: Path) -> None:
    rig = bench(tmp_path, "whole", INERTIA)
    run = dyno_run()
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
    with pytest.raises(RigError):
        stages_of_loss(Cascade(tuple(BUILT_IN[name] for name in ("line", "mech"))))
    rig, run = bench(tmp_path, "whole"), dyno_run()
    for channels, what in (
        ({**run.channels, "speed": np.zeros(run.t.size)}, "rest"),
        ({"speed": run.t, "torque": run.t}, "gen"),
    ):
        with pytest.raises(LogError, match=what):
            loss_points(reduce(msgspec.structs.replace(run, channels=channels), rig=rig))


@pytest.mark.slow
def test_the_loss_of_the_whole_campaign_is_that_of_the_model() -> None:
    """The shipped campaign as the model of the rig simulates it with noise, against the energy that the model loses."""
    rig, rng, parts, lost = load_rig("hsu2026"), np.random.default_rng(4), [], 0.0
    noise = {"velocity": 0.004, "torque": 0.8, "vdc": 0.3, "idc": 0.01}
    for listed in load_campaign(FIXTURES / "campaign").runs:
        done = simulate(read_run(listed.file, load=listed.load), baseline(rig))
        channels = {n: x + rng.normal(0.0, noise[n], x.size) if n in noise else x for n, x in done.run.channels.items()}
        reduction = reduce(msgspec.structs.replace(done.run, channels=channels), rig=rig, window=listed.window)
        parts.append(loss_points(reduction))
        stores = ("shaft_loss", "mesh", "damper", "windage", "friction", "copper", "diodes")
        spans, v = _spans(reduction)[0], reduction.run.channels["velocity"]
        spans = spans[
            np.abs(means_of(reduction.run.t, [v.__getitem__], spans)[0]) / 0.13 >= TURNING * onset_of_shaft(rig)
        ]
        watts = sum(done.energy[name] for name in stores)
        lost += float(np.diff(np.interp(spans, done.run.t, watts), axis=1).sum())
    found = make_loss_map(joined(parts))
    assert abs(found.energy - lost) < min(1.96 * found.u_energy, 0.02 * lost)
    assert float(found.points.columns @ found.surface.values @ found.points.duration) == pytest.approx(lost, rel=0.02)
    assert found.surface.held_out is not None
    assert found.surface.held_out < 0.05 * found.points.loss.mean()


def test_the_files_hold_the_same_table(tmp_path: Path) -> None:
    found = make_loss_map(scattered(6))
    for ending in 2 * ("csv", "mat", "json"):  # at last over its own file
        write_loss_map(found, tmp_path / f"map.{ending}", "a campaign")
    lines = [line.split(",") for line in (tmp_path / "map.csv").read_text().splitlines() if not line.startswith("#")]
    record = json.loads((tmp_path / "map.json").read_text())
    model = loadmat(tmp_path / "map.mat", squeeze_me=True, simplify_cells=True)["loss_map"]
    assert [float(x) for x in lines[0][1:]] == pytest.approx(found.speed)
    assert [float(row[0]) for row in lines[1:]] == pytest.approx(found.torque)
    read = [[math.nan if x is None else x for x in row] for row in record["loss_w"]]
    for loss in ([[float(x) for x in row[1:]] for row in lines[1:]], read, model["loss_w"]):
        assert np.array(loss) == pytest.approx(found.loss, nan_ok=True)
    assert (record["schema"], model["stage_in"]) == ("winchcascade/loss_map/1", "mech")
    with pytest.raises(OptionError, match=r"map\.txt"):
        write_loss_map(found, tmp_path / "map.txt", "a campaign")
