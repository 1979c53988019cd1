"""What the figures of a diagnosis show is what was computed: recomputed here block by block."""

from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.diagnosis.block_series import series, sides
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report.cause_costs import waterfall_figure
from winchcascade.report.diagnosis_figures import (
    error_figure,
    error_panels,
    gap_map,
    history,
    over_speed_figure,
    stage_map,
)
from winchcascade.report.figures.style import house_style
from winchcascade.report.gap_words import signed

ALL = ["copper", "rolloff", "nothing", "outsider"]


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    with house_style():
        yield


# ------------------------------------------------------------------------------------------------------------- the map
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
    names = [text.get_text() for text in stages.axes[0].get_yticklabels()]
    assert names[0] == "restoring: pressure, payout"
    assert len(names) == len({(place.stage, place.phase) for place in found.stages})


# ------------------------------------------------------------------------------------------------- time, speed, current
@pytest.mark.parametrize("name", ALL)
def test_every_figure_has_units_on_its_axes(name: str) -> None:
    found = diagnosed(name)
    both = sides(found)
    for figure in (
        history(found, both, 0, "log"),
        over_speed_figure(found, both, "log"),
        error_figure(found, both, "log"),
    ):
        assert figure is not None
        labels = " ".join(ax.get_xlabel() + ax.get_ylabel() for ax in figure.axes)
        assert "(s)" in labels or "(rpm)" in labels or "(A)" in labels
        assert all(ax.get_ylabel() for ax in figure.axes)


def test_the_history_draws_logged_minus_simulated() -> None:
    found = diagnosed("copper")
    both = sides(found)
    figure = history(found, both, 1, "log")
    assert figure is not None
    one = series(found, both, 1, "vdc")
    ax = figure.axes[CHANNELS.index("vdc")]
    assert both.after is not None
    assert one.after is not None
    before, after = ax.lines
    assert np.allclose(before.get_ydata(), one.logged - one.before, equal_nan=True)
    assert np.allclose(after.get_ydata(), one.logged - one.after, equal_nan=True)


def test_the_labels_of_the_history_stay_on_the_figure() -> None:
    found = diagnosed("copper")
    figure = history(found, sides(found), 1, "log")
    assert figure is not None
    figure.draw_without_rendering()
    assert all(ax.yaxis.label.get_window_extent().x0 > 0.0 for ax in figure.axes)


def test_errors_are_drawn_over_current_and_over_what_the_gap_depends_on() -> None:
    assert error_panels(diagnosed("copper")) == ["idc", "vdc"]
    assert error_panels(diagnosed("nothing")) == ["idc"]


# ---------------------------------------------------------------------------------------------------------- the costs
def test_the_waterfall_shows_three_loads_at_most_with_their_intervals() -> None:
    found = diagnosed("copper")
    more = [msgspec.structs.replace(c, load=(c.load or 0.0) + 100.0 * k) for k in range(3) for c in found.contributions]
    for one, loads in ((found, 2), (msgspec.structs.replace(found, contributions=tuple(more)), 3)):
        figure = waterfall_figure(one)
        assert figure is not None
        shown = [ax for ax in figure.axes if ax.get_visible()]
        assert len(shown) == loads
        for ax in shown:
            low, high = ax.get_xlim()
            assert all(low <= x <= high for line in ax.lines for x in np.asarray(line.get_xdata()).tolist())
