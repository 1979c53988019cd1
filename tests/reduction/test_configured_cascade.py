"""Cascades of other benches: stages of a rig file, their efficiencies, uncertainties and files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from winchcascade.core.cascade import PAPER
from winchcascade.core.errors import RigError
from winchcascade.core.rig_toml import built_in, built_in_text, parse_rig
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import reduction_json
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.content import Table
from winchcascade.report.frames import write_parquet
from winchcascade.report.render.report_files import publish
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.reduction import reduction_report

LOG = Path("fixtures/campaign/r36ohm.csv")
PLAIN = reduce(read_run(LOG, rig=built_in()), window=5.48)
HSU = built_in_text("hsu2026")


def stages(*names: str, more: str = "") -> Reduction:
    rig = parse_rig(f"{HSU}[cascade]\nstages = {json.dumps(names)}\n{more}", "rig.toml")
    return reduce(read_run(LOG, rig=rig), window=5.48)


def record(result: Reduction) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(reduction_json(result))
    return found


def bench(folder: Path, text: str, **columns: np.ndarray) -> Reduction:
    """The reduction of a log of some columns with a rig file of its own."""
    rows = [",".join(f"{x:.9g}" for x in row) for row in zip(*columns.values(), strict=True)]
    (folder / "log.csv").write_text("\n".join([",".join(HEADERS[name] for name in columns), *rows]))
    return reduce(
        read_run(folder / "log.csv", rig=parse_rig(f'name = "bench"\n{text}', "rig.toml"))
    )


HEADERS = {
    "t": "Time (s)", "force": "Force (N)", "velocity": "Velocity (m/s)", "ac": "AC power (W)", "rpm": "Speed (rpm)",
    "torque": "Torque (N.m)", "omega": "Speed (rad/s)",
}  # fmt: skip


def test_the_papers_stages_are_one_configuration_of_the_cascade() -> None:
    stated = stages("line", "mech", "gen")
    assert (stated.mean, stated.rig.cascade.stages) == (PLAIN.mean, PAPER.stages)
    one, other = record(stated), record(PLAIN)
    assert one["mean"] == other["mean"]
    assert one["stages"]["mean"].items() <= one["mean"].items()
    assert "stages" not in other


def test_two_stages_have_one_efficiency_and_no_net_energies_in_either_direction() -> None:
    result, back = stages("mech", "gen"), stages("gen", "mech")
    assert result.rig.cascade.ratios == {"eta_gen": ("energy_gen", "energy_mech")}
    assert result.mean.eta_gen == pytest.approx(PLAIN.mean.value("eta_gen"))
    assert (result.mean.energy_line, result.mean.energy_net) == (None, None)
    assert "whole-cycles" not in [
        one.id for one in reduction_report(result, uncertainty(result)).illustrated().sections
    ]
    assert back.mean.value("eta_gen_mech") == pytest.approx(
        1.0 / result.mean.value("eta_gen"), rel=1e-3
    )
    assert [f.kind for f in back.quality].count("efficiency_above_one") == 1


def test_stages_that_share_their_channels_share_their_errors() -> None:
    result = stages("line", "hyd", "mech", more='[stage.hyd]\npower = "force * velocity"\n')
    found = uncertainty(result).standard
    assert result.mean.eta_line_hyd == pytest.approx(1.0)
    assert found.eta_line_hyd == pytest.approx(0.0, abs=1e-9)
    assert found.eta_hyd_mech == pytest.approx(found.value("eta_trans"), rel=1e-6)
    assert result.rig.cascade.ratios.keys() == {"eta_line_hyd", "eta_hyd_mech", "eta_trans"}


def test_the_json_splits_the_uncertainty_of_configured_stages_too() -> None:
    plain, own = (
        record(stages("line", name, more=f'[stage.{name}]\npower = "vdc * idc"\n'))["uncertainty"]
        for name in ("gen", "ours")
    )
    for part in ("sensors", "repeatability"):
        assert own[part]["eta_line_ours"] == pytest.approx(plain[part]["eta_pto"])
    squares = sum((row["contribution"]["eta_line_ours"] or 0.0) ** 2 for row in own["budget"])
    assert squares**0.5 == pytest.approx(own["sensors"]["eta_line_ours"])


def test_a_power_may_be_counted_the_other_way_in_a_log() -> None:
    opposite = stages("mech", "gen", more='[stage.gen]\npower = "-vdc * idc"\n')
    assert opposite.mean.value("energy_gen") == pytest.approx(-PLAIN.mean.value("energy_gen"))
    u, expected = (uncertainty(of).standard.energy_gen for of in (opposite, PLAIN))
    assert u == pytest.approx(expected)


def test_an_own_channel_gives_a_stage_its_power(tmp_path: Path) -> None:
    log = tmp_path / "with flow.csv"
    head, *lines = LOG.read_text().splitlines()
    log.write_text("\n".join([head + ",Oil flow (L/min)", *(line + ",60" for line in lines)]))
    text = (
        '[channels.oil]\nunit = "L/min"\n[columns]\noil = "Oil flow (L/min)"\n'
        '[cascade]\nstages = ["oilside", "mech"]\n[stage.oilside]\npower = "pressure * '
        'oil"\nwhere = "the oil"\n'
        '[sensors.oil]\nunit = "L/min"\naccuracy_reading = 0.01\n'
    )
    run = read_run(log, rig=parse_rig(HSU + text, "rig.toml"))
    result = reduce(run, window=5.48)
    window = result.cycles[0].window
    rows = slice(*np.searchsorted(run.t, (window.onset, window.cutoff)).tolist())
    by_hand = float(np.trapezoid(run.channels["pressure"][rows] * 1e-3, run.t[rows]))
    assert result.cycles[0].metrics.energy_oilside == pytest.approx(by_hand, rel=0.02)
    report = reduction_report(result, uncertainty(result))
    publish(report, html=tmp_path / "a.html")
    assert "E_oilside" in terminal_text(report)
    assert "oilside: the oil" in (tmp_path / "a.html").read_text()
    columns = pq.read_table(write_parquet(result, tmp_path / "tables")[0]).to_pydict()
    assert columns["energy_oilside_j"] == [c.metrics.energy_oilside for c in result.cycles]


@pytest.mark.parametrize(
    ("power", "watts"),
    [
        ("vdc * idc + 60 * charge", 2.0 * 3.0 + 60.0 * 5.0),
        ("60 * charge - vdc*idc", 60.0 * 5.0 - 2.0 * 3.0),
        (" - force * velocity - 1.5e1 * power_ac", -11.0 * 13.0 - 15.0 * 7.0),
        ("0.5 * torque * speed + 4", 0.5 * 17.0 * 19.0 + 4.0),
        ("torque * velocity + power_mech", 17.0 * 13.0 / 0.13 + 23.0),
    ],
)
def test_a_power_is_a_sum_of_products_of_channels_and_constants(power: str, watts: float) -> None:
    names = (
        "vdc",
        "idc",
        "charge",
        "power_ac",
        "force",
        "velocity",
        "torque",
        "speed",
        "power_mech",
    )
    channels = {
        name: np.full(2, x) for name, x in zip(names, (2, 3, 5, 7, 11, 13, 17, 19, 23), strict=True)
    }
    text = 'name = "bench"\n[channels.charge]\nunit = "A"\n[stage.own]\npower = "{}"\n[cascade]\nstages = ["line", "own"]\n'
    stage = parse_rig(text.format(power), "rig.toml").cascade.stages[1]
    assert stage.watts(channels, 0.13) == pytest.approx(watts)
    again = parse_rig(text.format(stage.powers[0].text.replace(" / r_drum", "")), "rig.toml")
    assert again.cascade.stages[1].powers == stage.powers


@pytest.mark.parametrize(
    "text",
    [
        *(
            f'[stage.hyd]\npower = "{power}"\n'
            for power in ("", "2", "vdc * * idc", "vdc / (vdc + idc)", "1e999 * vdc")
        ),
        *(
            f'[stage.hyd]\npower = "{power}"\n'
            for power in ("0 * vdc", "3 * displacement", "vdc +", "vdc * force")
        ),
        *(
            f'[stage.hyd]\npower = "{power}"\n'
            for power in ("force * speed", "pressure * oil", "force * velocity * vdc")
        ),
        *(f'[stage.{name}]\npower = "power_ac"\n' for name in ("hyd_2", "net")),
        *(
            f"[cascade]\n{of}\n"
            for of in ('stages = ["line", "shaft"]', "stages = []", 'stages = ["line", "line"]')
        ),
        '[cascade]\nstage = ["line"]\n',
        '[stage]\nhyd = "force * velocity"\n',
    ],
)
def test_a_wrong_cascade_is_one_sentence(text: str) -> None:
    with pytest.raises(RigError, match=r"^rig\.toml: .*(stage|power)"):
        parse_rig(HSU + text, "rig.toml")


# -------------------------------------------------------------------------- cycles that are spans
def test_what_flows_back_has_its_own_efficiency(tmp_path: Path) -> None:
    t = np.arange(0.0, 40.0, 0.05)
    force, v = 100.0 + 20.0 * np.sin(3.0 * t), np.sin(0.25 * np.pi * t)
    ac = force * v * np.where(v > 0.0, 0.8, 1.0 / 0.6)
    result = bench(
        tmp_path, '[cascade]\nstages = ["line", "ac"]\n', t=t, force=force, velocity=v, ac=ac
    )
    found = record(result)["stages"]
    assert len(result.complete) > 2
    assert found["efficiency_out"]["eta_line_ac"] == pytest.approx(0.8, rel=1e-3)
    assert found["efficiency_back"]["eta_line_ac"] == pytest.approx(0.6, rel=1e-3)
    cycles = [c.net for c in result.complete]
    rest = [
        np.interp(np.linspace(c.begin, c.end, 9999), t, force * v).mean() * (c.end - c.begin)
        for c in cycles
    ]
    assert found["energy_out_j"]["line"] + found["energy_back_j"]["line"] == pytest.approx(
        sum(rest), abs=0.5
    )


def test_steps_of_a_dyno_are_no_repeats_of_each_other(tmp_path: Path) -> None:
    text = (
        '[log]\nsample_rate_hz = 10\n[phases]\nfrom = "steps"\n[cascade]\nstages = ["gen", '
        '"mech"]\n'
        '[sensors.torque]\nunit = "N.m"\naccuracy_reading = 0.01\n[sensors.speed]\nunit = '
        '"rpm"\naccuracy_reading = 0.001\n'
    )
    speeds = np.repeat([300.0, 600.0, 900.0], 80)
    torque = 0.5 + 1e-3 * np.random.default_rng(3).standard_normal(speeds.size)
    result = bench(tmp_path, text, rpm=speeds, torque=torque)
    found = uncertainty(result)
    assert [round(c.metrics.value("power_mech"), 1) for c in result.cycles] == [15.7, 31.4, 47.1]
    assert (result.max_deviation_percent.energy_mech, found.budget.repeatability.energy_mech) == (
        None,
        None,
    )
    assert found.standard.value("energy_mech") < 0.02 * result.mean.value("energy_mech")
    reasons = [f.message for f in result.quality if f.kind == "missing_channel"]
    assert reasons == ["stage gen has no power (vdc * idc): the log has no vdc and no idc"]
    assert "mean of" not in terminal_text(reduction_report(result, found))


def test_a_whole_record_states_what_flows_both_ways_and_bears_a_short_gap(tmp_path: Path) -> None:
    def signals(t: np.ndarray) -> dict[str, np.ndarray]:
        return {"t": t, "torque": 2.0 * np.sin(0.8 * t) + 0.3, "omega": 3.0 * np.sin(0.8 * t + 1.2)}

    log = signals(np.delete(np.arange(0.0, 200.0, 0.05), slice(1000, 1030)))
    result = bench(tmp_path, '[phases]\nfrom = "whole"\n[cascade]\nstages = ["mech"]\n', **log)
    fine = signals(np.arange(0.0, 200.0, 1e-3))
    power, flow = fine["torque"] * fine["omega"], result.both_ways["mech"]
    assert len(result.complete) == 1
    assert flow.positive == pytest.approx(float(np.maximum(power, 0.0).sum() * 1e-3), rel=0.02)
    assert flow.negative == pytest.approx(float(np.minimum(power, 0.0).sum() * 1e-3), rel=0.03)
    assert result.mean.energy_mech == pytest.approx(flow.positive + flow.negative, rel=1e-3)
    blocks = reduction_report(result, uncertainty(result)).blocks
    (row,) = next(
        block.texts for block in blocks if isinstance(block, Table) and block.id == "directions"
    )
    assert [float(cell) for cell in row[1:]] == pytest.approx(
        [flow.positive, flow.negative], rel=0.01
    )


def test_torque_without_a_drum_radius_is_reported() -> None:
    found = reduce(read_run(LOG, rig=parse_rig('name = "bare"\n', "bare.toml")))
    assert (found.mean.energy_mech, found.mean.eta_pto is not None) == (None, True)
    assert "torque" in [f.channel for f in found.quality if f.kind == "missing_channel"]
