"""Frames hold the numbers of the JSON and the Parquet tables, and plots draw them; the methods
of results do the same.
"""

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import msgspec
import numpy as np
import pandas as pd
import pytest
from diagnosed import diagnosed

from winchcascade import (
    CampaignReduction,
    Reduction,
    audit,
    calibrate,
    compare,
    frame,
    open_campaign,
    plot,
    read_run,
    reduce,
    simulate,
    summary_html,
)
from winchcascade.core.errors import OptionError
from winchcascade.core.extras import is_installed
from winchcascade.reduction.run_record import reduction_json
from winchcascade.report.content import Picture
from winchcascade.report.frames import RUNS_MAX, write_parquet
from winchcascade.report.results.diagnosis_record import as_json

mpl.use("Agg")


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture(name="reduction", scope="module")
def _reduction() -> Reduction:
    return reduce(read_run("fixtures/campaign/r36ohm.csv", load=36.0), window=5.48)


@pytest.fixture(name="campaign", scope="module")
def _campaign(tmp_path_factory: pytest.TempPathFactory) -> CampaignReduction:
    folder = tmp_path_factory.mktemp("campaign")
    lines = []
    for load in ("9", "18"):
        (folder / f"r{load}.csv").write_bytes(
            Path(f"fixtures/campaign/r{load}ohm.csv").read_bytes()
        )
        lines += ["[[run]]", f'file = "r{load}.csv"', f"load_ohm = {load}"]
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return open_campaign(folder).reduce()


# ----------------------------------------------------------------------------------------- frames
def test_frames_of_a_reduction_are_its_parquet_tables(reduction: Reduction, tmp_path: Path) -> None:
    write_parquet(reduction, tmp_path)
    for table in ("cycles", "bins", "findings"):
        stored = pd.read_parquet(tmp_path / f"r36ohm.csv.{table}.parquet")
        pd.testing.assert_frame_equal(frame(reduction, table), stored)
        pd.testing.assert_frame_equal(reduction.to_pandas(table), stored)


def test_cycles_have_the_numbers_of_the_json(reduction: Reduction) -> None:
    record: dict[str, Any] = msgspec.json.decode(reduction_json(reduction))
    names = [name for name in record["mean"] if name in frame(reduction)]
    for (_, row), cycle in zip(frame(reduction).iterrows(), record["cycles"], strict=True):
        assert [row[name] for name in names] == [cycle[name] for name in names]
        assert row["plateau_force_n"] == cycle["phase_summary"]["payout"]["plateau"]["force_n"]


def test_channels_of_a_run_are_in_si_units_with_the_unit_in_the_name(reduction: Reduction) -> None:
    run = reduction.run
    assert np.array_equal(run.to_pandas()["pressure_pa"], run.channels["pressure"])
    fast = msgspec.structs.replace(
        run, channels={"speed": np.array([math.pi])}, t=np.array([0.0]), fs=1.0
    )
    assert fast.to_pandas()["speed_radps"].tolist() == [math.pi]


def test_a_frame_of_a_run_is_read_as_the_same_run(reduction: Reduction) -> None:
    again = read_run(frame(reduction.run), load=36.0)
    assert again.findings == reduction.run.findings
    for name, x in reduction.run.channels.items():
        assert np.array_equal(again.channels[name], x), name


def test_energies_follow_from_the_samples_of_a_frame(reduction: Reduction) -> None:
    samples = frame(reduction, "channels")
    for one in reduction.cycles:
        part = samples[(samples["cycle"] == one.cycle) & samples["in_window"]]
        assert part["time_s"].min() >= one.window.onset
        assert part["time_s"].max() <= one.window.cutoff
        assert set(part["phase"]) == {"payout"}
        energy = float(np.trapezoid(part["power_line_w"], part["time_s"]))
        assert energy == pytest.approx(
            one.metrics.value("energy_line"), rel=0.02
        )  # without the ends of the window
    spans = samples.groupby(["cycle", "phase"])["time_s"].min()
    assert spans[1, "payout"] == pytest.approx(reduction.cycles[0].phases.onset, abs=0.04)
    assert set(samples.loc[samples["cycle"].isna(), "phase"]) == {""}


