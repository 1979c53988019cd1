"""Losses of a stage by their laws, and their map: what a bench loses is found, with its stores,
its sensors and its bounds.
"""

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.io import loadmat

from winchcascade.core.errors import LogError, OptionError, RigError
from winchcascade.core.rig_file import Rig, Sensor, StatedLaw
from winchcascade.core.rig_toml import read_rig
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.campaign_entries import Entries
from winchcascade.diagnosis.stages.diagnose_stages import diagnose_stages
from winchcascade.diagnosis.stages.stage_map import LossMap, convex_hull, make_loss_map
from winchcascade.diagnosis.stages.stage_samples import stage_data
from winchcascade.ingest.read import read_run
from winchcascade.report.results.loss_map import write_loss_map
from winchcascade.rig.baseline import load_rig
from winchcascade.rig.effects.catalogue import EFFECTS

TRUE = {
    "shaft_friction": 3.0, "shaft_viscous": 0.2, "copper_torque": 0.001, "junction_torque": 0.1, "power_share": 0.03,
}  # fmt: skip
"""Losses of the bench; the names are those of its map."""

INERTIA = 0.4


def lost(torque: Signal, speed: Signal) -> Signal:
    """What the bench loses. [W]"""
    over = speed, speed**2, torque**2, np.abs(torque), speed * torque
    return np.asarray(
        np.sum([number * x for number, x in zip(TRUE.values(), over, strict=True)], axis=0)
    )


def dyno_run(*, reverse: bool = False, noise: float = 0.0) -> Run:
    """A dynamometer at steps of 6 s of speed and torque, joined by ramps of 1 s, at 100 Hz."""
    steps = [
        (speed, torque)
        for speed in (2.0, 5.0, 8.0, 11.0, 14.0)
        for torque in (30.0, 80.0, 150.0, 220.0)
    ]
    corners = np.cumsum([0.0, *[1.0, 6.0] * len(steps)])
    t = np.arange(0.0, corners[-1], 0.01)
    omega, torque = (np.interp(t, corners, [of[0], *np.repeat(of, 2)]) for of in np.array(steps).T)
    power = torque * omega - lost(torque, omega) - INERTIA * omega * np.gradient(omega, t)
    sign, rng = -1.0 if reverse else 1.0, np.random.default_rng(0)
    channels = {
        "speed": sign * omega,
        "torque": sign * torque,
        "vdc": np.full(t.size, 100.0),
        "idc": power / 100.0,
    }
    for name, x in channels.items():
        x += rng.normal(0.0, noise * float(np.max(np.abs(x))) + 1e-12, t.size) * (name != "speed")
    return Run(name="dyno.csv", t=t, channels=channels, fs=100.0, samples=t.size)


def turned(run: Run) -> Run:
    """The same shaft turning the other way."""
    signs = {"speed": -1.0, "torque": -1.0}
    return msgspec.structs.replace(
        run, name="back.csv", channels={n: signs.get(n, 1.0) * x for n, x in run.channels.items()}
    )


def bench(
    tmp_path: Path, text: str = "", source: str = "whole", stages: str = '"mech", "gen"'
) -> Rig:
    rig = f'name = "bench"\n[cascade]\nstages = [{stages}]\n[phases]\nfrom = "{source}"\n{text}'
    (tmp_path / "bench.toml").write_text(rig, encoding="utf-8")
    return load_rig(tmp_path / "bench.toml")


def numbers(found: LossMap) -> dict[str, float]:
    return {one.name: one.number.value for one in found.laws}


