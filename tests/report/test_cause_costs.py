"""What each cause costs, in terminal, JSON and report: one split, the same numbers everywhere."""

import math

import msgspec
import pytest
from diagnosed import diagnosed

from winchcascade.report.cause_costs import (
    cost_lines,
    cost_section,
    cost_tables,
    cost_words,
    load_costs,
    no_energy_words,
    waterfall_figure,
)
from winchcascade.report.diagnosis_text import as_json, diagnosis_text
from winchcascade.report.digits import MINUS
from winchcascade.report.screen import PIPED
from winchcascade.report.style import house_style

ROUNDED = 0.03
"""Sum of what four numbers with two decimals are rounded by. [points]"""


def test_parts_in_the_json_add_up_to_the_difference() -> None:
    record = as_json(diagnosed("copper"))
    metrics = {one["metric"] for one in record["contributions"]}
    assert {"eta_trans", "eta_gen", "eta_pto", "energy_line_j", "power_gen_w", "vdc"} <= metrics
    for one in record["contributions"]:
        total = sum(part["value"] for part in one["parts"])
        assert total == pytest.approx(one["measured"] - one["as_given"], rel=1e-9, abs=1e-9 * abs(one["measured"]))
    first = record["contributions"][0]["parts"][0]
    assert (first["effect"], first["kind"]) == ("copper_heating", "physical")
    assert first["low"] <= first["value"] <= first["high"]
    assert record["causes"][0]["label"] == "Stator resistance"


def test_the_terminal_shows_eta_pto_by_load_in_points() -> None:
    lines = cost_lines(diagnosed("copper"), PIPED)
    assert lines[-1].startswith("4.5 ohm")
    *_, given, copper, tolerances, residual, logged = lines[-1].replace(MINUS, "-").split()
    assert float(given) + float(copper) + float(tolerances) + float(residual) == pytest.approx(
        float(logged), abs=ROUNDED
    )
    assert "resistance" in " ".join(lines[:-2])
    assert lines[-1].replace(MINUS, "-") in diagnosis_text(diagnosed("copper"))


def test_a_narrow_terminal_sums_the_smallest_causes() -> None:
    found = diagnosed("rolloff")
    few = cost_lines(found, 0)
    assert "other" in " ".join(few)
    assert max(map(len, few)) < max(map(len, cost_lines(found, PIPED)))


def test_runs_of_one_load_are_averaged() -> None:
    found = diagnosed("copper")
    twice = msgspec.structs.replace(found, contributions=(*found.contributions, *found.contributions))
    for two, one in zip(load_costs(twice, "eta_pto"), load_costs(found, "eta_pto"), strict=True):
        assert msgspec.structs.astuple(two.parts[0])[2:] == pytest.approx(msgspec.structs.astuple(one.parts[0])[2:])
        assert (two.load, two.as_given) == pytest.approx((one.load, one.as_given))


def test_the_sentence_names_the_load_with_the_largest_difference() -> None:
    text = cost_words(diagnosed("copper"))
    assert text.startswith("At 4.5 Ω η_pto is ")
    assert f"Stator resistance {MINUS}" in text
    assert cost_words(diagnosed("nothing")) == ""


def test_a_sensor_is_said_to_cost_no_energy() -> None:
    found = diagnosed("copper")
    cause = msgspec.structs.replace(found.causes[0], effect="force_zero", stage="sensor")
    words = no_energy_words(msgspec.structs.replace(found, causes=(cause,)))
    assert words == "Force cell zero costs no energy: it changes what is read."


def test_tables_and_figure_show_every_load() -> None:
    found = diagnosed("copper")
    tables = [table for table in cost_tables(found) if table is not None]
    assert [table.id for table in tables] == ["costs-eta-pto", "costs-eta-gen", "costs-eta-trans"]
    assert tables[0].head == ("Part", "Kind", "18 Ω", "4.5 Ω")
    assert [row[0] for row in tables[0].rows] == [
        "nominal [%]", "Stator resistance (copper_heating)", "tolerances", "residual", "log [%]",
    ]  # fmt: skip
    with house_style():
        figure = waterfall_figure(found)
    assert figure is not None
    assert [ax.get_title(loc="left") for ax in figure.axes if ax.get_visible()] == ["18 Ω", "4.5 Ω"]


def test_without_an_efficiency_there_is_no_section() -> None:
    found = diagnosed("copper")
    none = tuple(
        msgspec.structs.replace(one, as_given=math.nan, measured=math.nan, parts=()) for one in found.contributions
    )
    bare = msgspec.structs.replace(found, contributions=none)
    with house_style():
        assert cost_section(bare).blocks == ()
    assert cost_lines(bare, PIPED) == []
    assert "costs " not in diagnosis_text(bare)
