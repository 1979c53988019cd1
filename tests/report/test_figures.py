"""Figures draw what was reduced, with names or units on their axes and no text over another."""

from pathlib import Path

import matplotlib
import msgspec
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
from winchcascade.report.figures import reduction_figures as figures
from winchcascade.report.figures.histories import PANELS, history_figure, log_history, powers_of
from winchcascade.report.figures.style import COLOURS, drawn, house_style, label_panel, panel_figure

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOGS = {
    "clean": "campaign/r36ohm.csv",
    "aborted": "damaged_logs/aborted.csv",
    "no torque": "damaged_logs/no_torque.csv",
    "open circuit": "campaign/open_circuit.csv",
}


Result = tuple[Reduction, Uncertainty]


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    reductions = {
        name: reduce(
            read_run(FIXTURES / log, load=float("inf") if name == "open circuit" else None)
        )
        for name, log in LOGS.items()
    }
    return {name: (reduction, uncertainty(reduction)) for name, reduction in reductions.items()}


@pytest.fixture(scope="module")
def clean(results: dict[str, Result]) -> Result:
    return results["clean"]


def time_histories(reduction: Reduction) -> Figure:
    return history_figure(log_history(reduction))


@pytest.mark.parametrize("log", LOGS)
def test_histories_draw_every_channel_with_its_peaks(results: dict[str, Result], log: str) -> None:
    reduction, _ = results[log]
    run, powers = reduction.run, powers_of(reduction)
    figure = time_histories(reduction)
    in_si = {name: factor for name, _, _, factor in PANELS}
    wanted = [[run.channels[name] * in_si[name]] for name in in_si if name in run.channels] + [
        [*powers.values()]
    ]
    assert set(run.channels) <= set(in_si)
    for ax, signals in zip(figure.axes, wanted, strict=True):
        for line, x in zip(ax.lines, signals, strict=True):
            y = np.asarray(line.get_ydata())
            assert [y.min(), y.max()] == pytest.approx([x.min(), x.max()])


def edges(ax: Axes) -> dict[float, str]:
    """Instants of the dashed lines of a panel, and the pattern of each."""
    return {
        float(segment[0][0]): str(np.asarray(lines.get_linestyle(), dtype=object)[0])
        for lines in ax.collections
        if isinstance(lines, LineCollection)
        for segment in lines.get_segments()
    }


@pytest.mark.parametrize("log", LOGS)
def test_windows_of_all_cycles_are_marked_incomplete_ones_otherwise(
    results: dict[str, Result], log: str
) -> None:
    reduction, _ = results[log]
    found = edges(time_histories(reduction).axes[0])
    assert sorted(found) == sorted(
        e for c in reduction.cycles for e in (c.window.onset, c.window.cutoff)
    )
    patterns = {
        complete: {found[c.window.onset] for c in reduction.cycles if c.complete is complete}
        for complete in (True, False)
    }
    assert not patterns[True] & patterns[False]


def repaired(ax: Axes) -> list[tuple[float, float]]:
    """Begin and end of the stretches that are marked in a panel."""
    colour, found = matplotlib.colors.to_rgba(COLOURS["repaired"]), []
    for bars in ax.collections:
        face = np.asarray(bars.get_facecolor()).ravel()
        if isinstance(bars, PolyCollection) and len(bars.get_paths()) and tuple(face[:4]) == colour:
            corners = [np.asarray(path.vertices)[:, 0] for path in bars.get_paths()]
            found += [(float(x.min()), float(x.max())) for x in corners]
    return found


def test_repaired_stretches_are_marked_in_the_panels_of_their_channels_alone(clean: Result) -> None:
    reduction = reduce(read_run(FIXTURES / "damaged_logs" / "dropouts.csv"))
    figure = time_histories(reduction)
    gaps, clock = reduction.run.gaps, reduction.run.gaps["clock"].tolist()
    channels = [name for name, *_ in PANELS if name in reduction.run.channels]
    for ax, name in zip(figure.axes, channels, strict=False):
        marked = repaired(ax)
        for begin, end in [*clock, *gaps.get(name, np.empty((0, 2))).tolist()]:
            assert any(a <= begin and end <= b for a, b in marked), name
        assert sum(b - a for a, b in marked) < 3.0
    force, torque = (repaired(figure.axes[channels.index(name)]) for name in ("force", "torque"))
    assert force != torque
    assert {*repaired(figure.axes[-1])} >= {*force, *torque}
    assert not any(repaired(ax) for ax in time_histories(clean[0]).axes)


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


def test_means_of_powers_are_drawn_over_the_speed(clean: Result) -> None:
    reduction, _ = clean
    assert figures.power_streams(reduction, {}) is None
    figure = figures.power_streams(reduction, powers_of(reduction))
    assert figure is not None
    (means,) = (line for line in figure.axes[1].lines if line.get_label() == r"$P_\mathrm{gen}$")
    assert np.asarray(means.get_ydata()).tolist() == pytest.approx(
        [b.mean["gen"] for b in reduction.bins]
    )
    middle = [0.5 * (b.rpm_low + b.rpm_high) for b in reduction.bins]
    assert np.asarray(means.get_xdata()).tolist() == pytest.approx(middle)


@pytest.mark.parametrize("ends", [(0.0, 3.5e7), (25.0001, 25.0002), (0.0, 3e-7)])
def test_numbers_of_an_axis_are_in_full_and_leave_the_place_of_the_title_alone(
    ends: tuple[float, float],
) -> None:
    with house_style():
        figure, (ax,) = panel_figure(2.0)
        ax.plot(ends)
        label_panel(ax, "a", "Pressure", unit="Pa")
    drawn(figure)
    shown = [
        float(label.get_text().replace("\N{MINUS SIGN}", "-")) for label in ax.get_yticklabels()
    ]
    assert shown == pytest.approx(ax.get_yticks().tolist(), abs=1e-9)
    assert ax.yaxis.get_offset_text().get_text() == ""


def test_the_house_style_leaves_no_trace_in_the_users_settings() -> None:
    with matplotlib.rc_context({"lines.linewidth": 7.0, "svg.fonttype": "none"}):
        before = dict(matplotlib.rcParams)
        with house_style():
            assert matplotlib.rcParams["lines.linewidth"] != 7.0
        assert dict(matplotlib.rcParams) == before