# --------------------------------------------------------------------------------------- the laws
@pytest.mark.parametrize("source", ["steps", "whole"])
@pytest.mark.parametrize("reverse", [False, True])
def test_the_map_of_a_dynamometer_has_its_losses_and_its_inertia(
    tmp_path: Path, source: str, reverse: bool
) -> None:
    found = make_loss_map([dyno_run(reverse=reverse, noise=1e-4)], bench(tmp_path, source=source))
    assert numbers(found).keys() >= TRUE.keys()
    for name, true in TRUE.items():
        assert numbers(found)[name] == pytest.approx(true, rel=0.1)
    if source == "whole":  # ramps between the steps show what is stored
        assert numbers(found)["shaft_inertia"] == pytest.approx(INERTIA, rel=0.05)
    inside = found.inside
    grid = np.stack(np.meshgrid(found.motion, found.load), axis=-1)
    assert found.loss[inside] == pytest.approx(lost(grid[..., 1], grid[..., 0])[inside], rel=0.03)
    assert found.points[:, 0].min() > 0.0
    assert found.held_out < 0.02 * found.lost.mean()


def test_a_stated_law_is_no_cause_and_one_that_deviates_is_named_with_its_whole_number(
    tmp_path: Path,
) -> None:
    made = dyno_run(noise=1e-4)
    channels = {"power_ac": made.channels["vdc"] * made.channels["idc"], **made.channels}
    run = msgspec.structs.replace(
        made, channels={name: channels[name] for name in ("speed", "torque", "power_ac")}
    )
    laws = {
        "shaft_inertia": StatedLaw(INERTIA, "kg.m2", 0.01),
        "shaft_friction": StatedLaw(3.0, "N.m", 0.05),
        "shaft_viscous": StatedLaw(0.2, "N.m.s/rad", 0.004),
        "power_share": StatedLaw(0.03, "relative", 0.001),
    }
    rig = bench(tmp_path, stages='"mech", "ac"')
    rig = msgspec.structs.replace(rig, laws={"ac": laws})
    names = [cause.effect for cause in diagnose_stages(Entries([run]), rig, EFFECTS).causes]
    assert names == ["copper_torque", "junction_torque"]
    rig = msgspec.structs.replace(
        rig, laws={"ac": laws | {"shaft_friction": StatedLaw(1.0, "N.m", 0.05)}}
    )
    causes = {cause.effect: cause for cause in diagnose_stages(Entries([run]), rig, EFFECTS).causes}
    (other,) = causes.keys() - {
        *names
    }  # of a shaft that turns one way, a zero of its torque looks the same
    assert {other, *(one.effect for one in causes[other].look_alikes)} >= {
        "shaft_friction",
        "torque_zero",
    }
    reversed_too = Entries([run, turned(run)])
    causes = {cause.effect: cause for cause in diagnose_stages(reversed_too, rig, EFFECTS).causes}
    number = causes["shaft_friction"].parameters["torque"]
    assert number.low < 3.0 < number.high


def test_a_sensor_within_what_the_rig_file_states_is_no_loss(tmp_path: Path) -> None:
    run = dyno_run(noise=1e-4)
    rig = bench(tmp_path)
    high = msgspec.structs.replace(
        run, channels={**run.channels, "torque": 1.01 * run.channels["torque"]}
    )
    known = msgspec.structs.replace(rig, sensors={"torque": Sensor("N.m", u_gain=0.01)})
    share, wide = (numbers(make_loss_map([high], one))["power_share"] for one in (rig, known))
    assert share == pytest.approx(0.04, abs=0.004)
    (law,) = (one for one in make_loss_map([high], known).laws if one.name == "power_share")
    assert law.number.low < 0.03 < law.number.high
    assert wide == pytest.approx(0.04, abs=0.02)


def test_a_zero_grows_with_the_factor_of_the_power_that_its_sensor_does_not_read(
    tmp_path: Path,
) -> None:
    laws = stage_data(Entries([dyno_run()]), bench(tmp_path), EFFECTS).laws.values()
    of_motion = {one.channel: one.of_motion for one in laws if one.law.kind == "zero"}
    assert of_motion == {"torque": False, "vdc": True, "idc": False}


