"""Symbols of a report: the drawing follows the stages of the rig, and every symbol of the tables is explained."""

import pytest

from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade
from winchcascade.report.figures.style import Format, figure_format, house_style
from winchcascade.report.sheet import Picture, Table
from winchcascade.report.wording import SYMBOL, cascade_figure, cascade_symbols, symbols_section, tex

CASCADES = {
    "paper": PAPER,
    "two": Cascade((BUILT_IN["mech"], BUILT_IN["gen"]), configured=True),
    "four": Cascade(tuple(BUILT_IN[name] for name in ("line", "hyd", "gen", "ac")), configured=True),
}


@pytest.mark.parametrize("name", CASCADES)
@pytest.mark.parametrize("width", [6.7, 3.54])
def test_the_drawing_has_a_box_for_each_stage_and_the_efficiencies_between_them(name: str, width: float) -> None:
    cascade = CASCADES[name]
    with figure_format(Format(width)), house_style():
        figure = cascade_figure(cascade)
    (ax,) = figure.axes
    boxes = sorted((patch.get_x(), patch.get_width()) for patch in ax.patches if patch.get_gid() is None)  # type: ignore[attr-defined]
    assert len([box for box in boxes if box[1] > 0.1]) == len(cascade.stages)
    texts = [text.get_text() for text in ax.texts]
    for stage in cascade.names:
        assert f"{tex(f'energy_{stage}')}, {tex(f'power_{stage}')}" in texts
    assert {tex(eta) for eta in cascade.ratios} <= set(texts)


@pytest.mark.parametrize("name", CASCADES)
def test_no_text_of_the_drawing_leaves_the_figure(name: str) -> None:
    with house_style():
        figure = cascade_figure(CASCADES[name])
        figure.draw_without_rendering()
        whole = figure.bbox
        for text in figure.axes[0].texts:
            extent = text.get_window_extent()
            assert whole.x0 <= extent.x0 < extent.x1 <= whole.x1, text
            assert whole.y0 <= extent.y0 < extent.y1 <= whole.y1, text


def test_symbols_of_own_stages_are_explained() -> None:
    symbols = {one.text: one.meaning for one in cascade_symbols(CASCADES["four"])}
    assert symbols["E_ac"] == "Energy of the AC terminals, over the integration window"
    assert symbols["η_line→hyd"] == "Efficiency: energy of the hydraulic circuit over that of the line"
    assert set(symbols) == {SYMBOL[m] for m in CASCADES["four"].metrics}


def test_the_section_of_a_diagnosis_explains_its_z_and_no_cycles() -> None:
    with house_style():
        section = symbols_section(PAPER, cycles=False, diagnosed=True)
    drawing, table = section.blocks
    assert isinstance(drawing, Picture)
    assert isinstance(table, Table)
    names = [row[0] for row in table.rows]
    assert "z" in names
    assert "E_net" not in names