def test_frames_of_a_campaign_have_the_means_of_each_run(campaign: CampaignReduction) -> None:
    record = campaign.records["r9.csv"]
    opened = msgspec.structs.replace(
        record, log=msgspec.structs.replace(record.log, load_ohm=None, open_circuit=True)
    )
    both = msgspec.structs.replace(campaign, records={"one": record, "two": opened})
    found = frame(both, "runs_all")
    pd.testing.assert_frame_equal(both.to_pandas(), found[both.to_pandas().columns])
    assert len(both.to_pandas().columns) == RUNS_MAX
    assert found["run"].tolist() == ["one", "two"]
    assert found["load_ohm"].tolist() == [9.0, math.inf]
    assert found["eta_pto"].tolist() == [record.mean["eta_pto"]] * 2
    assert len(frame(both, "cycles")) == 2 * len(record.cycles)


def test_frames_of_a_diagnosis_are_its_json() -> None:
    found = diagnosed("copper")
    record = as_json(found)
    causes = frame(found, "causes")
    assert causes["effect"].tolist() == [
        c["effect"] for c in record["causes"] for _ in c["parameters"]
    ]
    first = next(iter(record["causes"][0]["parameters"].values()))
    shown = ["value", "low", "high", "unit"]
    assert causes.loc[0, shown].tolist() == [first[k] for k in shown]
    places = frame(found, "map")
    assert places["z"].tolist() == pytest.approx(
        [p["z"] for p in record["where"]["map"]], nan_ok=True
    )
    assert set(places.loc[places["channel"] == "force", "unit"]) == {"N"}
    assert len(frame(found, "stability")) == sum(
        len(c.get("stability", [])) for c in record["causes"]
    )


def test_parts_of_a_metric_add_up() -> None:
    found = diagnosed("copper")
    plain = frame(found, "contributions")
    sums = (
        plain.groupby(["run", "metric"])
        .agg({"as_given": "first", "measured": "first", "value": "sum"})
        .dropna()
    )
    gap = sums["measured"] - sums["as_given"]
    assert np.allclose(gap, sums["value"], rtol=1e-9, atol=1e-9 * sums["measured"].abs().max())


RESULTS: dict[str, tuple[Callable[[Reduction, CampaignReduction], Any], int]] = {
    "run": (lambda one, _: one.run, 2767),
    "reduction": (lambda one, _: one, 3),
    "campaign": (lambda _, both: both, 2),
    "diagnosis": (lambda *_: diagnosed("copper"), 1),
    "comparison": (lambda one, _: compare(one, one), 14),
    "check": (lambda *_: open_campaign("fixtures/campaign").check("hsu2026-table2"), 54),
    "audit": (lambda *_: audit("hsu2026-table2"), 1),
    "calibration": (lambda *_: calibrate(read_run("fixtures/campaign/open_circuit.csv")), 4),
    "simulation": (lambda one, _: simulate(one.run), 2767),
}
"""Results of each kind, and the rows of their main tables: samples, cycles, runs, numbers of
causes, metrics, cells, ...
"""


@pytest.mark.parametrize("kind", RESULTS)
def test_every_result_has_a_main_table_and_is_shown_in_a_notebook(
    kind: str, reduction: Reduction, campaign: CampaignReduction
) -> None:
    make, rows = RESULTS[kind]
    found = make(reduction, campaign)
    assert len(found.to_pandas()) == rows
    pd.testing.assert_frame_equal(found.to_pandas(), frame(found))
    assert "<p" in found._repr_html_()


def test_the_numbers_of_the_json_are_in_the_tables_of_check_and_calibration() -> None:
    cells = open_campaign("fixtures/campaign").check("hsu2026-table2").to_pandas()
    within = (cells["measured"] - cells["printed"]).abs() <= cells["tolerance_total"]
    assert within.equals(cells["outcome"] == "ok")
    known = calibrate(read_run("fixtures/campaign/open_circuit.csv"))
    numbers = known.to_pandas("numbers").set_index("name")
    assert {n.name: (n.value, n.low, n.high) for n in known.numbers} == {
        name: (row["value"], row["low"], row["high"]) for name, row in numbers.iterrows()
    }


# --------------------------------------------------------------------------------------- pictures
def test_channels_of_a_run_are_drawn_alone_in_groups_and_together(reduction: Reduction) -> None:
    run = reduction.run
    (force,) = run.plot("force").figure.axes[0].lines
    assert np.array_equal(force.get_ydata(), run.channels["force"])
    assert np.array_equal(force.get_xdata(), run.t)
    electrical = run.plot("electrical").figure.axes
    assert [ax.get_ylabel() for ax in electrical] == ["V", "A"]
    assert len(run.plot().figure.axes) == len(run.channels)


