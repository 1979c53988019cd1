"""A cause has one label on all pages, with its identifier behind it; the tile of its cost is the
bar beside it, and the history shows the place that the table calls worst.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from diagnosed import PLANTED, diagnosed
from stated import rows, texts

from winchcascade.report.content import Picture, Report
from winchcascade.report.figures.style import LOAD_COLOURS, load_looks
from winchcascade.report.glossary import typeset
from winchcascade.report.results.diagnosis import diagnosis_report
from winchcascade.rig.effects.catalogue import EFFECTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMED = ("copper", "rolloff")
"""Campaigns of which a cause is named."""


@cache
def report(name: str) -> Report:
    return diagnosis_report(diagnosed(name))


def picture(name: str, which: str) -> Picture:
    return next(one for one in report(name).pictures if one.id == which)


def waterfall(name: str) -> Figure:
    figure = picture(name, "waterfall").figure
    assert figure is not None
    return figure


@pytest.mark.parametrize("name", PLANTED)
def test_an_identifier_stands_in_brackets_behind_its_label(name: str) -> None:
    labels = {
        one: effect.label
        for one, effect in EFFECTS.items()
        if effect.number.rpartition(".")[2] != one  # also the name of a number of the rig file
    }
    known = re.compile(rf"(?<![\w.-])({'|'.join(labels)})(?![\w.])")
    bare = [
        (found[0], text)
        for text in texts(report(name))
        for found in known.finditer(text)
        if not text[: found.start()].endswith(f"{labels[found[0]]} (")
    ]
    assert bare == []


@pytest.mark.parametrize("name", NAMED)
def test_the_cost_of_the_tile_is_the_largest_bar_of_a_cause_in_the_figure_beside_it(
    name: str,
) -> None:
    (ax,) = waterfall(name).axes
    _, *parts, _ = (label.get_text() for label in ax.get_yticklabels())
    bars = dict(zip(parts, (text.get_text().strip() for text in ax.texts[2:]), strict=True))
    (tile,) = (one for one in report(name).tiles if one.name in ("Largest cost", "Largest change"))
    assert typeset(tile.beside.removesuffix(" points")) == bars[tile.value]
    assert tile.about.partition(", ")[2].replace("ohm", "Ω") == ax.get_title(loc="left")
    found = diagnosed(name)
    causes = {found.suspects[cause.effect].label for cause in found.causes}
    sizes = {label: abs(float(bars[label].replace("\u2212", "-"))) for label in causes}
    assert tile.value == max(sizes, key=sizes.__getitem__)


@pytest.mark.parametrize("name", PLANTED)
def test_a_part_has_the_name_of_its_bar_in_the_table_of_costs(name: str) -> None:
    (ax,) = waterfall(name).axes
    labels = {label.get_text() for label in ax.get_yticklabels()}
    shown = [row["part"] for row in rows(report(name), "costs-eta-pto")]
    assert shown
    assert {*shown} == labels


@pytest.mark.parametrize("name", PLANTED)
def test_the_history_is_of_the_run_that_the_table_of_places_calls_worst(name: str) -> None:
    worst = rows(report(name), "places")[0]
    caption = picture(name, "histories").caption
    assert f"({worst['load']})" in caption


def test_a_load_looks_alike_with_and_without_the_others_of_its_kind() -> None:
    loads = [45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    whole, without = load_looks([np.inf, *loads]), load_looks(reversed(loads))
    assert {load: whole[load] for load in loads} == {load: without[load] for load in loads}
    assert len({look.colour for look in whole.values()}) == len(LOAD_COLOURS) + 1
    many = load_looks([float(k) for k in range(1, 40)])
    assert len(set(many.values())) == 41
