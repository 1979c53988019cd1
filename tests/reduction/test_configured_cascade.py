"""Cascades of other benches: stages of a rig file, their efficiencies, uncertainties and files."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from msgspec.structs import astuple

from winchcascade.core.cascade import PAPER
from winchcascade.core.errors import RigError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import parse_rig, read_rig
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import reduction_json
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.content import Table
from winchcascade.report.frames import write_parquet
from winchcascade.report.render.publish import publish
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.drawn_reduction import drawn_report
from winchcascade.report.results.reduction import reduction_report

LOG = Path("fixtures/campaign/r36ohm.csv")


def rig_with(folder: Path, text: str) -> Rig:
    """The rig of the paper with other tables."""
    path = folder / "rig.toml"
    path.write_text(Path("winchcascade/rigfiles/hsu2026.toml").read_text() + text)
    return read_rig(path)


def reduced(rig: Rig, window: float = 5.48) -> Reduction:
    return reduce(read_run(LOG, rig=rig), rig=rig, window=window)


def test_the_papers_stages_are_one_configuration_of_the_cascade(tmp_path: Path) -> None:
    stated = reduced(rig_with(tmp_path, '[cascade]\nstages = ["line", "mech", "gen"]\n'))
    plain = reduce(read_run(LOG), window=5.48)
    assert stated.mean == plain.mean
    assert stated.rig.cascade.stages == PAPER.stages
    one, other = (json.loads(reduction_json(x, uncertainty(x))) for x in (stated, plain))
    assert one["mean"] == other["mean"]
    assert one["stages"]["mean"].items() <= one["mean"].items()
    assert "stages" not in other


def test_two_stages_have_one_efficiency_and_no_net_energies(tmp_path: Path) -> None:
    result = reduced(rig_with(tmp_path, '[cascade]\nstages = ["mech", "gen"]\n'))
    assert result.rig.cascade.ratios == {"eta_gen": ("energy_gen", "energy_mech")}
    assert result.mean.eta_gen == pytest.approx(0.7711, abs=1e-4)
    assert result.mean.energy_line is None
    assert result.mean.energy_net is None
    assert "whole-cycles" not in [one.id for one in reduction_report(result, uncertainty(result)).filled]


def test_a_motor_test_runs_the_other_way(tmp_path: Path) -> None:
    forward = reduced(rig_with(tmp_path, '[cascade]\nstages = ["mech", "gen"]\n'))
    back = reduced(rig_with(tmp_path, '[cascade]\nstages = ["gen", "mech"]\n'))
    assert back.mean.value("eta_gen_mech") > 1.0
    assert [f.kind for f in back.quality].count("efficiency_above_one") == 1
    assert back.mean.energy_gen == forward.mean.energy_gen


def test_stages_that_share_their_channels_share_their_errors(tmp_path: Path) -> None:
    text = '[cascade]\nstages = ["line", "hyd", "mech"]\n[stage.hyd]\npower = "force * velocity"\n'
    result = reduced(rig_with(tmp_path, text))
    found = uncertainty(result)
    assert result.mean.eta_line_hyd == pytest.approx(1.0)
    assert found.standard.eta_line_hyd == pytest.approx(0.0, abs=1e-9)
    assert found.standard.eta_hyd_mech == pytest.approx(found.standard.value("eta_trans"), rel=1e-6)
    assert result.rig.cascade.ratios.keys() == {"eta_line_hyd", "eta_hyd_mech", "eta_trans"}


def test_the_json_splits_the_uncertainty_of_configured_stages_too(tmp_path: Path) -> None:
    result = reduced(rig_with(tmp_path, '[cascade]\nstages = ["line", "gen"]\n[stage.gen]\npower = "vdc * idc"\n'))
    rig = rig_with(tmp_path, '[cascade]\nstages = ["line", "ours"]\n[stage.ours]\npower = "vdc * idc"\n')
    plain, own = (json.loads(reduction_json(r))["uncertainty"] for r in (result, reduced(rig)))
    for part in ("sensors", "repeatability"):
        assert own[part]["eta_line_ours"] == pytest.approx(plain[part]["eta_pto"])
    squares = sum((row["contribution"]["eta_line_ours"] or 0.0) ** 2 for row in own["budget"])
    assert squares**0.5 == pytest.approx(own["sensors"]["eta_line_ours"])
    assert own["stated"]["energy_ours_j"] == "gum"


def test_a_power_may_be_counted_the_other_way_in_a_log(tmp_path: Path) -> None:
    text = '[cascade]\nstages = ["mech", "gen"]\n[stage.gen]\npower = "-vdc * idc"\n'
    opposite = reduced(rig_with(tmp_path, text))
    plain = reduced(rig_with(tmp_path, '[cascade]\nstages = ["mech", "gen"]\n'))
    assert opposite.mean.value("energy_gen") == pytest.approx(-plain.mean.value("energy_gen"))
    u, expected = uncertainty(opposite).standard, uncertainty(plain).standard
    assert u.energy_gen == pytest.approx(expected.energy_gen)


def test_an_own_channel_gives_a_stage_its_power(tmp_path: Path) -> None:
    log = tmp_path / "with flow.csv"
    lines = LOG.read_text().splitlines()
    lines = [lines[0] + ",Oil flow (L/min)", *(line + ",60" for line in lines[1:])]
    log.write_text("\n".join(lines))
    rig = rig_with(
        tmp_path,
        '[channels.oil]\nunit = "L/min"\n[columns]\noil = "Oil flow (L/min)"\n'
        '[cascade]\nstages = ["oilside", "mech"]\n[stage.oilside]\npower = "pressure * oil"\nwhere = "the oil"\n'
        '[sensors.oil]\nunit = "L/min"\naccuracy_reading = 0.01\n',
    )
    run = read_run(log, rig=rig)
    assert run.channels["oil"] == pytest.approx(1e-3)
    result = reduce(run, rig=rig, window=5.48)
    cycle = result.cycles[0]
    rows = slice(*np.searchsorted(run.t, (cycle.window.onset, cycle.window.cutoff)).tolist())
    by_hand = float(np.trapezoid(run.channels["pressure"][rows] * 1e-3, run.t[rows]))
    assert cycle.metrics.energy_oilside == pytest.approx(by_hand, rel=0.02)
    report = drawn_report(result, uncertainty(result))
    assert "E_oilside" in terminal_text(report)
    publish(report, html=tmp_path / "a.html", pdf=tmp_path / "a.pdf")
    page = (tmp_path / "a.html").read_text()
    assert "oilside: the oil" in page
    files = write_parquet(result, tmp_path / "tables")
    columns = pq.read_table(files[0]).to_pydict()
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
    names = ("vdc", "idc", "charge", "power_ac", "force", "velocity", "torque", "speed", "power_mech")
    channels = {name: np.full(2, x) for name, x in zip(names, (2, 3, 5, 7, 11, 13, 17, 19, 23), strict=True)}
    text = f'[channels.charge]\nunit = "A"\n[stage.own]\npower = "{power}"\n[cascade]\nstages = ["line", "own"]\n'
    stage = parse_rig('name = "bench"\n' + text, "rig.toml").cascade.stages[1]
    assert stage.watts(channels, 0.13) == pytest.approx(watts)
    again = parse_rig(
        'name = "bench"\n' + text.replace(power, stage.powers[0].text.replace(" / r_drum", "")), "rig.toml"
    )
    assert again.cascade.stages[1].powers == stage.powers


def test_what_flows_back_has_its_own_efficiency(tmp_path: Path) -> None:
    t = np.arange(0.0, 40.0, 0.05)
    force = 100.0 + 20.0 * np.sin(3.0 * t)
    v = np.sin(0.25 * np.pi * t)
    out = force * v * np.where(v > 0.0, 0.8, 1.0 / 0.6)
    rows = [f"{a:.2f},{b:.9f},{c:.9f},{d:.9f}" for a, b, c, d in zip(t, force, v, out, strict=True)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["Time (s),Force (N),Velocity (m/s),AC power (W)", *rows]))
    bench = parse_rig('name = "bench"\n[cascade]\nstages = ["line", "ac"]\n', "rig.toml")
    result = reduce(read_run(log, rig=bench))
    stages = json.loads(reduction_json(result))["stages"]
    assert len(result.complete) > 2
    assert stages["efficiency_out"]["eta_line_ac"] == pytest.approx(0.8, rel=1e-3)
    assert stages["efficiency_back"]["eta_line_ac"] == pytest.approx(0.6, rel=1e-3)
    cycles = [c.net for c in result.complete]
    rest = [np.interp(np.linspace(c.begin, c.end, 9999), t, force * v).mean() * (c.end - c.begin) for c in cycles]
    assert stages["energy_out_j"]["line"] + stages["energy_back_j"]["line"] == pytest.approx(sum(rest), abs=0.5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *(
            (f'[stage.hyd]\npower = "{power}"\n', "power")
            for power in (
                "",
                "2",
                "vdc idc",
                "vdc * * idc",
                "(vdc * idc)",
                "1e999 * vdc",
                "0 * vdc",
                "3 * displacement",
                "vdc +",
            )
        ),
        (
            '[cascade]\nstages = ["line", "shaft"]\n',
            "shaft is no entry here; expected one of line, mech, gen, hyd, ac",
        ),
        ("[cascade]\nstages = []\n", "a list of length >= 1"),
        ('[cascade]\nstages = ["line", "line"]\n', "expected each stage once"),
        ('[cascade]\nstage = ["line"]\n', "stage is no entry here"),
        ('[stage.hyd]\npower = "vdc * force"\n', "is no power"),
        ('[stage.hyd]\npower = "force * speed"\n', "is no power"),
        ('[stage.hyd]\npower = "pressure * oil"\n', "channel oil is no entry here"),
        ('[stage.hyd_2]\npower = "power_ac"\n', "a name of letters and digits"),
        ('[stage.net]\npower = "power_ac"\n', "a name of letters and digits"),
        ('[stage.hyd]\npower = "force * velocity * vdc"\n', "is no power"),
        ('[stage]\nhyd = "force * velocity"\n', "{'hyd': 'force * velocity'}; expected a table"),
    ],
)
def test_a_wrong_cascade_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(RigError) as fault:
        rig_with(tmp_path, text)
    assert words in str(fault.value)
    assert str(tmp_path / "rig.toml") in str(fault.value)


def test_steps_of_a_dyno_are_no_repeats_of_each_other(tmp_path: Path) -> None:
    rig = tmp_path / "dyno.toml"
    rig.write_text(
        'name = "dyno"\n[log]\nsample_rate_hz = 10\n[phases]\nfrom = "steps"\n[cascade]\nstages = ["gen", "mech"]\n'
        '[sensors.torque]\nunit = "N.m"\naccuracy_reading = 0.01\n[sensors.speed]\nunit = "rpm"\naccuracy_reading = 0.001\n'
    )
    rng = np.random.default_rng(3)
    speeds = np.repeat([300.0, 600.0, 900.0], 80)
    rows = [f"{n:.2f},{0.5 + 1e-3 * e:.5f}" for n, e in zip(speeds, rng.standard_normal(speeds.size), strict=True)]
    log = tmp_path / "dyno.csv"
    log.write_text("\n".join(["Speed (rpm),Torque (N.m)", *rows]))
    bench = read_rig(rig)
    result = reduce(read_run(log, rig=bench), rig=bench)
    found = uncertainty(result)
    assert [round(c.metrics.value("power_mech"), 1) for c in result.cycles] == [15.7, 31.4, 47.1]
    assert result.max_deviation_percent.energy_mech is None
    assert found.budget.repeatability.energy_mech is None
    assert found.standard.value("energy_mech") < 0.02 * result.mean.value("energy_mech")
    reasons = [f.message for f in result.quality if f.kind == "missing_channel"]
    assert reasons == ["stage gen has no power (vdc * idc): the log has no vdc and no idc"]
    report = drawn_report(result, found)
    assert "mean of" not in terminal_text(report)
    publish(report, html=tmp_path / "a.html", pdf=tmp_path / "a.pdf")
    page = (tmp_path / "a.html").read_text()
    assert "all cycles together" in page
    assert "Speed of the shaft" in page


def test_a_whole_record_states_what_flows_both_ways_and_bears_a_short_gap(tmp_path: Path) -> None:
    rig = tmp_path / "buoy.toml"
    rig.write_text('name = "buoy"\n[phases]\nfrom = "whole"\n[cascade]\nstages = ["mech"]\n')
    bench = read_rig(rig)
    t = np.delete(np.arange(0.0, 200.0, 0.05), slice(1000, 1030))
    torque, omega = 2.0 * np.sin(0.8 * t) + 0.3, 3.0 * np.sin(0.8 * t + 1.2)
    log = tmp_path / "buoy.csv"
    rows = [f"{a:.3f},{b:.6f},{c:.6f}" for a, b, c in zip(t, torque, omega, strict=True)]
    log.write_text("\n".join(["Time (s),Torque (N.m),Speed (rad/s)", *rows]))
    result = reduce(read_run(log, rig=bench), rig=bench)
    fine = np.arange(0.0, 200.0, 1e-3)
    power = (2.0 * np.sin(0.8 * fine) + 0.3) * 3.0 * np.sin(0.8 * fine + 1.2)
    forth, back = astuple(result.both_ways["mech"])
    assert len(result.complete) == 1
    assert forth == pytest.approx(float(np.maximum(power, 0.0).sum() * 1e-3), rel=0.02)
    assert back == pytest.approx(float(np.minimum(power, 0.0).sum() * 1e-3), rel=0.03)
    assert result.mean.energy_mech == pytest.approx(forth + back, rel=1e-3)
    (row,) = next(
        block.texts
        for block in reduction_report(result, uncertainty(result)).blocks
        if isinstance(block, Table) and block.id == "directions"
    )
    assert [float(cell) for cell in row[1:]] == pytest.approx([forth, back], rel=0.01)
