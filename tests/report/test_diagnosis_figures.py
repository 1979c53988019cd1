"""What the figures of a diagnosis show are the numbers of the result."""

import json
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.diagnosis.diagnosis_result import RunValue, Stability
from winchcascade.diagnosis.explain.figure_data import block_table, largest_gap, worst_costs
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
from winchcascade.diagnosis.explain.model_comparison import COMPARED
from winchcascade.diagnosis.fit.block_means import PAYOUT
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.report.diagnosis_names import signed
from winchcascade.report.figures.diagnosis_figures import (
    cycle_history,
    error_figure,
    gap_map,
    profile_figure,
    stability_figure,
    stage_map,
    waterfall_figure,
)
from winchcascade.report.figures.histories import history_figure, history_json
from winchcascade.report.figures.style import house_style
from winchcascade.report.results.validation_report import FILED, errors_figure

ALL = ["copper", "rolloff", "nothing", "outsider"]


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    with house_style():
        yield


@pytest.mark.parametrize("name", ALL)
def test_the_maps_have_a_number_for_every_place(name: str) -> None:
    found = diagnosed(name)
    places, stages = gap_map(found), stage_map(found)
    assert places is not None
    assert stages is not None
    for figure, shown in ((places, found.places), (stages, found.stages)):
        texts = [text.get_text() for text in figure.axes[0].texts]
        assert sorted(texts) == sorted(signed(place.z) for place in shown)
    bold = sum(text.get_fontweight() == "bold" for text in places.axes[0].texts)
    assert bold == sum(abs(place.z) > STANDS_OUT for place in found.places)
    names = stages.axes[0].get_yticklabels()
    assert len(names) == len({(place.stage, place.phase) for place in found.stages})


@pytest.mark.parametrize(("name", "sides"), [("copper", 2), ("nothing", 1)])
def test_errors_are_those_of_the_blocks_and_smaller_after_the_causes(name: str, sides: int) -> None:
    table = block_table(diagnosed(name))
    figure = error_figure(diagnosed(name), table, "log")
    assert figure is not None
    lines = [np.asarray(line.get_ydata()) for line in figure.axes[0].lines]
    assert len([line for line in lines if np.isfinite(line).any()]) == sides
    own = table[(table.channel == "idc") & (table.phase == PAYOUT)]
    assert lines[0] == pytest.approx((own.logged - own.before).to_numpy())
    if sides == 2:
        assert np.std(lines[1]) < 0.5 * np.std(lines[0])


def test_errors_of_a_validation_stand_with_their_intervals_before_and_after() -> None:
    rows = [row for row in diagnosed("copper").validation if row.quantity in FILED]
    figure = errors_figure(rows)
    quantities = [name for name in FILED if any(row.quantity == name for row in rows)]
    assert len(figure.axes) == len(quantities)
    for ax, name in zip(figure.axes, quantities, strict=True):
        own = [row for row in rows if row.quantity == name]
        sides = [one for row in own for one in (row.before, row.after) if one is not None]
        drawn = [y for line in ax.lines[1:] for y in np.asarray(line.get_ydata()).tolist()]
        assert sorted(drawn) == pytest.approx(sorted(one.error for one in sides))
        spans = [line[:, 1].tolist() for lines in ax.collections for line in lines.get_segments()]  # type: ignore[attr-defined]
        assert sorted(spans) == [
            pytest.approx(x) for x in sorted([one.low, one.high] for one in sides)
        ]


# ------------------------------------------------------------------------------------- the causes
def test_the_waterfall_is_that_of_the_load_with_the_largest_gap_and_ends_at_the_log() -> None:
    found = diagnosed("copper")
    figure, worst = waterfall_figure(found, "log"), worst_costs(found)
    assert figure is not None
    assert worst is not None
    (ax,) = figure.axes
    low, high = ax.get_xlim()
    assert all(low <= x <= high for line in ax.lines for x in np.asarray(line.get_xdata()).tolist())
    last = ax.patches[1]
    assert last.get_x() + last.get_width() == pytest.approx(worst.measured)  # type: ignore[attr-defined]


def test_the_roll_off_is_drawn_where_it_is_a_cause() -> None:
    assert profile_figure(diagnosed("copper")) is None
    assert profile_figure(diagnosed("rolloff")) is not None


def test_the_numbers_run_by_run_are_those_of_the_result() -> None:
    found = diagnosed("copper")
    runs = (RunValue(0, 0.3, 0.28, 0.32), RunValue(1, 0.5, 0.48, 0.52))
    cause = msgspec.structs.replace(found.causes[0], stability=Stability(runs, ()))
    figure = stability_figure(msgspec.structs.replace(found, causes=(cause,)))
    assert figure is not None
    drawn = np.asarray(figure.axes[0].lines[-1].get_ydata())
    assert drawn == pytest.approx([30.0, 50.0])
    assert stability_figure(diagnosed("nothing")) is None


# -------------------------------------------------------------------------------------- the cycle
@pytest.mark.parametrize(("name", "curves"), [("copper", 3), ("nothing", 2)])
def test_page_and_print_get_every_channel_of_the_cycle(name: str, curves: int) -> None:
    found = diagnosed(name)
    item = largest_gap(found, block_table(found))
    assert item is not None
    record: dict[str, Any] = json.loads(history_json(cycle_history(found, item, "log")))
    assert (
        len(record["rows"])
        == len(history_figure(cycle_history(found, item, "log")).axes)
        == len(CHANNELS)
    )
    for k, (channel, row) in enumerate(zip(CHANNELS, record["rows"], strict=True)):
        assert len(row["series"]) == curves
        for one, side in zip(row["series"], item.sides, strict=True):
            np.testing.assert_allclose(
                one["values"], side[:, k] * COMPARED[channel], rtol=1e-5, atol=1e-9
            )
    np.testing.assert_allclose(record["t"], item.t, atol=1e-4)
    assert record["spans"] == [{"from": 0.0, "to": item.payout_end, "colour": "payout"}]
