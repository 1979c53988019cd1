"""Figures of a campaign of many logs: each load once in the legend, nothing beyond the edges,
nothing over another.
"""

import itertools

import pytest
from layout import misplaced
from summaries import run

from winchcascade.reduction.campaign_record import LogSummary
from winchcascade.report.figures.style import SHORT, cut_apart, house_style
from winchcascade.report.results.campaign import over_load, repeated

LOADS: dict[str, list[float | None]] = {
    "twice": [30.0, 30.0, 15.0, 15.0, 8.0],
    "forty": [(45.0, 36.0, 27.0, 18.0, 9.0)[k % 5] for k in range(40)],
    "twenty": [64.15, 54.85, 46.85, 40.05, 34.25, 29.25, 25.0, 21.35, 18.25, 15.6, 13.35, 11.4, 9.75, 8.3, 7.1, 6.05, 5.2, 4.4,
               3.8, 3.2],
    "unknown": [None] * 20,
    "one": [18.0],
}  # fmt: skip


def logs(kind: str) -> list[LogSummary]:
    names = (f"2026-03-{k:02d}_trial_of_the_winch.csv" for k in itertools.count(1))
    return [run(name, load, 0.7, 0.01) for name, load in zip(names, LOADS[kind], strict=False)]


@pytest.mark.parametrize("kind", LOADS)
def test_no_text_lies_over_another(kind: str) -> None:
    runs = logs(kind)
    with house_style():
        figure = over_load(runs)
        assert figure is not None
        assert misplaced(figure) == []


def test_the_line_over_the_loads_goes_through_the_mean_of_each() -> None:
    runs = [
        run("a", 30.0, 0.7, 0.01),
        run("b", 15.0, 0.6, 0.01),
        run("c", 30.0, 0.8, 0.01),
        run("d", 15.0, None, None),
    ]
    assert repeated(runs)
    assert not repeated(runs[:2])
    with house_style():
        figure = over_load(runs)
        assert figure is not None
        means = [
            line
            for line in figure.axes[1].lines
            if line.get_linestyle() == "-" and len(line.get_xdata()) == 2  # type: ignore[arg-type]
        ]
    (line,) = means
    assert list(line.get_xdata()) == [15.0, 30.0]  # type: ignore[arg-type]
    assert list(line.get_ydata()) == pytest.approx([0.6, 0.75])  # type: ignore[arg-type]


def test_names_are_cut_where_it_leaves_them_apart() -> None:
    names = [f"2026-03-{k:02d}_trial_of_the_winch_r9ohm.csv" for k in range(1, 31)]
    cut = cut_apart(names)
    assert len(set(cut)) == len(names)
    assert max(len(name) for name in cut) == SHORT
    alike = [f"{'x' * 30}{k:02d}{'y' * 30}" for k in range(20)]
    assert len(set(cut_apart(alike))) == len(alike)
    assert cut_apart(["a.csv", "a.csv"]) == ["a.csv", "a.csv"]
