"""Figures draw what was reduced, with units on their axes, and turn into SVG that a page can hold several of."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import matplotlib
import msgspec
import numpy as np
import pytest
from winchcascade.report.svg_drawing import svg_text

from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.montecarlo import Uncertainty, uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.figures import reduction_figures as figures
from winchcascade.report.figures.histories import PANELS
from winchcascade.report.figures.style import COLOURS, house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOGS = {
    "clean": "campaign/r36ohm.csv",
    "aborted": "damaged_logs/aborted.csv",
    "no torque": "damaged_logs/no_torque.csv",
    "open circuit": "campaign/open_circuit.csv",
}
DRAWN_LOGS = ("clean", "aborted")
"""Those that are turned into SVG, which takes a second each."""

EPOCH = 1_776_506_400.0

Result = tuple[Reduction, Uncertainty]


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    reductions = {
        name: reduce(read_run(FIXTURES / log, load=float("inf") if name == "open circuit" else None))
        for name, log in LOGS.items()
    }
    return {name: (reduction, uncertainty(reduction)) for name, reduction in reductions.items()}


@pytest.fixture(scope="module")
def clean(results: dict[str, Result]) -> Result:
    return results["clean"]


def drawn(result: Result) -> Iterator[tuple[str, "Figure"]]:
    """Every figure that a log has."""
    reduction, found = result
    powers = figures.powers_of(reduction)
    every = {
        "flow": figures.window_flow(reduction),
        "cycle flow": figures.cycle_flow(reduction),
        "histories": figures.time_histories(reduction, powers),
        "streams": figures.power_streams(reduction, powers),
        "overlaid": figures.overlaid(reduction, powers, None, None),
        "budget": figures.uncertainty_bars(found.budget),
    }
    yield from ((name, figure) for name, figure in every.items() if figure is not None)


@pytest.fixture(scope="module")
def svgs(results: dict[str, Result]) -> dict[str, dict[str, str]]:
    found = {}
    for log in DRAWN_LOGS:
        with house_style():
            found[log] = {name: svg_text(figure, name) for name, figure in drawn(results[log])}
    return found


def line(figure: "Figure", gid: str) -> "Line2D":
    (found,) = (line for ax in figure.axes for line in ax.lines if line.get_gid() == gid)
    return found


@pytest.mark.parametrize("log", LOGS)
def test_every_axis_in_use_has_a_name_or_a_unit(results: dict[str, Result], log: str) -> None:
    for name, figure in drawn(results[log]):
        axes = [ax for ax in figure.axes if ax.axison and ax.get_visible()]
        if name == "histories":  # panels above each other share the time axis
            assert axes[-1].get_xlabel() == "Time (s)"
        elif name != "overlaid":
            assert all(re.search(r"\(.+\)", ax.get_xlabel()) for ax in axes), name
        if name != "budget":
            assert all(ax.get_ylabel() for ax in axes), name


@pytest.mark.parametrize("log", LOGS)
def test_histories_draw_every_channel_with_its_peaks(results: dict[str, Result], log: str) -> None:
    reduction, _ = results[log]
    run, powers = reduction.run, figures.powers_of(reduction)
    figure = figures.time_histories(reduction, powers)
    in_si = {name: factor for name, _, _, factor in PANELS}
    assert set(run.channels) <= set(in_si)
    for name, x in run.channels.items():
        y = np.asarray(line(figure, f"trace-{name}").get_ydata())
        assert [y.min(), y.max()] == pytest.approx([x.min() * in_si[name], x.max() * in_si[name]])
    for stage, x in powers.items():
        y = np.asarray(line(figure, f"trace-power_{stage}").get_ydata())
        assert [y.min(), y.max()] == pytest.approx([x.min(), x.max()])


def test_a_large_force_is_drawn_in_thousands_and_says_so(clean: Result) -> None:
    reduction, _ = clean
    large = {"velocity": reduction.run.channels["velocity"], "force": 20.0 * reduction.run.channels["force"]}
    run = msgspec.structs.replace(reduction.run, channels=large)
    figure = figures.time_histories(msgspec.structs.replace(reduction, run=run), {})
    y = np.asarray(line(figure, "trace-force").get_ydata())
    assert y.max() == pytest.approx(large["force"].max() / 1000.0)
    assert figure.axes[1].get_ylabel().split() == ["Tension", "(kN)"]


def test_a_log_with_seconds_of_an_epoch_is_drawn_from_zero(clean: Result) -> None:
    run = msgspec.structs.replace(clean[0].run, t=clean[0].run.t + EPOCH)
    reduction = reduce(run)
    figure = figures.time_histories(reduction, figures.powers_of(reduction))
    assert figure.axes[-1].get_xlim()[0] == 0.0
    assert f"since {EPOCH + clean[0].run.t[0]:.2f} s" in figure.axes[-1].get_xlabel()
    edges = [line for line in figure.axes[0].lines if str(line.get_gid()).startswith("edge-1")]
    first = reduction.cycles[0].window
    times = sorted(float(np.asarray(edge.get_xdata())[0]) for edge in edges)
    assert times == pytest.approx([first.onset - run.t[0], first.cutoff - run.t[0]])


@pytest.mark.parametrize("log", LOGS)
def test_an_upright_axis_is_labelled_with_its_quantity_and_unit(results: dict[str, Result], log: str) -> None:
    for name, figure in drawn(results[log]):
        for ax in figure.axes if name != "budget" else ():
            if ax.axison and ax.get_visible():
                assert re.fullmatch(r"[A-Z][a-z]+[ \n]\([^()]+\)", ax.get_ylabel()), name


def repaired(figure: "Figure", panel: int) -> list[tuple[float, float]]:
    """Begin and end of the stretches that are marked in a panel."""
    found = [patch for patch in figure.axes[panel].patches if patch.get_gid() == f"repaired-{panel}"]
    corners = np.concatenate([np.asarray(patch.get_path().vertices)[:, 0] for patch in found]) if found else np.empty(0)
    return [(float(part.min()), float(part.max())) for part in corners.reshape(-1, 5)]


def key_of(figure: "Figure") -> list[str]:
    """Entries of the legend above the first panel."""
    legend = figure.axes[0].get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def test_repaired_stretches_are_marked_in_the_panels_of_their_channels_alone() -> None:
    reduction = reduce(read_run(FIXTURES / "damaged_logs" / "dropouts.csv"))
    powers = figures.powers_of(reduction)
    with house_style():
        figure = figures.time_histories(reduction, powers)
    gaps, clock = reduction.run.gaps, reduction.run.gaps["clock"].tolist()
    channels = [name for name, *_ in PANELS if name in reduction.run.channels]
    for panel, name in enumerate(channels):
        marked = repaired(figure, panel)
        for begin, end in [*clock, *gaps.get(name, np.empty((0, 2))).tolist()]:
            assert any(a <= begin and end <= b for a, b in marked), name
        assert sum(b - a for a, b in marked) < 3.0
    force, torque = channels.index("force"), channels.index("torque")
    assert repaired(figure, force) != repaired(figure, torque)
    assert set(repaired(figure, len(channels))) >= {*repaired(figure, force), *repaired(figure, torque)}
    assert "repaired" in key_of(figure)


def test_a_log_without_gaps_has_no_mark_of_repaired_stretches(clean: Result) -> None:
    with house_style():
        figure = figures.time_histories(clean[0], figures.powers_of(clean[0]))
    assert [repaired(figure, panel) for panel in range(len(figure.axes))] == [[]] * len(figure.axes)
    assert "repaired" not in key_of(figure)


def test_phases_are_named_above_the_histories_and_in_the_powers_of_a_cycle(clean: Result) -> None:
    reduction, _ = clean
    powers = figures.powers_of(reduction)
    with house_style():
        above = [
            (text.get_text(), text.get_position()[0])
            for text in figures.time_histories(reduction, powers).axes[0].texts
        ]
        streams = figures.power_streams(reduction, powers)
    wanted = []
    for c in reduction.cycles:
        assert c.phases.hold is not None
        assert c.phases.haul_in is not None
        spans = {
            f"payout {c.cycle}": (c.phases.onset, c.phases.payout_end),
            "hold": c.phases.hold,
            "haul-in": c.phases.haul_in,
        }
        wanted += [(name, 0.5 * sum(span)) for name, span in spans.items()]
    assert [name for name, _ in above] == [name for name, _ in wanted]
    assert [at for _, at in above] == pytest.approx([at for _, at in wanted])
    assert streams is not None
    assert [text.get_text().strip() for text in streams.axes[0].texts] == ["payout", "hold", "haul-in", "window"]


@pytest.mark.parametrize("log", LOGS)
def test_windows_of_all_cycles_are_marked_incomplete_ones_dotted(results: dict[str, Result], log: str) -> None:
    reduction, _ = results[log]
    figure = figures.time_histories(reduction, figures.powers_of(reduction))
    for c in reduction.cycles:
        edges = [line for line in figure.axes[0].lines if re.match(rf"edge-{c.cycle}\b", str(line.get_gid()))]
        assert sorted(float(np.asarray(e.get_xdata())[0]) for e in edges) == [c.window.onset, c.window.cutoff]
        assert {e.get_linestyle() for e in edges} == {"--" if c.complete else ":"}


def test_the_energy_flow_names_energies_losses_and_efficiencies(clean: Result) -> None:
    reduction, _ = clean
    mean = Metrics(energy_line=8000.0, energy_mech=6000.0, energy_gen=4500.0, eta_trans=0.75, eta_gen=0.75, eta_pto=0.5)
    figure = figures.window_flow(msgspec.structs.replace(reduction, mean=mean))
    assert figure is not None
    said = " ".join(text.get_text() for text in figure.axes[0].texts)
    for words in (
        "8000 J",
        "6000 J",
        "4500 J",
        "in the gas: 2000 J, 25.0 %",
        "in the rotor: 1500 J, 18.8 %",
        "= 0.750",
    ):
        assert words in said
    assert len(figure.axes) == 1


def test_the_energy_flow_of_a_whole_cycle_names_what_haul_in_returns(clean: Result) -> None:
    reduction, _ = clean
    mean = Metrics(
        energy_payout=8000.0, energy_returned=2000.0, energy_net=6000.0, energy_gen_cycle=4500.0, eta_net=0.75
    )
    figure = figures.cycle_flow(msgspec.structs.replace(reduction, mean=mean))
    assert figure is not None
    said = " ".join(text.get_text() for text in figure.axes[0].texts)
    for words in ("8000 J", "6000 J", "returned in haul-in: 2000 J, 25.0 %", "lost: 1500 J, 18.8 %", "= 0.750"):
        assert words in said


@pytest.mark.parametrize(
    "mean",
    [
        Metrics(),
        Metrics(energy_line=8000.0),
        Metrics(energy_line=8000.0, energy_mech=9000.0),
        Metrics(energy_line=8000.0, energy_gen=0.0),
        Metrics(energy_line=-1.0, energy_gen=-2.0),
    ],
    ids=["nothing", "one stage", "a gain", "nothing delivered", "negative"],
)
def test_energies_that_do_not_fall_have_no_flow_diagram(clean: Result, mean: Metrics) -> None:
    assert figures.window_flow(msgspec.structs.replace(clean[0], mean=mean)) is None


def test_overlaid_cycles_begin_a_second_before_their_onset_and_name_best_and_worst(clean: Result) -> None:
    reduction, _ = clean
    figure = figures.overlaid(reduction, figures.powers_of(reduction), 3, 1)
    assert figure is not None
    step = 1.0 / reduction.run.fs
    for ax in (ax for ax in figure.axes if ax.get_visible()):
        named = {str(trace.get_label()): trace for trace in ax.lines}
        assert {"best, cycle 3", "worst, cycle 1", "other cycles"} <= set(named)
        for label in ("best, cycle 3", "worst, cycle 1", "other cycles"):
            assert float(np.asarray(named[label].get_xdata())[0]) == pytest.approx(-1.0, abs=step)
    assert figure.legends


def test_of_many_cycles_an_even_selection_is_laid_over_with_best_and_worst(clean: Result) -> None:
    reduction, _ = clean
    cycles = tuple(msgspec.structs.replace(reduction.cycles[k % 3], cycle=k + 1) for k in range(300))
    figure = figures.overlaid(msgspec.structs.replace(reduction, cycles=cycles), {}, 2, 299)
    assert figure is not None
    labels = [str(trace.get_label()) for trace in figure.axes[0].lines]
    assert labels.count("best, cycle 2") == labels.count("worst, cycle 299") == 1
    assert labels.count("other cycles") in range(figures.OVERLAID - 2, figures.OVERLAID + 1)


def test_bars_of_the_uncertainty_fill_the_axis(clean: Result) -> None:
    figure = figures.uncertainty_bars(clean[1].budget)
    assert figure is not None
    (ax,) = figure.axes
    bars: dict[float, list[tuple[float, float]]] = {}
    for bar in ax.patches:
        box = bar.get_path().get_extents(bar.get_patch_transform())
        bars.setdefault(round(0.5 * (box.y0 + box.y1), 6), []).append((box.x0, box.x1))
    assert len(bars) == 7  # three efficiencies of the window, that of whole cycles, three energies
    for parts in bars.values():
        begins, ends = zip(*sorted(parts), strict=True)
        assert [*begins, 100.0] == pytest.approx([0.0, *ends])


def test_a_drift_is_drawn_over_the_cycles_where_there_are_many(clean: Result) -> None:
    reduction, _ = clean
    cycles = tuple(msgspec.structs.replace(reduction.cycles[k % 3], cycle=k + 1) for k in range(9))
    figure = figures.trend(msgspec.structs.replace(reduction, cycles=cycles))
    assert figure is not None
    assert figures.trend(reduction) is None
    dots = {
        str(trace.get_label()): trace for ax in figure.axes for trace in ax.lines if trace.get_linestyle() == "None"
    }
    trans = dots[r"$\eta_\mathrm{trans}$"]
    assert np.asarray(trans.get_xdata()).tolist() == list(range(1, 10))
    assert np.asarray(trans.get_ydata()).tolist() == [c.metrics.eta_trans for c in cycles]


def test_without_powers_there_is_no_figure_of_them(clean: Result) -> None:
    assert figures.power_streams(clean[0], {}) is None


def test_bins_are_drawn_at_their_means(clean: Result) -> None:
    reduction, _ = clean
    figure = figures.power_streams(reduction, figures.powers_of(reduction))
    assert figure is not None
    (means,) = (trace for trace in figure.axes[1].lines if trace.get_label() == r"$P_\mathrm{gen}$")
    assert np.asarray(means.get_ydata()).tolist() == pytest.approx([b.power["gen"] for b in reduction.bins])
    middle = [0.5 * (b.rpm_low + b.rpm_high) for b in reduction.bins]
    assert np.asarray(means.get_xdata()).tolist() == pytest.approx(middle)


@pytest.mark.parametrize("log", DRAWN_LOGS)
def test_references_in_a_drawing_lead_to_ids_of_its_own(svgs: dict[str, dict[str, str]], log: str) -> None:
    for name, text in svgs[log].items():
        root = ElementTree.fromstring(text)
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        ids = {element.attrib["id"] for element in root.iter() if "id" in element.attrib}
        assert all(found.startswith(f"{name}-") for found in ids)
        wanted = re.findall(r'(?:href="|url\()#([^")]+)', text)
        assert wanted
        assert set(wanted) <= ids


@pytest.mark.parametrize("log", DRAWN_LOGS)
def test_no_id_stands_twice_in_a_drawing(svgs: dict[str, dict[str, str]], log: str) -> None:
    for text in svgs[log].values():
        times = Counter(re.findall(r'\bid="([^"]*)"', text))
        assert {found: n for found, n in times.items() if n > 1} == {}


@pytest.mark.parametrize("log", DRAWN_LOGS)
def test_a_drawing_uses_the_named_colours_alone(svgs: dict[str, dict[str, str]], log: str) -> None:
    for name, text in svgs[log].items():
        used = set(re.findall(r"(?:fill|stroke|stop-color|color)(?:: |=\")(#[0-9a-fA-F]{3,8})\b", text))
        assert used, name
        assert used <= set(COLOURS.values()), name


def test_the_same_figure_gives_the_same_bytes(clean: Result, svgs: dict[str, dict[str, str]]) -> None:
    reduction, found = clean
    with house_style():
        for name, figure in (
            ("streams", figures.power_streams(reduction, figures.powers_of(reduction))),
            ("budget", figures.uncertainty_bars(found.budget)),
        ):
            assert figure is not None
            assert svg_text(figure, name) == svgs["clean"][name]


def test_colours_are_distinguished_and_stand_for_one_name_each() -> None:
    assert len(set(COLOURS.values())) == len(COLOURS)
    light = [
        sum(w * int(COLOURS[n][k : k + 2], 16) for w, k in ((0.3, 1), (0.59, 3), (0.11, 5)))
        for n in ("line", "mech", "gen")
    ]
    assert light == sorted(light)  # from dark to light, so that a grey print tells them apart


def test_the_house_style_leaves_no_trace_in_the_users_settings() -> None:
    with matplotlib.rc_context({"lines.linewidth": 7.0, "svg.fonttype": "none"}):
        before = dict(matplotlib.rcParams)
        with house_style():
            assert matplotlib.rcParams["lines.linewidth"] != 7.0
        assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("log", ["clean", "aborted"])
def test_what_shades_mean_stands_beside_the_title_not_on_it(results: dict[str, Result], log: str) -> None:
    reduction = results[log][0]
    with house_style():
        figure = figures.time_histories(reduction, figures.powers_of(reduction))
        figure.draw_without_rendering()
        for ax in (figure.axes[0], figure.axes[-1]):
            key = ax.get_legend()
            assert key is not None
            title = ax._left_title  # type: ignore[attr-defined]
            assert key.get_window_extent().x0 > title.get_window_extent().x1


def test_the_flow_shows_energies_as_the_tables_do(clean: Result) -> None:
    figure = figures.window_flow(clean[0], {"energy_line": "7110"})
    assert figure is not None
    texts = " ".join(text.get_text() for text in figure.axes[0].texts)
    assert "= 7110 J" in texts
