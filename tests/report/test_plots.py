"""Plots of results draw the numbers of the results on the axes that they are given, else on new ones."""

import re
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import msgspec
import numpy as np
import pytest
from diagnosed import diagnosed
from matplotlib.axes import Axes

from winchcascade import CampaignReduction, Reduction, open_campaign, read_run, reduce
from winchcascade.core.errors import OptionError
from winchcascade.report.figures.style import COLOURS

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
        (folder / f"r{load}.csv").write_bytes(Path(f"fixtures/campaign/r{load}ohm.csv").read_bytes())
        lines += ["[[run]]", f'file = "r{load}.csv"', f"load_ohm = {load}"]
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return open_campaign(folder).reduce()


def drawn(ax: Axes, label: str) -> tuple[list[float], list[float]]:
    line = next(line for line in ax.lines if label in str(line.get_label()))
    return np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist()


def test_a_plot_is_drawn_on_the_given_axes_and_changes_no_settings(reduction: Reduction) -> None:
    before = dict(mpl.rcParams)
    _, ax = plt.subplots()
    figures = plt.get_fignums()
    for what in ("power", "history", "speed", "efficiency"):
        ax.clear()
        assert reduction.plot(what, ax=ax) is ax
        assert ax.lines
        assert "(" in ax.get_xlabel() or what == "efficiency"
    assert dict(mpl.rcParams) == before
    assert plt.get_fignums() == figures


def test_efficiencies_and_powers_are_those_of_the_cycles(reduction: Reduction) -> None:
    ax = reduction.plot("efficiency")
    assert isinstance(ax, Axes)
    assert drawn(ax, "pto") == ([1.0, 2.0, 3.0], [c.metrics["eta_pto"] for c in reduction.cycles])
    power = reduction.plot("power")
    assert isinstance(power, Axes)
    assert power.get_title(loc="left") == "Cycle 1"
    assert max(drawn(power, "gen")[1]) == pytest.approx(
        np.max((reduction.run.channels["vdc"] * reduction.run.channels["idc"])[reduction.run.t < 35.0])
    )
    speed = reduction.plot("speed")
    assert isinstance(speed, Axes)
    assert drawn(speed, "line")[1] == [b.power_line for b in reduction.bins]


def test_histories_have_a_panel_for_each_channel_and_one_for_the_powers(reduction: Reduction) -> None:
    axes = reduction.plot("history")
    assert isinstance(axes, np.ndarray)
    assert len(axes) == len(reduction.run.channels) + 1
    assert axes[-1].get_xlabel() == "Time (s)"


def test_a_campaign_is_drawn_over_its_loads(campaign: CampaignReduction) -> None:
    frame = campaign.to_pandas("runs").sort_values("load_ohm")
    for what, field, label in (("efficiency", "eta_pto", "pto"), ("power", "power_gen_w", "gen")):
        ax = campaign.plot(what)  # type: ignore[arg-type]
        assert isinstance(ax, Axes)
        lines = [np.asarray(line.get_ydata()).tolist() for line in ax.lines]
        drawn_lines = ax.lines
        assert frame[field].tolist() in lines, label
    colours = {line.get_color() for line in drawn_lines if len(np.asarray(line.get_xdata())) == 2}
    assert colours == {COLOURS["line"], COLOURS["mech"], COLOURS["gen"]}
    speed = campaign.plot("speed")
    assert isinstance(speed, Axes)
    legend = speed.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["18 Ω", "9 Ω"]


def test_a_diagnosis_has_a_map_and_waterfalls() -> None:
    found = diagnosed("copper")
    ax = found.plot("map")
    assert isinstance(ax, Axes)
    assert len(ax.texts) == len(found.to_pandas("map"))
    many = found.plot("waterfall")
    one = found.plot("waterfall", plt.subplots()[1])
    assert isinstance(one, Axes)
    assert np.ravel(np.array(many, dtype=object)).size == found.to_pandas("contributions")["load_ohm"].nunique()


def test_what_cannot_be_drawn_is_reported(reduction: Reduction) -> None:
    with pytest.raises(
        OptionError, match=r"plot\('powers'\): no such plot of this result; expected one of 'power', 'history'"
    ):
        reduction.plot("powers")  # type: ignore[arg-type]
    bare = msgspec.structs.replace(reduction, bins=())
    with pytest.raises(
        OptionError, match=r"plot\('speed'\): the result has nothing to draw; expected the speed of the gen"
    ):
        bare.plot("speed")
    assert not plt.get_fignums()


def test_notebooks_show_the_summary_table_without_scripts(reduction: Reduction, campaign: CampaignReduction) -> None:
    named = msgspec.structs.replace(
        reduction, run=msgspec.structs.replace(reduction.run, name="<script>alert(1)</script>")
    )
    page = named._repr_html_()
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page)
    assert f"{reduction.cycles[0].metrics.value('eta_pto'):.3f}" in " ".join(cells)
    whole = campaign._repr_html_()
    assert "r18.csv" in whole
    assert "href" not in whole
    assert "Diagnosis of a campaign of copper: explained" in diagnosed("copper")._repr_html_()