def test_laws_that_the_rig_file_states_wrongly_are_rejected(tmp_path: Path) -> None:
    run = dyno_run()
    for laws, what in (
        ({"shaft_friction": StatedLaw(1.0, "W")}, "N.m"),
        ({"pressure_drop": StatedLaw(1.0, "Pa.s2/m6")}, "no such law"),
    ):
        with pytest.raises(RigError, match=what):
            make_loss_map([run], msgspec.structs.replace(bench(tmp_path), laws={"gen": laws}))
    with pytest.raises(RigError, match="shaft_friction"):
        bench(tmp_path, '[laws.gen]\nshaft_friction = { value = "much", unit = "N.m" }\n')
    assert (
        bench(tmp_path, '[laws.gen]\ncopper = { value = 2, unit = "ohm", u = 0.1 }\n')
        .laws["gen"]["copper"]
        .u
        == 0.1
    )


def test_no_map_exists_of_one_power_or_of_a_shaft_at_rest(tmp_path: Path) -> None:
    run = dyno_run()
    with pytest.raises(LogError, match="gen"):
        make_loss_map(
            [msgspec.structs.replace(run, channels={"speed": run.t, "torque": run.t})],
            bench(tmp_path),
        )
    still = {**run.channels, "speed": 0.0 * run.t}
    with pytest.raises(LogError, match="is 0 throughout"):
        make_loss_map([msgspec.structs.replace(run, channels=still)], bench(tmp_path))


# -------------------------------------------------------------------------------------- the table
def test_the_hull_holds_every_point_and_none_beyond() -> None:
    points = np.random.default_rng(1).normal(size=(50, 2))
    hull, inside = convex_hull(points, points)
    assert inside.all()
    assert not convex_hull(points, hull.mean(axis=0) + 1.01 * (hull - hull.mean(axis=0)))[1].any()
    assert not convex_hull(points * (1.0, 0.0), points * (1.0, 0.0))[1].any()  # a straight line


def test_the_files_hold_the_same_table(tmp_path: Path) -> None:
    found = make_loss_map([dyno_run(noise=1e-4)], bench(tmp_path))
    for ending in 2 * ("csv", "mat", "json"):  # at last over its own file
        write_loss_map(found, tmp_path / f"map.{ending}", "a campaign")
    lines = [
        line.split(",")
        for line in (tmp_path / "map.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    record = json.loads((tmp_path / "map.json").read_text())
    model = loadmat(tmp_path / "map.mat", squeeze_me=True, simplify_cells=True)["loss_map"]
    assert [float(x) for x in lines[0][1:]] == pytest.approx(found.motion)
    assert [float(row[0]) for row in lines[1:]] == pytest.approx(found.load)
    read = [[math.nan if x is None else x for x in row] for row in record["loss_w"]]
    table = np.where(found.inside, found.loss, np.nan)
    for loss in ([[float(x) for x in row[1:]] for row in lines[1:]], read, model["loss_w"]):
        assert np.array(loss) == pytest.approx(table, nan_ok=True)
    assert (record["schema"], model["stage_in"]) == ("winchcascade/loss_map/2", "mech")
    assert {name: law["value"] for name, law in record["laws"].items()} == pytest.approx(
        numbers(found)
    )
    grid = [
        line.split(",")
        for line in (tmp_path / "map_grid.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    _, _, loss, _, inside = np.array(grid[1:], dtype=np.float64).T
    assert loss.reshape(found.loss.shape) == pytest.approx(found.loss, rel=1e-6)
    assert inside.sum() == found.inside.sum()
    with pytest.raises(OptionError, match=r"map\.txt"):
        write_loss_map(found, tmp_path / "map.txt", "a campaign")


def test_what_a_rig_stores_is_stated_beside_its_map(fixtures: Path) -> None:
    """A capacitor stores with the voltage, which is no axis of the map."""
    folder = fixtures / "campaign"
    rig = read_rig(folder / "rig.toml")
    found = make_loss_map([read_run(folder / "r18ohm.csv", rig=rig, load=18.0)], rig)
    assert "capacitor" in {law.name for law in found.laws}
    assert np.isfinite(found.loss).all()