def drawn(picture: Picture, label: str) -> tuple[list[float], list[float]]:
    assert picture.figure is not None
    lines = [line for ax in picture.figure.axes for line in ax.lines]
    line = next(line for line in lines if label in str(line.get_label()))
    return np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist()


def test_a_picture_is_that_of_the_report_and_changes_no_settings(reduction: Reduction) -> None:
    before = dict(mpl.rcParams)
    figures = plt.get_fignums()
    for what in ("flow", "histories", "overlaid", "streams"):
        picture = reduction.plot(what)
        assert picture.id == what
        assert "<svg" in picture._repr_svg_()
    assert reduction.plot().id == "flow"
    assert dict(mpl.rcParams) == before
    assert plt.get_fignums() == figures


def test_powers_are_those_of_the_cycles(reduction: Reduction) -> None:
    watts = (reduction.run.channels["vdc"] * reduction.run.channels["idc"])[reduction.run.t < 35.0]
    assert max(drawn(plot(reduction, "streams"), "gen")[1]) == pytest.approx(np.max(watts))


def test_a_campaign_is_drawn_over_its_loads(campaign: CampaignReduction) -> None:
    means = frame(campaign, "runs").sort_values("load_ohm")
    figure = plot(campaign, "loads").figure
    assert figure is not None
    for ax, field in zip(figure.axes, ("power_gen_w", "eta_pto"), strict=True):
        assert means[field].tolist() in [np.asarray(line.get_ydata()).tolist() for line in ax.lines]


def test_a_diagnosis_has_a_map_and_a_waterfall() -> None:
    found = diagnosed("copper")
    figure = plot(found, "map").figure
    assert figure is not None
    assert len(figure.axes[0].texts) == len(frame(found, "map"))
    assert plot(found).id == "waterfall"


# ------------------------------------------------------------------------------ what is not there
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            lambda r: frame(r, "cycle"),
            r"to_pandas\('cycle'\): no such table; expected one of 'cycles', 'bins'",
        ),
        (
            lambda r: plot(r, "powers"),
            r"plot\('powers'\): no such picture of this result; expected one of 'flow'",
        ),
        (
            lambda r: plot(msgspec.structs.replace(r, cycles=()), "streams"),
            r"plot\('streams'\): the result has nothing to draw",
        ),
        (
            lambda r: frame(r.mean),
            "frame: Metrics has no table.* Audit, Calibration, CampaignReduction",
        ),
        (
            lambda r: plot(r.run, "flow"),
            r"plot\('flow'\): no such picture of this result; expected one of 'history'",
        ),
        (lambda _: plot(audit("hsu2026-table2")), "plot: Audit has no pictures"),
        (lambda r: summary_html(r.mean), "Metrics has no report"),
    ],
)
def test_what_a_result_does_not_have_is_reported(
    reduction: Reduction, wrong: Any, message: str
) -> None:
    with pytest.raises(OptionError, match=message):
        wrong(reduction)
    assert not plt.get_fignums()


def test_notebooks_show_the_summary_table_without_scripts(
    reduction: Reduction, campaign: CampaignReduction
) -> None:
    run = msgspec.structs.replace(reduction.run, name="<script>alert(1)</script>")
    page = msgspec.structs.replace(reduction, run=run)._repr_html_()
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page)
    assert f"{reduction.cycles[0].metrics.value('eta_pto'):.3f}" in " ".join(cells)
    assert "r18.csv" in summary_html(campaign)
    assert "href" not in summary_html(campaign)
    assert "copper" in summary_html(diagnosed("copper"))


def test_a_run_is_a_dataset_of_xarray_with_units_where_that_is_installed() -> None:
    run = read_run("fixtures/campaign/r36ohm.csv")
    if not is_installed("xarray"):
        with pytest.raises(OptionError, match="xarray"):
            run.to_xarray()
        return
    found = run.to_xarray()
    assert {*found.data_vars} == {*run.channels}
    assert {name: found[name].attrs["units"] for name in ("time", "force", "torque")} == {
        "time": "s",
        "force": "N",
        "torque": "N.m",
    }
    assert found["force"].dims == ("time",)
    assert np.array_equal(found["force"].sel(time=run.t[100]), run.channels["force"][100])
