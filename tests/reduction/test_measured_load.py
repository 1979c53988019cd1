"""Vdc / Idc beside the stated load: printed, and questioned from five standard uncertainties of what the log resolves."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calls import call
from msgspec.structs import replace

from winchcascade import Reduction, Run, read_run, reduce
from winchcascade.core.rig_toml import built_in
from winchcascade.reduction.phased_run import find_phases

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
LOADS = {"r45ohm": 45.0, "r36ohm": 36.0, "r27ohm": 27.0, "r18ohm": 18.0, "r9ohm": 9.0, "r4p5ohm": 4.5}


@cache
def clean(name: str, load: float | None) -> Run:
    return replace(read_run(CAMPAIGN / f"{name}.csv", rig=built_in(), load=36.0), load=load)


def scaled(run: Run, **factors: float) -> Run:
    return replace(run, channels={name: factors.get(name, 1.0) * x for name, x in run.channels.items()})


def kinds(found: Reduction) -> list[str]:
    return [f.kind for f in found.quality]


@pytest.mark.parametrize(("name", "load"), LOADS.items())
def test_the_measured_load_is_that_of_the_log(name: str, load: float) -> None:
    measured = reduce(clean(name, load)).measured_load
    assert measured is not None
    assert measured.ohm == pytest.approx(load, rel=0.002)
    phased = find_phases(clean(name, load), built_in(), "auto")
    gains = load * math.hypot(phased.u_gain("vdc"), phased.u_gain("idc"))
    assert gains < measured.u < 1.5 * gains  # zeros, resolution and noise are small
    assert reduce(clean(name, None)).measured_load == measured  # whatever is stated


@pytest.mark.parametrize(("name", "load"), LOADS.items())
@pytest.mark.parametrize("times", [-6.5, -3.5, 3.5, 6.5])
def test_a_load_is_questioned_from_five_standard_uncertainties(name: str, load: float, times: float) -> None:
    """The load of the log itself deviates by up to 0.1 %, and is known to 0.1 %."""
    rig = built_in()
    without_bleed = replace(rig, dc_link=replace(rig.dc_link, r_bleed=None))
    measured = reduce(clean(name, load)).measured_load
    assert measured is not None
    stated = measured.ohm * (1.0 + times * math.hypot(measured.u / measured.ohm, 0.001))
    found = kinds(reduce(clean(name, stated), rig=without_bleed))
    assert found == (["load_mismatch"] if abs(times) > 5.0 else [])


def test_what_is_not_known_of_a_sensor_is_not_resolved() -> None:
    rig = built_in()
    unknown = replace(rig, sensors={name: sensor for name, sensor in rig.sensors.items() if name != "idc"})
    for off, found in ((0.05, []), (0.15, ["load_mismatch"])):
        assert kinds(reduce(clean("r36ohm", 36.0 * (1.0 + off)), rig=unknown)) == found


def test_a_bleed_resistance_beside_a_large_load_is_no_contradiction() -> None:
    """At 36 ohm in parallel with 400 ohm the sensor of Idc reads 9 % more than the load takes, or does not."""
    rig = built_in()
    bleed = rig.dc_link.r_bleed
    assert bleed is not None
    beside = replace(rig, dc_link=replace(rig.dc_link, r_bleed=replace(bleed, value=400.0)))
    for factor in (1.0, 1.0 + 36.0 / 400.0):
        assert "load_mismatch" not in kinds(reduce(scaled(clean("r36ohm", 36.0), idc=factor), rig=beside))
    assert "load_mismatch" in kinds(reduce(scaled(clean("r36ohm", 36.0), idc=0.95), rig=beside))


@pytest.mark.parametrize("name", ["r36ohm", "r4p5ohm"])
@pytest.mark.parametrize("channel", ["vdc", "idc"])
def test_a_channel_that_is_a_thousand_times_too_small_is_questioned_by_the_load_and_by_the_efficiency(
    name: str, channel: str
) -> None:
    run = scaled(clean(name, LOADS[name]), **{channel: 0.001})
    assert {"load_mismatch", "out_of_range"} <= set(kinds(reduce(run)))
    assert "out_of_range" in kinds(reduce(replace(run, load=None)))  # eta_gen of a thousandth


def test_an_open_circuit_without_a_stated_load_is_questioned_and_a_load_is_not() -> None:
    found = reduce(clean("open_circuit", None))
    assert kinds(found) == ["load_mismatch"]
    assert kinds(reduce(clean("open_circuit", math.inf))) == []
    for name in LOADS:
        assert kinds(reduce(clean(name, None))) == []


def changed(folder: Path, factor: Callable[[str], float]) -> Path:
    """The shipped log of 36 ohm with its columns times a factor."""
    with (CAMPAIGN / "r36ohm.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    path = folder / "log.csv"
    with path.open("w", newline="") as file:
        scale = [factor(name) for name in head]
        body = [[f"{x * float(cell):.6g}" if cell else "" for x, cell in zip(scale, row, strict=True)] for row in rows]
        csv.writer(file).writerows([head, *body])
    return path


def test_the_record_the_terminal_and_the_page_have_it_beside_the_stated_load(tmp_path: Path) -> None:
    log = changed(tmp_path, lambda name: 1.03 if name.startswith("Vdc") else 1.0)
    page = tmp_path / "page.html"
    options = ("--rig", "hsu2026", "--load-ohm", "36")
    called = call("reduce", log, *options, "--json", tmp_path / "it.json", "--html", page)
    record: dict[str, Any] = json.loads((tmp_path / "it.json").read_bytes())
    assert record["log"]["load_ohm"] == 36.0
    assert record["log"]["load_measured_ohm"] == pytest.approx(1.03 * 36.0, rel=0.002)
    assert 0.0 < record["log"]["load_measured_u_ohm"] < 0.2
    shown = f"{record['log']['load_measured_ohm']:.4g}"
    assert f"Vdc / Idc {shown} ohm" in called.out
    assert f"Vdc / Idc {shown}" in page.read_text(encoding="utf-8")
    assert [f["kind"] for f in record["quality"]] == ["load_mismatch"]


BENCH = """name = "dyno"
[cascade]
stages = ["mech", "gen"]
[phases]
from = "steps"
[sensors.vdc]
unit = "V"
accuracy_reading = 0.005
[sensors.idc]
unit = "A"
accuracy_reading = 0.005
"""


@pytest.mark.parametrize(("stated", "found"), [(20.0, []), (20.6, ["load_mismatch"]), (None, [])])
def test_a_bench_with_a_stated_load_is_compared_too(tmp_path: Path, stated: float | None, found: list[str]) -> None:
    rng = np.random.default_rng(5)
    rpm = np.repeat((200.0, 400.0, 600.0), 200)
    volt = 0.3 * rpm + rng.normal(0.0, 0.05, rpm.size)
    amp = volt / 20.0 + rng.normal(0.0, 0.005, rpm.size)
    torque = 1.3 * volt * amp / (rpm * math.pi / 30.0) + rng.normal(0.0, 0.02, rpm.size)
    rows = np.column_stack((0.05 * np.arange(rpm.size), rpm, torque, volt, amp))
    log = tmp_path / "bench.csv"
    np.savetxt(log, rows, "%.6g", ",", header="Time (s),Speed (rpm),Torque (N.m),Vdc (V),Idc (A)", comments="")
    (tmp_path / "bench.toml").write_text(BENCH)
    load = () if stated is None else ("--load-ohm", str(stated))
    record = json.loads(call("reduce", log, "--rig", tmp_path / "bench.toml", *load, "--json", "-").out)
    assert [f["kind"] for f in record["quality"] if f["kind"] == "load_mismatch"] == found
    measured = record["log"]["load_measured_ohm"]
    assert measured is None if stated is None else measured == pytest.approx(20.0, rel=0.002)
